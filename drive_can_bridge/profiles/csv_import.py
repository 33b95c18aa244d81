# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
From a table to the entries of a profile, row by row.

A row is taken whole or not at all: a limit that cannot be read is no reason to let every value
through. What a table does not say stays unsaid; only the type has to be decided, and the entry
says so.
"""

from collections.abc import Mapping
import re
from typing import Any

from drive_can_bridge.core.parameters import ParameterType
from drive_can_bridge.profiles.draft import Draft, Found, LeftOut, Place
from drive_can_bridge.profiles.errors import ImportFailed, Unusable
from drive_can_bridge.profiles.headings import Column
from drive_can_bridge.profiles.names import name_of, split_unit
from drive_can_bridge.profiles.numerals import (
    decimal_sign, DecimalSign, factor, integer, interval, Measure, measure,
)
from drive_can_bridge.profiles.table import make_table, read_rows, Row, Table
from drive_can_bridge.profiles.text import one_line
from drive_can_bridge.profiles.types import access_of, storage_of, type_of
from drive_can_bridge.profiles.units import known_unit, unit

#: in front of a number: P102, Pr. 12, par. 7
_PREFIX = re.compile(r'(?:p|pr|par|param|parameter|pnu|reg|register|%mw|mw)[.:\s_-]*(?=[0-9])',
                     re.IGNORECASE)
#: an element behind it: P613[-05] counts from 1, 102.1 and 2004h:06 do not
_ELEMENT = re.compile(r'(.+?)\s*\[-?\s*([0-9]{1,3})\s*\]')
_PAIR = re.compile(r'([^.:/]+)\s*[.:/]\s*([^.:/]+)')
_BIT = re.compile(r'(?:bit\s*)?([0-9]{1,2})\s*[=:–-]\s*([^,;|/]+)', re.IGNORECASE)
#: cells that say nothing
_NOTHING = frozenset(('', '-', '--', '–', '—', 'n/a', 'na', '/', '?'))
_NUMERIC = (Column.SCALE, Column.DIVISOR, Column.OFFSET, Column.MINIMUM, Column.MAXIMUM,
            Column.RANGE, Column.UNIT)


def read_table(text: str, given: Mapping[Column, str],
               sign: DecimalSign = DecimalSign.UNKNOWN) -> Found:
    """
    Read what a table offers.

    :param given: columns by heading or place, as for :func:`.make_table`.
    :param sign: the decimal sign, where somebody says it.
    :raises ImportFailed: it is no table of parameters.
    :raises WrongColumns: a given column is not there.
    """
    rows, torn = read_rows(text)
    try:
        table = make_table(rows, given)
    except ImportFailed as error:
        if not torn:
            raise
        raise ImportFailed(f'in line {torn[0].line} a quote opens that is never closed; '
                           f'{error}') from None
    if sign is DecimalSign.UNKNOWN:
        sign = decimal_sign(table.cell(row, column) for row in table.rows for column in _NUMERIC)
    found = Found(notes=_notes(table), left_out=[
        LeftOut(Place(each.line), _shortened(each.text), 'a quote opens here that is never closed')
        for each in torn])
    reader = _RowReader(table, sign)
    headings = []
    for row in table.rows:
        if sum(map(bool, row.cells)) <= 1 and len(table.columns) > 1:
            headings.append(row.line)
            continue
        try:
            found.drafts.append(reader.draft(row))
        except Unusable as error:
            found.left_out.append(LeftOut(Place(row.line), _shown(row), str(error)))
    if headings:
        lines = ', '.join(map(str, headings[:10])) + (' …' if len(headings) > 10 else '')
        found.notes.append(f'taken for headings of sections: line {lines}')
    return found


def _notes(table: Table) -> list[str]:
    shown = []
    for column, place in table.columns.items():
        heading = table.headings[place] if place < len(table.headings) else ''
        shown.append(f'{column.value}={heading or place + 1}')
    notes = [f'columns: {", ".join(shown)}']
    if table.unused:
        notes.append(f'columns not used: {", ".join(table.unused)}')
    return notes


def _shown(row: Row) -> str:
    return _shortened(' '.join(cell for cell in row.cells if cell))


def _shortened(text: str) -> str:
    text = one_line(text)
    return text if len(text) <= 40 else text[:39] + '…'


class _RowReader:
    """Makes a draft of a row."""

    def __init__(self, table: Table, sign: DecimalSign) -> None:
        self._table = table
        self._sign = sign

    def draft(self, row: Row) -> Draft:
        """
        Read a row.

        :raises Unusable: something in it has no meaning.
        """
        entry: dict[str, Any] = self._address(row)
        remarks: list[str] = []
        title, title_unit = split_unit(self._cell(row, Column.NAME))
        description = self._cell(row, Column.DESCRIPTION)
        entry.update(self._scaling(row, title_unit))
        limits = self._limits(row, str(entry.get('unit', '')))
        kind, largest = self._type(row, entry, limits, remarks)
        entry['type'] = kind.value
        if largest is not None and limits.get('maximum') is None:
            limits['maximum'] = largest * entry.get('scale', 1.0) + entry.get('offset', 0.0)
        if kind is ParameterType.BOOL:
            for key in ('scale', 'offset', 'unit'):
                if entry.pop(key, None) is not None:
                    remarks.append(f'{key} left out: a bool has none')
            limits = {}
        entry.update({key: value for key, value in limits.items() if value is not None})
        for column, key, reading in ((Column.ACCESS, 'access', access_of),
                                     (Column.STORAGE, 'storage', storage_of)):
            if self._cell(row, column):
                entry[key] = reading(self._cell(row, column))
        if self._cell(row, Column.BITS):
            entry['bits'] = self._bits(row)
        if entry.get('access') == 'ro':
            entry.pop('storage', None)
        words = [self._cell(row, Column.NAME), description]
        entry['description'] = one_line('; '.join(dict.fromkeys(filter(None, words))))
        if not entry['description']:
            del entry['description']
        return Draft(Place(row.line), title or description, entry, remarks)

    def _cell(self, row: Row, column: Column) -> str:
        text = self._table.cell(row, column)
        return '' if text.casefold() in _NOTHING else text

    # -- which one --------------------------------------------------------------------------------

    def _address(self, row: Row) -> dict[str, Any]:
        found: dict[str, Any] = {}
        index = self._cell(row, Column.INDEX)
        number = self._cell(row, Column.NUMBER)
        element = ''
        if number:
            number, element = self._element(_PREFIX.sub('', number))
            found['number'] = integer(number, hexadecimal=Column.NUMBER in self._table.hexadecimal)
        if index:
            pair = _PAIR.fullmatch(index)
            if pair is not None:  # 2004:0A, as CANopen writes it
                index = pair[1]
                found['subindex'] = integer(pair[2], hexadecimal=True)
            found['index'] = integer(index, hexadecimal=True)
        subindex = self._cell(row, Column.SUBINDEX)
        if subindex:
            bracketed = re.fullmatch(r'\[-?\s*([0-9]{1,3})\s*\]', subindex)
            element = str(int(bracketed[1]) - 1) if bracketed else subindex
        if not found:
            raise Unusable('has no number')
        if element:
            found['subindex'] = integer(
                element, hexadecimal=Column.SUBINDEX in self._table.hexadecimal)
        elif index:
            found.setdefault('subindex', 0)
        for key, largest in (('number', 65535), ('index', 65535), ('subindex', 255)):
            if found.get(key, 0) > largest:
                raise Unusable(f'{key} {found[key]} is out of range, allowed is 0 to {largest}')
        return found

    def _element(self, text: str) -> tuple[str, str]:
        bracketed = _ELEMENT.fullmatch(text)
        if bracketed is not None:
            if int(bracketed[2]) == 0:
                raise Unusable(f"'{text}': elements in brackets are counted from 1")
            return bracketed[1], str(int(bracketed[2]) - 1)
        pair = _PAIR.fullmatch(text)
        if pair is not None and set(pair[2]) != {'0'}:
            return pair[1].strip(), pair[2].strip()
        return text, ''

    # -- how it is to be read ---------------------------------------------------------------------

    def _scaling(self, row: Row, title_unit: str) -> dict[str, Any]:
        found: dict[str, Any] = {}
        scale = 1.0
        units = [self._cell(row, Column.UNIT)]
        leading = re.match(r'(?:[0-9]|[xX×*] ?[0-9])', units[0])
        if leading and not known_unit(units[0]):   # "0,1 Hz" in the column of units
            step = factor(units[0], self._sign)
            scale, units = step.number, [step.unit]
        if self._cell(row, Column.SCALE):
            step = factor(self._cell(row, Column.SCALE), self._sign)
            scale *= step.number
            units.append(step.unit)
        if self._cell(row, Column.DIVISOR):
            scale /= factor(self._cell(row, Column.DIVISOR), self._sign).number
        if self._cell(row, Column.DECIMALS):
            places = integer(self._cell(row, Column.DECIMALS))
            if places > 9:
                raise Unusable(f'{places} decimal places are too many')
            scale *= float(f'1e-{places}')
        if scale != 1.0:
            found['scale'] = _tidy(scale)
        if self._cell(row, Column.OFFSET):
            offset = measure(self._cell(row, Column.OFFSET), self._sign).number
            if offset:
                found['offset'] = _tidy(offset)
        units.append(title_unit)
        if Column.UNIT not in self._table.columns:
            units += [split_unit(self._table.heading(column))[1] for column in (
                Column.SCALE, Column.MINIMUM, Column.MAXIMUM, Column.RANGE)]
        found_unit = next(filter(None, map(unit, units)), '')
        if not found_unit and self._cell(row, Column.RANGE):
            found_unit = unit(self._interval(row)[1].unit)
        if found_unit:
            found['unit'] = found_unit
        return found

    def _interval(self, row: Row) -> tuple[Measure, Measure]:
        return interval(self._cell(row, Column.RANGE), self._sign)

    def _limits(self, row: Row, own_unit: str) -> dict[str, float | None]:
        found: dict[str, Measure] = {}
        if self._cell(row, Column.RANGE):
            found['minimum'], found['maximum'] = self._interval(row)
        for column in (Column.MINIMUM, Column.MAXIMUM):
            if self._cell(row, column):
                found[column.value] = measure(self._cell(row, column), self._sign)
        for key, limit in found.items():
            if limit.unit and unit(limit.unit) != own_unit:
                raise Unusable(f"{key} '{limit.number:g} {limit.unit}' is not in "
                               f'{own_unit or "the unit of the parameter, which has none"}')
        low, high = found.get('minimum'), found.get('maximum')
        if low is not None and high is not None and low.number > high.number:
            raise Unusable(f'minimum {low.number:g} is above maximum {high.number:g}')
        return {key: _tidy(limit.number) for key, limit in found.items()}

    def _type(self, row: Row, entry: Mapping[str, Any], limits: Mapping[str, float | None],
              remarks: list[str]) -> tuple[ParameterType, int | None]:
        if self._cell(row, Column.TYPE):
            return type_of(self._cell(row, Column.TYPE))
        scale, offset = entry.get('scale', 1.0), entry.get('offset', 0.0)
        raws = [(limit - offset) / scale for limit in limits.values() if limit is not None]
        for kind in (ParameterType.UINT16, ParameterType.INT16, ParameterType.UINT32,
                     ParameterType.INT32):
            low, high = kind.raw_range
            if all(low - 0.5 <= raw <= high + 0.5 for raw in raws):
                remarks.append(f'type {kind.value}: not in the table, '
                               + ('chosen by the limits' if raws else 'the usual one'))
                return kind, None
        raise Unusable('the limits fit no type of 16 or 32 bits')

    def _bits(self, row: Row) -> dict[str, int]:
        text = self._cell(row, Column.BITS)
        found: dict[str, int] = {}
        for position, title in _BIT.findall(text):
            found.setdefault(name_of(title, position), int(position))
        if not found:
            raise Unusable(f"bits '{text}' are not of the form 0=ready, 3=fault")
        return found


def _tidy(value: float) -> float:
    """Take the binary noise from a product: 0.1, not 0.1000000000000002."""
    return float(f'{value:.12g}')
