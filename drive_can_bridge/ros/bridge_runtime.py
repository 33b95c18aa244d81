# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The parts of a bridge from configure to cleanup: buses, drives, and their reports.

The flight recorder, too: what makes it write, and ``~/save_trace``.
"""

from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from functools import partial
import json
from pathlib import Path
from typing import Any, Protocol

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.logging import get_logging_directory
from rclpy.node import Node
from std_srvs.srv import Trigger as TriggerService

from drive_can_bridge.clock import Clock
from drive_can_bridge.configuration.load import identity_name
from drive_can_bridge.core import codes, sentences
from drive_can_bridge.core.configuration import (
    BridgeConfiguration, BusConfiguration, DriveConfiguration)
from drive_can_bridge.core.errors import ConfigurationError
from drive_can_bridge.core.events import DriveState, Event, MappingDiffered, StationLost
from drive_can_bridge.core.text import counted
from drive_can_bridge.exchange.exchange import BusExchange, stop_all
from drive_can_bridge.exchange.one_master import InUse, Ownership
from drive_can_bridge.memory import data_limit, MEGABYTE, reserve
from drive_can_bridge.process.presence import BRIDGE, Presence
from drive_can_bridge.process.scheduling import raise_priority
from drive_can_bridge.protocols.families import FAMILIES, make_sessions
from drive_can_bridge.ros.coroutines import Awaited
from drive_can_bridge.ros.diagnostics import Diagnostics, PresenceCheck, StatusEntry
from drive_can_bridge.ros.drive_node import DriveNode
from drive_can_bridge.ros.joints import Joints
from drive_can_bridge.ros.local_way import LocalWayServer
from drive_can_bridge.ros.log import Log
from drive_can_bridge.ros.passing import Passing
from drive_can_bridge.ros.stamps import Stamps
from drive_can_bridge.ros.threads import ExecutorThread, PeriodicThread, ServiceThread
from drive_can_bridge.trace.flight import FlightRecorder
from drive_can_bridge.transport.end_point import EndPoint
from drive_can_bridge.transport.failures import with_outlook

#: of several reasons at once the most telling one names the trace
_RANKS = {DriveState.OFFLINE: 1, DriveState.FAULT: 2, DriveState.MAPPING_DIFFERS: 2}
_BUS_LOST_RANK = 3
#: s that is waited for the first attempt to open the buses, to report what can never work
FIRST_ATTEMPT_TIMEOUT = 3.0
#: s that one may take longer than another that is open: its drives may be enabled since before
OTHERS_TIMEOUT = 0.5
#: s between two looks whether one is open
_LOOK = 0.05


class Trigger(Protocol):
    """Saves a trace of a bus; of several reasons at once the highest rank names it."""

    def __call__(self, bus: str, reason: str, *, rank: int = 0) -> None:
        """Start to save."""


class TraceTriggers:
    """
    Decides what is worth a trace: each fault, loss and error, when it begins.

    Called with every event when it happens, so that none is over too soon to be noticed.
    """

    def __init__(self, trigger: Trigger) -> None:
        self._trigger = trigger
        self._faulted: set[str] = set()
        self._bad: set[str] = set()

    def drive_told(self, drive: str, bus: str, event: Event, state: DriveState) -> None:
        """Handle an event of a drive, with its state at that time."""
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
        """Record that a drive is inactive: a later fault counts as new."""
        self._faulted.discard(drive)

    def bus_lost(self, bus: str) -> None:
        """Handle the loss of a bus."""
        self._trigger(bus, 'bus_lost', rank=_BUS_LOST_RANK)

    def reported(self, report: StatusEntry, bus: str) -> None:
        """Handle a diagnostic status."""
        if report.level != DiagnosticStatus.ERROR:
            self._bad.discard(report.name)
        elif report.name not in self._bad:
            self._bad.add(report.name)
            self._trigger(bus, report.name.split(maxsplit=1)[-1] + '_error')


class FlightWatch:
    """
    Records the buses of a bridge, and saves traces of what is worth one.

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
        triggers = self._triggers = TraceTriggers(self._recorder.trigger)
        #: what else is worth a trace: a bus that is gone, and a diagnostic status
        self.bus_lost, self.reported = triggers.bus_lost, triggers.reported
        self._calls = 0     # that wait for their answer
        self._service = node.create_service(TriggerService, '~/save_trace', self._save,
                                            callback_group=ReentrantCallbackGroup())

    @property
    def memory(self) -> int:
        """Bytes that the records may take."""
        return self._recorder.memory

    def note_of(self, bus: str) -> Callable[..., object] | None:
        """Return the function that records every frame of a bus; None: it is not recorded."""
        ring = self._recorder.ring(bus)
        return None if ring is None else ring.note

    def attach(self, exchange: BusExchange) -> None:
        """Record the error frames of a bus, too. Before it is opened."""
        ring = self._recorder.ring(exchange.bus.name)
        if ring is not None:
            exchange.link.error_witness = lambda classes, data: ring.note_error(
                classes, data, self._now())

    def watch(self, drives: Sequence[DriveNode]) -> None:
        """Start watching the drives."""
        for drive in drives:
            if drive.drive.bus in self._recorder.buses:
                drive.witness = partial(_tell, self._triggers, drive)

    def close(self) -> None:
        """Write what is still to be written. The exchanges must be closed."""
        self._recorder.close()
        self._leave()

    def _leave(self) -> None:
        """Destroy the service, as soon as its last caller has an answer."""
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
            response.success, response.message = False, sentences.nothing_recorded()
            return response
        told = await Awaited[list[tuple[str, str]]](partial(self._ask, buses))
        paths = [path for path, _ in told if path]
        refusals = [refusal for path, refusal in told if not path]
        response.success = bool(paths) and not refusals
        response.message = '\n'.join([*paths, *refusals])
        return response

    def _ask(self, buses: Sequence[str],
             done: Callable[[list[tuple[str, str]]], None]) -> None:
        """Save the traces of several buses; ``done`` is called after the last one."""
        told: dict[str, tuple[str, str]] = {}

        def written(bus: str, path: str, refusal: str) -> None:
            told[bus] = path, refusal
            if len(told) == len(buses):
                done([told[each] for each in buses])
        for bus in buses:
            self._recorder.save(bus, 'save_trace', partial(self._thread.later, written, bus))


def _tell(triggers: TraceTriggers, drive: DriveNode, event: Event) -> None:
    """Pass on an event of a drive, with the bus lock held."""
    if drive.session.active:
        triggers.drive_told(drive.name, drive.drive.bus, event, drive.session.state)
    else:
        triggers.forget(drive.name)


class BridgeRuntime:
    """
    The buses of a configuration, and their drives (a ``BusListener`` of each exchange).

    :param spinner: serves the drive nodes.
    :param control_thread: (bus): returns the thread that serves what stops its drives.
    :param parameter_thread: serves their parameters.
    :param stamps: of all messages.
    :param open_bus: opens a bus; None: python-can, by its configuration.
    :param announce: changes a read-only parameter of the bridge.
    :param seen: returns the full names of all bridges in the graph, and of the drives around them.
    :param get: answers ``get_parameters`` of the bridge.
    :param dismiss: removes drives from the graph; their exchanges are closed.
    :param fatal: called with the reason when the bridge cannot go on; from any thread.
    :ivar drives: by name, in the order of the configuration.
    :ivar local_way: answers processes of this host.
    :raises ConfigurationError: another process has a drive.
    """

    def __init__(self, node: Node, log: Log, configuration: BridgeConfiguration,
                 spinner: ExecutorThread, control_thread: Callable[[str], ServiceThread],
                 parameter_thread: ServiceThread, stamps: Stamps, clock: Clock, *,
                 open_bus: Callable[[BusConfiguration], EndPoint] | None,
                 announce: Callable[[str, str], None],
                 seen: Callable[[], tuple[list[str], list[str]]],
                 get: Callable[[Any, Any], Any],
                 dismiss: Callable[[Iterable[DriveNode]], None],
                 fatal: Callable[[str], None]) -> None:
        self.configuration = configuration
        self.exchanges: dict[str, BusExchange] = {}
        self.drives: dict[str, DriveNode] = {}
        self.joints: Joints | None = None
        self._log = log
        self._clock = clock
        self._open_bus = open_bus
        self._fatal = fatal
        self._priority = ''
        #: what is wrong with buses, as long as they are opened for the first time
        self._misconfigured: list[str] | None = []
        with ExitStack() as closing:    # the last first
            closing.callback(data_limit.lift)
            closing.callback(self.exchanges.clear)
            closing.callback(self._own().release)
            domain, name = node.context.get_domain_id(), node.get_fully_qualified_name()
            presence = Presence(domain, name)
            closing.callback(presence.withdraw)
            closing.callback(dismiss, self.drives.values())
            self._flight = FlightWatch(node, log, list(configuration.buses.values()), spinner,
                                       clock)
            closing.callback(self._flight.close)
            for bus in configuration.buses.values():
                self._build(bus, lambda drive, session, exchange: DriveNode(
                    node, drive, session, FAMILIES[drive.protocol], exchange, spinner, log,
                    control_thread(drive.bus), parameter_thread, stamps,
                    partial(announce, identity_name(drive.name)), clock))
            if any(drive.joint is not None for drive in configuration.drives.values()):
                self.joints = Joints(node, log, configuration, self.drives, stamps, clock)
                closing.callback(self.joints.destroy)
            for exchange in self.exchanges.values():
                closing.callback(exchange.close)
            self.diagnostics = Diagnostics(node, list(self.exchanges.values()),
                                           list(self.drives.values()), stamps,
                                           self._flight.reported, clock)
            closing.callback(self.diagnostics.destroy)
            self._reporting = PeriodicThread(
                'diagnostics', configuration.diagnostics_period, self.diagnostics.publish,
                lambda text: log.error(f'diagnostics: {text}'), clock)
            closing.callback(self._reporting.stop)
            self._presence_check = PresenceCheck(log, list(self.drives.values()), clock)
            closing.callback(self._presence_check.end)
            self._passing = Passing(node, clock, log.warning)
            closing.callback(self._passing.end)
            self.local_way = LocalWayServer(
                presence, domain, name, self.drives, list(configuration.drives), seen=seen,
                get=get, spinner=spinner, pass_on=self._passing.begin, warn=log.warning,
                clock=clock)
            closing.callback(self.local_way.close)
            self._closing = closing.pop_all()

    def _drives_of(self, bus: BusConfiguration) -> list[DriveConfiguration]:
        return [drive for drive in self.configuration.drives.values() if drive.bus == bus.name]

    def _own(self) -> Ownership:
        try:
            return Ownership([(bus, self._drives_of(bus))
                              for bus in self.configuration.buses.values()],
                             BRIDGE, 'a drive has one master: end it first')
        except InUse as error:
            raise ConfigurationError([str(error)]) from None

    def _build(self, bus: BusConfiguration, make_node: Callable[..., DriveNode]) -> None:
        drives = self._drives_of(bus)
        sessions = make_sessions(drives)
        claims = [FAMILIES[drive.protocol].claims(drive) for drive in drives]
        exchange = self.exchanges[bus.name] = BusExchange(
            bus, sessions,
            [[claim.route for claim in entries if claim.heard] for entries in claims], self,
            self._clock, open_bus=self._open_bus,
            counted=[claim.route for entries in claims for claim in entries if not claim.heard],
            overheard=[FAMILIES[drive.protocol].overheard(drive) for drive in drives],
            prepare_thread=self._prepare_thread, note=self._flight.note_of(bus.name))
        self._flight.attach(exchange)
        for drive, session in zip(drives, sessions):
            node = self.drives[drive.name] = make_node(drive, session, exchange)
            exchange.attach(session, node)
            node.serve()

    def open(self) -> None:
        """
        Open the buses, and start their diagnostics; nothing is sent.

        :raises ConfigurationError: what can never be opened, or belongs to another process.
        """
        for exchange in self.exchanges.values():
            exchange.open()
        codes.make_ready()      # meanwhile
        self._await_buses()
        if self._misconfigured:
            raise ConfigurationError(self._misconfigured)
        self._misconfigured = None
        self._log.info(self._priority)
        self._flight.watch(list(self.drives.values()))
        self._reporting.start()
        if self.joints is not None:
            self.joints.start()

    def _await_buses(self) -> None:
        """Wait until each bus was tried once; not for long, where another one is open."""
        links = [exchange.link for exchange in self.exchanges.values()]
        deadline, others_wait = self._clock.now() + FIRST_ATTEMPT_TIMEOUT, False
        for link in links:
            while not link.wait_first_attempt(_LOOK) and self._clock.now() < deadline:
                if not others_wait and any(other.is_open for other in links):
                    others_wait = True
                    deadline = min(deadline, self._clock.now() + OTHERS_TIMEOUT)

    def activate(self) -> None:
        """Start the exchange with every drive."""
        for exchange in self.exchanges.values():
            exchange.activate()
        self._presence_check.begin()
        self._limit_memory()
        self._log.info(sentences.active(
            drives=len(self.drives), buses=counted(len(self.exchanges), 'bus', 'buses')))

    def _limit_memory(self) -> None:
        """Limit the memory for requests; the threads that must go on reserve theirs first."""
        megabytes = self.configuration.memory_limit_mb
        if megabytes:
            # for the main thread: a request that takes all memory takes its heap, too
            spare = self._clock.worker(reserve, 'reserve')
            spare.start()
            spare.join()
            try:
                data_limit.set(megabytes * MEGABYTE + self._flight.memory)
            except OSError as error:
                self._log.warning(sentences.no_memory_limit(str(error)))

    def stop(self) -> None:
        """Stop the drives safely, if they run."""
        with data_limit.room():
            failures = stop_all(self.exchanges.values(), self._clock)
        self._presence_check.end()      # which may be waiting for a bus that hangs
        for bus, reason in failures.items():
            self._log.error(sentences.stop_frames_not_sent(bus=bus, reason=reason))

    def close(self) -> None:
        """Close the buses, remove the drives, release the locks."""
        self._closing.close()

    def parameter_changed(self, name: str, value: Any) -> None:
        """Handle a parameter of the bridge that was changed while it runs."""
        drive, key = self.drive_of(name), name.rpartition('.')[2]
        if name == 'diagnostics_period':
            self._reporting.set_period(float(value))
        elif drive is not None and key == 'rearm':
            drive.exchange.reconfigure(drive.session, rearm_immediate=value == 'immediate')
        elif drive is not None and key in ('command_timeout', 'parameter_timeout'):
            drive.exchange.reconfigure(drive.session, **{key: float(value)})

    def drive_of(self, name: str) -> DriveNode | None:
        """Return the drive that a parameter of the bridge is about."""
        return self.drives.get(name.rpartition('.')[0].removeprefix('drives.'))

    def made_parameter(self, name: str, joint_commands: str) -> object:
        """
        Return the value of a parameter that is computed on request; None: not one of these.

        :param joint_commands: the topic with the commands for all joints.
        """
        drive = self.drive_of(name)
        key = name.rpartition('.')[2]
        if drive is None or key not in ('setpoints', 'commanders'):
            return None
        return drive.commands.setpoints_text() if key == 'setpoints' else (
            json.dumps(drive.commands.commanders(joint_commands)))

    # -- from the exchanges (BusListener) ---------------------------------------------------------

    def _prepare_thread(self) -> None:
        """Raise the priority of a thread of an exchange, and reserve its memory."""
        self._priority = raise_priority()
        reserve()

    def bus_opened(self, bus: str) -> None:
        """Log it."""
        self._log.source(f'bus {bus}').info('open')

    def bus_lost(self, bus: str, reason: str) -> None:
        """Log it; at start-up a bus of another process is not waited for."""
        if self._misconfigured is not None and self.exchanges[bus].link.taken:
            self._misconfigured.append(f'bus {bus}: {reason}')
            return
        again = self.configuration.buses[bus].reconnect_period
        self._log.source(f'bus {bus}').error(with_outlook(reason, again))
        self._flight.bus_lost(bus)

    def bus_told(self, bus: str, text: str) -> None:
        """Log it."""
        self._log.source(f'bus {bus}').warning(text)

    def fatal(self, bus: str, reason: str, *, misconfigured: bool) -> None:
        """Record that an exchange cannot go on."""
        text = f'buses.{bus}: {reason}'
        if misconfigured and self._misconfigured is not None:
            self._misconfigured.append(text)
        else:
            self._log.fatal(text)
            self._fatal(text)
