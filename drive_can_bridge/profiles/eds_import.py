# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
From an EDS or DCF file to the entries of a profile, through the library ``canopen``.

What a section means is the library's business: types, access, limits with their signs, compact
arrays. It gets one object at a time, so that a broken section costs that entry and no other.
"""

from collections.abc import Iterator
import configparser
import io
import logging
from types import ModuleType
from typing import Any

from drive_can_bridge.profiles.draft import Draft, Found, LeftOut, Place
from drive_can_bridge.profiles.eds_sections import Section, Sections, take_apart
from drive_can_bridge.profiles.errors import ImportFailed, Unusable
from drive_can_bridge.profiles.text import one_line
from drive_can_bridge.profiles.types import access_of
from drive_can_bridge.profiles.units import unit
from drive_can_bridge.resources import command_that_brings

#: what the library needs these keys to be called
_SPELLINGS = {key.lower(): key for key in (
    'ParameterName', 'ObjectType', 'DataType', 'AccessType', 'DefaultValue', 'PDOMapping',
    'LowLimit', 'HighLimit', 'SubNumber', 'CompactSubObj', 'StorageLocation', 'NrOfEntries',
    'Factor', 'Description', 'Unit')}
#: the communication area: identifiers, mappings, the node's own settings
_COMMUNICATION = range(0x1000, 0x2000)
_TYPES = {0x01: 'bool', 0x03: 'int16', 0x04: 'int32', 0x06: 'uint16', 0x07: 'uint32'}
_TYPE_NAMES = {
    0x02: 'INTEGER8', 0x05: 'UNSIGNED8', 0x08: 'REAL32', 0x09: 'VISIBLE_STRING',
    0x0A: 'OCTET_STRING', 0x0B: 'UNICODE_STRING', 0x0C: 'TIME_OF_DAY', 0x0D: 'TIME_DIFFERENCE',
    0x0F: 'DOMAIN', 0x10: 'INTEGER24', 0x11: 'REAL64', 0x12: 'INTEGER40', 0x13: 'INTEGER48',
    0x14: 'INTEGER56', 0x15: 'INTEGER64', 0x16: 'UNSIGNED24', 0x18: 'UNSIGNED40',
    0x19: 'UNSIGNED48', 0x1A: 'UNSIGNED56', 0x1B: 'UNSIGNED64'}
#: types of an object's own, defined by sections of these numbers
_OWN_TYPES = range(0x20, 0x1000)
#: everything that the library raises about a section that makes no sense
_ERRORS = (ValueError, KeyError, AttributeError, TypeError, configparser.Error)
_ELEMENTS_MAX = 0xFE


def canopen_library() -> ModuleType:
    """
    Return the library.

    :raises ImportFailed: it is not installed.
    """
    try:
        from canopen.objectdictionary import eds
    except ImportError:
        raise ImportFailed(
            'needs the Python library canopen, which is not installed: '
            f"{command_that_brings('eds')}") from None
    # what it complains about is told here, with section and line
    logging.getLogger('canopen').setLevel(logging.CRITICAL)
    module: ModuleType = eds
    return module


def read_eds(text: str) -> Found:
    """
    Read what an EDS or DCF file offers.

    :raises ImportFailed: it is none, or the library is missing.
    """
    library = canopen_library()
    sections = take_apart(text)
    if not sections.objects:
        raise ImportFailed('is no EDS or DCF file: it has no section of an object, like [1000]')
    found = Found(description=_description(sections))
    found.left_out += sections.doubles
    found.oddities += sections.broken
    reader = _ObjectReader(library, sections, found)
    for index in sorted({index for index, _ in sections.objects}):
        reader.read(index)
    for index, place in sections.listed():
        if (index, None) not in sections.objects:
            found.left_out.append(LeftOut(place, f'{index:04X}h', f'section [{index:04X}] is '
                                                                  'missing'))
    if reader.counts:
        found.notes.append(f'{reader.counts} sub-indices 0 left out: they hold the number of '
                           'entries')
    return found


def _description(sections: Sections) -> str:
    info = sections.others.get('deviceinfo')
    words = [info.get('VendorName'), info.get('ProductName')] if info is not None else []
    return one_line(' '.join(filter(None, words)))


class _ObjectReader:
    """Reads one object after the other."""

    def __init__(self, library: ModuleType, sections: Sections, found: Found) -> None:
        self._library = library
        self._sections = sections
        self._found = found
        self.counts = 0

    def read(self, index: int) -> None:
        """Read an object with all its sub-indices."""
        head = self._sections.objects.get((index, None))
        subs = sorted(sub for each, sub in self._sections.objects
                      if each == index and sub is not None)
        if head is None:
            for sub in subs:
                section = self._sections.objects[index, sub]
                self._leave_out(section, f'section [{index:04X}] is missing')
            return
        try:
            entry = self._understood(index, head)
            if not hasattr(entry, 'subindices'):
                self._take(head, entry)
                return
        except (*_ERRORS, Unusable) as error:
            self._leave_out(head, _words(error, head))
            for sub in subs:
                self._leave_out(self._sections.objects[index, sub],
                                f'[{index:04X}] in line {head.line} cannot be understood')
            return
        for sub in subs:
            self._read_sub(index, sub, head)
        if head.get('CompactSubObj'):
            self._read_compact(index, head)
        else:
            self._check_count(index, head, subs)

    def _read_sub(self, index: int, sub: int, head: Section) -> None:
        section = self._sections.objects[index, sub]
        try:
            entry = self._understood(index, head, section)
            if sub == 0 and entry[0].data_type == 0x05:
                self.counts += 1
                return
            self._take(section, entry[sub], parent=entry.name)
        except (*_ERRORS, Unusable) as error:
            self._leave_out(section, _words(error, section))

    def _read_compact(self, index: int, head: Section) -> None:
        try:
            count = int(head.get('CompactSubObj'), 0)
            if not 0 <= count <= _ELEMENTS_MAX:
                raise Unusable(f'CompactSubObj {count} is out of range')
            entry = self._understood(index, head)
            # with names the library calls the others after the first one
            named = self._understood(index, head, self._sections.names.get(index))
            for sub in range(1, count + 1):
                self._take(head, (named if sub in named.subindices else entry)[sub],
                           parent=entry.name)
        except (*_ERRORS, Unusable) as error:
            self._leave_out(head, _words(error, head))

    def _check_count(self, index: int, head: Section, subs: list[int]) -> None:
        """Say when there are fewer sub-indices than the object says it has."""
        try:
            count = int(head.get('SubNumber') or '0', 0)
        except ValueError:
            self._wonder(head, f"SubNumber '{head.get('SubNumber')}' is no number")
            return
        if count > len(subs):
            missing = count - len(subs)
            self._wonder(head, f'{missing} of {count} sections [{index:04X}sub…] '
                               f'{"is" if missing == 1 else "are"} missing')

    def _understood(self, index: int, *sections: Section | None) -> Any:
        """Let the library read an object."""
        parts = ['[DeviceInfo]\n']
        for section in sections:
            if section is not None:
                parts += [part.text(_SPELLINGS) for part in (section, *self._own_type(section))]
        source = io.StringIO(''.join(parts))
        return self._library.import_eds(source, node_id=None)[index]

    def _own_type(self, section: Section) -> Iterator[Section]:
        """Yield what defines the type of a section, where it is not one of the standard."""
        try:
            number = int(section.get('DataType') or '0', 0)
        except ValueError:
            return
        if number in _OWN_TYPES:
            for name in (f'{number:x}', f'{number:x}sub1'):
                other = self._sections.others.get(name)
                if other is not None:
                    yield Section(other.name.upper().replace('SUB', 'sub'), other.line,
                                  other.values, other.lines)

    def _take(self, section: Section, variable: Any, parent: str = '') -> None:
        """
        Make a draft of a variable.

        :raises Unusable: it has no place in a profile.
        """
        kind = _TYPES.get(variable.data_type)
        if kind is None:
            name = _TYPE_NAMES.get(variable.data_type, f'data type {variable.data_type:04X}h')
            raise Unusable(f'{name} is none of the types of 16 or 32 bits')
        entry: dict[str, Any] = {
            'index': variable.index, 'subindex': variable.subindex, 'type': kind,
            'access': access_of(variable.access_type)}
        remarks: list[str] = []
        scale = self._scale(section, variable)
        if kind == 'bool':
            scale = 1.0
        else:
            entry.update(_limits(section, variable, scale))
            if unit(str(getattr(variable, 'unit', ''))):
                entry['unit'] = unit(str(variable.unit))
            if scale != 1.0:
                entry['scale'] = scale
        storage = _storage(str(variable.storage_location or ''))
        if storage and entry['access'] != 'ro':
            entry['storage'] = storage
        if variable.index in _COMMUNICATION and entry['access'] != 'ro':
            entry['protected'] = True
        # the library calls an element of a record by both names
        own = one_line(str(variable.name).rpartition('.')[2] if parent else str(variable.name))
        title = f'{one_line(parent)} {own}' if parent and parent not in own else own
        extra = one_line(str(getattr(variable, 'description', '') or ''))
        entry['description'] = '; '.join(filter(None, (title, extra)))
        self._found.drafts.append(Draft(Place(section.line, f'[{section.name}]'), title, entry,
                                        remarks))

    def _scale(self, section: Section, variable: Any) -> float:
        if section.get('Factor') and float(section.get('Factor')) != variable.factor:
            raise Unusable(f"Factor '{section.get('Factor')}' is no number")
        return float(variable.factor)

    def _leave_out(self, section: Section, reason: str) -> None:
        self._found.left_out.append(
            LeftOut(section.place, one_line(section.get('ParameterName')), reason))

    def _wonder(self, section: Section, reason: str) -> None:
        self._found.oddities.append(
            LeftOut(section.place, one_line(section.get('ParameterName')), reason))


def _limits(section: Section, variable: Any, scale: float) -> dict[str, float]:
    """
    Return the limits as physical values.

    :raises Unusable: one of them cannot be read, which the library passes over in silence.
    """
    found = {}
    for key, name, limit in (('LowLimit', 'minimum', variable.min),
                             ('HighLimit', 'maximum', variable.max)):
        if section.get(key) and limit is None:
            raise Unusable(f"{key} '{section.get(key)}' is no number")
        if limit is not None:
            found[name] = float(f'{limit * scale:.12g}')
    ends = [limit for limit in (variable.min, variable.max) if limit is not None]
    if len(ends) == 2 and ends[0] > ends[1]:
        raise Unusable(f'LowLimit {ends[0]} is above HighLimit {ends[1]}')
    return found


def _storage(location: str) -> str:
    """Return where a value is kept, as far as the names in use say it."""
    word = location.upper()
    if word == 'RAM':
        return 'ram'
    kept = ('PERSIST', 'EEPROM', 'NVM', 'FLASH')
    return 'eeprom' if word.startswith(kept) else ''


def _words(error: Exception, section: Section) -> str:
    """Say what is wrong with a section, whatever the library called it."""
    if isinstance(error, Unusable):
        return str(error)
    if isinstance(error, configparser.NoOptionError):
        return f'{error.option} is missing'
    for key in ('ObjectType', 'DataType', 'SubNumber', 'CompactSubObj', 'PDOMapping', 'Factor'):
        value = section.get(key)
        try:
            if key.lower() in section.values:
                float(value) if key == 'Factor' else int(value, 0)
        except ValueError:
            return f"{key} '{value}' is no number" if value else f'{key} is empty'
    if isinstance(error, (KeyError, AttributeError, TypeError)):
        return 'is no object that can be understood'
    return one_line(str(error)) or 'is no object that can be understood'
