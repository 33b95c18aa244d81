# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Where the numbers of a message stand in its bytes.

That is not assumed but found: the message is serialised by the middleware in use, with a
distinctive number in each place.
"""

from collections.abc import Callable, Sequence
import struct
from typing import Any, NamedTuple

from rclpy.serialization import serialize_message

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


class Layout(NamedTuple):
    """
    The bytes of a message: what is constant, in turn with numbers.

    :param order: of the bytes, as ``struct`` writes it.
    :param constants: one more than codes; some may be empty.
    """

    order: str
    constants: tuple[bytes, ...]
    codes: tuple[str, ...]


def find_layout(message: Any, numbers: Sequence[Number]) -> Layout | None:
    """
    Find where the ``numbers`` of a message stand; None: they are not found in its bytes.

    They have to be given in the order in which the message has them. The message is left with
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
            return Layout(order, constants, codes)
    return None


def _marker(code: str, index: int) -> Any:
    if len(code) > 1:
        return [_marker(code[-1], ROW * (1 + index) + place) for place in range(int(code[:-1]))]
    return _MARKERS[code] + type(_MARKERS[code])(index)


def _constants(data: bytes, order: str, codes: Sequence[str],
               markers: Sequence[Any]) -> tuple[bytes, ...]:
    """Return what stands between these markers; nothing: they are not there."""
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
