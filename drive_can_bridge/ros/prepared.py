# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Messages that are serialised once; from then on only their numbers are filled in.

rclpy converts a message attribute by attribute and serialises it, every time it is published. For
a ``ParameterEvent`` of four values that takes twenty times as long as handing its bytes over
(docs/performance.md), and nothing but the stamp and four numbers differs from the last one.

Where in the bytes a number stands is not assumed but found: the message is serialised by the
middleware in use, with a distinctive number in each place. A message in which that cannot be
found (a bool is one byte, and no byte is distinctive) is published the ordinary way.
"""

from collections.abc import Callable, Sequence
import struct
from typing import Any

from rclpy.publisher import Publisher
from rclpy.serialization import serialize_message

from drive_can_bridge.core.parameters import ValueKind

#: by struct code: a number whose bytes all differ, and from all others that are likely
_MARKERS = {
    'd': struct.unpack('<d', bytes.fromhex('d17ae93b854f2240'))[0],
    'q': 0x2B86D3195EC7A4F1,
    'i': 0x3D94E5A7,
    'I': 0x2C6BD8F3,
}

#: distance between the markers of two rows
ROW = 1000
#: how a number of each kind stands in a message; a bool is no number
NUMBER_CODES = {ValueKind.DOUBLE: 'd', ValueKind.INTEGER: 'q'}
#: struct code of a number, and what puts it into the message; ``15d`` is that many in a row, which
#: are put and published as a list
Number = tuple[str, Callable[[Any], object]]


class PreparedMessage:
    """
    The bytes of one message and the places of its numbers. Not to be used by two threads at once.

    :param places: for each number, what packs it into a buffer, and its offset.
    """

    __slots__ = ('_buffer', '_places', '_publish')

    def __init__(self, publisher: Publisher, buffer: bytearray,
                 places: list[tuple[Callable[..., None], int]]) -> None:
        # the way to the handle through ``Publisher.publish`` costs more than the handing over; a
        # destroyed publisher raises RCLError
        self._publish: Callable[[bytes], None] = publisher.handle.publish_raw
        self._buffer = buffer
        self._places = places

    @classmethod
    def find(cls, publisher: Publisher, message: Any,
             numbers: Sequence[Number]) -> 'PreparedMessage | None':
        """
        Prepare ``message``, whose ``numbers`` change; None when they are not found in its bytes.

        The message is left with arbitrary numbers in it.
        """
        markers = [_marker(code, index) for index, (code, _) in enumerate(numbers)]
        for (_, put), marker in zip(numbers, markers):
            put(marker)
        data = serialize_message(message)
        for order in '<>':
            wanted = [_packer(order + code)(marker)
                      for (code, _), marker in zip(numbers, markers)]
            if all(data.count(part) == 1 for part in wanted):
                return cls(publisher, bytearray(data), [
                    (_filler(order + code), data.index(part))
                    for (code, _), part in zip(numbers, wanted)])
        return None

    def publish(self, numbers: Sequence[Any]) -> None:
        """
        Publish the message with these numbers.

        :raises RCLError: the publisher, or the context, is gone.
        """
        buffer = self._buffer
        for (pack_into, offset), number in zip(self._places, numbers):
            pack_into(buffer, offset, number)
        self._publish(bytes(buffer))


def _marker(code: str, index: int) -> Any:
    if len(code) > 1:
        return [_marker(code[-1], ROW * (1 + index) + place) for place in range(int(code[:-1]))]
    return _MARKERS[code] + type(_MARKERS[code])(index)


def _packer(code: str) -> Callable[[Any], bytes]:
    """Return what packs a number, or a row of them."""
    pack = struct.Struct(code).pack
    return (lambda row: pack(*row)) if len(code) > 2 else pack


def _filler(code: str) -> Callable[..., None]:
    """Return what packs a number, or a row of them, into a buffer at an offset."""
    pack_into = struct.Struct(code).pack_into
    if len(code) == 2:
        return pack_into
    return lambda buffer, offset, row: pack_into(buffer, offset, *row)
