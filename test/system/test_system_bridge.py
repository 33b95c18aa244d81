# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Simulated drives, the bridge and a ROS node: three processes on one bus and one graph."""

from pathlib import Path

from parameter_files import bridge_file, CONVEYOR, NEIGHBOUR
from processes import Client, Processes

NEUTRAL = '^003FFFF0#0{16} R'
#: a cyclic request with 150 rpm
RUNNING = '^003FFFF0#05DC'


def test_commands_and_parameters(processes: Processes, client: Client, namespace: str,
                                 tmp_path: Path) -> None:
    file = bridge_file(tmp_path)
    simulator = processes.simulator(file)
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/conveyor'
    client.online(drive)

    # the maps were read before the first cyclic frame, and every frame so far is neutral
    requests = simulator.frames(' R$')
    first = next(place for place, frame in enumerate(requests) if frame.startswith('003FFFF0'))
    assert {'002007A4#0000000000000000 R', '002007E4#0000000000000000 R'} <= set(requests[:first])
    assert len(simulator.frames(NEUTRAL)) == len(simulator.frames('^003FFFF0'))

    # a setpoint that nobody armed has no effect, and says so
    client.publish(f'{drive}/command/speed_setpoint', 150.0)
    bridge.error('command speed_setpoint has no effect: not armed, send 0 once first')
    client.value(f'{drive}/actual_speed', -0.5, 0.5)
    assert not simulator.frames(RUNNING)
    status = f'{namespace}/drive_can_bridge: drive conveyor'
    facts = client.diagnostics(status, state='^not armed$', message='^not armed')
    assert facts['level'] == '1'
    assert facts['message'] == (f'not armed: publish 0 to {drive}/command/speed_setpoint and 0 to '
                                f'{drive}/command/torque_limit')
    client.publish(f'{drive}/command/torque_limit', 0.0)
    client.publish(f'{drive}/command/speed_setpoint', 0.0)
    client.diagnostics(status, state='^online$', level='^0$')
    client.publish(f'{drive}/command/torque_limit', 100.0)
    client.publish(f'{drive}/command/speed_setpoint', 150.0)
    client.value(f'{drive}/actual_speed', 145.0, 155.0)
    simulator.frame('^003FFFF0#05DC03E800000000 R')

    # parameters: read, written, unknown, read-only, stuck
    raw, = client.get(drive, 'p30')
    speed, ramp, brake = client.get(drive, 'maximum_speed', 'ramp_time', 'brake_enabled')
    assert ramp == raw / 100.0
    assert isinstance(speed, float)
    assert isinstance(brake, bool)
    assert client.set(drive, ramp_time=7.25) == [(True, '')]
    assert simulator.frames('^003001E1#02D5000000000000 R')
    assert simulator.frames('^102001E1#02D5')
    assert client.get(drive, 'ramp_time') == [7.25]
    assert client.get(drive, 'p9999', 'ramp_time') == [None, 7.25]
    assert 'no answer in 0.3 s, 3 attempts' in bridge.error(r'conveyor: read p9999 \(P9999\)')
    assert client.get(drive, 'nonsense') == [None]
    bridge.error('conveyor: read nonsense')
    (success, reason), = client.set(drive, actual_speed=1.0)
    assert not success
    assert 'read-only' in reason
    (success, reason), = client.set(drive, ramp_time=61.0)
    assert not success
    assert '0.01' in reason
    assert '60' in reason
    simulator.write('conveyor stuck=ramp_time')
    simulator.line('conveyor: fault stuck=ramp_time')
    assert client.set(drive, ramp_time=8.0) == [(False, 'read back 7.25 instead of 8')]
    assert client.set(drive, speed_setpoint=1.0) == [
        (False, 'sent cyclically: publish ~/command/speed_setpoint')]

    # none of it disturbed the exchange
    facts = client.diagnostics(status, state='^online$')
    assert int(facts['exchanges']) > 20
    assert int(facts['parameter_requests_ok']) >= 5
    assert 'ramp_time' in facts['last_parameter_error'] or 'speed' in facts['last_parameter_error']
    assert not any('violation' in line for line in simulator.lines)
    assert bridge.end() == 0
    assert simulator.end() == 0


def test_silent_neighbour_costs_nothing(processes: Processes, client: Client, namespace: str,
                                        tmp_path: Path) -> None:
    # long periods: an exchange is not missed just because this machine is slow
    file = bridge_file(tmp_path, drives={'conveyor': {**CONVEYOR, 'period': 0.25},
                                         'neighbour': {**NEIGHBOUR, 'period': 0.25}})
    simulator = processes.simulator(file, '--fault', 'neighbour:silent')
    bridge = processes.bridge(file, namespace)
    conveyor, neighbour = f'/{namespace}/conveyor', f'/{namespace}/neighbour'
    client.online(conveyor)
    client.online(neighbour, wanted=False)
    before = client.diagnostics(f'{namespace}/drive_can_bridge: drive conveyor')
    other = client.diagnostics(f'{namespace}/drive_can_bridge: drive neighbour', state='offline')
    assert 'not seen since start' in other['message']
    first = len(simulator.frames())
    for _ in range(2):
        assert client.get(neighbour, 'ramp_time', 'maximum_speed') == [None, None]
        assert client.set(neighbour, speed_gain=1.0, ramp_time=1.0) == [
            (False, 'no answer; drive offline')] * 2
        assert client.get(conveyor, 'ramp_time') != [None]
    bridge.error(r'neighbour: read ramp_time \(P30\): no answer; drive offline')
    after = client.diagnostics(f'{namespace}/drive_can_bridge: drive conveyor')
    assert int(after['exchanges']) >= int(before['exchanges']) + 3
    # every request got its answer, however late the machine was
    assert after['missed_exchanges'] == before['missed_exchanges']
    requests = simulator.frames('^003FFFF0.* R$', since=first)
    answers = simulator.frames('^103FFFF0.* T$', since=first)
    assert abs(len(requests) - len(answers)) <= 1
    # the silent drive got no cyclic frame: nobody knows its maps
    assert not simulator.frames('^005FFFF0')

    # switched off it is the same, and it comes back by itself
    simulator.write('neighbour off')
    simulator.line('neighbour: fault off')
    assert client.get(neighbour, 'ramp_time') == [None]
    simulator.write('neighbour ok')
    client.online(neighbour)
    assert bridge.end() == 0
