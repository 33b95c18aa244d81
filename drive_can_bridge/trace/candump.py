# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The two texts that candump writes, log file (``-l``, ``-L``) and screen, read and written.

.. code-block:: text

    (1700000000.123456) can0 003FFFF0#05DC000000000000 T
     (1700000000.123456)  can0  TX - -  003FFFF0   [8]  05 DC 00 00 00 00 00 00
     (2026-11-21 23:04:38.123456)  can0  003FFFF0   [8]  05 DC 00 00 00 00 00 00

python-can's reader takes most error frames for data frames, ends at the first line that is none of
its own, and does not know the screen.
"""

from collections.abc import Callable, Iterable, Iterator
from datetime import datetime
import itertools
import re
from typing import TypeVar

from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.frame import DATA, EXTENDED_IDENTIFIER_MAX, Record, RecordKind
from drive_can_bridge.trace.formats import checked, CLASSICAL_MAX, Complain, TIME_MAX

Parsed = TypeVar('Parsed')
#: linux/can.h, in identifiers of eight digits
_ERROR_FLAG = 0x20000000
#: DLCs of classical frames that mean eight bytes, too, as ``candump -8`` writes them
_LONG_DLC = '9ABCDEF'
_LONG_LENGTHS = tuple(f'{{{digit}}}' for digit in _LONG_DLC)
#: the highest identifiers as they are written; lower ones come before them in the alphabet, too
_EXTENDED_DIGITS, _STANDARD_DIGITS = '1FFFFFFF', '7FF'
_DATE = re.compile(r'\([0-9]{4}-[0-9]{2}-[0-9]{2} [0-9]{2}:[0-9]{2}:[0-9]{2}\.[0-9]{6}\)')
_DIRECTIONS = {'R': False, 'T': True, 'RX': False, 'TX': True}
#: characters of a line of eight bytes, with room to spare; a longer one is no frame
LINE_MAX = 400


def format_record(record: Record) -> str:
    """Return an entry as a line of ``candump -L``, with its direction where that is known."""
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
                if len(content) <= CLASSICAL_MAX and 0.0 <= time < TIME_MAX and hash_sign:
                    return Record(time, words[1], number, content, width == 8, DATA,
                                  _DIRECTIONS.get(words[3]) if count == 4 else None)
        if hash_sign:
            return _logged(words, digits, data)
    if not words:
        return None
    if len(line) > LINE_MAX:
        raise ValueError('too long')
    if words[0] == '(' and count > 1:   # a time that was filled up with blanks
        words[:2] = [f'({words[1]}']
    if len(words) > 2 and '#' in words[2] and words[0][:1] == '(':
        # what tools and people write behind a frame is no part of it, unless it is another one
        if any(mark in word for word in words[3:] for mark in '#('):
            raise ValueError(command_sentences.frames_in_a_line())
        digits, _, data = words[2].partition('#')
        return _logged(words, digits, data)
    return _shown(words)


def _logged(words: list[str], identifier: str, data: str) -> Record:
    """Read a line of a log file."""
    time, number = _time(words[0]), _number(identifier)
    extended = len(identifier) == 8
    sent = _DIRECTIONS.get(words[3]) if len(words) > 3 else None
    kind = DATA
    if data[-2:-1] == '_' and data[-1] in _LONG_DLC and len(data) == 2 * CLASSICAL_MAX + 2:
        data = data[:-2]        # `candump -8`: eight bytes whose DLC is higher
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
                  if word[:1] == '[' and word[-1:] == ']' and word[1:-1].isdecimal()
                  or word in _LONG_LENGTHS), None)
    if place is None or place < 2:
        raise ValueError(command_sentences.no_candump_line())
    before, length, after = words[:place], words[place], words[place + 1:]
    time = 0.0
    if before[0][:1] == '(':
        word = before.pop(0)
        time = _time(word) if word[-1:] == ')' else _date(f'{word} {before.pop(0)}')
        if len(before) < 2:
            raise ValueError(command_sentences.no_candump_line())
    identifier = before[-1]
    sent = next((_DIRECTIONS[word] for word in before[1:-1] if word in _DIRECTIONS), None)
    number, extended = _number(identifier), len(identifier) == 8
    # "[8]" is a classical frame, "[08]" one of CAN FD
    kind = RecordKind.FD if len(length) == 4 else DATA
    size = CLASSICAL_MAX if length in _LONG_LENGTHS else int(length[1:-1])
    if after[:1] == ['remote']:
        kind, size = RecordKind.REMOTE, 0
    elif extended and number & _ERROR_FLAG:
        kind, number = RecordKind.ERROR, number & EXTENDED_IDENTIFIER_MAX
    content = _content(''.join(after[:size]))
    if len(content) != size:
        raise ValueError(command_sentences.data_bytes_differ(found=len(content), wanted=size))
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
    """Read the date and time of ``candump -t A``, in the time zone where it was written."""
    try:
        if _DATE.fullmatch(words):
            return datetime.fromisoformat(words[1:-1]).timestamp()
    except (ValueError, OverflowError, OSError):
        pass
    raise ValueError(command_sentences.no_time(word=repr(words.strip('()'))))


def _number(digits: str) -> int:
    return _read(lambda text: int(text, 16), digits, 'identifier')


def _content(digits: str) -> bytes:
    return _read(bytes.fromhex, digits, 'hexadecimal data')


def _checked(record: Record, digits: int) -> Record:
    if digits not in (3, 8):
        raise ValueError(command_sentences.identifier_digits(digits=digits))
    return checked(record)


def candump_records(stream: Iterable[str], complain: Complain) -> Iterator[Record]:
    parse = parse_line
    number = 0
    record: Record | None = None
    for line in _from_differences(iter(stream), complain):
        number += 1
        try:
            record = parse(line)
        except ValueError as error:
            # `candump -e` explains an error frame on the lines behind it
            if record is None or record.kind is not RecordKind.ERROR or line[0] != '\t':
                complain(f'line {number}: {error}')
            continue
        if record is not None:
            yield record


#: the time of a line of ``candump -t d`` or ``-t z``
_SHORT_TIME = re.compile(r' \((\d{3}\.\d{6})\) ')
#: lines by which times since the start (they rise) are told from those since the last line
_LOOKED_AT = 32
#: of so many steps one falls or stays, at least, where times are differences
_FALLS = 8


def _from_differences(lines: Iterator[str], complain: Complain) -> Iterator[str]:
    """Return lines with times from the beginning, where ``candump -t d`` wrote differences."""
    head = list(itertools.islice(lines, 1))
    if not head or _SHORT_TIME.match(head[0]) is None:
        return itertools.chain(head, lines)
    head += itertools.islice(lines, _LOOKED_AT)
    times = [float(found[1]) for found in map(_SHORT_TIME.match, head) if found is not None]
    falls = sum(later <= earlier for earlier, later in itertools.pairwise(times))
    lines = itertools.chain(head, lines)
    if not falls or falls * _FALLS < len(times) - 1:
        return lines
    complain(command_sentences.times_added_up())
    return _added_up(lines)


def _added_up(lines: Iterator[str]) -> Iterator[str]:
    elapsed = 0.0
    for line in lines:
        timed = _SHORT_TIME.match(line)
        if timed is not None:
            elapsed += float(timed[1])
            line = f' ({elapsed:.6f}) {line[timed.end():]}'
        yield line
