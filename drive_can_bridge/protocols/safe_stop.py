# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The stop of a drive by acyclic writes, whatever its family: begun, and what is said in the end.

What has to be told, and how often, is a procedure of the family, in the lane that comes first.
"""

from collections.abc import Callable, Generator
from typing import Any, Generic

from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.channel import Channel, Lane
from drive_can_bridge.protocols.courier import ReplyT, StepT


class SafeStop(Generic[StepT, ReplyT]):
    """
    The acyclic stop of one drive.

    :param ended: called when it has run its course.
    :ivar running: it is under way.
    """

    def __init__(self, session: Session, channel: Channel[StepT, ReplyT],
                 ended: Callable[[], None]) -> None:
        self.running = False
        self._session = session
        self._channel = channel
        self._ended = ended
        self._owed = False          # there was something to be stopped when it began
        self._insisting = False

    def begin(self, procedure: Generator[StepT, ReplyT, list[str]],
              confirmed: Callable[[], Any], now: float, *, insist: bool = False) -> None:
        """
        Begin.

        :param procedure: returns what failed, in words; nothing: the drive has confirmed it all.
        :param confirmed: called in this case.
        :param insist: what failed is told even if the drive was not told to run.
        """
        self.running = True
        self._owed, self._insisting = self._session.told.owed, insist
        self._channel.run(procedure, lambda failed: self._done(failed, confirmed), now, Lane.STOP)

    def forget(self) -> None:
        """Take note that the channel was cleared."""
        self.running = False

    def _done(self, failed: list[str], confirmed: Callable[[], Any]) -> None:
        self.running = False
        if not failed:
            confirmed()
        elif self._owed or self._insisting:
            self._session.report.warn(
                f'told to stop, but {"; ".join(failed)}', may_run=self._owed)
            if not self._session.active:    # which ends with it: there is no more to be said
                self._session.told.stopped()
        self._ended()
