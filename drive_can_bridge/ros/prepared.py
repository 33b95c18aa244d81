# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Messages that are serialised once; from then on only their numbers are filled in.

rclpy converts a message attribute by attribute and serialises it, every time it is published. For
a ``ParameterEvent`` of four values that takes twenty times as long as publishing its bytes
(docs/performance.md), and nothing but the stamp and four numbers differs from the last one.

A message in whose bytes the numbers cannot be found (a bool is one byte, and no byte is
distinctive) is published the ordinary way.
"""

from bisect import bisect_left
from collections.abc import Callable, Sequence
import struct
from typing import Any, NamedTuple

from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message, serialize_message

from drive_can_bridge.core.parameters import ValueKind
from drive_can_bridge.ros.rcl.outgoing import publish_bytes

#: by struct code: a number whose bytes all differ, and from all others that are likely
_MARKERS = {
    'd': struct.unpack('<d', bytes.fromhex('d17ae93b854f2240'))[0],
    'q': 0x2B86D3195EC7A4F1,
    'i': 0x3D94E5A7,
    'I': 0x2C6BD8F3,
}

#: distance between the markers of two rows
ROW = 1000
#: struct code of a number, and what puts it into the message; ``15d`` is that many in a row, which
#: are put as a list
Number = tuple[str, Callable[[Any], object]]
#: how a number of each kind stands in a message; a bool is no number
NUMBER_CODES = {ValueKind.DOUBLE: 'd', ValueKind.INTEGER: 'q'}


class ConstantBytes(NamedTuple):
    """
    The constant bytes of a message, in turn with its numbers.

    :param order: of the bytes, as ``struct`` writes it.
    :param constants: one more than codes; some may be empty.
    """

    order: str
    constants: tuple[bytes, ...]
    codes: tuple[str, ...]


def find_layout(message: Any, numbers: Sequence[Number]) -> ConstantBytes | None:
    """
    Find where the ``numbers`` of a message are; None: they are not found in its bytes.

    That is not assumed but found: the message is serialised by the middleware in use, with a
    distinctive number in each place.

    They have to be in the message's order. The message is left with
    arbitrary numbers in it.
    """
    markers = [_marker(code, index) for index, (code, _) in enumerate(numbers)]
    for (_, put), marker in zip(numbers, markers):
        put(marker)
    data = serialize_message(message)
    codes = tuple(code for code, _ in numbers)
    for order in '<>':
        constants = _constants(data, order, codes, markers)
        if constants:
            *before, rest = constants
            end = _end_of(message, data, len(data) - len(rest))
            return ConstantBytes(order, (*before, data[len(data) - len(rest):end]), codes)
    return None


def _end_of(message: Any, data: bytes, least: int) -> int:
    """
    Return where the message ends in its bytes, at ``least`` there.

    Fast DDS makes them longer: it has added up the alignment of elements that empty arrays do not
    have. rclpy passes over the rest; rosbags, for one, refuses the whole.
    """
    def is_whole(length: int) -> bool:
        try:
            return bool(deserialize_message(data[:length], type(message)) == message)
        except RuntimeError:    # it is too short
            return False
    lengths = range(least, len(data))
    return lengths.start + bisect_left(lengths, True, key=is_whole)


def _marker(code: str, index: int) -> Any:
    if len(code) > 1:
        return [_marker(code[-1], ROW * (1 + index) + place) for place in range(int(code[:-1]))]
    return _MARKERS[code] + type(_MARKERS[code])(index)


def _constants(data: bytes, order: str, codes: Sequence[str],
               markers: Sequence[Any]) -> tuple[bytes, ...]:
    """Return the bytes between these markers; empty: the markers were not found."""
    constants, end = [], 0
    for code, marker in zip(codes, markers):
        row = marker if isinstance(marker, list) else [marker]
        wanted = struct.pack(order + code, *row)
        place = data.find(wanted)
        if data.count(wanted) != 1 or place < end:
            return ()
        constants.append(data[end:place])
        end = place + len(wanted)
    return (*constants, data[end:])


class PreparedMessage:
    """
    The bytes of one message, in which numbers change. Not to be used by two threads at once.

    One ``struct`` makes all of them: what is constant goes into it as byte strings, in turn with
    the numbers.
    """

    __slots__ = ('_pack', '_parts', '_publish')

    def __init__(self, publisher: Publisher, layout: ConstantBytes) -> None:
        self._publish = publish_bytes(publisher)
        codes, parts = layout.order, []
        for constant, code in zip(layout.constants, layout.codes):
            for before in (constant, *[b''] * (int(code[:-1] or 1) - 1)):
                codes += f'{len(before)}s{code[-1]}'
                parts += [before, 0]
        self._parts: list[Any] = [*parts, layout.constants[-1]]
        self._pack = struct.Struct(f'{codes}{len(self._parts[-1])}s').pack

    @classmethod
    def find(cls, publisher: Publisher, message: Any,
             numbers: Sequence[Number]) -> 'PreparedMessage | None':
        """
        Prepare ``message``, whose ``numbers`` change; None when they are not found in its bytes.

        They have to be in the message's order; those in a row are
        published as so many numbers. The message is left with arbitrary numbers in it.
        """
        layout = find_layout(message, numbers)
        return None if layout is None else cls(publisher, layout)

    def publish(self, numbers: Sequence[Any]) -> None:
        """
        Publish the message with these numbers.

        :raises RCLError: the publisher, or the context, is gone.
        """
        parts = self._parts
        parts[1::2] = numbers
        self._publish(self._pack(*parts))
