# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Drives that are not there: what is said of one, and who is missing a while after the start."""

from collections.abc import Sequence
import time

from drive_can_bridge.clock import Clock
from drive_can_bridge.core import sentences
from drive_can_bridge.core.drive_state import DriveState
from drive_can_bridge.core.sentences import Sentence
from drive_can_bridge.core.words import counted
from drive_can_bridge.ros.drive_node import DriveNode
from drive_can_bridge.ros.log import Log

#: s after the activation that a drive may take to be seen
GRACE = 5.0
_NEVER = 'not seen since start: '
#: what a session says while it looks for a drive: of what to correct at a first start, which this
#: one has behind it
_FIRST_START = frozenset((
    'looked_for', 'maps_unread', 'cycles_unanswered', 'reads_unanswered', 'rounds_unanswered',
    'silent', 'reconnected'))


def absence(drive: DriveNode) -> Sentence:
    """Say of a drive that is offline since when, and what to do about it."""
    session, exchange = drive.session, drive.exchange
    what = session.offline_advice
    if exchange.bus_state != 'up':      # which is told once, there
        return (sentences.bus_of_drive_opening if exchange.bus_state == 'opening' else
                sentences.bus_of_drive_down)(exchange.bus.name)
    if not session.ever_online:
        return sentences.never_seen(what)
    since = time.strftime('%H:%M:%S', time.localtime(drive.lost_at // 1_000_000_000))
    if what.code in _FIRST_START:
        what = drive.lost_for
    return sentences.silent_since(since, what)


class Attendance:
    """
    Says once, a while after each activation, which drives were never seen.

    :param drives: of the bridge.
    """

    def __init__(self, log: Log, drives: Sequence[DriveNode], clock: Clock) -> None:
        self._log = log
        self._drives = drives
        self._clock = clock
        self._over = clock.alarm()
        self._thread = clock.worker(self._run, 'attendance')

    def begin(self) -> None:
        """Look in a while."""
        self._over = self._clock.alarm()
        self._thread = self._clock.worker(self._run, 'attendance')
        self._thread.start()

    def end(self) -> None:
        """Do not look any more; wait for a look that is under way."""
        self._over.ring()
        self._thread.join()

    def _run(self) -> None:
        try:
            if not self._over.wait(self._clock.now() + GRACE):
                self.look()
        except Exception as error:  # noqa: BLE001  outermost of a thread: no failure is silent
            self._log.error(f'attendance: {type(error).__name__}: {error}')

    def look(self) -> None:
        """Say who is missing."""
        missing = [drive for drive in self._drives if _never_seen(drive)]
        if not missing:
            return
        for drive in missing:
            with drive.exchange.lock:
                text = absence(drive)
            self._log.speaker(drive.name).warning(f'{_NEVER}{text.removeprefix(_NEVER)}')
        online = sum(drive.session.online for drive in self._drives)
        self._log.warning(f'{online} of {counted(len(self._drives), "drive", "drives")} online; '
                          f'not seen: {", ".join(drive.name for drive in missing)}')


def _never_seen(drive: DriveNode) -> bool:
    session = drive.session
    return (session.active and not session.ever_online and not session.defect
            and session.state is DriveState.OFFLINE)
