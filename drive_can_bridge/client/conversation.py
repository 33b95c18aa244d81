# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Parameter requests on one bus, without a bridge: its exchange and its sessions, but no exchange.

The sessions only *serve* (see :meth:`.Session.serve`): nothing is sent but the acyclic frames of
the requests that are handed in here. Whatever only a master sends to a drive of this bus, and was
not sent by this process, ends the conversation.
"""

from collections.abc import Sequence
import threading

from drive_can_bridge.clock import Clock
from drive_can_bridge.core.configuration import BusConfiguration, DriveConfiguration
from drive_can_bridge.core.errors import BusMisconfigured, BusUnavailable, DriveCanError
from drive_can_bridge.core.events import Event, RequestCompleted
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.core.requests import Outcome, Request
from drive_can_bridge.core.session import Session
from drive_can_bridge.exchange.exchange import BusExchange
from drive_can_bridge.exchange.listeners import DriveListener
from drive_can_bridge.exchange.one_master import Ownership
from drive_can_bridge.protocols.families import FAMILIES

#: s that a bus has to open
_OPEN_TIMEOUT = 5.0
#: s between two looks whether all is well, however many wait for something
_PATIENCE = 0.1


class AnotherMaster(DriveCanError):
    """Somebody else talks to one of the drives."""


class BusConversation:
    """
    One open bus.

    :param drives: those that will be asked.
    :param neighbours: all drives that are known on the bus: no other master may talk to them.
    :param ownership: of the bus; kept as long as its threads run, whoever forgets to close it.
    :raises DriveCanError: the bus cannot be opened.
    """

    def __init__(self, bus: BusConfiguration, drives: Sequence[DriveConfiguration],
                 neighbours: Sequence[DriveConfiguration], ownership: Ownership,
                 clock: Clock) -> None:
        self.bus = bus
        self.now = clock.now
        self._ownership = ownership
        self._changed = clock.alarm()
        self._lock = threading.Lock()
        self._outcomes: dict[int, tuple[Outcome, ...]] = {}
        self._trouble: DriveCanError | None = None
        self._opened = False
        self._requests: list[tuple[str, Route]] = [
            (drive.name, route) for drive in neighbours
            for route in FAMILIES[drive.protocol].make_prober(drive).requests]
        self.sessions: dict[str, Session] = {
            drive.name: FAMILIES[drive.protocol].make_session(drive) for drive in drives}
        self._exchange = BusExchange(
            bus, list(self.sessions.values()),
            [[claim.route for claim in FAMILIES[drive.protocol].claims(drive) if claim.heard]
             for drive in drives],
            self, clock, counted=[route for _, route in self._requests], note=self._note)
        for session in self.sessions.values():
            self._exchange.attach(session, _Ears(self))
        self._exchange.serve()
        self._exchange.open()
        try:
            self._exchange.link.wait_first_attempt(_OPEN_TIMEOUT)
            end = self.now() + _OPEN_TIMEOUT
            while not self._opened and self._trouble is None and self.now() < end:
                self._changed.wait(end)
            if not self._opened:
                self._fail(BusUnavailable(f'bus {bus.name}: it does not open'))
            self._check()
        except BaseException:
            self.close()
            raise

    def listen(self, seconds: float) -> None:
        """
        Do nothing but listen.

        :raises DriveCanError: another master talks to a drive, or the bus is lost.
        """
        end = self.now() + seconds
        self._check()
        while self.now() < end:
            self._changed.wait(min(end, self.now() + _PATIENCE))
            self._check()

    def submit(self, drive: str, request: Request) -> None:
        """
        Hand in a request; :meth:`wait` brings its outcomes.

        :raises DriveCanError: another master talks to a drive, or the bus is lost or closed.
        """
        self._check()
        self._exchange.submit(self.sessions[drive], request)

    def wait(self, request: Request) -> tuple[Outcome, ...]:
        """
        Wait for the outcomes of a request that was handed in.

        :raises DriveCanError: another master talks to a drive, or the bus is lost.
        """
        self._check()
        while id(request) not in self._outcomes:
            self._changed.wait(self.now() + _PATIENCE)
            self._check()
        return self._outcomes.pop(id(request))

    def send(self, frame: Frame) -> None:
        """
        Send a frame that is no parameter request.

        :raises BusUnavailable: the bus does not take it.
        """
        with self._exchange.lock:
            if not self._exchange.link.send(frame):
                raise BusUnavailable(f'bus {self.bus.name}: {self._exchange.link.last_error}')

    def close(self) -> None:
        """Close the bus; whoever asks for anything later is told so. Idempotent."""
        self._exchange.close()
        self._fail(DriveCanError(f'bus {self.bus.name}: is closed already'))

    def _check(self) -> None:
        if self._trouble is not None:
            raise self._trouble

    def _fail(self, trouble: DriveCanError) -> None:
        with self._lock:
            self._trouble = self._trouble or trouble
        self._changed.ring()

    # -- from the exchange ------------------------------------------------------------------------

    def completed(self, request: Request, outcomes: tuple[Outcome, ...]) -> None:
        """Take what became of a request."""
        self._outcomes[id(request)] = outcomes
        self._changed.ring()

    def _note(self, frame: Frame, now: float, sent: bool) -> None:
        if sent:
            return
        for name, route in self._requests:
            if route.matches(frame):
                self._fail(AnotherMaster(f'bus {self.bus.name}: another master talks to drive '
                                         f'{name} ({frame}); end it first'))

    def bus_opened(self, bus: str) -> None:
        """Take note that the bus is there."""
        self._opened = True
        self._changed.ring()

    def bus_lost(self, bus: str, reason: str) -> None:
        """End: what the drives do now nobody knows."""
        self._fail(BusUnavailable(f'bus {bus}: {reason}'))

    def fatal(self, bus: str, reason: str, *, misconfigured: bool) -> None:
        """End likewise."""
        kind = BusMisconfigured if misconfigured else DriveCanError
        self._fail(kind(f'bus {bus}: {reason}'))


class _Ears(DriveListener):
    """Listens to one session: only answered requests matter."""

    def __init__(self, conversation: BusConversation) -> None:
        self._conversation = conversation

    def handle_event(self, event: Event) -> None:
        """Hand on what became of a request."""
        if isinstance(event, RequestCompleted):
            self._conversation.completed(event.request, event.outcomes)
