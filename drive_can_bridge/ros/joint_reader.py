# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
JointState messages, read from their bytes.

Who commands joints names the same ones each time. To make an object of a message, with a string
for each name, costs more than all that is done with its numbers. So the bytes between the numbers
are compared with those of the message before, and only the numbers are read; where they stand is
found as for messages that are published (:mod:`.prepared`), and tried on a message that was read
the ordinary way.
"""

from array import array
from collections.abc import Sequence
from functools import partial
from itertools import groupby
from operator import itemgetter
import struct
from typing import NamedTuple

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from drive_can_bridge.ros.polled_topics import HEADER
from drive_can_bridge.ros.prepared import find_layout, Layout, Number

#: what a JointState carries beside names
QUANTITIES = ('position', 'velocity', 'effort')
#: so many messages in a row have the same names before it is worth while to look where numbers are
ALIKE = 8
#: bytes of its stamp
STAMP = 8
#: names of a message that is looked at
NAMES_MAX = 1000
#: one quantity, and its values for all joints of a message
Column = tuple[str, Sequence[float]]


class JointMessage(NamedTuple):
    """What a message says: an empty array leaves that quantity alone, and is left out."""

    names: list[str]
    columns: list[Column]


class _Pattern:
    """Messages with these names and quantities, and the same bytes around the numbers."""

    __slots__ = ('_around', '_bytes', '_names', '_rows', '_struct')

    def __init__(self, layout: Layout, names: list[str], quantities: Sequence[str]) -> None:
        said = _said(layout)
        codes, field, at, places = layout.order, 0, 0, []
        constants: list[bytes] = []
        self._rows = []
        for index, constant in enumerate(layout.constants):
            for written, run in groupby(range(at, at + len(constant)), said.__getitem__):
                length = len(list(run))
                codes += f'{length}s' if written else f'{length}x'
                if written:
                    constants.append(constant[:length])
                    places.append(field)
                    field += 1
                constant = constant[length:]
                at += length
            if index < len(layout.codes):
                code = layout.codes[index]
                if index > 1:   # after the stamp
                    self._rows.append((quantities[index - 2], slice(field, field + len(names))))
                codes += code
                at += struct.calcsize(layout.order + code)
                field += int(code[:-1] or 1)
        self._struct = struct.Struct(codes)
        self._around = itemgetter(*places)
        self._bytes = tuple(constants)
        self._names = names

    def read(self, data: bytes) -> JointMessage | None:
        """Read a message; None: it is another one."""
        if len(data) != self._struct.size:
            return None
        fields = self._struct.unpack(data)
        if self._around(fields) != self._bytes:
            return None
        return JointMessage(self._names,
                            [(quantity, fields[row]) for quantity, row in self._rows])


class JointReader:
    """Reads the messages of one topic."""

    def __init__(self) -> None:
        self._pattern: _Pattern | None = None
        self._shape: tuple[list[str], list[tuple[str, int]]] | None = None
        self._alike = 0     # messages of that shape in a row

    def __call__(self, data: bytes) -> JointMessage:
        """
        Read a message.

        :raises RuntimeError: what the middleware says of bytes that are none.
        :raises ValueError: it has too many names.
        """
        if self._pattern is not None:
            known = self._pattern.read(data)
            if known is not None:
                return known
        _check(_name_count(data))   # before anybody makes objects of them
        raw = deserialize_message(data, JointState)
        _check(len(raw.name))
        message = JointMessage(list(raw.name), [
            (quantity, values) for quantity in QUANTITIES
            if len(values := getattr(raw, quantity))])
        shape = message.names, [(quantity, len(values)) for quantity, values in message.columns]
        self._alike = self._alike + 1 if shape == self._shape else 1
        self._shape = shape
        # once for each shape: bytes that differ in something else are not worth another look
        if self._alike == ALIKE:
            self._pattern = _pattern(raw, message, data)
        return message


def _check(names: int) -> None:
    if names > NAMES_MAX:
        raise ValueError(f'{names} names, at most {NAMES_MAX} are allowed')


def _name_count(data: bytes) -> int:
    """Return how many names a message says it has; 0 where it is encoded in another way."""
    if data[:1] != b'\0' or data[1:2] not in (b'\0', b'\1'):     # plain CDR
        return 0
    number = struct.Struct('<I' if data[1] else '>I')
    try:
        (frame_id,) = number.unpack_from(data, HEADER + STAMP)
        after = HEADER + STAMP + number.size + frame_id
        (count,) = number.unpack_from(data, after + -after % number.size)
    except struct.error:    # it ends too soon: the middleware has words for it
        return 0
    return int(count)


def _said(layout: Layout) -> list[bool]:
    """
    Return for each byte of a message in plain CDR whether anything is said in it.

    What only fills up to the alignment of the next field, and what follows the last one, is what
    was in the memory of the publisher (rmw_fastrtps clears neither).
    """
    data = layout.constants[0]
    for constant, code in zip(layout.constants[1:], layout.codes):
        data += bytes(struct.calcsize(layout.order + code)) + constant
    said = [False] * len(data)
    at = 0

    def take(size: int, alignment: int = 1) -> int:
        nonlocal at
        at += -(at - HEADER) % alignment
        said[at:at + size] = [True] * size
        at += size
        return at - size

    def count() -> int:
        (number,) = struct.unpack_from(f'{layout.order}I', data, take(4, 4))
        return int(number)

    take(HEADER + STAMP)
    take(count())           # frame_id
    for _ in range(count()):
        take(count())       # names
    for _ in QUANTITIES:
        if values := count():
            take(8 * values, 8)
    return said


def _pattern(raw: JointState, message: JointMessage, data: bytes) -> _Pattern | None:
    """Return the pattern of a message; None: there is none. ``raw`` is used up."""
    if not message.columns or any(
            len(values) != len(message.names) for _, values in message.columns):
        return None
    stamp = raw.header.stamp
    numbers: list[Number] = [('i', partial(setattr, stamp, 'sec')),
                             ('I', partial(setattr, stamp, 'nanosec'))]
    numbers += [(f'{len(message.names)}d', partial(setattr, raw, quantity))
                for quantity, _ in message.columns]
    layout = find_layout(raw, numbers)
    if layout is None:
        return None
    pattern = _Pattern(layout, message.names, [quantity for quantity, _ in message.columns])
    tried = pattern.read(data)
    return pattern if tried is not None and _bits(tried) == _bits(message) else None


def _bits(message: JointMessage) -> list[tuple[str, bytes]]:
    """Return the numbers of a message so that they can be compared: NaN equals NaN."""
    return [(quantity, array('d', values).tobytes()) for quantity, values in message.columns]
