# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
All joints of a bridge, for whoever wants one message for all of them.

``~/joint_states`` is :mod:`.joint_states`. ``~/joint_commands`` has a subscription for each bus,
because each bus has a thread that takes commands just before its cycles; what concerns the drives
of other buses is left to theirs.
"""

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence

from rclpy.node import Node
from sensor_msgs.msg import JointState

from drive_can_bridge.clock import Clock
from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.core.text import printable
from drive_can_bridge.exchange.errand import Errand
from drive_can_bridge.ros.commands import CommandIntake
from drive_can_bridge.ros.drive_node import DriveNode
from drive_can_bridge.ros.joint_reader import Column, JointMessage, JointReader
from drive_can_bridge.ros.joint_states import JointStates
from drive_can_bridge.ros.log import Log
from drive_can_bridge.ros.polled_topics import PolledTopics, Warn
from drive_can_bridge.ros.stamps import Stamps

COMMANDS = '~/joint_commands'
#: so many joints of others are told of
STRANGERS_MAX = 100


class Joints:
    """
    The topics for all joints of a bridge.

    :param drives: by name.
    :param stamps: of the bridge.
    """

    def __init__(self, node: Node, log: Log, configuration: BridgeConfiguration,
                 drives: Mapping[str, DriveNode], stamps: Stamps, clock: Clock) -> None:
        self._now = clock.now
        speaker = log.speaker('')
        speaker.reset()
        warn = speaker.warn
        self._taken: list[PolledTopics] = []
        self._states: JointStates | None = None
        self._errand: Errand | None = None
        ordered = [drives[name] for name in configuration.drives]
        known = {drive.drive.joint.name for drive in ordered if drive.drive.joint is not None}
        for bus in configuration.buses:
            here = [drive for drive in ordered if drive.drive.bus == bus]
            joints = {drive.drive.joint.name: drive.commands for drive in here
                      if drive.drive.joint is not None}
            if not joints:
                continue
            if self._taken:     # the others hear the same, and need not tell it again
                taker = _Taker(joints, known, _nothing, _nothing)
            else:
                taker = _Taker(joints, known, warn, log.info)
            taken = PolledTopics(node, clock, warn, taker.refuse)
            self._taken.append(taken)
            taken.subscribe(JointState, COMMANDS, taker, taker.take_old, JointReader())
            for drive in here:
                drive.joint_commands = taken
        if configuration.joint_state_rate > 0.0:
            self._period = 1.0 / configuration.joint_state_rate
            self._states = JointStates(node, ordered, stamps, warn)
            self._errand = Errand(self._states.publish)
            for drive in ordered:
                drive.exchange.errand = self._errand

    def start(self) -> None:
        """Begin to publish."""
        if self._errand is not None:
            self._errand.begin(self._period, self._now())

    def destroy(self) -> None:
        """Take the topics out of the node. Nobody may take commands any more."""
        if self._errand is not None:
            self._errand.end()
        while self._taken:
            self._taken.pop().unsubscribe()
        if self._states is not None:
            self._states.publish(self._now())  # the last joints have gone
            self._states.destroy()
            self._states = None


def _nothing(*_: object, **__: object) -> None:
    """Leave it to somebody else to tell."""


class _Taker:
    """
    Takes messages for the joints of one bus.

    :param joints: who takes what concerns a joint, by its name.
    :param known: the names of all joints of the bridge.
    :param warn: takes what is wrong with a message.
    :param inform: takes what nobody has to do anything about.
    """

    def __init__(self, joints: Mapping[str, CommandIntake], known: Collection[str],
                 warn: Warn, inform: Callable[[str], None]) -> None:
        self._joints = joints
        self._known = known
        self._warn = warn
        self._inform = inform
        self._strangers: set[str] = set()
        #: names of the last message that was in order, and who takes which entry of such a one
        self._names: list[str] | None = None
        self._parts: list[tuple[int, Callable[[str, float, float], None]]] = []

    def __call__(self, message: JointMessage, now: float) -> None:
        """Hand each joint its part."""
        names, columns = message
        wrong = self._problem(names, columns)
        if wrong is not None:
            for name in self._joints.keys() & set(names):
                self._joints[name].count_refused()
            kind, text = wrong
            self._warn(f'joint commands: {kind}', f'joint_commands refused: {text}')
            return
        if names != self._names:
            self._names = names
            self._parts = [(entry, self._joints[name].take_quantity)
                           for entry, name in enumerate(names) if name in self._joints]
            for name in names:
                if name not in self._known:
                    self._tell_stranger(name)
        for quantity, values in columns:
            for entry, take in self._parts:
                take(quantity, values[entry], now)

    def take_old(self, message: JointMessage) -> None:
        """Take what a message that is thrown away for its age may stop, unless it is refused."""
        names, columns = message
        if self._problem(names, columns) is None:
            for entry, name in enumerate(names):
                if name in self._joints:
                    self._joints[name].take_old(message, entry)

    def refuse(self, topic: str, text: str) -> None:
        """Count and tell a message that is thrown away, for all that it might have moved."""
        for intake in self._joints.values():
            intake.count_refused()
        self._warn(topic, text)

    def _problem(self, names: list[str],
                 columns: Sequence[Column]) -> tuple[str, str] | None:
        """Return what kind of problem a message has, and the words for it; None: it has none."""
        if columns and not names:
            return 'no names', f'{len(columns[0][1])} {columns[0][0]} values and no names'
        for quantity, values in columns:
            if len(values) != len(names):
                return 'length', (
                    f'{len(values)} {quantity} values for {len(names)} names; allowed are as '
                    f'many as names, with NaN for joints that are to be left alone, or none')
        if names != self._names and len(set(names)) != len(names):
            twice, _ = Counter(names).most_common(1)[0]
            return 'twice', f'{printable(twice)} stands twice, allowed is once'
        return None

    def _tell_stranger(self, name: str) -> None:
        """Say once that a joint is none of this bridge; there may be any number of them."""
        if name not in self._strangers and len(self._strangers) < STRANGERS_MAX:
            self._strangers.add(name)
            self._inform(f'joint_commands name {printable(name)}, which is no joint of this '
                         f'bridge: ignored')
