# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What the columns of a table hold, by their headings: English, German, Italian.

A heading may have a unit in brackets (``Maximum [rpm]``), and two languages at once
(``Einheit / Unit``).
"""

from collections.abc import Sequence
from enum import Enum
import re
import unicodedata

from drive_can_bridge.profiles.names import split_unit


class Column(Enum):
    """What a column holds. The values are the words of ``--columns``."""

    NUMBER = 'number'
    INDEX = 'index'
    SUBINDEX = 'subindex'
    NAME = 'name'
    DESCRIPTION = 'description'
    TYPE = 'type'
    SCALE = 'scale'
    DIVISOR = 'divisor'
    DECIMALS = 'decimals'
    OFFSET = 'offset'
    UNIT = 'unit'
    ACCESS = 'access'
    STORAGE = 'storage'
    MINIMUM = 'minimum'
    MAXIMUM = 'maximum'
    RANGE = 'range'
    BITS = 'bits'


#: what any of them may be found by; compared with the whole heading, see :func:`_plain`
_WORDS: dict[Column, str] = {
    Column.SUBINDEX:
        'sub|subindex|sub index|sub idx|subidx|sub indice|subindice|sottoindice|sotto indice|'
        'unterindex|element|array index|ind',
    Column.INDEX:
        'index|idx|object index|od index|canopen index|object|objekt|objektindex|objekt index|'
        'indice|indice oggetto|oggetto|canopen|canopen object|canopen objekt',
    Column.NUMBER:
        'nr|no|n|num|nummer|number|numero|id|pnu|pnr|par nr|par no|para nr|param nr|'
        'parameter nr|parameter no|parameter number|parameternummer|parameter nummer|'
        'parameter id|n parametro|numero parametro|num parametro|nr parametro|register|'
        'register number|register nr|registernummer|register address|registeradresse|registro|'
        'n registro|numero registro|adresse|address|indirizzo|modbus|modbus address|'
        'modbus adresse|modbus register|indirizzo modbus|code|kennung|codice',
    Column.NAME:
        'name|parametername|parameter name|name des parameters|bezeichnung|benennung|'
        'kurzbezeichnung|parameterbezeichnung|bezeichner|label|titel|title|text|kurztext|'
        'signal|variable|variabile|nome|nome parametro|nome del parametro|denominazione|titolo|'
        'designation|parameter text|parametertext',
    Column.DESCRIPTION:
        'description|beschreibung|descrizione|parameter description|parameterbeschreibung|'
        'descrizione parametro|bedeutung|meaning|significato|function|funktion|funzione|'
        'bemerkung|bemerkungen|remark|remarks|comment|comments|kommentar|note|notes|hinweis|'
        'erlaeuterung|commento|nota|langtext',
    Column.TYPE:
        'type|typ|tipo|data type|datatype|datentyp|daten typ|tipo dati|tipo di dato|tipo dato|'
        'format|formato|datenformat|data format|variable type|variablentyp',
    Column.SCALE:
        'scale|scaling|scale factor|scaling factor|factor|faktor|skalierung|skalierungsfaktor|'
        'skal|resolution|aufloesung|risoluzione|fattore|fattore di scala|scala|multiplier|'
        'multiplikator|gain|lsb|normierung|normalisation|normalization|schrittweite|step|'
        'increment|passo|gewichtung|wertigkeit',
    Column.DIVISOR: 'divisor|divider|teiler|divisore',
    Column.DECIMALS:
        'decimals|decimal places|nachkommastellen|kommastellen|dezimalstellen|decimali|'
        'cifre decimali|digits after the point',
    Column.OFFSET: 'offset|versatz|nullpunkt|scostamento',
    Column.UNIT:
        'unit|units|einheit|einheiten|unita|unita di misura|u m|um|misura|dimension|dim|eh|'
        'phys einheit|physikalische einheit|engineering unit',
    Column.ACCESS:
        'access|zugriff|zugriffsrecht|accesso|r w|rw|access type|zugriffsart|tipo accesso|'
        'attribute|attribut|attr|lesen schreiben|read write|lettura scrittura|rechte|rights',
    Column.STORAGE:
        'storage|speicher|speicherung|speicherort|memory|memoria|eeprom|persistence|'
        'persistent|retain|memorizzazione|nichtfluechtig|non volatile|storage location',
    Column.MINIMUM:
        'minimum|min|min wert|minwert|minimalwert|mindestwert|min value|minimum value|minimo|'
        'valore minimo|val min|lower limit|low limit|lowlimit|untergrenze|untere grenze|'
        'limite inferiore|von|from|da',
    Column.MAXIMUM:
        'maximum|max|max wert|maxwert|maximalwert|hoechstwert|max value|maximum value|massimo|'
        'valore massimo|val max|upper limit|high limit|highlimit|obergrenze|obere grenze|'
        'limite superiore|bis|to|a',
    Column.RANGE:
        'range|value range|wertebereich|bereich|einstellbereich|campo|campo di valori|'
        'intervallo|limits|grenzen|limiti|min max|setting range|adjustment range|'
        'campo di regolazione',
    Column.BITS: 'bits|bit|bitbelegung|bit assignment|bitnamen|bit names',
}
_BY_WORD = {word: column for column, words in _WORDS.items() for word in words.split('|')}
#: headings that may stand for numbers as well as for names; the cells tell
AMBIGUOUS = frozenset(('parameter', 'param', 'par', 'parametro', 'p'))
#: columns that say which parameter a row is
ADDRESSES = frozenset((Column.NUMBER, Column.INDEX))


def _plain(text: str) -> str:
    """Return a heading without case, accents, brackets and signs."""
    text = re.sub(r'[\[(][^\])]*[\])]', ' ', text).casefold()
    for letter, letters in (('ä', 'ae'), ('ö', 'oe'), ('ü', 'ue'), ('ß', 'ss')):
        text = text.replace(letter, letters)
    text = ''.join(letter for letter in unicodedata.normalize('NFKD', text)
                   if unicodedata.category(letter) != 'Mn')
    return ' '.join(re.findall(r'[a-z0-9]+', text.replace('n°', 'nr')))


def readings(heading: str) -> list[str]:
    """Return what a heading may be read as: the whole of it, then each of its languages."""
    parts = [heading, split_unit(heading)[0], *re.split(r'\s*[/|\n;]\s*', heading)]
    return list(dict.fromkeys(filter(None, map(_plain, parts))))


def column_of(heading: str) -> Column | None:
    """Return what a column holds; None: the heading says nothing that is known."""
    for word in readings(heading):
        found = _BY_WORD.get(word) or _BY_WORD.get(re.sub(r' (?:dez|dec|hex|dezimal)$', '', word))
        if found is not None:
            return found
    return None


def is_ambiguous(heading: str) -> bool:
    """Tell whether a heading may stand for numbers or for names."""
    return any(word in AMBIGUOUS for word in readings(heading))


def recognised(cells: Sequence[str]) -> int:
    """Return how much a row looks like headings: how many of its cells are known ones."""
    known = {column_of(cell) for cell in cells if cell.strip()} - {None}
    return len(known) + any(is_ambiguous(cell) for cell in cells if cell.strip())
