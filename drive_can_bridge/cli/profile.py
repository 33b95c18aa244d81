# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The subcommand ``drive_can profile``: which parameter tables there are, and making new ones."""

from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter, SUPPRESS
import codecs
from collections.abc import Mapping, Sequence
import csv
from dataclasses import asdict
from pathlib import Path
import re
from typing import Any

from drive_can_bridge.cli.command import (
    agreed, complain, FAILED, output_path, print_json, say, WrongUsage)
from drive_can_bridge.cli.output import differs, print_table, write_atomically
from drive_can_bridge.configuration.problems import Problem
from drive_can_bridge.configuration.yaml_nodes import read_regular
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.text import counted
from drive_can_bridge.profiles.catalogue import (
    available, build_profile, Built, check, Checked, description, find, ImportFailed,
    VERIFIED_WORDS)
from drive_can_bridge.profiles.csv_import import COLUMNS, read_table, WrongColumns
from drive_can_bridge.profiles.eds_import import read_eds
from drive_can_bridge.protocols.families import FAMILIES

_HELP = {
    'list': 'which profiles there are',
    'show': 'what is in a profile',
    'check': 'whether profiles are right',
    'import': 'make a profile from an EDS, DCF or CSV file',
}
_SIGNS = {'point': '.', 'comma': ','}
#: MiB; larger files are no parameter tables, and would fill the memory
SIZE_MAX = 32
_EDS_HEAD = re.compile(r'^\s*\[(?:FileInfo|DeviceInfo|DeviceComissioning|MandatoryObjects)\]',
                       re.IGNORECASE | re.MULTILINE)
#: what is no table at all, by its first bytes
_OTHERS = (
    (b'PK\x03\x04', 'is a workbook or an archive; save its table as CSV'),
    (b'\xd0\xcf\x11\xe0', 'is an old workbook or document; save its table as CSV'),
    (b'%PDF', 'is a PDF; copy its table into a spreadsheet and save that as CSV'),
    (b'<?xml', 'is XML (an XDD, perhaps); what is read is EDS, DCF and CSV'),
)
#: marks at the beginning, longest first: UTF-32 begins like UTF-16
_MARKS = (
    (codecs.BOM_UTF32_LE, 'utf-32'), (codecs.BOM_UTF32_BE, 'utf-32'),
    (codecs.BOM_UTF8, 'utf-8-sig'), (codecs.BOM_UTF16_LE, 'utf-16'),
    (codecs.BOM_UTF16_BE, 'utf-16'),
)


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
        {'choices': tuple(_SIGNS),
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
    ('--axis',): (
        {'metavar': 'N', 'type': int,
         'help': 'whose objects an EDS file of several axes gives, counted from 1 (default: the '
                 'first)'}, None, ('import',)),
    ('--force',): (
        {'action': 'store_true', 'help': 'import an EDS file of a device that is no drive'},
        False, ('import',)),
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
        f'Columns: {", ".join(COLUMNS)}.\nHeadings in English, German and Italian are guessed; '
        '--columns says it where that is not enough:\n  --columns number=Nr,name=Bezeichnung,'
        '"scale=Faktor, intern",unit=')


def _add_options(parser: ArgumentParser, action: str = '') -> None:
    """
    Add the options of an action.

    :param action: '' for all, in front of the action: understood there, but not described again.
    """
    for flags, (what, default, actions) in _OPTIONS.items():
        if not action:
            parser.add_argument(*flags, **{**what, 'default': default, 'help': SUPPRESS})
        elif action in actions:
            parser.add_argument(*flags, **what, default=SUPPRESS)


def run(args: Namespace) -> int:
    """
    Run the requested action.

    :raises DriveCanError: it could not be done, in words.
    :raises OSError: a file cannot be read or written.
    """
    actions = {'list': _list, 'show': _show, 'check': _check, 'import': _import}
    return actions[args.action](args)


# -- what there is --------------------------------------------------------------------------------


def _list(args: Namespace) -> int:
    """Print which profiles there are."""
    documents = [_summary(name, check(path)) for name, path in available(args.directory).items()]
    if args.json:
        print_json(*documents)
        return 0
    print_table(
        ('name', 'parameters', 'verified', 'protocols', 'description', 'problems'),
        [(document['name'], str(document['parameters']),
          str(document['verified']) if document['verified'] or document['unverified'] else '',
          ', '.join(document['protocols']), document['description'],
          f'{document["problems"]}: drive_can profile check {document["path"]}'
          if document['problems'] else '') for document in documents],
        numbers=('parameters', 'verified'))
    return 0


def _summary(name: str, checked: Checked) -> dict[str, Any]:
    profile = checked.loaded.profile
    return {'name': name, 'path': str(checked.path), 'description': profile.description,
            'protocols': list(profile.protocols), 'parameters': len(profile.parameters),
            'verified': checked.count(True), 'unverified': checked.count(False),
            'problems': len(checked.problems)}


def _show(args: Namespace) -> int:
    """Print what is in a profile."""
    checked = check(find(args.name, args.directory))
    if checked.problems:
        complain('\n'.join(map(str, checked.problems)))
        return FAILED
    profile, entries = checked.loaded.profile, checked.entries
    if args.json:
        print_json(*(description(name, parameter, entries[name])
                     for name, parameter in profile.parameters.items()))
        return 0
    say(f'{profile.description or profile.name} ({", ".join(profile.protocols)})')
    say(str(checked.path))
    if profile.identity:
        print(f'identity: {", ".join(profile.identity)}')
    print()
    print_table(
        ('name', 'address', 'type', 'scale', 'unit', 'access', 'storage', 'allowed', 'verified',
         'description'),
        [_row(name, parameter) for name, parameter in profile.parameters.items()])
    return 0


def _row(name: str, parameter: Parameter) -> tuple[str, ...]:
    scale = '' if parameter.scale == 1.0 else f'{parameter.scale:.12g}'
    offset = f'{parameter.offset:+.12g}' if parameter.offset else ''
    bounded = parameter.minimum is not None or parameter.maximum is not None
    return (name, parameter.address, parameter.type.value, scale + offset, parameter.unit,
            parameter.access.value + (' protected' if parameter.protected else ''),
            parameter.storage.value if parameter.storage else '',
            parameter.range_text if bounded else '', VERIFIED_WORDS[parameter.verified],
            parameter.description)


def _check(args: Namespace) -> int:
    """Print whether profiles are right, or what is wrong with them."""
    good = True
    for path in args.files:
        checked = _checked(path)
        if checked is None:
            good = False
            continue
        good = good and not checked.problems
        if args.json:
            print_json({'file': str(path), 'ok': not checked.problems,
                        'parameters': len(checked.loaded.profile.parameters),
                        'problems': [_problem(each) for each in checked.problems],
                        'warnings': [_problem(each) for each in checked.warnings]})
            continue
        for problem in checked.problems:
            complain(str(problem))
        for warning in checked.warnings:
            complain(f'warning: {warning}')
        if not checked.problems:
            say(f'{path}: {_size(checked)}')
    return 0 if good else FAILED


def _checked(path: Path) -> Checked | None:
    try:
        return check(path)
    except OSError as error:  # the other files are checked all the same
        complain(f'{path}: {error.strerror or error}')
        return None


def _size(checked: Checked) -> str:
    profile = checked.loaded.profile
    total, sure, unsure = len(profile.parameters), checked.count(True), checked.count(False)
    trust = f', {sure} verified, {unsure} not' if sure or unsure else ''
    return f'all right: {total} parameter{"" if total == 1 else "s"}{trust}; ' \
           f'{", ".join(profile.protocols)}'


def _problem(problem: Problem) -> dict[str, Any]:
    return {'line': problem.line, 'key': problem.key, 'message': problem.message,
            'code': problem.message.code}


# -- import ---------------------------------------------------------------------------------------


def _import(args: Namespace) -> int:
    """
    Import a file.

    :raises WrongUsage: an option does not apply, or a question cannot be answered.
    :raises ImportFailed: nothing of it can be used.
    :raises OSError: a file cannot be read or written.
    """
    try:
        built = import_file(
            args.file, columns=columns_from_option(args.columns),
            sign=_SIGNS.get(args.decimal, ''), protocols=_protocols(args.protocols),
            description=args.description, file_format=args.format, axis=args.axis,
            force=args.force)
    except WrongColumns as error:
        raise WrongUsage(str(error)) from None
    if args.json and args.output is None:
        raise WrongUsage(command_sentences.json_wants_file())
    if not args.json:
        for each in (*(f' {note}' for note in built.notes), *built.left_out):
            complain(f'{args.file}:{each}')
    if args.output is None:
        print(built.text, end='')
        return 0
    data = built.text.encode('utf-8')
    if differs(args.output, data) and not agreed(
            f'{args.output} exists and holds something else. Overwrite it?', yes=args.yes,
            otherwise='Nothing was written', yes_means='overwrites it'):
        return FAILED
    write_atomically(args.output, data)
    if args.json:
        print_json({
            'file': str(args.file), 'output': str(args.output), 'entries': built.entries,
            'parameters': len(built.names), 'remarks': built.remarks,
            'protocols': list(built.protocols), 'notes': list(built.notes),
            'left_out': [asdict(each) for each in built.left_out]})
    else:
        say(f'{args.output}: {_counted(built)}')
    return 0


def _protocols(text: str) -> tuple[str, ...]:
    names = tuple(name.strip() for name in text.split(',') if name.strip())
    for name in names:
        if name not in FAMILIES:
            raise WrongUsage(command_sentences.protocol_unknown(
                word=name, there=', '.join(FAMILIES)))
    if len(set(names)) < len(names):
        raise WrongUsage(command_sentences.protocol_twice())
    return names


def _counted(built: Built) -> str:
    entries = counted(built.entries, 'entry', 'entries')
    text = f'{len(built.names)} of {entries} of the file'
    if built.left_out:
        text += f', {len(built.left_out)} left out (see above)'
    if built.remarks:
        text += f', {built.remarks} with a remark in the profile'
    return f'{text}; {", ".join(built.protocols)}'


def import_file(path: Path, *, columns: Mapping[str, str], sign: str = '',
                protocols: Sequence[str] = (), description: str = '',
                file_format: str = '', axis: int | None = None, force: bool = False) -> Built:
    """
    Return the profile that a file is imported as.

    :param columns: of a CSV table, by heading or place; the others are guessed.
    :param sign: the decimal sign of its numbers; '': as they show.
    :param file_format: ``eds`` or ``csv``; '': as its name and contents show.
    :param axis: of an EDS file, counted from 1; None: the first.
    :param force: import an EDS file of a device that is no drive.
    :raises WrongUsage: an option of EDS files, and it is none.
    :raises ImportFailed: it cannot be imported; the text begins with the name of the file.
    :raises OSError: it cannot be read, is no regular file, or is too large.
    """
    try:
        text = _decoded(read_regular(path, SIZE_MAX))
        kind = {'.dcf': 'eds', '.tsv': 'csv'}.get(path.suffix.lower(), path.suffix.lower()[1:])
        kind = file_format or kind
        if kind == 'eds' or kind != 'csv' and _EDS_HEAD.search(text):
            found = read_eds(text, protocols, axis=axis, force=force)
        elif axis is not None or force:
            raise WrongUsage(command_sentences.option_of_eds(
                option='--force' if axis is None else '--axis', file=path))
        else:
            found = read_table(text, columns, sign, protocols)
        return build_profile(found, path.name, description=description, protocols=protocols)
    except ImportFailed as error:
        raise ImportFailed(f'{path}: {error}') from None


def columns_from_option(text: str) -> dict[str, str]:
    """
    Return the columns in ``number=Nr,name=Bezeichnung``; quotes protect a comma.

    :raises WrongUsage: a column is unknown or given twice.
    """
    found: dict[str, str] = {}
    try:
        parts = next(csv.reader([re.sub(r'(\w+)\s*=\s*"', r'"\1=', text)], strict=True), [])
    except csv.Error as error:
        raise WrongUsage(f'--columns: {error}') from None
    for part in parts:
        column, sign, heading = (each.strip() for each in part.partition('='))
        if column not in COLUMNS:
            raise WrongUsage(command_sentences.no_column(word=column, there=', '.join(COLUMNS)))
        if not sign:
            raise WrongUsage(command_sentences.column_without_heading(column=column))
        if column in found:
            raise WrongUsage(command_sentences.column_twice(column=column))
        found[column] = heading
    return found


def _decoded(data: bytes) -> str:
    """
    Return the text of a file; line ends are those of Unix.

    Without a mark at its beginning a file that is valid UTF-8 is UTF-8, and any other one is what
    Windows writes in western Europe: cp1252, whose gaps are filled as latin-1 fills them.

    :raises ImportFailed: it is no text.
    """
    for head, what in _OTHERS:
        if data.startswith(head):
            raise ImportFailed(what)
    encoding = next((name for mark, name in _MARKS if data.startswith(mark)), '')
    try:
        text = data.decode(encoding or 'utf-8')
    except UnicodeDecodeError as error:
        if encoding:
            raise ImportFailed(command_sentences.no_such_text(
                encoding=encoding, byte=error.start, reason=error.reason)) from None
        text = ''.join(bytes((byte,)).decode('cp1252', 'ignore') or chr(byte) for byte in data)
    if '\0' in text:
        raise ImportFailed(command_sentences.no_text())
    return text.replace('\r\n', '\n').replace('\r', '\n')
