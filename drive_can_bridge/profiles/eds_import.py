# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
From an EDS or DCF file to the entries of a profile, through the library ``canopen``.

The library knows types, limits with their signs, and compact arrays; but it takes a file as a
whole or not at all, and knows no lines. So the file is handed over object by object: a broken
section costs that entry and no other.

Standard objects of CiA 402 have names, bits, values and units of the shipped profile
``cia402_servo``; units that are every maker's own are taken from the file, else raw.
"""

from collections.abc import Sequence
import configparser
from dataclasses import dataclass, field
import io
import logging
import math
import re
from types import ModuleType
from typing import Any

from drive_can_bridge.profiles.catalogue import check, Checked, Draft, Found, ImportFailed, LeftOut
from drive_can_bridge.profiles.csv_import import access_of
from drive_can_bridge.profiles.names import one_line, rounded, unit, Unusable
from drive_can_bridge.resources import command_that_brings, profiles_directory

#: how the library needs these keys to be written
_SPELLINGS = {key.lower(): key for key in (
    'ParameterName', 'ObjectType', 'DataType', 'AccessType', 'DefaultValue', 'PDOMapping',
    'LowLimit', 'HighLimit', 'SubNumber', 'CompactSubObj', 'StorageLocation', 'NrOfEntries',
    'Factor', 'Description', 'Unit')}
_HEADING = re.compile(r'\s*\[([^\[\]]*)\]\s*(?:;.*)?')
#: of CompactSubObj: each element has a section of its own
_ZERO = re.compile('0+|0x0+', re.IGNORECASE)
_OBJECT = re.compile(r'([0-9a-f]{4})(?:sub([0-9a-f]{1,2}))?')
#: the communication area: identifiers, mappings, the node's own settings
_COMMUNICATION = range(0x1000, 0x2000)
#: data types of CiA 301
_TYPES = {
    0x01: 'bool', 0x02: 'int8', 0x03: 'int16', 0x04: 'int32', 0x05: 'uint8', 0x06: 'uint16',
    0x07: 'uint32', 0x08: 'REAL32', 0x09: 'VISIBLE_STRING', 0x0A: 'OCTET_STRING',
    0x0B: 'UNICODE_STRING', 0x0C: 'TIME_OF_DAY', 0x0D: 'TIME_DIFFERENCE', 0x0F: 'DOMAIN',
    0x10: 'INTEGER24', 0x11: 'REAL64', 0x15: 'INTEGER64', 0x16: 'UNSIGNED24', 0x1B: 'UNSIGNED64'}
#: CiA 402: control word and status word, which are built in
_BUILT_IN = (0x6040, 0x6041)
#: profile of the objects that CiA 402 knows; entries of it that are not verified have units of
#: every maker's own, and are placeholders there
_STANDARD = 'cia402_servo'
#: what those entries have in common with the one that they stand for
_MEANING = ('bits', 'values', 'neutral', 'neutral_from', 'limit', 'protected')
#: numerators and denominators of 60A8h and 60A9h (bits 23 to 8; above them a power of ten) in the
#: notation of CiA 303-2, as in the files of maxon's EPOS4: unit, and how many of it
_SI_UNITS = {0xB400: ('rev', 1.0), 0xB500: ('inc', 1.0), 0x4100: ('deg', 1.0),
             0x1000: ('rad', 1.0), 0xB447: ('rpm', 1.0), 0xB403: ('rpm', 60.0),
             0xB503: ('inc/s', 1.0), 0x4103: ('deg/s', 1.0), 0x1003: ('rad/s', 1.0)}
#: revolutions by which a command may miss where the axis stays, and still arms; in other units
_ARMING = 0.01
_OF_A_REVOLUTION = {'rev': 1.0, 'deg': 360.0, 'rad': 2.0 * math.pi}
#: everything that the library raises about a section that makes no sense
_ERRORS = (ValueError, OverflowError, KeyError, AttributeError, TypeError,
           configparser.Error)


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


@dataclass(slots=True)
class Section:
    """A section with its values as written; keys are compared without case."""

    name: str
    line: int
    values: dict[str, str] = field(default_factory=dict)

    def get(self, key: str) -> str:
        """Return a value; '' where there is none, or an empty one."""
        return self.values.get(key.lower(), '')

    def text(self) -> str:
        """Return the section as a file of its own would have it, and the library needs it."""
        name = re.sub('sub', 'sub', self.name, flags=re.IGNORECASE)
        return f'[{name}]\n' + ''.join(
            f'{_SPELLINGS.get(key, key)}={value}\n' for key, value in self.values.items()
            if key != 'compactsubobj' or not _ZERO.fullmatch(value))

    def lost(self, reason: str) -> LeftOut:
        """Say why it is not in the profile."""
        return LeftOut(self.line, f'[{self.name}]', one_line(self.get('ParameterName')), reason)


def _take_apart(text: str, found: Found) -> dict[str, Section]:
    """Return the sections of a file by name in lower case, and note what is odd."""
    sections: dict[str, Section] = {}
    section = Section('', 0)
    for line, row in enumerate(text.split('\n'), start=1):
        stripped = row.strip()
        heading = _HEADING.fullmatch(row)
        key, sign, value = (each.strip() for each in stripped.partition('='))
        if not stripped or stripped[0] in ';#':
            continue
        if heading is not None:
            section = Section(heading[1].strip(), line)
            first = sections.setdefault(section.name.lower(), section)
            twice = f'stands twice, the first in line {first.line} counts'
            if first is not section and _OBJECT.fullmatch(section.name.lower()):
                found.left_out.append(section.lost(twice))
            elif first is not section:
                found.notes.append(f'line {line}: [{section.name}] {twice}')
        elif not sign or not key or not section.line:
            found.notes.append(f'line {line}: neither a section nor KEY=VALUE')
        elif key.lower() in section.values:
            found.notes.append(f'line {line}: {key} stands twice in [{section.name}], the first '
                               'counts')
        else:
            section.values[key.lower()] = re.split(r'(?:^|\s);', value)[0].strip()
    return sections


def read_eds(text: str, protocols: Sequence[str] = ()) -> Found:
    """
    Read what an EDS or DCF file offers.

    :param protocols: that the drive speaks; none: cia402 where the file has its control word and
        status word, else canopen_pkw.
    :raises ImportFailed: it is none, or the library is missing.
    """
    library = canopen_library()
    found = Found()
    sections = _take_apart(text, found)
    indices = sorted({match[1] for match in map(_OBJECT.fullmatch, sections) if match})
    if not indices:
        raise ImportFailed('is no EDS or DCF file: it has no section of an object, like [1000]')
    info = sections.get('deviceinfo', Section('', 0))
    found.description = one_line(f'{info.get("VendorName")} {info.get("ProductName")}')
    controlled = {f'{index:04x}' for index in _BUILT_IN} <= sections.keys()
    found.protocols = ('cia402' if controlled else 'canopen_pkw',)
    standard = (tuple(protocols) or found.protocols) == ('cia402',)
    reader = _ObjectReader(library, sections, found, bytes_stay=standard)
    for index in indices:
        reader.read(index)
    for name in ('mandatoryobjects', 'optionalobjects', 'manufacturerobjects'):
        for key, value in sections.get(name, Section('', 0)).values.items():
            listed = re.fullmatch('0x([0-9a-f]{1,4})', value.lower())
            if key.isdecimal() and listed and f'{int(listed[1], 16):04x}' not in sections:
                found.left_out.append(sections[name].lost(
                    f'section [{int(listed[1], 16):04X}] is missing'))
    if reader.counts:
        found.notes.append(f'{reader.counts} sub-indices 0 left out: they hold the number of '
                           'entries')
    if standard:
        _standardise(found, {index: _si_unit(sections.get(index, info))
                             for index in ('60a8', '60a9')}, _turning(sections))
    return found


class _ObjectReader:
    """Reads one object after the other."""

    def __init__(self, library: ModuleType, sections: dict[str, Section], found: Found, *,
                 bytes_stay: bool) -> None:
        self._library = library
        self._sections = sections
        self._found = found
        self._types = tuple(_TYPES[code] for code in (1, 2, 3, 4, 5, 6, 7)
                            if bytes_stay or code not in (2, 5))
        self.counts = 0

    def read(self, index: str) -> None:
        """Read an object with all its sub-indices."""
        head = self._sections.get(index)
        subs = [section for name, section in self._sections.items()
                if name.startswith(f'{index}sub') and _OBJECT.fullmatch(name)]
        if head is None:
            reason = f'section [{index.upper()}] is missing'
            self._found.left_out += [section.lost(reason) for section in subs]
            return
        reason = f'[{head.name}] in line {head.line} cannot be understood'
        try:
            entry = self._understood(index, head)
            if not hasattr(entry, 'subindices'):
                self._take(head, entry)
            elif head.get('CompactSubObj'):
                self._read_compact(index, head)
        except (*_ERRORS, Unusable) as error:
            self._found.left_out.append(head.lost(_words(error)))
            self._found.left_out += [section.lost(reason) for section in subs]
            return
        for section in subs if hasattr(entry, 'subindices') else ():
            try:
                record = self._understood(index, head, section)
                number = int(section.name[7:], 16)
                if not number and record[0].data_type == 0x05:
                    self.counts += 1
                    continue
                self._take(section, record[number], parent=entry.name)
            except (*_ERRORS, Unusable) as error:
                self._found.left_out.append(section.lost(_words(error)))

    def _read_compact(self, index: str, head: Section) -> None:
        count = int(head.get('CompactSubObj'), 0)
        if not 0 <= count <= 0xFE:
            raise Unusable(f'CompactSubObj {count} is out of range')
        entry = self._understood(index, head)
        # the library wants a name for each of the first ones, and calls others after the first
        names = self._sections.get(f'{index}name', Section('', 0))
        for number, variable in [(each, entry[each]) for each in range(1, count + 1)]:
            variable.name = names.get(str(number)) or variable.name
            self._take(head, variable, parent=entry.name)

    def _understood(self, index: str, *sections: Section) -> Any:
        """Let the library read an object."""
        parts = ['[DeviceInfo]\n']
        for section in sections:
            _check_numbers(section)
            parts.append(section.text())
            # a type of an object's own, as some editors make for limits
            own = self._sections.get(f'{int(section.get("DataType") or "0", 0):x}sub1')
            if own is not None:
                own.name = own.name.upper().replace('SUB', 'sub')
                parts.append(own.text())
        return self._library.import_eds(io.StringIO(''.join(parts)), node_id=None)[int(index, 16)]

    def _take(self, section: Section, variable: Any, parent: str = '') -> None:
        """
        Make a draft of a variable.

        :raises Unusable: it has no place in a profile.
        """
        kind = _TYPES.get(variable.data_type, f'data type {variable.data_type:04X}h')
        if kind not in self._types:
            raise Unusable(f'{kind} is none of the types of '
                           f'{"8, " if "uint8" in self._types else ""}16 or 32 bits')
        entry: dict[str, Any] = {
            'index': variable.index, 'subindex': variable.subindex, 'type': kind,
            'access': access_of(variable.access_type)}
        if kind != 'bool':
            scale = rounded(float(variable.factor))
            entry.update(_limits(section, variable, scale))
            entry.update({'scale': scale} if scale != 1.0 else {})
            unit_text = unit(str(getattr(variable, 'unit', '')))
            entry.update({'unit': unit_text} if unit_text else {})
        writable = entry['access'] != 'ro'
        storage = str(variable.storage_location or '').upper()
        if writable and storage.startswith(('RAM', 'PERSIST', 'EEPROM', 'NVM', 'FLASH')):
            entry['storage'] = 'ram' if storage.startswith('RAM') else 'eeprom'
        if writable and variable.index in _COMMUNICATION:
            entry['protected'] = True
        # the library calls an element of a record by both names
        own = one_line(str(variable.name).rpartition('.')[2] if parent else str(variable.name))
        title = f'{one_line(parent)} {own}' if parent and parent not in own else own
        extra = one_line(str(getattr(variable, 'description', '') or ''))
        entry['description'] = '; '.join(filter(None, (title, extra)))
        self._found.drafts.append(Draft(section.line, f'[{section.name}]', title, entry))


def _check_numbers(section: Section) -> None:
    """
    Look at what the library passes over in silence, or has no words for.

    :raises Unusable: a key is missing or no number.
    """
    for key in ('ObjectType', 'DataType', 'CompactSubObj', 'PDOMapping', 'Factor'):
        value = section.get(key)
        try:
            if key.lower() in section.values:
                float(value) if key == 'Factor' else int(value, 0)
        except ValueError:
            raise Unusable(f"{key} '{value}' is no number" if value else f'{key} is empty') \
                from None


def _words(error: Exception) -> str:
    """Say what is wrong with a section, whatever the library called it."""
    if isinstance(error, configparser.NoOptionError):
        return f'{error.option} is missing'
    return str(error) if isinstance(error, Unusable) else 'is no object that can be understood'


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
            found[name] = rounded(limit * scale)
    if variable.min is not None and variable.max is not None and variable.min > variable.max:
        raise Unusable(f'LowLimit {variable.min} is above HighLimit {variable.max}')
    return found


# -- CiA 402 --------------------------------------------------------------------------------------


def _value(section: Section) -> int | None:
    """Return what the file says that an object holds; None: it does not."""
    try:
        return int(section.get('ParameterValue') or section.get('DefaultValue'), 0)
    except ValueError:
        return None


def _turning(sections: dict[str, Section]) -> str:
    """Say what makes the revolutions that positions are counted in: CiA 402 has a gear, 6091h."""
    motor, shaft = (_value(sections.get(name, Section('', 0))) for name in (
        '6091sub1', '6091sub2'))
    if motor and shaft and motor != shaft:
        return (f'of the joint: 60A8h counts behind the gear, 6091h = {motor}:{shaft} '
                '(joint: gear_ratio: 1.0)')
    return ('of the motor: 60A8h counts before any gear that 6091h does not name '
            '(joint: gear_ratio)')


def _si_unit(section: Section) -> tuple[str, float] | None:
    """Return the unit that 60A8h or 60A9h names in the file, and how many of it a step is."""
    value = _value(section)
    if value is None:
        return None
    name, count = _SI_UNITS.get(value >> 8 & 0xFFFF, ('', 0.0))
    exponent = value >> 24 & 0xFF
    return (name, count * 10.0 ** (exponent - (exponent & 0x80) * 2)) if name else None


def _standardise(found: Found, units: dict[str, tuple[str, float] | None], turning: str) -> None:
    """
    Call standard objects by their names, and say what is known of them.

    :param turning: what makes the revolutions of positions.
    """
    shipped = check(profiles_directory() / f'{_STANDARD}.yaml')
    known = {(entry['index'], entry['subindex']): name for name, entry in shipped.entries.items()}
    found.drafts = [draft for draft in found.drafts if draft.entry['index'] not in _BUILT_IN]
    for draft in found.drafts:
        draft.name = known.get((draft.entry['index'], draft.entry['subindex']), '')
    names = {draft.name for draft in found.drafts}
    raw = []
    for draft in list(found.drafts):
        try:
            if not _complete(draft, shipped, units, names, turning):
                raw.append(draft)
        except Unusable as error:
            found.drafts.remove(draft)
            found.left_out.append(LeftOut(draft.line, draft.section, draft.title, str(error)))
    standard = [draft.name for draft in raw if draft.name]
    others = sum(not draft.name and draft.entry['index'] not in _COMMUNICATION for draft in raw)
    found.notes.append(f'CiA 402: {len(names - {""})} standard objects have the names of the '
                       f'profile {_STANDARD}; control word and status word are built in')
    if standard:
        found.notes.append(f'raw, because their unit is the maker\'s own: {", ".join(standard)}; '
                           'scale and unit stand in the manual')
    if others:
        found.notes.append(f'{others} objects of the maker have no unit in the file: they are raw')
    if 'store_parameters' in names:
        found.sections['restore'] = shipped.loaded.tree.data['restore']
    if 'fault_code' in names:
        found.sections['fault'] = shipped.loaded.tree.data['fault']


def _complete(draft: Draft, shipped: Checked, units: dict[str, tuple[str, float] | None],
              names: set[str], turning: str) -> bool:
    """Add to an entry what the standard says of it; return whether its unit is known."""
    entry, known = draft.entry, shipped.entries.get(draft.name, {})
    if entry['access'] != 'ro':
        entry['storage'] = 'ram'    # until 1010h stores it
    if known.get('access') == 'wo':
        entry['access'] = 'wo'
    entry.update({key: known[key] for key in _MEANING if key in known})
    scale, name = known.get('scale', 1.0), known.get('unit', '')
    if 'unit' in entry or not name:
        has_unit = 'unit' in entry or bool(draft.name)
        name, factor = entry.get('unit', ''), 1.0
    elif known['verified']:
        has_unit, factor = True, scale
    else:
        said = units['60a9' if name == 'rpm' else '60a8'] if name in ('rev', 'rpm') else None
        has_unit, (name, factor) = said is not None, said or ('', 1.0)
        draft.remarks.append(
            "raw: its unit is the maker's own, and the file does not say it" if said is None else
            f'scale and unit as {"60A9h" if name.endswith(("rpm", "/s")) else "60A8h"} stands in '
            'the file')
    if name:
        entry['unit'] = name
        for key in ('minimum', 'maximum'):
            if key in entry:
                entry[key] = rounded(entry[key] * factor)
        if factor != 1.0:
            entry['scale'] = rounded(entry.get('scale', 1.0) * factor)
    if known.get('neutral_from') in names:
        revolution = _OF_A_REVOLUTION.get(name, 0.0)    # unknown: a step may be any angle
        entry['arming_tolerance'] = rounded(_ARMING * revolution)
        draft.remarks.append(
            f'arming_tolerance: {_ARMING} rev {turning}' if revolution else
            'arming_tolerance 0: only the latched value exactly, as ~/request shows it, arms; set '
            f'as many steps as make {_ARMING} rev')
    elif entry.pop('neutral_from', None) is not None:
        draft.remarks.append(f'neutral_from left out: the file has no {known["neutral_from"]}')
    return has_unit
