# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can profile import``: a profile from an EDS, DCF or CSV file."""

from argparse import Namespace
from pathlib import Path

from drive_can_bridge.cli.command import complain, FAILED, say, WrongUsage
from drive_can_bridge.cli.questions import agreed
from drive_can_bridge.cli.tables import print_json
from drive_can_bridge.cli.whole_file import differs, write_whole
from drive_can_bridge.profiles.draft import LeftOut
from drive_can_bridge.profiles.importing import (
    columns_from_option, FileFormat, import_file, Imported, WrongOption,
)
from drive_can_bridge.profiles.numerals import DecimalSign
from drive_can_bridge.profiles.table import WrongColumns
from drive_can_bridge.protocols.families import FAMILIES


def run_import(args: Namespace) -> int:
    """
    Import a file.

    :raises WrongUsage: an option means nothing, or nobody can be asked.
    :raises ImportFailed: nothing of it can be used.
    :raises OSError: a file cannot be read or written.
    """
    try:
        imported = import_file(
            args.file, columns=columns_from_option(args.columns),
            sign=DecimalSign[args.decimal.upper()] if args.decimal else DecimalSign.UNKNOWN,
            protocols=_protocols(args.protocols), description=args.description,
            file_format=FileFormat(args.format) if args.format else None)
        if args.json and args.output is None:
            raise WrongOption('--json says on standard output what became of the file: say where '
                              'the profile goes with -o FILE')
    except (WrongOption, WrongColumns) as error:
        raise WrongUsage(str(error)) from None
    if not args.json:
        _report(args.file, imported)
    if args.output is None:
        print(imported.built.text, end='')
        return 0
    data = imported.built.text.encode('utf-8')
    if differs(args.output, data) and not agreed(
            f'{args.output} exists and holds something else. Overwrite it?', yes=args.yes,
            otherwise='Nothing was written', yes_means='overwrites it'):
        return FAILED
    write_whole(args.output, data)
    if args.json:
        _report_json(args, imported)
    else:
        say(f'{args.output}: {_counted(imported)}')
    return 0


def _protocols(text: str) -> tuple[str, ...]:
    names = tuple(name.strip() for name in text.split(',') if name.strip())
    for name in names:
        if name not in FAMILIES:
            raise WrongOption(f"--protocols: '{name}' is unknown, there are: "
                              f'{", ".join(FAMILIES)}')
    if len(set(names)) < len(names):
        raise WrongOption('--protocols: one of them stands twice')
    return names


# -- what is said ---------------------------------------------------------------------------------


def _report(file: Path, imported: Imported) -> None:
    """Say on standard error what the file was taken for, and what of it is left out and why."""
    for note in imported.found.notes:
        complain(f'{file}: {note}')
    for each in imported.found.complaints:
        complain(f'{file}:{each}')


def _counted(imported: Imported) -> str:
    built, found = imported.built, imported.found
    text = f'{len(built.names)} of {built.entries} entries of the file'
    if found.left_out:
        text += f', {len(found.left_out)} left out (see above)'
    if built.remarks:
        text += f', {built.remarks} with a remark in the profile'
    return f'{text}; {", ".join(built.protocols)}'


def _report_json(args: Namespace, imported: Imported) -> None:
    built, found = imported.built, imported.found
    print_json({
        'file': str(args.file), 'output': str(args.output), 'entries': built.entries,
        'parameters': len(built.names), 'remarks': built.remarks,
        'protocols': list(built.protocols), 'notes': found.notes,
        'left_out': [_document(each) for each in found.left_out],
        'oddities': [_document(each) for each in found.oddities]})


def _document(each: LeftOut) -> dict[str, object]:
    return {'line': each.place.line, 'section': each.place.section, 'what': each.what,
            'reason': each.reason}
