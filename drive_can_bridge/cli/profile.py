# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The subcommand ``drive_can profile``: which parameter tables there are, and making new ones."""

from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter, SUPPRESS
from pathlib import Path
from typing import Any

from drive_can_bridge.cli.arguments import output_path
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


#: option -> what argparse wants to know, what it is without, and the actions that have it
_OPTIONS: dict[tuple[str, ...], tuple[dict[str, Any], Any, tuple[str, ...]]] = {
    ('--json',): ({'action': 'store_true', 'help': 'one JSON document a line'}, False,
                  tuple(_HELP)),
    ('--directory',): (
        {'metavar': 'DIR', 'type': Path, 'action': 'append',
         'help': 'also search this one, before the shipped profiles (may be repeated)'},
        [], ('list', 'show')),
    ('-o', '--output'): (
        {'metavar': 'FILE', 'type': output_path,
         'help': 'profile to write (default: standard output)'},
        None, ('import',)),
    ('--columns',): (
        {'metavar': 'COLUMN=HEADING,...',
         'help': 'which column of a CSV table holds what; HEADING may be its place, counted from '
                 '1, or empty: there is none'}, '', ('import',)),
    ('--decimal',): (
        {'choices': [sign.name.lower() for sign in DecimalSign if sign is not DecimalSign.UNKNOWN],
         'help': 'the decimal sign of a CSV table, where its numbers do not tell'},
        None, ('import',)),
    ('--protocols',): (
        {'metavar': 'A,B', 'help': f'what the drive speaks: {", ".join(FAMILIES)} (default: all '
                                   'that can carry the table)'}, '', ('import',)),
    ('--description',): (
        {'metavar': 'TEXT', 'help': 'of the drive type (default: what an EDS file says)'},
        '', ('import',)),
    ('--format',): (
        {'choices': ('eds', 'csv'),
         'help': 'what the file is, where name and contents do not tell'}, None, ('import',)),
    ('--yes',): (
        {'action': 'store_true',
         'help': 'overwrite an output file that holds something else, without asking'},
        False, ('import',)),
}


def define(parser: ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'Profiles are the parameter tables of drive types. docs/profiles.md says how '
        'to make one from a manual.')
    parser.epilog = 'Exit code 0: everything is all right. 1: it is not. 2: wrong usage.'
    _add_options(parser)
    actions = parser.add_subparsers(dest='action', metavar='ACTION', required=True,
                                    help=', '.join(_HELP))
    made = {action: actions.add_parser(
        action, help=text, description=text[0].upper() + text[1:] + '.',
        formatter_class=RawDescriptionHelpFormatter) for action, text in _HELP.items()}
    for action, each in made.items():
        _add_options(each, action)
    made['show'].add_argument('name', metavar='NAME',
                              help='name of a profile, or a file (with / or .yaml)')
    made['check'].add_argument('files', metavar='FILE', nargs='+', type=Path)
    made['import'].add_argument('file', metavar='FILE', type=Path)
    made['import'].description = (
        'Make a profile from an EDS or DCF file (needs the Python library canopen), or from a\n'
        'table in a CSV file. What cannot be used is named with its line, the rest is imported.')
    made['import'].epilog = (
        f'Columns: {_COLUMNS}.\nHeadings in English, German and Italian are guessed; --columns '
        'says it where that is not enough:\n  --columns number=Nr,name=Bezeichnung,"scale=Faktor, '
        'intern",unit=')


def _add_options(parser: ArgumentParser, action: str = '') -> None:
    """
    Add the options of an action.

    :param action: '' for all, in front of the action: understood there, but not described again.
    """
    for flags, (what, _, actions) in _OPTIONS.items():
        if not action:
            parser.add_argument(*flags, **{**what, 'default': SUPPRESS, 'help': SUPPRESS})
        elif action in actions:
            parser.add_argument(*flags, **what, default=SUPPRESS)


def run(args: Namespace) -> int:
    """
    Do what was asked for.

    :raises DriveCanError: it could not be done, in words.
    :raises OSError: a file cannot be read or written.
    """
    for flags, (_, default, _) in _OPTIONS.items():
        name = flags[-1].removeprefix('--')
        setattr(args, name, getattr(args, name, default))
    if args.action == 'import':
        from drive_can_bridge.cli.profile_import import run_import
        return run_import(args)
    from drive_can_bridge.cli import profile_show
    actions = {'list': profile_show.run_list, 'show': profile_show.run_show,
               'check': profile_show.run_check}
    return actions[args.action](args)
