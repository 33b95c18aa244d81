# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can record``: the frames of buses, written to files; and listening to them."""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
import math
from pathlib import Path
import sys
from typing import Any, TextIO

from drive_can_bridge.cli.command import (
    above_zero, add_params_file, add_seconds, complain, FAILED, output_path, print_json,
    WrongUsage)
from drive_can_bridge.clock import Clock, Mailbox
from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.core.frame import bits_on_bus, Record, RecordKind, STUFFING
from drive_can_bridge.exchange.one_master import END_FIRST, Ownership
from drive_can_bridge.trace.channels import labels
from drive_can_bridge.trace.formats import check_writable, LOSSES, UnknownFormat, WRITABLE
from drive_can_bridge.trace.writers import TraceWriter
from drive_can_bridge.transport.tap import QUEUE_MAX, Tap

#: s between two looks at the clock while nothing arrives
_PATIENCE = 0.05


class Taps:
    """
    All buses of a file, recorded until closed; entries come out in the order they arrived.

    :raises DriveCanError: a bus that cannot be opened.
    """

    def __init__(self, configuration: BridgeConfiguration, clock: Clock) -> None:
        self._now = clock.now
        self._queue: Mailbox[Record] = Mailbox(clock, QUEUE_MAX)
        self.taps: list[Tap] = []
        # nothing is sent: only serial ports, which one process can read, are locked
        self._ownership = Ownership([(bus, ()) for bus in configuration.buses.values()],
                                    'drive_can listening', END_FIRST)
        channels = labels(configuration.buses.values())
        try:
            for bus in configuration.buses.values():
                self.taps.append(Tap(bus, channels[bus.name], self._queue, complain,
                                     clock))
        except BaseException:
            self.close()
            raise

    def records(self, seconds: float) -> Iterator[Record | float]:
        """Yield entries for so long; now and then, without any, the time up to which none came."""
        end = self._now() + seconds
        while self._now() < end:
            # read before the queue: what was received until then is in it, or was taken out of it
            heard_until = min(tap.heard_until for tap in self.taps)
            try:
                yield self._queue.get(self._now() + _PATIENCE)
            except TimeoutError:
                yield heard_until
        while True:     # what arrived in time
            try:
                yield self._queue.get(-math.inf)
            except TimeoutError:
                return

    @property
    def code(self) -> int:
        """The exit code: 1 where a bus was lost meanwhile."""
        return FAILED if any(tap.was_down for tap in self.taps) else 0

    def close(self) -> None:
        """Stop listening; print what could not be taken."""
        for tap in self.taps:
            tap.close()
            if tap.lost:
                complain(command_sentences.record_lost(bus=tap.bus.name, lost=tap.lost))
        self._ownership.release()


#: s between two looks at counts and file size
_LOOK_PERIOD = 1.0
_MEGABYTE = 1_000_000


def define(parser: ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'Listen to all buses of a parameter file and write every frame to a file, '
        'with direction and error frames, until SIGINT or SIGTERM. Sends nothing; on '
        'SocketCAN it works beside a running bridge.')
    parser.epilog = (
        f'Formats, by suffix: {", ".join(WRITABLE)}. Only .log, the format of candump, '
        'loses nothing. Exit code 1: a bus was lost meanwhile; all else is in the trace.')
    parser.add_argument('-o', '--output', metavar='FILE', type=output_path, required=True,
                        help='the trace; an existing file, or what --rotate has made of it, is '
                             'replaced')
    add_params_file(parser, 'parameter file of the bridge: names the buses')
    add_seconds(parser)
    parser.add_argument('--rotate', metavar='MB', type=above_zero,
                        help='begin a new file when one has that size: FILE_000, FILE_001, …')
    parser.add_argument('--wireshark', action='store_true',
                        help='write a .log that Wireshark opens: without directions')
    parser.add_argument('--json', action='store_true',
                        help='at the end, a JSON document for each bus: bus, file (the last), '
                             'files (how many), frames, sent, error_frames, load_percent, seconds')


def run(args: Namespace) -> int:
    """
    Record until a signal.

    :return: 0; 1 where a bus was lost meanwhile.
    :raises WrongUsage: a suffix that cannot be written.
    :raises DriveCanError: a parameter file with problems, a bus that cannot be opened.
    :raises OSError: a file cannot be read or written.
    """
    configuration = configuration_from_file(args.params_file)
    buses = list(configuration.buses.values())
    try:
        check_writable(args.output, len(buses))
    except UnknownFormat as error:
        raise WrongUsage(str(error)) from None
    if args.wireshark and args.output.suffix.lower() != '.log':
        raise WrongUsage(command_sentences.wireshark_for_log(suffix=args.output.suffix))
    if args.wireshark:
        complain(command_sentences.wireshark_loses())
    for loss in LOSSES.get(args.output.suffix.lower(), ()):
        complain(command_sentences.suffix_loses(suffix=args.output.suffix, loss=loss))
    status = _Status(sys.stderr)
    with closing(Taps(configuration, args.clock)) as taps:      # before a file is replaced
        channels = labels(buses)
        counters = {channels[bus.name]: _Counter(bus.name, bus.bitrate, args.clock.now)
                    for bus in buses}
        output = _Rotating(args.output, list(counters), args.rotate,
                           directions=not args.wireshark)
        try:
            _record(taps.records(args.seconds), args.clock, output, counters, status)
        except KeyboardInterrupt:
            pass
        finally:
            status.clear()
            for counter in counters.values():
                counter.end()
            output.close()
    for counter in counters.values():
        if args.json:
            print_json(counter.document(output))
        else:
            print(counter.line(output))
    return taps.code


def _record(records: Iterator[Record | float], clock: Clock, output: '_Rotating',
            counters: dict[str, '_Counter'], status: '_Status') -> None:
    look_at = clock.now() + _LOOK_PERIOD
    for record in records:
        if not isinstance(record, float):
            output.write(record)
            counters[str(record.channel)].take(record)
        now = clock.now()
        if now >= look_at:
            look_at = now + _LOOK_PERIOD
            output.look()
            status.show('  '.join(counter.status() for counter in counters.values()))


class _Counter:
    """Counts what was recorded of one bus."""

    def __init__(self, name: str, bitrate: int, now: Callable[[], float]) -> None:
        self._now = now
        self._name = name
        self._bitrate = bitrate
        self._began = self._now()
        self._seconds = 0.0
        self._frames = self._sent = self._error_frames = 0
        self._bits = self._bits_shown = 0
        self._shown_at = self._began

    def take(self, record: Record) -> None:
        """Count an entry."""
        if record.kind is RecordKind.ERROR:
            self._error_frames += 1
            return
        self._frames += 1
        self._sent += record.sent is True
        self._bits += bits_on_bus(len(record.data), record.extended)

    def status(self) -> str:
        """Return what was recorded so far, and the load of the bus now."""
        now = self._now()
        load = self._load(self._bits - self._bits_shown, now - self._shown_at)
        self._bits_shown, self._shown_at = self._bits, now
        return (f'{self._name}: {self._frames} frames, {self._error_frames} error frames, '
                f'load {load:.1f} %')

    def end(self) -> None:
        """Stop the time; writing may still take a while."""
        self._seconds = self._now() - self._began

    def line(self, output: '_Rotating') -> str:
        """Return the sums for people."""
        return (f'{self._name}: {self._frames} frames ({self._sent} sent by this machine), '
                f'{self._error_frames} error frames, {self._seconds:.1f} s, '
                f'load {self._load(self._bits, self._seconds):.1f} %: {output.names}')

    def document(self, output: '_Rotating') -> dict[str, Any]:
        """Return the sums for programs."""
        return {
            'bus': self._name, 'file': str(output.last), 'files': output.count,
            'frames': self._frames, 'sent': self._sent, 'error_frames': self._error_frames,
            'seconds': round(self._seconds, 3),
            'load_percent': round(self._load(self._bits, self._seconds), 1)}

    def _load(self, bits: int, seconds: float) -> float:
        return 100.0 * STUFFING * bits / (max(seconds, 1e-3) * self._bitrate)


class _Rotating:
    """
    One trace file, or several of limited size.

    :ivar count: how many there are.
    """

    def __init__(self, path: Path, channels: list[str], megabytes: float | None, *,
                 directions: bool) -> None:
        self._directions = directions
        self._path = path
        self._channels = channels
        self._limit = None if megabytes is None else megabytes * _MEGABYTE
        self.count = 1
        if self._limit is not None:
            self._remove_last_recording()
        self._writer = self._open()
        self._full = False

    def _open(self) -> TraceWriter:
        path = self._path if self._limit is None else self._part(self.count - 1)
        return TraceWriter(path, self._channels, directions=self._directions)

    def _part(self, number: int) -> Path:
        return self._path.with_name(f'{self._path.stem}_{number:03d}{self._path.suffix}')

    def _remove_last_recording(self) -> None:
        """Remove all parts of the last recording: leftovers would look like ours."""
        number = 0
        while (part := self._part(number)).is_file():
            part.unlink()
            number += 1

    @property
    def last(self) -> Path:
        """The file that is written, or was last."""
        return self._writer.path

    @property
    def names(self) -> str:
        """The file, or how many there are."""
        if self._limit is None:
            return str(self.last)
        if self.count == 1:
            return f'{self.last} is the only file'
        return f'{self.last} is the last of {self.count} files'

    def write(self, record: Record) -> None:
        """Write an entry, into a new file when the last one is large enough."""
        if self._full:
            self.count += 1
            self._writer = self._open()
            self._full = False
        self._writer.write(record)

    def look(self) -> None:
        """End this file when it is large enough; else flush it."""
        if self._full:
            return
        if self._limit is not None and self._writer.size >= self._limit:
            self._writer.close()
            self._full = True
        else:
            self._writer.flush()

    def close(self) -> None:
        """Finish the file."""
        if not self._full:
            self._writer.close()


class _Status:
    """A line that is overwritten again and again; in a terminal only."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream if stream.isatty() else None
        self._width = 0

    def show(self, text: str) -> None:
        """Replace the line."""
        self._write(f'\r{text.ljust(self._width)}')
        self._width = len(text)

    def clear(self) -> None:
        """Erase the line."""
        if self._width:
            self._write(f'\r{" " * self._width}\r')

    def _write(self, text: str) -> None:
        if self._stream is not None:
            with suppress(OSError):     # the terminal is gone; the trace is to be complete
                self._stream.write(text)
                self._stream.flush()
