# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""An adapter that stops taking data: told, waited for, and nothing stale reaches the drive."""

from collections.abc import Callable
from pathlib import Path

from parameter_files import bridge_file, CONVEYOR
from processes import Client, Processes
import pytest
from slcan_peer import Answers, NEUTRAL_WORDS, Peer, ZEROS
from waiting import wait_for_end

CYCLIC_REQUEST = 'T003FFFF08'
MISSED_LIMIT = 40
#: what a terminal holds ready for its reader; nobody can take that back
READY = 4096

pytestmark = pytest.mark.real


@pytest.fixture
def peer(connect: Callable[[Answers], Peer]) -> Peer:
    return connect({
        CYCLIC_REQUEST: f'T103FFFF08{ZEROS}', f'T002001E18{ZEROS}': f'T102001E180064{ZEROS[4:]}'})


def told_to_move(client: Client, namespace: str, peer: Peer, since: int = 0) -> None:
    topic = f'/{namespace}/conveyor/command/speed_setpoint'
    client.publish(topic, 0.0)
    client.diagnostics(f'{namespace}/drive_can_bridge: drive conveyor', state='^online$')
    client.publish(topic, 150.0)
    peer.wait_for(f'{CYCLIC_REQUEST}05DC', since)


def test_adapter_that_takes_nothing(processes: Processes, client: Client, namespace: str,
                                    tmp_path: Path, peer: Peer) -> None:
    # the drive's maps are not looked at, so that it is fed even while it is offline: the kernel's
    # buffers fill, and the oldest frames in them tell the drive to move
    file = bridge_file(tmp_path, bus={'bitrate': 1_000_000}, drives={'conveyor': {
        **CONVEYOR, 'mapping': 'assume', 'period': 0.005, 'missed_limit': MISSED_LIMIT}})
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/conveyor'
    bus = f'{namespace}/drive_can_bridge: bus main'
    client.online(drive)
    told_to_move(client, namespace, peer)

    peer.stop_reading()
    client.online(drive, wanted=False)
    bridge.error(
        r'bus main: send: .*the adapter takes no more data.*; tried again every 0\.2 s')
    # it goes on: requests are answered, diagnostics appear
    assert client.get(drive, 'ramp_time') == [None]
    facts = client.diagnostics(bus, send_failures='^[1-9]')
    assert facts['level'] == '2' or facts['state'] == 'up'

    count = peer.read_again()
    client.online(drive)
    peer.wait_for('O', count)
    reopened = count + peer.lines[count:].index('O')
    requests = peer.wait_for(CYCLIC_REQUEST, reopened, 20)
    assert set(requests) == {CYCLIC_REQUEST + NEUTRAL_WORDS}
    # before that: no more than the kernel cannot take back, neutral as soon as the drive was
    # offline, and no command that was made of a torn one
    old = peer.lines[count:reopened]
    assert sum(len(line) + 1 for line in old) <= 2 * READY
    whole = [line for line in old if len(line) >= len(CYCLIC_REQUEST + NEUTRAL_WORDS)]
    # and its stop by number, which is read back
    by_number = {line for line in whole if line.startswith(('T0020', 'T0030'))}
    assert all(line.endswith(ZEROS) for line in by_number)
    sent = {CYCLIC_REQUEST + NEUTRAL_WORDS, f'{CYCLIC_REQUEST}05DC{NEUTRAL_WORDS[4:]}'}
    # what opens the adapter clears a torn line: behind it stands no frame, nor half of another one
    torn = {line for line in whole if line.endswith('V')}
    assert all(any(each.startswith(line.rstrip('V')) for each in sent) for line in torn)
    assert set(whole) - by_number - torn <= sent
    assert sum('05DC' in line for line in whole) <= MISSED_LIMIT + 5
    assert old[-4:].count('C') >= 1
    assert not [line for line in old if line.endswith('C') and len(line) > 1]
    assert client.get(drive, 'ramp_time') == [1.0]
    told_to_move(client, namespace, peer, count)
    assert bridge.end() == 0
    wait_for_end(lambda: [line for line in peer.lines if line.startswith('T')],
                 [CYCLIC_REQUEST + NEUTRAL_WORDS] * 3)


def test_stop_of_a_drive_that_moves_while_the_adapter_takes_nothing(
        processes: Processes, client: Client, namespace: str, tmp_path: Path, peer: Peer) -> None:
    # every stop frame is refused: who reads the log has to know what nobody could tell the drive
    file = bridge_file(tmp_path, bus={'bitrate': 1_000_000, 'reconnect_period': 0.01}, drives={
        # nobody tells it neutral while there is still room
        'conveyor': {**CONVEYOR, 'mapping': 'assume', 'period': 0.005, 'missed_limit': 10_000,
                     'command_timeout': 60.0}})
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/conveyor'
    client.online(drive)
    told_to_move(client, namespace, peer)
    peer.stop_reading()
    bridge.error('the adapter takes no more data')
    assert bridge.end() == 0
    bridge.error('conveyor: .*may still be running')
