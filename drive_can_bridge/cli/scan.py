# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``drive_can scan``: looking for drives on an unknown bus.

Listening first, then requests that no device can misread. On 11-bit identifiers a read of one
family is a command of another: such a family is asked only when it is named, and never once a
CANopen node was heard or answered.
"""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from itertools import chain
import json
import math
from pathlib import Path
import re
import shlex
from typing import Any

from drive_can_bridge.cli.command import (
    above_zero, agree_to_hazard, bitrate, complain, FAILED, output_path, print_json, WrongUsage,
)
from drive_can_bridge.cli.output import may_overwrite, waiting, write_atomically
from drive_can_bridge.configuration.load import (
    configuration_from_file, configuration_from_overrides)
from drive_can_bridge.configuration.scalars import read_scalar
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import (
    BusUnavailable, ConfigurationError, DriveCanError, TransportError)
from drive_can_bridge.core.frame import bits_of_exchange, Frame
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.text import column_lines, counted
from drive_can_bridge.exchange.one_master import END_FIRST, Ownership
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.family import ScanEntry
from drive_can_bridge.protocols.scanner import Certainty, Scanner, Sighting
from drive_can_bridge.transport import adapters
from drive_can_bridge.transport.adapters import adapter_keywords, check_channel, check_interface
from drive_can_bridge.transport.end_point import arrived, EndPoint
from drive_can_bridge.transport.kernel_interfaces import kernel_interface
from drive_can_bridge.transport.port import open_port

#: share of the bus that questions and their answers may take at most
LOAD_MAX = 0.3
#: s that the last answer is waited for
LAST_ANSWER = 0.3
#: s that a receive may block
_PATIENCE = 0.005
_SEND_TIMEOUT = 0.05
#: s since the begin of the last look, behind which there may be more to hear than one frame
_LATE = 0.15
#: frames in a row that the bus refuses, until nothing more is sent
_REFUSED_MAX = 5
#: bit/s where nobody says another rate
DEFAULT_BITRATE = 125_000


class BusScan:
    """
    What is found on one bus.

    :ivar frames: frames heard.
    :ivar unknown: frames whose identifier belongs to no family.
    :ivar trouble: why nothing can be sent; '': it can.
    """

    def __init__(self, bus: BusConfiguration, port: EndPoint,
                 clock: Callable[[], float]) -> None:
        self._bus = bus
        self._port = port
        self._clock = clock
        self.scanners: dict[str, Scanner] = {name: family.make_scanner()
                                         for name, family in FAMILIES.items()}
        self.frames = 0
        self.trouble = ''
        self._looked = clock()

    @property
    def master(self) -> str:
        """What another master asks; '': there is none."""
        return next((scanner.master for scanner in self.scanners.values() if scanner.master), '')

    @property
    def nodes(self) -> dict[int, str]:
        """The CANopen nodes, of any kind."""
        return {node: text for scanner in self.scanners.values()
                for node, text in scanner.nodes.items()}

    @property
    def sightings(self) -> list[Sighting]:
        """All drives found, by family and station."""
        return [scanner.sightings[station] for scanner in self.scanners.values()
                for station in sorted(scanner.sightings)]

    def forbidden(self, scanner: Scanner) -> bool:
        """Return whether there is a node that might obey what a scanner asks."""
        return not scanner.unmistakable and bool(self.nodes)

    def listen(self, seconds: float) -> None:
        """
        Listen for frames.

        :raises BusUnavailable: the bus is lost.
        """
        end = self._clock() + seconds
        while self._clock() < end:
            self._hear(_PATIENCE)
        self._catch_up()

    def ask(self, protocol: str) -> None:
        """
        Ask all stations of a family, and what their answers make worth asking.

        Ends at once when a master is heard, or the bus refuses frames, or when a CANopen node
        turns up that might read the questions as process data.

        :raises BusUnavailable: the bus is lost.
        """
        scanner = self.scanners[protocol]
        scanner.begin()
        due = self._clock()
        quiet_at = 0.0
        refused = 0
        while True:
            now = self._clock()
            if now - self._looked > _LATE:
                self._catch_up()
            # a node that was asleep may boot meanwhile
            if self.master or self.trouble or self.forbidden(scanner):
                return
            if now < due:
                self._hear(min(_PATIENCE, due - now))
                continue
            question = scanner.take_question()
            if question is None:
                quiet_at = quiet_at or now + LAST_ANSWER
                if now >= quiet_at:
                    return
                self._hear(_PATIENCE)
                continue
            quiet_at = 0.0
            due = now + self._pause(question)
            scanner.asked(question, now)
            try:
                self._port.send(question, _SEND_TIMEOUT)
                refused = 0
            except (TransportError, BusUnavailable) as error:
                refused += 1
                if refused >= _REFUSED_MAX:
                    self.trouble = command_sentences.scan_unacknowledged(error=error)

    def _pause(self, frame: Frame) -> float:
        """Return the s from one question to the next: both it and its answer count."""
        return bits_of_exchange(extended=frame.extended) / (LOAD_MAX * self._bus.bitrate)

    def _catch_up(self) -> None:
        """Hear what has come while this process did not run: before more is asked, or the end."""
        self._looked = self._clock()
        for frame in arrived(self._port.receive, self._clock):
            self._take(frame)

    def _hear(self, timeout: float) -> None:
        self._looked = self._clock()
        frame = self._port.receive(timeout)
        if frame is not None:
            self._take(frame)

    def _take(self, frame: Frame) -> None:
        self.frames += 1
        now = self._clock() - self._port.age
        for scanner in self.scanners.values():
            scanner.receive(frame, now)


_HEAD = """\
# Found by drive_can scan. Look it over before a bridge runs with it: profiles are the shipped ones
# where there is one, and otherwise tables of raw numbers beside this file, without units.
"""
#: what scanners say that is no drive key
_NO_KEYS = {'request_numbers', 'response_numbers', 'remarks'}


def tables_beside(path: Path) -> list[Path]:
    """Return the tables there are that a parameter file of this name may be written with."""
    kinds = '|'.join(family.scan_entry.kind for family in FAMILIES.values()
                     if not family.scan_entry.profile)
    table = re.compile(rf'{re.escape(path.stem)}_(?:{kinds})_[0-9]+\.yaml')
    return sorted(each for each in path.parent.glob('*.yaml') if table.fullmatch(each.name))


def write_parameter_file(path: Path, bus: BusConfiguration, sightings: Sequence[Sighting],
                         settings: Sequence[dict[str, Any]], nodes: Collection[int] = (),
                         ) -> list[Path]:
    """
    Write a parameter file that ``validate`` accepts, after the tables that it names.

    A sighting that would share identifiers with a surer one is a comment.

    :param sightings: at least one.
    :param settings: for each sighting, what its scanner knows.
    :param nodes: Node-IDs of devices that are there.
    :return: the files written.
    :raises OSError: they cannot be written.
    """
    written = [path]
    # so slow that all of them fit the bus: an exchange has at most 320 bits
    period = max(0.05, 0.01 * len(sightings), math.ceil(1e6 * len(sightings) / bus.bitrate) / 1e3)
    taken = _canopen_stations(sightings) | {*nodes}
    head = [_HEAD, '/**/drive_can_bridge:', '  ros__parameters:', '    buses:', '      main:',
            f'        interface: {bus.interface}', f'        channel: {json.dumps(bus.channel)}',
            f'        bitrate: {bus.bitrate}',
            *(f'        {key}: {json.dumps(value)}' for key, value in bus.options.items()),
            '    drives:']
    drives: dict[str, list[str]] = {}
    for sighting, keys in sorted(      # the surest first
            zip(sightings, settings), key=lambda each: each[0].certainty is Certainty.LIKELY):
        family = FAMILIES[sighting.protocol]
        name = f'{family.scan_entry.kind}_{sighting.station}'
        entry = family.scan_entry
        if not entry.profile:
            table = path.with_name(f'{path.stem}_{name}.yaml').absolute()
            entry = _write_table(table, sighting, keys)
            written.append(table)
        drives[name] = lines = [f'      # {remark}' for remark in keys.get('remarks', ())]
        lines += [f'      {name}:   # {sighting.text}', '        bus: main',
                  f'        protocol: {sighting.protocol}',
                  f'        station: {sighting.station}',
                  f'        profile: {json.dumps(entry.profile)}', f'        period: {period:g}',
                  f'        cyclic_request: [{", ".join(entry.request)}]',
                  f'        cyclic_response: [{", ".join(entry.response)}]']
        lines += [f'        {key}: {value}' for key, value in (
            *keys.items(), *family.scan_keys(taken).items()) if key not in _NO_KEYS]
    _write(path, [*head, *chain.from_iterable(drives.values())])
    collisions = _collisions(path)
    for name, why in collisions.items():
        drives[name] = [f'      # left out, station {why}',
                        *(f'# {line}' for line in drives[name])]
    if collisions:
        _write(path, [*head, *chain.from_iterable(drives.values())])
    return written


def _collisions(path: Path) -> dict[str, str]:
    """Return the drives of a parameter file that collide with earlier ones, and with what."""
    try:
        configuration_from_file(path)
    except ConfigurationError as error:
        # stations of what was found on a bus have no other fault
        keys = {problem: problem.fields['key'] for problem in error.problems
                if isinstance(problem, Sentence)}
        return {key.split('.')[1]: problem.partition(f'{key}: ')[2]
                for problem, key in keys.items() if key.endswith('.station')}
    return {}


def _canopen_stations(sightings: Sequence[Sighting]) -> set[int]:
    return {each.station for each in sightings if FAMILIES[each.protocol].on_canopen}


def _write_table(path: Path, sighting: Sighting, keys: dict[str, Any]) -> ScanEntry:
    """Write a table of the numbers that are exchanged; return how a drive uses it."""
    request, response = (keys.get(f'{each}_numbers', ()) for each in ('request', 'response'))
    lines = [f'description: Raw parameters of station {sighting.station}, found by a scan',
             f'protocols: [{sighting.protocol}]', 'parameters:']
    entries = dict.fromkeys(response, 'access: ro')
    entries.update(dict.fromkeys(request, 'access: rw, storage: ram'))
    lines += [f'  parameter_{number}: {{number: {number}, type: uint16, {entry}}}'
              for number, entry in sorted(entries.items())]
    if not entries:
        lines[-1] = 'parameters: {}'
    _write(path, lines)
    return ScanEntry(profile=str(path), request=tuple(f'parameter_{each}' for each in request),
                     response=tuple(f'parameter_{each}' for each in response))


def _write(path: Path, lines: Sequence[str]) -> None:
    write_atomically(path, ('\n'.join(lines) + '\n').encode('utf-8'))


#: families whose reads may be commands of others: only when named
_NAMED = tuple(name for name, family in FAMILIES.items() if not family.make_scanner().unmistakable)
_COLUMNS = ('protocol', 'station', 'how sure', 'what it said')


def define(parser: ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'Listen, then ask: 29-bit DataModel reads and CANopen SDO reads, which mean '
        'nothing to other devices, at 30 % bus load at most. Only listens while '
        'another master asks. Sends reads only, never a setpoint, a control word or '
        'an NMT command.')
    parser.epilog = (
        'Exit code 0: something was found. 1: nothing, or the bus cannot be used. 2: wrong '
        'usage, or a question that could not be asked.')
    parser.add_argument('--interface', required=True, help='python-can interface: socketcan, …; '
                        'drive_can adapters shows those of this machine, with their channels')
    parser.add_argument('--channel', required=True, help='what it calls its channel: can0, …')
    parser.add_argument('--bitrate', type=bitrate, metavar='B',
                        help='bit/s, also as 500k (default: what the interface is set to, and '
                             f'{DEFAULT_BITRATE // 1000}k where the adapter has to be told)')
    parser.add_argument('--option', action='append', default=[], metavar='KEY=VALUE',
                        type=_option, help='a key of the adapter, as in a parameter file: '
                                           'host=10.0.0.5; as often as needed')
    parser.add_argument('--listen', type=above_zero, default=2.0, metavar='S',
                        help='s to listen before anything is asked (default 2)')
    parser.add_argument('--passive', action='store_true', help='only listen')
    parser.add_argument('--protocols', type=_protocols, default=[], metavar='NAME',
                        help=f'ask these, too, one after the other: {", ".join(_NAMED)}; their '
                             'reads may be commands to other devices, never asked where there is '
                             'a CANopen node')
    parser.add_argument('--yes', action='store_true', help='answer every question with yes')
    parser.add_argument('--bitrates', type=_bitrates, metavar='A,B,…',
                        help='only listen, at each of these; needs an adapter with a listen-only '
                             'mode')
    parser.add_argument('-o', '--output', type=output_path, metavar='FILE',
                        help='write what was found as a parameter file; one that exists, and '
                             'tables beside it, are asked for')
    parser.add_argument('--json', action='store_true',
                        help='a document for each drive: protocol, station, certainty, text')


def run(args: Namespace) -> int:
    """
    Scan.

    :return: 0 found something, 1 nothing.
    :raises WrongUsage: an adapter that cannot be used so, or consent is missing.
    :raises DriveCanError: the bus cannot be used.
    :raises OSError: the output cannot be written.
    """
    reason = check_interface(args.interface)
    if reason is not None:
        raise WrongUsage(f'--interface: {reason}')
    reason = check_channel(args.interface, args.channel)
    if reason is not None:
        raise WrongUsage(f'--channel: {reason}')
    bus = _bus(args)
    if args.bitrates:
        if args.output is not None:
            raise WrongUsage(command_sentences.bitrates_write_nothing())
        return _compare_bitrates(args, bus)
    if args.output is not None and args.output.is_dir():
        raise DriveCanError(command_sentences.is_a_directory(file=args.output))
    if args.output is not None and not args.output.parent.is_dir():
        raise DriveCanError(command_sentences.no_directory_above(above=args.output.parent))
    if args.output is not None and not may_overwrite(
            (args.output, *tables_beside(args.output)), yes=args.yes,
            otherwise='Nothing was sent or written'):
        return FAILED
    for name in args.protocols:     # before anything is sent
        agree_to_hazard(f'{name}: {FAMILIES[name].make_scanner().hazard}',
                        f'Ask {name} all the same?', yes=args.yes or args.passive,
                        who=f'--protocols {name}')
    return _scan(args, bus)


def _bus(args: Namespace) -> BusConfiguration:
    """
    Return the bus, checked as one of a parameter file.

    :raises WrongUsage: an option that the bridge sets, or one that is missing.
    """
    args.doubt = _find_bitrate(args)
    options = dict(args.option)
    keys = {'interface': args.interface, 'channel': args.channel,
            'bitrate': args.bitrate or DEFAULT_BITRATE}
    wrong = next((key for key in options if key in keys), None)
    if wrong is not None:
        raise WrongUsage(command_sentences.option_of_its_own(wrong=wrong, option=wrong))
    try:
        found = configuration_from_overrides(
            {f'buses.main.{key}': value for key, value in {**keys, **options}.items()},
            adapters=adapters)
    except ConfigurationError as error:
        problem = str(error.problems[0])
        where, told = problem.partition(': ')[::2]
        key = where.removeprefix('buses.main').removeprefix('.')
        name = f'--{key}' if key in keys else f'--option {key}'.rstrip()
        raise WrongUsage(f'{name}: {told}') from None
    for warning in found.warnings:
        if warning.startswith('buses.main.'):
            complain(f'warning: --option {warning.removeprefix("buses.main.")}')
    return found.buses['main']


def _find_bitrate(args: Namespace) -> Sentence:
    """Set the bit rate to that of the interface, or to one that is assumed; return a warning."""
    if args.bitrates:
        return NOTHING
    found = kernel_interface(args.channel) if args.interface == 'socketcan' else None
    if found is not None and found.bitrate:
        given, args.bitrate = args.bitrate, found.bitrate
        if given not in (None, found.bitrate):
            return command_sentences.bitrate_of_interface(given, args.channel, found.bitrate)
    elif args.bitrate is None and 'bitrate' in (adapter_keywords(args.interface) or ()):
        args.bitrate = DEFAULT_BITRATE
        return command_sentences.bitrate_not_given(bitrate=DEFAULT_BITRATE)
    return NOTHING


def _scan(args: Namespace, bus: BusConfiguration) -> int:
    with Ownership([(bus, ())], 'drive_can scan', END_FIRST):
        if args.doubt:
            complain(args.doubt)
        port = open_port(bus, args.clock)
        try:
            scan = BusScan(bus, port, args.clock.now)
            with waiting('listening' if args.passive else 'listening, then asking'):
                scan.listen(args.listen)
                asked = [] if args.passive else _ask(args, scan)
        finally:
            port.close()
    if scan.master:
        complain(command_sentences.only_listening(master=scan.master))
    _tell_trouble(scan, port, asked=not args.passive)
    _show(args, scan)
    _tell_left_out(args, scan, asked)
    if args.output is not None and not scan.sightings:
        complain(command_sentences.no_file_without_drives(output=args.output))
    elif args.output is not None:
        for path in write_parameter_file(
                args.output, bus, scan.sightings,
                [scan.scanners[each.protocol].settings(each.station)
                 for each in scan.sightings], scan.nodes):
            complain(f'written: {path}')
        complain(f'next: drive_can validate {shlex.quote(str(args.output))}')
    elif scan.sightings:
        complain(f'next: {_command(args)} -o found.yaml')
    return 0 if scan.sightings or scan.nodes else FAILED


def _ask(args: Namespace, scan: BusScan) -> list[str]:
    """Ask the stations of the families; return the families that were asked."""
    asked = []
    for name in [*(each for each in FAMILIES if scan.scanners[each].unmistakable),
                 *args.protocols]:
        if not scan.master and not scan.forbidden(scan.scanners[name]):
            asked.append(name)
            scan.ask(name)
        if scan.forbidden(scan.scanners[name]):
            complain(command_sentences.not_asked_beside_canopen(
                name=name, nodes=', '.join(map(str, scan.nodes))))
    return asked


def _tell_left_out(args: Namespace, scan: BusScan, asked: Sequence[str]) -> None:
    """Print the bit rate, and what was not asked, and how to ask it."""
    left = [name for name in FAMILIES if name not in asked]
    told = f'{args.bitrate} bit/s, ' if args.bitrate else ''
    told += f'{counted(scan.frames, "frame")} heard'
    if args.passive:
        told += '; nothing was asked: --passive'
    elif left and not scan.master and not scan.nodes and not scan.trouble:
        told += (f'; not asked: {", ".join(left)}: their reads may be commands to other devices '
                 f'({_command(args)} --protocols {left[0]})')
    elif left:
        told += f'; not asked: {", ".join(left)}'
    complain(told)


def _command(args: Namespace) -> str:
    """Return the command line for the same scan again."""
    words = ['drive_can', 'scan', '--interface', args.interface, '--channel', args.channel,
             *(('--bitrate', str(args.bitrate)) if args.bitrate else ())]
    for key, value in args.option:
        words += ['--option', f'{key}={value if isinstance(value, str) else json.dumps(value)}']
    if args.protocols:
        words += ['--protocols', ','.join(args.protocols)]
    return shlex.join(words)


def _show(args: Namespace, scan: BusScan) -> None:
    sightings = scan.sightings
    drives = _canopen_stations(sightings)
    others = [(node, text) for node, text in sorted(scan.nodes.items()) if node not in drives]
    if args.json:
        for node, text in others:
            complain(command_sentences.node_of_no_family(node=node, text=text))
        print_json(*({'protocol': each.protocol, 'station': each.station,
                      'certainty': each.certainty.value, 'text': each.text}
                     for each in sightings))
        return
    rows = [(each.protocol, str(each.station), each.certainty.value, each.text)
            for each in sightings]
    rows += [('CANopen node', str(node), '–', text) for node, text in others]
    if rows:
        print('\n'.join(column_lines(_COLUMNS, rows, numbers=('station',))))
    else:
        print(command_sentences.no_drive_found(frames=scan.frames))


def _tell_trouble(scan: BusScan, port: EndPoint, *, asked: bool) -> None:
    """Print what is wrong with a bus, as far as it can be seen from here."""
    if port.error_frames:
        error = port.last_error
        told = f': {error.text}; {error.advice}' if error is not None else ''
        complain(command_sentences.error_frames_seen(count=port.error_frames, told=told))
    if port.controller:
        complain(command_sentences.controller_state(controller=port.controller))
    if scan.trouble:
        complain(command_sentences.scan_trouble(trouble=scan.trouble))
    elif not scan.frames and not port.error_frames:
        complain(command_sentences.nothing_answered() if asked
                 else command_sentences.nothing_heard())


def _compare_bitrates(args: Namespace, bus: BusConfiguration) -> int:
    if 'listen_only' not in (adapter_keywords(bus.interface) or ()):
        raise WrongUsage(command_sentences.bitrates_need_listening(interface=bus.interface))
    heard = 0
    for rate in args.bitrates:
        with Ownership([(bus, ())], 'drive_can scan', END_FIRST):
            port = open_port(replace(bus, bitrate=rate, options={
                **bus.options, 'listen_only': True}), args.clock)
            try:
                scan = BusScan(bus, port, args.clock.now)
                scan.listen(args.listen)
            finally:
                port.close()
        heard += scan.frames
        print(f'{rate} bit/s: {scan.frames} frames, {port.error_frames} error frames'
              + ('' if not scan.sightings else ': ' + ', '.join(
                  f'{each.protocol} {each.station}' for each in scan.sightings)))
    if not heard:
        complain(command_sentences.nothing_at_any_rate())
    return 0 if heard else FAILED


def _protocols(text: str) -> list[str]:
    names = text.split(',')
    wrong: Sequence[str] = [name for name in names if name not in _NAMED]
    if wrong:
        raise ArgumentTypeError(command_sentences.scan_protocols(
            word=repr(wrong[0]), allowed=', '.join(_NAMED)))
    return names


def _option(text: str) -> tuple[str, Any]:
    key, equals, value = text.partition('=')
    if not equals or re.fullmatch('[a-zA-Z_]+', key) is None:
        raise ArgumentTypeError(command_sentences.key_and_value(text=repr(text)))
    return key, read_scalar(value)


def _bitrates(text: str) -> list[int]:
    try:
        return [bitrate(rate) for rate in text.split(',')]
    except ArgumentTypeError:
        raise ArgumentTypeError(command_sentences.bitrates_wanted(text=text)) from None
