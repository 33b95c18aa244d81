# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Sessions of a bridge and simulated drives without a clock: conversations in literal times.

Nothing here waits, and nothing depends on the machine.
"""

from collections.abc import Callable
import math
from typing import Any

from builders import text_of

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.core.events import Event, Noted, ProcessDataReceived, RequestCompleted
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.setpoints import CommandOutcome
from drive_can_bridge.protocols.families import FAMILIES, make_sessions
from drive_can_bridge.simulation.cia402_plant import Habits
from drive_can_bridge.simulation.registers import Mechanics
from drive_can_bridge.simulation.simulation import SIMULATED_DRIVES


class Cable:
    """
    Bridge and drives at the two ends of a bus.

    :param frame_time: s that a frame takes.
    :param prepare: called with each drive before anybody hears of it.
    :ivar sent: what the bridge has sent, with its time.
    :ivar dead: the bridge has been killed: nothing of it runs any more.
    """

    def __init__(self, *drives: DriveConfiguration, frame_time: float = 0.0002,
                 habits: Habits | None = None, prepare: Callable[[Any], None] = lambda _: None,
                 **mechanics: Any) -> None:
        self._frame_time = frame_time
        self.drives: list[Any] = [
            SIMULATED_DRIVES[each.protocol](each, mechanics=Mechanics(**mechanics))
            for each in drives]
        for drive in self.drives:
            if habits is not None:
                drive.habits = habits
            prepare(drive)
        self.sessions = make_sessions(list(drives))
        self._routes = [[claim.route for claim in FAMILIES[each.protocol].claims(each)]
                        for each in drives]
        self.now = 0.0
        self.dead = False
        self.sent: list[tuple[float, str]] = []
        self.events: list[tuple[float, Event]] = []
        self._under_way: list[tuple[float, bool, Frame]] = []
        for drive in self.drives:
            drive.handle_timer(0.0)
        for session in self.sessions:
            session.bus_up(0.0)
            session.activate(0.0)
        self._collect()

    def run(self, seconds: float) -> 'Cable':
        """Let time pass."""
        until = self.now + seconds
        for _ in range(200_000):
            due = min(*(drive.next_timer() for drive in self.drives),
                      *(at for at, _, _ in self._under_way), math.inf,
                      *(() if self.dead else (each.next_timer() for each in self.sessions)))
            if due > until:
                self.now = until
                for drive in self.drives:
                    drive.plant.advance(until)
                return self
            self.now = max(self.now, due)
            arrived = [entry for entry in self._under_way if entry[0] <= self.now]
            self._under_way = [entry for entry in self._under_way if entry[0] > self.now]
            for _, to_drives, each in arrived:
                self._deliver(each, to_drives)
            for drive in self.drives:
                if drive.next_timer() <= self.now:
                    drive.handle_timer(self.now)
            if not self.dead:
                for session in self.sessions:
                    session.handle_timer(self.now)
            self._collect()
        raise AssertionError(f'nothing goes on at {self.now}')

    def _deliver(self, each: Frame, to_drives: bool) -> None:
        if to_drives:
            for drive in self.drives:
                if any(route.matches(each) for route in drive.routes):
                    drive.receive_frame(each, self.now)
        elif not self.dead:
            for session, routes in zip(self.sessions, self._routes, strict=True):
                if any(route.matches(each) for route in routes):
                    session.receive_frame(each, self.now)

    def _arrival(self, place: int) -> float:
        """Return when a frame arrives, by its place among those that leave now."""
        return self.now + self._frame_time * (1 + place / 100)

    def _collect(self) -> None:
        while not self.dead:
            frames = [each for session in self.sessions for each in session.take_frames()]
            for session in self.sessions:
                session.frames_left(self.now)
            if not frames:
                break
            for place, each in enumerate(frames):
                self.sent.append((round(self.now, 6), str(each)))
                self._under_way.append((self._arrival(place), True, each))
        for drive in self.drives:
            for place, each in enumerate(drive.take_frames()):
                self._under_way.append((self._arrival(place), False, each))
        if not self.dead:
            self.events += [(round(self.now, 6), event) for session in self.sessions
                            for event in session.take_events()]

    # -- users ------------------------------------------------------------------------------------

    def found(self, kind: type) -> list[Any]:
        """Return the events of a kind."""
        return [event for _, event in self.events if isinstance(event, kind)]

    def submit(self, request: Any) -> None:
        """Hand a request to the first drive."""
        self.sessions[0].services.submit(request, self.now)
        self._collect()

    def control(self, action: ControlAction, patience: float = 20.0) -> tuple[bool, str]:
        """Ask the first drive for a control action; let time pass until it has its outcome."""
        refusal = self.sessions[0].services.control_refusal(action)
        if refusal:
            return False, refusal
        request = ControlRequest(action)
        self.submit(request)
        limit = self.now + patience
        while True:
            for done in self.found(ControlCompleted):
                if done.request is request:
                    return done.success, done.message
            assert self.now < limit
            self.run(0.01)

    def outcome(self, request: Any, patience: float = 20.0) -> list[object]:
        """Submit a request to the first drive; let time pass until it has its outcome."""
        self.submit(request)
        return self.wait(request, patience)

    def wait(self, request: Any, patience: float = 20.0) -> list[object]:
        """Let time pass until a request has its outcome."""
        limit = self.now + patience
        while not self.outcomes(request):
            assert self.now < limit
            self.run(0.01)
        return self.outcomes(request)[0]

    def outcomes(self, request: Any) -> list[list[object]]:
        return [[text_of(each) for each in event.outcomes]
                for event in self.found(RequestCompleted) if event.request is request]

    def command(self, value: float, seconds: float = 0.2) -> None:
        """Have somebody publish a setpoint for the first drive for some time."""
        for _ in range(max(round(seconds / 0.1), 1)):
            outcome = self.sessions[0].services.command(0, value, self.now)
            assert outcome in (CommandOutcome.ACCEPTED, CommandOutcome.ARMED), outcome
            self._collect()
            self.run(0.1)

    def deactivate(self) -> None:
        """End as SIGTERM does: every session stops, and the bus is closed when all have."""
        for session in self.sessions:
            session.deactivate(self.now)
        self._collect()
        for _ in range(1000):
            if all(session.stopped for session in self.sessions):
                break
            self.run(0.01)
        self.dead = True

    def told(self) -> list[str]:
        """Return what was noted for the log."""
        return [str(event.text) for event in self.found(Noted)]

    @property
    def speed(self) -> float:
        """Revolutions per second of the first axis."""
        return float(self.drives[0].plant.shaft.speed)

    @property
    def samples(self) -> list[tuple[int, ...]]:
        return [event.raws for event in self.found(ProcessDataReceived)]
