# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The bridge: a managed node that turns its parameters into buses, exchanges and drive nodes.

========== ====================================================================================
transition what happens
========== ====================================================================================
configure  parameters are checked, drives locked on this host, buses opened, drive nodes made;
           nothing is sent
activate   the exchange begins: mapping checks, then cyclic frames with neutral setpoints
deactivate three cycles with neutral setpoints (and ``disable``), then silence
cleanup    buses closed, drive nodes gone, locks released
shutdown   deactivate and cleanup as far as needed
========== ====================================================================================
"""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
import threading
from typing import Any

from lifecycle_msgs.msg import State
from rclpy.context import Context
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from drive_can_bridge.configuration.declare import identity_name
from drive_can_bridge.configuration.load import configuration_from_overrides
from drive_can_bridge.configuration.parameter_file import unseen_problems
from drive_can_bridge.configuration.problems import report
from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.core.errors import ConfigurationError
from drive_can_bridge.core.words import counted
from drive_can_bridge.exchange.exchange import BusExchange
from drive_can_bridge.exchange.one_master import BRIDGE, InUse, Ownership
from drive_can_bridge.exchange.stop import stop_all
from drive_can_bridge.process.scheduling import raise_priority
from drive_can_bridge.protocols.families import FAMILIES, make_sessions
from drive_can_bridge.ros.diagnostics import Diagnostics
from drive_can_bridge.ros.drive_node import DriveNode
from drive_can_bridge.ros.executor_thread import ExecutorThread
from drive_can_bridge.ros.flight_watch import FlightWatch
from drive_can_bridge.ros.joints import Joints
from drive_can_bridge.ros.log import Log
from drive_can_bridge.ros.node_parameters import NodeParameters
from drive_can_bridge.ros.periodic_thread import PeriodicThread
from drive_can_bridge.ros.service_thread import ServiceThread
from drive_can_bridge.ros.transition_guard import guard_transitions
from drive_can_bridge.transport import adapters
from drive_can_bridge.transport.link import steady_now

NODE_NAME = 'drive_can_bridge'
#: s that configure waits for the first attempt to open the buses, to report what can never work
FIRST_ATTEMPT_TIMEOUT = 3.0

SUCCESS = TransitionCallbackReturn.SUCCESS
FAILURE = TransitionCallbackReturn.FAILURE


class BridgeNode(LifecycleNode):
    """
    The managed node.

    :param spinner: serves this node and all drive nodes.
    :param fatal: takes the reason when the bridge cannot go on; from any thread.
    :param files: the parameter files that were given to this process.
    """

    def __init__(self, spinner: ExecutorThread, fatal: Callable[[str], None], *,
                 context: Context | None = None, files: Sequence[str] = (),
                 **options: Any) -> None:
        super().__init__(NODE_NAME, context=context, enable_logger_service=True,
                         start_parameter_services=False, **options)  # NodeParameters has them
        self.log = Log(self.get_logger())
        self._spinner = spinner
        self._fatal = fatal
        # now: later on, somebody may have edited or removed them
        self._unseen = unseen_problems(map(Path, files), self.get_fully_qualified_name())
        self._transition_lock = threading.RLock()
        self._control_thread = ServiceThread('control', self.context, self.log.error,
                                             raise_priority, share=1.0)
        self._parameter_thread = ServiceThread('parameters', self.context, self.log.error)
        self._diagnostics: Diagnostics | None = None
        self._flight: FlightWatch | None = None
        self._joints: Joints | None = None
        self._diagnostics_thread: PeriodicThread | None = None
        self._configuring = False
        self._ending = False
        self._misconfigured: list[str] = []
        self._priority = ''
        self._leaving: list[DriveNode] = []
        self._ownership: Ownership | None = None
        self.configuration: BridgeConfiguration | None = None
        self.exchanges: dict[str, BusExchange] = {}
        self.drives: dict[str, DriveNode] = {}
        self._node_parameters = NodeParameters(self, self._parameter_changed,
                                               self._parameter_refusal)
        guard_transitions(self, self.log.warning, self._transition_lock,
                          lambda: 'the bridge is being stopped' if self._ending else '')
        spinner.executor.add_node(self)

    # -- parameters -------------------------------------------------------------------------------

    @property
    def overrides(self) -> dict[str, Any]:
        """What parameter files and command line say, by dotted name."""
        return self._node_parameters.overrides

    @property
    def autostart(self) -> bool:
        """Configure and activate without being asked (anything but an explicit ``false``)."""
        return self.overrides.get('autostart', True) is not False

    @property
    def is_empty(self) -> bool:
        """No parameter file reached this node: neither buses nor drives."""
        return not any(name.startswith(('buses.', 'drives.')) for name in self.overrides)

    def _parameter_refusal(self, name: str, value: Any) -> str:
        drive = self._drive_of(name)
        if drive is not None and name.endswith('.rearm') and value == 'immediate':
            for setpoint in drive.session.setpoints.held:
                return (f'{setpoint.parameter.name} would jump: it has neutral_from, which needs '
                        f'rearm: neutral')
        return ''

    def _drive_of(self, name: str) -> DriveNode | None:
        return self.drives.get(name.rpartition('.')[0].removeprefix('drives.'))

    def _parameter_changed(self, name: str, value: Any) -> None:
        if name == 'diagnostics_period' and self._diagnostics_thread is not None:
            self._diagnostics_thread.set_period(float(value))
            return
        drive, key = self._drive_of(name), name.rpartition('.')[2]
        if drive is None:
            return
        if key == 'rearm':
            drive.exchange.reconfigure(drive.session, rearm_immediate=value == 'immediate')
        elif key in ('command_timeout', 'parameter_timeout'):
            drive.exchange.reconfigure(drive.session, **{key: float(value)})

    # -- transitions ------------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Check the parameters, open the buses, make the drive nodes."""
        return self._transition('configure', self._configure)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin the exchange."""
        return self._transition('activate', self._activate)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the drives safely."""
        return self._transition('deactivate', self._stop_drives)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Close the buses, remove the drive nodes."""
        return self._transition('cleanup', self._clean_up)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the drives safely if they run, then clean up."""
        def shut_down() -> None:
            self._stop_drives()
            self._clean_up()
        return self._transition('shutdown', shut_down)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Get back to a state from which configure works."""
        return self._transition('error processing', self._clean_up)

    def _transition(self, name: str, action: Callable[[], None]) -> TransitionCallbackReturn:
        # rclpy swallows exceptions in these callbacks; here they become one line and a failure
        try:
            action()
        except ConfigurationError as error:
            for problem in error.problems:
                self.log.error(problem)
            return FAILURE
        except Exception as error:  # noqa: BLE001  see above
            self.log.error(f'{name} failed: {type(error).__name__}: {error}')
            return TransitionCallbackReturn.ERROR
        return SUCCESS

    def _checked_configuration(self) -> BridgeConfiguration:
        """
        Check everything.

        :raises ConfigurationError: with all problems.
        """
        problems, garbled = map(report, self._unseen)
        if garbled:     # what else there is to be said would mislead
            raise ConfigurationError(garbled)
        try:
            configuration = configuration_from_overrides(self._node_parameters.current,
                                                         adapters=adapters)
        except ConfigurationError as error:
            raise ConfigurationError([*problems, *error.problems]) from None
        if problems:
            raise ConfigurationError(problems)
        return configuration

    def _configure(self) -> None:
        configuration = self._checked_configuration()
        if self.get_name() in configuration.drives:
            raise ConfigurationError([f'drives.{self.get_name()}: the name of the bridge itself '
                                      f'(remapped), allowed is another one'])
        for warning in configuration.warnings:
            self.log.warning(warning)
        self._node_parameters.declare(configuration)
        self.configuration = configuration
        self._misconfigured = []
        self._configuring = True
        try:
            self._lock(configuration)
            self._build(configuration)
            self._open(configuration)
        except BaseException:
            self._clean_up()
            raise
        finally:
            self._configuring = False

    def _lock(self, configuration: BridgeConfiguration) -> None:
        try:
            self._ownership = Ownership(
                [(bus, [drive for drive in configuration.drives.values() if drive.bus == name])
                 for name, bus in configuration.buses.items()],
                BRIDGE, 'a drive has one master: end it first')
        except InUse as error:
            raise ConfigurationError([str(error)]) from None

    def _build(self, configuration: BridgeConfiguration) -> None:
        flight = self._flight = FlightWatch(
            self, self.log, list(configuration.buses.values()), self._spinner)
        for bus in configuration.buses.values():
            drives = [drive for drive in configuration.drives.values() if drive.bus == bus.name]
            families = [FAMILIES[drive.protocol] for drive in drives]
            sessions = make_sessions(drives)
            claims = [family.claims(drive) for family, drive in zip(families, drives)]
            exchange = BusExchange(
                bus, sessions, [[claim.route for claim in entries if claim.heard]
                                for entries in claims], self,
                counted=[claim.route for entries in claims for claim in entries
                         if not claim.heard],
                prepare_thread=self._prepare_thread, note=flight.note_of(bus.name))
            flight.attach(exchange)
            self.exchanges[bus.name] = exchange
            for drive, session, family in zip(drives, sessions, families):
                node = DriveNode(
                    self, drive, session, family, exchange, self._spinner, self.log,
                    self._control_thread, self._parameter_thread,
                    partial(self._node_parameters.announce, identity_name(drive.name)))
                self.drives[drive.name] = node
                exchange.attach(session, node)
                node.serve()
        if any(drive.joint is not None for drive in configuration.drives.values()):
            self._joints = Joints(self, self.log, configuration, self.drives)

    def _open(self, configuration: BridgeConfiguration) -> None:
        for exchange in self.exchanges.values():
            exchange.open()
        deadline = steady_now() + FIRST_ATTEMPT_TIMEOUT
        for exchange in self.exchanges.values():
            exchange.link.wait_first_attempt(max(0.0, deadline - steady_now()))
        if self._misconfigured:
            raise ConfigurationError(self._misconfigured)
        self.log.info(self._priority)
        drives = list(self.drives.values())
        flight = self._flight
        self._diagnostics = Diagnostics(self, list(self.exchanges.values()), drives,
                                        None if flight is None else flight.reported)
        if flight is not None:
            flight.watch(drives)
        self._diagnostics_thread = PeriodicThread(
            'diagnostics', configuration.diagnostics_period, self._diagnostics.publish,
            lambda text: self.log.error(f'diagnostics: {text}'))
        self._diagnostics_thread.start()
        if self._joints is not None:
            self._joints.start()

    def _activate(self) -> None:
        for exchange in self.exchanges.values():
            exchange.activate()
        self.log.info(f'active: {counted(len(self.drives), "drive", "drives")} on '
                      f'{counted(len(self.exchanges), "bus", "buses")}')

    def _stop_drives(self) -> None:
        for bus, reason in stop_all(self.exchanges.values()).items():
            self.log.error(f'bus {bus}: the stop frames could not all be sent: {reason}')

    def _clean_up(self) -> None:
        if self._diagnostics_thread is not None:
            self._diagnostics_thread.stop()
            self._diagnostics_thread = None
        if self._diagnostics is not None:
            self._diagnostics.destroy()
            self._diagnostics = None
        for exchange in self.exchanges.values():
            exchange.close()
        if self._ownership is not None:
            self._ownership.release()
            self._ownership = None
        if self._joints is not None:
            self._joints.destroy()
            self._joints = None
        if self._flight is not None:
            self._flight.close()
            self._flight = None
        self._leaving += self.drives.values()
        self.exchanges.clear()
        self.drives.clear()
        self._dismiss()

    def _dismiss(self) -> None:
        """Take the drives out of the graph, each as soon as its last caller has an answer."""
        staying = []
        for drive in self._leaving:
            if drive.answer_all():
                drive.destroy()
            else:
                staying.append(drive)
        self._leaving = staying
        if staying:
            self._spinner.later(self._dismiss)

    # -- from the outside -------------------------------------------------------------------------

    def start(self, unwanted: Callable[[], bool] = lambda: False) -> bool:
        """
        Configure and activate; False when the configuration is wrong (it was logged).

        :param unwanted: nobody wants it any more: nothing is begun that would have to be stopped.
        """
        with self._transition_lock:
            if self.trigger_configure() is not SUCCESS:
                return False
            return unwanted() or self.trigger_activate() is SUCCESS

    def stop(self) -> None:
        """Stop the drives and publish a last diagnostic message; for the end of the process."""
        self._ending = True
        if self._transition_lock.acquire(timeout=5.0):
            try:
                self._stop_drives()
                if self._diagnostics is not None:
                    self._diagnostics.conclude()
            finally:
                self._transition_lock.release()

    def close(self) -> None:
        """Close what is open. The executor must have stopped."""
        self._clean_up()
        while self._leaving:
            self._leaving.pop().destroy()
        self._control_thread.stop()
        self._parameter_thread.stop()

    def destroy_node(self) -> None:
        """Take the node out of the graph, when everything is written that it had to say."""
        self.log.close()
        super().destroy_node()

    @property
    def is_active(self) -> bool:
        """In lifecycle state active."""
        return bool(self._state_machine.current_state[0] == State.PRIMARY_STATE_ACTIVE)

    @property
    def diagnostics(self) -> Diagnostics | None:
        """What reports on buses and drives, from configure to cleanup."""
        return self._diagnostics

    # -- from the exchanges (BusListener) ---------------------------------------------------------

    def _prepare_thread(self) -> None:
        """Make a thread of an exchange punctual."""
        self._priority = raise_priority()

    def bus_opened(self, bus: str) -> None:
        """Log it."""
        self.log.speaker(f'bus {bus}').info('open')

    def bus_lost(self, bus: str, reason: str) -> None:
        """Log it."""
        exchange = self.exchanges.get(bus)
        if exchange is not None:  # else it was given up while it was still being opened
            again = exchange.bus.reconnect_period
            self.log.speaker(f'bus {bus}').error(f'{reason}; tried again every {again:g} s')
        if self._flight is not None:
            self._flight.bus_lost(bus)

    def fatal(self, bus: str, reason: str, *, misconfigured: bool) -> None:
        """Take note that an exchange cannot go on."""
        text = f'buses.{bus}: {reason}'
        if misconfigured and self._configuring:
            self._misconfigured.append(text)
        else:
            self.log.fatal(text)
            self._fatal(text)
