# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Drives that answer late, twice, in pieces, in the wrong order, or against each other."""

from collections.abc import Callable
from pathlib import Path

from parameter_files import bridge_file, CONVEYOR, NEIGHBOUR
from processes import Client, Processes
import pytest
from repeating import again_and_again
from slcan_peer import Answers, Peer, ZEROS
from test_system_reconnection import rearm_and_move, start_moving, status_of
from waiting import SLOWNESS, wait_for

CYCLIC_REQUEST = 'T003FFFF08'
CYCLIC_RESPONSE = 'T103FFFF08'
#: Reg.209 = 100.0 rpm
ANSWER = f'{CYCLIC_RESPONSE}03E8{ZEROS[4:]}'
PERIOD = 0.1 * SLOWNESS


@pytest.fixture
def peer(connect: Callable[[Answers], Peer]) -> Peer:
    return connect({CYCLIC_REQUEST: ANSWER})


def peer_file(directory: Path) -> Path:
    """Write the configuration of a drive whose maps are not looked at."""
    return bridge_file(directory, drives={'conveyor': {
        **CONVEYOR, 'period': PERIOD, 'mapping': 'assume', 'missed_limit': 5,
        'parameter_timeout': 1.5 * PERIOD}})


#: fault -> what diagnostics and log say of it
STILL_WORKS = {'duplicate': 'check for a second station with the same number',
               'foreign': 'frames rejected, the last: ', 'drop=3': '', 'late=0.01': ''}
#: fault -> why the drive is offline
LOST = {'silent': 'no cyclic response', 'length=1': 'no cyclic response',
        'off': 'no cyclic response', 'forget': 'mapping differs|no cyclic response'}


def test_drive_that_still_works(processes: Processes, client: Client, namespace: str,
                                tmp_path: Path) -> None:
    # it stays online, its values stay true, it goes on as it is told; what is odd is reported
    file = bridge_file(tmp_path, drives={'conveyor': {**CONVEYOR, 'period': PERIOD}})
    simulator = processes.simulator(file)
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/conveyor'
    start_moving(client, drive)
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
    simulator = processes.simulator(file)
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/conveyor'
    start_moving(client, drive)
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


def test_answers_in_the_wrong_order(processes: Processes, client: Client, namespace: str,
                                    tmp_path: Path, peer: Peer) -> None:
    # each answer to a read comes when the next question has been asked: never taken for its answer
    held: list[str] = []

    def late(answer: str) -> Callable[[str], list[str]]:
        def reply(line: str) -> list[str]:
            held.append(answer)
            return [held.pop(0)] if len(held) > 1 else []
        return reply
    peer.answers.update({f'T002001E18{ZEROS}': late(f'T102001E180001{ZEROS[4:]}'),
                         f'T002001F18{ZEROS}': late(f'T102001F180002{ZEROS[4:]}'),
                         f'T002002018{ZEROS}': late(f'T1020020180003{ZEROS[4:]}')})
    bridge = processes.bridge(peer_file(tmp_path), namespace)
    drive = f'/{namespace}/conveyor'
    client.online(drive)
    for _ in range(3):
        values = client.get(drive, 'p30', 'p32', 'p31')
        assert [value in (None, right) for value, right in zip(values, (1, 3, 2))] == [True] * 3
    # the cyclic exchange has its own answers, and goes on
    client.value(f'{drive}/actual_speed', 100.0, 100.0)
    held.clear()
    peer.answers.update({f'T002001E18{ZEROS}': f'T102001E180001{ZEROS[4:]}'})
    assert client.get(drive, 'p30') == [1]
    assert bridge.end() == 0


def test_two_drives_with_the_same_station(processes: Processes, client: Client, namespace: str,
                                          tmp_path: Path, peer: Peer) -> None:
    # both answer, and contradict each other: the first is taken, the second told
    peer.answers[CYCLIC_REQUEST] = lambda line: [ANSWER, f'{CYCLIC_RESPONSE}FC18{ZEROS[4:]}']
    bridge = processes.bridge(peer_file(tmp_path), namespace)
    drive = f'/{namespace}/conveyor'
    client.online(drive)
    client.value(f'{drive}/actual_speed', 100.0, 100.0)
    facts = client.diagnostics(status_of(drive), message='second station with the same number')
    assert facts['level'] == '1'
    assert 'cyclic response that nobody asked for' in facts['message']
    bridge.error('conveyor: frame rejected: cyclic response that nobody asked for')
    assert client.values(f'{drive}/actual_speed') == [100.0]
    assert bridge.end() == 0


def test_second_master(processes: Processes, client: Client, namespace: str, tmp_path: Path,
                       peer: Peer) -> None:
    bridge = processes.bridge(peer_file(tmp_path), namespace)
    drive = f'/{namespace}/conveyor'
    client.online(drive)
    # a request for this station that the bridge did not send
    with again_and_again(lambda: peer.send(f'T003FFFF0801F4{ZEROS[4:]}\r'.encode()), PERIOD):
        facts = client.diagnostics(status_of(drive), message='there must be one master only')
        assert facts['level'] == '1'
        assert 'another master sends requests to station 1' in facts['message']
        bridge.error('conveyor: another master sends requests to station 1: 003FFFF0#01F4')
        client.value(f'{drive}/actual_speed', 100.0, 100.0)
    assert bridge.end() == 0


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
    client.diagnostics(f'{namespace}/drive_can_bridge: drive neighbour', state='offline',
                       message='not seen since start')
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
