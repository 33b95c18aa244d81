# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A session that is spoken to in hex and literal times."""

from collections.abc import Callable
from functools import partial
from typing import Any

from builders import frame, text_of
from coming import Coming

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.core.events import Event, ProcessDataReceived, RequestCompleted
from drive_can_bridge.core.parameters import Value
from drive_can_bridge.core.requests import Request
from drive_can_bridge.core.session import Session
from drive_can_bridge.core.setpoints import CommandOutcome
from drive_can_bridge.protocols.families import FAMILIES


class Conversation:
    """
    A session, spoken to in hex and literal times.

    Every method that may cause frames returns them as candump writes them.

    :ivar refusing: tells of a frame whether the bus refuses it.
    """

    def __init__(self, configuration: DriveConfiguration) -> None:
        self.session: Session = FAMILIES[configuration.protocol].make_session(configuration)
        self.log: list[Event] = []
        self.controlled: list[ControlCompleted] = []
        self.now = 0.0
        self.refusing: Callable[[str], bool] = lambda text: False

    def sent(self) -> list[str]:
        """Return the frames since the last look that the bus took, and keep the events."""
        found: list[str] = []
        while True:
            texts = [str(entry) for entry in self.session.take_frames()]
            if not texts:
                self.listen()
                return found
            refused = [place for place, text in enumerate(texts) if self.refusing(text)]
            found += [text for place, text in enumerate(texts) if place not in refused]
            self.session.frames_left(self.now, refused)

    def at(self, now: float) -> list[str]:
        """Let the timer run once."""
        self.now = now
        self.session.handle_timer(now)
        return self.sent()

    def until(self, end: float) -> list[tuple[float, str]]:
        """Serve every timer up to and including ``end``, each at its own time."""
        return self.served(end, lambda text: None)

    def hears(self, text: str, now: float) -> list[str]:
        """Receive a frame."""
        self.now = now
        self.session.receive_frame(frame(text), now)
        return self.sent()

    def served(self, end: float, answer: Callable[[str], str | None], delay: float = 0.002,
               ) -> list[tuple[float, str]]:
        """
        Serve every timer up to ``end``, and have a drive answer.

        :param answer: makes it of each frame sent; None: there is none.
        :param delay: s until it arrives. What has not arrived by the end does not.
        """
        found: list[tuple[float, str]] = []
        coming = Coming()

        def took(sent: list[str]) -> None:
            for text in sent:
                found.append((round(self.now, 6), text))
                reply = answer(text)
                if reply is not None:
                    coming.plan(self.now + delay, partial(arrives, reply))

        def arrives(reply: str) -> None:
            took(self.hears(reply, self.now))
        coming.live(self, end, due=self.session.next_timer,
                    timers=lambda: took(self.at(self.now)))
        return found

    def bus_up(self, now: float) -> list[str]:
        self.now = now
        self.session.bus_up(now)
        return self.sent()

    def bus_down(self, now: float, reason: str = 'unplugged') -> list[str]:
        self.now = now
        self.session.bus_down(now, reason)
        return self.sent()

    def activate(self, now: float) -> list[str]:
        self.now = now
        self.session.activate(now)
        return self.sent()

    def begins(self, now: float = 10.0) -> list[str]:
        """Be activated, on a bus that has been there for a second."""
        assert self.bus_up(now - 1.0) == []
        return self.activate(now)

    def begun(self) -> 'Conversation':
        """Begin, whatever is sent."""
        self.begins()
        return self

    def deactivate(self, now: float) -> list[str]:
        self.now = now
        self.session.deactivate(now)
        return self.sent()

    def handle_stall(self, now: float) -> list[str]:
        self.now = now
        self.session.handle_stall(now)
        return self.sent()

    def submits(self, request: Request, now: float) -> list[str]:
        self.now = now
        self.session.services.submit(request, now)
        return self.sent()

    def asks(self, action: ControlAction, now: float) -> list[str]:
        """Ask for a control action, which has to be taken."""
        self.now = now
        refusal = self.session.services.control_refusal(action)
        assert not refusal, refusal
        self.session.services.submit(ControlRequest(action), now)
        return self.sent()

    def commands(self, index: int, value: Value, now: float) -> CommandOutcome:
        self.now = now
        return self.session.services.command(index, value, now)

    def listen(self) -> None:
        """Take what the session has to tell; outcomes of control requests are kept apart."""
        for event in self.session.take_events():
            if isinstance(event, ControlCompleted):
                self.controlled.append(event)
            else:
                self.log.append(event)

    def events(self, *kinds: type) -> list[Any]:
        """Return the events since the last call, or only those of some kinds."""
        self.listen()
        found, self.log = self.log, []
        return [event for event in found if not kinds or isinstance(event, kinds)]

    def samples(self) -> list[tuple[int, ...]]:
        """Return the process data received since the last look at events."""
        return [event.raws for event in self.events()
                if isinstance(event, ProcessDataReceived)]

    def outcomes(self) -> list[list[object]]:
        """Return the outcomes of the requests that ended since the last look at events."""
        return [[text_of(outcome) for outcome in event.outcomes] for event in self.events()
                if isinstance(event, RequestCompleted)]

    def control_outcomes(self) -> list[tuple[str, bool, str]]:
        """Return the control requests that ended since the last call."""
        self.listen()
        found, self.controlled = self.controlled, []
        return [(done.request.action.value, done.success, done.message) for done in found]
