# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The subcommand ``drive_can profile``: which parameter tables there are, and making new ones."""

from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter, SUPPRESS
from pathlib import Path
from typing import Any

from drive_can_bridge.profiles.headings import Column
from drive_can_bridge.profiles.numerals import DecimalSign
from drive_can_bridge.protocols.families import FAMILIES

_HELP = {
    'list': 'which profiles there are',
    'show': 'what is in a profile',
    'check': 'whether profiles are right',
    'import': 'make a profile from an EDS, DCF or CSV file',
}
_COLUMNS = ', '.join(column.value for column in Column)


def add_parser(subparsers: Any) -> None:
    """Add the subcommand to the command's parser."""
    parser = subparsers.add_parser(
        'profile', help='list, show, check and import parameter tables',
        description='Profiles are the parameter tables of drive types. docs/profiles.md says how '
                    'to make one from a manual.',
        epilog='Exit code 0: everything is all right. 1: it is not. 2: wrong usage.')
    _add_common(parser, hidden=True)
    actions = parser.add_subparsers(dest='action', metavar='ACTION', required=True)
    made = {action: actions.add_parser(
        action, help=text, description=text[0].upper() + text[1:] + '.',
        formatter_class=RawDescriptionHelpFormatter) for action, text in _HELP.items()}
    for action, each in made.items():
        _add_common(each, hidden=False, directories=action in ('list', 'show'))
    made['show'].add_argument('name', metavar='NAME',
                              help='name of a profile, or a file (with / or .yaml)')
    made['check'].add_argument('files', metavar='FILE', nargs='+', type=Path)
    _add_import(made['import'])


def _add_common(parser: ArgumentParser, *, hidden: bool, directories: bool = True) -> None:
    """
    Add what may stand anywhere on the command line.

    :param hidden: in front of the action: understood, but not described again.
    """
    parser.add_argument('--json', action='store_true', default=SUPPRESS,
                        help=SUPPRESS if hidden else 'one JSON document a line')
    if directories:
        parser.add_argument('--directory', metavar='DIR', type=Path, action='append',
                            default=SUPPRESS,
                            help=SUPPRESS if hidden else 'also search this one, before the '
                            'shipped profiles (may be repeated)')


def _add_import(parser: ArgumentParser) -> None:
    parser.description = (
        'Make a profile from an EDS or DCF file (needs the Python library canopen), or from a\n'
        'table in a CSV file. What cannot be used is named with its line, the rest is imported.')
    parser.epilog = (
        f'Columns: {_COLUMNS}.\nHeadings in English, German and Italian are guessed; --columns '
        'says it where that is not enough:\n  --columns number=Nr,name=Bezeichnung,"scale=Faktor, '
        'intern",unit=')
    parser.add_argument('file', metavar='FILE', type=Path)
    parser.add_argument('-o', '--output', metavar='FILE', type=Path,
                        help='profile to write (default: standard output)')
    parser.add_argument('--columns', metavar='COLUMN=HEADING,...', default='',
                        help='which column of a CSV table holds what; HEADING may be its place, '
                             'counted from 1, or empty: there is none')
    parser.add_argument('--decimal', choices=[sign.name.lower() for sign in DecimalSign
                                              if sign is not DecimalSign.UNKNOWN],
                        help='the decimal sign of a CSV table, where its numbers do not tell')
    parser.add_argument('--protocols', metavar='A,B', default='',
                        help=f'what the drive speaks: {", ".join(FAMILIES)} (default: all that '
                             'can carry the table)')
    parser.add_argument('--description', metavar='TEXT', default='',
                        help='of the drive type (default: what an EDS file says)')
    parser.add_argument('--format', choices=('eds', 'csv'),
                        help='what the file is, where name and contents do not tell')
    parser.add_argument('--yes', action='store_true',
                        help='overwrite an output file that holds something else, without asking')


def run(args: Namespace) -> int:
    """
    Do what was asked for.

    :raises DriveCanError: it could not be done, in words.
    :raises OSError: a file cannot be read or written.
    """
    args.json = getattr(args, 'json', False)
    args.directory = getattr(args, 'directory', [])
    if args.action == 'import':
        from drive_can_bridge.cli.profile_import import run_import
        return run_import(args)
    from drive_can_bridge.cli import profile_show
    actions = {'list': profile_show.run_list, 'show': profile_show.run_show,
               'check': profile_show.run_check}
    return actions[args.action](args)
