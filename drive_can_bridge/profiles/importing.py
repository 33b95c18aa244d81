# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""From a file of a vendor, or from somebody's spreadsheet, to a profile."""

import codecs
from collections.abc import Mapping, Sequence
import csv
from pathlib import Path
import re

from drive_can_bridge.configuration.yaml_nodes import read_regular
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.profiles.build import build_profile, Built, ImportFailed
from drive_can_bridge.profiles.csv_import import COLUMNS, read_table
from drive_can_bridge.profiles.eds_import import read_eds

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


class WrongOption(DriveCanError):
    """An option does not mean anything; the text says why."""


def import_file(path: Path, *, columns: Mapping[str, str], sign: str = '',
                protocols: Sequence[str] = (), description: str = '',
                file_format: str = '') -> Built:
    """
    Make a profile of a file.

    :param columns: of a CSV table, by heading or place; the others are guessed.
    :param sign: what separates the fraction in its numbers; '': they tell.
    :param file_format: ``eds`` or ``csv``; '': what its name and contents say.
    :raises ImportFailed: it cannot be imported; the text begins with the name of the file.
    :raises OSError: it cannot be read, is no regular file, or is too large.
    """
    try:
        text = _decoded(read_regular(path, SIZE_MAX))
        kind = {'.dcf': 'eds', '.tsv': 'csv'}.get(path.suffix.lower(), path.suffix.lower()[1:])
        kind = file_format or kind
        if kind == 'eds' or kind != 'csv' and _EDS_HEAD.search(text):
            found = read_eds(text, protocols)
        else:
            found = read_table(text, columns, sign, protocols)
        return build_profile(found, path.name, description=description, protocols=protocols)
    except ImportFailed as error:
        raise ImportFailed(f'{path}: {error}') from None


def columns_from_option(text: str) -> dict[str, str]:
    """
    Read ``number=Nr,name=Bezeichnung``; a heading with a comma stands in double quotes.

    :raises WrongOption: a column is unknown or stands twice.
    """
    found: dict[str, str] = {}
    try:
        parts = next(csv.reader([re.sub(r'(\w+)\s*=\s*"', r'"\1=', text)], strict=True), [])
    except csv.Error as error:
        raise WrongOption(f'--columns: {error}') from None
    for part in parts:
        column, sign, heading = (each.strip() for each in part.partition('='))
        if column not in COLUMNS:
            raise WrongOption(f"--columns: '{column}' is no column, there are: "
                              f'{", ".join(COLUMNS)}')
        if not sign:
            raise WrongOption(f'--columns: {column} has no heading, allowed is '
                              f'{column}=HEADING')
        if column in found:
            raise WrongOption(f'--columns: {column} stands twice')
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
            raise ImportFailed(f'begins like {encoding} text and is none: byte {error.start} '
                               f'({error.reason})') from None
        text = ''.join(bytes((byte,)).decode('cp1252', 'ignore') or chr(byte) for byte in data)
    if '\0' in text:
        raise ImportFailed('is no text: it contains NUL characters')
    return text.replace('\r\n', '\n').replace('\r', '\n')
