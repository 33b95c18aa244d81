# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The properties of a CAN adapter that decide whether drives can be driven through it."""

from dataclasses import dataclass
from typing import NamedTuple

from drive_can_bridge.core.frame import Route

#: bit/s that the SLCAN command S7 sets: in CANable 1 and 2; by LAWICEL's manual
S7_RATES = 750_000, 800_000


class Dropped(NamedTuple):
    """Frames that an adapter accepts and never sends."""

    what: str
    route: Route


@dataclass(frozen=True, slots=True)
class AdapterTraits:
    """
    The known properties of the adapter of a bus.

    :param title: what people call it.
    :param latency: s that it may keep what it has received.
    :param remedy: the command that makes that less; '' where there is none.
    :param line_rate: bit/s of the serial line to it; 0: there is none, or none that limits.
    :param line_bits: bits on that line for each bit on the bus, at most.
    :param listen_only: what makes it listen only; '' where nothing does.
    :param drops: what it never sends.
    """

    title: str
    latency: float = 0.0
    remedy: str = ''
    line_rate: int = 0
    line_bits: float = 1.0
    listen_only: str = ''
    drops: tuple[Dropped, ...] = ()
