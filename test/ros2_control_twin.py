# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What stands at the other end of ``~/joint_states`` and ``~/joint_commands``, as it behaves.

The hardware interface and the controllers are written in C++ and not installed here. This does
what they do with messages, traps included, and has been compared with the real ones. Lines are of
``joint_state_topic_hardware_interface`` 1.1.0 (JSTHI: its one file in src/),
``hardware_interface`` 4.46.0 (RM: src/resource_manager.cpp, HC: src/hardware_component.cpp) and
``joint_trajectory_controller`` 4.42.0 (JTC: src/joint_trajectory_controller.cpp, TOL:
include/joint_trajectory_controller/tolerances.hpp).

* states come with the quality of sensor data; only the latest message is kept, and it is copied
  field by field over the one that ``read()`` is looking at, without a lock (JSTHI 75-77, 103-145):
  so ``read()`` may meet any mixture of two messages in a row;
* arrays may be empty; one that is shorter than the names is an exception, and so is a finite value
  for an interface that the joint lacks; what is not finite is skipped, and the last value stays
  (JSTHI 121-144);
* an exception in ``read()`` ends neither process nor controller manager: the component becomes
  ``unconfigured``, its interfaces are gone, and the controllers that use them are deactivated; it
  comes back by hand (RM 2483-2508, HC 241-258);
* commands go with a queue of one; each kind of interface is one array, without gaps for joints
  that lack it; nothing is sent while all commands together differ from the states by no more than
  ``trigger_joint_command_threshold`` (JSTHI 73, 180-233).

``robot_state_publisher`` and MoveIt take a message only if it has a position for each name.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product
import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from rclpy.qos import qos_profile_sensor_data, QoSProfile
from sensor_msgs.msg import JointState

KINDS = ('position', 'velocity', 'effort')
PLUGIN = 'joint_state_topic_hardware_interface/JointStateTopicSystem'
#: what ``read()`` looks at, in the order in which it is copied
FIELDS = ('name', *KINDS)


class Thrown(Exception):
    """An exception in C++ that the resource manager catches."""


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
    ``read()`` and ``write()`` of the hardware interface, and what becomes of it when they throw.

    :param node: what publishes and subscribes.
    :ivar state: by (joint, kind); NaN until something was received.
    :ivar command: the same.
    :ivar thrown: why it is ``unconfigured``; '': it is active.
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
        self.thrown = ''
        self._torn = ''
        self._publisher = node.create_publisher(
            JointState, parameters.get('joint_commands_topic', '/robot_joint_commands'),
            QoSProfile(depth=1))
        self._subscription = node.create_subscription(
            JointState, parameters.get('joint_states_topic', '/robot_joint_states'),
            self._received, qos_profile_sensor_data)

    @property
    def configured(self) -> bool:
        """Whether there are interfaces that controllers can have."""
        return not self.thrown

    def configure(self) -> None:
        """Do what a person does: ``ros2 control set_hardware_component_state … active``."""
        self.thrown = self._torn = ''

    def _received(self, message: JointState) -> None:
        alike = _shape(message) == _shape(self.latest)
        for mixture in () if alike else _mixtures(self.latest, message):
            try:
                self._values(mixture)
            except Thrown as error:     # once in some thousand times, there; here at once
                self._torn = f'read() while a message was copied: {error}'
        self.latest = message

    def read(self) -> None:
        """Take what was received last, once more if nothing has come since."""
        if not self.configured:
            return
        try:
            if self._torn:
                raise Thrown(self._torn)
            self.state.update(self._values({field: getattr(self.latest, field)
                                            for field in FIELDS}))
        except Thrown as error:
            self.thrown = str(error)

    def _values(self, message: Mapping[str, Any]) -> dict[tuple[str, str], float]:
        """Return what a message says of the joints of this system."""
        found = {}
        for place, name in enumerate(message['name']):
            if name not in self.system.states:
                continue
            for kind in KINDS:
                values = message[kind]
                if not len(values):
                    continue
                if place >= len(values):
                    raise Thrown(f'vector::_M_range_check: {kind} {place} of {len(values)}')
                if math.isfinite(values[place]):
                    if (name, kind) not in self.state:
                        raise Thrown(f'{name} has no state interface {kind}')
                    found[name, kind] = values[place]
        return found

    def message(self) -> JointState | None:
        """Return what is sent now; None: nothing."""
        # an interface that is commanded but has no state throws there, each time
        difference = sum(abs(self.state[key] - value) for key, value in self.command.items())
        if difference <= self.threshold:
            return None
        message = JointState(name=list(self.system.commands))
        for (_, kind), value in self.command.items():
            getattr(message, kind).append(value)
        return message

    def write(self) -> None:
        """Send the commands, if they are worth it."""
        message = self.message() if self.configured else None
        if message is not None:
            self._publisher.publish(message)


def _shape(message: JointState) -> list[int]:
    return [len(getattr(message, field)) for field in FIELDS]


def _mixtures(old: JointState, new: JointState) -> Iterator[dict[str, Any]]:
    """Return what ``read()`` may find while one message is copied over another."""
    for taken in product((old, new), repeat=len(FIELDS)):
        yield {field: getattr(message, field) for field, message in zip(FIELDS, taken)}


@dataclass(frozen=True)
class Constraints:
    """
    ``constraints`` of a ``joint_trajectory_controller``; 0 means that nothing is checked.

    :param joints: (trajectory, goal) in rad, by joint.
    """

    goal_time: float
    stopped_velocity_tolerance: float
    joints: Mapping[str, tuple[float, float]]

    @classmethod
    def of(cls, parameters: Mapping[str, Any]) -> 'Constraints':
        """Read them, with the controller's own defaults, from its parameters."""
        given = parameters.get('constraints', {})
        return cls(given.get('goal_time', 0.0), given.get('stopped_velocity_tolerance', 0.01), {
            joint: (given.get(joint, {}).get('trajectory', 0.0),
                    given.get(joint, {}).get('goal', 0.0)) for joint in parameters['joints']})


def within(error: float, tolerance: float) -> bool:
    """
    Tell whether a tolerance is kept, as TOL 308-311 does: 0 is skipped, and NaN passes.

    What is written there is ``!(tolerance > 0.0 && abs(error) > tolerance)``.
    """
    return not (tolerance > 0.0 and abs(error) > tolerance)


class TrajectoryTwin:
    """
    ``joint_trajectory_controller``: holds what it finds when it is activated, then interpolates.

    It interpolates with the velocities of a goal that begins and ends standing, checks what the
    axes do meanwhile, and holds them where they are when they do not follow (JTC 372-407, 467-491,
    493-539, 1839-1849).

    :param constraints: of its joints, which have position commands.
    :param period: s between two updates.
    :ivar result: of the last goal: '' while it is under way, 'succeeded', 'path', 'goal time'.
    """

    def __init__(self, hardware: HardwareTwin, constraints: Constraints,
                 period: float = 0.01) -> None:
        self._hardware = hardware
        self._constraints = constraints
        self._period = period
        self._from: dict[str, float] = {}
        self._to: dict[str, float] = {}
        self._began = self._duration = 0.0
        self.result = 'succeeded'
        self.active = False

    def activate(self) -> None:
        """Hold the present position."""
        assert self._hardware.configured, self._hardware.thrown
        self._hold('succeeded')
        self.active = True

    def deactivate(self) -> None:
        """Leave the command interfaces alone: they keep what was in them."""
        self.active = False

    def go(self, goal: dict[str, float], duration: float, now: float) -> None:
        """Go somewhere within so many s, from where the axes are (JTC 311)."""
        assert self.active and goal.keys() == self._constraints.joints.keys()
        self._from, self._to = self._states(), goal
        self._began, self._duration = now, duration
        self.result = ''

    def done(self, now: float) -> bool:
        """Tell whether the goal has been commanded."""
        return now >= self._began + self._duration

    def update(self, now: float) -> None:
        """Write the commands of this cycle."""
        if not self._hardware.configured:
            self.active = False
        if not self.active:
            return
        if not self.result:
            self._check(now)
        for joint, value in self.desired(now + self._period).items():
            self._hardware.command[joint, 'position'] = value

    def desired(self, now: float) -> dict[str, float]:
        """Return where the axes are to be."""
        share = 1.0 if self._duration <= 0.0 else min(
            1.0, max(0.0, (now - self._began) / self._duration))
        smooth = share * share * (3.0 - 2.0 * share)
        return {joint: self._from[joint] + smooth * (self._to[joint] - self._from[joint])
                for joint in self._to}

    def _check(self, now: float) -> None:
        """Look whether the axes follow, and whether the goal is reached."""
        desired, actual = self.desired(now), self._states()
        past = now - self._began - self._duration
        place = 0 if past < 0.0 else 1
        # velocities are not compared where only positions are commanded (JTC 1510-1515)
        kept = all(within(desired[joint] - actual[joint], tolerances[place])
                   for joint, tolerances in self._constraints.joints.items())
        if past < 0.0:
            if not kept:
                self._hold('path')
        elif kept:
            self.result = 'succeeded'   # and the goal is what it goes on to hold
        elif 0.0 < self._constraints.goal_time < past:
            self._hold('goal time')

    def _hold(self, result: str) -> None:
        self._from = self._to = self._states()
        self._duration = 0.0
        self.result = result

    def _states(self) -> dict[str, float]:
        return {joint: self._hardware.state[joint, 'position']
                for joint in self._constraints.joints}


def takes_positions(message: JointState) -> bool:
    """Tell whether robot_state_publisher and MoveIt's state monitor take a message."""
    return len(message.position) == len(message.name)


def run(hardware: HardwareTwin, update: Callable[[], None]) -> None:
    """Do one cycle of the controller manager."""
    hardware.read()
    update()
    hardware.write()
