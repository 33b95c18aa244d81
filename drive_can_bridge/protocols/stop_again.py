# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The stop of a drive that may run on although it is offline: told again when it shows up.

A drive that falls silent is told to stop, and may not hear it. When it is back, it is told with
the first exchange that is complete. Until then, and that may be for ever if it answers a part
only, any sign of life has it told again: at once, and then with pauses.
"""

from collections.abc import Callable, Generator
from typing import Any

from drive_can_bridge.core.session import Session, Stage
from drive_can_bridge.core.stop_duty import Happened
from drive_can_bridge.protocols.channel import Channel, Priority
from drive_can_bridge.protocols.safe_stop import SafeStop

#: s after one that was told again until the next: what looks for the drive goes on meanwhile
PAUSE = 1.0
#: longest such pause where each stop wears an EEPROM: they double
PAUSE_MAX = 60.0


class StopAgain:
    """
    The stops of one drive that are told again until it has confirmed one.

    :param stop: what is told.
    :param tell: begins it.
    :param wears: it is written to an EEPROM.
    """

    def __init__(self, session: Session, channel: Channel[Any, Any], stop: SafeStop[Any, Any],
                 tell: Callable[[float], None], *, wears: bool = False) -> None:
        self._session = session
        self._channel = channel
        self._stop = stop
        self._tell = tell
        self._longest = PAUSE_MAX if wears else PAUSE
        self._pause = PAUSE
        self._first = True

    def heard(self, now: float, *, hurry: bool = False, answered: bool = False) -> None:
        """
        Record a sign of life, before an answer is taken that it may be.

        :param hurry: it is no answer, and for that to what is under way a moment will do; once,
            for a slow drive would never be found.
        :param answered: the answer that it may be has been taken.
        """
        if not self._wanted:
            self._pause, self._first = PAUSE, True
        elif now >= self._stop.again_at + self._pause and self._channel.is_idle(Priority.STOP):
            if hurry and self._first:
                self._channel.make_room(now)
            self._first = False
            if answered:
                self._again(now)
            else:
                self._channel.run(self._begin(), lambda _: None, now, Priority.STOP)

    @property
    def _wanted(self) -> bool:
        session = self._session
        return not session.online and session.stage is Stage.RUNNING and session.may_run

    def _begin(self) -> Generator[Any, Any, None]:
        """Begin when the exchange under way has ended, unless that has found the drive."""
        if self._wanted:
            self._again(self._channel.now)
        yield from ()

    def _again(self, now: float) -> None:
        self._pause = min(2 * self._pause, self._longest)
        self._session.duty.happened(Happened.SHOWED_UP)
        self._tell(now)
