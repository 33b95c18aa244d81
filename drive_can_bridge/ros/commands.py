# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Setpoint commands: taken by the exchange at its tick, not by callbacks.

A callback per message makes an executor pay for its whole wait set each time, and a flood of
commands would starve the services. Here the exchange's timer thread takes what is waiting just
before a cycle: the newest command goes out in the very next frame, and a flood costs nothing but
the take of as many as can wait (:mod:`.command_topic`). The subscriptions stand in a callback
group that no executor ever runs. Nor does it wait for their events, such as a publisher of other
quality: with Fast DDS that wait ends with every message, which at 3,000 commands/s costs more than
everything else. They are looked at once in a while instead.

Even a look into an empty queue costs 2 µs, with four setpoints a tenth of the whole exchange. So
only the topics that somebody publishes are looked at in each cycle; who does is looked up every
``COUNT_PERIOD``, and whatever came from anybody is taken then. The very first command of a
publisher that was discovered just now may wait for that long.
"""

from collections.abc import Callable
import math
from typing import Any, Protocol

from rclpy.event_handler import QoSSubscriptionEventType, SubscriptionEventCallbacks
from rclpy.exceptions import InvalidHandle
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import qos_policy_name_from_kind
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import Value, ValueKind
from drive_can_bridge.core.session import Session
from drive_can_bridge.core.setpoints import CommandOutcome
from drive_can_bridge.core.text import printable
from drive_can_bridge.core.words import value_text
from drive_can_bridge.ros.command_topic import CommandTopic
from drive_can_bridge.ros.polled_group import PolledGroup
from drive_can_bridge.ros.quality import command_quality, overriding
from drive_can_bridge.ros.values import TOPIC_TYPES

RCLError = rclpy_implementation.RCLError

#: s between two looks at who publishes
COUNT_PERIOD = 0.05
#: s between two looks at events of subscriptions
EVENT_PERIOD = 1.0


class Warn(Protocol):
    """Takes the topic of a warning, and its text; ``once``: no need to repeat it."""

    def __call__(self, topic: str, text: str, *, once: bool = False) -> None:
        """Log it, or not."""


class PolledEvent:
    """
    An event of a subscription for which nobody waits. To be destroyed before the subscription.

    :param tell: takes the status when there is news.
    """

    def __init__(self, subscription: Subscription, kind: Any,
                 tell: Callable[[Any], None]) -> None:
        self._handle = rclpy_implementation.EventHandle(subscription.handle, kind)
        self._tell = tell

    def look(self) -> None:
        """Tell what happened since the last look, if anything did."""
        with self._handle:
            status = self._handle.take_event()
        if status is not None and status.total_count_change > 0:
            self._tell(status)

    def destroy(self) -> None:
        """Let go of the subscription."""
        self._handle.destroy_when_not_in_use()


class CommandIntake:
    """
    The command subscriptions of one drive.

    :param warn: takes (topic of the warning, text); throttling is its business.
    :param inform: takes what nobody has to do anything about.
    """

    def __init__(self, node: Node, drive: DriveConfiguration, session: Session,
                 warn: Warn, inform: Callable[[str], None]) -> None:
        self._session = session
        self._warn = warn
        self._inform = inform
        self._told: set[str] = set()
        self._drive = drive
        self._group = PolledGroup()
        self._topics: list[CommandTopic] = []
        self._published: list[CommandTopic] = []  # by somebody, as far as known
        self._count_at = -math.inf
        self._events: list[PolledEvent] = []
        self._look_at = -math.inf
        self._subscriptions: list[Subscription] = []
        self._index = {setpoint.parameter.name: index
                       for index, setpoint in enumerate(session.setpoints.items)}
        try:
            for name, index in self._index.items():
                kind = session.setpoints.items[index].parameter.kind
                self._subscribe(node, TOPIC_TYPES[kind], f'~/command/{name}', self._taker(index))
            if drive.joint is not None:
                self._subscribe(node, JointState, '~/joint_command', self._take_joint)
        except BaseException:
            self.destroy()
            raise

    def take(self, now: float) -> None:
        """Hand all waiting commands to the session, oldest first."""
        try:
            if now < self._count_at:
                for topic in self._published:
                    topic.take(now)
                return
            self._count_at = now + COUNT_PERIOD
            for topic in self._topics:  # some may have come from a publisher that is gone by now
                topic.take(now)
            self._published = [topic for topic in self._topics
                               if topic.handle.get_publisher_count()]
            for topic in self._topics:
                if topic not in self._published:
                    topic.forget()
            if now >= self._look_at:
                self._look_at = now + EVENT_PERIOD
                for event in self._events:
                    event.look()
        except (InvalidHandle, RCLError):  # the node is being destroyed
            pass

    def discard(self, why: str) -> None:
        """
        Throw away what is waiting.

        :param why: in words; '': nobody has to be told.
        """
        try:
            count = sum(topic.discard() for topic in self._topics)
        except (InvalidHandle, RCLError):  # the node is being destroyed
            return
        if count and why:
            self._session.statistics.commands_refused += count
            self._warn('discarded', f'{count} commands thrown away: {why}')

    def destroy(self) -> None:
        """Let go of the subscriptions. Before the node is destroyed, which has them otherwise."""
        events, self._events = self._events, []
        for event in events:
            event.destroy()

    # -- inside -----------------------------------------------------------------------------------

    def _subscribe(self, node: Node, message_type: type, topic: str,
                   take: Callable[[Any, float], None]) -> None:
        name = node.resolve_topic_name(topic)

        def incompatible(status: Any) -> None:
            self._warn(f'quality {name}', f'a publisher of {name} offers incompatible quality of '
                       f'service ({qos_policy_name_from_kind(status.last_policy_kind)}): nothing '
                       f'is received from it')
        subscription = node.create_subscription(
            message_type, topic, _never, command_quality(), callback_group=self._group,
            qos_overriding_options=overriding(node, topic),
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False))
        self._events.append(PolledEvent(
            subscription, QoSSubscriptionEventType.RCL_SUBSCRIPTION_REQUESTED_INCOMPATIBLE_QOS,
            incompatible))
        self._subscriptions.append(subscription)

        def late(seconds: float) -> None:
            self._refuse(f'late {name}', f'command on {name} thrown away: it came {seconds:.2f} s '
                         f'later than others have')

        def unreadable(reason: str) -> None:
            self._refuse(f'unreadable {name}',
                         f'command on {name} cannot be read: {printable(reason)}')
        self._topics.append(CommandTopic(subscription, use=take, late=late,
                                         unreadable=unreadable))

    def _taker(self, index: int) -> Callable[[Any, float], None]:
        return lambda value, now: self._command(index, value, now)

    def _command(self, index: int, value: Value, now: float) -> None:
        session = self._session
        try:
            outcome = session.command(index, value, now)
        except ValueRefused as error:
            name = session.setpoints.items[index].parameter.name
            self._warn(f'refused {name}', f'command {name} refused: {error}')
            return
        if outcome is CommandOutcome.DISABLED:
            name = session.setpoints.items[index].parameter.name
            self._warn('disabled', f'command {name} has no effect: disabled, '
                       f'{session.how_to_enable}', once=True)
        if outcome is CommandOutcome.NOT_ARMED and session.setpoints.enabled:
            parameter = session.setpoints.items[index].parameter
            neutral = value_text(
                parameter.value_from_raw(session.setpoints.items[index].neutral))
            self._warn(f'not armed {parameter.name}',
                       f'command {parameter.name} has no effect: not armed, send {neutral} '
                       f'once first')

    def _take_joint(self, message: JointState, now: float) -> None:
        joint = self._drive.joint
        if joint is None:
            return
        try:
            entry = list(message.name).index(joint.name)
        except ValueError:
            self._session.statistics.commands_refused += 1
            self._warn('joint name', f'joint_command without an entry named {joint.name}',
                       once=True)
            return
        for quantity, values, target in (
                ('position', message.position, joint.position_command),
                ('velocity', message.velocity, joint.velocity_command),
                ('effort', message.effort, joint.effort_command)):
            if not len(values):
                continue
            if target is None:
                if quantity not in self._told:
                    self._told.add(quantity)
                    self._inform(f'joint_command has a {quantity}, which is ignored: '
                                 f'joint.{quantity}_command is not configured')
            elif entry >= len(values):
                self._refuse(f'joint {quantity}',
                             f'joint_command has fewer {quantity} values than names')
            elif not math.isnan(values[entry]):
                self._command_joint(target, values[entry], now)

    def _command_joint(self, name: str, value: float, now: float) -> None:
        joint = self._drive.joint
        index = self._index[name]
        parameter = self._session.setpoints.items[index].parameter
        if joint is None:
            return
        physical: Value = value / joint.factors[name]
        if parameter.kind is ValueKind.INTEGER:
            physical = round(physical) if abs(physical) < 1e15 else physical
        self._command(index, physical, now)

    def _refuse(self, topic: str, text: str) -> None:
        self._session.statistics.commands_refused += 1
        self._warn(topic, text)


def _never(_: Any) -> None:
    raise RuntimeError('command subscriptions are taken by the exchange, not by an executor')
