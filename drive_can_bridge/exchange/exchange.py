# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The exchange of one bus: owns the sessions of its drives under one lock.

Two threads drive it: the link's reader (``frame_received``) and the timer thread started here.
A request is submitted under the same lock, which sends the frames at once, so that a
service call never waits for a tick. Everything that a frame causes, publishing included, happens
in the thread that received it: a hop through an executor costs 50 µs and a quarter of a core at
1,000 frames/s.

What is due is served in a *pass*. Passes follow the earliest of the sessions' deadlines, which are
absolute: that needs no executor, no wait set, and follows each session's own rhythm (cycles, time-
outs, EEPROM gaps) instead of one period. Drives of equal periods take turns (:func:`stagger`).

Where the adapter wakes the reader in time (``EndPoint.punctual``), the reader makes the passes,
too: it sleeps once for whatever comes first, a frame or a deadline, and no thread has to wait for
the other one's lock and interpreter. It sets when it will be back. The timer thread makes the
passes that are due before that, those for which it is woken, and all of them while no reader is
back in time: no bus, one that opens, a reader that has ended, an adapter that sleeps too long.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from itertools import chain, zip_longest
import math
import threading
from typing import Any, Generic, TypeVar

from drive_can_bridge.clock import Clock
from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.control import ControlRequest
from drive_can_bridge.core.errors import TransportError
from drive_can_bridge.core.frame import bits_of_exchange, bits_on_bus, Frame, Route
from drive_can_bridge.core.requests import Request
from drive_can_bridge.core.session import Session
from drive_can_bridge.exchange.member import BusListener, DriveListener, Member, STOP_MARGIN
from drive_can_bridge.transport.bus_identity import SERIAL_INTERFACES
from drive_can_bridge.transport.end_point import EndPoint
from drive_can_bridge.transport.link import Link

Owner = TypeVar('Owner')
#: s between two turns at least
SLOT = 0.0015
#: share of a period by which it may come before its time, where a thread is awake just then
EARLY = 0.1
#: the timer thread passes at least this often (s), so that a longer gap means lost time
PASS_PERIOD = 0.25
#: s without a pass after which known states are invalid: the process was stalled
LOST_TIME = 1.0
#: s by which a pass may be late until commands that wait are not believed any more
LATENESS_MAX = 0.25
#: s that users wait for the lock of a bus: at first, and of one that is known to hang
PATIENCE, LITTLE_PATIENCE = LOST_TIME, 0.05
#: s that a command waits at most until it is looked at, however seldom its drive is served
LOOK_PERIOD = 0.05
#: s by which the reader may be back too late before the timer thread does its work
GRACE = 0.02
#: s by which the reader is so late for a pass that it looks first at what has come meanwhile;
#: sooner, that would only make passes later
LATE = 0.003
#: frames that may have come in one packet and are read before something is sent
LOOK_AHEAD = 8
#: s until the values sent last are published again
REQUEST_PERIOD = 1.0


class Router(Generic[Owner]):
    """
    Routes with masks, grouped by mask.

    A bus has a handful of distinct masks at most, so that a frame costs one masked look-up per
    mask however many drives there are.
    """

    def __init__(self) -> None:
        self._tables: list[tuple[bool, int, dict[int, Owner]]] = []
        self._hearers: dict[tuple[int, bool], list[Owner]] = {}

    def add(self, routes: Iterable[Route], owner: Owner, overheard: Iterable[Route] = ()) -> None:
        """
        Route the frames of these routes to ``owner``.

        :param overheard: routes that several owners may share; of one identifier each.
        """
        for route in routes:
            self._table(route.extended, route.mask)[route.identifier & route.mask] = owner
        for route in overheard:
            self._hearers.setdefault((route.identifier, route.extended), []).append(owner)

    def hearers(self, frame: Frame) -> Sequence[Owner]:
        """Return the owners that overhear a frame without an owner; there may be none."""
        return self._hearers.get((frame[0], frame[2]), ())

    def find(self, frame: Frame) -> Owner | None:
        """Return the owner of a frame, or None."""
        identifier, _, frame_extended = frame
        for extended, mask, table in self._tables:
            if extended == frame_extended:
                owner = table.get(identifier & mask)
                if owner is not None:
                    return owner
        return None

    def _table(self, extended: bool, mask: int) -> dict[int, Owner]:
        for known_extended, known_mask, table in self._tables:
            if (known_extended, known_mask) == (extended, mask):
                return table
        table = {}
        self._tables.append((extended, mask, table))
        return table


def exchanges_in_slot(bus: BusConfiguration, *, extended: bool) -> int:
    """Return how many exchanges the wire carries in a ``SLOT``, one at least."""
    if bus.interface in SERIAL_INTERFACES:  # whose own line is the slower one
        return 1
    return max(1, int(SLOT * bus.bitrate / bits_of_exchange(extended=extended)))


def stagger(periods: Sequence[float], sharing: int = 1) -> list[float]:
    """
    Return when in its period each drive has its turn, in s.

    Drives that are all served at the same instant wait for each other: on the wire, where the
    last of fifteen at 1 Mbit/s gets its request after two and its answer after four of five
    milliseconds, and again in this process, where each answer is published before the next one is
    looked at. So drives of the same period are spread over it; but no finer than ``SLOT``, and no
    finer than the wire needs, because every turn costs a wake-up (bench/README.md has what other
    slots cost).

    Drives of a period are placed in the order given; as many of them as need be share a slot.

    :param sharing: so many drives may share a turn though there is time for another one.
    """
    groups: dict[float, list[int]] = {}
    for index, period in enumerate(periods):
        groups.setdefault(period, []).append(index)
    turns = [0.0] * len(periods)
    for period, members in groups.items():
        slots = max(1, min(math.ceil(len(members) / sharing), int(period / SLOT + 1e-6)))
        for place, index in enumerate(members):
            turns[index] = place * slots // len(members) * period / slots
    return turns


class PeriodicTask:
    """
    Calls ``action`` with the time, once a period. No thread waits for a call in another one.

    A thread of its own costs a wake-up each time, asks for the interpreter beside threads that
    need it, and finds its caches cold: together more than what it does. The timer threads of busy
    buses are awake all the time, and those of idle ones have the time to wake up for it.

    :param action: must not raise; it is called without the lock of any exchange.
    """

    def __init__(self, action: Callable[[float], None]) -> None:
        self._action = action
        self._period = math.inf
        self._due = math.inf
        self._from = math.inf   # it may come a little before its time
        self._taken = threading.Lock()

    def begin(self, period: float, now: float) -> None:
        """Start to call every ``period`` s, for the first time after one."""
        with self._taken:
            self._period = period
            self._plan(now + period)

    def end(self) -> None:
        """Stop calling, and wait for a call that is under way."""
        with self._taken:
            self._due = self._from = math.inf

    def run(self, now: float) -> float:
        """Call if it is due; return when to run next."""
        if now < self._from:
            return self._due
        if not self._taken.acquire(blocking=False):     # another exchange is at it
            return now + self._period
        try:
            if now >= self._from:
                due = self._due + self._period
                self._plan(due if due > now else now + self._period)    # never twice to catch up
                self._action(now)
            return self._due
        finally:
            self._taken.release()

    def _plan(self, due: float) -> None:
        self._due = due
        self._from = due - EARLY * self._period


class BusExchange:
    """
    All drives of one bus.

    :param routes: for each session, in the same order, the identifiers it wants to see.
    :param counted: further identifiers, on which no other node should send.
    :param overheard: for each session those on which another master commands several drives at
        once.
    :param open_bus: opens the bus; None: python-can, by the configuration.
    :param prepare_thread: called first in each of the two threads.
    :param note: called with every frame that was sent or received: (frame, time, sent).
    :ivar periodic_task: what its threads run beside its drives; to be set before ``open``.
    :ivar hung: a thread has kept the lock for too long: the adapter does not return from a send.
    """

    def __init__(self, bus: BusConfiguration, sessions: Sequence[Session],
                 routes: Sequence[Sequence[Route]], listener: BusListener, clock: Clock, *,
                 counted: Sequence[Route] = (), overheard: Sequence[Sequence[Route]] = (),
                 open_bus: Callable[[BusConfiguration], EndPoint] | None = None,
                 prepare_thread: Callable[[], object] = lambda: None,
                 note: Callable[[Frame, float, bool], object] | None = None) -> None:
        self.bus = bus
        self._note = note
        self.lock = threading.Lock()
        self._clock, self._sleep = clock.now, clock.wait
        self._prepare_thread = prepare_thread
        self._listener = listener
        self._members: list[Member] = []
        self._sessions = list(sessions)
        self._router: Router[Member] = Router()
        self._routes = list(zip_longest(routes, overheard, fillvalue=()))
        periods = [session.configuration.period for session in sessions]
        # a send may hold up every drive of the bus: never for more than half a cycle
        send_timeout = min(0.05, 0.5 * min(periods, default=0.1))
        filters = list(dict.fromkeys(chain(*routes, counted, *overheard)))
        self.link = Link(bus, filters, self, clock, send_timeout=send_timeout,
                         stations=len(self._sessions), prepare_thread=prepare_thread,
                         opener=open_bus and (lambda: open_bus(bus)), keep_time=self._keep_time)
        sharing = exchanges_in_slot(bus, extended=any(route.extended for route in filters))
        for session, phase in zip(sessions, stagger(periods, sharing)):
            session.phase = phase
        self.periodic_task: PeriodicTask | None = None
        self._wake = clock.wake_event()
        self._wake_at = 0.0     # when the next pass is due
        self._back_at = -math.inf   # when the reader will look after that
        self._asleep_until = -math.inf  # when the timer thread will
        self._meant_at = 0.0    # when the next pass was to be
        self._last_pass = 0.0
        self._tell_at = 0.0
        self._closing = False
        self._timer_thread = clock.worker(self._run, f'exchange {bus.name}')
        self.active = self.hung = False
        self.bus_state = 'opening'
        self.bus_reason = ''
        self.frames_rejected = 0
        self.received_bits = 0
        self.sent_bits = 0

    # -- life cycle -------------------------------------------------------------------------------

    def attach(self, session: Session, listener: DriveListener) -> None:
        """Attach the listener of a session. Once for each, before ``open``."""
        member = Member(session, listener, self._transmit, self._clock)
        for other in self._members:
            if other.session in session.partners:
                other.partners.append(member)
                member.partners.append(other)
        self._members.append(member)
        own, overheard = self._routes[self._sessions.index(session)]
        self._router.add(own, member, overheard)

    def open(self) -> None:
        """Start both threads; the bus opens in the background. Nothing is sent."""
        self._last_pass = self._meant_at = self._clock()
        self.link.start()
        self._timer_thread.start()

    def activate(self) -> None:
        """Start the exchange with every drive."""
        with self.lock:
            now = self._clock()
            self._last_pass = self._meant_at = now
            self.active = True
            for member in self._members:
                member.tell(member.listener.discard_commands, '')
                member.begin(member.session.activate, now)
        self._wake.ring()

    def serve(self) -> None:
        """Serve parameter requests only: nothing is sent unasked."""
        with self.lock:
            for member in self._members:
                member.session.serve()

    def deactivate(self) -> bool:
        """
        Stop every drive safely and wait for it; another thread may have started it.

        :return: False when it could not be completed in time (a bus that blocks).
        """
        self.begin_stop()
        return self._wait_for_stop()

    def begin_stop(self) -> None:
        """Start to stop every drive safely; the exchange's threads continue it."""
        with self.lock:
            if self.active:
                self._begin_stop(self._clock())
        self._wake.ring()

    def _begin_stop(self, now: float) -> None:
        lost = now - self._last_pass >= LOST_TIME   # not noticed yet
        self.active = False
        for member in self._members:
            member.anew_at = math.inf
            if lost:
                member.take(member.session.handle_stall, now)
            member.take(member.session.deactivate, now)

    def _wait_for_stop(self) -> bool:
        end = self._clock() + STOP_MARGIN + max(
            (session.longest_stop for session in self._sessions), default=0.0)
        while not self.stopped:
            now = self._clock()
            if now > end:
                self._give_up()
                return False
            if not self._timer_thread.is_alive():  # the neutral frames go out all the same
                self._pass_to_stop()
                now = self._clock()
            self._sleep(now + 0.002)
            asleep = self._clock() - now
            if asleep > LATENESS_MAX:   # a stalled process: not the bus blocks
                end += asleep
        return True

    def _give_up(self) -> None:
        """End stops that take too long: the state of the drives is unknown."""
        with self.lock:
            for member in self._members:
                session = member.session
                if not session.stopped:
                    member.take(session.give_up, self._clock())
                    if session.defect:
                        self.bus_reason = f'{session.configuration.name}: {session.defect}'

    def _pass_to_stop(self) -> None:
        """Serve the stops, without the timer thread and without commands."""
        with self.lock:
            for member in self._members:
                if member.due <= self._clock():
                    member.take(member.session.handle_timer, self._clock())

    def close(self) -> None:
        """End both threads, and close the bus."""
        self._closing = True
        self._wake.ring()
        self._timer_thread.join(2.0)
        self.link.stop()

    @property
    def stopped(self) -> bool:
        """Whether no drive is exchanged with, or being stopped."""
        with self.lock:
            return all(session.stopped for session in self._sessions)

    # -- users, any thread ------------------------------------------------------------------------

    def stands_still(self, now: float) -> bool:
        """Return whether there was no pass for so long that the drives' states are unknown."""
        return now - self._last_pass >= LOST_TIME

    @contextmanager
    def entered(self) -> Iterator[bool]:
        """Acquire the lock for a thread that serves other buses, too; yield False: it hangs."""
        patience = 0.5 * (LITTLE_PATIENCE if self.hung else PATIENCE)
        # twice: the process may have been stalled meanwhile
        entered = any(self.lock.acquire(timeout=patience) for _ in range(2))
        self.hung = not entered
        try:
            yield entered
        finally:
            if entered:
                self.lock.release()

    def submit(self, session: Session, request: Request | ControlRequest) -> None:
        """
        Submit a request to a drive's session; the answer comes as an event.

        :raises TransportError: the bus hangs.
        """
        member = self._member(session)
        with self.entered() as entered:
            if not entered:
                raise TransportError(sentences.bus_hangs(self.bus.name))
            now = self._clock()
            self._notice_lost_time(now)     # else an enable would go by what was before
            try:
                session.services.submit(request, now)
                member.pump()
            except Exception as error:
                member.contain(error)
                raise
        self._ring_if_sooner(member)

    def reconfigure(self, session: Session, **changes: Any) -> None:
        """Change what may change while running (see :meth:`.Session.reconfigure`)."""
        member = self._member(session)
        with self.lock:
            session.reconfigure(**changes)
            member.due = session.next_timer()

    def contain(self, session: Session, error: Exception) -> None:
        """
        Stop a drive after an internal error in one of its parts.

        To be called in the course of a call of a listener: with the bus lock held.
        """
        self._member(session).unheard(error)

    def _member(self, session: Session) -> Member:
        return next(member for member in self._members if member.session is session)

    def _ring_if_sooner(self, member: Member) -> None:
        """Wake the timer thread if a drive, or a partner, is due before it wakes by itself."""
        if member.soonest < self._wake_at:
            self._wake.ring()

    # -- the timer thread -------------------------------------------------------------------------

    def _run(self) -> None:
        rung = True
        try:
            self._prepare_thread()
            while not self._closing:
                if rung or self._clock() >= self._turn():
                    self._serve()
                with self.lock:
                    self._asleep_until = self._turn()
                rung = self._wake.wait(self._asleep_until)
        except Exception as error:  # noqa: BLE001  outermost loop: no failure is silent
            self._fail(f'{type(error).__name__}: {error}')

    def _turn(self) -> float:
        """Return when the timer thread makes the next pass."""
        due, back_at = self._wake_at, self._back_at
        return due if due < back_at else max(due, back_at + GRACE)

    def _keep_time(self, longest: float) -> float:
        """Serve what is due, in the reader thread; return how many s it may wait for a frame."""
        late = self._clock() - self._wake_at
        if late >= 0.0:
            if late > LATE:
                self._catch_up()
            self._serve()
        with self.lock:
            now = self._clock()
            self._back_at = min(self._wake_at, now + longest)
            oversleeping = self._turn() < self._asleep_until
        if oversleeping:    # it fell asleep when less was to be done
            self._wake.ring()
        return max(0.0, self._back_at - now)

    def _catch_up(self) -> None:
        """
        Handle what waits, a frame of each drive at most: no answer that has come is missed.

        Where others have the interpreter, each frame may take as long as a turn of the drives.
        """
        for _ in self._members:
            waiting = self.link.look()
            if waiting is None:
                break
            self.frame_received(*waiting)

    def _serve(self) -> None:
        """Make a pass, and run the periodic task."""
        with self.lock:
            self._wake_at = self._pass()
        if self.periodic_task is not None:
            due = self.periodic_task.run(self._clock())
            with self.lock:
                self._wake_at = min(self._wake_at, due)

    def _pass(self) -> float:
        """Serve every session that is due; return when the next one is."""
        now = self._last_pass = self._look_at_clock()
        self.hung = False
        self._meant_at = min(self._meant_at, now)
        if now >= self._tell_at:
            self._tell_again(now)
        soonest = min(now + PASS_PERIOD, self._tell_at)
        for member in self._members:
            if member.due <= now or member.look_at <= now and self.active:
                now = self._look_at_clock()  # the drives before took their time
                member.look_at = now + LOOK_PERIOD
                member.take_commands(now)
                now = self._look_at_clock()  # and so did these
                member.take(member.session.handle_timer, now)
            if member.anew_at <= now:
                member.recover(now)
        for member in self._members:  # a partner's timer may have changed after its turn
            due = member.look_at if member.look_at < member.due and self.active else member.due
            if due < soonest:
                soonest = due
        self._meant_at = max(soonest, now)
        return soonest

    def _look_at_clock(self) -> float:
        """
        Return the time, after handling a stall, or discarding commands after a delay.

        Not only when a pass begins: a process may be stopped in the midst of one.
        """
        now = self._clock()
        late = now - self._meant_at
        if late > LATENESS_MAX and not self._notice_lost_time(now):
            self._meant_at = now
            for member in self._members if self.active else ():
                member.tell(member.listener.discard_commands,
                            sentences.exchange_late(seconds=late))
        return now

    def _tell_again(self, now: float) -> None:
        self._tell_at = now + REQUEST_PERIOD
        if self.active:
            for member in self._members:
                member.tell(member.listener.request_sent, now)

    def _notice_lost_time(self, now: float) -> bool:
        """Handle a stall of a second or more: arm again; return False: there was none."""
        gap = now - self._last_pass
        if gap < LOST_TIME or not self.active:
            return False
        self._last_pass = self._meant_at = now
        for member in self._members:
            member.tell(member.listener.discard_commands,
                        sentences.stood_still_for(seconds=gap))
            member.take(member.session.handle_stall, now)
        return True

    # -- the reader thread (LinkListener) ---------------------------------------------------------

    def frame_received(self, frame: Frame, age: float) -> None:
        """Handle a frame from the link. The fast path of the reader."""
        arrived = self._clock() - age
        with self.lock:
            now = self._clock()
            if now - self._last_pass >= LOST_TIME:
                self._notice_lost_time(now)
            member = self._find(frame, arrived, now)
            if member is None:
                return
            if member.session.looks_ahead:
                member.take(self._take_with_others, member, frame, now, now - arrived)
            else:
                member.take(member.session.receive_frame, frame, now, now - arrived)
            due = member.soonest
            if due >= self._wake_at:
                return
            if now < self._back_at + GRACE:     # this thread keeps time, and looks next
                self._wake_at = due
                return
        self._wake.ring()

    def _find(self, frame: Frame, arrived: float, now: float) -> Member | None:
        """Count a frame, and return its owner; without one it is overheard."""
        self.received_bits += bits_on_bus(len(frame[1]), frame[2])
        if self._note is not None:
            self._note(frame, arrived, False)
        member = self._router.find(frame)
        if member is None:
            for hearer in (hearers := self._router.hearers(frame)):
                hearer.take(hearer.session.receive_frame, frame, now, now - arrived)
            self.frames_rejected += not hearers
        return member

    def _take_with_others(self, member: Member, frame: Frame, now: float, age: float) -> None:
        """Handle a frame, and those of its packet before anything is sent in answer."""
        session = member.session
        session.receive_frame(frame, now, age)
        for _ in range(LOOK_AHEAD):
            if not session.outbox.frames:
                return
            more = self.link.look()
            if more is None:
                return
            following, age = more
            now = self._clock()
            owner = self._find(following, now - age, now)
            if owner is member:
                session.receive_frame(following, now, age)
            elif owner is not None:
                owner.take(owner.session.receive_frame, following, now, age)

    def bus_opened(self) -> None:
        """Start (again) with every drive."""
        with self.lock:
            now = self._clock()
            self.bus_state, self.bus_reason = 'up', ''
            for member in self._members:
                member.take(member.session.bus_up, now)
        self._wake.ring()
        self._listener.bus_opened(self.bus.name)

    def bus_lost(self, reason: str) -> None:
        """Report to every drive that its bus is gone."""
        with self.lock:
            now = self._clock()
            self.bus_state, self.bus_reason = 'down', reason
            for member in self._members:
                member.take(member.session.bus_down, now, reason)
        self._listener.bus_lost(self.bus.name, reason)

    def bus_told(self, text: str) -> None:
        """Report what people should know of the adapter."""
        self._listener.bus_told(self.bus.name, text)

    def bus_misconfigured(self, reason: str) -> None:
        """Give up: the configuration of the bus is wrong."""
        self.bus_state, self.bus_reason = 'misconfigured', reason
        self._listener.fatal(self.bus.name, reason, misconfigured=True)

    def link_failed(self, reason: str) -> None:
        """Give up: the reader thread ended by an internal error."""
        self._back_at = -math.inf
        self._wake.ring()
        self._fail(reason)

    def _fail(self, reason: str) -> None:
        self.bus_state, self.bus_reason = 'failed', reason
        self._listener.fatal(self.bus.name, f'internal error: {reason}', misconfigured=False)

    # -- from session to the outside --------------------------------------------------------------

    def _transmit(self, frame: Frame, now: float) -> bool:
        """Send a frame of a session; return False: the bus refused it."""
        if not self.link.send(frame):
            return False
        self.sent_bits += bits_on_bus(len(frame[1]), frame[2])
        if self._note is not None:
            self._note(frame, now, True)
        return True


def stop_all(exchanges: Iterable[BusExchange], clock: Clock) -> dict[str, str]:
    """
    Stop the drives of every active exchange, also of one that is stopping, and wait for it.

    :return: why the stop frames could not all be sent, by name of the bus.
    """
    failures: dict[str, str] = {}

    def stop(exchange: BusExchange) -> None:
        try:
            if exchange.deactivate():
                return
            reason = exchange.bus_reason or sentences.bus_blocks()
        except Exception as error:  # noqa: BLE001  outermost call of a thread: nothing is silent
            reason = f'{type(error).__name__}: {error}'
        failures[exchange.bus.name] = reason

    threads = []
    left = []
    for exchange in exchanges:
        if exchange.active or not exchange.stopped:
            thread = clock.worker(partial(stop, exchange), f'stop {exchange.bus.name}')
            try:
                thread.start()
                threads.append(thread)
            except RuntimeError:    # the system has no more threads for us
                left.append(exchange)
    for exchange in left:   # no drive runs on while another one's stop is waited for
        with suppress(Exception):   # reported when it is waited for
            exchange.begin_stop()
    for exchange in left:
        stop(exchange)
    for thread in threads:
        thread.join()
    return failures
