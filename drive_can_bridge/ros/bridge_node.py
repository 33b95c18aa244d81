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

Parameter files give their values (``overrides``); once those are checked, every key is
declared with its value in effect, so that ``ros2 param get`` returns it. Four of them may be
changed while the bridge runs; all others are read-only and described so.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
import gc
from pathlib import Path
import shlex
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.context import Context
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.time_source import CLOCK_TOPIC

from drive_can_bridge.clock import Clock, Lock
from drive_can_bridge.configuration.load import (
    check_dynamic, configuration_from_file, configuration_from_overrides, declared_parameters)
from drive_can_bridge.configuration.parameter_file import directory_that_sets, unseen_problems
from drive_can_bridge.configuration.problems import report
from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import BridgeConfiguration, BusConfiguration
from drive_can_bridge.core.errors import ConfigurationError, DriveCanError
from drive_can_bridge.core.text import printable
from drive_can_bridge.exchange.exchange import BusExchange
from drive_can_bridge.memory import reserve
from drive_can_bridge.process.scheduling import raise_priority
from drive_can_bridge.ros.answers import ServiceAnswers
from drive_can_bridge.ros.bridge_runtime import BridgeRuntime
from drive_can_bridge.ros.diagnostics import Diagnostics
from drive_can_bridge.ros.drive_node import DriveNode
from drive_can_bridge.ros.joints import COMMANDS
from drive_can_bridge.ros.log import Log
from drive_can_bridge.ros.rcl import nodes, outgoing, waiting
from drive_can_bridge.ros.rcl.extension import look_for
from drive_can_bridge.ros.rcl.incoming import why_not_by_hand
from drive_can_bridge.ros.rcl.nodes import (
    AnsweringParameterServices, overrides, set_read_only, Transitions)
from drive_can_bridge.ros.rcl.relay import Relay
from drive_can_bridge.ros.rcl.services import RclServices
from drive_can_bridge.ros.rcl.unfit import Unfit
from drive_can_bridge.ros.recognition import (
    BRIDGES, bridges_among, drives_among, Entries)
from drive_can_bridge.ros.requests import ServiceRequests
from drive_can_bridge.ros.stamps import Stamps
from drive_can_bridge.ros.threads import ExecutorServices, ExecutorThread, ServiceThread
from drive_can_bridge.transport import adapters
from drive_can_bridge.transport.end_point import EndPoint

_OURS = ('drives.', 'buses.')
_OURS_ALONE = ('diagnostics_period', 'autostart')
NODE_NAME = 'drive_can_bridge'
#: s until it is looked again whether the callers of a drive that leaves have their answers
DISMISS_PAUSE = 0.005
#: s that these may take at the end of the process
LAST_ANSWERS = 0.5

SUCCESS = TransitionCallbackReturn.SUCCESS
FAILURE = TransitionCallbackReturn.FAILURE


class NodeParameters:
    """
    Declares, checks and passes on parameters. The node must have no parameter services of its own.

    :param changed: called with (name, value) of each changed parameter.
    :param refusal: returns why a valid value cannot be set now; '' if it can.
    :param current: returns a value that is computed on request; None: not one of these.
    """

    def __init__(self, node: Node, changed: Callable[[str, Any], None],
                 refusal: Callable[[str, Any], str], current: Callable[[str], Any]) -> None:
        self._node = node
        self._changed = changed
        self._refusal = refusal
        self._made = current
        self._dynamic: list[str] = []
        self._announcing = False
        node.declare_parameter(
            BRIDGES, [node.get_fully_qualified_name()], ParameterDescriptor(
                description='full names of all bridges that this one sees, its own among them',
                read_only=True), ignore_override=True)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)
        self._services = AnsweringParameterServices(node, self._prepare)

    @property
    def overrides(self) -> dict[str, Any]:
        """The values from parameter files and command line, by dotted name."""
        return {name: parameter.value
                for name, parameter in overrides(self._node).items()}

    @property
    def current(self) -> dict[str, Any]:
        """The same with later changes applied."""
        current = self.overrides
        for name in self._dynamic:
            current[name] = self._node.get_parameter(name).value
        return current

    def declare(self, configuration: BridgeConfiguration) -> None:
        """Declare every key of a configuration, or update its value, with new profiles."""
        for name, value, description, dynamic in declared_parameters(configuration):
            if self._node.has_parameter(name):
                if not dynamic:
                    self.announce(name, value)
                continue
            if dynamic:
                self._dynamic.append(name)
            self._node.declare_parameter(
                name, value, ParameterDescriptor(
                    description=description, read_only=not dynamic, dynamic_typing=True),
                ignore_override=True)

    def pass_on(self) -> None:
        """Pass on values that may have changed before their receivers existed."""
        for name in self._dynamic:
            self._changed(name, self._node.get_parameter(name).value)

    def _prepare(self, names: Sequence[str]) -> None:
        """Update computed values that are requested: reading the graph is not cheap."""
        if BRIDGES in names:
            self.announce(BRIDGES, self.bridges())
        for name in dict.fromkeys(names):
            made = self._made(name)
            if made is not None and self._node.has_parameter(name):
                self.announce(name, made)

    def bridges(self) -> list[str]:
        """Return the full names of all bridges that are seen; equal names are repeated."""
        return self._bridges_of(self._node.get_service_names_and_types())

    def around(self) -> tuple[list[str], list[str]]:
        """Return the same, and the full names of the drives that are seen around them."""
        services = self._node.get_service_names_and_types()
        bridges = self._bridges_of(services)
        return bridges, drives_among(
            services, self._node.get_topic_names_and_types, bridges, ())

    def _bridges_of(self, services: Entries) -> list[str]:
        seen = {self._node.get_fully_qualified_name(), *bridges_among(services)}
        return sorted(name for name in seen for _ in range(
            max(1, self._node.count_services(f'{name}/change_state'))))

    def get(self, request: Any, response: Any) -> Any:
        """Handle ``get_parameters`` for a caller by the local way. In the executor's thread."""
        return self._services.get(request, response)

    def announce(self, name: str, value: Any) -> None:
        """Change a read-only parameter to a value that the bridge itself has found."""
        if self._node.get_parameter(name).value == value:
            return
        self._announcing = True
        try:
            set_read_only(self._node, name, value)
        finally:
            self._announcing = False

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        if self._announcing:
            return SetParametersResult(successful=True)
        for parameter in parameters:
            if not parameter.name:  # rclpy would add one
                return SetParametersResult(successful=False, reason=sentences.nameless_parameter())
            if parameter.name.startswith(_OURS) or parameter.name in _OURS_ALONE:
                problem = (check_dynamic(parameter.name, parameter.value)
                           or self._refusal(parameter.name, parameter.value))
                if problem and self._node.has_parameter(parameter.name):
                    return SetParametersResult(successful=False, reason=problem)
        return SetParametersResult(successful=True)

    def _apply(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            self._changed(parameter.name, parameter.value)


class BridgeNode(LifecycleNode):
    """
    The managed node.

    :param spinner: serves this node and all drive nodes.
    :param fatal: called with the reason when the bridge cannot go on; from any thread.
    :param open_bus: opens a bus; None: python-can, by its configuration.
    :param files: the parameter files that were given to this process.
    """

    _own: ExecutorServices | None = None
    _ended = False

    def __init__(self, spinner: ExecutorThread, fatal: Callable[[str], None], clock: Clock, *,
                 context: Context | None = None,
                 open_bus: Callable[[BusConfiguration], EndPoint] | None = None,
                 files: Sequence[str] = (),
                 **options: Any) -> None:
        try:
            nodes.look()
        except Unfit as error:
            raise DriveCanError(sentences.rclpy_lacks(str(error))) from None
        self._stamps = Stamps(self.get_clock, lambda text: self.log.warning(text), clock)
        super().__init__(NODE_NAME, context=context, enable_logger_service=True,
                         start_parameter_services=False, **options)  # NodeParameters has them
        self._steady = clock      # the node has a clock of its own: ROS time
        self.log = Log(self.get_logger(), clock)
        voice = self.log.source('')
        try:
            nodes.look_at(self)
        except Unfit as error:
            self.destroy_node()
            raise DriveCanError(sentences.rclpy_lacks(str(error))) from None
        rcl, why_relayed = _rcl_services(self.services, self.context, self.log.warning)
        if why_relayed or why_not_by_hand():
            spinner.part()
        self._relayed = bool(why_relayed)
        self._answers = ServiceAnswers(rcl, voice.warn, clock)
        self._requests = ServiceRequests(rcl, voice.warning, voice.error, self.context, clock)
        self._open_bus = open_bus
        self._spinner = spinner
        self._fatal = fatal
        # now: the files may be edited or removed later
        self._unseen = unseen_problems(map(Path, files), self.get_fully_qualified_name())
        self._files = list(files)
        self._transition_lock = clock.lock()
        self._control_threads: dict[str, ServiceThread] = {}     # by bus
        self._parameter_thread = self._service_thread('parameters', spinner.of_drives)
        self._own_thread = self._service_thread('requests of the bridge', spinner)
        self._own = ExecutorServices(self._own_thread, spinner)
        self._ending = False
        _guard_transitions(self, self.log.warning, self._transition_lock,
                           lambda: sentences.being_stopped() if self._ending else '')
        self._own.adopt(self.services)
        self._leaving: list[DriveNode] = []
        self._runtime: BridgeRuntime | None = None
        self._node_parameters = NodeParameters(self, self._parameter_changed,
                                               self._parameter_refusal, self._made_parameter)
        spinner.executor.add_node(self)

    def _service_thread(self, name: str, spinner: ExecutorThread, *options: Any,
                        **more: Any) -> ServiceThread:
        return ServiceThread(name, self.context, self.log.error, self._steady, *options,
                             send=self._answers.send, take=self._requests.take,
                             relay=Relay(spinner.later) if self._relayed else None, **more)

    def create_service(self, *arguments: Any, **options: Any) -> Service:
        """Create a service whose requests and answers block no others."""
        service = super().create_service(*arguments, **options)
        if self._own is not None:   # else it is made by a base class, and adopted soon
            self._own.adopt([service])
        return service

    def destroy_service(self, service: Service) -> bool:
        """Destroy a service, as soon as its last answer is sent."""
        destroy = super().destroy_service
        if self._own is None or self._ended:
            return destroy(service)
        self._own.leave(service, partial(destroy, service))
        return True

    def create_subscription(self, msg_type: Any, topic: str, callback: Callable[[Any], None],
                            *arguments: Any, **options: Any) -> Subscription:
        """Create a subscription; that of the simulated clock is made by rclpy itself."""
        if topic == CLOCK_TOPIC:
            guarded = self._stamps.guarded(callback)
            # rclpy asks for the signature of a callback; one that is compiled has none
            return super().create_subscription(
                msg_type, topic, lambda message: guarded(message), *arguments, **options)
        return super().create_subscription(msg_type, topic, callback, *arguments, **options)

    # -- parameters -------------------------------------------------------------------------------

    @property
    def overrides(self) -> dict[str, Any]:
        """The values from parameter files and command line, by dotted name."""
        return self._node_parameters.overrides

    @property
    def autostart(self) -> bool:
        """Whether to configure and activate by itself (anything but an explicit ``false``)."""
        return self.overrides.get('autostart', True) is not False

    @property
    def is_empty(self) -> bool:
        """Whether no parameter file reached this node: neither buses nor drives."""
        return not any(name.startswith(('buses.', 'drives.')) for name in self.overrides)

    def _parameter_refusal(self, name: str, value: Any) -> str:
        runtime = self._runtime
        drive = None if runtime is None else runtime.drive_of(name)
        if drive is None:
            return ''
        with drive.exchange.entered() as entered:
            if not entered:
                return sentences.bus_hangs(drive.exchange.bus.name)
        if name.endswith('.rearm') and value == 'immediate':
            for setpoint in drive.session.setpoints.held:
                return sentences.rearm_would_jump(setpoint.parameter.name)
        return ''

    def _made_parameter(self, name: str) -> Any:
        runtime = self._runtime
        return None if runtime is None else runtime.made_parameter(
            name, self.resolve_topic_name(COMMANDS))

    def _parameter_changed(self, name: str, value: Any) -> None:
        runtime = self._runtime
        if runtime is not None:
            runtime.parameter_changed(name, value)

    # -- transitions ------------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Check the parameters, open the buses, make the drive nodes."""
        return self._transition('configure', self._configure)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start the exchange."""
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
            self.log.info(sentences.shut_down())
        return self._transition('shutdown', shut_down)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Return to a state from which configure works."""
        def stop_and_clean_up() -> None:
            try:
                self._stop_drives()     # activate may have failed when some had begun
            finally:
                self._clean_up()
        return self._transition('error processing', stop_and_clean_up)

    def _transition(self, name: str, action: Callable[[], None]) -> TransitionCallbackReturn:
        # rclpy swallows exceptions in these callbacks; here they become one line and a failure
        try:
            action()
        except ConfigurationError as error:
            for problem in error.problems:
                self.log.error(problem)
            return FAILURE
        except Exception as error:  # noqa: BLE001  see above
            self.log.error(sentences.transition_failed(
                name=name, kind=type(error).__name__, text=str(error)))
            return TransitionCallbackReturn.ERROR
        return SUCCESS

    def _checked_configuration(self) -> BridgeConfiguration:
        """
        Check everything.

        :raises ConfigurationError: with all problems.
        """
        problems, garbled = map(report, self._unseen)
        if garbled:     # the other problems would mislead
            raise ConfigurationError(garbled)
        try:
            configuration = configuration_from_overrides(
                self._node_parameters.current, adapters=adapters,
                namespace=self.get_namespace().rstrip('/'), setter=self._directory_that_sets)
        except ConfigurationError as error:
            lines = [sentences.command_names_lines(f'drive_can validate {shlex.quote(file)}')
                     for file in filter(_is_wrong, self._files)][:1]
            raise ConfigurationError([*problems, *error.problems, *lines]) from None
        if problems:
            raise ConfigurationError(problems)
        return configuration

    def _directory_that_sets(self, drive: str, profile: str) -> Path | None:
        return directory_that_sets(map(Path, self._files), self.get_fully_qualified_name(),
                                   ('drives', drive, 'profile'), profile)

    def _configure(self) -> None:
        configuration = self._checked_configuration()
        if self.get_name() in configuration.drives:
            raise ConfigurationError([f'drives.{self.get_name()}: the name of the bridge itself '
                                      f'(remapped), allowed is another one'])
        for warning in configuration.warnings:
            self.log.warning(warning)
        self._node_parameters.declare(configuration)
        self._runtime = BridgeRuntime(
            self, self.log, configuration, self._spinner, self._control_thread_of,
            self._parameter_thread, self._stamps, self._steady, open_bus=self._open_bus,
            announce=self._node_parameters.announce, seen=self._node_parameters.around,
            get=self._node_parameters.get, dismiss=self._dismiss, fatal=self._fatal)
        self._node_parameters.pass_on()     # since they are declared
        try:
            self._runtime.open()
        except BaseException:
            self._clean_up()
            raise

    def _control_thread_of(self, bus: str) -> ServiceThread:
        """Return the thread that serves the stops of a bus: one that hangs blocks no other's."""
        if bus not in self._control_threads:
            self._control_threads[bus] = self._service_thread(
                f'control {bus}', self._spinner.of_drives, _prepare_control, share=1.0)
        return self._control_threads[bus]

    def _activate(self) -> None:
        if self._runtime is not None:
            self._runtime.activate()

    def _stop_drives(self) -> None:
        if self._runtime is not None:
            self._runtime.stop()

    def _clean_up(self) -> None:
        runtime, self._runtime = self._runtime, None
        if runtime is not None:
            runtime.close()
            gc.collect()    # see scheduling.PASSES

    def _dismiss(self, drives: Iterable[DriveNode] = ()) -> None:
        """Remove drives from the graph, each as soon as its last caller has an answer."""
        self._leaving = [drive for drive in (*self._leaving, *drives) if not _gone(drive)]
        if self._leaving:   # those that answer need the interpreter meanwhile
            self._steady.wait(self._steady.now() + DISMISS_PAUSE)
            self._spinner.later(self._dismiss)

    # -- from the outside -------------------------------------------------------------------------

    def start(self, unwanted: Callable[[], bool] = lambda: False) -> bool:
        """
        Configure and activate; False when the configuration is wrong (it was logged).

        :param unwanted: it is not wanted any more: nothing is started that would have to be
            stopped.
        """
        with self._transition_lock:
            if self.trigger_configure() is not SUCCESS:
                return False
            return unwanted() or self.trigger_activate() is SUCCESS

    def stop(self) -> None:
        """Stop the drives and publish a last diagnostic message; for the end of the process."""
        self._ending = True
        # a transition under way may take longer, such as a stop by unacknowledged writes
        alone = self._transition_lock.acquire(timeout=5.0)
        try:
            self._stop_drives()
            if self._runtime is not None:
                self._runtime.diagnostics.conclude()
        finally:
            if alone:
                self._transition_lock.release()

    def close(self) -> None:
        """Close what is open. The executor must have stopped."""
        self._clean_up()
        until = self._steady.now() + LAST_ANSWERS
        while self._leaving and self._steady.now() < until:
            self._dismiss()
        while self._leaving:
            self._leaving.pop().destroy()
        for thread in self._control_threads.values():
            thread.stop()
        self._parameter_thread.stop()
        self._own_thread.stop()
        self._ended = True
        self._requests.stop()
        self._answers.stop()

    def destroy_node(self) -> None:
        """Destroy the node, after its log is written."""
        self.log.close()
        self._ended = True      # rclpy goes on until no service is left
        super().destroy_node()

    @property
    def configuration(self) -> BridgeConfiguration | None:
        """The configuration in effect, from configure to cleanup."""
        return None if self._runtime is None else self._runtime.configuration

    @property
    def exchanges(self) -> Mapping[str, BusExchange]:
        """The buses by name, from configure to cleanup."""
        return {} if self._runtime is None else self._runtime.exchanges

    @property
    def drives(self) -> Mapping[str, DriveNode]:
        """The drives by name, from configure to cleanup."""
        return {} if self._runtime is None else self._runtime.drives

    @property
    def diagnostics(self) -> Diagnostics | None:
        """The diagnostics of buses and drives, from configure to cleanup."""
        return None if self._runtime is None else self._runtime.diagnostics


def _prepare_control() -> None:
    """Raise the thread's priority, and reserve its memory, so that stops are served at once."""
    raise_priority()
    reserve()


def _rcl_services(services: Iterable[Service], context: Context,
                  warn: Callable[[str], None]) -> tuple[RclServices | None, str]:
    """
    Choose how requests are taken, and answers sent, by what this rclpy has.

    Any other way than the best logs a warning.

    :return: direct access to rcl, or None; and why not even a wait set is of use, but only the
        executor; '': it is.
    """
    for reason in why_not_by_hand(), outgoing.why_not_straight():
        if reason:
            warn(sentences.commands_by_executor(reason))
    try:
        waiting.look(context)
        try:
            rcl = RclServices()
            for service in services:
                rcl.check(service)
            return rcl, ''
        except Unfit as error:
            look_for(['Service.service_take_request'])
            warn(sentences.requests_hold_up(str(error)))
    except Unfit as error:
        warn(sentences.requests_by_executor(str(error)))
        return None, str(error)
    return None, ''


def _gone(drive: DriveNode) -> bool:
    """Destroy a drive's node, unless a caller waits for its answer; return whether it was."""
    if drive.answer_all():
        drive.destroy()
        return True
    return False


def _is_wrong(file: str) -> bool:
    """Return whether a parameter file itself has problems."""
    try:
        configuration_from_file(file, adapters=adapters)
    except ConfigurationError:
        return True
    except OSError:     # the file was removed, and its lines with it
        pass
    return False


def _guard_transitions(node: LifecycleNode, warn: Callable[[str], None], lock: Lock,
                      refusal: Callable[[], str]) -> None:
    """
    Answer an illegal lifecycle transition instead of ending on it.

    rclpy lets the error of an illegal transition escape from the service's callback, and so from
    the executor: any client could end the process. Here it becomes a failure and a warning, before
    rcl is asked, which would have a warning of its own.

    :param warn: logs what is wrong with a transition.
    :param lock: is held during a transition.
    :param refusal: why none is possible any more; '' otherwise.
    """
    transitions = Transitions(node)

    def guarded(change_state: Callable[[Any, Any], Any], request: Any, response: Any) -> Any:
        number, label = request.transition.id, request.transition.label
        with lock:
            # of a request with both, rclpy uses the label
            possible = transitions.possible
            why = refusal()
            if not why and (label not in possible.values() if label else number not in possible):
                why = sentences.possible_are(list(possible.values()) or ['none'])
            if not why:
                try:
                    return change_state(request, response)
                except RuntimeError as error:
                    why = printable(' '.join(str(error).split()))
            warn(sentences.transition_impossible(
                printable(label) or f'number {number}', transitions.state, why))
            response.success = False
            return response

    transitions.guard(guarded)
