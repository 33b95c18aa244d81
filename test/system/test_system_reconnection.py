# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What the bridge does when its bus or a drive goes away and comes back."""

from pathlib import Path
import re

from parameter_files import bridge_file, CONVEYOR
from processes import Client, Process, Processes, Simulator
import pytest
from waiting import SLOWNESS

CYCLIC = '^003FFFF0#'
NEUTRAL = '^003FFFF0#000003E80{8} R'
#: anything cyclic with a setpoint that is not neutral
MOVING = '^003FFFF0#(?!000003E80{8} R)'
MISSED_LIMIT = 4


def status_of(drive: str) -> str:
    """Return the name of a drive's diagnostic status."""
    namespace, name = drive.strip('/').split('/')
    return f'{namespace}/drive_can_bridge: drive {name}'


def move(client: Client, drive: str) -> None:
    """Arm the speed setpoint, and let it stand at 150 rpm; again where a busy machine loses it."""
    while True:
        client.publish(f'{drive}/command/speed_setpoint', 0.0)
        client.diagnostics(status_of(drive), state='^online$')
        client.publish(f'{drive}/command/speed_setpoint', 150.0)
        try:
            client.value(f'{drive}/actual_speed', 145.0, 155.0, timeout=10.0 * SLOWNESS)
        except AssertionError:
            # there is no other reason
            client.diagnostics(status_of(drive), message='not armed: .*/speed_setpoint')
        else:
            return


def start_moving(client: Client, drive: str) -> None:
    """Wait until the drive is there, and let it move."""
    client.online(drive)
    move(client, drive)


def moving(processes: Processes, client: Client, namespace: str, file: Path,
           ) -> tuple[Simulator, Process, str]:
    """Return a simulator, a bridge, and the conveyor, which moves."""
    simulator, bridge = processes.simulator(file), processes.bridge(file, namespace)
    start_moving(client, f'/{namespace}/conveyor')
    return simulator, bridge, f'/{namespace}/conveyor'


def goes_on(client: Client, drive: str, bridge: Process, simulator: Simulator) -> None:
    """See that a drive moves on, and its bridge takes no notice of others."""
    count = len(simulator.frames())
    assert set(simulator.frame('^003FFFF0#.* R$', count, 5)) == {'003FFFF0#05DC03E800000000 R'}
    assert client.get(drive, 'ramp_time') == [1.0]
    assert not bridge.losses()
    assert client.diagnostics(status_of(drive))['frames_rejected'] == '0'


def rearm_and_move(client: Client, drive: str, bridge: Process, simulator: Simulator,
                   since: int = 0) -> None:
    """
    See that a drive that came back stands still, and moves again after a neutral command.

    The publisher of its setpoint went on all the time.
    """
    client.online(drive)
    client.diagnostics(status_of(drive), message='not armed: .*/speed_setpoint')
    bridge.error('command speed_setpoint has no effect: not armed, send 0 once first')
    simulator.frame(NEUTRAL, since, count=10)
    assert not simulator.frames(MOVING, since)
    move(client, drive)
    assert simulator.frames(MOVING, since)


@pytest.mark.real
def test_adapter_is_pulled_and_another_plugged_in(
    processes: Processes, client: Client, namespace: str, tmp_path: Path,
) -> None:
    file = bridge_file(tmp_path)
    simulator, bridge, drive = moving(processes, client, namespace, file)
    simulator.kill()
    client.online(drive, wanted=False)
    bridge.error('conveyor: offline: bus main is down$')
    lost = bridge.error(r'bus main: adapter .*/main is gone: unplugged\? Goes on by itself when '
                        'it is back$')
    assert '[ERROR]' in lost
    facts = client.diagnostics(f'{namespace}/drive_can_bridge: bus main', state='^down$')
    assert facts['level'] == '2'
    assert client.get(drive, 'ramp_time') == [None]
    assert client.set(drive, ramp_time=1.0) == [(False, 'bus down')]
    # the same failure is told once, not at every attempt
    client.diagnostics(f'{namespace}/drive_can_bridge: bus main', state='^down$')
    lines = [line.split(': ', 1)[1] for line in bridge.errors if 'bus main: ' in line]
    assert len(lines) == len(set(lines))

    again = processes.simulator(file)
    rearm_and_move(client, drive, bridge, again)
    facts = client.diagnostics(f'{namespace}/drive_can_bridge: bus main', state='^up$')
    assert facts['reconnections'] == '1'
    # maps first, as at the start
    requests = again.frames(' R$')
    first = next(place for place, frame in enumerate(requests) if frame.startswith('003FFFF0'))
    assert {'002007A4#0000000000000000 R', '002007E4#0000000000000000 R'} <= set(requests[:first])
    assert bridge.end() == 0


def test_drive_falls_silent_and_comes_back(processes: Processes, client: Client, namespace: str,
                                           tmp_path: Path) -> None:
    file = bridge_file(tmp_path,
                       drives={'conveyor': {**CONVEYOR, 'period': 0.1,
                                              'missed_limit': MISSED_LIMIT}})
    simulator, bridge, drive = moving(processes, client, namespace, file)
    simulator.write('conveyor silent')
    client.online(drive, wanted=False)
    bridge.error('conveyor: offline: no cyclic response for 4 cycles')
    facts = client.diagnostics(f'{namespace}/drive_can_bridge: drive conveyor', state='offline')
    assert facts['level'] == '2'
    # nothing of what to correct at a first start
    assert re.fullmatch(r'silent since \d\d:\d\d:\d\d, was online before: check its power and '
                        r'cable \(no cyclic response for 4 cycles\)', facts['message'])

    # counted in frames: after the last answer, missed_limit requests, then neutral ones, then
    # silence but for the look at the maps
    frames = simulator.frames()
    last = max(place for place, frame in enumerate(frames) if frame.startswith('103FFFF0'))
    simulator.frame('^002007A4', since=last, count=3)
    after = [frame for frame in simulator.frames(' R$', since=last) if '003FFFF0' in frame]
    assert [frame.split('#')[1] for frame in after] == (
        ['05DC03E800000000 R'] * MISSED_LIMIT + ['000003E800000000 R'] * 3)

    back = len(simulator.frames())
    simulator.write('conveyor ok')
    rearm_and_move(client, drive, bridge, simulator, back)
    assert bridge.end() == 0
