# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Messages that are serialised once; from then on only their numbers are filled in.

rclpy converts a message attribute by attribute and serialises it, every time it is published. For
a ``ParameterEvent`` of four values that takes twenty times as long as handing its bytes over
(docs/performance.md), and nothing but the stamp and four numbers differs from the last one.

A message in whose bytes the numbers cannot be found (:mod:`.layout`; a bool is one byte, and no
byte is distinctive) is published the ordinary way.
"""

from collections.abc import Callable, Sequence
import struct
from typing import Any

from rclpy.publisher import Publisher

from drive_can_bridge.core.parameters import ValueKind
from drive_can_bridge.ros.layout import find_layout, Layout, Number

#: how a number of each kind stands in a message; a bool is no number
NUMBER_CODES = {ValueKind.DOUBLE: 'd', ValueKind.INTEGER: 'q'}


class PreparedMessage:
    """
    The bytes of one message, in which numbers change. Not to be used by two threads at once.

    One ``struct`` makes all of them: what is constant goes into it as byte strings, in turn with
    the numbers.
    """

    __slots__ = ('_pack', '_parts', '_publish')

    def __init__(self, publisher: Publisher, layout: Layout) -> None:
        # the way to the handle through ``Publisher.publish`` costs more than the handing over; a
        # destroyed publisher raises RCLError
        self._publish: Callable[[bytes], None] = publisher.handle.publish_raw
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

        They have to be given in the order in which the message has them; those in a row are
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
