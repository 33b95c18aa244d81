# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The heartbeats that a simulated node misses (1016h): watched from the first one on."""

import math

from drive_can_bridge.protocols.canopen import abort_codes, network
from drive_can_bridge.simulation.canopen.sdo import checked_length
from drive_can_bridge.simulation.registers import Refused

INDEX = 0x1016


class HeartbeatConsumer:
    """
    Watches other nodes, each at a place of the list: node << 16 | ms.

    :param places: how many there are.
    """

    def __init__(self, places: int) -> None:
        self._watched = [0] * places
        self._stored = list(self._watched)
        self.begin()

    def store(self) -> None:
        """Keep the list without power."""
        self._stored = list(self._watched)

    def begin(self) -> None:
        """Have what was stored, and have heard nobody."""
        self._watched = list(self._stored)
        self._heard = [math.inf] * len(self._watched)

    def read(self, subindex: int) -> bytes:
        if subindex == 0:
            return bytes((len(self._watched),))
        return self._watched[self._place(subindex)].to_bytes(4, 'little')

    def write(self, subindex: int, data: bytes) -> None:
        if subindex == 0:
            raise Refused(abort_codes.WRITE_OF_READ_ONLY)
        place = self._place(subindex)
        self._watched[place] = int.from_bytes(checked_length(data, 4), 'little')
        self._heard[place] = math.inf

    def hear(self, node: int, now: float) -> None:
        """Take a heartbeat."""
        for place, watched in enumerate(self._watched):
            if watched >> 16 & network.NODE_MAX == node and watched & 0xFFFF:
                self._heard[place] = now

    def next_timer(self) -> float:
        """Return when the next heartbeat is missed."""
        return min(map(self._due, range(len(self._watched))))

    def missed(self, now: float) -> list[int]:
        """Return the nodes that are missed now, each once."""
        missed = [place for place in range(len(self._watched)) if self._due(place) <= now]
        for place in missed:
            self._heard[place] = math.inf
        return [self._watched[place] >> 16 & network.NODE_MAX for place in missed]

    def _due(self, place: int) -> float:
        return self._heard[place] + (self._watched[place] & 0xFFFF) / 1000.0

    def _place(self, subindex: int) -> int:
        if subindex > len(self._watched):
            raise Refused(abort_codes.NO_SUCH_SUBINDEX)
        return subindex - 1
