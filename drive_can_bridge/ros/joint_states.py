# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``~/joint_states`` of the bridge: all joints in one message.

Drives answer one after the other, each with a stamp of its own; what reads joints wants all of
them in one message (the hardware interface of ros2_control keeps the latest message only). So at a
rate of its own the newest sample of each is taken together, under the stamp of the oldest; by the
timer thread of an exchange, which is awake in any case (:mod:`~drive_can_bridge.exchange.errand`).

It always names the same joints: the hardware interface copies a message while it reads the one
before, and fails when the number of names has changed. A joint whose drive is not online has NaN
in every quantity: nobody is told a position that nobody has measured. When the last one goes, that
is published once.
"""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import accumulate
import math

from rclpy.node import Node
from sensor_msgs.msg import JointState

from drive_can_bridge.core.configuration import JointConfiguration
from drive_can_bridge.ros.audience import Audience
from drive_can_bridge.ros.drive_node import DriveNode
from drive_can_bridge.ros.gone import GONE
from drive_can_bridge.ros.joint_reader import QUANTITIES
from drive_can_bridge.ros.layout import Number
from drive_can_bridge.ros.prepared import PreparedMessage
from drive_can_bridge.ros.quality import publisher, state_quality
from drive_can_bridge.ros.stamps import NO_STAMP, Stamps


TOPIC = '~/joint_states'


#: one number of the message: its place in the samples one after the other, and the way to SI units
_Cell = tuple[int, float, float, float]


class _Joint:
    """
    A joint that is measured.

    :ivar width: how many values its samples have.
    :ivar unknown: a sample of which nothing is known.
    """

    __slots__ = ('_places', 'name', 'samples', 'session', 'unknown', 'width')

    def __init__(self, drive: DriveNode, joint: JointConfiguration) -> None:
        self.session = drive.session
        self.samples = drive.samples
        self.name = joint.name
        parameters = {parameter.name: (slot, parameter) for slot, parameter
                      in enumerate(drive.session.sample_parameters)}
        self.width = len(parameters)
        self.unknown = [math.nan] * self.width
        self._places: dict[str, _Cell] = {}
        for quantity in QUANTITIES:
            name = getattr(joint, quantity)
            if name is not None:
                slot, parameter = parameters[name]
                linear = (parameter.scale, parameter.offset) if parameter.scaled else (1.0, 0.0)
                self._places[quantity] = (slot, *linear, joint.factors[name])

    def cell(self, quantity: str, first: int) -> _Cell:
        """Return where a quantity is when the sample begins there; NaN: this joint lacks it."""
        slot, scale, offset, factor = self._places.get(quantity, (0, math.nan, 0.0, 1.0))
        return first + slot, scale, offset, factor


class JointStates:
    """
    Publishes the message.

    :param drives: in the order of the configuration; those without a measured joint are left out.
    :param stamps: of the bridge.
    :param warn: takes (topic of the warning, text); throttling is its business.
    """

    def __init__(self, node: Node, drives: Sequence[DriveNode], stamps: Stamps,
                 warn: Callable[[str, str], None]) -> None:
        joints = [(drive, drive.drive.joint) for drive in drives]
        self._quantities = [quantity for quantity in QUANTITIES if any(
            joint is not None and getattr(joint, quantity) for _, joint in joints)]
        self._joints = [
            _Joint(drive, joint) for drive, joint in joints
            if joint is not None and any(getattr(joint, each) for each in QUANTITIES)]
        self._node = node
        self._warn = warn
        self._stamps = stamps
        self.publisher = publisher(node, JointState, TOPIC, state_quality())
        self._audience = Audience(self.publisher)
        self._known = False     # anything, in the last message
        firsts = list(accumulate((joint.width for joint in self._joints), initial=0))
        self._cells = [joint.cell(quantity, first) for quantity in self._quantities
                       for joint, first in zip(self._joints, firsts)]
        message = self._message = JointState(name=[joint.name for joint in self._joints])
        stamp = message.header.stamp
        numbers: list[Number] = [('i', partial(setattr, stamp, 'sec')),
                                 ('I', partial(setattr, stamp, 'nanosec'))]
        numbers += [(f'{len(self._joints)}d', partial(setattr, message, quantity))
                    for quantity in self._quantities]
        self._prepared = PreparedMessage.find(self.publisher, message, numbers)

    def publish(self, now: float) -> None:
        """Publish what is known now, if anything is, or was, and somebody listens."""
        try:
            if self._audience.listens(now):
                self._publish(now)
        except GONE as error:
            if self._node.context.ok():
                self._warn('joint states', f'joint_states cannot be published: {error}')

    def destroy(self) -> None:
        """Take the publisher out of its node."""
        self._node.destroy_publisher(self.publisher)

    def _publish(self, now: float) -> None:
        raws: list[float] = []
        oldest, stamp = math.inf, NO_STAMP
        for joint in self._joints:
            last = joint.samples.last
            if last is None or not joint.session.online:
                raws += joint.unknown
                continue
            sample, received_at, stamped = last
            raws += sample
            raws += joint.unknown[len(sample):]     # a short response
            if received_at < oldest:
                oldest, stamp = received_at, stamped
        known = oldest < math.inf
        if not known:
            if not self._known:
                return
            stamp = self._stamps.at(now)
        self._known = known
        numbers = [(raws[place] * scale + offset) * factor
                   for place, scale, offset, factor in self._cells]
        if self._prepared is not None:
            self._prepared.publish([*stamp, *numbers])
            return
        message, count = self._message, len(self._joints)
        message.header.stamp.sec, message.header.stamp.nanosec = stamp
        for column, quantity in enumerate(self._quantities):
            setattr(message, quantity, numbers[column * count:(column + 1) * count])
        self.publisher.publish(message)
