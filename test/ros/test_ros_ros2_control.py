# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The example for ros2_control, with the hardware interface's twin, over three simulated axes.

The axes carry a load and their encoders are noisy. Whatever happens, no setpoint jumps, and no
axis moves by more than an encoder step unless a trajectory moves it.
"""

from collections.abc import Callable, Iterator
import math
from pathlib import Path
import struct
from typing import Any

from bridges import Bridge, cyclic_identifier, Recorder, StartBridge
from clients import Client, wait_until
from extent import some
import pytest
from ros2_control_twin import (
    Constraints, HardwareTwin, run, System, takes_positions, TrajectoryTwin,
)
from std_srvs.srv import SetBool, Trigger
from waiting import clock
import yaml

from drive_can_bridge.core.sentences import rearm_would_jump
from drive_can_bridge.simulation.registers import Mechanics

FOLDER = Path(__file__).parents[2] / 'config' / 'ros2_control'
AXES = {'shoulder': 1, 'elbow': 2, 'wrist': 3}
REMAPS = ('-r', '~/joint_states:=/robot_joint_states',
          '-r', '~/joint_commands:=/robot_joint_commands')
#: rad of each joint; what its drive measures then, in steps of 0.01 deg
GOAL = {'shoulder_joint': 0.5, 'elbow_joint': -0.4, 'wrist_joint': 0.3}
AWAY = dict.fromkeys(GOAL, -0.6)
GEAR = {'shoulder': 1.0, 'elbow': -1.0, 'wrist': 2.0}
#: a vertical axis has a brake; the encoder is off by one step now and then, or never
NOISE = 1
MECHANICS = Mechanics(load=0.3, noise=NOISE, brake=1)
EXACT = Mechanics(load=0.3, noise=0, brake=1)
BOTH = pytest.mark.parametrize('arm', [MECHANICS, EXACT], ids=['noise', 'exact'], indirect=True)
#: words of the control word
DISABLE, ENABLE = 0, 1


def content(robot: str) -> dict[str, Any]:
    """Return the example's parameters with a virtual bus, and patience with a busy machine."""
    text = (FOLDER / f'{robot}.yaml').read_text(encoding='utf-8')
    parameters: dict[str, Any] = yaml.safe_load(text)['/**/drive_can_bridge']['ros__parameters']
    parameters['buses']['main'] = {'interface': 'virtual', 'bitrate': 1_000_000,
                                   'reconnect_period': 0.1}
    parameters['diagnostics_period'] = 0.1
    for drive in parameters['drives'].values():
        drive.update(command_timeout=5.0, missed_limit=40, parameter_timeout=0.5,
                     control_timeout=20.0)
    return parameters


def constraints() -> Constraints:
    """Return those of the example."""
    text = (FOLDER / 'arm_controllers.yaml').read_text(encoding='utf-8')
    return Constraints.of(yaml.safe_load(text)['arm_controller']['ros__parameters'])


class Manager:
    """The controller manager: a cycle every 10 ms, in a thread of its own."""

    def __init__(self, client: Client, robot: str) -> None:
        self.system = System(FOLDER / f'{robot}.urdf')
        self.hardware = HardwareTwin(client.node, self.system)
        self.update: Callable[[], None] = lambda: None
        self.crash = ''
        self._ending = clock().wake_event()
        self._worker = clock().worker(self._run, 'controllers')
        self._worker.start()

    def _run(self) -> None:
        while not self._ending.wait(clock().now() + 0.01):
            try:
                run(self.hardware, self.update)
            except Exception as error:  # noqa: BLE001  outermost loop of a thread
                self.crash = f'{type(error).__name__}: {error}'
                return

    def close(self) -> None:
        self._ending.ring()
        self._worker.join()
        assert not self.crash
        assert not self.hardware.thrown, 'the component is unconfigured, no controller is active'


class Arm:
    """The whole arm: bridge, drives, manager, controller, and a record of the bus."""

    def __init__(self, one: Bridge, client: Client, manager: Manager, recorder: Recorder) -> None:
        self.one, self.client, self.manager, self.recorder = one, client, manager, recorder
        self.controller = TrajectoryTwin(manager.hardware, constraints())
        manager.update = lambda: self.controller.update(clock().now())

    def steps(self, name: str) -> int:
        """Return where an axis really is, in steps; the encoder's noise is not in it."""
        axis: Any = self.one.played[name].drive.plant
        return round(100 * axis.motor.shaft.position)

    def enable(self, name: str, wanted: bool = True) -> None:
        answer = self.client.call(f'/{name}/enable', SetBool, SetBool.Request(data=wanted))
        assert answer.success, answer.message

    def activate(self) -> None:
        """Activate the controller once states are there; wait until it has armed all axes."""
        wait_until(lambda: all(math.isfinite(self.manager.hardware.state[joint, 'position'])
                               for joint in GOAL))
        self.controller.activate()
        wait_until(lambda: all(self.armed(name) for name in AXES), what='armed axes')

    def armed(self, name: str) -> bool:
        return all(item.armed for item in self.one.node.drives[name].session.setpoints.items)

    def go(self, goal: dict[str, float], duration: float = 2.0) -> None:
        self.controller.go(goal, duration, clock().now())

    def go_until(self, goal: dict[str, float], condition: Callable[[], Any],
                 duration: float = 2.0) -> None:
        """
        Go there, and return once something is true.

        On a machine that stood still for a moment the axes did not follow: then once more.
        """
        self.go(goal, duration)

        def look() -> Any:
            if self.controller.result in ('path', 'goal time'):
                self.go(goal, duration)
            return condition()
        wait_until(look, what='the axes to go there')

    def travel(self, goal: dict[str, float]) -> None:
        """Go there, and wait until the controller says that it succeeded."""
        self.go_until(goal, lambda: self.controller.result == 'succeeded', 1.2)
        wait_until(lambda: all(abs(self.steps(name) - wanted(goal, name)) <= 1 for name in AXES),
                   what='the goal')

    def aborted(self) -> None:
        """Wait until the controller has noticed that an axis does not follow."""
        wait_until(lambda: self.controller.result == 'path', what='the controller to abort')

    def exchanges(self, name: str, count: int = 10) -> None:
        """Wait until so many further exchanges are over."""
        statistics = self.one.node.drives[name].session.statistics
        start = statistics.exchanges
        wait_until(lambda: statistics.exchanges >= start + count)

    def requests(self, name: str) -> list[tuple[int, int]]:
        """Return control word and position of all cyclic requests so far."""
        self.recorder.catch_up()
        return [struct.unpack('>Hh', data[:4])
                for _, data in self.recorder.frames(cyclic_identifier(AXES[name]))]


def wanted(goal: dict[str, float], name: str) -> int:
    return round(100 * math.degrees(goal[f'{name}_joint']) * GEAR[name])


@pytest.fixture
def arm(bridge: StartBridge, client: Client, request: pytest.FixtureRequest) -> Iterator[Arm]:
    """Return the arm, online and disabled, standing where nobody would guess."""
    one = bridge(content('arm'), arguments=REMAPS,
                 mechanics=dict.fromkeys(AXES, getattr(request, 'param', MECHANICS))).online()
    manager = Manager(client, 'arm')
    with one.record() as recorder:
        try:
            yield Arm(one, client, manager, recorder)
        finally:
            manager.close()


def no_jump(requests: list[tuple[int, int]], stood: int, steps: int = 1) -> None:
    """
    Check that no setpoint is more than so many encoder steps away from where the axis is.

    That is, without a trajectory: where it stood as long as nothing drives it, and from then on
    where the setpoint before has sent it.
    """
    assert requests
    before = DISABLE
    for word, position in requests:
        assert abs(position - stood) <= steps, (before, word, position, stood)
        if word == ENABLE:
            stood = position
        before = word


def believed_twice(request: pytest.FixtureRequest) -> int:
    """
    Return by how many steps enabling and activating may move an axis.

    The encoder is believed twice, when the setpoint is latched and by the controller: what it is
    off by then is all that adds up.
    """
    return 2 * int(request.node.callspec.params['arm'].noise)


def moved(arm: Arm) -> None:
    """Enable all axes and move them to the goal."""
    for name in AXES:
        arm.enable(name)
    arm.activate()
    arm.travel(GOAL)


@BOTH
def test_moves_along_a_trajectory(arm: Arm, request: pytest.FixtureRequest) -> None:
    before = {name: arm.steps(name) for name in AXES}
    for name in AXES:
        arm.enable(name)
        arm.exchanges(name)     # what the controller is to hold was measured after that
    arm.activate()
    for name in AXES:
        no_jump(arm.requests(name), before[name])
        assert abs(arm.steps(name) - before[name]) <= believed_twice(request)
    arm.travel(GOAL)
    for joint, goal in GOAL.items():
        wait_until(lambda joint=joint, goal=goal: arm.manager.hardware.state[
            joint, 'position'] == pytest.approx(goal, abs=0.0005))
    message = arm.manager.hardware.latest
    assert takes_positions(message)
    assert list(message.name) == list(GOAL)


def test_stop_and_enable_again(arm: Arm) -> None:
    """The controller notices, and goes on without being activated anew."""
    moved(arm)
    arm.go_until(AWAY, lambda: arm.steps('shoulder') < wanted(GOAL, 'shoulder') - 500)
    arm.enable('shoulder', False)
    arm.aborted()
    arm.exchanges('shoulder')
    stood = arm.steps('shoulder')
    arm.recorder.clear()
    arm.exchanges('shoulder', 50)
    assert abs(arm.steps('shoulder') - stood) <= 1, 'the brake holds'
    for name in ('elbow', 'wrist'):
        assert abs(arm.steps(name) - wanted(AWAY, name)) > 500, 'nobody goes on'
    arm.enable('shoulder')
    arm.exchanges('shoulder', 50)
    assert abs(arm.steps('shoulder') - stood) <= 2 * NOISE, 'no jump, and no sagging'
    wait_until(lambda: arm.armed('shoulder'), what='what the controller holds is near enough')
    arm.exchanges('shoulder', 20)
    no_jump(arm.requests('shoulder'), stood, 2 * NOISE)
    assert abs(arm.steps('shoulder') - stood) <= 2 * NOISE, 'enabled, and held by the controller'
    arm.travel(GOAL)


def test_a_command_of_before_moves_nothing(arm: Arm) -> None:
    """The hardware interface repeats the last command of an inactive controller for ever."""
    moved(arm)
    arm.controller.deactivate()
    for name in AXES:
        arm.enable(name, False)
        arm.manager.hardware.command[f'{name}_joint', 'position'] = -0.6
    arm.exchanges('shoulder')
    stood = {name: arm.steps(name) for name in AXES}
    arm.recorder.clear()
    for name in AXES:
        arm.enable(name)
        arm.exchanges(name, 50)
        assert not arm.armed(name)
        no_jump(arm.requests(name), stood[name])
    arm.activate()
    arm.travel(GOAL)


def test_fault_reset_and_enable_again(arm: Arm) -> None:
    moved(arm)
    arm.go_until(AWAY, lambda: arm.steps('elbow') > wanted(GOAL, 'elbow') + 500)
    arm.one.played['elbow'].fault('trip')
    arm.client.diagnostics('drive_can_bridge: drive elbow',
                           lambda facts: facts['state'] == 'fault')
    arm.aborted()
    arm.exchanges('elbow')
    stood = arm.steps('elbow')
    arm.recorder.clear()
    assert arm.client.call('/elbow/reset_fault', Trigger).success
    arm.enable('elbow')
    arm.exchanges('elbow', 50)
    assert abs(arm.steps('elbow') - stood) <= 2 * NOISE
    no_jump(arm.requests('elbow'), stood, 2 * NOISE)
    arm.travel(GOAL)


@pytest.mark.parametrize(('fault', 'arm'), some([
    ('silent', MECHANICS), ('silent', EXACT),
    ('power_cut=1.5', EXACT), ('power_cut=1.5', MECHANICS)], 4), indirect=['arm'])
def test_lost_drive(arm: Arm, fault: str, request: pytest.FixtureRequest) -> None:
    """Silent, or without power for a while: it is where it was, or where it was left."""
    moved(arm)
    drive = arm.one.node.drives['wrist']
    arm.exchanges('wrist')
    wait_until(lambda: arm.steps('wrist') == arm.requests('wrist')[-1][1], what='standing still')
    stood = arm.steps('wrist')
    arm.recorder.clear()
    arm.one.played['wrist'].fault(fault)
    wait_until(lambda: not drive.session.online, what='offline')
    wait_until(lambda: math.isnan(arm.manager.hardware.latest.position[2]))
    assert math.isfinite(arm.manager.hardware.state['wrist_joint', 'position']), 'kept for ever'
    if fault == 'silent':
        arm.one.played['wrist'].fault('ok')
    arm.one.online('wrist')
    arm.enable('wrist')
    wait_until(lambda: arm.armed('wrist'), what='the controller holds it where it was')
    arm.exchanges('wrist', 50)
    requests = arm.requests('wrist')
    no_jump(requests, stood, 2 * NOISE)
    moved_by = max(abs(position - stood) for _, position in requests)
    assert moved_by <= believed_twice(request)
    assert abs(arm.steps('wrist') - stood) <= moved_by
    arm.travel(dict.fromkeys(GOAL, 0.0))


def test_nothing_creeps_for_a_long_time(arm: Arm) -> None:
    moved(arm)
    arm.controller.deactivate()     # its command interfaces keep what was in them
    stood = {name: arm.steps(name) for name in AXES}
    arm.recorder.clear()
    for name in AXES:
        for _ in range(3):
            arm.enable(name, False)
            arm.enable(name)
            arm.exchanges(name)     # until it is where the noise has sent it
        arm.exchanges(name, 100)
    for name in AXES:
        no_jump(arm.requests(name), stood[name])
        # each enabling may take a step of noise into the setpoint
        assert abs(arm.steps(name) - stood[name]) <= 3 * NOISE
        positions = {position for _, position in arm.requests(name)[-100:]}
        assert len(positions) == 1, 'held, whatever the encoder says'


def test_rearm_stays_neutral(arm: Arm) -> None:
    (answer,) = arm.client.set('/drive_can_bridge', **{'drives.wrist.rearm': 'immediate'})
    assert answer == (False, rearm_would_jump('position_setpoint'))


def test_base_with_wheels(bridge: StartBridge, client: Client) -> None:
    """Velocity interfaces: both wheels forward, of which one is mounted the other way."""
    one = bridge(content('base'), arguments=REMAPS).online()
    manager = Manager(client, 'base')
    try:
        for name in ('left_wheel', 'right_wheel'):
            assert client.call(f'/{name}/enable', SetBool, SetBool.Request(data=True)).success
        command = manager.hardware.command
        command.update({('left_wheel_joint', 'velocity'): 0.0,
                        ('right_wheel_joint', 'velocity'): 0.0})
        wait_until(lambda: all(drive.session.setpoints.items[0].armed
                               for drive in one.node.drives.values()))
        command.update({('left_wheel_joint', 'velocity'): 2.0,
                        ('right_wheel_joint', 'velocity'): 3.0})
        state = manager.hardware.state
        wait_until(lambda: state['left_wheel_joint', 'velocity'] == pytest.approx(2.0, abs=0.01)
                   and state['right_wheel_joint', 'velocity'] == pytest.approx(3.0, abs=0.01))
        assert one.played['left_wheel'].value('actual_speed') == pytest.approx(382.0, abs=0.1)
        assert one.played['right_wheel'].value('actual_speed') == pytest.approx(-573.0, abs=0.1)
        message = manager.hardware.latest
        assert takes_positions(message)
        # its counter began 10 turns before its end: it begins again, and the joint goes on
        left = one.played['left_wheel']
        wait_until(lambda: left.value('actual_position') < 0.0, what='the counter has wrapped')
        turned = (float(left.value('actual_position')) + 655.36) / 20.0
        assert state['left_wheel_joint', 'position'] == pytest.approx(
            2.0 * math.pi * turned, abs=5.0)

        # without power at speed: neutral until commanded neutral, whatever the controller goes on
        one.played['right_wheel'].fault('power_cut=4')
        wait_until(lambda: math.isnan(manager.hardware.latest.velocity[1]), what='NaN')
        assert state['right_wheel_joint', 'velocity'] == pytest.approx(3.0, abs=0.1), 'for ever'
        one.online('right_wheel')
        with one.record() as recorder:
            assert client.call('/right_wheel/enable', SetBool, SetBool.Request(data=True)).success
            wait_until(lambda: len([words for words in recorder.cycles(2) if words[0]]) > 50)
            assert {words[1] for words in recorder.cycles(2)} == {0}
            assert {words[1] for words in recorder.cycles(1)} == {3820}     # 0.1 rpm of the motor
            command['right_wheel_joint', 'velocity'] = 0.0
            wait_until(lambda: one.node.drives['right_wheel'].session.setpoints.items[0].armed)
            command['right_wheel_joint', 'velocity'] = 3.0
            wait_until(lambda: recorder.words(2)[1] == -5730)
    finally:
        manager.close()
