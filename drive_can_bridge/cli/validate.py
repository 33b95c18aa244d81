# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The subcommand ``drive_can validate``: check a parameter file without touching a bus."""

from argparse import ArgumentParser, Namespace
import sys
from typing import Any

from drive_can_bridge.cli.command import FAILED, print_json
from drive_can_bridge.configuration.checks import Adapters, bus_shares
from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.configuration.problems import Problem
from drive_can_bridge.core.configuration import BusConfiguration, DriveConfiguration
from drive_can_bridge.core.errors import ConfigurationError
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.text import printable


def define(parser: ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'Check a parameter file and the profiles it names. Prints one line per '
        'drive, or on standard error one line per problem '
        '(FILE:LINE: key.path: what is wrong, what is allowed).')
    parser.epilog = 'Exit code 0: everything is all right. 1: it is not. 2: wrong usage.'
    parser.add_argument('file', metavar='FILE', help='ROS 2 parameter file of the bridge')
    parser.add_argument('--json', action='store_true', help=(
        'a JSON document a line: drive, bus, interface, channel, protocol, station, profile, '
        'period, request, response, load_percent; or level (warning, error), file, line, key, '
        'message, code'))


def run(args: Namespace) -> int:
    """
    Check the file.

    :raises ConfigurationError: the file has problems.
    :raises OSError: the file cannot be read.
    """
    try:
        configuration = configuration_from_file(args.file, adapters=_adapters())
    except ConfigurationError as error:
        if not args.json:
            raise
        print_json(*(_place('error', problem) for problem in error.problems))
        return FAILED
    for warning in configuration.warnings:
        if args.json:
            print_json(_place('warning', warning))
        else:
            print(f'warning: {warning}', file=sys.stderr)
    shares: dict[str, float] = {}
    for bus in configuration.buses.values():
        shares.update(bus_shares(
            bus, [drive for drive in configuration.drives.values() if drive.bus == bus.name]))
    for drive in configuration.drives.values():
        if args.json:
            print_json(_document(drive, configuration.buses[drive.bus], shares[drive.name]))
            continue
        print(summary(drive, configuration.buses[drive.bus], shares[drive.name]))
    return 0


def summary(drive: DriveConfiguration, bus: BusConfiguration, share: float) -> str:
    """
    Return a line with everything that matters about a drive.

    :param share: of the bus that its exchange takes at worst.
    """
    return (f'{drive.name}: bus {drive.bus} ({bus.place}), {drive.protocol}, '
            f'station {drive.station}, profile {printable(drive.profile.name)}, '
            f'period {1000 * drive.period:g} ms, '
            f'request {_names(drive.cyclic_request)}, response {_names(drive.cyclic_response)}, '
            f'load {100 * share:.1f} %')


def _document(drive: DriveConfiguration, bus: BusConfiguration, share: float) -> dict[str, Any]:
    return {'drive': drive.name, 'bus': drive.bus, 'interface': bus.interface,
            'channel': bus.channel, 'protocol': drive.protocol, 'station': drive.station,
            'profile': drive.profile.name, 'period': drive.period,
            'request': [each.name for each in drive.cyclic_request],
            'response': [each.name for each in drive.cyclic_response],
            'load_percent': round(100 * share, 1)}


def _place(level: str, problem: str) -> dict[str, Any]:
    """Return where a problem is, and what is wrong there."""
    where = problem.fields if isinstance(problem, Sentence) else {}
    file, line, key = where.get('file', ''), where.get('line'), where.get('key', '')
    before = str(Problem(file, line or 0, key, NOTHING))
    return {'level': level, 'file': file or None, 'line': line if file else None,
            'key': key or None, 'message': problem.removeprefix(before),
            'code': problem.code if isinstance(problem, Sentence) else ''}


def _names(parameters: tuple[Parameter, ...]) -> str:
    return f'[{", ".join(parameter.name for parameter in parameters)}]'


def _adapters() -> Adapters | None:
    """Return what is known about CAN adapters, if python-can is installed."""
    try:
        from drive_can_bridge.transport import adapters
    except ImportError:
        print('warning: python-can is not installed: interfaces and adapter keys are unchecked',
              file=sys.stderr)
        return None
    return adapters
