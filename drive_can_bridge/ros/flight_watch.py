# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The flight recorder in the bridge: what makes it write, and ``~/save_trace``."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import Executor
from rclpy.logging import get_logging_directory
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger

from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.drive_state import DriveState
from drive_can_bridge.exchange.exchange import BusExchange
from drive_can_bridge.ros.diagnostics import Report
from drive_can_bridge.ros.drive_node import DriveNode
from drive_can_bridge.ros.log import Log
from drive_can_bridge.ros.mailbox import Mailbox
from drive_can_bridge.ros.periodic_thread import PeriodicThread
from drive_can_bridge.trace.flight import FlightRecorder
from drive_can_bridge.transport.link import steady_now

#: s between two looks at the drives
LOOK_PERIOD = 0.1
NOT_RECORDING = 'nothing is recorded: set trace_seconds of a bus'
#: of several reasons at once the most telling one names the trace
_RANKS = {DriveState.OFFLINE: 1, DriveState.FAULT: 2, DriveState.MAPPING_DIFFERS: 2}
_BUS_LOST_RANK = 3


class FlightWatch:
    """
    Records the buses of a bridge, and notices what is worth a trace.

    :param buses: those of the configuration; without ``trace_seconds`` nothing is recorded.
    """

    def __init__(self, node: Node, log: Log, buses: Sequence[BusConfiguration], mailbox: Mailbox,
                 executor: Executor) -> None:
        self._node = node
        self._log = log
        self._mailbox = mailbox
        self._executor = executor
        self._recorder: FlightRecorder | None = None
        if any(bus.trace_seconds > 0.0 for bus in buses):
            self._recorder = FlightRecorder(
                buses, Path(str(get_logging_directory())) / 'drive_can_bridge',
                log.warning, log.error)
        self._service = node.create_service(Trigger, '~/save_trace', self._save,
                                            callback_group=ReentrantCallbackGroup())
        self._drives: list[DriveNode] = []
        self._states: dict[str, tuple[DriveState, int]] = {}
        self._bad: set[str] = set()
        self._thread: PeriodicThread | None = None

    def note_of(self, bus: str) -> Callable[..., object] | None:
        """Return what takes every frame of a bus; None: nobody does."""
        ring = None if self._recorder is None else self._recorder.ring(bus)
        return None if ring is None else ring.note

    def attach(self, exchange: BusExchange) -> None:
        """Take the error frames of a bus, too. Before it is opened."""
        ring = None if self._recorder is None else self._recorder.ring(exchange.bus.name)
        if ring is not None:
            exchange.link.error_witness = lambda classes, data: ring.note_error(
                classes, data, steady_now())

    def watch(self, drives: Sequence[DriveNode]) -> None:
        """Begin to look at the drives."""
        recorder = self._recorder
        if recorder is None:
            return
        self._drives = [drive for drive in drives if drive.drive.bus in recorder.buses]
        self._thread = PeriodicThread(
            'flight watch', LOOK_PERIOD, self._look,
            lambda text: self._log.error(f'flight recorder: {text}'))
        self._thread.start()

    def close(self) -> None:
        """Write what is still to be written. The exchanges must be closed."""
        if self._thread is not None:
            self._thread.stop()
        if self._recorder is not None:
            self._recorder.close()
        self._node.destroy_service(self._service)

    # -- what is worth a trace --------------------------------------------------------------------

    def bus_lost(self, bus: str) -> None:
        """Take note that a bus is gone."""
        if self._recorder is not None:
            self._recorder.trigger(bus, 'bus_lost', rank=_BUS_LOST_RANK)

    def reported(self, report: Report, bus: str) -> None:
        """Take note of a diagnostic status."""
        if self._recorder is None:
            return
        if report.level != DiagnosticStatus.ERROR:
            self._bad.discard(report.name)
        elif report.name not in self._bad:
            self._bad.add(report.name)
            self._recorder.trigger(bus, report.name.split(maxsplit=1)[-1] + '_error')

    def _look(self) -> None:
        for drive in self._drives:
            session = drive.session
            if not session.active:
                self._states.pop(drive.name, None)
                continue
            seen = session.state, drive.times_lost
            state, lost = self._states.get(drive.name, (DriveState.OFFLINE, seen[1]))
            self._states[drive.name] = seen
            if self._recorder is None:
                return
            if seen[1] > lost:
                self._recorder.trigger(drive.drive.bus, f'{drive.name}_offline',
                                       rank=_RANKS[DriveState.OFFLINE])
            if seen[0] is not state and seen[0] in (DriveState.FAULT,
                                                    DriveState.MAPPING_DIFFERS):
                self._recorder.trigger(drive.drive.bus, f'{drive.name}_{seen[0].value}',
                                       rank=_RANKS[seen[0]])

    # -- ~/save_trace -----------------------------------------------------------------------------

    async def _save(self, _: Any, response: Any) -> Any:
        recorder = self._recorder
        if recorder is None:
            response.success, response.message = False, NOT_RECORDING
            return response
        paths: list[str] = []
        refusals: list[str] = []
        for future in [self._ask(recorder, bus) for bus in recorder.buses]:
            path, refusal = await future
            (paths if path else refusals).append(path or refusal)
        response.success = bool(paths) and not refusals
        response.message = '\n'.join([*paths, *refusals])
        return response

    def _ask(self, recorder: FlightRecorder, bus: str) -> Future:
        future = Future(executor=self._executor)
        recorder.save(bus, 'save_trace',
                      lambda path, refusal: self._mailbox.complete(future, (path, refusal)))
        return future
