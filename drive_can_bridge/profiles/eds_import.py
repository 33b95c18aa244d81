# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
From an EDS or DCF file to the entries of a profile, through the library ``canopen``.

The library knows types, also those of a file's own; but it reads a file as a whole or not at all,
knows no lines, folds limits that its type cannot hold, and trusts the heads of records. So
it gets each object in the one notation that it reads well, and limits, access and what is a record
are read here: a broken section costs that entry and no other, an odd key costs no entry at all.

Standard objects of CiA 402 have names, bits, values and units of the shipped profile of its
family; units that are every maker's own are taken from the file, else raw.
"""

from collections.abc import Iterator, Mapping, Sequence
import configparser
from dataclasses import dataclass, field
import io
import logging
import math
import re
from types import ModuleType
from typing import Any

from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.core.text import counted
from drive_can_bridge.profiles.catalogue import (
    check, Checked, Draft, FileContent, ImportFailed, LeftOut)
from drive_can_bridge.profiles.csv_import import access_of
from drive_can_bridge.profiles.numbers import rounded, split_step, Unusable
from drive_can_bridge.profiles.units import unit
from drive_can_bridge.profiles.yaml_text import one_line
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.resources import command_that_brings, profiles_directory

_HEADING = re.compile(r'\[([^\[\]]*)\]\s*(?:;.*)?')
_COMMENT = re.compile(r'(?:^|\s);')
#: behind a number, where it can be nothing else
_REMARK = re.compile(r'\s*;|\s+#')
_OBJECT = re.compile(r'([0-9a-f]{4})(?:sub([0-9a-f]{1,2}))?')
#: sections with a name that are no object: of types, names and values of arrays, modules
_TYPE = re.compile(r'[0-9a-f]{1,3}(?:sub[0-9a-f]{1,2})?')
_NUMBER = re.compile(r'([+-]?)(?:(0x)([0-9a-f]{1,400})|([0-9]{1,400})(?:\.0*)?)', re.IGNORECASE)
#: the communication area: identifiers, mappings, the node's own settings
_COMMUNICATION = range(0x1000, 0x2000)
#: objects of CiA 402 of the first axis; those of the next ones are 800h above
_AXIS, _AXES_MAX = range(0x6000, 0x6800), 8
#: data types of CiA 301
_TYPES = {
    0x01: 'bool', 0x02: 'int8', 0x03: 'int16', 0x04: 'int32', 0x05: 'uint8', 0x06: 'uint16',
    0x07: 'uint32', 0x08: 'REAL32', 0x09: 'VISIBLE_STRING', 0x0A: 'OCTET_STRING',
    0x0B: 'UNICODE_STRING', 0x0C: 'TIME_OF_DAY', 0x0D: 'TIME_DIFFERENCE', 0x0F: 'DOMAIN',
    0x10: 'INTEGER24', 0x11: 'REAL64', 0x15: 'INTEGER64', 0x16: 'UNSIGNED24', 0x1B: 'UNSIGNED64'}
_ARRAY, _RECORD = 8, 9
#: device profiles of CiA by the lower half of 1000h
_DRIVES, _NO_PROFILE = 402, 0
_DEVICES = {401: 'inputs and outputs', 404: 'measuring devices', 405: 'programmable controllers',
            406: 'encoders', 408: 'hydraulics', 410: 'inclinometers', 418: 'batteries',
            419: 'battery chargers'}
#: families whose drives have EDS files; the first: those that are known by most objects
_BY_OBJECTS = sorted((family for family in FAMILIES.values()
                      if family.import_rules.eds_objects is not None),
                     key=lambda family: -len(family.import_rules.eds_objects or ()))
#: control word and status word of the first axis, which are built in
_BUILT_IN = _BY_OBJECTS[0].import_rules.eds_objects or ()
#: what those entries have in common with the one that they stand for
_MEANING = ('bits', 'values', 'neutral', 'neutral_from', 'limit', 'protected')
#: numerators and denominators of 60A8h and 60A9h (bits 23 to 8; above them a power of ten) in the
#: notation of CiA 303-2, as in the files of maxon's EPOS4: unit, and how many of it
_SI_UNITS = {0xB400: ('rev', 1.0), 0xB500: ('inc', 1.0), 0x4100: ('deg', 1.0),
             0x1000: ('rad', 1.0), 0xB447: ('rpm', 1.0), 0xB403: ('rpm', 60.0),
             0xB503: ('inc/s', 1.0), 0x4103: ('deg/s', 1.0), 0x1003: ('rad/s', 1.0)}
#: powers of ten that make sense there
_EXPONENTS = range(-12, 4)
#: revolutions by which a command may miss where the axis stays, and still arms; in other units
_ARMING = 0.01
_OF_A_REVOLUTION = {'rev': 1.0, 'deg': 360.0, 'rad': 2.0 * math.pi}
#: limits, and which one each becomes in a unit that counts the other way round
_ENDS = {'minimum': 'maximum', 'maximum': 'minimum'}
#: comments of Sevcon's files; the access level from which on a value is not ordinary configuration
_SEVCON, _PROTECTED_LEVEL = ';sevconfield ', 5
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
            command_sentences.canopen_missing(how=command_that_brings('eds'))) from None
    # its warnings are reported here, with section and line
    logging.getLogger('canopen').setLevel(logging.CRITICAL)
    module: ModuleType = eds
    return module


@dataclass(slots=True)
class EdsSection:
    """
    A section with its values as written; keys are compared without case.

    :param comments: keys and values in comment lines, as Sevcon writes them; those behind
        ``split``, which are about single bits, are left out.
    """

    name: str
    line: int
    values: dict[str, str] = field(default_factory=dict)
    comments: dict[str, str] = field(default_factory=dict)

    def get(self, key: str) -> str:
        """Return a value; '' where there is none, or an empty one."""
        return self.values.get(key.lower(), '')

    def lost(self, reason: str) -> LeftOut:
        """Return it as left out of the profile."""
        return LeftOut(self.line, f'[{self.name}]', one_line(self.get('ParameterName')), reason)


_NONE = EdsSection('', 0)


def _take_apart(text: str, found: FileContent) -> dict[str, EdsSection]:
    """Return the sections of a file by name in lower case, and note what is odd."""
    sections: dict[str, EdsSection] = {}
    section = _NONE
    for line, row in enumerate(text.split('\n'), start=1):
        row = row.strip()
        if not row or row[0] in ';#':
            if row[:len(_SEVCON)].lower() == _SEVCON:
                key, _, value = row[len(_SEVCON):].partition('=')
                if 'split' not in section.comments:     # what follows is about single bits
                    section.comments.setdefault(key.strip().lower(), value.strip())
            continue
        heading = _HEADING.fullmatch(row) if row[0] == '[' else None
        if heading is not None:
            section = EdsSection(heading[1].strip(), line)
            first = sections.setdefault(section.name.lower(), section)
            twice = f'stands twice, the first in line {first.line} counts'
            if first is not section and _OBJECT.fullmatch(section.name.lower()):
                found.left_out.append(section.lost(twice))
            elif first is not section:
                found.notes.append(f'line {line}: [{section.name}] {twice}')
            continue
        key, sign, value = row.partition('=')
        key = key.rstrip()
        small = key.lower()
        if not sign or not key or not section.line:
            found.notes.append(f'line {line}: neither a section nor KEY=VALUE')
        elif small in section.values:
            found.notes.append(f'line {line}: {key} stands twice in [{section.name}], the first '
                               'counts')
        else:
            section.values[small] = (
                _COMMENT.split(value, maxsplit=1)[0] if ';' in value else value).strip()
    return sections


def read_eds(text: str, protocols: Sequence[str] = (), *, axis: int | None = None,
             force: bool = False) -> FileContent:
    """
    Return what an EDS or DCF file offers.

    :param protocols: that the drive speaks; none: the one whose objects the file has, of the first
        axis that it has.
    :param axis: whose objects are used, counted from 1; None: the first.
    :param force: read a file of a device that is no drive.
    :raises ImportFailed: it is none, or none of a drive, or the library is missing.
    """
    library = canopen_library()
    found = FileContent(mended=True)
    sections = _take_apart(text, found)
    if not any(map(_OBJECT.fullmatch, sections)):
        raise ImportFailed(command_sentences.no_eds())
    info = sections.get('deviceinfo', _NONE)
    found.description = one_line(f'{info.get("VendorName")} {info.get("ProductName")}')
    shift = _choose_axis(sections, found, axis)
    if shift is None and not force:
        _refuse_others(sections)
    found.protocols = (next(family.name for family in _BY_OBJECTS if {
        f'{index + (shift or 0):04x}' for index in family.import_rules.eds_objects or ()
    } <= sections.keys()),)
    spoken = protocols or found.protocols
    standard = FAMILIES[spoken[0]].import_rules.eds_profile if len(spoken) == 1 else ''
    _ObjectReader(library, sections, found, bytes_stay=bool(standard)).read()
    for name in ('mandatoryobjects', 'optionalobjects', 'manufacturerobjects'):
        for key, value in sections.get(name, _NONE).values.items():
            listed = re.fullmatch('0x([0-9a-f]{1,4})', value.lower())
            if key.isdecimal() and listed and f'{int(listed[1], 16):04x}' not in sections:
                found.left_out.append(sections[name].lost(
                    command_sentences.section_missing(section=int(listed[1], 16))))
    if standard:
        _standardise(found, sections, shift or 0, standard)
    else:
        for draft in found.drafts:
            _take_step(draft)
    if shift is not None:
        for draft in found.drafts:
            # what moves an axis, and the bridge does not send in a cycle, is no setting
            if (shift or not draft.name) and draft.entry['access'] != 'ro' and (
                    _BY_OBJECTS[0].is_command(Parameter('', index=draft.entry['index']))):
                draft.entry['protected'] = True
    return found


def _choose_axis(sections: Mapping[str, EdsSection], found: FileContent,
                 wanted: int | None) -> int | None:
    """
    Leave out the objects of other axes, and return how far those of this one are from the first.

    :return: None where nothing has a control word.
    :raises ImportFailed: the file has no such axis.
    """
    axes = [number for number in range(1, _AXES_MAX + 1)
            if f'{_BUILT_IN[0] + len(_AXIS) * (number - 1):04x}' in sections]
    if wanted is not None and wanted not in axes:
        raise ImportFailed(command_sentences.no_such_axis(wanted, axes))
    if not axes:
        return None
    axis = wanted or axes[0]
    blocks = [range(_AXIS.start + move, _AXIS.stop + move)
              for move in (len(_AXIS) * (other - 1) for other in axes if other != axis)]
    found.foreign = tuple(blocks)
    if blocks:
        found.notes.append(
            f'{len(axes)} axes: {", ".join(map(str, axes))}; taken is axis {axis}, and what '
            'belongs to none of them; for another one: --axis N')
    if axis > 1:
        found.notes.append(
            f'axis {axis}: a bridge sends the control word of the first axis, 6040h, so that '
            f'validate takes this profile in no mode; with --protocols {_BY_OBJECTS[-1].name} its '
            'objects are parameters')
    return len(_AXIS) * (axis - 1)


def _refuse_others(sections: Mapping[str, EdsSection]) -> None:
    """
    Check that the device of the file is a drive.

    :raises ImportFailed: no drive.
    """
    kind = _value(sections.get('1000', _NONE))
    profile = _NO_PROFILE if kind is None else kind & 0xFFFF
    if kind is not None and profile not in (_NO_PROFILE, _DRIVES):
        what = _DEVICES.get(profile, '')
        raise ImportFailed(command_sentences.device_is_no_drive(
            kind, profile, f' ({what})' if what else ''))


@dataclass(slots=True)
class _Place:
    """
    The place of an entry, and its section.

    :param title: its own name.
    :param parent: name of the record or array that it is in.
    """

    index: int
    subindex: int
    section: EdsSection
    title: str
    parent: str = ''
    element: bool = False


class _ObjectReader:
    """Reads all objects."""

    def __init__(self, library: ModuleType, sections: dict[str, EdsSection], found: FileContent, *,
                 bytes_stay: bool) -> None:
        self._library = library
        self._sections = sections
        self._found = found
        self._types = {_TYPES[code]: ParameterType(_TYPES[code]) for code in (1, 2, 3, 4, 5, 6, 7)
                       if bytes_stay or code not in (2, 5)}
        self._width = f'none of the types of {"8, " if bytes_stay else ""}16 or 32 bits'

    def read(self) -> None:
        """Make a draft of each entry, and report why the others are left out."""
        places = [place for index, subs in sorted(self._grouped().items())
                  for place in self._places(index, subs)]
        readable = []
        taken: dict[tuple[int, int], int] = {}
        counts = 0
        for place in places:
            first = taken.setdefault((place.index, place.subindex), place.section.line)
            try:
                if first != place.section.line:
                    raise Unusable(command_sentences.same_address(first=first))
                code = self._type_of(place.section)
                counts += place.element and not place.subindex and code == 0x05
                if not (place.element and not place.subindex and code == 0x05):
                    readable.append((place, code))
            except Unusable as error:
                self._lose(place, error)
        for place, variable in self._understood(readable):
            try:
                self._take(place, variable)
            except Unusable as error:
                self._lose(place, error)
        if counts:
            number = counted(counts, 'sub-index 0', 'sub-indices 0')
            self._found.notes.append(
                f'{number} left out: {"it holds" if counts == 1 else "they hold"} the number of '
                'entries')

    def _grouped(self) -> dict[int, dict[int, list[EdsSection]]]:
        """Return the sections by index and sub-index; -1: the head."""
        grouped: dict[int, dict[int, list[EdsSection]]] = {}
        others = 0
        for name, section in self._sections.items():
            match = _OBJECT.fullmatch(name)
            if match is None:
                if section.get('ParameterName') and not _TYPE.fullmatch(name):
                    self._found.left_out.append(
                        section.lost(command_sentences.no_object_section()))
                continue
            index = int(match[1], 16)
            if any(index in block for block in self._found.foreign):
                others += 1
                continue
            number = int(match[2], 16) if match[2] else -1
            grouped.setdefault(index, {}).setdefault(number, []).append(section)
        if others:
            self._found.notes.append(f'{counted(others, "section")} of other axes left out')
        return grouped

    def _places(self, index: int, subs: dict[int, list[EdsSection]]) -> Iterator[_Place]:
        """Yield the entries of an object: a record wherever it has sub-indices."""
        [head] = subs.pop(-1, [_NONE])
        if index < _COMMUNICATION.start:
            self._found.left_out += [
                section.lost(command_sentences.no_object_but_type())
                for section in (head, *(each for some in subs.values() for each in some))
                if section is not _NONE]
            return
        parent = one_line(head.get('ParameterName'))
        if head is _NONE:
            self._found.notes.append(command_sentences.head_missing(index))
        try:
            count = _integer(head.get('CompactSubObj') or '0')
            if not 0 <= count <= 0xFE:
                raise Unusable(command_sentences.compact_out_of_range(count=count))
            kind = _integer_or(head.get('ObjectType'), 0)
            if not subs and not count and kind in (_ARRAY, _RECORD):
                raise Unusable(command_sentences.no_subindices())
        except Unusable as error:
            if not subs:
                self._found.left_out.append(head.lost(
                    str(error) if 'CompactSubObj' in str(error) or 'file' in str(error)
                    else f'CompactSubObj {error}'))
                return
            count = 0
        for number, sections in sorted(subs.items()):
            for section in sections:
                yield _Place(index, number, section, one_line(section.get('ParameterName')),
                             parent, element=True)
        names = self._sections.get(f'{index:04x}name', _NONE)
        for number in range(1, count + 1):
            if number not in subs:
                name = names.get(str(number)) or (parent if number == 1 else f'{parent}_{number}')
                yield _Place(index, number, head, one_line(name), parent, element=True)
        if not subs and not count:
            yield _Place(index, 0, head, parent)

    def _type_of(self, section: EdsSection) -> int:
        """
        Return the number of the type.

        :raises Unusable: it is missing or none.
        """
        text = section.get('DataType')
        if not text:
            raise Unusable(command_sentences.data_type_empty() if 'datatype' in section.values
                           else command_sentences.data_type_missing())
        try:
            code = _integer(text)
        except Unusable as error:
            raise Unusable(f'DataType {error}') from None
        if code not in _TYPES and f'{code:x}sub1' not in self._sections:
            raise Unusable(command_sentences.data_type_of_other_width(
                code=code, width=self._width))
        return code

    def _understood(self, readable: Sequence[tuple[_Place, int]],
                    ) -> Iterator[tuple[_Place, Any]]:
        """Read entries by the library, all at once; where it cannot, object by object."""
        try:
            objects = self._read(readable)
        except _ERRORS:
            for place, code in readable:
                try:
                    objects = self._read([(place, code)])
                except _ERRORS:
                    self._lose(place, Unusable(command_sentences.object_not_understood()))
                else:
                    yield place, _variable(objects, place)
            return
        for place, _ in readable:
            yield place, _variable(objects, place)

    def _read(self, readable: Sequence[tuple[_Place, int]]) -> Any:
        parts = ['[DeviceInfo]\n']
        heads = set()
        for place, code in readable:
            name = f'{place.index:04X}'
            if place.element and place.index not in heads:
                heads.add(place.index)
                parts.append(f'[{name}]\nParameterName=record\nObjectType={_RECORD}\n')
            if code not in _TYPES and code not in heads:    # as some editors make for limits
                heads.add(code)
                own = self._sections[f'{code:x}sub1']
                parts.append(f'[{code:X}sub1]\nDefaultValue={own.get("DefaultValue")}\n')
            section = place.section
            parts.append(
                f'[{name}{f"sub{place.subindex:X}" if place.element else ""}]\n'
                f'ParameterName={place.title}\nObjectType=7\nDataType={code}\nAccessType=rw\n'
                f'StorageLocation={section.get("StorageLocation")}\n'
                f'Description={section.get("Description")}\nUnit={section.get("Unit")}\n')
        return self._library.import_eds(io.StringIO(''.join(parts)), node_id=None)

    def _lose(self, place: _Place, error: Unusable) -> None:
        self._found.left_out.append(LeftOut(
            place.section.line, f'[{place.section.name}]', place.title, str(error)))

    def _take(self, place: _Place, variable: Any) -> None:
        """
        Make a draft of a variable.

        :raises Unusable: a profile cannot have it.
        """
        section = place.section
        kind = self._types.get(_TYPES.get(variable.data_type, ''))
        if kind is None:
            raise Unusable(f'{_TYPES[variable.data_type]} is {self._width}')
        draft = Draft(section.line, f'[{section.name}]', place.title, {
            'index': variable.index, 'subindex': variable.subindex, 'type': kind.value},
            parent=place.parent if place.element else '')
        entry, remarks = draft.entry, draft.remarks
        entry['access'] = _access(section, remarks)
        if not place.title:
            remarks.append('ParameterName is missing')
        if kind is not ParameterType.BOOL:
            entry.update(_limits(section, kind, remarks))
            _take_unit(draft, section, str(getattr(variable, 'unit', '')))
        _take_sevcon(draft, section, kind)
        writable = entry['access'] != 'ro'
        storage = str(variable.storage_location or '').upper()
        if writable and storage.startswith(('RAM', 'PERSIST', 'EEPROM', 'NVM', 'FLASH')):
            entry['storage'] = 'ram' if storage.startswith('RAM') else 'eeprom'
        if writable and variable.index in _COMMUNICATION:
            entry['protected'] = True
        own = place.title or f'object {place.index:04X}h'
        title = f'{place.parent} {own}' if place.element and place.parent not in own else own
        extra = one_line(str(getattr(variable, 'description', '') or ''))
        entry['description'] = '; '.join(filter(None, (title.strip(), extra)))
        self._found.drafts.append(draft)


def _variable(objects: Any, place: _Place) -> Any:
    entry = objects[place.index]
    return entry[place.subindex] if place.element else entry


def _integer(text: str) -> int:
    """
    Return a whole number: decimal, or hexadecimal with 0x; a comment behind it is ignored.

    :raises Unusable: it is none, or one of two: CiA 306 has octal numbers, with a 0 in front.
    """
    match = _NUMBER.fullmatch(_REMARK.split(text, maxsplit=1)[0].strip())
    if match is None:
        raise Unusable(command_sentences.no_number(text=text))
    sign, _, hexadecimal, digits = match.groups()
    value = int(hexadecimal, 16) if hexadecimal else int(digits)
    if digits and digits[0] == '0' and set(digits) <= set('01234567') and int(digits, 8) != value:
        raise Unusable(command_sentences.octal_or_not(
            text=text, value=value, octal=int(digits, 8)))
    return -value if sign == '-' else value


def _integer_or(text: str, otherwise: int) -> int:
    try:
        return _integer(text)
    except Unusable:
        return otherwise


def _access(section: EdsSection, remarks: list[str]) -> str:
    """Return the access; where the file lacks it, the harmless one."""
    text = _REMARK.split(section.get('AccessType'), maxsplit=1)[0].strip()
    try:
        if text:
            return access_of(text)
        remarks.append('ro: AccessType is missing')
    except Unusable:
        remarks.append(f"ro: AccessType '{text}' is none of those that are known here")
    return 'ro'


def _limits(section: EdsSection, kind: ParameterType, remarks: list[str]) -> dict[str, int]:
    """
    Return the limits as raw integers.

    A hexadecimal one of a signed type is two's complement where that makes low <= high, else the
    number as written. One beyond the type becomes the type's own, on the side where that limits
    nothing. What cannot be read or meant is left out with a remark.
    """
    low, high = kind.raw_range
    written, folded = {}, {}
    for key, name in (('LowLimit', 'minimum'), ('HighLimit', 'maximum')):
        text = section.get(key)
        if not text:
            continue
        try:
            written[name] = value = _integer(text)
        except Unusable as error:
            remarks.append(f'{key} left out: {error}')
            continue
        marked = kind.signed and text[:2].lower() == '0x' and high < value < 1 << kind.bits
        folded[name] = value - (1 << kind.bits) if marked else value
    limits: dict[str, int] = {}
    for name, value in (folded if _ordered(folded) else written).items():
        key, end = ('LowLimit', low) if name == 'minimum' else ('HighLimit', high)
        if low <= value <= high:
            limits[name] = value
        elif (value < low) == (name == 'minimum'):
            limits[name] = end
            remarks.append(f'{name}: {key} {section.get(key)} is beyond {kind.value}, which ends '
                           f'at {end}')
        else:
            remarks.append(f'{key} {section.get(key)} left out: {kind.value} is {low} to {high}')
    if not _ordered(limits):
        remarks.append(f'LowLimit {section.get("LowLimit")} and HighLimit '
                       f'{section.get("HighLimit")} left out: the first is above the second')
        return {}
    return limits


def _ordered(limits: Mapping[str, int]) -> bool:
    return len(limits) < 2 or limits['minimum'] <= limits['maximum']


# -- units ----------------------------------------------------------------------------------------


def _take_unit(draft: Draft, section: EdsSection, unit_text: str) -> None:
    """Set scale and unit where keys of the file, or comments of Sevcon's, have them."""
    remarks = draft.remarks
    keys = 'Factor', 'Unit'
    texts = section.get('Factor') if 'factor' in section.values else None, unit_text
    if texts == (None, '') and section.comments:
        keys = 'SCALING', 'UNITS'
        texts = section.comments.get('scaling'), section.comments.get('units', '')
    scale, name = 1.0, unit(texts[1])
    if texts[0] is not None:
        try:
            scale = _scale(texts[0])
        except Unusable as error:
            remarks.append(f'{keys[0]} left out: {error}')
    said = [key for key, given in zip(keys, (scale != 1.0, name), strict=True) if given]
    if said:
        where = 'comments' if keys[0] == 'SCALING' else 'keys'
        remarks.append(f'{" and ".join(said)}: {where} of the file')
        _rescale(draft, scale, name)
    else:
        draft.step = split_step(draft.title)[1:]


def _scale(text: str) -> float:
    """
    Read a factor.

    :raises Unusable: it is none that a profile can hold.
    """
    try:
        scale = float(text)
    except ValueError:
        raise Unusable(command_sentences.no_number(text=text) if text
                       else command_sentences.cell_empty()) from None
    if not 1e-12 <= abs(scale) <= 1e4:      # nan, too
        raise Unusable(command_sentences.no_scale(text=text))
    return rounded(scale)


def _rescale(draft: Draft, factor: float, name: str) -> None:
    """Convert an entry to another unit, limits included."""
    entry = draft.entry
    if name:
        entry['unit'] = name
    if factor == 1.0:
        return
    limits = {key: _scaled(entry.pop(key), factor) for key in _ENDS if key in entry}
    if factor < 0:
        limits = {other: limits[key] for key, other in _ENDS.items() if key in limits}
    entry.update(limits, scale=rounded(entry.get('scale', 1.0) * factor))


def _scaled(limit: float, factor: float) -> float:
    """Return a limit in its unit, without binary noise unless that were a part of a step."""
    exact = limit * factor
    return exact if abs(rounded(exact) - exact) > abs(factor) * 1e-6 else rounded(exact)


def _take_step(draft: Draft) -> bool:
    """Set scale and unit from the end of the name; return whether there are any."""
    factor, name = draft.step
    if name:
        draft.remarks.append(f'scale {factor:g} and unit {name}: at the end of the name')
        _rescale(draft, factor, name)
    return bool(name)


def _take_sevcon(draft: Draft, section: EdsSection, kind: ParameterType) -> None:
    """Set names of values and the access level from Sevcon's comments."""
    if not section.comments:
        return
    low, high = kind.raw_range
    numbers = {key: _integer_or(key, high + 1) for key in section.comments}
    names = {str(number): one_line(section.comments[key]) for key, number in numbers.items()
             if low <= number <= high and section.comments[key]}
    said = list(names.values())
    names = {number: text for number, text in names.items() if said.count(text) == 1}
    if names and (kind is ParameterType.BOOL or {'scale', 'unit'} & draft.entry.keys()):
        draft.remarks.append(', '.join(f'{number} = {text}' for number, text in names.items()))
    elif names:
        draft.entry['values'] = names
        draft.remarks.append('values: comments of the file')
    level = section.comments.get('access_level', '')
    if level and draft.entry['access'] != 'ro':
        if _integer_or(level, 0) >= _PROTECTED_LEVEL:
            draft.entry['protected'] = True
        draft.remarks.append(f'access level {level}')


# -- CiA 402 --------------------------------------------------------------------------------------


def _value(section: EdsSection) -> int | None:
    """Return the content of an object by the file; None: it has none."""
    try:
        return _integer(section.get('ParameterValue') or section.get('DefaultValue'))
    except Unusable:
        return None


def _turning(sections: Mapping[str, EdsSection], shift: int) -> str:
    """Return the revolutions that positions are counted in: CiA 402 has a gear, 6091h."""
    motor, shaft = (_value(sections.get(f'{0x6091 + shift:04x}sub{number}', _NONE))
                    for number in (1, 2))
    if motor and shaft and motor != shaft:
        return (f'of the joint: 60A8h counts behind the gear, 6091h = {motor}:{shaft} '
                '(joint: gear_ratio: 1.0)')
    return ('of the motor: 60A8h counts before any gear that 6091h does not name '
            '(joint: gear_ratio)')


def _si_unit(section: EdsSection) -> tuple[str, float] | None:
    """Return the unit of 60A8h or 60A9h in the file, and how many of it a step is."""
    value = _value(section)
    if value is None:
        return None
    name, count = _SI_UNITS.get(value >> 8 & 0xFFFF, ('', 0.0))
    exponent = (value >> 24 & 0xFF ^ 0x80) - 0x80
    return (name, count * 10.0 ** exponent) if name and exponent in _EXPONENTS else None


def _standardise(found: FileContent, sections: Mapping[str, EdsSection], shift: int,
                 profile: str) -> None:
    """
    Give standard objects their names, and what is known of them.

    :param shift: how far the objects of the axis are from those of the first one.
    :param profile: that knows them; entries of it that are not verified have units of every
        maker's own, and are placeholders there.
    """
    shipped = check(profiles_directory() / f'{profile}.yaml')
    units = {name: _si_unit(sections.get(f'{int(name, 16) + shift:04x}', _NONE))
             for name in ('60a8', '60a9')}
    turning = _turning(sections, shift)
    known = {(entry['index'] + shift * (entry['index'] in _AXIS), entry['subindex']): name
             for name, entry in shipped.entries.items()}
    found.drafts = [draft for draft in found.drafts if draft.entry['index'] not in _BUILT_IN]
    for draft in found.drafts:
        draft.name = known.get((draft.entry['index'], draft.entry['subindex']), '')
    names = {draft.name for draft in found.drafts}
    raw = [draft for draft in found.drafts
           if not _complete(draft, shipped, units, names, turning)]
    standard = [draft.name for draft in raw if draft.name]
    others = sum(not draft.name and draft.entry['index'] not in _COMMUNICATION for draft in raw)
    found.notes.append(f'CiA 402: {counted(len(names - {""}), "standard object")} by the names of '
                       f'the profile {profile}; control word and status word are built in')
    if standard:
        found.notes.append(f'raw, because their unit is the maker\'s own: {", ".join(standard)}; '
                           'scale and unit stand in the manual')
    if others:
        found.notes.append('without a unit in the file, so raw: '
                           f'{counted(others, "object")} of the maker')
    data = shipped.loaded.tree.data
    found.sections = {section: data[section] for section, name in (
        ('restore', 'store_parameters'), ('fault', 'fault_code')) if name in names}


def _complete(draft: Draft, shipped: Checked, units: dict[str, tuple[str, float] | None],
              names: set[str], turning: str) -> bool:
    """Complete an entry from the standard; return whether its unit is known."""
    entry, known = draft.entry, shipped.entries.get(draft.name, {})
    if entry['access'] != 'ro':
        entry['storage'] = 'ram'    # until 1010h stores it
        if known.get('access') == 'wo':
            entry['access'] = 'wo'
            _free_of_limits(draft, 'they are those of what is read')
    entry.update({key: known[key] for key in _MEANING if key in known})
    scale, name = known.get('scale', 1.0), known.get('unit', '')
    if not name:
        has_unit = 'unit' in entry or bool(draft.name) or _take_step(draft)
    elif known['verified'] and ('unit' not in entry or (
            entry['unit'] == name and 'scale' not in entry)):
        has_unit = True
        _rescale(draft, scale, name)
    elif 'unit' in entry:
        has_unit = True
    else:
        key = '60A9h' if name == 'rpm' else '60A8h'
        said = units[key[:4].lower()] if name in ('rev', 'rpm') else None
        if said is not None:
            draft.remarks.append(f'scale and unit as {key} stands in the file')
            _rescale(draft, said[1], said[0])
        has_unit = said is not None or _take_step(draft)
        if not has_unit:
            draft.remarks.append(
                "raw: its unit is the maker's own, and the file does not say it")
    if known.get('neutral_from') in names:
        revolution = _OF_A_REVOLUTION.get(entry.get('unit', ''), 0.0)   # unknown: of any angle
        entry['arming_tolerance'] = rounded(_ARMING * revolution)
        draft.remarks.append(
            f'arming_tolerance: {_ARMING} rev {turning}' if revolution else
            'arming_tolerance 0: only the latched value exactly, as ~/request shows it, arms; set '
            f'as many steps as make {_ARMING} rev')
    elif entry.pop('neutral_from', None) is not None:
        draft.remarks.append(f'neutral_from left out: the file has no {known["neutral_from"]}')
    return has_unit


def _free_of_limits(draft: Draft, reason: str) -> None:
    """Leave the limits out, with a remark."""
    given = [key for key in _ENDS if draft.entry.pop(key, None) is not None]
    if given:
        draft.remarks.append(f'{" and ".join(given)} left out: {reason}')
