# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A drive on its bus: its session, its listener, and the effect of an internal error in either.

Whatever one of the two raises, the bus and its other drives go on. The drive itself is not
commanded further: it is stopped as at the end of the bridge, is offline for a moment, and is
looked for again as after a loss. Drives that share frames with it are stopped with it.
"""

from collections.abc import Callable
from functools import partial
import math
from typing import Protocol

from drive_can_bridge.compiled import mypyc_attr
from drive_can_bridge.core.events import DriveFailed, Event, ProcessDataReceived
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.sentences import internal_error, partner_failed
from drive_can_bridge.core.session import Session

#: s that a stop may take beyond its neutral cycles
STOP_MARGIN = 0.5
#: s that a drive is left alone after a defect: long enough to be seen
PAUSE = 1.0
#: s until a step is repeated that has failed during a stop
RETRY_AFTER = 0.01


@mypyc_attr(allow_interpreted_subclasses=True)
class DriveListener:
    """
    The callbacks of an exchange for the owner of a drive; all do nothing by default.

    Every call comes with the bus lock held, from the reader or timer thread or from the thread
    that called the exchange: it has to be short and must not call back into the exchange.
    """

    def take_commands(self, now: float) -> None:
        """Pass the newest setpoint commands to the session: a cycle may be due."""

    def discard_commands(self, why: str) -> None:
        """
        Discard commands that are waiting: they are too old.

        :param why: in words; '' where it need not be logged.
        """

    def process_data(self, event: ProcessDataReceived) -> None:
        """Publish a sample. The fast path."""

    def request_sent(self, now: float) -> None:
        """Publish the values sent to the drive last: they changed, or a second has passed."""

    def handle_event(self, event: Event) -> None:
        """Publish or log anything else."""


class BusListener(Protocol):
    """The callbacks of an exchange for its bus; from the reader or timer thread, lock not held."""

    def bus_opened(self, bus: str) -> None:
        """Handle a bus that is there (again)."""

    def bus_lost(self, bus: str, reason: str) -> None:
        """Handle a bus that is gone, or could not be opened."""

    def bus_told(self, bus: str, text: str) -> None:
        """Log what people should know of the adapter."""

    def fatal(self, bus: str, reason: str, *, misconfigured: bool) -> None:
        """End the bridge: the exchange cannot go on."""


class Member:
    """
    A drive on the bus.

    :param transmit: (frame, time): sends it; False: the bus refused it.
    :ivar partners: drives that share frames with this one: what happens to it may concern them.
    :ivar due: when the session wants to be called; kept here, so that a pass over all drives costs
        a comparison each.
    :ivar look_at: when its commands are to be looked at.
    :ivar anew_at: when to look for it again after an internal error; infinity: there was none.
    :ivar told: the sent values that the listener knows.
    """

    __slots__ = ('_clock', '_defect_told', '_give_up_at', '_transmit', 'anew_at', 'due',
                 'listener', 'look_at', 'partners', 'session', 'told')

    def __init__(self, session: Session, listener: DriveListener,
                 transmit: Callable[[Frame, float], bool], clock: Callable[[], float]) -> None:
        self.session = session
        self.listener = listener
        self.look_at = -math.inf
        self.partners: list[Member] = []
        self.due = session.next_timer()
        self.told = session.sent.raws
        self.anew_at = self._give_up_at = math.inf
        self._defect_told = ''
        self._transmit = transmit
        self._clock = clock

    @property
    def soonest(self) -> float:
        """When it, or a partner, wants to be called."""
        due = self.due
        for partner in self.partners:
            due = min(due, partner.due)
        return due

    # -- steps ------------------------------------------------------------------------------------

    def take(self, step: Callable[..., object], *arguments: object) -> None:
        """Call a session method, then send its frames and report its events."""
        before = self.session.defect
        try:
            step(*arguments)
            self.pump()
        except Exception as error:  # noqa: BLE001  one drive costs no other: it is reported
            self.contain(error)
            if before:      # not for ever in one go
                self.due = self._clock() + RETRY_AFTER

    def tell(self, call: Callable[..., object], *arguments: object) -> None:
        """Call the listener with what is no event of the session."""
        try:
            call(*arguments)
        except Exception as error:  # noqa: BLE001  likewise
            self.unheard(error)

    def take_commands(self, now: float) -> None:
        """
        Make the listener pass on the commands that wait.

        After an internal error, too: a limit is set all the same, and what waits for all joints of
        the bus is of other drives as well.
        """
        self.tell(self.listener.take_commands, now)

    def pump(self) -> None:
        """Send the session's frames, and report its events to the listener."""
        self._pump()
        for partner in self.partners:
            partner._pump()

    def _pump(self) -> None:
        outbox = self.session.outbox
        try:
            if outbox.frames:
                self._send()
        finally:
            self._report()
        if outbox.frames:   # the number of a reported fault is requested
            self._send()
        self.due = self.session.next_timer()

    def _send(self) -> None:
        session = self.session
        frames = session.take_frames()
        while frames:
            refused = []
            leaving = self._clock()     # no answer comes before that
            for place, frame in enumerate(frames):
                if not self._transmit(frame, leaving):
                    refused.append(place)
            session.frames_left(self._clock(), refused)
            frames = session.take_frames()

    def _report(self) -> None:
        """Report what was sent, and what happened, to the listener."""
        session, failure = self.session, None
        if session.sent.raws is not self.told:
            self.told = session.sent.raws
            self.tell(self.listener.request_sent, self._clock())
        for event in session.take_events():
            try:
                if type(event) is not ProcessDataReceived:
                    self.listener.handle_event(event)
                elif not session.defect:
                    self.listener.process_data(event)
            except Exception as error:  # noqa: BLE001  the other events are reported all the same
                failure = failure or error
        if failure is not None:
            self.unheard(failure)

    # -- defects ----------------------------------------------------------------------------------

    def contain(self, error: Exception) -> None:
        """
        Stop the drive, and those that share frames with it, after an internal error.

        :raises Exception: the error, where only parameter requests are served.
        """
        if self.session.serving:
            raise error
        text = _in_words(error)
        self._fail(text)
        for partner in self.partners:
            partner._fail(partner_failed(self.session.configuration.name, text))

    def unheard(self, error: Exception) -> None:
        """Handle an exception of the listener: a stop that is under way goes on."""
        if self.session.active:
            self.contain(error)
        else:
            self._tell_defect(_in_words(error))

    def _fail(self, text: Sentence) -> None:
        session, now = self.session, self._clock()
        if session.active:
            self.anew_at = now + PAUSE
        self._tell_defect(text)
        for step in (partial(session.fail, text, now), self._pump):
            try:
                step()
            except Exception:   # noqa: BLE001  more of what was reported
                self.due = now + RETRY_AFTER
        self._give_up_at = now + session.longest_stop + STOP_MARGIN

    def _tell_defect(self, text: Sentence) -> None:
        if text == self._defect_told:
            return
        self._defect_told = text
        try:
            self.listener.handle_event(DriveFailed(text))
        except Exception:   # noqa: BLE001  diagnostics have it
            pass

    def begin(self, step: Callable[[float], None], now: float) -> None:
        """Start the session; earlier internal errors are over."""
        self.anew_at, self._defect_told = math.inf, ''
        self.take(step, now)

    def recover(self, now: float) -> None:
        """Look for the drive again, as soon as its stop is complete."""
        session = self.session
        if session.stopped:
            self.take_commands(now)     # of a drive that is lost: they move nothing
            self.begin(session.recover, now)
        elif now >= self._give_up_at:
            self.take(session.give_up, now)


def _in_words(error: Exception) -> Sentence:
    return internal_error(type(error).__name__, str(error))
