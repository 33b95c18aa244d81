# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A hidden node that attaches to all bridges there are, and fills the model.

It only subscribes and calls: no topic, no service, no parameter of its own. Everything
happens in :meth:`MonitorClient.poll`, in the thread that calls it.

:class:`ServiceOperations` is what a user may request of a drive through it: reads, writes, stops.
Nothing here can move one.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
import math
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log, ParameterDescriptor, ParameterEvent, ParameterType
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.qos import QoSProfile
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger

from drive_can_bridge.core.messages import together
from drive_can_bridge.core.parameters import Value, ValueKind
from drive_can_bridge.core.sentences import (
    may_still_be_running, no_answer_to_stop, nobody_answered, nobody_takes, write_not_confirmed)
from drive_can_bridge.core.text import is_ros_name, printable
from drive_can_bridge.monitor.model import Model
from drive_can_bridge.monitor.snapshot import OperationOutcome, Place, Status, StopAction
from drive_can_bridge.monitor.values import BUDGET, ParameterInfo, SamplingPlan
from drive_can_bridge.ros.client.calls import NodeCalls, Service
from drive_can_bridge.ros.client.client_node import ClientNode, HasEnd
from drive_can_bridge.ros.client.drive_commands import CONTROL_TIMEOUT, STOP_AGAIN, STOP_TIMEOUT
from drive_can_bridge.ros.client.foreign import why_not
from drive_can_bridge.ros.client.subscriptions import Inbox, log_quality, newest_quality
from drive_can_bridge.ros.messages import (
    drive_value, facts_of, limits_of, parameter_message, plain)
from drive_can_bridge.ros.rcl.quality import latched_quality
from drive_can_bridge.ros.recognition import bridges_among, drives_among

_KINDS = {ParameterType.PARAMETER_BOOL: ValueKind.BOOL,
          ParameterType.PARAMETER_INTEGER: ValueKind.INTEGER,
          ParameterType.PARAMETER_DOUBLE: ValueKind.DOUBLE}
_LEVELS = {getattr(Log, name): name
           for name in ('DEBUG', 'INFO', 'WARN', 'ERROR', 'FATAL')}
#: s for a read or write
PARAMETER_TIMEOUT = 15.0

#: service and request of each, s that the answer may take (it comes when the drive's status says
#: so) and after how many it is asked again; ``enable`` is asked for its false only
_STOPS: dict[StopAction, tuple[str, Any, Callable[[], Any], float, float]] = {
    StopAction.QUICK_STOP: ('quick_stop', Trigger, Trigger.Request, STOP_TIMEOUT, STOP_AGAIN),
    StopAction.DISABLE: ('enable', SetBool, lambda: SetBool.Request(data=False), CONTROL_TIMEOUT,
                         math.inf),
}
_UNASKED = OperationOutcome(False, nobody_answered())
_UNCONFIRMED = OperationOutcome(False, together([write_not_confirmed(), nobody_answered()]))


def stamp_of(message: Any) -> float:
    """Return the stamp of a message in s."""
    return float(message.sec + 1e-9 * message.nanosec)


def statuses(message: DiagnosticArray) -> list[Status]:
    """Return the entries of a diagnostic message."""
    return [Status(status.name, int.from_bytes(status.level, 'little'), status.message,
                   {pair.key: pair.value for pair in status.values})
            for status in message.status]


def values(message: ParameterEvent) -> list[tuple[str, Value]]:
    """Return names and values of a sample."""
    pairs = ((entry.name, drive_value(entry.value)) for entry in message.changed_parameters)
    return [(name, value) for name, value in pairs if value is not None]


def log_level(message: Log) -> str:
    """Return the level of a line of the log, as ROS names it."""
    return _LEVELS.get(message.level, str(message.level))


def parameter_info(message: ParameterDescriptor) -> ParameterInfo:
    """Return what a descriptor contains."""
    facts = facts_of(message)
    return ParameterInfo(
        printable(message.name), _KINDS.get(message.type) or _kind_told_by(facts),
        message.read_only, printable(message.description), *limits_of(message), facts)


def _kind_told_by(facts: Mapping[str, str]) -> ValueKind:
    """Return the kind of a parameter whose descriptor has no type: it has no value to show."""
    if 'scale' in facts or 'type' not in facts:
        return ValueKind.DOUBLE
    return ValueKind.BOOL if facts['type'] == 'bool' else ValueKind.INTEGER


#: s between two looks at the graph, which are not cheap
_GRAPH_PERIOD = 2.0
#: s after which an answer is not waited for any more
_CALL_TIMEOUT = 5.0
#: descriptors asked for at once
_BATCH = 200
_BITS_MAX = 256
#: drives that are asked for the first time, and topics and services that are made, in one look: on
#: a busy machine with hundreds of drives each takes DDS 0.1 s, and the user wants to see and stop
_ASKED_AT_ONCE, _MADE_AT_ONCE = 4, 16
_PLACE = ('bus', 'station', 'protocol', 'period')


class MonitorClient:
    """
    Fills a model.

    :param budget: messages per second to be sampled.
    :raises DriveCanError: ROS does not start.
    """

    def __init__(self, model: Model, *, budget: float = BUDGET) -> None:
        self._model = model
        self._node = ClientNode('monitor')
        self._now = 0.0
        self._plan = SamplingPlan(budget)
        self._inboxes = [
            Inbox(self._node, DiagnosticArray, '/diagnostics', QoSProfile(depth=50),
                  self._take_diagnostics),
            Inbox(self._node, Log, '/rosout', log_quality(), self._take_log)]
        self._online: dict[str, Inbox] = {}
        self._samples: dict[str, tuple[Inbox, Inbox]] = {}
        self._bits: dict[str, Inbox] = {}
        self._focus: frozenset[str] = frozenset()
        self._watched = True
        self._graph_at = 0.0
        self._calls = NodeCalls(self._node, _CALL_TIMEOUT)
        self._asked: set[str] = set()
        self._bridges_asked: set[str] = set()   # and have not answered yet

    # -- for the view -----------------------------------------------------------------------------

    @property
    def node(self) -> ClientNode:
        """The node, for further calls to drives."""
        return self._node

    @property
    def busy(self) -> bool:
        """Whether an answer is awaited: polling soon is worth it."""
        return self._calls.busy

    def focus(self, *drives: str) -> None:
        """Subscribe to all samples of drives, and to their bits."""
        if self._focus != set(drives):
            self._focus = frozenset(drives)
            self._graph_at = 0.0
            for topic in [topic for topic in self._bits
                          if not any(topic.startswith(f'{drive}/') for drive in drives)]:
                self._bits.pop(topic).close()

    def watch(self, wanted: bool) -> None:
        """Subscribe to samples, or to none while no view shows them."""
        self._watched = wanted

    def poll(self, now: float) -> None:
        """Handle what has arrived, and request what is missing."""
        self._now = now
        for inbox in (*self._inboxes, *self._online.values(), *self._bits.values()):
            inbox.look()
        for pair in self._samples.values():
            for inbox in pair:
                inbox.look()
        self._calls.look(now)
        self._follow()

    def glance(self, now: float) -> None:
        """Handle the samples of the drives in focus, and nothing else."""
        self._now = now
        for drive in self._focus & self._samples.keys():
            for inbox in self._samples[drive]:
                inbox.look()

    def close(self) -> None:
        """Leave the graph."""
        self._node.leave()

    # -- what arrives -----------------------------------------------------------------------------

    def _take_diagnostics(self, message: DiagnosticArray) -> None:
        self._model.diagnosed(statuses(message), stamp_of(message.header.stamp), self._now)

    def _take_log(self, message: Log) -> None:
        self._model.logged(stamp_of(message.stamp), log_level(message), message.name, message.msg)

    # -- what is asked for ------------------------------------------------------------------------

    def _follow(self) -> None:
        """Subscribe to what there is now, and to nothing else."""
        model, now = self._model, self._now
        _keep(self._online, model.drives, self._subscribe_online, Inbox.close)
        wanted = (self._plan.choose(model.rates(), self._focus, now) if self._watched
                  else frozenset())
        _keep(self._samples, self._by_interest(wanted), self._subscribe_samples, _close_all)
        model.sampled(self._samples, now)
        doubtful = set(model.doubtful(now)) - self._bridges_asked
        self._asked &= {*model.drives, *model.bridges} - doubtful - model.take_anew()
        for bridge in model.bridges:
            if bridge not in self._asked:
                self._ask_places(bridge)
        unasked = [drive for drive in model.drives if drive not in self._asked]
        for drive in self._by_interest(unasked)[:_ASKED_AT_ONCE]:
            self._ask_names(drive)
        if now >= self._graph_at:
            self._graph_at = now + _GRAPH_PERIOD
            self._notice()
            if self._focus:
                self._find_bits()

    def _by_interest(self, drives: Iterable[str]) -> list[str]:
        """Return drives, those in focus first."""
        return sorted(drives, key=lambda drive: drive not in self._focus)

    def _subscribe_online(self, drive: str) -> Inbox:
        def take(message: Bool) -> None:
            self._model.went_online(drive, message.data, self._now)
        return Inbox(self._node, Bool, f'{drive}/online', latched_quality(), take)

    def _subscribe_samples(self, drive: str) -> tuple[Inbox, Inbox]:
        def take_response(message: ParameterEvent) -> None:
            self._model.responded(drive, values(message), self._now)

        def take_request(message: ParameterEvent) -> None:
            self._model.requested(drive, values(message), self._now)
        return (Inbox(self._node, ParameterEvent, f'{drive}/response', newest_quality(),
                      take_response),
                Inbox(self._node, ParameterEvent, f'{drive}/request', newest_quality(),
                      take_request))

    def _notice(self) -> None:
        """Look for drives that their bridge has not reported: it hangs, or is slow."""
        services = self._node.services()
        self._model.noticed(drives_among(
            services, self._node.topics, bridges_among(services), set(self._model.drives)),
            self._now)

    def _find_bits(self) -> None:
        """Subscribe to the bits of drives: ``~/<parameter>/<bit>``."""
        for topic, types in self._node.topics():
            drive, _, below = topic.rpartition('/')
            drive, _, parameter = drive.rpartition('/')
            if (drive in self._focus and parameter != 'command'
                    and types == ['std_msgs/msg/Bool'] and topic not in self._bits
                    and len(self._bits) < _BITS_MAX):
                self._bits[topic] = self._subscribe_bit(drive, parameter, below)

    def _subscribe_bit(self, drive: str, parameter: str, bit: str) -> Inbox:
        def take(message: Bool) -> None:
            self._model.bit(drive, parameter, bit, message.data)
        return Inbox(self._node, Bool, f'{drive}/{parameter}/{bit}', latched_quality(), take)

    def _ask_places(self, bridge: str) -> None:
        """Read where a bridge's drives are, and how often it publishes diagnostics."""
        self._asked.add(bridge)
        self._bridges_asked.add(bridge)
        drives = self._model.drives_of(bridge)
        names = [f'drives.{drive.rpartition("/")[2]}.{key}' for drive in drives for key in _PLACE]

        def take(response: GetParameters.Response | None) -> None:
            self._bridges_asked.discard(bridge)
            if response is None:
                self._asked.discard(bridge)
                return
            found = iter(response.values)
            period = next(found, None)
            self._model.paced(bridge, math.nan if period is None else _number(period), self._now)
            for drive, (bus, station, protocol, period) in zip(drives, zip(*[found] * 4)):
                self._model.placed(drive, Place(
                    _text(bus), _text(station), _text(protocol), _number(period)))
        self._ask(bridge, 'get_parameters',
                  GetParameters.Request(names=['diagnostics_period', *names]), take)

    def _ask_names(self, drive: str) -> None:
        """Ask a drive what parameters it has, and then what they are."""
        self._asked.add(drive)

        def take(response: ListParameters.Response | None) -> None:
            if response is None:
                self._asked.discard(drive)
            elif response.result.names:
                self._ask_descriptors(drive, list(response.result.names), [])
        self._ask(drive, 'list_parameters', ListParameters.Request(), take)

    def _ask_descriptors(self, drive: str, names: list[str], known: list[ParameterInfo]) -> None:
        def take(response: DescribeParameters.Response | None) -> None:
            if response is None:
                self._asked.discard(drive)
                return
            found = [*known, *map(parameter_info, response.descriptors)]
            self._model.described(drive, found)
            if names[_BATCH:]:
                self._ask_descriptors(drive, names[_BATCH:], found)
        self._ask(drive, 'describe_parameters',
                  DescribeParameters.Request(names=names[:_BATCH]), take)

    def _ask(self, node: str, service: str, request: Any, done: Callable[[Any], None]) -> None:
        """Send a request; an earlier one to the same service is dropped."""
        self._calls.drop(node, service)
        if is_ros_name(node):
            self._calls.ask(node, service, request, done, self._now)


def _keep(have: dict[str, Any], wanted: Iterable[str], make: Callable[[str], Any],
          close: Callable[[Any], None]) -> None:
    """Make what is wanted and missing, only the first of it now; close what is not wanted."""
    names = dict.fromkeys(wanted)
    for name in have.keys() - names.keys():
        close(have.pop(name))
    for name in [name for name in names if name not in have][:_MADE_AT_ONCE]:
        have[name] = make(name)


def _close_all(inboxes: tuple[Inbox, ...]) -> None:
    for inbox in inboxes:
        inbox.close()


def _text(value: Any) -> str:
    found = plain(value)
    return '' if found is None else printable(str(found))


def _number(value: Any) -> float:
    found = drive_value(value)
    return math.nan if found is None else float(found)


class ServiceOperations:
    """
    Calls services of drives, through a monitor's node.

    :param node: of the monitor.
    """

    def __init__(self, node: HasEnd) -> None:
        self._node = node
        self._stops: dict[tuple[str, StopAction], Service] = {}
        self._calls = NodeCalls(node, PARAMETER_TIMEOUT)

    def poll(self, stops: Mapping[str, Collection[StopAction]], now: float) -> bool:
        """Handle the answers that have arrived; return whether any is still awaited."""
        wanted = [(drive, stop) for drive, each in stops.items() for stop in each]
        for gone in self._stops.keys() - set(wanted):
            if not self._stops[gone].busy:
                self._stops.pop(gone).close()
        for drive, stop in [each for each in wanted if each not in self._stops][:_MADE_AT_ONCE]:
            self._keep_at_hand(drive, stop)
        for service in self._stops.values():
            if service.busy:
                service.look(now)
        self._calls.look(now)
        return self._calls.busy or any(service.busy for service in self._stops.values())

    def _keep_at_hand(self, drive: str, stop: StopAction) -> Service:
        name, kind, _, patience, again = _STOPS[stop]
        made = Service(self._node, kind, f'{drive}/{name}', patience, again)
        self._stops[drive, stop] = made
        return made

    def stop(self, drive: str, stop: StopAction, done: Callable[[OperationOutcome], None],
             now: float) -> None:
        """Stop a drive, also one that no poll has reported yet."""
        name, _, request, patience, _ = _STOPS[stop]
        service = self._stops.get((drive, stop)) or self._keep_at_hand(drive, stop)

        def take(response: Any) -> None:
            if response is not None:
                done(OperationOutcome(response.success, printable(response.message)))
            else:
                done(OperationOutcome(False, may_still_be_running(
                    no_answer_to_stop(patience) if service.ready else nobody_takes(name))))
        service.send(request(), take, now, unasked=lambda: self._unasked(drive, take, done))

    def _unasked(self, drive: str, take: Callable[[Any], None],
                 done: Callable[[OperationOutcome], None]) -> None:
        reason = why_not(self._node, drive)
        if reason is None:
            take(None)
        else:
            done(OperationOutcome(False, may_still_be_running(reason)))

    def write(self, drive: str, name: str, value: Value, done: Callable[[OperationOutcome], None],
              now: float) -> None:
        """Write a parameter of a drive."""
        def take(response: SetParameters.Response | None) -> None:
            results = [] if response is None else response.results
            done(OperationOutcome(results[0].successful, printable(results[0].reason)) if results
                 else _UNCONFIRMED)
        self._ask(drive, 'set_parameters',
                  SetParameters.Request(parameters=[parameter_message(name, value)]), take, now,
                  lambda: done(_UNASKED if (reason := why_not(self._node, drive)) is None
                               else OperationOutcome(False, reason)))

    def read(self, drive: str, names: Sequence[str],
             done: Callable[[Sequence[Value | None]], None], now: float) -> None:
        """Read parameters of a drive; None: could not be read."""
        def take(response: GetParameters.Response | None) -> None:
            answers = [] if response is None else [drive_value(v) for v in response.values]
            done((answers + [None] * len(names))[:len(names)])
        self._ask(drive, 'get_parameters',
                  GetParameters.Request(names=list(names)), take, now, lambda: take(None))

    def _ask(self, drive: str, service: str, request: Any, take: Callable[[Any], None],
             now: float, unasked: Callable[[], None]) -> None:
        if is_ros_name(drive):
            self._calls.ask(drive, service, request, take, now, unasked=unasked)
        else:
            unasked()
