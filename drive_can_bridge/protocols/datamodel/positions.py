# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Where axes are that have to stay there, read by number before the first cyclic frame."""

from collections.abc import Callable
import math

from drive_can_bridge.core.setpoints import Setpoints
from drive_can_bridge.protocols.datamodel.channel import AcyclicChannel, Procedure, Read

#: s until a position that a setpoint cannot carry is read again
PAUSE = 0.1


class Positions:
    """
    Reads positions.

    :param offset: added to parameter numbers on the wire.
    :param read: called at the end; takes whether the drive has answered, and the time.
    :ivar due: when they are to be read again; infinity: not planned.
    """

    def __init__(self, channel: AcyclicChannel, setpoints: Setpoints, offset: int,
                 read: Callable[[bool, float], None]) -> None:
        self.due = math.inf
        self._channel = channel
        self._setpoints = setpoints
        self._offset = offset
        self._read = read
        self._asked = -1    # ``setpoints.forgotten`` when they were; -1: they are not

    def forget(self) -> None:
        """Plan nothing any more. The channel was cleared."""
        self._asked, self.due = -1, math.inf

    def read(self, now: float) -> None:
        """Read where the axes are, unless that is under way."""
        asked = self._setpoints.forgotten
        if self._asked != asked:
            self._asked = asked
            self._channel.run(self._all(), lambda raws: self._take(asked, raws), now)

    def _all(self) -> Procedure:
        raws: list[int] = []
        for setpoint in self._setpoints.held:
            words = yield Read((setpoint.measured.number or 0) + self._offset)
            if words is None:
                return None
            raws.append(setpoint.measured.raw_from_word(words[0]))
        return raws

    def _take(self, asked: int, raws: list[int] | None) -> None:
        if asked != self._setpoints.forgotten:      # the drive was lost since
            return
        self._asked = -1
        for setpoint, raw in zip(self._setpoints.held, raws or ()):
            self._setpoints.changed |= setpoint.measure(raw)
        self._read(raws is not None, self._channel.now)
