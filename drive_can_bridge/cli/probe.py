# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can probe``: which keys a drive needs that its manual leaves open."""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator, Sequence
import json
from typing import Any

from drive_can_bridge.cli.arguments import add_params_file
from drive_can_bridge.cli.asking import Asker, LISTEN
from drive_can_bridge.cli.command import complain, FAILED
from drive_can_bridge.cli.drives import chosen, split_words
from drive_can_bridge.cli.questions import agree_to_hazard
from drive_can_bridge.cli.tables import print_json, print_table
from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core.configuration import BridgeConfiguration, DriveConfiguration
from drive_can_bridge.exchange.one_master import END_FIRST, Ownership
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.prober import Finding, Prober
from drive_can_bridge.transport.port import open_port

UNDECIDED = 'undecided'


def define(parser: ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'Find out by harmless reads what the manuals leave open: value_order and '
        'index_byte (cannord), layout, word_order and abort_code_order (canopen_pkw), '
        'parameter_offset and maps (DataModel). Sends reads only. Listens for 1.2 s '
        'before, and ends when another master talks to a drive of the file.')
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
    :raises WrongUsage: it is not clear which drive is meant, or nobody agrees.
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
                            'configured': configured, 'reason': finding.reason})
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
    """Write a value as it stands in a parameter file."""
    if isinstance(value, list):
        return f'[{", ".join(value)}]'
    return value if isinstance(value, str) else json.dumps(value)
