# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A setpoint held for a while through the bridge, by the topic that any node could use.

Neutral until the setpoint is armed, the value, neutral until the bridge has sent that. From the
first sign of a fault the value is never published again. What the
bridge sends is seen on ``~/request``, that the drive answers on ``~/response``; other publishers
are asked of the bridge, because a process that has just started does not know the graph.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
import json
import math
from typing import Any, NamedTuple

from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import DescribeParameters, GetParameters
from std_msgs.msg import Bool, Float64, Int64

from drive_can_bridge.client.bridge import parameter_of
from drive_can_bridge.client.ros_way import described
from drive_can_bridge.core import sentences
from drive_can_bridge.core.errors import DriveCanError, ValueRefused, WhichBridge
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.parameters import Parameter, Value, ValueKind
from drive_can_bridge.core.text import printable, UNNAMED_NODE, value_text
from drive_can_bridge.ros.client.calls import NodeCalls
from drive_can_bridge.ros.client.graph import Graph
from drive_can_bridge.ros.client.search import find_drives
from drive_can_bridge.ros.client.subscriptions import (
    Inbox, NewestPublisher, undemanding_quality)
from drive_can_bridge.ros.messages import drive_value, value_of
from drive_can_bridge.ros.rcl.quality import latched_quality
from drive_can_bridge.ros.recognition import namespace_of

#: commands a second, and how many of them at least within ``command_timeout``
RATE, IN_TIMEOUT = 20.0, 4
#: s: the longest ``command_timeout`` with which a drive is held by a process that may die
LONGEST_TIMEOUT = 2.0
#: s until the setpoint is armed; until what is published is sent; until neutral was answered
ARMING_TIMEOUT, TAKING_TIMEOUT, NEUTRAL_TIMEOUT = 5.0, 1.0, 2.0
#: s without anything from the bridge, which is asked all the time and publishes once a second
SILENCE = 2.0
#: s between two questions to the bridge: whether it is armed, and which others command
ASK_PERIOD = 0.1
#: s that an answer of the bridge may take
ANSWER_TIMEOUT = 5.0
#: states of diagnostics in which a drive can be commanded
READY = ('online', 'not armed')

_TYPES: dict[ValueKind, Any] = {
    ValueKind.DOUBLE: Float64, ValueKind.INTEGER: Int64, ValueKind.BOOL: Bool}


class JogRefused(DriveCanError):
    """The setpoint cannot be moved, with the reason; nothing was published."""


class JogOutcome(NamedTuple):
    """
    The outcome of holding a setpoint.

    :param ok: an answered exchange carried the value, and a later one neutral.
    """

    ok: bool
    text: Sentence


@dataclass(frozen=True, slots=True)
class Target:
    """
    The setpoint to be moved, and its value.

    :param node: full name of the drive.
    :param shown: the actual values of the drive, for people.
    :param timeout: its ``command_timeout`` in s.
    """

    bridge: str
    node: str
    parameter: Parameter
    neutral: Value
    value: Value
    timeout: float
    shown: tuple[Parameter, ...]

    @property
    def topic(self) -> str:
        """The topic of its commands."""
        return f'{self.node}/command/{self.parameter.name}'

    @property
    def period(self) -> float:
        """The seconds from command to command."""
        return min(1.0 / RATE, self.timeout / IN_TIMEOUT)

    def in_words(self, value: Value) -> str:
        """Return a value with its unit."""
        return with_unit(self.parameter, value)


def with_unit(parameter: Parameter, value: Value) -> str:
    """Return a value as people write it."""
    return f'{value_text(value)} {parameter.unit}'.rstrip()


def find_target(graph: Graph, namespace: str | None, drive: str, name: str | None,
                value: str) -> Target:
    """
    Return the setpoint that is meant, or refuse what must not be moved like this.

    :param drive: its name, or its full name.
    :param name: of the setpoint; None: the only one there is.
    :param value: as it was typed.
    :raises JogRefused: it cannot be done.
    :raises DriveCanError: no bridge, or none that answers.
    """
    place = namespace_of(drive) if drive.startswith('/') else namespace
    bridges = find_drives(graph, place)
    short = drive.rpartition('/')[2]
    if short not in bridges:
        raise WhichBridge(sentences.no_drive_there(
            repr(drive), ', '.join(bridges) or 'none'))
    bridge = bridges[short]
    node = f'{namespace_of(bridge)}/{short}'
    prefix = f'drives.{short}.'
    text, others, timeout, response = _values(graph, bridge, [
        f'{prefix}{key}' for key in (
            'setpoints', 'commanders', 'command_timeout', 'cyclic_response')])
    setpoints = _read(text)
    if setpoints is None:
        raise JogRefused(sentences.jog_not_told())
    chosen = _choose(setpoints, name, node)
    parameter, *shown = _described(graph, node, [chosen['name'], *(response or ())])
    wanted = _parsed(parameter, value)
    if not 0.0 < timeout <= LONGEST_TIMEOUT:
        raise JogRefused(sentences.jog_timeout(timeout=timeout, longest=LONGEST_TIMEOUT,
                                               drive=short))
    facts = graph.newest_status(f'{bridge.lstrip("/")}: drive {short}', age=0.5, patience=5.0)
    state = facts.get('state', 'unknown')
    if state not in READY:
        raise JogRefused(_why_not_ready(state, facts, node.lstrip('/')))
    who = list(_others(others, graph.client_node.full_name))
    if who:
        raise JogRefused(sentences.jog_commanded(who=who))
    return Target(bridge, node, parameter, chosen['neutral'], wanted, float(timeout), tuple(shown))


def _why_not_ready(state: str, facts: Mapping[str, str], drive: str) -> Sentence:
    """Return what keeps a drive from being moved, and what to type about it."""
    if state == 'fault':
        # without a control word it cannot be reset from here
        reset = (f'drive_can reset {drive}' if 'control_state' in facts
                 else str(sentences.reset_at_drive()))
        return sentences.jog_fault(fault=printable(facts.get('fault_code', '')), reset=reset)
    advice = f'drive_can enable {drive}' if state == 'disabled' else ''
    return sentences.jog_not_ready(state=printable(state), advice=advice)


def _values(graph: Graph, node: str, names: Sequence[str]) -> list[Any]:
    answer = graph.call(node, 'get_parameters', GetParameters.Request(names=list(names)),
                        ANSWER_TIMEOUT)
    if len(answer.values) != len(names):    # rclpy returns nothing where one name is unknown
        raise JogRefused(sentences.jog_not_told())
    return [value_of(value) for value in answer.values]


def _read(text: Any) -> list[dict[str, Any]] | None:
    """Return the setpoints in a parameter of the bridge; None: it has none."""
    try:
        return [each for each in json.loads(text) if isinstance(each['name'], str)]
    except (TypeError, ValueError, KeyError):
        return None


def _choose(setpoints: Sequence[dict[str, Any]], name: str | None, node: str) -> dict[str, Any]:
    """Return the setpoint that is meant."""
    moving = [each for each in setpoints if not each.get('limit')]
    if name is None and len(moving) != 1:
        raise JogRefused(sentences.jog_which(names=[each['name'] for each in moving]) if moving
                         else sentences.jog_no_setpoint())
    chosen = moving[0] if name is None else next(
        (each for each in setpoints if each['name'] == name), None)
    if chosen is None:
        raise JogRefused(sentences.jog_unknown(name=name, names=[each['name'] for each in moving]))
    topic = f'{node}/command/{chosen["name"]}'
    if chosen.get('limit'):
        raise JogRefused(sentences.jog_limit(name=chosen['name'], topic=topic))
    if 'neutral' not in chosen:
        raise JogRefused(sentences.jog_position(name=chosen['name'], topic=topic))
    return chosen


def _described(graph: Graph, node: str, names: Sequence[str]) -> list[Parameter]:
    """Return parameters of a drive; the first of them exists."""
    answer = graph.call(node, 'describe_parameters', DescribeParameters.Request(
        names=list(names)), ANSWER_TIMEOUT)
    found = [parameter_of(described(each)) for each in answer.descriptors]
    if not found or found[0] is None:
        raise JogRefused(sentences.jog_not_told())
    return [each for each in found if each is not None]


def _parsed(parameter: Parameter, text: str) -> Value:
    """Return a value as a command of this type carries it, checked as the bridge will."""
    value: Value
    if text.lower() in ('true', 'false'):
        value = text.lower() == 'true'
    else:
        number = float(text)
        value = int(number) if parameter.kind is ValueKind.INTEGER and number.is_integer() \
            else number
    try:
        parameter.raw_from_value(value)
    except ValueRefused as error:
        raise JogRefused(error.sentence) from None
    return value


class Jog:
    """
    Holds one setpoint for a while.

    :param seconds: how long the value is published.
    :param stopped: returns whether to end; called before each command.
    :ivar values: actual values of the drive, by name.
    """

    def __init__(self, graph: Graph, target: Target, seconds: float,
                 stopped: Callable[[], object]) -> None:
        node = graph.client_node
        self.values: dict[str, Value] = {}
        self._graph, self._target, self._seconds = graph, target, seconds
        self._stopped = stopped
        self._own_name = node.full_name
        self._calls = NodeCalls(node, ANSWER_TIMEOUT)
        self._message_type = _TYPES[target.parameter.kind]
        any_publisher = undemanding_quality()
        self._inboxes = (
            Inbox(node, ParameterEvent, f'{target.node}/request', any_publisher,
                  self._take_request),
            Inbox(node, ParameterEvent, f'{target.node}/response', any_publisher,
                  self._take_response),
            Inbox(node, Bool, f'{target.node}/online', latched_quality(), self._take_online),
            Inbox(node, self._message_type, target.topic, any_publisher, self._take_command))
        self._out = NewestPublisher(node, self._message_type, target.topic)
        self._phase, self._since = _Phase.ARMING, graph.now()
        self._heard_at = self._since        # something of the bridge
        self._published_at = self._due = self._ask_at = -math.inf
        self._asking = self._armed = False
        self._sent: Value | None = None     # by the bridge, as its last message shows
        self._sent_at = self._answers = 0   # ns; answers to exchanges that may have carried it
        self._value_answered = self._neutral_answered = False
        self._why: Sentence | None = None

    def run(self, show: Callable[[float], object]) -> JogOutcome:
        """
        Hold the value, and return when neutral was sent.

        :param show: called again and again with the s for which the value is published.
        """
        try:
            self._graph.wait(lambda now: self._look(now, show), math.inf)
        except BaseException:   # whatever it is: not with the value as the last command
            self._out.publish(self._message_type(data=self._target.neutral))
            raise
        value = self._target.in_words(self._target.value)
        if self._why is not None:
            return JogOutcome(False, self._why)
        if not self._value_answered:
            return JogOutcome(False, sentences.jog_unanswered(value=value))
        if not self._neutral_answered:
            silent = self._graph.now() - self._heard_at > 0.5 * SILENCE
            return JogOutcome(False, sentences.jog_bridge_silent(0.5 * SILENCE) if silent else
                              sentences.jog_neutral_unseen())
        return JogOutcome(True, sentences.jog_done(value=value))

    def close(self) -> None:
        """Destroy the publisher and the subscriptions."""
        for part in (*self._inboxes, self._out):
            part.close()

    # -- inside -----------------------------------------------------------------------------------

    def _look(self, now: float, show: Callable[[float], object]) -> bool:
        """Handle what has arrived, and publish what is due; return whether all is over."""
        for inbox in self._inboxes:
            inbox.look()
        self._calls.look(now)
        self._judge(now)
        if self._phase is _Phase.MOVING:
            show(now - self._since)
        if self._phase is _Phase.ENDING and (
                self._neutral_answered or now - self._since > NEUTRAL_TIMEOUT):
            return True
        if now >= self._due:
            if self._phase is _Phase.MOVING:    # once more: it may have been suspended just now
                self._judge(self._graph.now())
            moving = self._phase is _Phase.MOVING
            self._out.publish(self._message_type(
                data=self._target.value if moving else self._target.neutral))
            self._published_at, self._due = now, now + self._target.period
        if now >= self._ask_at and not self._asking:
            self._ask(now)
        return False

    def _judge(self, now: float) -> None:
        """Choose what is published next: the value only without a sign of a fault."""
        if self._phase is _Phase.ENDING:
            return
        if self._stopped():
            self._end(sentences.jog_interrupted())
        if self._phase is _Phase.ARMING:
            if now - self._since > ARMING_TIMEOUT and not self._armed:
                self._end(sentences.jog_not_armed(seconds=ARMING_TIMEOUT))
        elif now - self._published_at > self._target.timeout:
            self._end(sentences.jog_late(seconds=now - self._published_at))
        elif now - self._heard_at > SILENCE:
            self._end(sentences.jog_bridge_silent(SILENCE))
        elif now - self._since > TAKING_TIMEOUT and not self._is_sent(self._target.value):
            self._end(sentences.jog_not_taken(
                wanted=self._target.in_words(self._target.value), seconds=TAKING_TIMEOUT))
        if self._why is not None or (
                self._phase is _Phase.MOVING and now - self._since >= self._seconds):
            # what was never moved is at neutral
            self._neutral_answered = self._phase is _Phase.ARMING
            self._enter(_Phase.ENDING, now)
        elif self._phase is _Phase.ARMING and self._armed:
            self._enter(_Phase.MOVING, now)

    def _enter(self, phase: '_Phase', now: float) -> None:
        self._phase, self._since, self._due = phase, now, now

    def _end(self, why: Sentence) -> None:
        if self._why is None:
            self._why = why

    def _ask(self, now: float) -> None:
        """Ask the bridge whether the setpoint is armed, and which other nodes command it."""
        prefix = f'drives.{self._target.node.rpartition("/")[2]}.'
        self._asking, self._ask_at = True, now + ASK_PERIOD

        def take(answer: Any) -> None:
            self._asking = False
            if answer is None or len(answer.values) != 2:
                return
            self._heard_at = self._graph.now()
            text, publishers = (value_of(value) for value in answer.values)
            before, self._armed = self._armed, any(
                each.get('armed') is True for each in _read(text) or ()
                if each['name'] == self._target.parameter.name)
            # twice, because what is sent then says it better, where that can be seen
            if self._phase is _Phase.MOVING and not (before or self._armed):
                self._end(sentences.jog_no_longer(state='armed'))
            who = list(_others(publishers, self._own_name))
            if who:
                self._end(sentences.jog_commanded(who=who))
        self._calls.ask(self._target.bridge, 'get_parameters', GetParameters.Request(
            names=[f'{prefix}setpoints', f'{prefix}commanders']), take, now)

    def _take_online(self, message: Bool) -> None:
        if not message.data:
            self._end(sentences.jog_no_longer(state='online'))

    def _take_command(self, message: Any) -> None:
        if message.data not in (self._target.value, self._target.neutral):
            self._end(sentences.jog_commanded(who=[self._target.topic]))

    def _take_request(self, message: ParameterEvent) -> None:
        self._heard_at = self._graph.now()
        for each in message.changed_parameters:
            if each.name == self._target.parameter.name:
                sent = drive_value(each.value)
                if sent != self._sent:
                    self._sent, self._sent_at, self._answers = sent, _ns(message), 0
        if self._phase is _Phase.MOVING and self._value_answered and not self._is_sent(
                self._target.value):
            self._end(sentences.jog_neutral_again(
                sent=self._target.in_words(0 if self._sent is None else self._sent),
                wanted=self._target.in_words(self._target.value)))

    def _take_response(self, message: ParameterEvent) -> None:
        self._heard_at = self._graph.now()
        self.values.update(
            (each.name, value) for each in message.changed_parameters
            if (value := drive_value(each.value)) is not None)
        if _ns(message) <= self._sent_at:
            return
        self._answers += 1
        if self._answers < 2:   # the first one may answer the exchange before
            return
        if self._phase is _Phase.ENDING and self._is_sent(self._target.neutral):
            self._neutral_answered = True
        elif self._is_sent(self._target.value):
            self._value_answered = True

    def _is_sent(self, value: Value) -> bool:
        """Return whether the bridge sent a value last: the same raw integer."""
        parameter = self._target.parameter
        try:
            return self._sent is not None and (
                parameter.raw_from_value(self._sent) == parameter.raw_from_value(value))
        except ValueRefused:    # neutral may lie outside of the limits of a profile
            return self._sent == value


class _Phase(Enum):
    ARMING = 'arming'
    MOVING = 'moving'
    ENDING = 'ending'


def _ns(message: ParameterEvent) -> int:
    """Return the stamp of a message in ns."""
    return int(message.stamp.sec) * 1_000_000_000 + int(message.stamp.nanosec)


def _others(text: Any, own: str) -> Iterator[str]:
    """Yield the other publishers, by node and topic; our own node may not be known yet."""
    try:
        publishers = [str(each) for each in json.loads(text)]
    except (TypeError, ValueError):
        return
    for each in publishers:
        node = each.partition(' ')[0]
        if node != own and not node.endswith(UNNAMED_NODE):
            yield printable(each)
