# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can read``: the parameters of drives, as a table."""

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
import sys
from typing import Any

from drive_can_bridge.cli.command import above_zero, FAILED, print_json
from drive_can_bridge.cli.drives import (
    add_words, by_short_names, complete_words, opened, read_all, source_of, split_words)
from drive_can_bridge.cli.output import fitting_table, print_table
from drive_can_bridge.client.drive import Drive, Drives, ReadOutcome
from drive_can_bridge.clock import Clock
from drive_can_bridge.core.parameters import named_value

_HEADINGS = ('drive', 'name', 'value', 'unit', 'raw', 'number', 'storage', 'description',
             'why not')
_NUMBERS = ('value', 'raw')


def define(parser: ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'Read all parameters of a drive that its profile lists, or those named: '
        'through a running bridge, or directly with --params-file. Sends reads only.')
    parser.epilog = (
        'Exit code 0: all was read. 1: something was not, its row says why. 2: wrong '
        'usage.')
    add_words(parser, complete_words, '[DRIVE] [NAME …]', '*', (
        'the drive, by its name or its full name in the ROS graph (/cell/lift), also as a shell '
        'pattern (may be left out where there is only one); names of the profile, or raw ones: '
        'p30, p613.5, x2004.10'))
    parser.add_argument('--watch', metavar='S', type=above_zero,
                        help='read again every S seconds, until Ctrl-C')


def run(args: Namespace) -> int:
    """
    Read parameters, and print them.

    :return: 0 everything, 1 not everything.
    :raises WrongUsage: it is not clear which drive is meant.
    :raises DriveCanError: another master, a bus or a bridge that is not there.
    """
    args.words[:1] = by_short_names(args, args.words[:1])
    with source_of(args) as source:
        names, wanted = split_words(source.names, args.words)
        with opened(source, names) as drives:
            return _watch(args, drives, wanted) if args.watch else _read(args, drives, wanted)


def _read(args: Namespace, drives: Drives, wanted: Sequence[str]) -> int:
    outcomes = []
    for drive in drives.values():
        names = wanted or drive.readable_names
        outcomes += [(drive, outcome) for outcome in read_all(drive, names, args.clock).values()]
    if args.json:
        print_json(*(document(drive, outcome) for drive, outcome in outcomes))
    else:
        print_table(_HEADINGS, _rows(drives, outcomes), numbers=_NUMBERS)
    return 0 if all(outcome.ok for _, outcome in outcomes) else FAILED


def _watch(args: Namespace, drives: Drives, wanted: Sequence[str]) -> int:
    """Read again and again."""
    clock: Clock = args.clock
    due = clock.now()
    live: Any = None
    if sys.stdout.isatty() and not args.json:
        from rich.live import Live
        live = Live(auto_refresh=False)
    first = True
    try:
        if live is not None:
            live.start()
        while True:
            outcomes = [(drive, outcome) for drive in drives.values()
                        for outcome in drive.read(*wanted).values()]
            if live is not None:
                live.update(fitting_table(_HEADINGS, _rows(drives, outcomes), _NUMBERS),
                            refresh=True)
            elif args.json:
                now = 1e-9 * clock.stamp()
                print_json(*({'time': round(now, 3), **document(drive, outcome)}
                             for drive, outcome in outcomes))
            else:
                if not first:
                    print()
                print_table(_HEADINGS, _rows(drives, outcomes), numbers=_NUMBERS)
            first = False
            sys.stdout.flush()
            due = max(due + args.watch, clock.now())
            clock.wait(due)
    finally:
        if live is not None:
            live.stop()


def document(drive: Drive, outcome: ReadOutcome) -> dict[str, Any]:
    """Return what ``--json`` prints of a parameter; the keys are documented."""
    from drive_can_bridge.core.codes import code_of     # takes its time
    parameter = outcome.parameter
    return {
        'drive': drive.name, 'name': outcome.name, 'value': outcome.value,
        'text': '' if parameter is None or outcome.value is None else (
            parameter.name_of(outcome.value)),
        'unit': parameter.unit if parameter else '', 'raw': outcome.raw,
        'number': parameter.number if parameter else None,
        'index': parameter.index if parameter else None,
        'subindex': parameter.subindex if parameter else None,
        'storage': parameter.storage.value if parameter and parameter.storage else None,
        'description': parameter.description if parameter else '',
        'reason': outcome.reason, 'code': code_of(outcome.reason)}


def _shown(outcome: ReadOutcome) -> str:
    """Return a value, and its name beside it."""
    return '–' if outcome.value is None else named_value(outcome.parameter, outcome.value)


def _rows(drives: Drives, outcomes: Sequence[tuple[Drive, ReadOutcome]],
          ) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for drive, outcome in outcomes:
        parameter = outcome.parameter
        rows.append((
            drive.name if len(drives) > 1 else '', outcome.name,
            _shown(outcome),
            parameter.unit if parameter else '',
            '–' if outcome.raw is None else str(outcome.raw),
            parameter.address if parameter else '',
            parameter.storage.value if parameter and parameter.storage else '',
            parameter.description if parameter else '', outcome.reason))
    return rows
