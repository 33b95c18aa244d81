# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The two texts that candump writes: its log file (``-l``, ``-L``) and its screen.

.. code-block:: text

    (1700000000.123456) can0 003FFFF0#05DC000000000000 T
     (1700000000.123456)  can0  TX - -  003FFFF0   [8]  05 DC 00 00 00 00 00 00
     (2026-11-21 23:04:38.123456)  can0  003FFFF0   [8]  05 DC 00 00 00 00 00 00

Not by python-can: its reader takes most error frames for data frames, ends at the first line that
is none of its own, and does not know the screen.
"""

from collections.abc import Callable
from datetime import datetime
import re
from typing import TypeVar

from drive_can_bridge.core.frame import EXTENDED_IDENTIFIER_MAX, STANDARD_IDENTIFIER_MAX
from drive_can_bridge.core.record import DATA, Record, RecordKind

Parsed = TypeVar('Parsed')
#: linux/can.h, in identifiers of eight digits
_ERROR_FLAG = 0x20000000
_CLASSICAL_MAX = 8
_LENGTH_MAX = 64
#: the highest identifiers as they are written; lower ones come before them in the alphabet, too
_EXTENDED_DIGITS, _STANDARD_DIGITS = '1FFFFFFF', '7FF'
#: s since 1970: the end of the year 9999. Beyond, a float soon tells no two frames apart
_TIME_MAX = 253_402_300_800.0
_DATE = re.compile(r'\([0-9]{4}-[0-9]{2}-[0-9]{2} [0-9]{2}:[0-9]{2}:[0-9]{2}\.[0-9]{6}\)')
_DIRECTIONS = {'R': False, 'T': True, 'RX': False, 'TX': True}
#: characters of a line of eight bytes, with room to spare; a longer one is no frame
LINE_MAX = 400


def format_record(record: Record) -> str:
    """Write an entry as ``candump -L`` does, with its direction where that is known."""
    time, channel, identifier, data, extended, kind, sent = record
    direction = '' if sent is None else ' T' if sent else ' R'
    if kind is DATA:
        width = 8 if extended else 3
        content = f'{identifier:0{width}X}#{data.hex().upper()}'
    elif kind is RecordKind.ERROR:
        content = f'{identifier & EXTENDED_IDENTIFIER_MAX | _ERROR_FLAG:08X}#{data.hex().upper()}'
    elif kind is RecordKind.REMOTE:
        content = f'{identifier:0{8 if extended else 3}X}#R'
    else:
        content = f'{identifier:0{8 if extended else 3}X}##0{data.hex().upper()}'
    return f'({time:.6f}) {channel} {content}{direction}\n'


def parse_line(line: str) -> Record | None:
    """
    Read a line of either text.

    :return: None for a line without content.
    :raises ValueError: it is no line of candump.
    """
    words = line.split()
    count = len(words)
    if (count == 3 or count == 4) and words[0][0] == '(':
        # the fast path: a data frame in a log file
        digits, hash_sign, data = words[2].partition('#')
        width = len(digits)
        if (width == 8 and '00000000' <= digits <= _EXTENDED_DIGITS
                or width == 3 and '000' <= digits <= _STANDARD_DIGITS):
            try:
                time = float(words[0][1:-1])
                number, content = int(digits, 16), bytes.fromhex(data)
            except ValueError:
                pass    # not quite so plain
            else:
                if len(content) <= _CLASSICAL_MAX and 0.0 <= time < _TIME_MAX and hash_sign:
                    return Record(time, words[1], number, content, width == 8, DATA,
                                  _DIRECTIONS.get(words[3]) if count == 4 else None)
        if hash_sign:
            return _logged(words, digits, data)
    if not words:
        return None
    if len(line) > LINE_MAX:
        raise ValueError('too long')
    return _shown(words)


def _logged(words: list[str], identifier: str, data: str) -> Record:
    """Read a line of a log file."""
    time, number = _time(words[0]), _number(identifier)
    extended = len(identifier) == 8
    sent = _DIRECTIONS.get(words[3]) if len(words) == 4 else None
    kind = DATA
    if data[:1] in ('#', 'R', 'r'):
        kind = RecordKind.FD if data[0] == '#' else RecordKind.REMOTE
        data = data[2:] if data[0] == '#' else ''
    elif extended and number & _ERROR_FLAG:
        kind, number = RecordKind.ERROR, number & EXTENDED_IDENTIFIER_MAX
    return _checked(Record(time, words[1], number, _content(data), extended, kind, sent),
                    len(identifier))


def _shown(words: list[str]) -> Record:
    """Read a line of the screen."""
    place = next((index for index, word in enumerate(words)
                  if word[:1] == '[' and word[-1:] == ']' and word[1:-1].isdecimal()), None)
    if place is None or place < 2:
        raise ValueError('neither a line of a candump log nor of its screen')
    before, length, after = words[:place], words[place], words[place + 1:]
    time = 0.0
    if before[0][:1] == '(':
        word = before.pop(0)
        time = _time(word) if word[-1:] == ')' else _date(f'{word} {before.pop(0)}')
        if len(before) < 2:
            raise ValueError('neither a line of a candump log nor of its screen')
    identifier = before[-1]
    sent = next((_DIRECTIONS[word] for word in before[1:-1] if word in _DIRECTIONS), None)
    number, extended = _number(identifier), len(identifier) == 8
    # "[8]" is a classical frame, "[08]" one of CAN FD
    kind = RecordKind.FD if len(length) == 4 else DATA
    size = int(length[1:-1])
    if after[:1] == ['remote']:
        kind, size = RecordKind.REMOTE, 0
    elif extended and number & _ERROR_FLAG:
        kind, number = RecordKind.ERROR, number & EXTENDED_IDENTIFIER_MAX
    content = _content(''.join(after[:size]))
    if len(content) != size:
        raise ValueError(f'{len(content)} data bytes instead of {size}')
    return _checked(Record(time, before[0], number, content, extended, kind, sent),
                    len(identifier))


def _read(parse: Callable[[str], Parsed], text: str, what: str) -> Parsed:
    try:
        return parse(text)
    except ValueError:
        raise ValueError(f'{text!r} is no {what}') from None


def _time(word: str) -> float:
    return _read(float, word[1:-1], 'time')


def _date(words: str) -> float:
    """Read what ``candump -t A`` writes: date and time where it was written."""
    try:
        if _DATE.fullmatch(words):
            return datetime.fromisoformat(words[1:-1]).timestamp()
    except (ValueError, OverflowError, OSError):
        pass
    raise ValueError(f'{words.strip("()")!r} is no time')


def _number(digits: str) -> int:
    return _read(lambda text: int(text, 16), digits, 'identifier')


def _content(digits: str) -> bytes:
    return _read(bytes.fromhex, digits, 'hexadecimal data')


def _checked(record: Record, digits: int) -> Record:
    if digits not in (3, 8):
        raise ValueError(f'an identifier of {digits} digits')
    return checked(record)


def checked(record: Record) -> Record:
    """
    Look whether an entry is possible at all.

    :raises ValueError: it is not.
    """
    longest = _LENGTH_MAX if record.kind is RecordKind.FD else _CLASSICAL_MAX
    if len(record.data) > longest:
        raise ValueError(f'{len(record.data)} data bytes')
    highest = EXTENDED_IDENTIFIER_MAX if record.extended else STANDARD_IDENTIFIER_MAX
    if record.kind is not RecordKind.ERROR and not 0 <= record.identifier <= highest:
        raise ValueError(f'identifier {record.identifier:X}h')
    if not -_TIME_MAX < record.time < _TIME_MAX:    # nor NaN
        raise ValueError(f'time {record.time}')
    return record
