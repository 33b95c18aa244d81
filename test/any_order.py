# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A session under anything that may happen, in any order: what is the same for every family.

A family adds its drive (what it does with a frame, and says) and an observer, who sees nothing but
frames and knows the protocol's bytes and the contract, nothing of the session's inside.

Where the bus may refuse frames (``AnyOrder.bus_may_refuse``), the observer keeps books of those
that left by :meth:`Observer.tells`; whenever an exchange has ended, whatever was told to run must
have been told to stop, or a warning has said that it may still be running.
"""

from collections import deque
from collections.abc import Callable, Sequence
import math
from typing import Any, ClassVar

from hypothesis import settings, strategies as st
from hypothesis.stateful import invariant, precondition, rule, RuleBasedStateMachine

from drive_can_bridge.core import sentences
from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.core.events import Noted, RequestCompleted
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.requests import Failure, FailureKind, ReadRequest, WriteRequest
from drive_can_bridge.core.setpoints import CommandOutcome

#: more than rounding errors, less than anything that matters
SLACK = 1e-7
#: for the state machine of every family
SETTINGS = settings(stateful_step_count=50)
#: s for all its examples
PATIENCE = 600


class Observer:
    """
    Keeps books of what a session was told and may send.

    :param timeout: command_timeout in s.
    :param immediate: whether any command arms.
    :param control: whether commands count only while the drive is enabled.
    """

    def __init__(self, *, timeout: float = 0.0, immediate: bool = False,
                 control: bool = False) -> None:
        self.timeout = timeout
        self.immediate = immediate
        self.control = control
        #: ``enable`` is the last word that left, and the drive may have said that it is enabled
        self.enabled = False
        #: the drive has said that it has a fault
        self.faulted = False
        self.active = self.bus = self.online = False
        self.asked: Any = None      # what the session waits for an answer to
        self.raws = [0, 0]
        self.since = [-math.inf, -math.inf]
        self.armed = [False, False]
        #: the drive was told to be neutral, and has not answered that yet
        self.held: Callable[[], bool] = lambda: False
        #: what the drive was told to run by, by frames that left, and not told to stop since
        self.running: set[object] = set()
        #: a warning has said since that it may still be running
        self.warned = False

    def tells(self, what: object, *, runs: bool) -> None:
        """
        Record what a frame that has left tells the drive.

        :param what: which of the things that travel separately.
        :param runs: anything but neutral and ``disable``.
        """
        if runs:
            self.running.add(what)
            self.warned = False
        else:
            self.running.discard(what)

    def refused(self, sent: Frame, now: float) -> None:
        """Record a frame that the bus did not take."""

    def sees(self, sent: Frame, now: float) -> None:
        """Check a frame that the session sends."""
        raise NotImplementedError

    def disarm(self) -> None:
        """Record that no command counts any more, nor the drive's being there."""
        self.online = False
        self.disable()

    def disable(self) -> None:
        """Record that no command counts, although the drive may be there."""
        self.armed = [False, False]
        self.raws = [0, 0]

    def doubt(self) -> None:
        """Start over: whatever was known counts no more."""
        self.disarm()

    def bus_went_up(self) -> None:
        if self.active:
            self.doubt()

    def bus_went_down(self) -> None:
        self.doubt()
        self.asked = None

    def activated(self) -> None:
        self.doubt()

    def deactivated(self, session: Any) -> None:
        """Record that the session is about to be told to stop."""
        raise NotImplementedError

    def time_was_lost(self, session: Any) -> None:
        """Record that the session is about to be told that time was lost."""

    def commanded(self, index: int, raw: int, outcome: CommandOutcome, now: float, *,
                  neutral: bool | None = None) -> None:
        """
        Check what became of a command.

        :param neutral: whether it arms; None: 0 and one raw step do.
        """
        if not self.online or not self.active:
            assert outcome is CommandOutcome.NOT_ARMED or (
                outcome is CommandOutcome.DISABLED and not self.active)
            return
        if self.held():
            assert outcome is CommandOutcome.NOT_ARMED
            return
        if self.control:
            if outcome is CommandOutcome.DISABLED or (
                    outcome is CommandOutcome.NOT_ARMED and self.faulted):
                self.disable()
                return
            assert self.enabled, 'commands count while it is enabled by our word, and only then'
        neutral = abs(raw) <= 1 if neutral is None else neutral
        if not self.armed[index] and not self.immediate and not neutral:
            assert outcome is CommandOutcome.NOT_ARMED
            return
        assert outcome is (CommandOutcome.ACCEPTED if self.armed[index] else CommandOutcome.ARMED)
        self.armed[index], self.raws[index], self.since[index] = True, raw, now

    def expected(self, now: float) -> list[int]:
        """Return the setpoints that a cycle has to carry now."""
        for index in range(2):
            if self.armed[index] and 0 < self.timeout < now - self.since[index]:
                self.armed[index], self.raws[index] = False, 0
        return [raw & 0xFFFF for raw in self.raws]


class AnyOrder(RuleBasedStateMachine):
    """Everything that may happen to a session of any family."""

    #: what users read and write
    readable: ClassVar[Sequence[Parameter]]
    writable: ClassVar[Sequence[Parameter]]
    #: s after which a session that was told to stop has stopped
    stop_takes: ClassVar[float] = 1.0
    #: the bus refuses a frame now and then
    bus_may_refuse: ClassVar[bool] = False

    session: Any = None
    observer: Any

    def start(self, session: Any, observer: Observer) -> None:
        """Begin with a session that was told nothing yet."""
        self.session = session
        self.observer = observer
        observer.held = lambda: session.neutral_stop.pending
        self.now = 1000.0
        self.open: list[ReadRequest | WriteRequest] = []
        self.control_requests: list[object] = []
        self.unanswered: list[Frame] = []
        self.fates: deque[bool] = deque()   # of the next frames: whether the bus takes them
        self.refusals = 0

    # -- what a family says -----------------------------------------------------------------------

    def happened(self, event: Any) -> None:
        """Record an event that is not the end of a request."""
        raise NotImplementedError

    def completed(self, event: RequestCompleted) -> None:
        """Check the outcomes of a request."""

    def apply(self, sent: Frame) -> None:
        """Do what a drive does with a frame; its answers wait in ``unanswered``."""
        raise NotImplementedError

    def drive_answers(self, choice: int) -> None:
        """Hand over one of the answers that wait."""
        raise NotImplementedError

    # -- looking ----------------------------------------------------------------------------------

    def look(self, *, silent: bool = False) -> None:
        """Fetch and check everything that the session gives out."""
        any_sent = False
        while True:
            self.look_at_events()
            sent = self.session.take_frames()
            if not sent:
                break
            assert not silent
            refused = [place for place in range(len(sent))
                       if self.fates and not self.fates.popleft()]
            for place, entry in enumerate(sent):
                if place in refused:
                    self.observer.refused(entry, self.now)
                else:
                    any_sent = True
                    self.observer.sees(entry, self.now)
                    self.apply(entry)
            self.refusals += len(refused)
            self.session.frames_left(self.now, refused)
        self.looked(any_sent)

    def look_at_events(self) -> None:
        for event in self.session.take_events():
            if isinstance(event, RequestCompleted):
                assert event.request in self.open, 'one answer per request'
                self.open.remove(event.request)
                assert len(event.outcomes) == len(event.request)
                self.completed(event)
            elif isinstance(event, ControlCompleted):
                assert event.request in self.control_requests, 'one answer per control request'
                self.control_requests.remove(event.request)
                self.answered(event)
            else:
                if isinstance(event, Noted) and event.warning and (
                        'may still be running' in event.text):
                    self.observer.warned = True
                self.happened(event)

    def answered(self, outcome: ControlCompleted) -> None:
        """Record the end of a control request."""

    def looked(self, sent: bool) -> None:
        """Check what is to be checked after each look; ``sent``: whether there were frames."""

    # -- the passage of time ----------------------------------------------------------------------

    def timer(self) -> None:
        self.session.handle_timer(self.now)
        self.look()

    @rule(steps=st.integers(1, 30))
    def time_passes_well(self, steps: int) -> None:
        self.time_passes_in_time(steps, True)

    @rule(steps=st.integers(1, 12), answering=st.booleans())
    def time_passes_in_time(self, steps: int, answering: bool) -> None:
        for _ in range(steps):
            due = self.session.next_timer()
            if due > self.now + 2.0:
                self.now += 0.01
                return
            self.now = max(self.now, due)
            self.timer()
            while answering and self.unanswered:
                self.now += 0.0002
                self.drive_answers(0)

    @rule(pause=st.sampled_from([0.0, 0.0001, 0.003, 0.017, 0.06, 0.101, 0.4, 0.99]))
    def time_passes_late(self, pause: float) -> None:
        self.now += pause
        self.timer()

    def time_is_lost(self) -> None:
        self.now += 1.0
        self.observer.time_was_lost(self.session)
        self.session.handle_stall(self.now)
        self.look()

    # -- users ------------------------------------------------------------------------------------

    @rule(choices=st.lists(st.integers(0, 99), max_size=5), times=st.integers(1, 80))
    def users_read(self, choices: list[int], times: int) -> None:
        for _ in range(times):
            self.submit(ReadRequest(tuple(
                self.readable[choice % len(self.readable)] for choice in choices)))

    @rule(choices=st.lists(st.tuples(st.integers(0, 99), st.integers(0, 1)), max_size=3),
          atomic=st.booleans())
    def users_write(self, choices: list[tuple[int, int]], atomic: bool) -> None:
        self.submit(WriteRequest(tuple(
            (self.writable[choice % len(self.writable)], self.raw_to_write(raw))
            for choice, raw in choices), atomic))

    def raw_to_write(self, raw: int) -> int:
        """Return what is written instead of 0 or 1."""
        return raw

    def submit(self, request: ReadRequest | WriteRequest) -> None:
        waiting = len(self.open)
        self.open.append(request)
        self.session.services.submit(request, self.now)
        refused = any(
            isinstance(event, RequestCompleted) and event.request is request
            and Failure(FailureKind.UNAVAILABLE, sentences.busy()) in event.outcomes
            for event in self.session.report.events)
        possible = self.observer.active and self.observer.bus and len(request) > 0
        if refused or possible and waiting == 65:   # 64 wait; one more may be under way
            assert refused and possible and waiting in (64, 65)
        self.look()
        # a request may have been what noticed a time-out
        assert len(self.open) <= 65

    @rule(action=st.sampled_from(ControlAction))
    def control(self, action: ControlAction) -> None:
        refusal = self.session.services.control_refusal(action)
        request = ControlRequest(action)
        self.control_requests.append(request)
        self.session.services.submit(request, self.now)
        if not refusal:
            assert self.observer.active
            if self.session.control is None:
                self.observer.disable()
            else:
                self.wanted(action)
        self.look()

    def wanted(self, action: ControlAction) -> None:
        """Record something that the session agreed to try."""

    # -- a bus that refuses -----------------------------------------------------------------------

    @precondition(lambda self: self.bus_may_refuse)
    @rule(fates=st.lists(st.booleans(), min_size=1, max_size=6))
    def bus_refuses_some(self, fates: list[bool]) -> None:
        self.fates.extend(fates)

    @precondition(lambda self: self.bus_may_refuse)
    @rule(count=st.integers(1, 40))
    def bus_refuses_all(self, count: int) -> None:
        self.fates.extend([False] * count)

    @precondition(lambda self: self.fates)
    @rule()
    def bus_takes_all(self) -> None:
        self.fates.clear()

    # -- the life of a session --------------------------------------------------------------------

    @rule(kind=st.integers(0, 5))
    def upset(self, kind: int) -> None:
        (self.bus_goes_up, self.bus_goes_down, self.activate, self.deactivate,
         self.deactivate_to_the_end, self.time_is_lost)[kind]()

    @precondition(lambda self: self.bus_may_refuse)
    @rule(kind=st.sampled_from([4, 1, 3, 0, 2, 5, 4]), steps=st.integers(0, 4),
          answering=st.booleans(), refused=st.sampled_from([0, 400, 1, 3, 10, 400]))
    def ends_while_it_runs(self, kind: int, steps: int, answering: bool, refused: int) -> None:
        """Chance alone would hardly ever end the exchange with a drive that runs."""
        self.fates.clear()
        if not self.session.online or not self.observer.active:
            self.all_is_well()
        self.have_it_run()
        self.fates.extend([False] * refused)
        self.time_passes_in_time(steps, answering)
        self.upset(kind)

    def have_it_run(self) -> None:
        """Enable the drive and command it, as users do."""
        raise NotImplementedError

    @precondition(lambda self: not self.session.online)
    @rule()
    def all_is_well(self) -> None:
        """Bring the drive online."""
        if not self.observer.bus:
            self.bus_goes_up()
        if not self.observer.active:
            self.activate()
        self.drive_is_well()

    def drive_is_well(self) -> None:
        for _ in range(3):
            self.time_passes_in_time(8, True)

    def bus_goes_up(self) -> None:
        self.observer.bus = True
        self.observer.bus_went_up()
        self.session.bus_up(self.now)
        self.look()

    def bus_goes_down(self) -> None:
        if self.observer.active:
            self.observer.warned = False
        self.session.bus_down(self.now, 'unplugged')
        self.observer.bus_went_down()
        self.observer.bus = False
        self.look(silent=True)
        assert not self.open
        assert not self.control_requests
        assert self.session.stopped
        assert self.session.next_timer() == math.inf

    def activate(self) -> None:
        self.observer.active = True
        self.observer.running.clear()   # what this activation has told is what counts
        self.observer.activated()
        self.session.activate(self.now)
        self.look()

    def deactivate(self) -> None:
        if self.observer.active:
            self.observer.warned = False
        self.observer.active = False
        self.observer.deactivated(self.session)
        self.session.deactivate(self.now)
        self.look()
        assert not self.open

    def deactivate_to_the_end(self) -> None:
        refusals = self.refusals
        self.deactivate()
        end = self.now + self.stop_takes
        while self.session.next_timer() <= end:
            self.now = max(self.now, self.session.next_timer())
            self.timer()
        if not self.session.stopped:
            assert self.refusals > refusals, 'an unblocked bus is enough to stop'
            self.session.give_up(self.now)
            self.look(silent=True)
        assert self.session.stopped
        assert self.session.next_timer() == math.inf
        assert not self.control_requests
        assert not self.session.online

    # -- always -----------------------------------------------------------------------------------

    @invariant()
    def counts_are_right(self) -> None:
        if self.session is None:
            return
        assert self.session.services.waiting <= 64
        assert self.session.online == self.observer.online or not self.observer.active
        if not self.observer.bus:
            assert not self.session.online
            assert self.session.stopped
        assert not self.session.take_frames()
        if not self.session.online:
            assert not any(item.armed for item in self.session.setpoints.items)

    @invariant()
    def whatever_was_told_to_run_is_told_to_stop(self) -> None:
        if self.session is not None and self.session.stopped:
            assert not self.observer.running or self.observer.warned, 'an exchange has ended'
