# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Setpoint commands: taken by the exchange at its tick, not by callbacks.

A callback per message makes an executor pay for its whole wait set each time, and a flood of
commands would starve the services. Here the thread that begins a cycle takes what is waiting just
before it: the newest command goes out in the very next frame, and a flood costs nothing but
the take of as many as can wait (:mod:`.polled_topics`). The subscriptions stand in a callback
group that no executor ever runs.
"""

from collections.abc import Callable, Iterable, Iterator
from functools import partial
import json
from typing import NamedTuple

from rclpy.node import Node
from sensor_msgs.msg import JointState

from drive_can_bridge.clock import Clock
from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import is_misplaced_integer, Value, ValueKind
from drive_can_bridge.core.session import Session
from drive_can_bridge.core.setpoints import CommandOutcome
from drive_can_bridge.core.text import UNNAMED_NODE, value_text
from drive_can_bridge.ros.advice import how_to_enable
from drive_can_bridge.ros.joint_reader import JointMessage, JointReader, QUANTITIES
from drive_can_bridge.ros.polled_topics import COUNT_PERIOD, PolledTopics, Warn
from drive_can_bridge.ros.values import TOPIC_TYPES

#: drives of neighbouring stations count their publishers in so many different cycles
SHIFTS = 5


class _Target(NamedTuple):
    """The setpoint of a quantity of the joint, SI units per unit of it, whether an integer."""

    setpoint: int
    factor: float
    integer: bool


class CommandIntake:
    """
    The command subscriptions of one drive.

    :param warn: logs (topic of the warning, text); limits repetitions itself.
    :param inform: logs what needs no action.
    :param armed: handles the name of a setpoint that a command has armed.
    """

    def __init__(self, node: Node, drive: DriveConfiguration, session: Session,
                 clock: Clock, warn: Warn, inform: Callable[[str], None],
                 armed: Callable[[str], None]) -> None:
        self._node = node
        self._session = session
        self._warn = warn
        self._inform = inform
        self._armed = armed
        self._told: set[str] = set()
        self._joint = joint = drive.joint
        self._topics = PolledTopics(node, clock, warn, self.refuse,
                                    shift=drive.station % SHIFTS * COUNT_PERIOD / SHIFTS)
        self._joint_targets: dict[str, _Target] = {}    # by quantity of the joint
        try:
            for index, setpoint in enumerate(session.setpoints.items):
                name, kind = setpoint.parameter.name, setpoint.parameter.kind
                self._topics.subscribe(TOPIC_TYPES[kind], f'~/command/{name}',
                                       partial(self._command, index),
                                       partial(session.setpoints.old_command, index),
                                       partial(session.setpoints.disarm_one, index))
                for quantity in QUANTITIES if joint is not None else ():
                    if joint is not None and getattr(joint, f'{quantity}_command') == name:
                        self._joint_targets[quantity] = _Target(
                            index, joint.factors[name], kind is ValueKind.INTEGER)
            if joint is not None:
                self._topics.subscribe(JointState, '~/joint_command', self._take_joint,
                                       self._take_old_joint, self.disarm_joint,
                                       JointReader())
        except BaseException:
            self.destroy()
            raise

    def take(self, now: float) -> None:
        """Pass all waiting commands to the session, oldest first."""
        self._topics.take(now)

    def discard(self, why: str) -> None:
        """
        Discard the waiting commands.

        :param why: in words; '': not logged.
        """
        self.discarded(self._topics.discard(), why)

    def discarded(self, count: int, why: str) -> None:
        """Count and log discarded commands."""
        if count and why:
            self._session.statistics.commands_refused += count
            self._warn('discarded', sentences.commands_discarded(count=count, why=why))

    def destroy(self) -> None:
        """Destroy the subscriptions. Before the node is destroyed, which has them otherwise."""
        self._topics.destroy()

    def setpoints_text(self) -> str:
        """Return what may be commanded as JSON, for clients of the bridge."""
        return json.dumps([{
            'name': item.parameter.name, 'limit': item.parameter.limit, 'armed': item.armed,
            **({'neutral_from': item.parameter.neutral_from} if item.parameter.neutral_from else
               {'neutral': item.parameter.value_from_raw(item.parameter.neutral_raw)}),
        } for item in self._session.setpoints.items])

    def commanders(self, joint_commands: str) -> list[str]:
        """
        Return the publishers of commands to this drive, ``node topic``, as this process sees them.

        :param joint_commands: the topic with the commands for all joints of the bridge.
        """
        return sorted(f'{node} {topic}' for node, topic in self._publishers([joint_commands]))

    def commanding_nodes(self, joint_commands: Iterable[str]) -> list[str]:
        """Return the full names of the nodes that publish them, as far as ROS knows them yet."""
        return sorted({node for node, _ in self._publishers(joint_commands)
                       if not node.endswith(UNNAMED_NODE)})

    def _publishers(self, joint_commands: Iterable[str]) -> Iterator[tuple[str, str]]:
        for topic in (*self._topics.names, *(joint_commands if self._joint_targets else ())):
            for each in self._node.get_publishers_info_by_topic(topic):
                yield f'{each.node_namespace.rstrip("/")}/{each.node_name}', topic

    # -- inside -----------------------------------------------------------------------------------

    def _command(self, index: int, value: Value, now: float) -> None:
        session = self._session
        try:
            outcome = session.services.command(index, value, now)
        except ValueRefused as error:
            name = session.setpoints.items[index].parameter.name
            self._warn(f'refused {name}', sentences.command_refused(name, str(error)))
            return
        if outcome is CommandOutcome.ARMED:
            self._armed(session.setpoints.items[index].parameter.name)
        elif outcome is CommandOutcome.DISABLED and session.active:
            name = session.setpoints.items[index].parameter.name
            self._warn('disabled', sentences.command_while_disabled(
                name=name, enable=how_to_enable(session, self._node)), once=True)
        if outcome is CommandOutcome.NOT_ARMED and session.setpoints.enabled:
            parameter = session.setpoints.items[index].parameter
            neutral = value_text(
                parameter.value_from_raw(session.setpoints.items[index].neutral))
            self._warn(f'not armed {parameter.name}',
                       sentences.command_while_not_armed(name=parameter.name, neutral=neutral))

    def _take_joint(self, message: JointMessage, now: float) -> None:
        joint = self._joint
        if joint is None:
            return
        try:
            entry = message.names.index(joint.name)
        except ValueError:
            self._session.statistics.commands_refused += 1
            self._warn('joint name', sentences.joint_not_named(joint.name), once=True)
            return
        for quantity, values in message.columns:
            if entry < len(values):
                self.take_quantity(quantity, values[entry], now)
            elif quantity in self._joint_targets:
                self.refuse(f'joint {quantity}',
                            sentences.joint_command_short(quantity=quantity))
            else:
                self._tell_ignored(quantity)

    def _take_old_joint(self, message: JointMessage) -> None:
        if self._joint is not None and self._joint.name in message.names:
            self.take_old(message, message.names.index(self._joint.name))

    def take_old(self, message: JointMessage, entry: int) -> None:
        """Handle the joint's part of a message that is too old: it may only stop."""
        for quantity, values in message.columns:
            target = self._joint_targets.get(quantity)
            if target is not None and entry < len(values) and values[entry] == values[entry]:
                self._session.setpoints.old_command(
                    target.setpoint, _in_units(values[entry], target))

    def disarm_joint(self) -> None:
        """Disarm all setpoints of the joint."""
        for target in self._joint_targets.values():
            self._session.setpoints.disarm_one(target.setpoint)

    def take_quantity(self, quantity: str, value: float, now: float) -> None:
        """Handle a command for one quantity of the joint, in SI units; NaN leaves it alone."""
        if value != value:
            return
        target = self._joint_targets.get(quantity)
        if target is None:
            self._tell_ignored(quantity)
            return
        self._command(target.setpoint, _in_units(value, target), now)

    def _tell_ignored(self, quantity: str) -> None:
        if quantity not in self._told:
            self._told.add(quantity)
            self._inform(sentences.joint_quantity_ignored(quantity))

    def refuse(self, topic: str, text: str) -> None:
        """Count and log a refused command."""
        self.count_refused()
        self._warn(topic, text)

    def count_refused(self) -> None:
        """Count a refused command that is logged elsewhere."""
        self._session.statistics.commands_refused += 1


def _in_units(value: float, target: _Target) -> Value:
    """Return a value in SI units in those of the setpoint."""
    if is_misplaced_integer(value):     # it must not become a 0, which arms
        return value
    physical = value / target.factor
    return round(physical) if target.integer and abs(physical) < 1e15 else physical
