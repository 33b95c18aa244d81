# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What the drives of one bus have in common: SYNC, and the heartbeat of the bridge.

*A round* is one SYNC behind the RPDOs of all drives that are in exchange. Each session sends its
own when it is due, which is the same moment for all; the last of them in the order of the bus
sends SYNC. Where a stop does not wait for the next SYNC, a whole round is brought forward: all who
does so sends the RPDOs of all others as well.
"""

from collections.abc import Sequence
import math
from typing import Protocol

from drive_can_bridge.core.outbox import Left, Outbox
from drive_can_bridge.protocols.canopen import network
from drive_can_bridge.protocols.cyclic_exchange import CyclicExchange
from drive_can_bridge.protocols.exchange_book import CYCLE_SPACING_MIN, CycleTimer

#: s that a stop waits for the next SYNC; else a round is brought forward
SYNC_WAIT_MAX = 0.02


class InStep(Protocol):
    """A session that hears SYNC."""

    outbox: Outbox

    @property
    def exchange(self) -> 'CyclicExchange[list[bytes]]':
        """Its cycles."""


class Turn(CycleTimer):
    """
    When one drive is due: with all others of its bus.

    :ivar session: of the drive.
    :ivar begun_round: its RPDOs of the round under way were handed out.
    :ivar moved: who serves this drive may not know when it is due.
    :ivar tell: takes what becomes of the SYNC behind them.
    """

    __slots__ = ('_beat', '_spacing', 'begun_round', 'moved', 'session', 'tell')

    def __init__(self, period: float, beat: 'Beat', session: InStep) -> None:
        super().__init__(period)
        self._beat = beat
        self._spacing = period
        self.session = session
        self.begun_round = self.moved = False
        self.tell: Left | None = None
        beat.turns.append(self)

    @property
    def running(self) -> bool:
        """The drive is in exchange."""
        return self.due < math.inf

    def takes_part(self, now: float) -> bool:
        """Tell whether this round is one of the drive: it has begun it, or is about to."""
        return self.begun_round or self.due < now + 0.5 * self._spacing

    def start(self, at: float) -> None:
        self.moved = self._beat.pulling
        due = self._beat.next_due(at, self, self._spacing)
        if self.running and due > at + self.stop_spacing:   # a stop
            if at > self.due:
                self._beat.bring_forward(at)    # the others come along
            due = at
        super().start(due)

    def stop(self) -> None:
        super().start(math.inf)
        self._beat.leave(self)

    def no_later(self, at: float) -> None:
        if math.inf > self.due > at:
            self._beat.bring_forward(at)

    def follow(self, at: float) -> None:
        """Be due then, because others are."""
        super().start(at)
        self.moved = True

    def hurry(self, now: float) -> None:
        if self.due > now + SYNC_WAIT_MAX:
            self.no_later(max(now, self.began_at + CYCLE_SPACING_MIN))

    def begun(self, now: float, pause: float | None = None) -> float:
        error = super().begun(now)
        if pause is not None and pause < self._spacing:     # those of a stop are closer
            self._beat.bring_forward(now + pause)
        self.begun_round, self.moved = True, self._beat.pulling
        self._beat.agree()
        return error


class Beat:
    """
    The rounds of one bus.

    :ivar turns: of all its drives, in their order.
    :ivar pulling: drives are served of whom another one was.
    """

    def __init__(self) -> None:
        self.turns: list[Turn] = []
        self.pulling = False

    @property
    def running(self) -> bool:
        """Some drive is in exchange, so that SYNC is sent."""
        return any(turn.running for turn in self.turns)

    def next_due(self, at: float, turn: Turn, period: float) -> float:
        """Return when a drive that wants to begin then is due: with the others."""
        due = min((other.due for other in self.turns if other is not turn), default=math.inf)
        if math.inf in (due, at):
            return at
        while due < at:
            due += period
        return due

    def agree(self) -> None:
        """Have all that have begun this round due together, however late each of them was."""
        begun = [turn for turn in self.turns if turn.begun_round and turn.running]
        soonest = min(turn.due for turn in begun)
        for turn in begun:
            if turn.due > soonest:
                CycleTimer.start(turn, soonest)

    def bring_forward(self, at: float) -> None:
        """Have a whole round begin then, unless it is due before."""
        for turn in self.turns:
            if turn.running and turn.due > at:
                turn.follow(at)

    def begun(self, turn: Turn, now: float, tell: Left) -> None:
        """
        Record that a drive was sent its RPDOs; SYNC follows if it was the last of this round.

        :param tell: takes what becomes of SYNC.
        """
        turn.tell = tell
        if self.pulling:
            return
        round_of = [each for each in self.turns if each.takes_part(now)]
        waiting = [each for each in round_of if not each.begun_round]
        if waiting and round_of[-1] is not turn and not any(
                each.moved or each.due > now for each in waiting):
            return      # they are served right behind this one
        outbox, self.pulling = turn.session.outbox, True
        try:
            for each in waiting:
                if each.due > now:
                    each.follow(now)
                each.session.exchange.handle_timer(now)
                outbox.take_over(each.session.outbox)
        finally:
            self.pulling = False
        self._send_sync(outbox)

    def leave(self, turn: Turn) -> None:
        """Record that a drive is not in exchange any more: others may have waited for it."""
        turn.begun_round, turn.tell = False, None
        running = [each for each in self.turns if each.running]
        if running and not self.pulling and all(each.begun_round for each in running):
            self._send_sync(turn.session.outbox)

    def _send_sync(self, outbox: Outbox) -> None:
        told = [each.tell for each in self.turns if each.begun_round and each.tell is not None]
        for each in self.turns:
            each.begun_round, each.tell = False, None

        def left(sent: bool, now: float) -> None:
            for tell in told:
                tell(sent, now)
        outbox.put(network.encode_sync(), left)


class BridgeHeartbeat:
    """
    The heartbeat that the drives of a bus watch.

    :param node: node-ID of the bridge.
    :param interval: s between two of them.
    """

    def __init__(self, node: int, interval: float) -> None:
        self._frame = network.encode_heartbeat(node, network.NmtState.OPERATIONAL)
        self._interval = interval
        self._due = -math.inf

    def next_timer(self) -> float:
        """Return when the next one is due."""
        return self._due

    def beat(self, outbox: Outbox, now: float) -> None:
        """Send one, if it is due."""
        if now >= self._due:
            self._due = now + self._interval if now > self._due + self._interval else (
                self._due + self._interval)
            outbox.put(self._frame)


def smallest(intervals: Sequence[float]) -> float:
    """Return the shortest interval that is on; 0: none is."""
    return min((interval for interval in intervals if interval > 0.0), default=0.0)
