# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A table in a text file: what separates its cells, and what its columns hold."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
import csv
from dataclasses import dataclass

from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.profiles.errors import ImportFailed, Unusable
from drive_can_bridge.profiles.headings import (
    ADDRESSES, Column, column_of, is_ambiguous, recognised,
)
from drive_can_bridge.profiles.numerals import integer, is_hexadecimal_only

#: ends the search for headings
_HEAD_ROWS = 60
_SAMPLE_LINES = 200
_DELIMITERS = (';', '\t', ',', '|')


class WrongColumns(DriveCanError):
    """What ``--columns`` says does not fit the table; the text says why."""


@dataclass(frozen=True, slots=True)
class Row:
    """A row: the line it begins in, and its cells without space around them."""

    line: int
    cells: tuple[str, ...]

    def cell(self, place: int | None) -> str:
        """Return a cell; '' where the row is too short or the table has no such column."""
        return self.cells[place] if place is not None and place < len(self.cells) else ''


@dataclass(frozen=True, slots=True)
class Table:
    """
    A table with what its columns hold.

    :param headings: '' where there are none.
    :param columns: place of each column.
    :param unused: headings of columns that nothing was made of.
    :param rows: below the headings, empty ones and repeated headings left out.
    :param hexadecimal: columns whose digits are hexadecimal without a mark.
    """

    headings: tuple[str, ...]
    columns: Mapping[Column, int]
    unused: tuple[str, ...]
    rows: tuple[Row, ...]
    hexadecimal: frozenset[Column]

    def cell(self, row: Row, column: Column) -> str:
        """Return a cell of a row; '' where there is none."""
        return row.cell(self.columns.get(column))

    def heading(self, column: Column) -> str:
        """Return the heading of a column; '' where there is none."""
        place = self.columns.get(column)
        return self.headings[place] if place is not None and place < len(self.headings) else ''


@dataclass(frozen=True, slots=True)
class Torn:
    """A line in which a quote opens that is never closed: nobody knows where its cell ends."""

    line: int
    text: str


def read_rows(text: str) -> tuple[list[Row], list[Torn]]:
    """
    Split a text into rows, with whatever separates its cells.

    :return: rows, and lines that are none.
    :raises ImportFailed: it cannot be split.
    """
    lines = text.split('\n')
    rows: list[Row] = []
    torn: list[Torn] = []
    for line, cells in _split(lines, _delimiter(lines[:_SAMPLE_LINES])):
        if cells is None:
            torn.append(Torn(line, lines[line - 1]))
        elif any(row := tuple(' '.join(cell.split()) for cell in cells)):
            rows.append(Row(line, row))
    return rows, torn


def _split(lines: Sequence[str], delimiter: str) -> Iterator[tuple[int, list[str] | None]]:
    """
    Yield the cells of each row with the line it begins in; None: a quote is never closed.

    Row by row, because the reader would take all that follows such a quote for one cell.

    :raises ImportFailed: a row cannot be split.
    """
    place = 0
    while place < len(lines):
        line = place + 1
        try:
            count, cells = _row(lines, place, delimiter, strict=False)
        except csv.Error as error:
            if _closed(lines[place], delimiter):
                raise ImportFailed(f'line {line}: cannot be split into cells: {error}') from None
            count, cells = 2, None
        if count > 1:   # over several lines only what is beyond doubt
            try:
                _row(lines, place, delimiter, strict=True)
            except csv.Error:
                count, cells = 1, None
        place += count
        yield line, cells


def _row(lines: Sequence[str], place: int, delimiter: str, *,
         strict: bool) -> tuple[int, list[str] | None]:
    reader = csv.reader((f'{lines[each]}\n' for each in range(place, len(lines))),
                        delimiter=delimiter, skipinitialspace=True, strict=strict)
    cells = next(reader)
    return reader.line_num, cells


def _closed(line: str, delimiter: str) -> bool:
    """Tell whether every quote that opens in a line is closed in it."""
    reader = csv.reader((f'{line}\n', '\n'), delimiter=delimiter, skipinitialspace=True)
    try:
        next(reader)
    except csv.Error:
        return True     # too long by itself
    return reader.line_num == 1


def _delimiter(lines: Sequence[str]) -> str:
    """Return what gives most rows the same number of cells, and the more cells the better."""
    best, delimiter = 0.0, ','
    for candidate in _DELIMITERS:
        try:
            widths = Counter(len(cells) for _, cells in _split(lines, candidate)
                             if cells is not None and any(cells))
        except ImportFailed:
            continue
        width, rows = max(widths.items(), key=lambda item: (item[0] - 1) * item[1],
                          default=(0, 0))
        if (width - 1) * rows > best:
            best, delimiter = float((width - 1) * rows), candidate
    return delimiter


def make_table(rows: Sequence[Row], given: Mapping[Column, str]) -> Table:
    """
    Find the headings, and what the columns hold.

    :param given: headings, or places counted from 1, of columns; '' for one that is not there.
    :raises ImportFailed: it cannot be found out which parameter a row is.
    :raises WrongColumns: something given is not there.
    """
    head = _head(rows, [word for word in given.values() if word and not word.isdecimal()])
    headings = head.cells if head is not None else ()
    body = rows[rows.index(head) + 1:] if head is not None else rows
    body = [row for row in body if row.cells != headings]
    columns: dict[Column, int] = {}
    for column, word in given.items():
        if word:
            columns[column] = _place(word, headings, body)
    free = [place for place in range(len(headings)) if place not in columns.values()]
    columns = {**_guessed(headings, free, body, taken=set(given)), **columns}
    columns = _settled(columns, body, given)
    if not ADDRESSES & set(columns):
        raise ImportFailed(_no_address(headings))
    unused = tuple(heading for place, heading in enumerate(headings)
                   if heading and place not in columns.values())
    return Table(headings, columns, unused, tuple(body), _hexadecimal(columns, headings, body))


def _no_address(headings: Iterable[str]) -> str:
    shown = ', '.join(heading for heading in headings if heading)
    what = f'its headings are: {shown}' if shown else 'no row looks like headings'
    return f'no column with parameter numbers was found; {what}; say which one it is: ' \
           '--columns number=HEADING,name=HEADING,... (or their places: number=1)'


def _head(rows: Sequence[Row], given: Sequence[str]) -> Row | None:
    """Return the row of headings, None without one."""
    candidates = rows[:_HEAD_ROWS]
    if given:
        wanted = {word.casefold() for word in given}
        for row in candidates:
            if wanted <= {cell.casefold() for cell in row.cells}:
                return row
        known = {cell.casefold() for row in candidates for cell in row.cells}
        missing = [word for word in given if word.casefold() not in known]
        likely = max(candidates, default=Row(0, ()),
                     key=lambda row: (recognised(row.cells), sum(map(bool, row.cells))))
        raise WrongColumns('no row has the headings ' + ', '.join(
            f"'{word}'" for word in missing or given) + '; there are: '
            + ', '.join(cell for cell in likely.cells if cell))
    best = max(candidates, key=lambda row: recognised(row.cells), default=None)
    return best if best is not None and recognised(best.cells) >= 2 else None


def _place(word: str, headings: Sequence[str], body: Sequence[Row]) -> int:
    matches = [place for place, heading in enumerate(headings)
               if heading.casefold() == word.casefold()]
    if matches:
        return matches[0]
    width = max((len(row.cells) for row in body), default=0)
    if word.isdecimal() and word.isascii() and 1 <= int(word[:9]) <= width:
        return int(word) - 1
    raise WrongColumns(f"no column '{word}': the table has {width}")


def _guessed(headings: Sequence[str], free: Sequence[int], body: Sequence[Row],
             taken: set[Column]) -> dict[Column, int]:
    found: dict[Column, int] = {}
    for place in free:
        column = column_of(headings[place])
        if column is None and is_ambiguous(headings[place]):
            column = Column.NUMBER if _mostly_numbers(place, body) else Column.NAME
        if column is not None and column not in taken:
            found.setdefault(column, place)
    return found


def _mostly_numbers(place: int, body: Sequence[Row]) -> bool:
    cells = [row.cell(place) for row in body if row.cell(place)]
    return sum(any(letter.isdigit() for letter in cell) and len(cell) <= 12
               for cell in cells) > len(cells) / 2


def _settled(columns: dict[Column, int], body: Sequence[Row],
             given: Mapping[Column, str]) -> dict[Column, int]:
    """Tell an index of CANopen from the index of an array: the former begins at 1000h."""
    place = columns.get(Column.INDEX)
    if place is None or Column.INDEX in given:
        return columns
    values = []
    for row in body:
        try:
            values.append(integer(row.cell(place).split(':')[0].split('.')[0], hexadecimal=True))
        except Unusable:
            continue
    if values and sum(value >= 0x1000 for value in values) > len(values) / 2:
        return columns
    other = Column.SUBINDEX if Column.NUMBER in columns else Column.NUMBER
    settled = dict(columns)
    del settled[Column.INDEX]
    settled.setdefault(other, place)
    return settled


def _hexadecimal(columns: Mapping[Column, int], headings: Sequence[str],
                 body: Sequence[Row]) -> frozenset[Column]:
    found = {Column.INDEX}
    for column in (Column.NUMBER, Column.SUBINDEX):
        place = columns.get(column)
        if place is not None and place < len(headings) and 'hex' in headings[place].casefold():
            found.add(column)
    place = columns.get(Column.SUBINDEX)
    if Column.INDEX in columns and any(is_hexadecimal_only(row.cell(place)) for row in body):
        found.add(Column.SUBINDEX)
    return frozenset(found)
