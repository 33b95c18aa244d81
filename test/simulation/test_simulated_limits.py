# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Simulated motors obey limits; and the README's drive turns by what the README types."""

from dataclasses import replace
from pathlib import Path
import re
import shlex

from builders import Conversation, frame
import pytest
from simulation_builders import (
    ACTUAL_SPEED, INT16, motor, parameter, RO, SPEED_SETPOINT, TORQUE_LIMIT,
)
from timeline import Timeline
import yaml

import drive_can_bridge
from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.simulation.datamodel import SimulatedDataModelDrive

README = (Path(drive_can_bridge.__file__).resolve().parents[1] / 'README.md').read_text(
    encoding='utf-8')
PERIOD = 0.02


def speed_after(seconds: float, *limits: tuple[Parameter, float], target: float = 1500.0,
                load: float = 0.0) -> float:
    """Return the speed of a motor that had some time to get to another one."""
    made = motor([SPEED_SETPOINT, ACTUAL_SPEED, *(each for each, _ in limits)], load=load)
    for each, value in limits:
        made.set_value(each.name, value)
    made.set_value('speed_setpoint', target)
    speed = 0.0
    for step in range(round(seconds / PERIOD) + 1):     # as often as it is asked
        speed = float(made.value('actual_speed', step * PERIOD))
    return speed


class TestMotor:

    def test_enough_torque_changes_nothing(self) -> None:
        assert speed_after(0.24) == speed_after(0.24, (TORQUE_LIMIT, 100.0)) == 720.0

    def test_no_torque_no_turn(self) -> None:
        assert speed_after(3.0, (TORQUE_LIMIT, 0.0)) == 0.0

    def test_little_torque_turns_it_slowly_and_not_fast(self) -> None:
        assert 0.0 < speed_after(0.24, (TORQUE_LIMIT, 15.0)) < 720.0
        # friction takes 5 % of the torque, and the rated speed 30 %
        assert speed_after(9.0, (TORQUE_LIMIT, 15.0)) == pytest.approx(1000.0, abs=0.1)

    def test_a_load_that_it_cannot_hold_sinks(self) -> None:
        assert speed_after(3.0, (TORQUE_LIMIT, 20.0), load=0.5) == pytest.approx(-150.0)

    def test_without_torque_it_runs_down_instead_of_braking(self) -> None:
        made = motor([SPEED_SETPOINT, ACTUAL_SPEED, TORQUE_LIMIT])
        made.set_value('torque_limit', 100.0)
        made.set_value('speed_setpoint', 1500.0)
        assert made.value('actual_speed', 0.0) == 0.0
        assert made.value('actual_speed', 1.0) == 1500.0
        made.set_value('torque_limit', 0.0)
        made.set_value('speed_setpoint', 0.0)
        assert made.value('actual_speed', 1.5) == pytest.approx(1125.0)     # 3000 rpm in 4 s
        made.set_value('torque_limit', 100.0)
        assert made.value('actual_speed', 2.0) == 0.0

    def test_current_limit_and_speed_limit(self) -> None:
        amps = parameter('current_limit', 60, scale=0.1, unit='A')
        assert speed_after(3.0, (amps, 2.0)) == 0.0         # all of it magnetises
        assert speed_after(3.0, (amps, 10.0)) == 1500.0
        fast = parameter('maximum_speed', 61, scale=0.1, unit='rpm')
        assert speed_after(3.0, (fast, 300.0)) == 300.0
        assert speed_after(3.0, (fast, 300.0), target=-1500.0) == -300.0

    def test_what_nobody_can_scale_is_a_register(self) -> None:
        for unit in ('', 's'):
            strange = parameter('torque_limit', 62, unit=unit, scaled=True)
            assert speed_after(3.0, (strange, 0.0)) == 1500.0

    def test_a_new_drive_is_not_limited(self) -> None:
        for limit in (parameter('torque_limit', 62, unit='%', scaled=True),
                      parameter('speed_limit', 62, scale=0.1, unit='rpm'),
                      parameter('maximum_current', 62, unit='A', scaled=True)):
            made = motor([SPEED_SETPOINT, ACTUAL_SPEED, limit])
            made.set_value('speed_setpoint', 1500.0)
            assert made.value('actual_speed', 0.0) == 0.0
            assert made.value('actual_speed', 0.5) == 1500.0, limit.name

    def test_an_axis_that_goes_to_a_position(self) -> None:
        where = parameter('position_setpoint', 53, type=INT16, unit='deg', scaled=True)
        angle = parameter('actual_position', 54, type=INT16, unit='deg', scaled=True, access=RO)
        made = motor([where, angle, TORQUE_LIMIT])
        made.set_value('torque_limit', 0.0)
        made.set_value('position_setpoint', 90.0)
        assert made.value('actual_position', 0.0) == 0.0
        assert made.value('actual_position', 5.0) == 0.0
        made.set_value('torque_limit', 100.0)
        assert made.value('actual_position', 10.0) == 90.0


def readme_drive(folder: Path) -> DriveConfiguration:
    """Return the drive of the README's first configuration."""
    text, = re.findall(r'```yaml\n(# my_drives\.yaml\n.*?)```', README, re.DOTALL)
    (folder / 'my_drives.yaml').write_text(text, encoding='utf-8')
    drive, = configuration_from_file(str(folder / 'my_drives.yaml')).drives.values()
    return drive


def typed(drive: DriveConfiguration) -> list[tuple[int, float, float]]:
    """Return what the README publishes by hand: which setpoint, how often in a s, and what."""
    found = []
    for line in re.findall(r'^(?:\$ )?(ros2 topic pub .*)', README, re.MULTILINE):
        _, _, _, _, rate, topic, _, message = shlex.split(line, comments=True)
        _, name, _, parameter_name = topic.split('/')
        assert name == drive.name
        names = [each.name for each in drive.cyclic_request]
        found.append((names.index(parameter_name), float(rate), yaml.safe_load(message)['data']))
    return found


def fastest(drive: DriveConfiguration) -> float:
    """Type each command into a terminal of its own, the former ending a second later."""
    simulated = SimulatedDataModelDrive(drive)
    talk = Conversation(drive)

    def answer(text: str) -> tuple[float, str] | None:
        simulated.receive_frame(frame(text), talk.now)
        for reply in simulated.take_frames():
            return 0.001, str(reply)
        return None
    line = Timeline(talk, answer)
    talk.bus_up(9.0)
    talk.activate(10.0)
    begun_at, speed = 11.0, 0.0
    commands = typed(drive)
    for place, (index, rate, value) in enumerate(commands):
        seconds = 3.0 if place + 1 < len(commands) else 5.0
        for step in range(round(seconds * rate)):
            def publish(now: float, index: int = index, value: float = value) -> list[str]:
                talk.commands(index, value, now)
                return []
            line.plan(begun_at + step / rate, publish)
        begun_at += 2.0
    for step in range(1, 15):
        line.live(10.0 + step)
        speed = max(speed, abs(float(simulated.value('actual_speed', 10.0 + step))))
    return speed


def test_the_readme_drive_turns_by_what_the_readme_types(tmp_path: Path) -> None:
    drive = readme_drive(tmp_path)
    wanted = max(abs(value) for _, _, value in typed(drive))
    assert wanted > 0.0
    assert fastest(drive) == wanted


def test_it_does_not_where_the_limit_is_neutral_0(tmp_path: Path) -> None:
    drive = readme_drive(tmp_path)
    assert [each.limit for each in drive.cyclic_request] == [False, True]
    request = tuple(replace(each, neutral=0.0) if each.limit else each
                    for each in drive.cyclic_request)
    table = {**drive.profile.parameters, **{each.name: each for each in request}}
    none = replace(drive, cyclic_request=request,
                   profile=replace(drive.profile, parameters=table))
    assert fastest(none) == 0.0
