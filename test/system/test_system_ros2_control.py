# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Faults on the way, with the example for ros2_control: bridge, drives and controllers in processes.

What happened is judged by the frames that the simulator recorded.
"""

from collections.abc import Callable
import json
import math
from pathlib import Path
import re
import struct
import sys
import time
from typing import Any, NamedTuple

from parameter_files import bridge_file
from processes import Client, Process, Processes, Simulator
import pytest
from waiting import SLOWNESS, wait_for
import yaml

FOLDER = Path(__file__).parents[2] / 'config' / 'ros2_control'
PERIOD = 0.02 * SLOWNESS
AXES = {'shoulder': 1, 'elbow': 2, 'wrist': 3}
#: turns of what is measured per turn of the joint, in steps of 0.01 deg
GEAR = {'shoulder': 1.0, 'elbow': -1.0, 'wrist': 2.0}
HERE = {'shoulder_joint': 0.4, 'elbow_joint': -0.4, 'wrist_joint': 0.4}
THERE = {'shoulder_joint': -0.6, 'elbow_joint': 0.6, 'wrist_joint': -0.6}
DURATION = 3.2 * SLOWNESS
#: rad; config/ros2_control/arm_controllers.yaml
TRAJECTORY = 0.1
#: s from the moment when an axis stands still until it is too far behind, at the speed it had
BEHIND_MAX = 0.3 * SLOWNESS
DISABLE, ENABLE, FAULT = 0, 1, 8
#: steps: what latching, holding and looking believe of the encoder's noise
NOISE = 3
#: steps; config/profiles/datamodel_axis_example.yaml
ARMING_TOLERANCE = 50


class Frame(NamedTuple):
    """A cyclic frame of one drive: its four words."""

    time: float
    answer: bool
    words: tuple[int, ...]


class Robot:
    """An example in processes of its own."""

    def __init__(self, robot: str, axes: dict[str, int], processes: Processes, client: Client,
                 namespace: str, directory: Path, *options: str) -> None:
        text = (FOLDER / f'{robot}.yaml').read_text(encoding='utf-8')
        given = yaml.safe_load(text)['/**/drive_can_bridge']['ros__parameters']
        for drive in given['drives'].values():
            drive.update(period=PERIOD, command_timeout=5.0 * SLOWNESS, missed_limit=100,
                         parameter_timeout=0.5 * SLOWNESS, control_timeout=20.0 * SLOWNESS)
        file = bridge_file(directory, drives=given['drives'], bus={'bitrate': 1_000_000},
                           joint_state_rate=given['joint_state_rate'])
        self.axes, self.client, self.namespace = axes, client, namespace
        self.simulator: Simulator = processes.simulator(file, *options)
        self.bridge = processes.bridge(file, namespace, *(
            part for topic in ('joint_states', 'joint_commands')
            for part in ('-r', f'~/{topic}:=/{namespace}/robot_{topic}')))
        self.manager: Process = processes.start(
            [sys.executable, str(Path(__file__).with_name('controllers.py')), robot, namespace],
            'controllers')
        for name in axes:
            client.online(f'/{namespace}/{name}')

    def ask(self, action: str, **arguments: Any) -> Any:
        """Let the controllers do something; return their answer."""
        wanted = len(self.manager.lines) + 1
        self.manager.write(json.dumps({'action': action, **arguments}))
        wait_for(lambda: len(self.manager.lines) >= wanted or not self.manager.running,
                 f'the controllers to {action}')
        return json.loads(self.manager.lines[wanted - 1])

    def call(self, name: str, service: str, wanted: bool | None = None) -> None:
        """Call a service of a drive; on a busy machine it may be lost just then."""
        wait_for(lambda: self.client.control(f'/{self.namespace}/{name}/{service}', wanted)[0],
                 f'{name}: {service}')

    def frames(self, name: str, since: float = 0.0) -> list[Frame]:
        """Return what was recorded of a drive's cycle."""
        request = self.axes[name] << 21 | 0x1FFFF0
        pattern = re.compile(rf'^\((\d+\.\d+)\) main (0|1){request:07X}#([0-9A-F]{{16}}) ')
        found = (pattern.match(line) for line in self.simulator.lines)
        return [Frame(float(match[1]), match[2] == '1',
                      struct.unpack('>4h', bytes.fromhex(match[3])))
                for match in found if match and float(match[1]) >= since]

    def wait_frames(self, name: str, condition: Callable[[Frame], bool], since: float = 0.0,
                    count: int = 1) -> list[Frame]:
        """Wait for so many frames of a drive, and return them."""
        found: list[Frame] = []

        def look() -> bool:
            found[:] = filter(condition, self.frames(name, since))
            return len(found) >= count
        wait_for(look, f'frames of {name}')
        return found

    def last_time(self) -> float:
        return max(self.frames(name)[-1].time for name in self.axes)


class Arm(Robot):
    """Three axes under load, with noisy encoders, enabled and held by their controller."""

    def __init__(self, processes: Processes, client: Client, namespace: str,
                 directory: Path) -> None:
        super().__init__('arm', AXES, processes, client, namespace, directory, *(
            part for name in AXES for part in ('--axis', f'{name}:load=0.3,noise=1,brake=1')))
        for name in AXES:
            self.call(name, 'enable', True)
        wait_for(lambda: self.ask('activate'), 'the states of all joints')
        self.travel(HERE)

    def travel(self, goal: dict[str, float]) -> None:
        """
        Go there, and wait until the controller says that it succeeded.

        Where the machine stood still for a moment, axes were too far behind: then once more.
        """
        self.ask('go', goal=goal, duration=DURATION)

        def look() -> bool:
            result = self.ask('result')
            if result in ('path', 'goal time'):
                for name in AXES:   # one may have been lost meanwhile
                    self.client.control(f'/{self.namespace}/{name}/enable', True)
                self.ask('go', goal=goal, duration=DURATION)
            return bool(result == 'succeeded')
        wait_for(look, f'the axes to go to {goal}')

    def under_way(self) -> tuple[float, Any]:
        """Go there, and return at full speed: when that began, and from where."""
        for _ in range(20):
            self.travel(HERE)
            began, where = self.ask('go', goal=THERE, duration=DURATION)
            while time.time() < began + 0.4 * DURATION and not self.ask('result'):
                time.sleep(0.02)
            if not self.ask('result') and time.time() < began + 0.5 * DURATION:
                return began, where
        raise AssertionError('this machine stands still too often')


def radians(name: str, frame: Frame) -> float:
    """Return the position that an answer says, or a request wants, of the joint."""
    return math.radians(0.01 * frame.words[1]) / GEAR[name]


def behind(name: str, begun: tuple[float, Any], stopped: Frame) -> float:
    """
    Return the s from an axis' last frame on its way until desired minus actual is too much.

    What is desired, the trajectory says: nobody has to be on time for it.
    """
    joint = f'{name}_joint'
    start, where = begun[0], begun[1][joint]
    for step in range(10_000):
        share = min(1.0, (stopped.time + 0.001 * step - start) / DURATION)
        desired = where + share * share * (3.0 - 2.0 * share) * (THERE[joint] - where)
        if abs(desired - radians(name, stopped)) > TRAJECTORY:
            return 0.001 * step
    raise AssertionError(f'{name} is never too far behind')


def no_jump(frames: list[Frame], steps: int) -> None:
    """Check that an axis that runs is not told to be elsewhere."""
    actual = next(frame.words[1] for frame in frames if frame.answer)
    for frame in frames:
        if frame.answer:
            actual = frame.words[1]
        elif frame.words[0] == ENABLE:
            assert abs(frame.words[1] - actual) <= steps, frame


@pytest.fixture
def arm(processes: Processes, client: Client, namespace: str, tmp_path: Path) -> Arm:
    return Arm(processes, client, namespace, tmp_path)


def goes_on(arm: Arm, name: str, since: float) -> None:
    """
    Enable an axis again: it stays where it is, and goes on without any restart.

    The controller holds the last position that it heard of; an axis that ran on for a moment, by
    less than what arms it, goes back there.
    """
    arm.call(name, 'enable', True)
    running = arm.wait_frames(name, lambda frame: not frame.answer and frame.words[0] == ENABLE,
                              since, count=50)
    frames = arm.frames(name, since)
    no_jump(frames[:frames.index(running[-1])], ARMING_TOLERANCE + NOISE)
    arm.travel(HERE)
    assert not arm.ask('look')['thrown']
    for other in AXES:
        assert radians(other, arm.frames(other)[-1]) == pytest.approx(HERE[f'{other}_joint'],
                                                                      abs=0.02)


@pytest.mark.real
def test_trip_on_the_way(arm: Arm) -> None:
    begun = arm.under_way()
    since = arm.last_time()
    arm.simulator.write('elbow trip')
    stopped = arm.wait_frames('elbow', lambda frame: frame.answer and bool(
        frame.words[0] & FAULT), since)[0]
    wait_for(lambda: arm.ask('result') == 'path', 'the controller to abort')
    assert behind('elbow', begun, stopped) < BEHIND_MAX
    since = arm.last_time()
    held = {name: arm.wait_frames(name, lambda frame: not frame.answer, since, count=50)[-20:]
            for name in ('shoulder', 'wrist')}
    for name, frames in held.items():
        assert len({frame.words[1] for frame in frames}) == 1, 'the others stop, too'
        assert abs(radians(name, frames[-1]) - THERE[f'{name}_joint']) > 0.1
    since = arm.last_time()
    arm.call('elbow', 'reset_fault')
    goes_on(arm, 'elbow', since)
    assert arm.bridge.end() == 0
