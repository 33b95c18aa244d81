# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Whether an adapter returns the frames that it sends.

Some firmware and gateways do. One frame is no proof: another master may send the same. So it is
decided for the whole bus, by many frames, again after each opening.
"""

from collections import deque
from dataclasses import dataclass
from enum import Enum

from drive_can_bridge.clock import Clock
from drive_can_bridge.core.frame import Frame

#: s within which a frame comes back
WITHIN = 0.05
#: frames in a row that decide; frames after which it is no echo, whatever it is
IN_A_ROW, UNDECIDED_MAX = 20, 100
#: s for which an echo that is known to come is waited for
_PATIENCE = 1.0


class EchoVerdict(Enum):
    """What is known of an adapter's echoes."""

    OPEN = 'open'
    ECHOES = 'echoes'
    SILENT = 'silent'


@dataclass(slots=True)
class _Sent:
    """A frame: when it was sent, and whether it came back."""

    at: float
    frame: Frame
    came: bool = False


class Echo:
    """
    What was sent, and came back, since the bus was opened. From any thread.

    :ivar verdict: what that shows.
    """

    def __init__(self, clock: Clock) -> None:
        self.verdict = EchoVerdict.OPEN
        self._lock = clock.lock()
        self._now = clock.now
        self._sent: deque[_Sent] = deque()
        self._back = self._missing = self._judged = 0

    def sending(self, frame: Frame) -> None:
        """Record a frame that is about to be sent: its echo may be quicker than the call."""
        with self._lock:
            self._look(self._now())
            self._sent.append(_Sent(self._now(), frame))

    def not_sent(self) -> None:
        """Forget the last frame: it was refused."""
        with self._lock:
            if self._sent:
                self._sent.pop()

    def is_echo(self, frame: Frame) -> bool:
        """Return whether a frame that has arrived is an echo of a sent one."""
        with self._lock:
            self._look(self._now())
            if self.verdict is EchoVerdict.SILENT:
                return False
            place = next((place for place, entry in enumerate(self._sent)
                          if entry.frame == frame and not entry.came), None)
            if place is None:
                # once more what came back already
                again = self.verdict is EchoVerdict.OPEN and any(
                    entry.frame == frame for entry in self._sent)
                self._back = 0 if again else self._back
                return again
            if self.verdict is EchoVerdict.ECHOES:      # those before it were not sent after all
                for _ in range(place + 1):
                    self._sent.popleft()
                return True
            self._sent[place].came = True
            in_order = all(before.came for before in list(self._sent)[:place])
            self._judge(came=True, in_order=in_order)
            return True

    def _look(self, now: float) -> None:
        """Drop frames whose echo is overdue, and count them as not returned."""
        patience = WITHIN if self.verdict is EchoVerdict.OPEN else _PATIENCE
        while self._sent and now - self._sent[0].at > patience:
            came = self._sent.popleft().came
            if not came and self.verdict is EchoVerdict.OPEN:
                self._judge(came=False, in_order=False)

    def _judge(self, *, came: bool, in_order: bool) -> None:
        self._judged += 1
        self._back = self._back + 1 if in_order else 0
        self._missing = 0 if came else self._missing + 1
        if self._back >= IN_A_ROW:
            self.verdict = EchoVerdict.ECHOES
            self._sent = deque(entry for entry in self._sent if not entry.came)
        elif self._missing >= IN_A_ROW or self._judged >= UNDECIDED_MAX:
            self.verdict = EchoVerdict.SILENT
            self._sent.clear()
