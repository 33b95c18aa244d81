# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Vector's text format, ``.asc``: what python-can's reader needs, and what it ignores.

.. code-block:: text

    0.015991 CAN 1 Status:chip status error passive - TxErr: 132 RxErr: 0
    1.015991 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%
    2.501000 1  605             TxRq d 8 40 41 60 00 00 00 00 00
    2.501100 1  605             Tx   d 8 40 41 60 00 00 00 00 00
"""

from collections import Counter, deque
from collections.abc import Iterable, Iterator
import itertools
import re

from drive_can_bridge.core.frame import Record, state_record

#: of a header: each time is counted from the line before; and a line with its time
_FROM_THE_LAST = re.compile(r'\s*base\s+(?:hex|dec)\s+timestamps\s+relative', re.IGNORECASE)
_DECIMAL = re.compile(r'\s*base\s+dec', re.IGNORECASE)
_TIMED = re.compile(r'\s*([0-9]+\.[0-9]+)(?=\s)')
#: what python-can's reader reads as a frame, and what is one without its direction
_FRAME = re.compile(r'\s*\d+\.\d+\s+(?:\d+\s+(?:\w+\s+(?:Tx|Rx)\b|ErrorFrame)|CANFD\s)',
                    re.ASCII | re.IGNORECASE)
#: a state of a controller
_STATUS = re.compile(r'\s*([0-9.]+)\s+CAN\s+(\d+)\s+Status:\s*(.*\S)')
_WELL = 'error active'
#: what is of no bus, and is not counted
_ORDINARY = re.compile(
    r'\s*(?:$|//|date\b|base\b|(?:no\s+)?internal\s+events|begin\s+trigger|end\s+trigger'
    r'|[0-9.]+\s+start\s+of\s+measurement|[0-9.]+\s+(?:begin|end)\s+trigger)', re.IGNORECASE)
_REQUEST = ' TxRq '
#: what a line calls itself, behind its time and the number of its channel
_KIND = re.compile(r'\s*[0-9.]+\s+(?:CAN\s+)?(?:\d+\s+)?([A-Za-z]\w{2,19}):?(?:\s|$|:)')
#: bits of the flags of a ``CANFD`` line: remote frame, and EDL, without which it is classical
_REMOTE_FLAG, _EDL = 0x10, 0x1000


def of_vector(stream: Iterable[str], aside: deque[Record], passed: Counter[str]) -> Iterator[str]:
    """
    Yield lines as python-can's reader needs them: times from the beginning, an end of the header.

    It reads all ``CANFD`` lines as CAN FD, and requests to send (``TxRq``) as frames.

    :param aside: gets the entries that it does not know.
    :param passed: counts lines of other kinds.
    """
    lines = iter(stream)
    relative, elapsed, base = False, 0.0, 16
    for line in lines:
        relative = relative or _FROM_THE_LAST.match(line) is not None
        base = 10 if _DECIMAL.match(line) else base
        timed = _TIMED.match(line)
        if timed is not None:
            yield 'no internal events logged\n'     # takes the next line for that, whatever it is
            lines = itertools.chain((line,), lines)
            break
        yield line
    for line in lines:
        if relative and (timed := _TIMED.match(line)) is not None:
            elapsed += float(timed[1])
            line = f'{elapsed:.6f}{line[timed.end():]}'
        if _FRAME.match(line) is None:
            if not _is_state(line, aside):
                _count(line, passed)
            if _ORDINARY.match(line) is None:
                continue
        elif 'CANFD' in line:
            line = _classical(line, base)
        yield line


def _is_state(line: str, aside: deque[Record]) -> bool:
    """Return whether a line is a state of a controller, which is put aside."""
    status = _STATUS.match(line)
    if status is None:
        return False
    time, channel, words = status.groups()
    aside.append(state_record(float(time), int(channel), words, well=words.endswith(_WELL)))
    return True


def _count(line: str, passed: Counter[str]) -> None:
    if _REQUEST in line:
        passed['TxRq'] += 1
    elif _ORDINARY.match(line) is None:
        kind = _KIND.match(line)
        passed[kind[1] if kind is not None else 'lines of another kind'] += 1


def _classical(line: str, base: int) -> str:
    """Return a ``CANFD`` line of a classical frame as a line of such frames."""
    words = line.split()
    if len(words) < 6 or words[4].lower() == 'errorframe':
        return line
    # time CANFD channel direction identifier [name] BRS ESI DLC length data… duration bits flags
    place = 5 if words[5].isdigit() else 6
    try:
        size = int(words[place + 3])
        after = place + 4 + size
        flags = int(words[after + 2], 16)
        if flags & _EDL or int(words[place + 2], base) > 15:
            return line
    except (IndexError, ValueError):
        return line
    time, _, channel, direction, identifier = words[:5]
    content = f'r {size}' if flags & _REMOTE_FLAG else ' '.join(
        ('d', f'{size}', *words[place + 4:after]))
    return f'{time} {channel} {identifier} {direction} {content}\n'
