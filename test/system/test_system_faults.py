# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Drives that answer late, twice, in pieces, or not at all."""

from pathlib import Path

from parameter_files import bridge_file, CONVEYOR
from processes import Client, Processes
from test_system_reconnection import moving, rearm_and_move, status_of
from waiting import SLOWNESS, wait_for

PERIOD = 0.1 * SLOWNESS
#: fault -> what diagnostics and log say of it
STILL_WORKS = {'duplicate': 'check for a second station with the same number',
               'foreign': 'frames? rejected, the last: ', 'drop=3': '', 'late=0.01': ''}
#: fault -> why the drive is offline
LOST = {'silent': 'no cyclic response', 'length=1': 'no cyclic response',
        'off': 'no cyclic response', 'forget': 'mapping differs|no cyclic response'}


def test_drive_that_still_works(processes: Processes, client: Client, namespace: str,
                                tmp_path: Path) -> None:
    # it stays online, its values stay true, it goes on as it is told; what is odd is reported
    file = bridge_file(tmp_path, drives={'conveyor': {**CONVEYOR, 'period': PERIOD}})
    simulator, bridge, drive = moving(processes, client, namespace, file)
    for fault, words in STILL_WORKS.items():
        client.publish(f'{drive}/command/speed_setpoint', 150.0)
        client.value(f'{drive}/actual_speed', 145.0, 155.0)
        before = client.diagnostics(status_of(drive))
        simulator.write(f'conveyor {fault}')
        simulator.line(f'conveyor: fault {fault}')
        count = len(simulator.frames())
        told = len(bridge.errors)
        if words:
            facts = client.diagnostics(status_of(drive), message=words)
            assert facts['level'] == '1'
            assert int(facts['frames_rejected']) > int(before['frames_rejected'])
        if fault == 'duplicate':
            bridge.error('conveyor: frame rejected: ', since=told)
        if fault == 'drop=3':
            missed = int(before['missed_exchanges'])
            wait_for(lambda missed=missed: missed < int(  # type: ignore[misc]
                client.diagnostics(status_of(drive))['missed_exchanges']), 'missed exchanges')
        client.publish(f'{drive}/command/speed_setpoint', 100.0)
        client.value(f'{drive}/actual_speed', 95.0, 105.0)
        simulator.frame('^003FFFF0#03E8', since=count, count=10)
        assert all(-1.0 <= value <= 160.0 for value in client.values(f'{drive}/actual_speed'))
        ramp = 1.25 + count % 50  # another one each time
        assert client.set(drive, ramp_time=ramp) == [(True, '')]
        assert client.get(drive, 'ramp_time') == [ramp]
        assert not bridge.losses()
        simulator.write('conveyor ok')
        client.diagnostics(status_of(drive), state='^online$')
    assert bridge.end() == 0


def test_drive_that_is_lost(processes: Processes, client: Client, namespace: str,
                            tmp_path: Path) -> None:
    file = bridge_file(tmp_path, drives={'conveyor': {
        **CONVEYOR, 'period': PERIOD, 'missed_limit': 4, 'mapping': 'configure'}})
    simulator, bridge, drive = moving(processes, client, namespace, file)
    for fault, reason in LOST.items():
        told = len(bridge.errors)
        simulator.write(f'conveyor {fault}')
        simulator.line(f'conveyor: fault {fault}')
        client.online(drive, wanted=False)
        bridge.error(f'conveyor: offline: .*({reason})', since=told)
        simulator.write('conveyor ok')
        client.online(drive)
        count = len(simulator.frames())
        rearm_and_move(client, drive, bridge, simulator, count)
    assert bridge.end() == 0


