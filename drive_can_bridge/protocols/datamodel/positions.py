# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Where axes are that have to stay there, read by number before the first cyclic frame."""

from collections.abc import Callable
import math

from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.datamodel.channel import AcyclicChannel, Procedure
from drive_can_bridge.protocols.datamodel.numbers import Numbers

#: s until a position that a setpoint cannot carry is read again
PAUSE = 0.1


class Positions:
    """
    Reads positions.

    :param known: called when all are known.
    :param again: called when one that a setpoint could not carry is to be read again.
    :param silent: called when the drive has not answered; None: they are read again at once, paced
        by the time-out of the read.
    """

    def __init__(self, session: Session, channel: AcyclicChannel, numbers: Numbers, *,
                 known: Callable[[float], None], again: Callable[[float], None],
                 silent: Callable[[float], None] | None) -> None:
        self._due = math.inf
        self._channel = channel
        self._setpoints = session.setpoints
        self._report = session.report
        self._numbers = numbers
        self._known, self._again = known, again
        self._silent = silent or self.read
        self._asked = -1    # ``setpoints.forgotten`` when they were; -1: they are not

    def stop(self) -> None:
        """Plan nothing any more. The channel was cleared."""
        self._asked, self._due = -1, math.inf

    def next_timer(self) -> float:
        """Return when they are to be read again; infinity: not planned."""
        return self._due

    def handle_timer(self, now: float) -> None:
        """Have them read again."""
        self._due = math.inf
        self._again(now)

    def read(self, now: float) -> None:
        """Read where the axes are, unless that is under way."""
        asked = self._setpoints.forgotten
        if self._asked != asked:
            self._asked = asked
            self._channel.run(self._all(), lambda raws: self._take(asked, raws), now)

    def _all(self) -> Procedure:
        raws: list[int] = []
        for setpoint in self._setpoints.held:
            words = yield self._numbers.read(setpoint.measured)
            if words is None:
                return None
            raws.append(setpoint.measured.raw_from_word(words[0]))
        return raws

    def _take(self, asked: int, raws: list[int] | None) -> None:
        if asked != self._setpoints.forgotten:      # the drive was lost since
            return
        self._asked, now = -1, self._channel.now
        for setpoint, raw in zip(self._setpoints.held, raws or ()):
            self._setpoints.changed |= setpoint.measure(raw)
        if self._setpoints.known:
            self._known(now)
            return
        self._report.advice = self._setpoints.untold_text
        if raws is None:
            self._silent(now)
        else:   # but the setpoint cannot carry it
            self._due = now + PAUSE
