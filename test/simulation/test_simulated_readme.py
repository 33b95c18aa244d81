# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The README's drive turns by what the README types."""

from dataclasses import replace
from pathlib import Path
import re
import shlex

from builders import Conversation, frame
from timeline import Timeline
import yaml

import drive_can_bridge
from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.simulation.datamodel import SimulatedDataModelDrive

README = (Path(drive_can_bridge.__file__).resolve().parents[1] / 'README.md').read_text(
    encoding='utf-8')


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
