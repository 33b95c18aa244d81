# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Who speaks, and what a row says in a table of telegrams of different layouts.

Such a table is an enum whose values are rows (:class:`.canopen.sdo.SdoCommand`). Where all
telegrams have one layout, a row is a number and what it means (:class:`.canopen_pkw.pkw.Function`,
:class:`.cannord.parameter_frame.Task`). Sessions, simulated drives and ``decode`` read frames by
the same rows, so ``test/protocols/test_telegrams.py`` wants a frame of a source for each, and
that every change of one is seen.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
import struct
from typing import Any


class Direction(Enum):
    """The sender of a telegram; the value is what a line of text shows."""

    REQUEST = '>'
    RESPONSE = '<'
    NEITHER = '-'


@dataclass(frozen=True)
class TelegramType:
    """
    One row.

    :param direction: who sends it; ``NEITHER``: both sides may.
    :param code: what tells it from others of its direction, and ``mask``: the bits that tell.
    :param layout: its data bytes, for :mod:`struct`.
    :param fields: names of the numbers and bytes in it, in order.
    :param answers: names of the rows that may answer it.
    """

    direction: Direction
    code: int
    mask: int
    layout: str
    fields: str
    answers: str = ''

    def is_sent_by(self, direction: Direction) -> bool:
        """Return whether it goes this way."""
        return self.direction in (direction, Direction.NEITHER)

    @cached_property
    def names(self) -> list[str]:
        """The fields, one by one."""
        return self.fields.split()

    @cached_property
    def _packing(self) -> struct.Struct:
        return struct.Struct(self.layout)

    def pack(self, values: Mapping[str, Any]) -> bytes:
        """Return the data bytes of the fields; what is no field of it is left out."""
        return self._packing.pack(*[values[name] for name in self.names])

    def unpack(self, data: bytes) -> dict[str, Any]:
        """Return the fields; the data have their length."""
        return dict(zip(self.names, self._packing.unpack(data)))
