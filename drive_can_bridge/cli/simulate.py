# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``drive_can simulate``: simulate every drive of a bridge parameter file on its buses.

Standard output has first the end points, one line per bus, then what the drives do. Standard input
takes faults while the drives run (:class:`Console`).
"""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager, ExitStack, suppress
from dataclasses import dataclass, replace
import os
from pathlib import Path
import select
import signal
import sys
import threading
from typing import TextIO

from drive_can_bridge.cli.command import add_params_file, bitrate, FAILED, of_drive, WrongUsage
from drive_can_bridge.clock import Clock
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.configuration import BridgeConfiguration, BusConfiguration
from drive_can_bridge.core.errors import BusMisconfigured, BusUnavailable, ValueRefused
from drive_can_bridge.exchange.one_master import END_FIRST, InUse, Ownership
from drive_can_bridge.process.critical_sections import handled
from drive_can_bridge.process.locks import Held, HostLock
from drive_can_bridge.simulation.cia402 import object_text, parse_objects, SimulatedServoDrive
from drive_can_bridge.simulation.cia402_plant import Habits
from drive_can_bridge.simulation.faults import Fault, parse_fault, usage_lines
from drive_can_bridge.simulation.registers import Mechanics
from drive_can_bridge.simulation.simulation import (
    PlayedDrive, Say, ShowFrame, SIMULATED_DRIVES, Simulation)
from drive_can_bridge.simulation.terminal import SlcanTerminal
from drive_can_bridge.transport.adapters import check_interface

_CHUNK = 4096
_LINE_MAX = 1000
#: s between two looks at the threads
_LOOK_PERIOD = 0.5
#: families whose drives may lack objects, and have habits
_SERVOS = [name for name, kind in SIMULATED_DRIVES.items()
           if issubclass(kind, SimulatedServoDrive)]


class Console:
    """
    Runs lines of standard input.

    ``conveyor late=0.15 drop=2`` plays faults, ``conveyor`` shows what the drive is doing.

    :param say: prints an answer.
    :param complain: prints one line per invalid line.
    """

    def __init__(self, simulation: Simulation, *, say: Say, complain: Say) -> None:
        self._drives = simulation.drives
        self._say = say
        self._complain = complain

    def obey(self, line: str) -> None:
        """Run one line. An empty one does nothing."""
        words = line.split()
        if not words:
            return
        told: list[str] = []
        if words == ['help']:
            told = help_lines()
        elif words in (['list'], ['status']):
            for drive in self._drives.values():
                told += describe(drive)[:1 if words == ['list'] else 2]
        elif words[0] not in self._drives:
            self._complain(command_sentences.no_simulated_drive(
                word=words[0], drives=', '.join(self._drives)))
        elif len(words) == 1:
            told = describe(self._drives[words[0]])
        else:
            self._play(self._drives[words[0]], words[1:])
        for text in told:
            self._say(text)

    def _play(self, drive: PlayedDrive, texts: list[str]) -> None:
        try:
            # all are read before the first is played: a line counts as a whole or not at all
            for fault in [parse_fault(text) for text in texts]:
                drive.fault(fault)
        except ValueRefused as error:
            self._complain(str(error))


class LineReader:
    """Standard input, read without ever blocking or stopping a process in the background."""

    def __init__(self) -> None:
        self._descriptor: int | None = None
        self._rest = b''
        # the stream may be closed (None), or replaced by something without a descriptor
        with suppress(AttributeError, OSError, ValueError):
            self._descriptor = sys.stdin.fileno()

    @property
    def fileno(self) -> int | None:
        """The descriptor to read now; None: nothing comes, or a terminal would stop the reader."""
        found = self._descriptor
        try:
            foreground = found is None or not os.isatty(found) or (
                os.tcgetpgrp(found) == os.getpgrp())
        except OSError:
            foreground = False
        return found if foreground else None

    def read_lines(self) -> list[str]:
        """Return the lines that have come. Call it when the descriptor is readable."""
        if self._descriptor is None:
            return []
        try:
            data = os.read(self._descriptor, _CHUNK)
        except BlockingIOError:
            return []
        except OSError:
            data = b''
        if not data:
            self._descriptor = None
            data = b'\n'
        *lines, self._rest = (self._rest + data).split(b'\n')
        self._rest = self._rest[:_LINE_MAX]
        return [line.decode('utf-8', 'replace') for line in lines]


def describe(drive: PlayedDrive) -> list[str]:
    """Return a line about a drive, and one about the EEPROM cells that it has written, if any."""
    configuration = drive.drive.configuration
    worn = ', '.join(f'{name} {count}' for name, count in sorted(drive.wear.items()))
    line = (f'{drive.name}: {configuration.protocol} station {configuration.station} '
            f'on bus {configuration.bus}, {drive.requests} requests, {drive.answers} answers, '
            f'{drive.eeprom_writes} EEPROM writes, faults: {drive.faults_text}')
    return [line, f'{drive.name}: EEPROM writes: {worn}'] if worn else [line]


def help_lines() -> list[str]:
    """Return the help on lines."""
    return ['DRIVE FAULT …  DRIVE  status  list  help; faults:', *usage_lines()]


def define(parser: argparse.ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'Play every drive of a bridge parameter file on its buses, until SIGINT or '
        'SIGTERM.')
    parser.epilog = 'Lines on standard input: ' + '\n'.join(help_lines())
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    add_params_file(parser, 'parameter file of the bridge')
    parser.add_argument('--interface', help='python-can interface for all buses, instead of the '
                                            "file's")
    parser.add_argument('--channel', help="channel of the bus, instead of the file's")
    parser.add_argument('--bitrate', type=bitrate, metavar='B',
                        help="bit/s of all buses, instead of the file's; who sets another one "
                             'on a pseudo-terminal then hears nothing')
    parser.add_argument('--pty', action='store_true',
                        help='a pseudo-terminal per bus, which behaves like an SLCAN adapter')
    parser.add_argument('--pty-link', metavar='DIR', type=Path,
                        help='keep DIR/BUS pointing at the pseudo-terminal of each bus (implies '
                             '--pty)')
    parser.add_argument('--fault', metavar='DRIVE:FAULT', action='append', default=[],
                        help='begin with a fault, for example conveyor:late=0.15; repeatable')
    parser.add_argument('--axis', metavar='DRIVE:KEY=VALUE,…', action='append', default=[],
                        help='what the motor of a drive carries, for example '
                             'lift:load=0.3,noise=1,brake=0; repeatable')
    parser.add_argument('--without', metavar='DRIVE=OBJECT,…', action='append', default=[],
                        help=f'objects that a {_SERVOS[0]} drive does not have, for example '
                             'servo=6007h,1800h.05h; repeatable')
    parser.add_argument('--habit', metavar='DRIVE:KEY=VALUE,…', action='append', default=[],
                        help=f'what differs between makers of {_SERVOS[0]} drives, for example '
                             'servo:mapping=operational,start=0.3 (docs/simulation.md); '
                             'repeatable')
    parser.add_argument('--log-frames', metavar='FILE', type=Path, nargs='?', const=Path('-'),
                        help='print every frame: (seconds) BUS ID#DATA R|T; or write it to FILE, '
                             'as candump -L does')


def run(args: argparse.Namespace) -> int:
    """
    Simulate until a signal.

    :return: 0 after SIGINT or SIGTERM, 1 failure; one line on standard error each.
    :raises WrongUsage: options that exclude each other, or do not apply.
    :raises ConfigurationError: the file has problems.
    :raises InUse: another process has a serial port.
    :raises OSError: a file cannot be read, or written.
    """
    try:
        pty = args.pty or args.pty_link is not None
        if pty and (args.interface or args.channel):
            raise WrongUsage(command_sentences.pty_or_interface())
        unusable = check_interface(args.interface) if args.interface else None
        if unusable is not None:    # before the bus is announced
            raise BusMisconfigured(f'--interface: {unusable}')
        # imported late: it reads schemas, and --help needs none
        from drive_can_bridge.configuration.load import configuration_from_file
        configuration = _on_buses(configuration_from_file(args.params_file), args.interface,
                                  args.channel, args.bitrate)
        faults = [of_drive('--fault', text, configuration, parse_fault) for text in args.fault]
        mechanics = dict(of_drive('--axis', text, configuration, Mechanics.parse)
                         for text in args.axis)
        servos = _servos(configuration, args.without, args.habit)
        with ExitStack() as stack:
            return _simulate(stack, args.clock, configuration, faults, mechanics, servos, pty=pty,
                             link=args.pty_link, log_frames=args.log_frames,
                             strict=args.bitrate is not None)
    except (BusMisconfigured, BusUnavailable) as error:
        _complain(str(error))
        return FAILED


def _keep_links(stack: ExitStack, directory: Path, configuration: BridgeConfiguration) -> None:
    """
    Lock the links of all buses: bridges would turn to another simulation unnoticed.

    :raises InUse: a running simulation has one. What an ended one has left is free.
    """
    place = directory.resolve()
    for name in configuration.buses:
        try:
            lock = HostLock(f'link {place / name}', 'drive_can simulate')
        except Held as held:
            raise InUse(command_sentences.link_in_use(
                link=str(directory / name), process=held.in_words)) from None
        stack.callback(lock.release)


def _simulate(stack: ExitStack, clock: Clock, configuration: BridgeConfiguration,
              faults: list[tuple[str, Fault]], mechanics: dict[str, Mechanics],
              servos: 'Servos', *, pty: bool, link: Path | None, log_frames: Path | None,
              strict: bool) -> int:
    # before anything is announced: a reader of the first line may send the signal at once
    wake = stack.enter_context(_signals_as_descriptor())
    if not pty:     # a bridge locks the other end of a pseudo-terminal
        stack.enter_context(Ownership([(bus, ()) for bus in configuration.buses.values()],
                                      'drive_can simulate', END_FIRST))
    if link is not None:
        _keep_links(stack, link, configuration)
    output = _Output(sys.stdout)
    terminals: dict[str, SlcanTerminal] = {}

    def open_terminal(bus: BusConfiguration) -> SlcanTerminal:
        return terminals[bus.name]

    simulation = Simulation(
        configuration, clock, open_bus=open_terminal if pty else None, say=output.say,
        complain=_complain, show_frame=_frame_log(stack, clock, output, log_frames),
        mechanics=mechanics)
    for name, fault in faults:
        try:
            simulation.drives[name].fault(fault)
        except ValueRefused as error:
            raise WrongUsage(f'--fault {name}:{fault}: {error}') from None
    servos.prepare(simulation)
    for bus in configuration.buses.values():
        if pty:
            terminals[bus.name] = terminal = SlcanTerminal(
                clock.now, bus.bitrate if strict else None)
            stack.callback(terminal.close)
            if link is not None:
                terminal.link(link / bus.name)
            output.say(f'bus {bus.name}: slcan {terminal.path}')
        else:
            output.say(f'bus {bus.name}: {bus.place}')
    stack.enter_context(simulation)
    for drive in simulation.drives.values():
        output.say(f'drive {describe(drive)[0]}')
    status = _wait(simulation, wake, Console(simulation, say=output.say, complain=_complain))
    simulation.stop()
    for drive in simulation.drives.values():
        for line in describe(drive):
            output.say(line)
        for rule, count in drive.violations.items():
            output.say(f'{drive.name}: violation: {rule}: {count} times')
    return status


@dataclass(frozen=True)
class Servos:
    """The options on drives of CiA 402."""

    without: dict[str, frozenset[tuple[int, int | None]]]
    habits: dict[str, Habits]

    def prepare(self, simulation: Simulation) -> None:
        """Apply the options to the drives; print objects that are missing anyway."""
        for name, habits in self.habits.items():
            _servo(simulation, name).habits = habits
        for name, places in self.without.items():
            servo = _servo(simulation, name)
            for index, subindex in sorted(places, key=str):
                if not servo.has(index, subindex):
                    _complain(f'--without: {name} has no {object_text(index, subindex)} anyway')
            servo.take_away(places)


def _servos(configuration: BridgeConfiguration, without: list[str], habit: list[str]) -> Servos:
    """
    Read ``--without`` and ``--habit``.

    :raises WrongUsage: they are invalid, or for a drive of another family.
    """
    taken: dict[str, frozenset[tuple[int, int | None]]] = {}
    for text in without:
        name, places = of_drive('--without', text, configuration, parse_objects, '=')
        taken[name] = taken.get(name, frozenset()) | places
    habits = dict(of_drive('--habit', text, configuration, Habits.parse) for text in habit)
    for option, names in (('--without', taken), ('--habit', habits)):
        for name in names:
            protocol = configuration.drives[name].protocol
            if protocol not in _SERVOS:
                raise WrongUsage(command_sentences.option_of_other_family(
                    option=option, name=name, protocol=protocol,
                    allowed=', '.join(_SERVOS)))
    return Servos(taken, habits)


def _servo(simulation: Simulation, name: str) -> SimulatedServoDrive:
    drive = simulation.drives[name].drive
    assert isinstance(drive, SimulatedServoDrive)
    return drive


def _frame_log(stack: ExitStack, clock: Clock, output: '_Output',
               path: Path | None) -> ShowFrame | None:
    """
    Return the log of frames: standard output (``-``), a file as candump -L writes it, or None.

    :raises OSError: the file cannot be written.
    """
    if path is None:
        return None
    if path == Path('-'):
        return lambda bus, frame, sent: output.say(
            f'({1e-9 * clock.stamp():.6f}) {bus} {frame} {"T" if sent else "R"}')
    file = _Output(stack.enter_context(path.open('w', encoding='ascii')), path)
    return lambda bus, frame, _: file.say(f'({1e-9 * clock.stamp():.6f}) {bus} {frame}')


def _wait(simulation: Simulation, wake: int, console: Console) -> int:
    """Run standard input until a signal comes, or a thread has ended by itself."""
    reader = LineReader()
    while not simulation.failure:
        typed = reader.fileno
        wanted = [wake] if typed is None else [wake, typed]
        readable, _, _ = select.select(wanted, [], [], _LOOK_PERIOD)
        if wake in readable:
            return 0
        if readable:
            for line in reader.read_lines():
                console.obey(line)
    return FAILED


def _on_buses(configuration: BridgeConfiguration, interface: str | None, channel: str | None,
              bitrate: int | None) -> BridgeConfiguration:
    """
    Replace the end points of all buses.

    :raises WrongUsage: two of them would be one: drives that never meet would answer together.
    """
    buses: dict[str, BusConfiguration] = {}
    for bus in configuration.buses.values():
        changed = replace(bus, interface=interface or bus.interface,
                          channel=bus.channel if channel is None else channel,
                          bitrate=bitrate or bus.bitrate)
        if changed.interface != bus.interface:
            # options of one adapter do not apply to another
            changed = replace(changed, options={})
        buses[bus.name] = changed
    apart = {bus.wire for bus in configuration.buses.values()}
    if len({bus.wire for bus in buses.values()}) < len(apart):
        given = ' '.join(option for option, value in (('--interface', interface),
                                                      ('--channel', channel)) if value is not None)
        raise WrongUsage(command_sentences.buses_on_one(given=given, buses=', '.join(buses)))
    return replace(configuration, buses=buses)


class _Output:
    """Standard output, or a file, for several threads; its end does not end them."""

    def __init__(self, stream: TextIO | None, path: Path | None = None) -> None:
        self._stream = stream
        self._path = path
        self._lock = threading.Lock()

    def say(self, line: str) -> None:
        with self._lock:
            if self._stream is None:
                return
            try:
                print(line, file=self._stream, flush=True)
            except OSError as error:
                stream, self._stream = self._stream, None
                if self._path is not None:
                    with suppress(OSError):     # it would be given again what it did not write
                        stream.close()
                    _complain(f'{self._path}: incomplete: {error.strerror}')
                else:
                    # Python flushes once more at exit, and would complain
                    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _complain(line: str) -> None:
    try:
        print(f'drive_can simulate: {line}', file=sys.stderr, flush=True)
    except OSError:
        pass


@contextmanager
def _signals_as_descriptor() -> Iterator[int]:
    """Yield a descriptor that becomes readable with SIGINT or SIGTERM."""
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    woken = signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    try:
        # a handler, so that neither has its usual effect
        with handled((signal.SIGINT, signal.SIGTERM), lambda *_: None):
            yield reading
    finally:
        signal.set_wakeup_fd(woken)
        os.close(reading)
        os.close(writing)
