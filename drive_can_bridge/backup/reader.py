# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Read a backup, strictly: whatever is not plainly one is named, with its line, and nothing is used.

Output of ``ros2 param dump`` is read as well: it has no head, and ``null`` for what a drive did
not give.
"""

from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterator, Mapping
from pathlib import Path
import re
from typing import Any

from drive_can_bridge.backup.document import Backup, Head
from drive_can_bridge.configuration.parameter_file import read_sections
from drive_can_bridge.configuration.problems import report
from drive_can_bridge.core.errors import ConfigurationError
from drive_can_bridge.core.text import printable, TEXT_MAX
from drive_can_bridge.core.words import describe_type, show

#: how ros2 param dump writes what has no value
NOT_SET = 'null'
_COMMENT = re.compile(r'# ([a-z0-9_]+): ?(.*)')
_BRIDGE_KEYS = {'buses', 'drives'}


def read_backup(path: Path) -> Backup:
    """
    Read a backup.

    :raises ConfigurationError: it is none; a line for each problem.
    :raises OSError: it cannot be read.
    """
    sections, problems = read_sections(path)
    if len(sections) == 1:
        problems += sections[0].tree.problems
    if problems:
        raise ConfigurationError(report(problems))
    if len(sections) != 1:
        names = ', '.join(section.name for section in sections)
        raise _wrong(path, f'has sections of {len(sections)} nodes ({names}), allowed is one'
                     if sections else 'has no parameters of any node: this is no backup')
    section, = sections
    data = section.tree.data
    if _BRIDGE_KEYS & set(data):
        raise _wrong(path, f'is a parameter file of a bridge, not a backup of a drive (it has '
                           f'{", ".join(sorted(_BRIDGE_KEYS & set(data)))})')
    values = dict(_flat(data, ()))
    backup = Backup(
        str(path), section.name,
        {'.'.join(place): value for place, value in values.items() if value != NOT_SET},
        _head(path), {'.'.join(place): section.tree.line(place) for place in values})
    wrong = [backup.problem(name, f'{_described(value)}, allowed is a number, true or false')
             for name, value in backup.values.items()
             if not isinstance(value, (bool, int, float))]
    wrong += [backup.problem(name, f'a name longer than {TEXT_MAX} characters')
              for name in backup.lines if len(name) > TEXT_MAX]
    if wrong:
        raise ConfigurationError(wrong)
    if not values:
        raise _wrong(path, 'has no parameters: this is no backup')
    return backup


def _described(value: object) -> str:
    return f'{show(value)} is a string' if isinstance(value, str) else describe_type(value)


def _flat(data: Mapping[str, Any], above: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...],
                                                                             object]]:
    """Go through nested mappings: ``ros2 param dump`` splits names at their dots."""
    for key, value in data.items():
        if isinstance(value, dict):
            yield from _flat(value, (*above, key))
        else:
            yield (*above, key), value


def _head(path: Path) -> Head:
    """Read the comments before the first line that is none, encoded as YAML may be."""
    found: dict[str, str] = {}
    data = path.read_bytes()
    encoding = 'utf-16' if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)) else 'utf-8-sig'
    for line in data.decode(encoding, errors='replace').splitlines():
        line = line.strip()
        if line and not line.startswith('#'):
            break
        match = _COMMENT.fullmatch(line)
        if match is not None and match[1] in Head.__dataclass_fields__:
            found.setdefault(match[1], match[2].strip())
    return Head(**found)


def _wrong(path: Path, message: str) -> ConfigurationError:
    return ConfigurationError([printable(f'{path}: {message}', None)])
