# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A node that uses the bridge as anybody does, and waits for what has to happen."""

from collections.abc import Callable
import itertools
import os
import re
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import Log, Parameter, ParameterEvent, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
import rclpy
from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.qos import DurabilityPolicy, qos_profile_parameters, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from service_handshake import shake_hands
import waiting

_COUNTER = itertools.count(1)
CLIENT = f'client_{os.getpid()}'
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
EVERYTHING = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
KEEP = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
WARN, ERROR = 30, 40

FIELDS = {
    ParameterType.PARAMETER_BOOL: 'bool_value', ParameterType.PARAMETER_INTEGER: 'integer_value',
    ParameterType.PARAMETER_DOUBLE: 'double_value',
    ParameterType.PARAMETER_STRING: 'string_value',
    ParameterType.PARAMETER_STRING_ARRAY: 'string_array_value',
}


def patience(seconds: float) -> float:
    """Return how long to wait at most: longer where somebody says that the machine is slow."""
    return seconds * float(os.environ.get('DRIVE_CAN_TEST_PATIENCE', '1'))


def wait_until(condition: Callable[[], Any], timeout: float = 60.0, what: str = '') -> Any:
    """Return what a condition gives as soon as it is true."""
    if waiting.virtual is not None:
        return waiting.virtual.until(condition, what, timeout)
    deadline = time.monotonic() + patience(timeout)
    while True:
        found = condition()
        if found:
            return found
        assert time.monotonic() < deadline, f'waited {timeout:g} s for {what or condition}'
        time.sleep(0.005)


def is_client(node: str) -> bool:
    """Tell whether the full name of a node is that of a client of this process."""
    return node.startswith(f'/{CLIENT}_')


class ClientContext:
    """A context and an executor for all clients of a test run."""

    def __init__(self) -> None:
        self.context = Context()
        rclpy.init(args=[], context=self.context, signal_handler_options=SignalHandlerOptions.NO)
        self.executor = SingleThreadedExecutor(context=self.context)
        self._ending = False
        self._thread = waiting.clock().worker(self._run, 'clients')
        self._thread.start()

    def _run(self) -> None:
        while not self._ending:
            try:
                self.executor.spin_once(timeout_sec=0.1)
            except InvalidHandle:
                pass    # a test destroyed something that rclpy was just looking at

    def close(self) -> None:
        """End."""
        self._ending = True
        self._thread.join()
        self.executor.shutdown()
        self.context.try_shutdown()


class Topic:
    """A subscription that keeps everything."""

    def __init__(self, subscription: Any, messages: list[Any]) -> None:
        self.subscription = subscription
        self.messages = messages

    @property
    def values(self) -> list[Any]:
        """The ``data`` of the messages."""
        return [message.data for message in list(self.messages)]

    @property
    def last(self) -> Any:
        """The last message, or None."""
        return self.messages[-1] if self.messages else None

    def wait(self, condition: Callable[[Any], Any] = lambda _: True, timeout: float = 60.0) -> Any:
        """Return the first message from now on that fulfils a condition."""
        start = len(self.messages)
        return wait_until(
            lambda: next((message for message in self.messages[start:] if condition(message)),
                         None), timeout, f'a message of {self.subscription.topic_name}; '
                                         f'last: {self.last}')


class Client:
    """A node with helpers. Callbacks run in a thread of their own."""

    def __init__(self, context: ClientContext) -> None:
        self._executor = context.executor
        self.node = rclpy.create_node(
            f'{CLIENT}_{next(_COUNTER)}', context=context.context,
            enable_rosout=False, start_parameter_services=False)
        self.full_name = self.node.get_fully_qualified_name()
        self._services: dict[str, Any] = {}
        self._publishers: dict[str, Any] = {}
        self._logs: Topic | None = None
        self._executor.add_node(self.node)

    def close(self) -> None:
        """Take the node out of the graph."""
        self._executor.remove_node(self.node)
        self.node.destroy_node()

    def nodes(self) -> list[str]:
        """Return the full names of all nodes in the graph."""
        return [f'{namespace.rstrip("/")}/{name}'
                for name, namespace in self.node.get_node_names_and_namespaces()]

    def find(self, bridge: Node, *names: str) -> None:
        """Wait until this node has found everything that nodes beside the bridge offer."""
        for name in names:
            for look in (Node.get_publisher_names_and_types_by_node,
                         Node.get_subscriber_names_and_types_by_node,
                         Node.get_service_names_and_types_by_node):
                wait_until(lambda name=name, look=look: self._sees(look, bridge, name),
                           what=f'all of {name}')

    def _sees(self, look: Callable[[Node, str, str], Any], bridge: Node, name: str) -> bool:
        try:
            found = look(self.node, name, bridge.get_namespace())
        except NodeNameNonExistentError:
            return False
        return bool(found == look(bridge, name, bridge.get_namespace()))

    # -- topics -----------------------------------------------------------------------------------

    def topic(self, name: str, message_type: Any, quality: QoSProfile = KEEP, *,
              publisher: bool = True) -> Topic:
        """Subscribe; wait until there is a publisher."""
        messages: list[Any] = []
        topic = Topic(self.node.create_subscription(message_type, name, messages.append, quality),
                      messages)
        if publisher:
            wait_until(lambda: self.node.count_publishers(topic.subscription.topic_name),
                       what=f'a publisher of {name}')
        return topic

    def latched(self, name: str, message_type: Any) -> Topic:
        """Subscribe to a topic of which the last message matters."""
        return self.topic(name, message_type, LATCHED)

    def publisher(self, name: str, message_type: Any, quality: QoSProfile = KEEP, *,
                  host: str = '') -> Any:
        """Return a publisher that a subscriber knows: that of the node ``host``, if renamed."""
        if name not in self._publishers:
            self._publishers[name] = self.node.create_publisher(message_type, name, quality)
            wait_until(self._publishers[name].get_subscription_count,
                       what=f'a subscriber of {name}')
            host = host or re.split('/command/|/joint_command', name)[0]
            if host != name:    # nothing is sent again to a subscriber that finds out later
                self._shake_hands(name, host)
        return self._publishers[name]

    def publish(self, name: str, message: Any) -> None:
        """Publish a message."""
        self.publisher(name, type(message)).publish(message)

    # -- services ---------------------------------------------------------------------------------

    def service(self, name: str, service_type: Any, host: str = '') -> Any:
        """Return a client of a service that is there; of the node ``host`` if it was renamed."""
        found = self._services.get(name)
        if found is None:
            found = self._services[name] = self.node.create_client(
                service_type, name, qos_profile=qos_profile_parameters)
            wait_until(found.service_is_ready, what=f'the service {name}')
            self._shake_hands(name, host)
        wait_until(found.service_is_ready, what=f'the service {name}')
        return found

    def _shake_hands(self, name: str, host: str) -> None:
        clock = waiting.clock()
        deadline = clock.now() + patience(60.0)

        def wait(condition: Callable[[], bool], seconds: float) -> bool:
            end = clock.now() + seconds
            while not condition() and clock.now() < end:
                assert clock.now() < deadline, f'no answer from the node of {name}'
                waiting.pause(0.002)
            return condition()
        shake_hands(self.node, name, wait, host)

    def ask(self, name: str, service_type: Any, request: Any = None, *, host: str = '') -> Any:
        """Call a service; return the future."""
        return self.service(name, service_type, host).call_async(
            request or service_type.Request())

    def call(self, name: str, service_type: Any, request: Any = None, *,
             timeout: float = 30.0, host: str = '') -> Any:
        """Call a service; return the answer."""
        future = self.ask(name, service_type, request, host=host)
        wait_until(future.done, timeout, f'the answer of {name}')
        return future.result()

    def get(self, node: str, *names: str) -> list[Any]:
        """Get parameters; None where not set."""
        answer = self.call(f'{node}/get_parameters', GetParameters,
                           GetParameters.Request(names=names))
        return [from_value(value) for value in answer.values]

    def set(self, node: str, **values: Any) -> list[tuple[bool, str]]:
        """Set parameters; a double underscore stands for a dot."""
        answer = self.call(f'{node}/set_parameters', SetParameters,
                           SetParameters.Request(parameters=to_messages(values)))
        return [(result.successful, result.reason) for result in answer.results]

    def set_atomically(self, node: str, **values: Any) -> tuple[bool, str]:
        """Set parameters in one go."""
        answer = self.call(
            f'{node}/set_parameters_atomically', SetParametersAtomically,
            SetParametersAtomically.Request(parameters=to_messages(values)))
        return answer.result.successful, answer.result.reason

    def transition(self, number: int = 0, label: str = '',
                   node: str = '/drive_can_bridge') -> bool:
        """Ask for a lifecycle transition."""
        request = ChangeState.Request()
        request.transition.id = number
        request.transition.label = label
        return bool(self.call(f'{node}/change_state', ChangeState, request).success)

    def state(self, node: str = '/drive_can_bridge') -> str:
        """Return the lifecycle state."""
        return str(self.call(f'{node}/get_state', GetState).current_state.label)

    # -- diagnostics, log, events -----------------------------------------------------------------

    def diagnostics(self, name: str, condition: Callable[[dict[str, str]], Any] = lambda _: True,
                    timeout: float = 60.0) -> dict[str, str]:
        """
        Return the keys of a status that fulfils a condition, from now on.

        ``level`` (OK, WARN, ERROR, STALE) and ``message`` are among them.
        """
        topic = self.topic('/diagnostics', DiagnosticArray)
        seen: list[dict[str, str]] = []

        def look() -> dict[str, str] | None:
            while topic.messages:
                for status in topic.messages.pop(0).status:
                    if status.name == name:
                        seen.append(facts(status))
                        if condition(seen[-1]):
                            return seen[-1]
            return None
        try:
            return dict(wait_until(look, timeout, f'diagnostics of {name}'))
        except AssertionError as error:
            raise AssertionError(f'{error}; last: {seen[-1] if seen else "none"}') from None
        finally:
            self.node.destroy_subscription(topic.subscription)

    def listen(self) -> None:
        """Begin to collect the log, as far back as it goes."""
        self._logs = self._logs or self.topic('/rosout', Log, EVERYTHING)

    def logged(self, level: int = WARN, node: str = '') -> list[str]:
        """Return the texts logged so far with at least this level."""
        self.listen()
        assert self._logs is not None
        return [message.msg for message in list(self._logs.messages)
                if message.level >= level and message.name.endswith(node)]

    def wait_logged(self, text: str, level: int = 0) -> str:
        """Return the first logged text that contains another."""
        self.listen()
        try:
            return str(wait_until(lambda: next(
                (line for line in self.logged(level) if text in line), '')))
        except AssertionError:
            raise AssertionError(f'not logged: {text}; but: {self.logged(0)}') from None

    def parameter_events(self, node: str) -> list[dict[str, Any]]:
        """Return a list that fills with the announced changes of a node."""
        found: list[dict[str, Any]] = []

        def receive(message: ParameterEvent) -> None:
            if message.node == node:
                found.append({entry.name: from_value(entry.value)
                              for entry in message.changed_parameters})
        topic = self.node.create_subscription(ParameterEvent, '/parameter_events', receive, KEEP)
        wait_until(lambda: any(
            f'{info.node_namespace.rstrip("/")}/{info.node_name}' == node
            for info in self.node.get_publishers_info_by_topic(topic.topic_name)),
            what='announcements')
        return found


def facts(status: Any) -> dict[str, str]:
    """Return a diagnostic status as a dictionary."""
    levels = {b'\0': 'OK', b'\1': 'WARN', b'\2': 'ERROR', b'\3': 'STALE'}
    return {**{pair.key: pair.value for pair in status.values},
            'level': levels[status.level], 'message': status.message}


def to_messages(values: dict[str, Any]) -> list[Parameter]:
    """Return parameter messages."""
    return [Parameter(name=name.replace('__', '.'), value=to_value(value))
            for name, value in values.items()]


def to_value(value: Any) -> ParameterValue:
    """Return a typed parameter value; None is NOT_SET, a message stays one."""
    if value is None or isinstance(value, ParameterValue):
        return value or ParameterValue()
    kind = {bool: ParameterType.PARAMETER_BOOL, int: ParameterType.PARAMETER_INTEGER,
            float: ParameterType.PARAMETER_DOUBLE, str: ParameterType.PARAMETER_STRING,
            list: ParameterType.PARAMETER_STRING_ARRAY}[type(value)]
    return ParameterValue(type=kind, **{FIELDS[kind]: value})


def from_value(value: ParameterValue) -> Any:
    """Return the Python value; None for NOT_SET."""
    field = FIELDS.get(value.type)
    found = None if field is None else getattr(value, field)
    return list(found) if value.type == ParameterType.PARAMETER_STRING_ARRAY else found
