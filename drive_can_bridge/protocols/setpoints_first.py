# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Drives that are told one thing at a time: no word that starts one leaves before its setpoints.

A drive may have been off for a moment, unseen, and have in its registers what somebody else has
put there. So each of its setpoints is written again, neutral as they are then, right before it is
told ``enable``, every time, and counts when it has left (where a write is acknowledged, when it
was), but not while nobody answers.
"""

from collections.abc import Collection

from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.polling import WriteSchedule


class SetpointsFirst:
    """
    Holds the word that starts one drive back.

    :param schedule: where setpoints become due.
    :param indices: those of the setpoints in it.
    """

    def __init__(self, session: Session, schedule: WriteSchedule,
                 indices: Collection[int]) -> None:
        self._session = session
        self._schedule = schedule
        self._indices = indices
        self._starting = False
        self._lacking: set[int] = set()

    def look(self, *, again: bool = False) -> bool:
        """
        Tell whether the word has to wait; when it begins to, all setpoints become due.

        :param again: the word is due again, to a drive that takes no notice of it.
        """
        control = self._session.control
        starting = control is not None and (control.word_due or again) and not (
            control.at_rest or control.stopping or control.pulsing)
        if starting and not self._starting:
            self._lacking = set(self._indices)
            for index in self._indices:
                self._schedule.failed(index)
        self._starting = starting
        return starting and bool(self._lacking)

    def forget(self) -> None:
        """Let what was written not count: whether the drive was there to hear it, nobody knows."""
        self._starting = False

    def written(self, index: int) -> bool:
        """Record that the drive has a setpoint; tell whether it was the last one waited for."""
        waited = self._starting and index in self._lacking
        self._lacking.discard(index)
        return waited and not self._lacking
