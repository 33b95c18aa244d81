# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The ROS graph in the memory of one process, with a clock that jumps: what rcl and DDS do for rclpy.

It stands below rclpy, in place of its C extension (:func:`pretending`): nodes, executors, futures,
parameters and what else rclpy does in Python are rclpy's own. What is here behaves as the real
one does where a story looks at it: ``test_clocked_contract.py`` tells its stories to both.

What it leaves out: discovery takes no time, messages neither, and nothing is lost. Events of
quality of service happen to whoever asks for them: those of which rclpy itself writes to the log
would cost half of the time of each wait of an executor.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partialmethod
import itertools
import math
import os
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from jumping import JumpingClock, JumpingWakeEvent
from rcl_interfaces.msg import Log
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.impl.implementation_singleton import rclpy_implementation as real
from rclpy.logging import LoggingSeverity
from rclpy.qos import (
    DurabilityPolicy, HistoryPolicy, qos_profile_services_default, QoSPolicyKind, QoSProfile,
    ReliabilityPolicy,
)
from rclpy.type_support import check_is_valid_msg_type, check_is_valid_srv_type
from states import STATES, TRANSITIONS
import yaml

#: of whoever publishes the log (rcl's rcl_qos_profile_rosout_default)
ROSOUT = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
UNKNOWN_HISTORY = 3
#: libyaml, which takes a tenth of the time, where PyYAML has it
LOADER: Any = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
#: what can be waited for
KINDS = 'subscription', 'guard_condition', 'timer', 'client', 'service', 'event'
_POINTERS = itertools.count(0x1000, 0x10)


def _nothing(*_: object) -> None:
    pass


class Graph:
    """All contexts of a story; see there."""

    def __init__(self, clock: JumpingClock) -> None:
        self.clock = clock
        self.stamp = clock.stamp    # of the middleware, whatever a story shows the bridge
        self.nodes: list[Node] = []
        self.publishers: list[Publisher] = []
        self.subscriptions: list[Subscription] = []
        self.services: list[Service] = []
        self.clients: list[Client] = []
        self.levels: set[str] = set()
        self.written: list[str] = []    # lines of all logs
        self.tell: Callable[[str], None] = _nothing


class Destroyable:
    """Something that may be destroyed while it is in use, and then is at the end of that."""

    here: ClassVar[Graph]
    pointer = 0     # of each object another one

    def __init__(self) -> None:
        self.graph = self.here
        self.pointer = next(_POINTERS)
        self.gone = False
        self._unwanted = False
        self._users = 0

    def __enter__(self) -> None:
        if self._unwanted:
            raise real.InvalidHandle('cannot use Destroyable because destruction was requested')
        self._users += 1

    def __exit__(self, *_: object) -> None:
        self._users -= 1
        self._destroy_unused()

    def destroy_when_not_in_use(self) -> None:
        """Destroy it, or have it destroyed by its last user."""
        self._unwanted = True
        self._destroy_unused()

    def _destroy_unused(self) -> None:
        if self._unwanted and not self._users and not self.gone:
            self.gone = True
            self.destroy()

    def destroy(self) -> None:
        """Let go of what it has."""


class Context(Destroyable):
    """What ``rclpy.init`` makes of arguments."""

    def __init__(self, arguments: Sequence[str], domain: int) -> None:
        super().__init__()
        self.arguments = Arguments(arguments)
        self._domain = (int(os.environ.get('ROS_DOMAIN_ID') or 0)
                        if domain == real.RCL_DEFAULT_DOMAIN_ID else domain)
        self._valid = True

    def ok(self) -> bool:
        """Tell whether it has not been shut down."""
        return self._valid

    def shutdown(self) -> None:
        """End."""
        self._valid = False

    def get_domain_id(self) -> int:
        """Return the domain."""
        return self._domain


class Rule(NamedTuple):
    """A remap: of which node ('': any), from, to."""

    node: str
    match: str
    replacement: str


class Arguments:
    """What stands between ``--ros-args`` and ``--``."""

    def __init__(self, words: Sequence[str]) -> None:
        self.rules: list[Rule] = []
        self.files: list[Path] = []
        self.values: list[tuple[str, Any]] = []
        rest = iter(words)
        for word in rest:
            if word == '--ros-args':
                self._read(rest)

    def _read(self, words: Iterator[str]) -> None:
        for word in words:
            if word == '--':
                return
            if word == '--params-file':
                self.files.append(Path(next(words)))
            elif word in ('-p', '--param'):
                name, value = next(words).split(':=', 1)
                self.values.append((name, yaml.load(value, LOADER)))
            elif word in ('-r', '--remap'):
                match, replacement = next(words).split(':=', 1)
                node, colon, name = match.rpartition(':')
                self.rules.append(Rule(node if colon else '', name, replacement))

    def rule(self, node: str, *matches: str) -> str | None:
        """Return what a name of a node is replaced with."""
        return next((rule.replacement for rule in self.rules
                     if rule.node in ('', node) and rule.match in matches), None)

    def parameters(self, node: str) -> dict[str, Any]:
        """Return what files and arguments say of a node of this full name, by dotted name."""
        found: dict[str, Any] = {}
        for file in self.files:
            text = file.read_text(encoding='utf-8')
            for key, section in (yaml.load(text, LOADER) or {}).items():
                if _addresses(key, node):
                    _flatten(section['ros__parameters'], '', found)
        for name, value in self.values:
            found[name] = value
        return found


def _addresses(key: str, node: str) -> bool:
    """Tell whether a key of a parameter file means a node: ``**`` stands for any namespaces."""
    wanted, name = key.lstrip('/').split('/'), node.lstrip('/').split('/')
    if wanted[0] == '**':
        return wanted[1:] == name[len(name) - len(wanted) + 1:]
    return wanted in (name, ['*'])


def _flatten(tree: dict[str, Any], prefix: str, found: dict[str, Any]) -> None:
    for key, value in tree.items():
        if isinstance(value, dict):
            _flatten(value, f'{prefix}{key}.', found)
        else:
            found[f'{prefix}{key}'] = value


# -- nodes ----------------------------------------------------------------------------------------


class Node(Destroyable):
    """A node; see ``rcl_node_t``."""

    def __init__(self, name: str, namespace: str, context: Context, arguments: Any,
                 use_global: bool, rosout: bool, *_: Any) -> None:
        super().__init__()
        self.context = context
        sources = [Arguments(arguments)] if arguments else []
        self._arguments = [*sources, *([context.arguments] if use_global else [])]
        self.name = self._remapped(name, '__node', '__name') or name
        namespace = self._remapped(name, '__ns') or namespace or '/'
        self.namespace = namespace if namespace.startswith('/') else f'/{namespace}'
        for text, check in ((self.name, real.rclpy_get_validation_error_for_node_name),
                            (self.namespace, real.rclpy_get_validation_error_for_namespace)):
            if check(text) is not None:
                raise ValueError(f'invalid name: {text}')
        self.loggers = [self.logger_name()]
        self.rosout: Publisher | None = None
        self.graph.nodes.append(self)
        if rosout:
            check_is_valid_msg_type(Log)
            self.rosout = Publisher(self, Log, '/rosout', ROSOUT.get_c_qos_profile())

    def _remapped(self, node: str, *matches: str) -> str | None:
        return next((found for each in self._arguments
                     if (found := each.rule(node, *matches)) is not None), None)

    def destroy(self) -> None:
        """Leave the graph."""
        if self.rosout is not None:
            self.rosout.destroy_when_not_in_use()
        self.graph.nodes.remove(self)

    def check(self) -> None:
        """Raise what rcl does when the context is gone."""
        if not self.context.ok():
            raise real.RCLError("rcl node's context is invalid")

    def resolve(self, name: str, *, remap: bool = True) -> str:
        """Return the full name of a topic or service."""
        try:
            full = str(real.rclpy_expand_topic_name(name, self.name, self.namespace))
        except Exception as error:  # noqa: BLE001  rclpy makes its own of it
            raise real.RCLError(str(error)) from None
        return (self.remap(full) if remap else full)

    def remap(self, full: str) -> str:
        """Return what a full name is replaced with."""
        for arguments in self._arguments:
            for rule in arguments.rules:
                if (rule.node in ('', self.name) and not rule.match.startswith('__')
                        and self.resolve(rule.match, remap=False) == full):
                    return self.resolve(rule.replacement, remap=False)
        return full

    def get_node_name(self) -> str:
        """Return the name."""
        return self.name

    def get_namespace(self) -> str:
        """Return the namespace."""
        return self.namespace

    def get_fully_qualified_name(self) -> str:
        """Return both."""
        return f'{self.namespace.rstrip("/")}/{self.name}'

    def logger_name(self) -> str:
        """Return both with dots."""
        return self.get_fully_qualified_name().strip('/').replace('/', '.')

    def get_parameters(self, kind: Any) -> dict[str, Any]:
        """Return what was said of the node when the process began."""
        found: dict[str, Any] = {}
        for arguments in reversed(self._arguments):
            found |= arguments.parameters(self.get_fully_qualified_name())
        return {name: kind(name, value=value) for name, value in found.items()}

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        """Return all nodes."""
        self.check()
        return [(each.name, each.namespace) for each in self._peers(self.graph.nodes)]

    def get_count_publishers(self, name: str) -> int:
        """Return how many publish a topic."""
        return self._count(self.graph.publishers, name)

    def get_count_subscribers(self, name: str) -> int:
        """Return how many subscribe to it."""
        return self._count(self.graph.subscriptions, name)

    def get_count_services(self, name: str) -> int:
        """Return how many offer a service."""
        return self._count(self.graph.services, name)

    def _peers(self, those: Sequence[Any]) -> list[Any]:
        domain = self.context.get_domain_id()
        return [each for each in those if each.context.get_domain_id() == domain]

    def _count(self, those: Sequence[Any], name: str) -> int:
        self.check()
        return sum(each.full_name == name for each in self._peers(those))

    def types(self, *those: Sequence[Any], of: 'Node | None' = None) -> list[tuple[str, Any]]:
        """Return names and types of some entities, of one node or of all."""
        found: dict[str, set[str]] = {}
        for each in self._peers(list(itertools.chain(*those))):
            if of is None or each.node is of:
                found.setdefault(each.full_name, set()).add(each.type_name)
        return [(name, sorted(types)) for name, types in sorted(found.items())]

    def types_of(self, those: Sequence[Any], name: str, namespace: str) -> list[tuple[str, Any]]:
        """Return the same of a node by its name."""
        for node in self._peers(self.graph.nodes):
            if (node.name, node.namespace) == (name, namespace):
                return self.types(those, of=node)
        raise real.NodeNameNonExistentError('no such node')

    def about(self, those: Sequence[Any], name: str) -> list[dict[str, Any]]:
        """Return what there is of a topic."""
        return [each.about() for each in self._peers(those) if each.full_name == name]


class Entity(Destroyable):
    """What a node has in the graph, and an executor can wait for."""

    where: ClassVar[str]

    def __init__(self, node: Node, kind: Any, name: str, quality: Any) -> None:
        super().__init__()
        node.check()
        self.node = node
        self.context = node.context
        self.kind = kind
        try:
            self.full_name = node.resolve(name)
        except real.RCLError as error:
            raise ValueError(str(error)) from None
        self.quality = quality.to_dict()
        self.wake_events: set[JumpingWakeEvent] = set()
        self.type_name = _type_name(kind)
        getattr(self.graph, self.where).append(self)

    def destroy(self) -> None:
        """Leave the graph."""
        getattr(self.graph, self.where).remove(self)

    def get_logger_name(self) -> str:
        """Return the logger of the node."""
        return self.node.logger_name()

    def check(self, *, alone: bool = False) -> None:
        """Raise what rcl does when the entity is gone, or (not ``alone``) its context."""
        if self.gone or not (alone or self.context.ok()):
            raise real.RCLError(f'{type(self).__name__.lower()} is invalid')

    def peers(self, those: Sequence[Any]) -> list[Any]:
        """Return which of these it talks to, but for their quality."""
        domain = self.context.get_domain_id()
        return [each for each in those
                if each.full_name == self.full_name and each.type_name == self.type_name
                and each.context.get_domain_id() == domain]

    def ring(self) -> None:
        """Wake who waits for it."""
        for wake_event in self.wake_events:
            wake_event.ring()


def _type_name(kind: Any) -> str:
    package, group, _ = kind.__module__.split('.', 2)
    return f'{package}/{group}/{kind.__name__}'


# -- topics ---------------------------------------------------------------------------------------


class TopicEnd(Entity):
    """A publisher or a subscription."""

    offers: ClassVar[bool]

    def __init__(self, node: Node, kind: Any, name: str, quality: Any) -> None:
        super().__init__(node, kind, name, quality)
        if any(each.context is self.context and each.full_name == self.full_name
               and each.type_name != self.type_name
               for each in (*self.graph.publishers, *self.graph.subscriptions)):
            self.destroy_when_not_in_use()
            raise real.RCLError(f'{self.full_name}: existing topic name with incompatible type')
        #: how many others do not match, and by what
        self.misfits = 0
        self.told_misfits = 0
        self.misfit = QoSPolicyKind.INVALID
        self.events: set[JumpingWakeEvent] = set()

    def get_topic_name(self) -> str:
        """Return the full name."""
        return self.full_name

    def depth(self) -> int | None:
        """Return how many messages are kept; None: all."""
        if self.quality['history'] == HistoryPolicy.KEEP_ALL:
            return None
        return int(self.quality['depth']) or 1

    @property
    def latched(self) -> bool:
        """Whoever comes later gets what was."""
        return bool(self.quality['durability'] == DurabilityPolicy.TRANSIENT_LOCAL)

    def about(self) -> dict[str, Any]:
        """Return what others see of it."""
        return {'node_name': self.node.name, 'node_namespace': self.node.namespace,
                'topic_type': self.type_name,
                'topic_type_hash': {'version': 1, 'value': bytes(32)},
                'endpoint_type': 1 if self.offers else 2,
                'endpoint_gid': [*self.pointer.to_bytes(16, 'big')],
                'qos_profile': {**self.quality, 'depth': 0, 'history': UNKNOWN_HISTORY}}

    def meet(self, other: 'TopicEnd') -> None:
        """Note that there is another end of the topic, of another quality than we can do with."""
        publisher, subscription = (self, other) if self.offers else (other, self)
        reason = _misfit(publisher.quality, subscription.quality)
        if reason is not None:
            for end in (self, other):
                end.misfits += 1
                end.misfit = reason
                for wake_event in end.events:
                    wake_event.ring()


def _misfit(offered: dict[str, Any], requested: dict[str, Any]) -> QoSPolicyKind | None:
    if (offered['reliability'] == ReliabilityPolicy.BEST_EFFORT
            and requested['reliability'] == ReliabilityPolicy.RELIABLE):
        return QoSPolicyKind.RELIABILITY
    if (offered['durability'] == DurabilityPolicy.VOLATILE
            and requested['durability'] == DurabilityPolicy.TRANSIENT_LOCAL):
        return QoSPolicyKind.DURABILITY
    return None


class Publisher(TopicEnd):
    """See ``rcl_publisher_t``."""

    where, offers = 'publishers', True

    def __init__(self, node: Node, kind: Any, name: str, quality: Any) -> None:
        super().__init__(node, kind, name, quality)
        self.behind = 0     # ns, of the clock of its host
        self.kept: deque[tuple[bytes, int, int]] = deque(maxlen=self.depth())
        self._number = itertools.count(1)
        for each in self.peers(self.graph.subscriptions):
            self.meet(each)

    def publish(self, message: Any) -> None:
        """Publish a message."""
        self.publish_raw(bytes(real.rclpy_serialize(message, self.kind)))

    def publish_raw(self, data: bytes) -> None:
        """Publish the bytes of a message."""
        self.check()
        sample = bytes(data), self.graph.stamp() - self.behind, next(self._number)
        if self.latched:
            self.kept.append(sample)
        for each in self.peers(self.graph.subscriptions):
            if _misfit(self.quality, each.quality) is None:
                each.receive(sample)

    def get_subscription_count(self) -> int:
        """Return how many receive it."""
        self.check()
        return sum(_misfit(self.quality, each.quality) is None
                   for each in self.peers(self.graph.subscriptions))


class Subscription(TopicEnd):
    """See ``rcl_subscription_t``."""

    where, offers = 'subscriptions', False

    def __init__(self, node: Node, kind: Any, name: str, quality: Any,
                 content_filter: Any = None) -> None:
        super().__init__(node, kind, name, quality)
        self._queue: deque[tuple[bytes, dict[str, Any]]] = deque(maxlen=self.depth())
        for each in self.peers(self.graph.publishers):
            self.meet(each)
            if self.latched and each.latched and _misfit(each.quality, self.quality) is None:
                for sample in each.kept:
                    self.receive(sample)

    def receive(self, sample: tuple[bytes, int, int]) -> None:
        """Take what was published."""
        data, stamp, number = sample
        self._queue.append((data, {
            'source_timestamp': stamp, 'received_timestamp': self.graph.stamp(),
            'publication_sequence_number': number, 'reception_sequence_number': None}))
        self.ring()

    def ready(self) -> bool:
        """Tell whether something waits."""
        return bool(self._queue)

    def take_message(self, kind: Any, raw: bool) -> tuple[Any, dict[str, Any]] | None:
        """Take the oldest message that waits."""
        self.check(alone=True)
        if not self._queue:
            return None
        data, info = self._queue.popleft()
        return (data if raw else real.rclpy_deserialize(data, kind)), info

    def get_publisher_count(self) -> int:
        """Return how many it receives from."""
        self.check(alone=True)
        return sum(_misfit(each.quality, self.quality) is None
                   for each in self.peers(self.graph.publishers))


class EventHandle(Destroyable):
    """News of a topic's end; only those of quality ever come."""

    def __init__(self, parent: TopicEnd, kind: Any) -> None:
        super().__init__()
        self._parent = parent
        self._wanted = kind in (
            real.rcl_subscription_event_type_t.RCL_SUBSCRIPTION_REQUESTED_INCOMPATIBLE_QOS,
            real.rcl_publisher_event_type_t.RCL_PUBLISHER_OFFERED_INCOMPATIBLE_QOS)
        self._told = 0
        self.wake_events = parent.events

    def ready(self) -> bool:
        """Tell whether there is news."""
        return self._wanted and self._parent.misfits > self._told

    def take_event(self) -> Any:
        """Return the news."""
        class Status(NamedTuple):
            total_count: int
            total_count_change: int
            last_policy_kind: QoSPolicyKind
        total = self._parent.misfits if self._wanted else 0
        change, self._told = total - self._told, total
        return Status(total, change, self._parent.misfit)


# -- services -------------------------------------------------------------------------------------


class RequestId:
    """Which question it was, and whose."""

    sequence_number = 0     # of each object another one

    def __init__(self, client: 'Client', number: int) -> None:
        self.client = client
        self.sequence_number = number


class ServiceInfo:
    """What comes with a request or a response: the base, by which rclpy recognises it."""

    request_id: RequestId | None = None

    def __init__(self, request: RequestId, stamp: int) -> None:
        self.request_id = request
        self.source_timestamp = self.received_timestamp = stamp


class _Info(ServiceInfo):
    """One that nobody takes for the structure of C."""


class _ServiceEnd(Entity):
    """Has a queue of requests or responses."""

    def __init__(self, node: Node, kind: Any, name: str, quality: Any) -> None:
        super().__init__(node, kind, name, quality)
        self._queue: deque[tuple[bytes, RequestId]] = deque(maxlen=int(self.quality['depth']))

    def receive(self, data: bytes, request: RequestId) -> None:
        """Take a request or response."""
        self._queue.append((data, request))
        self.ring()

    def ready(self) -> bool:
        """Tell whether something waits."""
        return bool(self._queue)


class Service(_ServiceEnd):
    """See ``rcl_service_t``."""

    where = 'services'

    def __init__(self, node: Node, kind: Any, name: str, quality: Any) -> None:
        check_is_valid_srv_type(kind)
        super().__init__(node, kind, name, quality)
        self.name = self.full_name
        self.qos = self.quality

    def service_take_request(self, kind: Any) -> tuple[Any, Any]:
        """Take the oldest request that waits."""
        self.check(alone=True)
        if not self._queue:
            return None, None
        data, request = self._queue.popleft()
        return real.rclpy_deserialize(data, kind), _Info(request, self.graph.stamp())

    def service_send_response(self, response: Any, request: RequestId) -> None:
        """Answer; nobody gets the answer to one who has gone."""
        self.check()
        if not request.client.gone:
            request.client.receive(bytes(real.rclpy_serialize(response, self.kind.Response)),
                                   request)


class Responses:
    """In place of :class:`drive_can_bridge.ros.rcl.services.RclServices`."""

    def check(self, service: Any) -> None:
        """Every service can be served."""

    def take(self, service: Any, lost: Any) -> Any:
        """Take a request."""
        request, header = service.handle.service_take_request(service.srv_type.Request)
        return None if header is None else (request, header)

    def prepare(self, service: Any, message: Any, header: Any) -> Any:
        """Make an answer ready."""
        return _Response(service, message, header, bytes(id(header.request_id.client)
                                                         .to_bytes(16, 'big')))

    def send(self, response: Any) -> None:
        """Send it."""
        with response.service.handle:
            response.service.handle.service_send_response(response.message,
                                                          response.header.request_id)


class _Response(NamedTuple):
    service: Any
    message: Any
    header: Any
    caller: bytes


class Client(_ServiceEnd):
    """See ``rcl_client_t``."""

    where = 'clients'

    def __init__(self, node: Node, kind: Any, name: str, quality: Any) -> None:
        super().__init__(node, kind, name, quality)
        self.service_name = self.full_name
        self._number = itertools.count(1)

    def send_request(self, request: Any) -> int:
        """Ask all who offer it; return the number of the question."""
        self.check(alone=True)
        number = next(self._number)
        data = bytes(real.rclpy_serialize(request, self.kind.Request))
        for each in self.peers(self.graph.services):
            each.receive(data, RequestId(self, number))
        return number

    def take_response(self, kind: Any) -> tuple[Any, Any]:
        """Take the oldest response that waits."""
        if not self._queue:
            return None, None
        data, request = self._queue.popleft()
        return _Info(request, self.graph.stamp()), real.rclpy_deserialize(data, kind)

    def service_server_is_available(self) -> bool:
        """Somebody offers it."""
        self.check()
        return bool(self.peers(self.graph.services))


class TypeDescriptionService(Destroyable):
    """The service of each node that describes types; nobody asks it."""

    def __init__(self, node: Node) -> None:
        super().__init__()
        from type_description_interfaces.srv import GetTypeDescription
        self.impl = Service(node, GetTypeDescription, '~/get_type_description',
                            qos_profile_services_default.get_c_qos_profile())

    def destroy(self) -> None:
        """Leave the graph."""
        self.impl.destroy_when_not_in_use()


# -- waiting --------------------------------------------------------------------------------------


class GuardCondition(Destroyable):
    """Something that anybody may trigger."""

    def __init__(self, context: Context) -> None:
        super().__init__()
        self.wake_events: set[JumpingWakeEvent] = set()
        self.triggered = False

    def ready(self) -> bool:
        """Tell whether somebody did."""
        return self.triggered

    def trigger_guard_condition(self) -> None:
        """Do."""
        self.triggered = True
        for wake_event in self.wake_events:
            wake_event.ring()


class Timer(Destroyable):
    """A timer of the jumping clock."""

    def __init__(self, clock: 'Clock', context: Context, period: int, autostart: bool) -> None:
        super().__init__()
        self.wake_events: set[JumpingWakeEvent] = set()
        self._period = period
        self.next_call = self.graph.clock.now() + 1e-9 * period if autostart else math.inf

    def ready(self) -> bool:
        """Tell whether it is due."""
        return self.graph.clock.now() >= self.next_call

    is_timer_ready = ready

    def call_timer(self) -> None:
        """Note that it was served."""
        self.next_call += 1e-9 * self._period

    def call_timer_with_info(self) -> dict[str, int]:
        """Do that; return when it was due, and when it is, which versions of rclpy ask since 9."""
        due = round(1e9 * self.next_call)
        self.call_timer()
        return {'expected_call_time': due,
                'actual_call_time': round(1e9 * self.graph.clock.now())}

    def get_timer_period(self) -> int:
        """Return the period in ns."""
        return self._period

    def change_timer_period(self, period: int) -> None:
        """Change the period."""
        self._period = period


class WaitSet(Destroyable):
    """What a thread waits for."""

    def __init__(self, *_: object) -> None:
        super().__init__()
        self.clear_entities()

    def clear_entities(self) -> None:
        """Wait for nothing."""
        self._entities: dict[str, list[Any]] = {
            kind: [] for kind in KINDS}
        self._ready: dict[str, list[Any]] = {}

    def wait(self, timeout: int) -> None:
        """Wait until something is ready, or for so many ns; -1: for ever."""
        clock = self.graph.clock
        until = clock.now() + 1e-9 * timeout if timeout >= 0 else math.inf
        wake_event = clock.wake_event()
        everything = list(itertools.chain(*self._entities.values()))
        for entity in everything:
            entity.wake_events.add(wake_event)
        try:
            while not any(entity.ready() for entity in everything) and clock.now() < until:
                wake_event.wait(min(
                    [until, *(timer.next_call for timer in self._entities['timer'])]))
        finally:
            for entity in everything:
                entity.wake_events.discard(wake_event)
        self._ready = {kind: [entity for entity in those if entity.ready()]
                       for kind, those in self._entities.items()}
        for guard in self._ready['guard_condition']:
            guard.triggered = False

    def get_ready_entities(self, kind: str) -> list[int]:
        """Return the pointers of what is ready."""
        return [entity.pointer for entity in self._ready[kind]]

    def is_ready(self, kind: str, index: int) -> bool:
        """Tell whether one of them is."""
        return self._entities[kind][index] in self._ready[kind]

    def _add(self, kind: str, entity: Any) -> int:
        self._entities[kind].append(entity)
        return len(self._entities[kind]) - 1

    add_subscription = partialmethod(_add, 'subscription')
    add_guard_condition = partialmethod(_add, 'guard_condition')
    add_timer = partialmethod(_add, 'timer')
    add_client = partialmethod(_add, 'client')
    add_service = partialmethod(_add, 'service')
    add_event = partialmethod(_add, 'event')


class Clock(Destroyable):
    """A clock of rcl."""

    def __init__(self, kind: Any) -> None:
        super().__init__()
        self._kind = kind
        self._simulated: int | None = None
        self._active = False

    def get_now(self) -> Any:
        """Return the time."""
        clock = self.graph.clock
        if self._kind == real.ClockType.STEADY_TIME:
            nanoseconds = round(1e9 * clock.now())
        elif self._active:
            nanoseconds = self._simulated or 0
        else:
            nanoseconds = self.graph.stamp()
        return real.rcl_time_point_t(nanoseconds, int(self._kind))

    def get_ros_time_override_is_enabled(self) -> bool:
        """Tell whether time is simulated."""
        return self._active

    def set_ros_time_override_is_enabled(self, enabled: bool) -> None:
        """Begin or end that."""
        self._active = enabled

    def set_ros_time_override(self, time: Any) -> None:
        """Say what time it is."""
        self._simulated = time.nanoseconds


# -- lifecycle ------------------------------------------------------------------------------------


class LifecycleStateMachine(Destroyable):
    """The states of a managed node, and the services by which they are asked for and changed."""

    def __init__(self, node: Node, communication: bool) -> None:
        from lifecycle_msgs.msg import TransitionEvent
        from lifecycle_msgs.srv import (
            ChangeState, GetAvailableStates, GetAvailableTransitions, GetState,
        )
        super().__init__()
        quality = qos_profile_services_default.get_c_qos_profile()
        check_is_valid_msg_type(TransitionEvent)
        self._event = TransitionEvent
        self._events = Publisher(node, TransitionEvent, '~/transition_event', quality)
        (self.service_change_state, self.service_get_state, self.service_get_available_states,
         self.service_get_available_transitions, self.service_get_transition_graph) = self._all = [
            Service(node, kind, f'~/{name}', quality) for kind, name in (
                (ChangeState, 'change_state'), (GetState, 'get_state'),
                (GetAvailableStates, 'get_available_states'),
                (GetAvailableTransitions, 'get_available_transitions'),
                (GetAvailableTransitions, 'get_transition_graph'))]
        self.initialized = True
        self._state = 1

    def destroy(self) -> None:
        """Leave the graph."""
        for each in (self._events, *self._all):
            each.destroy_when_not_in_use()

    def __del__(self) -> None:
        self.destroy_when_not_in_use()

    @property
    def current_state(self) -> tuple[int, str]:
        """Number and label."""
        return self._state, STATES[self._state]

    @property
    def available_states(self) -> list[tuple[int, str]]:
        """All of them."""
        return list(STATES.items())

    @property
    def transition_graph(self) -> list[tuple[int, str, int, str, int, str]]:
        """All transitions: number, label, and from where to where."""
        return [(number, label, begin, STATES[begin], end, STATES[end])
                for number, label, begin, end in TRANSITIONS]

    @property
    def available_transitions(self) -> list[tuple[int, str, int, str, int, str]]:
        """Those from here."""
        return [each for each in self.transition_graph if each[2] == self._state]

    def get_transition_by_label(self, label: str) -> int:
        """Return the number of a transition from here."""
        return self._find(lambda each: each[1] == label)[0]

    def trigger_transition_by_id(self, number: int, _: bool) -> None:
        """Go."""
        self._go(self._find(lambda each: each[0] == number))

    def trigger_transition_by_label(self, label: str, _: bool) -> None:
        """Go."""
        self._go(self._find(lambda each: each[1] == label))

    def _find(self, wanted: Callable[[Any], bool]) -> tuple[int, str, int, str, int, str]:
        found = next(filter(wanted, self.available_transitions), None)
        if found is None:
            raise real.RCLError('Transition is not registered.')
        return found

    def _go(self, transition: tuple[int, str, int, str, int, str]) -> None:
        _, _, begin, begin_label, end, end_label = transition
        message = self._event()     # rcl leaves the transition itself out
        message.start_state.id, message.start_state.label = begin, begin_label
        message.goal_state.id, message.goal_state.label = end, end_label
        self._state = end
        self._events.publish(message)


# -- in place of the extension --------------------------------------------------------------------


def _log(graph: Graph, severity: Any, name: str, message: str, function: str = '', file: str = '',
         line: int = 0) -> None:
    """Write a line to standard error, as rcl does, and publish it."""
    real_log(severity, name, message, function, file, line)
    graph.tell(f'{name}: {message}')
    graph.written.append(f'[{LoggingSeverity(severity).name}] [{1e-9 * graph.stamp():.9f}] '
                         f'[{name}]: {message}')
    for node in graph.nodes:
        if node.rosout is not None and name in node.loggers and node.context.ok():
            seconds, nanoseconds = divmod(graph.stamp(), 10 ** 9)
            text = Log(level=int(severity), name=name, msg=message, file=file, function=function,
                       line=line)
            text.stamp.sec, text.stamp.nanosec = seconds, nanoseconds
            node.rosout.publish(text)
            return


def _sublogger(graph: Graph, parent: str, child: str) -> bool:
    for node in graph.nodes:
        if parent in node.loggers:
            node.loggers.append(f'{parent}.{child}')
            return True
    return False


def _asked_for(create: Callable[..., list[Any]]) -> Callable[..., list[Any]]:
    """Return what listens for those events only that somebody has asked for."""
    def created(callbacks: Any, *arguments: Any) -> list[Any]:
        callbacks.use_default_callbacks = False
        return create(callbacks, *arguments)
    return created


def _unregister(guard: Any, former: Any = real.unregister_sigint_guard_condition) -> None:
    """Leave alone what was never registered: executors may outlive their story."""
    if not isinstance(guard, GuardCondition):
        former(guard)


real.unregister_sigint_guard_condition = _unregister
real_log = real.rclpy_logging_rcutils_log
real_set_level = real.rclpy_logging_set_logger_level


@contextmanager
def pretending(clock: JumpingClock) -> Iterator[Graph]:
    """Put a graph in place of the one that is shared with other processes."""
    graph = Graph(clock)
    Destroyable.here = graph

    def set_level(name: str, level: Any, detailed: bool = False) -> None:
        graph.levels.add(name)
        real_set_level(name, level, detailed)
    names: dict[str, Any] = {
        kind.__name__: kind for kind in (
            Client, Clock, Context, EventHandle, GuardCondition, LifecycleStateMachine, Node,
            Publisher, Service, Subscription, Timer, TypeDescriptionService, WaitSet)}
    names |= {
        'rmw_request_id_t': RequestId, 'rmw_service_info_t': ServiceInfo,
        'rclpy_get_publisher_names_and_types_by_node':
            lambda node, _, *whose: node.types_of(graph.publishers, *whose),
        'rclpy_get_subscriber_names_and_types_by_node':
            lambda node, _, *whose: node.types_of(graph.subscriptions, *whose),
        'rclpy_get_service_names_and_types_by_node':
            lambda node, *whose: node.types_of(graph.services, *whose),
        'rclpy_get_client_names_and_types_by_node':
            lambda node, *whose: node.types_of(graph.clients, *whose),
        'rclpy_get_topic_names_and_types':
            lambda node, _: node.types(graph.publishers, graph.subscriptions),
        'rclpy_get_service_names_and_types': lambda node: node.types(graph.services),
        'rclpy_get_publishers_info_by_topic':
            lambda node, name, _: node.about(graph.publishers, name),
        'rclpy_get_subscriptions_info_by_topic':
            lambda node, name, _: node.about(graph.subscriptions, name),
        'rclpy_resolve_name':
            lambda node, name, only_expand, _: node.resolve(name, remap=not only_expand),
        'rclpy_remap_topic_name': lambda node, name: node.remap(name),
        'rclpy_logging_rcutils_log': lambda *words: _log(graph, *words),
        'rclpy_logging_rosout_add_sublogger': lambda *names: _sublogger(graph, *names),
        'rclpy_logging_set_logger_level': set_level,
        **dict.fromkeys((
            'register_sigint_guard_condition', 'install_signal_handlers',
            'rclpy_logging_configure', 'rclpy_logging_fini'),
            _nothing)}
    places: list[tuple[Any, str, Any]] = [
        *((real, name, value) for name, value in names.items()),
        *((kind, 'create_event_handlers', _asked_for(kind.create_event_handlers))
          for kind in (PublisherEventCallbacks, SubscriptionEventCallbacks))]
    former = [(owner, name, getattr(owner, name)) for owner, name, _ in places]
    for owner, name, value in places:
        setattr(owner, name, value)
    try:
        yield graph
    finally:
        for owner, name, value in former:
            setattr(owner, name, value)
        for name in graph.levels:
            real_set_level(name, 0, False)
