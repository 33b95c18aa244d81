# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""From a file of a vendor, or from somebody's spreadsheet, to a profile."""

from collections.abc import Mapping, Sequence
import csv
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
import re

from drive_can_bridge.configuration.regular_file import read_regular
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.profiles.build import build_profile, Built
from drive_can_bridge.profiles.csv_import import read_table
from drive_can_bridge.profiles.decoding import decoded
from drive_can_bridge.profiles.draft import Found
from drive_can_bridge.profiles.eds_import import read_eds
from drive_can_bridge.profiles.errors import ImportFailed
from drive_can_bridge.profiles.headings import Column
from drive_can_bridge.profiles.numerals import DecimalSign

#: MiB; larger files are no parameter tables, and would fill the memory
SIZE_MAX = 32
_EDS_HEAD = re.compile(r'^\s*\[(?:FileInfo|DeviceInfo|DeviceComissioning|MandatoryObjects)\]',
                       re.IGNORECASE | re.MULTILINE)


class WrongOption(DriveCanError):
    """An option does not mean anything; the text says why."""


class FileFormat(Enum):
    """What a file is."""

    EDS = 'eds'
    CSV = 'csv'


@dataclass(frozen=True, slots=True)
class Imported:
    """What became of a file: a profile, what is in the file, and what is left out of it."""

    built: Built
    found: Found


def import_file(path: Path, *, columns: Mapping[Column, str], sign: DecimalSign,
                protocols: Sequence[str] = (), description: str = '',
                file_format: FileFormat | None = None) -> Imported:
    """
    Make a profile of a file.

    :param columns: of a CSV table, by heading or place; the others are guessed.
    :param file_format: None: what its name and contents say.
    :raises ImportFailed: it cannot be imported; the text begins with the name of the file.
    :raises OSError: it cannot be read, is no regular file, or is too large.
    """
    try:
        text = decoded(read_regular(path, SIZE_MAX))
        kind = file_format or _format_of(path, text)
        found = read_eds(text) if kind is FileFormat.EDS else read_table(text, columns, sign)
        built = build_profile(found, path.name, description=description, protocols=protocols)
    except ImportFailed as error:
        raise ImportFailed(f'{path}: {error}') from None
    return Imported(built, found)


def _format_of(path: Path, text: str) -> FileFormat:
    if path.suffix.lower() in ('.eds', '.dcf'):
        return FileFormat.EDS
    if path.suffix.lower() in ('.csv', '.tsv'):
        return FileFormat.CSV
    return FileFormat.EDS if _EDS_HEAD.search(text) else FileFormat.CSV


def columns_from_option(text: str) -> dict[Column, str]:
    """
    Read ``number=Nr,name=Bezeichnung``; a heading with a comma stands in double quotes.

    :raises WrongOption: a column is unknown or stands twice.
    """
    found: dict[Column, str] = {}
    try:
        parts = next(csv.reader([re.sub(r'(\w+)\s*=\s*"', r'"\1=', text)], strict=True), [])
    except csv.Error as error:
        raise WrongOption(f'--columns: {error}') from None
    known = ', '.join(column.value for column in Column)
    for part in parts:
        key, sign, heading = part.partition('=')
        try:
            column = Column(key.strip().lower())
        except ValueError:
            raise WrongOption(f"--columns: '{key.strip()}' is no column, there are: {known}") \
                from None
        if not sign:
            raise WrongOption(f'--columns: {column.value} has no heading, allowed is '
                              f'{column.value}=HEADING')
        if column in found:
            raise WrongOption(f'--columns: {column.value} stands twice')
        found[column] = heading.strip()
    return found
