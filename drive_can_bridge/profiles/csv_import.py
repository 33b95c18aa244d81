# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
From a table in a text file to the entries of a profile, row by row.

A row is used whole or not at all: a limit that cannot be read is no reason to let every value
through. Only a missing type is decided, with a remark in the entry. The meaning of each column
is a note; ``--columns`` and ``--decimal`` correct it.
"""

from collections.abc import Mapping, Sequence
import csv
from functools import cache
import re
from typing import Any, NamedTuple

from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.parameters import ParameterType
from drive_can_bridge.profiles.catalogue import Draft, FileContent, ImportFailed, LeftOut
from drive_can_bridge.profiles.names import name_of, plain_words
from drive_can_bridge.profiles.numbers import (
    decimal_sign, factor, integer, interval, is_hexadecimal_only, Measure, measure, rounded,
    Unusable)
from drive_can_bridge.profiles.units import known_unit, split_unit, unit
from drive_can_bridge.profiles.yaml_text import one_line
from drive_can_bridge.protocols.families import FAMILIES

#: ends the search for headings
_HEAD_ROWS = 60
#: characters by which it is found out what separates cells
_SAMPLE = 8192
#: separators, the least likely last: decimal commas stand in every row, too
_DELIMITERS = [';', '\t', '|', ',']
#: put behind the last row, where a quote is closed
_END = '\0end'

#: in front of a number: P102, Pr. 12, par. 7
_PREFIX = re.compile(r'(?:p|pr|par|param|parameter|pnu|reg|register|%mw|mw)[.:\s_-]*(?=[0-9])',
                     re.IGNORECASE)
#: an address with an element, 102.1 and 2004h:06 counted from 0, P613[-05] from 1
_ADDRESS = re.compile(r'([^.:/\[\]]*?)\s*(?:[.:/]\s*([^.:/]+)|\[-?\s*([0-9]{1,3})\s*\])')
_BIT = re.compile(r'(?:bit\s*)?([0-9]{1,2})\s*[=:–-]\s*([^,;|/]+)', re.IGNORECASE)
#: cells without a meaning
_NOTHING = frozenset('- -- – — n/a na / ?'.split()) | {''}


class WrongColumns(DriveCanError):
    """The columns of ``--columns`` do not fit the table; the text has the reason."""


#: columns, as ``--columns`` calls them, and their headings in English, German and Italian: without
#: case, accents, brackets and ``_FILLERS``
COLUMNS: dict[str, str] = {
    'number': 'nr|no|n|num|nummer|number|numero|id|pnu|pnr|parameternummer|register|registro|code|'
              'registernummer|registeradresse|adresse|address|indirizzo|modbus|kennung|codice',
    'index': 'index|idx|object|objekt|objektindex|indice|oggetto|canopen|od index',
    'subindex': 'sub|subindex|sub index|sub idx|subidx|sub indice|subindice|sottoindice|element|'
                'unterindex|array index|ind',
    'name': 'name|parametername|bezeichnung|benennung|kurzbezeichnung|bezeichner|label|titel|nome|'
            'parameterbezeichnung|title|text|kurztext|parametertext|signal|variable|variabile|'
            'titolo|denominazione|designation',
    'description': 'description|beschreibung|parameterbeschreibung|descrizione|bedeutung|meaning|'
                   'significato|function|funktion|funzione|bemerkung|bemerkungen|remark|remarks|'
                   'comment|comments|kommentar|commento|note|notes|nota|hinweis|langtext',
    'type': 'type|typ|tipo|datatype|datentyp|format|formato|datenformat|variablentyp',
    'scale': 'scale|scaling|factor|faktor|skalierung|skalierungsfaktor|skal|resolution|aufloesung|'
             'risoluzione|fattore|scala|multiplier|multiplikator|gain|lsb|normierung|step|'
             'schrittweite|increment|passo',
    'divisor': 'divisor|divider|teiler|divisore',
    'decimals': 'decimals|decimal places|nachkommastellen|kommastellen|dezimalstellen|decimali',
    'offset': 'offset|versatz|nullpunkt|scostamento',
    'unit': 'unit|units|einheit|einheiten|unita|misura|u m|um|dimension|dim|eh',
    'access': 'access|zugriff|zugriffsrecht|zugriffsart|accesso|r w|rw|access type|tipo accesso|'
              'attribute|attribut|attr|rights|rechte|lesen schreiben|read write|lettura scrittura',
    'storage': 'storage|speicher|speicherung|speicherort|memory|memoria|eeprom|persistence|retain|'
               'persistent|memorizzazione|nichtfluechtig|non volatile',
    'minimum': 'minimum|min|minwert|minimalwert|mindestwert|minimo|lower|low|lowlimit|untergrenze|'
               'untere grenze|limite inferiore|von|from|da',
    'maximum': 'maximum|max|maxwert|maximalwert|hoechstwert|massimo|upper|high|highlimit|'
               'obergrenze|obere grenze|limite superiore|bis|to|a',
    'range': 'range|wertebereich|bereich|einstellbereich|campo|campo regolazione|intervallo|'
             'limits|grenzen|limiti|min max',
    'bits': 'bits|bit|bitbelegung|bit assignment|bitnamen|bit names',
}
_BY_HEADING = {word: column for column, words in COLUMNS.items() for word in words.split('|')}
#: words of headings that do not count where another one is known
_FILLERS = frozenset(
    'parameter param par para parametro value wert valore valori val data daten dati dato of the '
    'di del dez dec dezimal hex setting adjustment limit location phys physikalische '
    'engineering'.split())
#: headings that may stand for numbers as well as for names; the cells decide
_AMBIGUOUS = frozenset(('parameter', 'param', 'par', 'parametro', 'p'))
_NUMERIC = ('scale', 'divisor', 'offset', 'minimum', 'maximum', 'range', 'unit')

# -- what manuals call types, access and storage --------------------------------------------------

_TYPES = {
    'bool': 'bool|boolean|bit|flag',
    'uint8': 'uint8|u8|unsigned8|usint|byte|uchar',
    'int8': 'int8|i8|s8|sint8|integer8|signed8|sint|char',
    'int16': 'int16|i16|s16|sint16|integer16|signed16|int|short|sword|int16bit|16bitsigned|'
             'wordsigned|signedword|signedint',
    'uint16': 'uint16|u16|unsigned16|word|uint|ushort|unsigned|unsignedword|unsignedint|enum|'
              '16bitunsigned|unsignedshort|bitset|bitfield|bitfeld|bitfield16',
    'int32': 'int32|i32|s32|sint32|integer32|signed32|dint|long|32bitsigned|signedlong|'
             'signeddword',
    'uint32': 'uint32|u32|unsigned32|dword|udint|ulong|doubleword|doppelwort|unsignedlong|'
              'unsigneddword|32bitunsigned'}
_ACCESS = {
    'ro': 'ro|r|read|readonly|lesen|nurlesen|nurlesbar|l|lettura|solalettura|const',
    'rw': 'rw|wr|rww|rwr|readwrite|lesenschreiben|schreibbar|ls|les|letturascrittura|'
          'letturaescrittura',
    'wo': 'wo|w|write|writeonly|schreiben|nurschreiben|scrittura|solascrittura'}
_STORAGE = {
    'ram': 'ram|volatile|volatil|volatilememory|temporary|fluechtig|flüchtig|no|nein|n|false|0',
    'eeprom': 'eeprom|e2prom|eprom|nvram|fram|flash|nv|nonvolatile|nonvolatil|nichtfluechtig|x|'
              'nichtflüchtig|remanent|persistent|persist|permanent|retain|yes|ja|si|sì|j|y|true|1'}


def word_of(what: str, table: Mapping[str, str], text: str) -> str:
    """
    Translate a manual's word into the profile's.

    :param what: ``type``, ``access``, ``storage``.
    :raises Unusable: it is none of those that are known.
    """
    plain = re.sub(r'[\s_./,+-]+', '', text.casefold().strip().removesuffix('_t'))
    for word, others in table.items():
        if plain in others.split('|'):
            return word
    raise Unusable(command_sentences.cell_unknown(what=what, text=text))


@cache
def access_of(text: str) -> str:
    """
    Return ``ro``, ``rw`` or ``wo``.

    :raises Unusable: it is none of them.
    """
    return word_of('access', _ACCESS, text)


# -- rows and columns -----------------------------------------------------------------------------


class CsvRow(NamedTuple):
    """
    A row: the line it begins in, and its cells without space around them.

    :param inside: most separators in a cell over several lines: a quote may be missing.
    """

    line: int
    cells: tuple[str, ...]
    inside: int = 0

    def cell(self, place: int | None) -> str:
        """Return a cell; '' where the row is too short or the table has no such column."""
        return self.cells[place] if place is not None and place < len(self.cells) else ''


def _read_rows(text: str) -> list[CsvRow]:
    """
    Split a text into rows, with what separates its cells.

    :raises ImportFailed: it cannot be split.
    """
    sniffer = csv.Sniffer()
    sniffer.preferred = _DELIMITERS
    try:
        delimiter = sniffer.sniff(text[:_SAMPLE], ''.join(_DELIMITERS)).delimiter
    except csv.Error:
        delimiter = max(_DELIMITERS, key=text[:_SAMPLE].count)
    reader = csv.reader((f'{line}\n' for line in (*text.split('\n'), _END)), delimiter=delimiter,
                        skipinitialspace=True)
    rows, line = [], 1
    try:
        for cells in reader:
            rows.append(CsvRow(line, tuple(' '.join(cell.split()) for cell in cells),
                               max((cell.count(delimiter) for cell in cells if '\n' in cell),
                                   default=0)))
            line = reader.line_num + 1
    except csv.Error as error:
        raise ImportFailed(command_sentences.cells_not_split(line=line, error=error)) from None
    last = rows.pop()
    if last.cells != (_END,):
        raise ImportFailed(command_sentences.quote_open(line=last.line))
    return [row for row in rows if any(row.cells)]


def _plain_heading(text: str) -> str:
    """Return a heading without case, accents, brackets and signs."""
    text = re.sub(r'[\[(][^\])]*[\])]', ' ', text)
    return ' '.join(plain_words(text.casefold().replace('n°', 'nr')))


def _columns_of(heading: str) -> list[str]:
    """Return what a column may hold; several only where the cells decide."""
    parts = [heading, split_unit(heading)[0], *re.split(r'\s*[/|\n;]\s*', heading)]
    words = list(filter(None, map(_plain_heading, parts)))
    for word in words:
        known = {_BY_HEADING.get(each) for each in word.split() if each not in _FILLERS}
        column = _BY_HEADING.get(word) or (known.pop() if len(known) == 1 else None)
        if column is not None:
            return [column]
    return ['number', 'name'] if _AMBIGUOUS & set(words) else []


def _recognised(row: CsvRow) -> int:
    """Return how many cells of a row are known headings."""
    return len({tuple(_columns_of(cell)) for cell in row.cells} - {()})


class CsvTable:
    """
    A table whose columns have a meaning.

    :param given: headings, or places counted from 1, of columns; '' for one that is not there.
    :raises ImportFailed: it is unknown which parameter a row is.
    :raises WrongColumns: something given is not there.
    """

    def __init__(self, rows: Sequence[CsvRow], given: Mapping[str, str]) -> None:
        head = _head(rows, [word for word in given.values() if word and not word.isdecimal()])
        self.headings = head.cells if head is not None else ()
        below = rows[rows.index(head) + 1:] if head is not None else rows
        #: below the headings, repeated headings left out
        self.rows = [row for row in below if row.cells != self.headings]
        self.columns = {column: self._place(word) for column, word in given.items() if word}
        for place, heading in enumerate(self.headings):
            columns = _columns_of(heading) if place not in self.columns.values() else []
            if len(columns) > 1:
                columns = columns[:1] if self._mostly_numbers(place) else columns[1:]
            for column in columns:
                if column not in given:
                    self.columns.setdefault(column, place)
        # beside a number an "Index" is that of an array
        place = self.columns.get('index', 0)
        if 'number' in self.columns and 'index' not in given and _plain_heading(
                CsvRow(0, self.headings).cell(place)) in ('index', 'idx', 'indice'):
            del self.columns['index']
            self.columns.setdefault('subindex', place)
        if not {'number', 'index'} & set(self.columns):
            shown = ', '.join(filter(None, self.headings))
            what = f'its headings are: {shown}' if shown else 'no row looks like headings'
            raise ImportFailed(
                command_sentences.no_number_column(what=what))
        #: columns whose digits are hexadecimal without a mark
        self.hexadecimal = {'index', *(
            column for column in ('number', 'subindex')
            if 'hex' in self.heading(column).casefold())}
        if 'index' in self.columns and any(map(is_hexadecimal_only, (
                self.cell(row, 'subindex') for row in self.rows))):
            self.hexadecimal.add('subindex')

    def cell(self, row: CsvRow, column: str) -> str:
        """Return a cell of a row; '' where there is none, or it is void."""
        text = row.cell(self.columns.get(column))
        return '' if text.casefold() in _NOTHING else text

    def heading(self, column: str) -> str:
        """Return the heading of a column; '' where there is none."""
        return CsvRow(0, self.headings).cell(self.columns.get(column))

    def notes(self) -> list[str]:
        """Return notes on the meaning of the columns."""
        notes = ['columns: ' + ', '.join(f'{column}={self.heading(column) or place + 1}'
                                         for column, place in self.columns.items())]
        unused = [heading for place, heading in enumerate(self.headings)
                  if heading and place not in self.columns.values()]
        return [*notes, f'columns not used: {", ".join(unused)}'] if unused else notes

    def _place(self, word: str) -> int:
        for place, heading in enumerate(self.headings):
            if heading.casefold() == word.casefold():
                return place
        width = max((len(row.cells) for row in self.rows), default=0)
        if word.isdecimal() and word.isascii() and 1 <= int(word[:9]) <= width:
            return int(word) - 1
        raise WrongColumns(command_sentences.no_table_column(word=word, width=width))

    def _mostly_numbers(self, place: int) -> bool:
        cells = [row.cell(place) for row in self.rows if row.cell(place)]
        return sum(bool(re.search('[0-9]', cell)) and len(cell) <= 12
                   for cell in cells) > len(cells) / 2


def _head(rows: Sequence[CsvRow], given: Sequence[str]) -> CsvRow | None:
    """
    Return the row of headings, None without one.

    :raises WrongColumns: a given heading is not there.
    """
    candidates = rows[:_HEAD_ROWS]
    wanted = {word.casefold() for word in given}
    best = max(candidates, key=_recognised, default=CsvRow(0, ()))
    if not wanted:
        return best if _recognised(best) >= 2 else None
    for row in candidates:
        if wanted <= {cell.casefold() for cell in row.cells}:
            return row
    known = {cell.casefold() for row in candidates for cell in row.cells}
    missing = [word for word in given if word.casefold() not in known] or given
    raise WrongColumns(command_sentences.no_such_headings(
        [f"'{word}'" for word in missing], list(filter(None, best.cells))))


# -- entries --------------------------------------------------------------------------------------


def read_table(text: str, given: Mapping[str, str], sign: str = '',
               protocols: Sequence[str] = ()) -> FileContent:
    """
    Return what a table offers.

    :param given: columns by heading or place, as for :class:`CsvTable`.
    :param sign: the decimal sign, where it is given.
    :param protocols: that the drive speaks; where all have 8-bit types, those stay.
    :raises ImportFailed: it is no table of parameters.
    :raises WrongColumns: a given column is not there.
    """
    table = CsvTable(_read_rows(text), given)
    reader = _RowReader(table, sign or decimal_sign(
        table.cell(row, column) for row in table.rows for column in _NUMERIC),
        bytes_stay=bool(protocols) and all(8 in FAMILIES[name].widths for name in protocols))
    found = FileContent(notes=table.notes())
    sections = []
    for row in table.rows:
        if sum(map(bool, row.cells)) <= 1 and len(table.columns) > 1:
            sections.append(row.line)
            continue
        try:
            found.drafts.append(reader.draft(row))
        except Unusable as error:
            shown = one_line(' '.join(filter(None, row.cells)))
            found.left_out.append(LeftOut(
                row.line, '', shown if len(shown) <= 40 else f'{shown[:39]}…', str(error)))
    if sections:
        found.notes.append('taken for headings of sections: line '
                           + ', '.join(map(str, sections[:10]))
                           + (' …' if len(sections) > 10 else ''))
    return found


#: the cells of a row, by column; '': empty
Cells = Mapping[str, str]


class _RowReader:
    """Reads rows as drafts."""

    def __init__(self, table: CsvTable, sign: str, *, bytes_stay: bool) -> None:
        self._table = table
        self._sign = sign
        self._bytes_stay = bytes_stay

    def draft(self, row: CsvRow) -> Draft:
        """
        Return the draft of a row.

        :raises Unusable: something in it has no meaning.
        """
        cells = {column: self._table.cell(row, column) for column in COLUMNS}
        if row.inside >= max(2, len(self._table.headings) - 1):
            raise Unusable(command_sentences.cell_too_long())
        entry: dict[str, Any] = self._address(cells)
        remarks: list[str] = []
        title, title_unit = split_unit(cells['name'])
        texts = (cells['name'], cells['description'])
        entry.update(self._scaling(cells, title_unit))
        limits = self._limits(cells, str(entry.get('unit', '')))
        entry['type'] = self._type(cells['type'], entry, limits, remarks)
        if entry['type'] == 'bool':
            for key in entry.keys() & {'scale', 'offset', 'unit'}:
                del entry[key]
                remarks.append(f'{key} left out: a bool has none')
        else:
            entry.update(limits)
        if cells['access']:
            entry['access'] = access_of(cells['access'])
        if cells['storage']:
            entry['storage'] = word_of('storage', _STORAGE, cells['storage'])
        if cells['bits']:
            entry['bits'] = _bits(cells['bits'])
        if entry.get('access') == 'ro':
            entry.pop('storage', None)
        words = one_line('; '.join(dict.fromkeys(filter(None, texts))))
        return Draft(row.line, '', title or cells['description'],
                     {**entry, 'description': words} if words else entry, remarks)

    def _address(self, cells: Cells) -> dict[str, int]:
        found: dict[str, int] = {}
        hexadecimal = self._table.hexadecimal
        number, element = _parts(_PREFIX.sub('', cells['number']))
        index, subindex = _parts(cells['index'])
        if number:
            found['number'] = integer(number, hexadecimal='number' in hexadecimal)
            if set(element) == {'0'}:    # what a spreadsheet makes of whole numbers
                element = ''
        if index:
            found['index'] = integer(index, hexadecimal=True)
            found['subindex'] = integer(subindex or '0', hexadecimal=True)
            if found['index'] < 0x1000:
                raise Unusable(command_sentences.no_canopen_index(index=index))
        if not found:
            raise Unusable(command_sentences.row_without_number())
        element = ''.join(_parts(cells['subindex'])) or element
        if element:
            found['subindex'] = integer(element, hexadecimal='subindex' in hexadecimal)
        for key, largest in (('number', 65535), ('index', 65535), ('subindex', 255)):
            if found.get(key, 0) > largest:
                raise Unusable(command_sentences.address_out_of_range(
                    key=key, found=found[key], most=largest))
        return found

    def _scaling(self, cells: Cells, title_unit: str) -> dict[str, Any]:
        found: dict[str, Any] = {}
        scale, units = 1.0, [cells['unit']]
        if re.match(r'(?:[0-9]|[xX×*] ?[0-9])', units[0]) and not known_unit(units[0]):
            scale, units[0] = factor(units[0], self._sign)     # "0,1 Hz" in the column of units
        if cells['scale']:
            step = factor(cells['scale'], self._sign)
            scale *= step.number
            units.append(step.unit)
        if cells['divisor']:
            scale /= factor(cells['divisor'], self._sign).number
        if cells['decimals']:
            scale *= 10.0 ** -min(integer(cells['decimals']), 99)
        if rounded(scale) != 1.0:
            found['scale'] = rounded(scale)
        if cells['offset']:
            offset = measure(cells['offset'], self._sign).number
            found.update({'offset': offset} if offset else {})
        units.append(title_unit)
        if 'unit' not in self._table.columns:
            units += [split_unit(self._table.heading(column))[1] for column in (
                'scale', 'minimum', 'maximum', 'range')]
        if cells['range']:
            units.append(interval(cells['range'], self._sign)[1].unit)
        own = next(filter(None, map(unit, units)), '')
        return {**found, 'unit': own} if own else found

    def _limits(self, cells: Cells, own_unit: str) -> dict[str, float]:
        found: dict[str, Measure] = {}
        if cells['range']:
            found['minimum'], found['maximum'] = interval(cells['range'], self._sign)
        for column in ('minimum', 'maximum'):
            if cells[column]:
                found[column] = measure(cells[column], self._sign)
        for key, limit in found.items():
            if limit.unit and unit(limit.unit) != own_unit:
                raise Unusable(command_sentences.limit_in_other_unit(
                    key=key, number=limit.number, unit=limit.unit,
                    own=own_unit or 'the unit of the parameter, which has none'))
        limits = {key: limit.number for key, limit in found.items()}
        if len(limits) == 2 and limits['minimum'] > limits['maximum']:
            raise Unusable(command_sentences.limits_exchanged(
                low=limits['minimum'], high=limits['maximum']))
        return limits

    def _type(self, told: str, entry: Mapping[str, Any], limits: dict[str, float],
              remarks: list[str]) -> str:
        scale, offset = entry.get('scale', 1.0), entry.get('offset', 0.0)
        if told:
            kind = word_of('type', _TYPES, told)
            if kind == 'uint8' and not self._bytes_stay:    # eight bits fit sixteen
                limits.setdefault('maximum', rounded(255 * scale + offset))
                return 'uint16'
            return kind
        raws = [(limit - offset) / scale for limit in limits.values()]
        for fits in (ParameterType.UINT16, ParameterType.INT16, ParameterType.UINT32,
                     ParameterType.INT32):
            low, high = fits.raw_range
            if all(low - 0.5 <= raw <= high + 0.5 for raw in raws):
                remarks.append(f'type {fits.value}: not in the table, '
                               + ('chosen by the limits' if raws else 'the usual one'))
                return str(fits.value)
        raise Unusable(command_sentences.limits_fit_no_type())


def _bits(text: str) -> dict[str, int]:
    found: dict[str, int] = {}
    for position, title in _BIT.findall(text):
        found.setdefault(name_of(title, position), int(position))
    if not found:
        raise Unusable(command_sentences.bits_form(text=text))
    return found


def _parts(text: str) -> tuple[str, str]:
    """
    Split an address from its element, '' for none.

    :raises Unusable: an element that is counted from 1 is 0.
    """
    match = _ADDRESS.fullmatch(text)
    if match is None:
        return text, ''
    if match[3] is None:
        return match[1], match[2].strip()
    if int(match[3]) == 0:
        raise Unusable(command_sentences.elements_from_one(text=text))
    return match[1], hex(int(match[3]) - 1)
