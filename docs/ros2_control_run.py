# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What docs/ros2_control.md shows: the arm of the example, with everything that may come between.

usage: ros2_control_run.py TRACE [NOTES]

NOTES: what happened when, ``[[seconds since 1970, text], …]``.

Bridge and simulated drives share a bus that is in this process, and ``drive_can record`` listens
to it; the controllers are those of ``test/ros2_control_twin.py``.
"""

from collections.abc import Callable
import json
import math
import os
from pathlib import Path
import signal
import sys
import tempfile
import threading
import time
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path += [str(HERE.parent / 'test' / folder) for folder in ('', 'ros', 'clocked')]

from bridges import Bridge  # noqa: E402
import rclpy  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.signals import SignalHandlerOptions  # noqa: E402
from ros2_control_twin import (  # noqa: E402
    Constraints, HardwareTwin, run, System, TrajectoryTwin,
)
from std_srvs.srv import SetBool, Trigger  # noqa: E402
import yaml  # noqa: E402

from drive_can_bridge.cli.main import main as drive_can  # noqa: E402
from drive_can_bridge.simulation.registers import Mechanics  # noqa: E402

FOLDER = HERE.parent / 'config' / 'ros2_control'
AXES = ('shoulder', 'elbow', 'wrist')
#: rad
HOME = {f'{name}_joint': 0.0 for name in AXES}
OUT = {'shoulder_joint': 0.6, 'elbow_joint': -0.4, 'wrist_joint': 0.3}
#: s of a cycle of the controllers, and of a wait that only a failure exceeds
PERIOD, PATIENCE = 0.01, 60.0


class Arm:
    """The arm, as whoever commands it sees it."""

    def __init__(self, node: Any, executor: SingleThreadedExecutor) -> None:
        self._node, self._executor = node, executor
        self.notes: list[tuple[float, str]] = []
        self.hardware = HardwareTwin(node, System(FOLDER / 'arm.urdf'))
        text = (FOLDER / 'arm_controllers.yaml').read_text(encoding='utf-8')
        self.controller = TrajectoryTwin(self.hardware, Constraints.of(
            yaml.safe_load(text)['arm_controller']['ros__parameters']))

    def note(self, text: str) -> None:
        """Say what happens now."""
        self.notes.append((time.time(), text))

    def pass_time(self, seconds: float) -> None:
        """Run the controllers for some time."""
        end = time.monotonic() + seconds
        self.wait(lambda: time.monotonic() >= end)

    def wait(self, condition: Callable[[], Any]) -> None:
        """Run the controllers until something is true."""
        begun = due = time.monotonic()
        while not condition():
            if time.monotonic() > begun + PATIENCE:
                raise SystemExit('ros2_control: the arm does not do what it should')
            run(self.hardware, lambda: self.controller.update(time.monotonic()))
            due += PERIOD
            while (left := due - time.monotonic()) > 0.0:
                self._executor.spin_once(timeout_sec=left)

    def call(self, name: str, kind: Any, **request: Any) -> None:
        """Call a service of a drive, while the controllers go on."""
        client = self._node.create_client(kind, name)
        self.wait(client.service_is_ready)
        future = client.call_async(kind.Request(**request))
        self.wait(future.done)
        if not future.result().success:
            raise SystemExit(f'ros2_control: {name}: {future.result().message}')
        self._node.destroy_client(client)

    def enable(self, *names: str, wanted: bool = True) -> None:
        """Enable or disable drives."""
        for name in names:
            self.call(f'/{name}/enable', SetBool, data=wanted)

    def go(self, goal: dict[str, float], duration: float) -> None:
        """Begin a trajectory."""
        self.controller.go(goal, duration, time.monotonic())

    def online(self, joint: str) -> bool:
        """Tell whether the last message says where a joint is."""
        message = self.hardware.latest
        return math.isfinite(message.position[message.name.index(joint)])

    def aborted(self) -> None:
        """Wait until the controller has noticed that an axis does not follow."""
        self.wait(lambda: self.controller.result == 'path')


def play(arm: Arm, one: Bridge) -> None:
    """Let happen what may happen."""
    arm.wait(lambda: all(math.isfinite(arm.hardware.state[joint, 'position']) for joint in HOME))
    arm.pass_time(0.5)
    arm.note('enable')
    arm.enable(*AXES)
    arm.controller.activate()
    arm.pass_time(0.5)
    arm.note('trajectory')
    arm.go(OUT, 2.0)
    arm.pass_time(2.5)
    arm.note('another')
    arm.go(HOME, 3.0)                   # stopped on the way
    arm.pass_time(1.0)
    arm.note('disable')
    arm.enable(*AXES, wanted=False)
    arm.aborted()
    arm.pass_time(0.5)
    arm.note('enable')
    arm.enable(*AXES)
    arm.pass_time(0.8)
    arm.note('trajectory')
    arm.go(OUT, 2.0)                    # a fault on the way
    arm.pass_time(0.7)
    arm.note('fault')
    one.played['shoulder'].fault('trip')
    arm.aborted()
    arm.pass_time(0.7)
    arm.note('reset, enable')
    arm.call('/shoulder/reset_fault', Trigger)
    arm.enable('shoulder')
    arm.pass_time(0.6)
    arm.note('trajectory')
    arm.go(HOME, 2.0)                   # a lost drive on the way
    arm.pass_time(0.7)
    arm.note('power lost')
    one.played['shoulder'].fault('power_cut=1')
    arm.wait(lambda: not arm.online('shoulder_joint'))
    arm.note('offline')
    arm.wait(lambda: arm.online('shoulder_joint'))
    arm.pass_time(0.3)
    arm.note('enable')
    arm.enable('shoulder')
    arm.pass_time(0.6)
    arm.note('trajectory')
    arm.go(HOME, 2.0)
    arm.pass_time(2.5)


def control(one: Bridge, failures: list[BaseException], notes: list[tuple[float, str]]) -> None:
    """Play it all, and end the recording."""
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node('controllers')
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        arm = Arm(node, executor)
        play(arm, one)
        notes += arm.notes
    except BaseException as error:  # noqa: BLE001  outermost loop of a thread
        failures.append(error)
    finally:
        node.destroy_node()
        rclpy.shutdown()
        os.kill(os.getpid(), signal.SIGINT)


def parameters() -> dict[str, Any]:
    """Return those of the example, with a bus in this process, which has the more to do."""
    text = (FOLDER / 'arm.yaml').read_text(encoding='utf-8')
    content: dict[str, Any] = yaml.safe_load(text)['/**/drive_can_bridge']['ros__parameters']
    content['buses']['main'].update(interface='virtual', channel='arm')
    for drive in content['drives'].values():
        drive.update(missed_limit=20, command_timeout=1.0)
    return content


def record(trace: Path, told: Path | None = None) -> None:
    """Play it all, and record the bus."""
    with tempfile.TemporaryDirectory() as folder:
        one = Bridge(Path(folder), parameters(),
                     arguments=('-r', '~/joint_states:=/robot_joint_states',
                                '-r', '~/joint_commands:=/robot_joint_commands',
                                '--log-level', 'error'),
                     mechanics=dict.fromkeys(AXES, Mechanics(load=0.3, noise=1, brake=1)))
        failures: list[BaseException] = []
        notes: list[tuple[float, str]] = []
        try:
            one.begin()
            controllers = threading.Thread(target=control, args=(one, failures, notes))
            # the recording ends by it, also where whoever started us had it ignored (nohup)
            signal.signal(signal.SIGINT, signal.default_int_handler)
            controllers.start()
            code = drive_can(['record', '-o', str(trace), '--params-file', str(one.file)])
            controllers.join()
            lost = {name: drive.times_lost for name, drive in one.node.drives.items()}
        finally:
            one.close()
    if failures or code:
        raise SystemExit(failures[0] if failures else code)
    if lost != {**dict.fromkeys(AXES, 0), 'shoulder': 1}:
        raise SystemExit(f'ros2_control: this machine is too busy, drives were lost: {lost}')
    if told is not None:
        told.write_text(json.dumps(notes), encoding='utf-8')


if __name__ == '__main__':
    record(*map(Path, sys.argv[1:]))
