# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``~/joint_states`` of the bridge: all joints in one message.

Drives answer one after the other, each with a stamp of its own; what reads joints wants all of
them in one message (the hardware interface of ros2_control keeps the latest message only). So at a
rate of its own the newest sample of each is taken together, under the stamp of the oldest.

A joint whose drive is not online is left out: nobody is told a position that nobody has measured.
"""

from collections.abc import Sequence
from functools import partial
import math
from typing import Any, NamedTuple

from rclpy.exceptions import InvalidHandle
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from sensor_msgs.msg import JointState

from drive_can_bridge.core.configuration import JointConfiguration
from drive_can_bridge.ros.drive_node import DriveNode
from drive_can_bridge.ros.prepared import PreparedMessage
from drive_can_bridge.ros.quality import overriding, state_quality
from drive_can_bridge.ros.stamps import Stamps

RCLError = rclpy_implementation.RCLError

TOPIC = '~/joint_states'
QUANTITIES = ('position', 'velocity', 'effort')


class _Value(NamedTuple):
    """One quantity of one joint: its slot in a sample, and the way to its SI value."""

    slot: int
    scale: float
    offset: float
    factor: float


class _Joint:
    """
    A joint that is measured.

    :ivar values: for each quantity of the bridge what it is; None: this joint lacks it.
    """

    def __init__(self, drive: DriveNode, joint: JointConfiguration,
                 quantities: Sequence[str]) -> None:
        self.drive = drive
        self.name = joint.name
        parameters = {parameter.name: (slot, parameter) for slot, parameter
                      in enumerate(drive.session.sample_parameters)}
        self.values: list[_Value | None] = []
        for quantity in quantities:
            name = getattr(joint, quantity)
            if name is None:
                self.values.append(None)
                continue
            slot, parameter = parameters[name]
            linear = (parameter.scale, parameter.offset) if parameter.scaled else (1.0, 0.0)
            self.values.append(_Value(slot, *linear, joint.factors[name]))

    def measured(self, raws: tuple[int, ...]) -> list[float]:
        """Return what a sample says, NaN where it says nothing."""
        found = []
        for value in self.values:
            if value is None or value[0] >= len(raws):
                found.append(math.nan)
            else:
                slot, scale, offset, factor = value
                found.append((raws[slot] * scale + offset) * factor)
        return found


class JointStates:
    """
    Publishes the message.

    :param drives: in the order of the configuration; those without a measured joint are left out.
    """

    def __init__(self, node: Node, drives: Sequence[DriveNode]) -> None:
        joints = [(drive, drive.drive.joint) for drive in drives]
        self._quantities = [quantity for quantity in QUANTITIES if any(
            joint is not None and getattr(joint, quantity) for _, joint in joints)]
        self._joints = [
            _Joint(drive, joint, self._quantities) for drive, joint in joints
            if joint is not None and any(getattr(joint, each) for each in QUANTITIES)]
        self._node = node
        self._stamps = Stamps(node.get_clock())
        self.publisher = node.create_publisher(
            JointState, TOPIC, state_quality(), qos_overriding_options=overriding(node, TOPIC))
        self._names: list[str] = []
        self._message = JointState()
        self._prepared: PreparedMessage | None = None

    def publish(self) -> None:
        """Publish what is known now, if anything is and somebody listens."""
        try:
            if self.publisher.get_subscription_count():
                self._publish()
        except (InvalidHandle, RCLError):
            if self._node.context.ok():
                raise

    def destroy(self) -> None:
        """Take the publisher out of its node."""
        self._node.destroy_publisher(self.publisher)

    def _publish(self) -> None:
        names: list[str] = []
        rows: list[list[float]] = []
        oldest = math.inf
        for joint in self._joints:
            last = joint.drive.samples.last
            if last is None or not joint.drive.session.online:
                continue
            raws, received_at = last
            names.append(joint.name)
            rows.append(joint.measured(raws))
            oldest = min(oldest, received_at)
        if not names:
            return
        if names != self._names:
            self._prepare(names)
        columns = list(zip(*rows))
        numbers: list[Any] = [*self._stamps.at(oldest), *columns]
        if self._prepared is not None:
            self._prepared.publish(numbers)
            return
        message = self._message
        message.header.stamp.sec, message.header.stamp.nanosec = numbers[:2]
        for quantity, column in zip(self._quantities, columns):
            setattr(message, quantity, column)
        self.publisher.publish(message)

    def _prepare(self, names: list[str]) -> None:
        """Prepare the message for these joints: others than before are online."""
        self._names = names
        message = self._message = JointState(name=names)
        stamp = message.header.stamp
        numbers: list[Any] = [('i', partial(setattr, stamp, 'sec')),
                              ('I', partial(setattr, stamp, 'nanosec'))]
        numbers += [(f'{len(names)}d', partial(setattr, message, quantity))
                    for quantity in self._quantities]
        self._prepared = PreparedMessage.find(self.publisher, message, numbers)
