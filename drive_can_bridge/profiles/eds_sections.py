# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The sections of an EDS or DCF file, with their lines.

The library that understands EDS files takes a file as a whole or not at all, and knows no lines.
So the file is taken apart here, and handed over object by object.
"""

from dataclasses import dataclass, field
import re

from drive_can_bridge.profiles.draft import LeftOut, Place

_SECTION = re.compile(r'\s*\[([^\[\]]*)\]\s*(?:;.*)?')
_OBJECT = re.compile(r'([0-9A-Fa-f]{4})(?:[Ss][Uu][Bb]([0-9A-Fa-f]{1,2})|Name)?')
_LISTS = frozenset(('mandatoryobjects', 'optionalobjects', 'manufacturerobjects'))


@dataclass(slots=True)
class Section:
    """
    A section.

    :param values: as written; keys are compared without case.
    :param lines: of its keys.
    """

    name: str
    line: int
    values: dict[str, str] = field(default_factory=dict)
    lines: dict[str, int] = field(default_factory=dict)

    @property
    def place(self) -> Place:
        """Where it begins."""
        return Place(self.line, f'[{self.name}]')

    def get(self, key: str) -> str:
        """Return a value; '' where there is none, or an empty one."""
        return self.values.get(key.lower(), '')

    def text(self, spellings: dict[str, str]) -> str:
        """Return the section as a file of its own would have it."""
        rows = [f'[{self.name}]']
        rows += [f'{spellings.get(key, key)}={value}' for key, value in self.values.items()]
        return '\n'.join(rows) + '\n'


@dataclass(slots=True)
class Sections:
    """
    A file, taken apart.

    :param objects: sections of objects by index and sub-index; None is the object itself.
    :param names: sections ``[1234Name]`` by index.
    :param others: all other sections, by lower-case name.
    :param doubles: sections of objects that stand twice.
    :param broken: lines that are neither sections nor keys, keys and other sections that stand
        twice.
    """

    objects: dict[tuple[int, int | None], Section] = field(default_factory=dict)
    names: dict[int, Section] = field(default_factory=dict)
    others: dict[str, Section] = field(default_factory=dict)
    doubles: list[LeftOut] = field(default_factory=list)
    broken: list[LeftOut] = field(default_factory=list)

    def listed(self) -> list[tuple[int, Place]]:
        """Return the objects that the file says it has, and where it says so."""
        found = []
        for name in sorted(_LISTS & set(self.others)):
            section = self.others[name]
            for key, value in section.values.items():
                if key.isdecimal() and re.fullmatch('0[xX][0-9a-fA-F]{1,4}', value):
                    found.append((int(value, 16), Place(section.lines[key], f'[{section.name}]')))
        return found


def take_apart(text: str) -> Sections:
    """Find the sections of a file."""
    found = Sections()
    section: Section | None = None
    for line, row in enumerate(text.split('\n'), start=1):
        stripped = row.strip()
        if not stripped or stripped[0] in ';#':
            continue
        match = _SECTION.fullmatch(row)
        if match is not None:
            section = Section(match[1].strip(), line)
            _enter(found, section)
            continue
        key, sign, value = stripped.partition('=')
        key = key.strip().lower()
        if not sign or not key or section is None:
            where = f'[{section.name}]' if section is not None else ''
            found.broken.append(LeftOut(Place(line, where), '', 'neither a section nor KEY=VALUE'))
        elif key in section.values:
            found.broken.append(LeftOut(
                Place(line, f'[{section.name}]'), '', f'{key} stands twice, the first in line '
                                                      f'{section.lines[key]} counts'))
        else:
            section.values[key] = re.split(r'(?:^|\s);', value)[0].strip()
            section.lines[key] = line
    return found


def _enter(found: Sections, section: Section) -> None:
    match = _OBJECT.fullmatch(section.name)
    first: Section
    twice = found.broken
    if match is None:
        first = found.others.setdefault(section.name.lower(), section)
    elif section.name.lower().endswith('name'):
        first = found.names.setdefault(int(match[1], 16), section)
    else:
        key = (int(match[1], 16), int(match[2], 16) if match[2] else None)
        first = found.objects.setdefault(key, section)
        twice = found.doubles
    if first is not section:
        twice.append(LeftOut(section.place, '', f'stands twice, the first in line '
                                                f'{first.line} counts'))
