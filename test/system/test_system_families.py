# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Each family once as its user runs it: simulated drive, bridge and ROS node; one in three processes.

The simulated drive logs every frame and is thereby a witness of what was on the bus; what is
compared here are literal bytes of the manuals' tables, not of our codec. What else a family does
is shown where it is quicker: by its session, and by the contract of ``ros/``.
"""

from dataclasses import dataclass
from pathlib import Path
import re
from typing import Any

from parameter_files import bridge_file, CONVEYOR
from processes import Client, Processes
import pytest
from test_system_cannord import INVERTER, PROFILE
from test_system_canopen_pkw import PUMP
from test_system_datamodel_standard import SHORT
from test_system_reconnection import status_of
from waiting import wait_for_end


@dataclass(frozen=True)
class Facts:
    """
    One family; frames are patterns.

    :param drive: its section of the parameter file.
    :param commands: setpoint -> value.
    :param neutral: what the first setpoint frames are.
    :param moving: what carries the commands, all of them in order.
    :param actual: topic and limits of what the drive does then.
    :param parameter: name, a value to write, and the frames of that: request, response.
    :param refused: a parameter, a value that it does not take, and what is said.
    :param end: frames with setpoints begin so; the last ones, and how many.
    """

    drive: dict[str, Any]
    commands: dict[str, float]
    neutral: str
    moving: tuple[str, ...]
    actual: tuple[str, float, float]
    parameter: tuple[str, float, str, str]
    refused: tuple[str, float, str]
    end: tuple[str, str, int]
    bitrate: int = 125_000
    enable: bool = False
    profile: str = ''


#: 1500 = 05DCh; the torque limit beside it is 100 %, 1000 = 03E8h, and needs no arming
SPEED = {'speed_setpoint': 150.0}
FAMILIES = [
    Facts(
        # longer than the drive needs: it begins to count when it gets round to it
        {**CONVEYOR, 'eeprom_write_gap': 0.2}, SPEED, '^003FFFF0#000003E80{8} R$',
        ('^003FFFF0#05DC03E800000000 R$',),
        ('actual_speed', 145.0, 155.0),
        ('ramp_time', 7.25, '^003001E1#02D5000000000000 R$', '^102001E1#02D5.* T$'),
        ('ramp_time', 61.0, '0.01 to 60 s'), ('^003FFFF0#', '000003E80{8} R', 3)),
    Facts(
        SHORT, SPEED, '^3F1#06(320{12}|3300E8030{6}) R$', ('^3F1#063200DC05000000 R$',),
        ('actual_speed', 149.9, 150.1),
        ('ramp_time', 7.25, '^3F1#061E00D502000000 R$', '^7F1#D502A5A5A5A5A5A5 T$'),
        ('ramp_time', 61.0, '0.01 to 60 s'), ('^3F1#063200', '0000000000 R', 1)),
    Facts(
        INVERTER, {'frequency_setpoint': 25.0}, '^0C8#7F040000 R$',
        ('^0C8#7F040020 R$', '^0C9#370B0020 T$'), ('actual_frequency', 24.99, 25.01),
        ('acceleration_time', 99.99, '^2C8#6620000000000F27 R$', '^2C9#6610000000000F27 T$'),
        ('acceleration_time', 321.0, '320'), ('^0C8#', '7E040000 R', 3),
        enable=True, profile=PROFILE),
    Facts(
        PUMP, {}, '^505#C00200[2A]A00000000 R$', ('^505#C00200[2A]A01000000 R$',),
        ('average_current', 6.0, 6.6),
        ('flc1_ratio', 40.0, '^505#8C0200[2A]A28000000 R$', '^485#8C0200[2A]A00000000 T$'),
        ('motor_trip_class', 7.0, '06090030h (value out of range)'),
        ('^505#C00200[2A]A', '00000000 R', 1), bitrate=250_000, enable=True),
]


@pytest.mark.parametrize('facts', [
    pytest.param(facts, id=str(facts.drive['protocol']), marks=[pytest.mark.real] * (not place))
    for place, facts in enumerate(FAMILIES)])
def test_run_write_and_stop(processes: Processes, client: Client, namespace: str,
                            tmp_path: Path, facts: Facts) -> None:
    section = dict(facts.drive)
    if facts.profile:
        section['profile'] = str(tmp_path / 'profile.yaml')
        Path(section['profile']).write_text(facts.profile, encoding='utf-8')
    file = bridge_file(tmp_path, drives={'one': section}, bus={'bitrate': facts.bitrate})
    simulator = processes.simulator(file)
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/one'
    client.online(drive)

    # some take settings only while they stand still
    name, value, request, response = facts.parameter
    found, = client.get(drive, name)
    assert client.set(drive, **{name: value}) == [(True, '')]
    simulator.frame(request)
    simulator.frame(response)
    assert client.get(drive, name) == [pytest.approx(value)]
    # nobody wants to wait for a ramp of that length
    assert client.set(drive, **{name: found}) == [(True, '')]
    wrong, value, words = facts.refused
    before = client.get(drive, wrong)
    (success, reason), = client.set(drive, **{wrong: value})
    assert not success
    assert words in reason
    assert client.get(drive, wrong, 'nonsense') == [*before, None]
    bridge.error('one: read nonsense')

    assert not simulator.frames(facts.moving[0])
    if facts.enable:
        client.diagnostics(status_of(drive), state='^disabled$', level='^0$')
        success, message = client.control(f'{drive}/enable', True)
        assert success, message
    # a setpoint that nobody armed has no effect, and says so
    for name, value in facts.commands.items():
        client.publish(f'{drive}/command/{name}', value)
        bridge.error(f'one: command {name} has no effect: not armed, send 0 once first')
    if facts.commands:
        simulator.frame(facts.neutral, len(simulator.frames()), count=3)
        assert client.diagnostics(status_of(drive), state='^not armed$')['level'] == '1'
        assert not simulator.frames(facts.moving[0])
    for name in facts.commands:
        client.publish(f'{drive}/command/{name}', 0.0)
    client.diagnostics(status_of(drive), state='^online$', level='^0$')
    for name, value in facts.commands.items():
        client.publish(f'{drive}/command/{name}', value)
    for pattern in facts.moving:
        simulator.frame(pattern)
    client.value(f'{drive}/{facts.actual[0]}', *facts.actual[1:])
    assert not [line for line in simulator.lines if 'violation' in line]
    assert bridge.end() == 0
    head, tail, count = facts.end
    wait_for_end(lambda: [bool(re.search(f'{head}{tail}$', frame))
                          for frame in simulator.frames(head)], [True] * count)
    assert simulator.end() == 0
