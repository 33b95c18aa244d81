# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The twin of ros2_control does what the real one was seen to do."""

import math
from pathlib import Path
from typing import Any

import pytest
from ros2_control_twin import Constraints, HardwareTwin, run, System, TrajectoryTwin, within
from sensor_msgs.msg import JointState
import yaml

FOLDER = Path(__file__).parents[2] / 'config' / 'ros2_control'
JOINTS = ['shoulder_joint', 'elbow_joint', 'wrist_joint']
ZERO = [0.0] * 3


class Node:
    """Takes what is published; what is received is handed over by hand."""

    def __init__(self) -> None:
        self.published: list[JointState] = []

    def create_publisher(self, *_: Any) -> 'Node':
        return self

    def publish(self, message: JointState) -> None:
        self.published.append(message)

    def create_subscription(self, *arguments: Any) -> None:
        self.receive = arguments[2]


class Arm:
    """The example's system with its controller, in virtual time."""

    def __init__(self, urdf: Path = FOLDER / 'arm.urdf') -> None:
        self.node = Node()
        self.hardware = HardwareTwin(self.node, System(urdf))
        text = (FOLDER / 'arm_controllers.yaml').read_text(encoding='utf-8')
        self.controller = TrajectoryTwin(self.hardware, Constraints.of(
            yaml.safe_load(text)['arm_controller']['ros__parameters']))
        self.now = 0.0

    def states(self, position: list[float], names: list[str] = JOINTS, **more: Any) -> None:
        self.node.receive(JointState(name=names, position=position, **more))

    def cycle(self, count: int = 1) -> None:
        for _ in range(count):
            self.now += 0.01
            run(self.hardware, lambda: self.controller.update(self.now))


@pytest.fixture
def arm() -> Arm:
    one = Arm()
    one.states(ZERO)
    one.cycle()
    one.controller.activate()
    one.cycle()
    return one


@pytest.mark.parametrize('names', [JOINTS[:2], ['head_joint', *JOINTS]], ids=['less', 'more'])
def test_another_number_of_names_ends_the_component(arm: Arm, names: list[str]) -> None:
    sent = len(arm.node.published)
    arm.states([0.1] * len(names), names)
    arm.cycle(3)
    assert not arm.hardware.configured
    assert '_M_range_check' in arm.hardware.thrown
    assert not arm.controller.active
    assert len(arm.node.published) == sent, 'no axis is commanded any more'


def test_another_length_of_one_array_does_so_too(arm: Arm) -> None:
    arm.states(ZERO, velocity=ZERO[:1])
    arm.cycle()
    assert 'velocity 1 of 1' in arm.hardware.thrown


def test_nan_is_skipped_and_the_last_value_stays(arm: Arm) -> None:
    arm.states([0.1, 0.2, 0.3])
    arm.cycle()
    arm.states([0.4, math.nan, math.inf])
    arm.cycle()
    assert [arm.hardware.state[joint, 'position'] for joint in JOINTS] == [0.4, 0.2, 0.3]
    assert arm.hardware.configured


def test_a_value_without_an_interface_unconfigures_and_it_comes_back_by_hand(
        tmp_path: Path) -> None:
    text = (FOLDER / 'base.urdf').read_text(encoding='utf-8')
    less = tmp_path / 'base.urdf'
    less.write_text(text.replace('<state_interface name="position"/>', ''), encoding='utf-8')
    arm = Arm(less)
    names = ['left_wheel_joint', 'right_wheel_joint']
    arm.node.receive(JointState(name=names, velocity=[1.0, 2.0]))
    arm.cycle()
    assert arm.hardware.configured
    arm.node.receive(JointState(name=names, velocity=[1.0, 2.0], position=[math.nan, 0.5]))
    arm.cycle()
    assert 'right_wheel_joint has no state interface position' in arm.hardware.thrown
    sent = len(arm.node.published)
    arm.cycle(5)    # the controller manager goes on, without this component
    assert len(arm.node.published) == sent
    arm.node.receive(JointState(name=names, velocity=[3.0, 4.0]))
    arm.cycle()
    assert not arm.hardware.configured, 'not by itself'
    arm.hardware.configure()
    arm.cycle()
    assert arm.hardware.state['left_wheel_joint', 'velocity'] == 3.0
    assert len(arm.node.published) > sent


@pytest.mark.parametrize('error, tolerance, kept', [
    (0.1, 0.1, True), (0.11, 0.1, False), (-0.11, 0.1, False), (100.0, 0.0, True),
    (math.nan, 0.1, True), (math.inf, 0.1, False)])
def test_tolerances(error: float, tolerance: float, kept: bool) -> None:
    assert within(error, tolerance) is kept


def test_an_axis_that_stands_still_aborts_and_holds_all(arm: Arm) -> None:
    arm.controller.go(dict(zip(JOINTS, (0.8, 0.0, -0.4))), 1.0, arm.now)
    begun = arm.now
    while not arm.controller.result:    # the shoulder stands still, the others are exact
        desired = arm.controller.desired(arm.now)
        arm.states([0.0, *(desired[joint] for joint in JOINTS[1:])])
        arm.cycle()
        assert arm.now < begun + 1.0
    assert arm.controller.result == 'path'
    held = arm.node.published[-1].position
    assert held[0] == 0.0 and -0.4 < held[2] < 0.0
    arm.cycle(100)
    assert arm.node.published[-1].position == held


def test_without_constraints_it_succeeds_all_the_same(arm: Arm) -> None:
    arm.controller = TrajectoryTwin(arm.hardware, Constraints.of({'joints': JOINTS}))
    arm.controller.activate()
    arm.controller.go(dict.fromkeys(JOINTS, 0.8), 1.0, arm.now)
    arm.cycle(110)
    assert arm.controller.result == 'succeeded'


def test_an_axis_that_stops_just_before_the_goal_aborts_in_the_end(arm: Arm) -> None:
    arm.controller.go(dict.fromkeys(JOINTS, 0.08), 1.0, arm.now)
    arm.cycle(140)      # 0.08 is within the tolerance of the way, not within that of the goal
    assert arm.controller.result == ''
    arm.cycle(20)
    assert arm.controller.result == 'goal time'
    assert list(arm.node.published[-1].position) == ZERO
