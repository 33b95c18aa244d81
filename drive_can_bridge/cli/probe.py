# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can probe``: harmless reads that answer what the manuals leave open."""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator, Sequence
import json
from typing import Any

from drive_can_bridge.cli.command import (
    add_params_file, agree_to_hazard, complain, FAILED, print_json,
)
from drive_can_bridge.cli.drives import chosen, split_words
from drive_can_bridge.cli.output import print_table, waiting
from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.codes import code_of
from drive_can_bridge.core.configuration import (
    BridgeConfiguration, BusConfiguration, DriveConfiguration,
)
from drive_can_bridge.core.errors import BusUnavailable, DriveCanError, TransportError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.exchange.one_master import AnotherMaster, END_FIRST, Ownership
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.scanner import Finding, Prober, Question
from drive_can_bridge.transport.end_point import arrived, EndPoint
from drive_can_bridge.transport.port import open_port

#: s to listen for another master before the first question
LISTEN = 1.2
#: s that a receive may block
_PATIENCE = 0.005
_SEND_TIMEOUT = 0.05


class Asker:
    """
    Asks drives on one open bus.

    :param drives: all drives of the file on this bus.
    :param clock: s.
    """

    def __init__(self, bus: BusConfiguration, port: EndPoint,
                 drives: Sequence[DriveConfiguration],
                 clock: Callable[[], float]) -> None:
        self._bus = bus
        self._port = port
        self._clock = clock
        self._requests = [(drive.name, route) for drive in drives for route in
                          FAMILIES[drive.protocol].make_prober(drive).requests]

    def listen(self, seconds: float) -> None:
        """
        Listen for another master.

        :raises AnotherMaster: there is one.
        :raises BusUnavailable: the bus is lost.
        """
        end = self._clock() + seconds
        while self._clock() < end:
            self._receive(min(_PATIENCE, seconds))

    def tell(self, frame: Frame) -> None:
        """Send a frame that is not answered."""
        self._port.send(frame, _SEND_TIMEOUT)

    def probe(self, prober: Prober) -> list[Finding]:
        """
        Ask all questions of a prober; return its findings.

        :raises AnotherMaster: another master asks, too.
        :raises TransportError: the bus refuses frames.
        :raises BusUnavailable: it is lost.
        """
        conversation = prober.converse()
        answer: Frame | None = None
        try:
            question = next(conversation)
            while True:
                answer = self.ask(question, timeout=prober.drive.parameter_timeout,
                                  retries=prober.drive.parameter_retries)
                question = conversation.send(answer)
        except StopIteration as end:
            findings: list[Finding] = end.value
            return findings

    def ask(self, question: Question, *, timeout: float, retries: int) -> Frame | None:
        """
        Ask until there is an answer, or all attempts have failed.

        :param timeout: s for each time.
        """
        refusal: DriveCanError | None = None
        for _ in range(retries + 1):
            for _ in arrived(self._receive, self._clock):
                pass    # it came before the question, and answers nothing
            try:
                self._port.send(question.frame, _SEND_TIMEOUT)
                refusal = None
            except (TransportError, BusUnavailable) as error:
                refusal = error
            end = self._clock() + timeout
            for frame in self._heard(end):
                if question.answers(frame):
                    return frame
        if refusal is not None:
            raise TransportError(command_sentences.probe_unacknowledged(
                bus=self._bus.name, error=refusal))
        if question.quiet:
            self.listen(question.quiet)
        return None

    def _heard(self, end: float) -> Iterator[Frame]:
        """Yield what is received until then."""
        while self._clock() < end:
            frame = self._receive(_PATIENCE)
            if frame is not None:
                yield frame
        yield from arrived(self._receive, self._clock)

    def _receive(self, timeout: float) -> Frame | None:
        frame = self._port.receive(timeout)
        if frame is not None:
            for name, route in self._requests:
                if route.matches(frame):
                    raise AnotherMaster(
                        f'bus {self._bus.name}: another master talks to drive {name} ({frame}); '
                        'end it first')
        return frame


UNDECIDED = 'undecided'


def define(parser: ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'Find out by harmless reads what the manuals leave open: ' + '; '.join(
            f'{name}: {", ".join(family.probed)}' for name, family in FAMILIES.items()
            if family.probed) + '. Sends reads only. Listens for 1.2 s before, and ends when '
        'another master talks to a drive of the file.')
    parser.epilog = (
        'Exit code 0: the drive answered, whether or not everything could be decided. 1: '
        'it did not, or there is another master, or the bus cannot be used. 2: wrong '
        'usage.')
    parser.add_argument('drive', metavar='DRIVE', nargs='?',
                        help='name in the file, or a shell pattern; may be left out where there '
                             'is only one')
    add_params_file(parser, 'parameter file of the bridge, which must not run')
    parser.add_argument('--nmt-start', action='store_true',
                        help='start CANopen nodes first: others answer no PKW')
    parser.add_argument('--yes', action='store_true', help='answer every question with yes')
    parser.add_argument('--json', action='store_true',
                        help='a document for each key: drive, key, value (null: undecided), '
                             'configured, reason')


def run(args: Namespace) -> int:
    """
    Probe.

    :return: 0 the drives answered, 1 one of them did not.
    :raises WrongUsage: it is not clear which drive is meant, or consent is missing.
    :raises DriveCanError: the file is wrong, there is another master, the bus cannot be used.
    """
    configuration = configuration_from_file(args.params_file)
    known = list(configuration.drives)
    names = split_words(known, [])[0] if args.drive is None else chosen(known, [args.drive])
    drives = [configuration.drives[name] for name in names]
    probers = [FAMILIES[drive.protocol].make_prober(drive) for drive in drives]
    for prober in probers:      # before anything is sent
        if prober.hazard:
            name = prober.drive.name
            agree_to_hazard(f'{name}: {prober.hazard}', 'Ask all the same?', yes=args.yes,
                            who=name)
    results: list[tuple[Prober, list[Finding]]] = []
    for bus in dict.fromkeys(drive.bus for drive in drives):
        together = [prober for prober in probers if prober.drive.bus == bus]
        with waiting('listening for another master, then asking'):
            results += _probe_bus(configuration, bus, together, args)
    for prober, _ in results:
        for note in prober.notes:
            complain(f'warning: {prober.drive.name}: {note}')
    _show(args, results)
    return 0 if all(prober.answered for prober in probers) else FAILED


def _probe_bus(configuration: BridgeConfiguration, name: str, probers: Sequence[Prober],
               args: Namespace) -> Iterator[tuple[Prober, list[Finding]]]:
    bus = configuration.buses[name]
    drives = [drive for drive in configuration.drives.values() if drive.bus == name]
    with Ownership([(bus, drives)], 'drive_can probe', END_FIRST):
        port = open_port(bus, args.clock)
        try:
            asker = Asker(bus, port, drives, args.clock.now)
            asker.listen(LISTEN)
            for prober in probers:
                start = prober.start_frame()
                if args.nmt_start and start is not None:
                    asker.tell(start)
                yield prober, asker.probe(prober)
        finally:
            port.close()


def _show(args: Namespace, results: Sequence[tuple[Prober, list[Finding]]]) -> None:
    rows = []
    to_set: dict[str, list[str]] = {}
    for prober, findings in results:
        drive = prober.drive
        for finding in findings:
            configured = _configured(drive, finding.key)
            if args.json:
                print_json({'drive': drive.name, 'key': finding.key, 'value': finding.value,
                            'configured': configured, 'reason': finding.reason,
                            'code': code_of(finding.reason)})
                continue
            value = UNDECIDED if finding.value is None else _written(finding.value)
            rows.append((drive.name, finding.key, value, _written(configured), finding.reason))
            if finding.value is not None and configured not in (finding.value, 'auto'):
                to_set.setdefault(drive.name, []).append(f'{finding.key}: {value}')
    if args.json:
        return
    print_table(('drive', 'key', 'found', 'in the file', 'rests on'), rows)
    if to_set:
        print('\nTo be set in the file:')
        for name, lines in to_set.items():
            print('\n'.join((f'  {name}:', *(f'    {line}' for line in lines))))


def _configured(drive: DriveConfiguration, key: str) -> Any:
    if key.startswith('cyclic_'):
        return [each.name for each in getattr(drive, key)]
    return getattr(drive.options, key)


def _written(value: Any) -> str:
    """Return a value as it stands in a parameter file."""
    if isinstance(value, list):
        return f'[{", ".join(value)}]'
    return value if isinstance(value, str) else json.dumps(value)
