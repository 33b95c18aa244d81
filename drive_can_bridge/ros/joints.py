# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
All joints of a bridge in one message: ``~/joint_states`` and ``~/joint_commands``.

Drives answer one after the other, each with a stamp of its own; what reads joints wants all of
them in one message (the hardware interface of ros2_control keeps the latest message only). So at a
rate of its own the newest sample of each is taken together, under the stamp of the oldest; by a
thread of an exchange, which is awake in any case (``exchange.PeriodicTask``).

It always names the same joints: the hardware interface copies a message while it reads the one
before, and fails when the number of names has changed. A joint whose drive is not online, or whose
bus hangs, has NaN in every quantity: no position is published that was not measured. When the
last one goes offline, that is published once.

Commands have a subscription for each bus, because each bus has a thread that takes commands just
before its cycles; the part of the drives of other buses is left to theirs.
"""

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from itertools import accumulate
import math

from rclpy.node import Node
from sensor_msgs.msg import JointState

from drive_can_bridge.clock import Clock
from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import BridgeConfiguration, JointConfiguration
from drive_can_bridge.core.text import printable
from drive_can_bridge.exchange.exchange import PeriodicTask
from drive_can_bridge.ros.drive_node import DriveNode
from drive_can_bridge.ros.joint_reader import Column, JointMessage, JointReader, QUANTITIES
from drive_can_bridge.ros.log import Log
from drive_can_bridge.ros.middleware import Audience, publisher, state_quality
from drive_can_bridge.ros.polled_topics import PolledTopics, Warn
from drive_can_bridge.ros.prepared import Number, PreparedMessage
from drive_can_bridge.ros.rcl.extension import GONE
from drive_can_bridge.ros.stamps import NO_STAMP, Stamps

STATES = '~/joint_states'
COMMANDS = '~/joint_commands'
#: so many joints of others are logged
STRANGERS_MAX = 100

#: one number of the message: its place in the samples one after the other, and the way to SI units
_Cell = tuple[int, float, float, float]


class _Joint:
    """
    One measured joint.

    :ivar width: how many values its samples have.
    :ivar unknown: a sample of which nothing is known.
    """

    __slots__ = ('_places', 'exchange', 'name', 'samples', 'session', 'unknown', 'width')

    def __init__(self, drive: DriveNode, joint: JointConfiguration) -> None:
        self.session = drive.session
        self.exchange = drive.exchange
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
        """Return where a quantity is in a sample that begins there; NaN: this joint lacks it."""
        slot, scale, offset, factor = self._places.get(quantity, (0, math.nan, 0.0, 1.0))
        return first + slot, scale, offset, factor


class JointStates:
    """
    Publishes the message with all joints.

    :param drives: in the order of the configuration; those without a measured joint are left out.
    :param stamps: of the bridge.
    :param warn: logs (topic of the warning, text); limits repetitions itself.
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
        self.publisher = publisher(node, JointState, STATES, state_quality())
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
        """Publish what is known now, if anything is, or was, and there is a subscriber."""
        try:
            if self._audience.listens(now):
                self._publish(now)
        except GONE as error:
            if self._node.context.ok():
                self._warn('joint states', sentences.joint_states_unpublished(str(error)))

    def destroy(self) -> None:
        """Destroy the publisher."""
        self._node.destroy_publisher(self.publisher)

    def _publish(self, now: float) -> None:
        raws: list[float] = []
        oldest, stamp = math.inf, NO_STAMP
        for joint in self._joints:
            last = joint.samples.last
            if (last is None or not joint.session.online
                    or joint.exchange.stands_still(now)):   # another bus, which hangs
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


class Joints:
    """
    The topics for all joints of a bridge.

    :param drives: by name.
    :param stamps: of the bridge.
    """

    def __init__(self, node: Node, log: Log, configuration: BridgeConfiguration,
                 drives: Mapping[str, DriveNode], stamps: Stamps, clock: Clock) -> None:
        self._now = clock.now
        source = log.source('')
        source.reset()
        warn = source.warn
        self._taken: list[PolledTopics] = []
        self._states: JointStates | None = None
        self._periodic_task: PeriodicTask | None = None
        ordered = [drives[name] for name in configuration.drives]
        known = {drive.drive.joint.name for drive in ordered if drive.drive.joint is not None}
        for bus in configuration.buses:
            here = [drive for drive in ordered if drive.drive.bus == bus]
            joints = {drive.drive.joint.name: drive for drive in here
                      if drive.drive.joint is not None}
            if not joints:
                continue
            if self._taken:     # the others receive the same, and need not log it again
                taker = _JointTaker(joints, known, _nothing, _nothing)
            else:
                taker = _JointTaker(joints, known, warn, log.info)
            taken = PolledTopics(node, clock, warn, taker.refuse)
            self._taken.append(taken)
            taken.subscribe(JointState, COMMANDS, taker, taker.take_old, taker.disarm,
                            JointReader())
            for drive in here:
                drive.joint_commands = taken
        if configuration.joint_state_rate > 0.0:
            self._period = 1.0 / configuration.joint_state_rate
            self._states = JointStates(node, ordered, stamps, warn)
            self._periodic_task = PeriodicTask(self._states.publish)
            for drive in ordered:
                drive.exchange.periodic_task = self._periodic_task

    def start(self) -> None:
        """Start to publish."""
        if self._periodic_task is not None:
            self._periodic_task.begin(self._period, self._now())

    def destroy(self) -> None:
        """Destroy the topics. No thread may take commands any more."""
        if self._periodic_task is not None:
            self._periodic_task.end()
        while self._taken:
            self._taken.pop().unsubscribe()
        if self._states is not None:
            self._states.publish(self._now())  # the last joints are offline
            self._states.destroy()
            self._states = None


def _nothing(*_: object, **__: object) -> None:
    """Do nothing: another subscription logs the same."""


class _JointTaker:
    """
    Handles messages for the joints of one bus.

    :param joints: the drives of the bus by the names of their joints.
    :param known: the names of all joints of the bridge.
    :param warn: logs what is wrong with a message.
    :param inform: logs what needs no action.
    """

    def __init__(self, joints: Mapping[str, DriveNode], known: Collection[str],
                 warn: Warn, inform: Callable[[str], None]) -> None:
        self._joints = joints
        self._known = known
        self._warn = warn
        self._inform = inform
        self._strangers: set[str] = set()
        #: names of the last valid message, and the function for each entry of such a one
        self._names: list[str] | None = None
        self._parts: list[tuple[int, Callable[[str, float, float], None]]] = []

    def __call__(self, message: JointMessage, now: float) -> None:
        """Pass each joint its part."""
        names, columns = message
        wrong = self._problem(names, columns)
        if wrong is not None:
            for name in self._joints.keys() & set(names):
                self._joints[name].commands.count_refused()
            kind, text = wrong
            self._warn(f'joint commands: {kind}', sentences.joint_commands_refused(text))
            return
        if names != self._names:
            self._names = names
            self._parts = [(entry, self._joints[name].take_joint)
                           for entry, name in enumerate(names) if name in self._joints]
            for name in names:
                if name not in self._known:
                    self._tell_stranger(name)
        for quantity, values in columns:
            for entry, take in self._parts:
                take(quantity, values[entry], now)

    def take_old(self, message: JointMessage) -> None:
        """Handle a message that is too old: it may only stop, unless it is refused."""
        names, columns = message
        if self._problem(names, columns) is None:
            for entry, name in enumerate(names):
                if name in self._joints:
                    self._joints[name].commands.take_old(message, entry)

    def disarm(self) -> None:
        """Disarm all joints."""
        for drive in self._joints.values():
            drive.commands.disarm_joint()

    def refuse(self, topic: str, text: str) -> None:
        """Count and log a refused message, for every joint of it."""
        for drive in self._joints.values():
            drive.commands.count_refused()
        self._warn(topic, text)

    def _problem(self, names: list[str],
                 columns: Sequence[Column]) -> tuple[str, str] | None:
        """Return what kind of problem a message has, and the words for it; None: it has none."""
        if columns and not names:
            return 'no names', sentences.values_without_names(
                len(columns[0][1]), columns[0][0])
        for quantity, values in columns:
            if len(values) != len(names):
                return 'length', sentences.values_for_names(len(values), quantity, len(names))
        if names != self._names and len(set(names)) != len(names):
            twice, _ = Counter(names).most_common(1)[0]
            return 'twice', sentences.joint_twice(name=printable(twice))
        return None

    def _tell_stranger(self, name: str) -> None:
        """Log once that a joint is none of this bridge; there may be any number of them."""
        if name not in self._strangers and len(self._strangers) < STRANGERS_MAX:
            self._strangers.add(name)
            self._inform(sentences.foreign_joint(name=printable(name)))
