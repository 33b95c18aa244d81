# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
SYNC, which the drives of one bus have in common.

*A round* is one SYNC behind the RPDOs of all drives that are in exchange. Each session sends its
own when it is due, which is the same moment for all; the last of them in the order of the bus
sends SYNC. Where a stop does not wait for the next SYNC, a whole round is brought forward: all who
does so sends the RPDOs of all others as well.

A drive that watches SYNC (1006h) leaves *operational* without it, and does not come back before it
gets one. So SYNC goes on between rounds, and before the first of them (:class:`FreeSync`), as long
as a drive is set up, differs, is lost or is told to stop, and one of these is heard. A SYNC puts
into effect what an operational drive has in its buffers: so the first one waits until that can
start no drive of the bus (:attr:`InStep.sync_at`).
"""

import math
from typing import Protocol

from drive_can_bridge.core.outbox import Left, Outbox
from drive_can_bridge.core.session import Stage
from drive_can_bridge.protocols.canopen import network
from drive_can_bridge.protocols.cyclic_exchange import CyclicExchange
from drive_can_bridge.protocols.exchange_book import CYCLE_SPACING_MIN, CycleTimer

#: s that a stop waits for the next SYNC; else a round is brought forward
SYNC_WAIT_MAX = 0.02
#: s since a drive was heard for which SYNC goes on between rounds
HEARD_TIME = 1.0
#: s before NMT start, and behind it, in which there is SYNC although nobody is heard
BEFORE_START, BEHIND_START = 0.1, 0.2


class InStep(Protocol):
    """A session whose drive is synchronised by SYNC."""

    outbox: Outbox
    stage: Stage

    @property
    def exchange(self) -> 'CyclicExchange[list[bytes]]':
        """Its cycles."""

    @property
    def needs_sync(self) -> bool:
        """The drive is looked for, set up, in exchange, or being stopped."""

    @property
    def heard_at(self) -> float:
        """When it sent a PDO, an SDO answer or a heartbeat last."""

    @property
    def sync_at(self) -> float:
        """From when on SYNC starts nothing that is in its buffers; infinity: not known."""


class EventTimer(CycleTimer):
    """When a drive without SYNC is due: its stop jolts no other drive, and goes out at once."""

    __slots__ = ()

    def hurry(self, now: float) -> None:
        self.no_later(max(now, self.began_at + CYCLE_SPACING_MIN))


class SyncSlot(CycleTimer):
    """
    When one drive is due: with all others of its bus.

    :ivar period: s between two rounds.
    :ivar session: of the drive.
    :ivar begun_round: its RPDOs of the round under way were handed out.
    :ivar moved: who serves this drive may not know when it is due.
    :ivar tell: takes what becomes of the SYNC behind them.
    """

    __slots__ = ('_producer', 'begun_round', 'moved', 'period', 'session', 'tell')

    def __init__(self, period: float, producer: 'SyncProducer', session: InStep) -> None:
        super().__init__(period)
        self._producer = producer
        self.period = period
        self.session = session
        self.begun_round = self.moved = False
        self.tell: Left | None = None
        producer.slots.append(self)

    @property
    def running(self) -> bool:
        """The drive is in exchange."""
        return self.due < math.inf

    def takes_part(self, now: float) -> bool:
        """Return whether this round is one of the drive: it has begun it, or is about to."""
        return self.begun_round or self.due < now + 0.5 * self.period

    def start(self, at: float) -> None:
        self.moved = self._producer.pulling
        due = self._producer.next_due(at, self, self.period)
        if self.running and due > at + self.stop_spacing:   # a stop
            if at > self.due:
                self._producer.bring_forward(at)    # the others come along
            due = at
        super().start(due)

    def stop(self) -> None:
        super().start(math.inf)
        self._producer.leave(self)

    def no_later(self, at: float) -> None:
        if math.inf > self.due > at:
            self._producer.bring_forward(at)

    def follow(self, at: float) -> None:
        """Be due then, because others are."""
        super().start(at)
        self.moved = True

    def hurry(self, now: float) -> None:
        if self.due > now + SYNC_WAIT_MAX:
            self.no_later(max(now, self.began_at + CYCLE_SPACING_MIN))

    def begun(self, now: float, pause: float | None = None) -> float:
        error = super().begun(now)
        if pause is not None and pause < self.period:     # those of a stop are closer
            self._producer.bring_forward(now + pause)
        self.begun_round, self.moved = True, self._producer.pulling
        self._producer.agree()
        return error


class SyncProducer:
    """
    The rounds of one bus.

    :ivar slots: of all its drives, in their order.
    :ivar pulling: drives are served of whom another one was.
    :ivar opened: SYNC may be sent.
    :ivar by_rounds: rounds send it.
    """

    def __init__(self) -> None:
        self.slots: list[SyncSlot] = []
        self.pulling = self.opened = self.by_rounds = False
        self._next = self._around_until = -math.inf     # the next SYNC; and NMT start

    @property
    def running(self) -> bool:
        """Some drive is in exchange, so that SYNC is sent."""
        return any(slot.running for slot in self.slots)

    def next_due(self, at: float, slot: SyncSlot, period: float) -> float:
        """Return when a drive that wants to begin then is due: with the others."""
        due = min((other.due for other in self.slots if other is not slot), default=math.inf)
        if due == math.inf and not self.by_rounds:
            due = self.due
        if math.inf in (due, at):
            return at
        while due < at:
            due += period
        return due

    def agree(self) -> None:
        """Make all that have begun this round due together, however late each of them was."""
        begun = [slot for slot in self.slots if slot.begun_round and slot.running]
        soonest = min(slot.due for slot in begun)
        for slot in begun:
            if slot.due > soonest:
                CycleTimer.start(slot, soonest)

    def bring_forward(self, at: float) -> None:
        """Schedule a whole round for then, unless it is due before."""
        for slot in self.slots:
            if slot.running and slot.due > at:
                slot.follow(at)

    def begun(self, slot: SyncSlot, now: float, tell: Left) -> None:
        """
        Record that a drive was sent its RPDOs; SYNC follows if it was the last of this round.

        :param tell: takes what becomes of SYNC.
        """
        slot.tell = tell
        if self.pulling:
            return
        round_of = [each for each in self.slots if each.takes_part(now)]
        waiting = [each for each in round_of if not each.begun_round]
        if waiting and round_of[-1] is not slot and not any(
                each.moved or each.due > now for each in waiting):
            return      # they are served right behind this one
        outbox, self.pulling = slot.session.outbox, True
        try:
            for each in waiting:
                if each.due > now:
                    each.follow(now)
                each.session.exchange.handle_timer(now)
                outbox.take_over(each.session.outbox)
        finally:
            self.pulling = False
        self._send_sync(outbox)

    def leave(self, slot: SyncSlot) -> None:
        """Record that a drive is not in exchange any more: others may have waited for it."""
        slot.begun_round, slot.tell = False, None
        running = [each for each in self.slots if each.running]
        self.by_rounds = self.by_rounds and bool(running)
        if running and not self.pulling and all(each.begun_round for each in running):
            self._send_sync(slot.session.outbox)

    def _send_sync(self, outbox: Outbox) -> None:
        told = [each.tell for each in self.slots if each.begun_round and each.tell is not None]
        for each in self.slots:
            each.begun_round, each.tell = False, None
        self.by_rounds, self._next = True, min(each.due for each in self.slots)

        def left(sent: bool, now: float) -> None:
            for tell in told:
                tell(sent, now)
        outbox.put(network.encode_sync(), left)


    # -- between rounds ---------------------------------------------------------------------------

    @property
    def due(self) -> float:
        """When SYNC is to be sent, or to begin, that no round sends; infinity: never."""
        sessions = [slot.session for slot in self.slots if slot.session.needs_sync]
        if not sessions:
            return math.inf
        if not self.opened:
            return max(session.sync_at for session in sessions)
        until = max(HEARD_TIME + max(session.heard_at for session in sessions), self._around_until)
        soon = self._next + 0.5 * self.slots[0].period
        if self._next > until or min(slot.due for slot in self.slots) < soon:
            return math.inf
        return self._next

    def send(self, outbox: Outbox, now: float) -> None:
        """Send SYNC, if it is due and no round sends it."""
        if self.by_rounds or now < self.due:
            return
        if not self.opened:
            self.opened, self._next = True, now
            if now < self.due:
                return
        period = self.slots[0].period
        self._next += period * max(1, math.ceil((now - self._next) / period - 0.5))
        outbox.put(network.encode_sync())

    def before_start(self, now: float) -> float:
        """Schedule SYNC around an NMT start; return in how many s that may be sent."""
        flows = self.by_rounds or self.due < math.inf
        self._around_until = now + BEFORE_START + BEHIND_START
        if flows:
            return 0.0
        self._next = now
        return BEFORE_START

    def shut(self) -> None:
        """Begin again: nothing is known of the drives any more."""
        self.opened = False

    def ended(self) -> None:
        """Record that a session sends nothing more."""
        if all(slot.session.stage is Stage.IDLE for slot in self.slots):
            self.shut()


class FreeSync:
    """The part of a session that sends SYNC while no round does: any of the bus."""

    def __init__(self, session: InStep, producer: SyncProducer) -> None:
        self._session, self._producer = session, producer

    @property
    def due(self) -> float:
        """When SYNC is due."""
        if self._producer.by_rounds or self._session.stage is Stage.IDLE:
            return math.inf
        return self._producer.due

    def handle_timer(self, now: float) -> None:
        """Send it, if it is due."""
        self._producer.send(self._session.outbox, now)

    def stop(self) -> None:
        """Send none any more on account of this drive."""
        self._producer.ended()
