# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""An exchange without a bus: a link that keeps what it is given, a clock that is set by hand."""

from collections.abc import Sequence
from typing import Any

from builders import drive, frame
from clocks import HandClock

from drive_can_bridge.clock import Clock
from drive_can_bridge.core.configuration import BusConfiguration, DriveConfiguration
from drive_can_bridge.core.events import Event, ProcessDataReceived
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.core.session import Session
from drive_can_bridge.exchange.exchange import BusExchange
from drive_can_bridge.exchange.member import DriveListener
from drive_can_bridge.protocols.families import FAMILIES, make_sessions
from drive_can_bridge.transport.link import Link


class FakeLink(Link):
    """Keeps the frames."""

    def __init__(self) -> None:     # nothing is opened
        self.sent: list[str] = []
        self.refusing = False
        self.started = self.stopped = False
        self.coming: list[Frame] = []       # with the frame that is taken

    def start(self) -> None:
        self.started = True

    def stop(self) -> None:
        self.stopped = True

    def send(self, sent: Frame) -> bool:
        if self.refusing:
            return False
        self.sent.append(str(sent))
        return True

    def look(self) -> tuple[Frame, float] | None:
        return (self.coming.pop(0), 0.0) if self.coming else None

    def take(self) -> list[str]:
        sent, self.sent = self.sent, []
        return sent


class DriveNotes(DriveListener):
    """A drive's listener that keeps what it is told, and hands over commands."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.samples: list[ProcessDataReceived] = []
        self.events: list[Event] = []
        self.commands: list[tuple[int, float]] = []
        self.told: list[float] = []
        self.discarded = 0
        self.failing = False

    def take_commands(self, now: float) -> None:
        if self.failing:
            raise ZeroDivisionError('a defect')
        for index, value in self.commands:
            self.session.services.command(index, value, now)
        self.commands.clear()

    def request_sent(self, now: float) -> None:
        self.told.append(now)

    def discard_commands(self, why: str) -> None:
        self.discarded += 1
        self.commands.clear()

    def process_data(self, event: ProcessDataReceived) -> None:
        self.samples.append(event)

    def handle_event(self, event: Event) -> None:
        self.events.append(event)


class BusNotes:
    """A bus listener that keeps what it is told."""

    def __init__(self) -> None:
        self.told: list[tuple[Any, ...]] = []

    def bus_told(self, bus: str, text: str) -> None:
        pass

    def bus_opened(self, bus: str) -> None:
        self.told.append(('opened', bus))

    def bus_lost(self, bus: str, reason: str) -> None:
        self.told.append(('lost', bus, reason))

    def fatal(self, bus: str, reason: str, *, misconfigured: bool) -> None:
        self.told.append(('fatal', bus, reason, misconfigured))


class Bench:
    """An exchange on the bench."""

    def __init__(self, *drives: DriveConfiguration, sessions: Sequence[Session] = (),
                 clock: Clock | None = None, bitrate: int = 125_000) -> None:
        drives = drives or (drive(name='first', station=1), drive(name='second', station=2))
        self.now = 10.0
        self.step = 0.0
        self.sessions = list(sessions) or make_sessions(drives)
        self.routes = [[claim.route for claim in FAMILIES[entry.protocol].claims(entry)
                        if claim.heard]
                       for entry in drives]
        self.bus_notes = BusNotes()
        self.exchange = BusExchange(
            BusConfiguration('main', 'virtual', 'x', bitrate=bitrate), self.sessions,
            self.routes, self.bus_notes, clock or HandClock(self.clock),
            overheard=[FAMILIES[entry.protocol].overheard(entry) for entry in drives])
        self.link = FakeLink()
        self.exchange.link = self.link
        self.notes = [DriveNotes(session) for session in self.sessions]
        for session, notes in zip(self.sessions, self.notes):
            self.exchange.attach(session, notes)

    def clock(self) -> float:
        """Return the time; looking at it may take time."""
        self.now += self.step
        return self.now

    def at(self, now: float) -> list[str]:
        """Let the timer pass once; return what was sent."""
        self.now = now
        with self.exchange.lock:
            self.exchange._pass()
        return self.link.take()

    def hears(self, text: str, now: float, age: float = 0.0) -> list[str]:
        """Receive a frame."""
        self.now = now
        self.exchange.frame_received(frame(text), age)
        return self.link.take()

    def begin(self) -> 'Bench':
        """Open the bus, and activate."""
        self.exchange.bus_opened()
        self.exchange.activate()
        return self

    def online(self) -> 'Bench':
        """Bring the drive of station 1 online, at 10.002 s."""
        self.now = 9.998
        self.exchange._last_pass = self.now
        self.begin()
        self.hears('102007A4#0032003300000000', 9.999)
        self.hears('102007E4#00D100D200D30000', 10.0)
        self.at(10.0)
        self.hears('103FFFF0#03E800FA00010000', 10.002)
        return self


def all_routes(bench: Bench) -> list[Route]:
    """Return the routes of every drive."""
    return [route for routes in bench.routes for route in routes]
