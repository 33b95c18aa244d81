# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What stands at the other end of ``~/joint_states`` and ``~/joint_commands``, as it behaves.

``joint_state_topic_hardware_interface`` 1.1.0 and the controllers are written in C++ and not
installed here. This does what they do with messages, traps included:

* states come with the quality of sensor data, and only the latest message is kept;
* arrays may be empty; one that is shorter than the names ends the process, and so does a finite
  value for an interface that the joint lacks; what is not finite is skipped;
* commands go with a queue of one; each kind of interface is one array, without gaps for joints
  that lack it; nothing is sent while all commands together differ from the states by no more than
  ``trigger_joint_command_threshold``.

``robot_state_publisher`` and MoveIt take a message only if it has a position for each name.
"""

from collections.abc import Callable, Sequence
import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from rclpy.qos import qos_profile_sensor_data, QoSProfile
from sensor_msgs.msg import JointState

KINDS = ('position', 'velocity', 'effort')
PLUGIN = 'joint_state_topic_hardware_interface/JointStateTopicSystem'


class Crash(Exception):
    """An exception in C++ that nobody catches: the controller manager ends."""


class System:
    """
    One ``ros2_control`` section of a robot description.

    :ivar commands: kinds of command interfaces by joint, in the order of the file.
    :ivar states: the same of state interfaces.
    """

    def __init__(self, urdf: Path) -> None:
        root = ElementTree.parse(urdf).getroot()
        (section,) = root.findall('ros2_control')
        assert section.get('type') == 'system'
        assert section.findtext('hardware/plugin', '').strip() == PLUGIN
        self.parameters = {str(entry.get('name')): (entry.text or '').strip()
                           for entry in section.findall('hardware/param')}
        self.commands, self.states = (
            {str(joint.get('name')): [str(entry.get('name')) for entry in joint.findall(tag)]
             for joint in section.findall('joint')}
            for tag in ('command_interface', 'state_interface'))
        self.described = {str(joint.get('name')) for joint in root.findall('joint')}


class HardwareTwin:
    """
    ``read()`` and ``write()`` of the hardware interface.

    :param node: what publishes and subscribes.
    :ivar state: by (joint, kind); NaN until something was received.
    :ivar command: the same.
    """

    def __init__(self, node: Any, system: System) -> None:
        parameters = system.parameters
        self.system = system
        self.threshold = float(parameters.get('trigger_joint_command_threshold', '1e-5'))
        self.state = {(joint, kind): math.nan for joint, kinds in system.states.items()
                      for kind in kinds}
        self.command = {(joint, kind): math.nan for joint, kinds in system.commands.items()
                        for kind in kinds}
        self.latest = JointState()
        self._publisher = node.create_publisher(
            JointState, parameters.get('joint_commands_topic', '/robot_joint_commands'),
            QoSProfile(depth=1))
        self._subscription = node.create_subscription(
            JointState, parameters.get('joint_states_topic', '/robot_joint_states'),
            self._received, qos_profile_sensor_data)

    def _received(self, message: JointState) -> None:
        self.latest = message

    def read(self) -> None:
        """Take what was received last, once more if nothing has come since."""
        message = self.latest
        for place, name in enumerate(message.name):
            if name not in self.system.states:
                continue
            for kind in KINDS:
                values = getattr(message, kind)
                if not len(values):
                    continue
                if place >= len(values):
                    raise Crash(f'{kind}.at({place}): only {len(values)} values')
                if math.isfinite(values[place]):
                    if (name, kind) not in self.state:
                        raise Crash(f'{name} has no state interface {kind}')
                    self.state[name, kind] = values[place]

    def message(self) -> JointState | None:
        """Return what is sent now; None: nothing."""
        difference = 0.0
        for key, value in self.command.items():
            if key not in self.state:
                raise Crash(f'{key} has a command interface, but no state interface')
            difference += abs(self.state[key] - value)
        if difference <= self.threshold:
            return None
        message = JointState(name=list(self.system.commands))
        for (_, kind), value in self.command.items():
            getattr(message, kind).append(value)
        return message

    def write(self) -> None:
        """Send the commands, if they are worth it."""
        message = self.message()
        if message is not None:
            self._publisher.publish(message)


class TrajectoryTwin:
    """
    ``joint_trajectory_controller``: holds what it finds when it is activated, then interpolates.

    :param joints: with position commands.
    """

    def __init__(self, hardware: HardwareTwin, joints: Sequence[str]) -> None:
        self._hardware = hardware
        self._joints = joints
        self._from: dict[str, float] = {}
        self._to: dict[str, float] = {}
        self._began = self._duration = 0.0
        self.active = False

    def activate(self) -> None:
        """Hold the present position."""
        self._to = {joint: self._hardware.state[joint, 'position'] for joint in self._joints}
        self._from, self._duration = self._to, 0.0
        self.active = True

    def deactivate(self) -> None:
        """Leave the command interfaces alone: they keep what was in them."""
        self.active = False

    def go(self, goal: dict[str, float], duration: float, now: float) -> None:
        """Go somewhere within so many s."""
        self._from, self._to = self._at(now), {**self._to, **goal}
        self._began, self._duration = now, duration

    def done(self, now: float) -> bool:
        """Tell whether the goal has been commanded."""
        return now >= self._began + self._duration

    def update(self, now: float) -> None:
        """Write the commands of this cycle."""
        if self.active:
            for joint, value in self._at(now).items():
                self._hardware.command[joint, 'position'] = value

    def _at(self, now: float) -> dict[str, float]:
        share = 1.0 if self._duration <= 0.0 else min(
            1.0, max(0.0, (now - self._began) / self._duration))
        smooth = share * share * (3.0 - 2.0 * share)
        return {joint: self._from[joint] + smooth * (self._to[joint] - self._from[joint])
                for joint in self._to}


def takes_positions(message: JointState) -> bool:
    """Tell whether robot_state_publisher and MoveIt's state monitor take a message."""
    return len(message.position) == len(message.name)


def run(hardware: HardwareTwin, update: Callable[[], None]) -> None:
    """Do one cycle of the controller manager."""
    hardware.read()
    update()
    hardware.write()
