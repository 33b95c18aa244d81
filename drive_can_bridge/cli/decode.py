# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can decode``: what the frames of a trace, or of a bus, mean."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, ExitStack, nullcontext
from functools import partial
from itertools import chain
from pathlib import Path
import re
import sys

from drive_can_bridge.cli.command import (
    add_params_file, add_seconds, complain, FAILED, print_json, WrongUsage)
from drive_can_bridge.cli.record import Taps
from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.frame import Record
from drive_can_bridge.core.text import printable
from drive_can_bridge.host_texts import is_pattern
from drive_can_bridge.protocols.observer import Telegram
from drive_can_bridge.resources import command_that_brings
from drive_can_bridge.trace.channels import Channels
from drive_can_bridge.trace.files import read_records
from drive_can_bridge.trace.formats import check_readable, READABLE, UnknownFormat
from drive_can_bridge.trace.sinks import LineWriter, Only, Plotter, Selection, TableWriter
from drive_can_bridge.trace.tracer import Sink, summary_documents, summary_lines, Tracer
from drive_can_bridge.trace.writers import open_text

#: the place in a file of a complaint
_PLACE = re.compile(r'(?:line|entry) \d+: ')
#: different complaints about a file that are shown
_COMPLAINTS_MAX = 5
#: s that a frame may take from the bus to its adapter's queue before it counts as missing
_DELIVERY_TIME = 0.05


def define(parser: ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'One line for each telegram: s since the trace began, s since the last of '
        'its kind, bus, drive, > request or < response, and what it carries. What '
        'was not answered, refused, late, unasked or malformed is named; frames of '
        'nobody in the parameter file are shown in hex.')
    parser.epilog = (
        f'Traces: {", ".join(READABLE)}; "-" reads candump\'s text from standard input. '
        'Direction and error frames are shown as far as the format keeps them.')
    parser.add_argument('file', metavar='FILE', nargs='?', help='the trace')
    parser.add_argument('--live', action='store_true',
                        help='listen to the buses of the parameter file instead; sends nothing')
    add_params_file(parser, 'parameter file of the bridge: names buses and drives')
    add_seconds(parser)
    parser.add_argument('--bus', metavar='NAME=CHANNEL', action='append', default=[],
                        help='the channel of the trace that is this bus, as it is shown; '
                             'repeatable')
    parser.add_argument('--drive', metavar='NAME', action='append', default=[],
                        help='only this drive; a shell pattern, repeatable')
    parser.add_argument('--only', metavar='WHAT', type=_only, default=set(),
                        help='some of: parameters (reads and writes beside the exchange), errors, '
                             'changes (of cyclic values and states); separated by commas')
    parser.add_argument('--csv', metavar='FILE', type=Path,
                        help='write the values of the exchange, a column each, instead of lines')
    parser.add_argument('--plot', metavar=('FILE.png', 'DRIVE.NAME'), nargs='+',
                        help='draw these values (default: all actual values), instead of lines, '
                             'in the format of the suffix (.png, .svg, .pdf, ...)')
    parser.add_argument('--summary', action='store_true',
                        help='for each drive exchanges, missed ones, period, latency, refusals; '
                             'for each bus its load; instead of lines')
    parser.add_argument('--json', action='store_true',
                        help='a JSON document a line: time, bus, drive, direction, kind, title, '
                             'values, parameters, verdict, remark, latency_ms')


def run(args: Namespace) -> int:
    """
    Decode a trace to its end, or a bus until a signal.

    :return: 0; 1 where nothing could be read, or a bus was lost meanwhile.
    :raises WrongUsage: no trace, no such drive, or a file that would be written over.
    :raises DriveCanError: a parameter file with problems, a bus that cannot be opened, channels of
        which the bus is unknown.
    :raises OSError: a file cannot be read or written.
    """
    if args.file is None and args.plot and not args.live:   # options may stand before FILE
        args.file = args.plot.pop()
        args.plot = args.plot or None
    if (args.file is None) is not args.live or args.plot == []:
        raise WrongUsage(command_sentences.trace_or_live())
    configuration = configuration_from_file(args.params_file)
    unknown = [name for name in args.drive
               if not is_pattern(name) and name not in configuration.drives]
    if unknown:
        raise WrongUsage(command_sentences.filter_names_no_drive(
            drive=unknown[0], drives=', '.join(configuration.drives) or 'none'))
    meant = _meant(args, configuration)
    taken = _written_over(args)
    if taken is not None:
        raise WrongUsage(command_sentences.would_write_over(file=taken))
    if args.plot and not Path(args.plot[0]).suffix:
        raise WrongUsage(command_sentences.plot_suffix(plot=args.plot[0]))
    if not args.live and args.file != '-':      # before a file is replaced
        try:
            check_readable(Path(args.file))
        except UnknownFormat as error:
            raise WrongUsage(str(error)) from None
    complaints = _Complaints(args.file)
    records: Iterator[Record] = (
        iter(()) if args.live else read_records(Path(args.file), complaints))
    first = next(records, None)
    if first is None and not args.live:
        complaints.conclude()
        complain(command_sentences.trace_empty(file=args.file))
        return FAILED
    channels = Channels(list(configuration.buses.values()), meant, complain)
    if args.file is not None and Path(args.file).is_file():     # a pipe is read only once
        channels.look_ahead(record.channel for record in read_records(Path(args.file), _ignore))
    selection = Selection(args.drive, args.only)
    code = 0
    with ExitStack() as stack:
        sinks, endings = _sinks(args, configuration, selection, stack)
        tracer = Tracer(configuration, _together(sinks), channels)
        if args.summary:
            endings.append(lambda: _summarise(tracer, selection.names, as_json=args.json))
        if first is None:
            code = _live(args, configuration, tracer)
        else:
            with nullcontext() if _prints(args) else _waiting(args.file):
                take = tracer.take
                for record in chain((first,), records):
                    take(record)
            complaints.conclude()
            for line in channels.left_over():
                complain(line)
            for each in channels.missing():
                complain(command_sentences.no_such_channel(bus=each))
        tracer.finish()
        for ending in endings:
            ending()
    return code


def _meant(args: Namespace, configuration: BridgeConfiguration) -> dict[str, str]:
    """
    Return the channels that are given for buses.

    :raises WrongUsage: of no bus, of one twice, one for two, or of no trace.
    """
    if args.bus and args.live:
        raise WrongUsage(command_sentences.bus_of_trace_only())
    found: dict[str, str] = {}
    for given in args.bus:
        name, sign, channel = given.partition('=')
        if not (sign and channel):
            raise WrongUsage(command_sentences.bus_and_channel(given=given))
        if name not in configuration.buses:
            raise WrongUsage(command_sentences.no_such_bus(
                given=given, buses=', '.join(configuration.buses)))
        if name in found or channel in found.values():
            raise WrongUsage(command_sentences.bus_given_twice(
                given=given, what='bus' if name in found else 'channel'))
        found[name] = channel
    return found


def _ignore(_: str) -> None:
    """Ignore a complaint: the second pass over the file reports it."""


def _prints(args: Namespace) -> bool:
    """Return whether it writes lines as it goes."""
    return not (args.summary or args.plot or args.csv)


def _waiting(file: str) -> AbstractContextManager[None]:
    from drive_can_bridge.cli.output import waiting     # which takes its time
    return waiting(f'reading {file}')


def _written_over(args: Namespace) -> Path | None:
    """Return an output that is one of the files to be read; None: there is none."""
    outputs = [args.csv] if args.csv is not None else []
    outputs += [Path(picture) for picture in (args.plot or [])[:1]]
    read = [Path(each) for each in (args.file, args.params_file) if each is not None]
    return next((output for output in outputs for each in read
                 if output.exists() and each.exists() and output.samefile(each)), None)


def _sinks(args: Namespace, configuration: BridgeConfiguration, selection: Selection,
           stack: ExitStack) -> tuple[list[Sink], list[Callable[[], None]]]:
    """Return the sinks for telegrams, and what is to be done at the end."""
    sinks: list[Sink] = []
    endings: list[Callable[[], None]] = []
    drives = [drive for drive in configuration.drives.values() if selection.names(drive.name)]
    if args.plot:       # refuses unknown names, so before a file is replaced
        picture, *wanted = args.plot
        try:
            plotter = Plotter(configuration, wanted, drives)
        except DriveCanError as error:
            raise WrongUsage(error.sentence) from None
        sinks.append(plotter)
        endings.append(lambda: _draw(plotter, picture))
    if args.csv is not None:
        stream = stack.enter_context(open_text(args.csv, newline=''))
        sinks.append(TableWriter(stream, drives))
    if _prints(args):
        write = partial(print, end='', flush=True) if args.live else sys.stdout.write
        sinks.append(LineWriter(write, selection, as_json=args.json))
    return sinks, endings


def _together(sinks: list[Sink]) -> Sink:
    if len(sinks) == 1:
        return sinks[0]

    def take(bus: str, telegram: Telegram) -> None:
        for sink in sinks:
            sink(bus, telegram)
    return take


def _live(args: Namespace, configuration: BridgeConfiguration, tracer: Tracer) -> int:
    with closing(Taps(configuration, args.clock)) as taps:
        try:
            for record in taps.records(args.seconds):
                if isinstance(record, float):
                    tracer.advance(record - _DELIVERY_TIME)
                else:
                    tracer.take(record)
        except KeyboardInterrupt:
            pass
    return taps.code


def _draw(plotter: Plotter, path: str) -> None:
    try:
        plotter.draw(path)
    except ImportError:
        raise DriveCanError(command_sentences.matplotlib_missing(
            command=command_that_brings('plot'))) from None
    except OSError as error:
        error.filename = path
        raise
    except ValueError as error:     # a suffix that matplotlib does not know
        raise DriveCanError(command_sentences.plot_failed(path=path, error=error)) from None


def _summarise(tracer: Tracer, wanted: Callable[[str], bool], *, as_json: bool) -> None:
    if as_json:
        print_json(*summary_documents(tracer, wanted))
    else:
        print('\n'.join(summary_lines(tracer, wanted)))


class _Complaints:
    """The first few different lines about a damaged file, and the number of the others."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._shown: set[str] = set()
        self._more = 0

    def __call__(self, text: str) -> None:
        what = _PLACE.sub('', text)
        if what in self._shown or len(self._shown) == _COMPLAINTS_MAX:
            self._more += 1
            return
        self._shown.add(what)
        complain(f'{self._name}: {printable(text)}')

    def conclude(self) -> None:
        """Report how many more there were."""
        if self._more:
            complain(command_sentences.more_like_that(name=self._name, count=self._more))


def _only(text: str) -> set[Only]:
    known = {only.value: only for only in Only}
    wrong = [word for word in text.split(',') if word not in known]
    if wrong:
        raise ArgumentTypeError(command_sentences.word_unknown(
            word=repr(wrong[0]), known=', '.join(known)))
    return {known[word] for word in text.split(',')}
