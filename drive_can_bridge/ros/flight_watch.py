# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The flight recorder in the bridge: what makes it write, and ``~/save_trace``."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.logging import get_logging_directory
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger as TriggerService

from drive_can_bridge.clock import Clock
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.drive_state import DriveState
from drive_can_bridge.core.events import Event, MappingDiffered, StationLost
from drive_can_bridge.exchange.exchange import BusExchange
from drive_can_bridge.ros.diagnostics import Report
from drive_can_bridge.ros.drive_node import DriveNode
from drive_can_bridge.ros.executor_thread import ExecutorThread
from drive_can_bridge.ros.log import Log
from drive_can_bridge.trace.flight import FlightRecorder

NOT_RECORDING = 'nothing is recorded: set trace_seconds of a bus'
#: of several reasons at once the most telling one names the trace
_RANKS = {DriveState.OFFLINE: 1, DriveState.FAULT: 2, DriveState.MAPPING_DIFFERS: 2}
_BUS_LOST_RANK = 3


class Trigger(Protocol):
    """Has a trace of a bus written; of several reasons at once the highest rank names it."""

    def __call__(self, bus: str, reason: str, *, rank: int = 0) -> None:
        """Begin."""


class Occasions:
    """
    What is worth a trace: whatever ails, each time that it begins.

    Told of every event when it happens, so that nothing is over too soon to be noticed.
    """

    def __init__(self, trigger: Trigger) -> None:
        self._trigger = trigger
        self._faulted: set[str] = set()
        self._bad: set[str] = set()

    def drive_told(self, drive: str, bus: str, event: Event, state: DriveState) -> None:
        """Take an event of a drive, and its state by then."""
        states = []
        if isinstance(event, StationLost):
            states.append(DriveState.OFFLINE)
        elif isinstance(event, MappingDiffered):
            states.append(DriveState.MAPPING_DIFFERS)
        if state is not DriveState.FAULT:
            self._faulted.discard(drive)
        elif drive not in self._faulted:
            self._faulted.add(drive)
            states.append(state)
        for each in states:
            self._trigger(bus, f'{drive}_{each.value}', rank=_RANKS[each])

    def forget(self, drive: str) -> None:
        """Record that a drive is inactive: whatever ails it then begins anew."""
        self._faulted.discard(drive)

    def bus_lost(self, bus: str) -> None:
        """Record that a bus is gone."""
        self._trigger(bus, 'bus_lost', rank=_BUS_LOST_RANK)

    def reported(self, report: Report, bus: str) -> None:
        """Take a diagnostic status."""
        if report.level != DiagnosticStatus.ERROR:
            self._bad.discard(report.name)
        elif report.name not in self._bad:
            self._bad.add(report.name)
            self._trigger(bus, report.name.split(maxsplit=1)[-1] + '_error')


class FlightWatch:
    """
    Records the buses of a bridge, and notices what is worth a trace.

    :param buses: those of the configuration; without ``trace_seconds`` nothing is recorded.
    """

    def __init__(self, node: Node, log: Log, buses: Sequence[BusConfiguration],
                 thread: ExecutorThread, clock: Clock) -> None:
        self._now = clock.now
        self._node = node
        self._log = log
        self._thread = thread
        wanted = any(bus.trace_seconds > 0.0 for bus in buses)  # else there may be no such place
        folder = Path(str(get_logging_directory())) / 'drive_can_bridge' if wanted else Path()
        self._recorder = FlightRecorder(buses, folder, log.warning, log.error, clock)
        occasions = self._occasions = Occasions(self._recorder.trigger)
        #: what else is worth a trace: a bus that is gone, and a diagnostic status
        self.bus_lost, self.reported = occasions.bus_lost, occasions.reported
        self._calls = 0     # that wait for their answer
        self._service = node.create_service(TriggerService, '~/save_trace', self._save,
                                            callback_group=ReentrantCallbackGroup())

    def note_of(self, bus: str) -> Callable[..., object] | None:
        """Return what takes every frame of a bus; None: nobody does."""
        ring = self._recorder.ring(bus)
        return None if ring is None else ring.note

    def attach(self, exchange: BusExchange) -> None:
        """Take the error frames of a bus, too. Before it is opened."""
        ring = self._recorder.ring(exchange.bus.name)
        if ring is not None:
            exchange.link.error_witness = lambda classes, data: ring.note_error(
                classes, data, self._now())

    def watch(self, drives: Sequence[DriveNode]) -> None:
        """Begin to look at the drives."""
        for drive in drives:
            if drive.drive.bus in self._recorder.buses:
                drive.witness = partial(_tell, self._occasions, drive)

    def close(self) -> None:
        """Write what is still to be written. The exchanges must be closed."""
        self._recorder.close()
        self._leave()

    def _leave(self) -> None:
        """Let go of the service, as soon as its last caller has an answer."""
        if self._calls:
            self._thread.later(self._leave)
        else:
            self._node.destroy_service(self._service)

    # -- ~/save_trace -----------------------------------------------------------------------------

    async def _save(self, _: Any, response: Any) -> Any:
        self._calls += 1
        try:
            return await self._saved(response)
        finally:
            # it is sent when this has ended
            self._thread.later(self._end_call)

    def _end_call(self) -> None:
        self._calls -= 1

    async def _saved(self, response: Any) -> Any:
        buses = self._recorder.buses
        if not buses:
            response.success, response.message = False, NOT_RECORDING
            return response
        paths: list[str] = []
        refusals: list[str] = []
        for future in [self._ask(bus) for bus in buses]:
            path, refusal = await future
            (paths if path else refusals).append(path or refusal)
        response.success = bool(paths) and not refusals
        response.message = '\n'.join([*paths, *refusals])
        return response

    def _ask(self, bus: str) -> Future:
        future = Future(executor=self._thread.executor)
        self._recorder.save(bus, 'save_trace', lambda path, refusal: self._thread.later(
            future.set_result, (path, refusal)))
        return future


def _tell(occasions: Occasions, drive: DriveNode, event: Event) -> None:
    """Pass on what a drive tells, with the bus lock held."""
    if drive.session.active:
        occasions.drive_told(drive.name, drive.drive.bus, event, drive.session.state)
    else:
        occasions.forget(drive.name)
