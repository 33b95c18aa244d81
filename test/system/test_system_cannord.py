# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""CANnord: inverters that share a broadcast, and one in literal text that tells a fault."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from parameter_files import bridge_file
from processes import Client, Processes
import pytest
from slcan_peer import Answers, Peer

PROFILE = """
protocols: [cannord]
parameters:
  frequency_setpoint:
    {type: int16, scale: 0.0030517578125, unit: Hz, minimum: -50, maximum: 50, neutral: 0}
  actual_frequency: {type: int16, scale: 0.0030517578125, unit: Hz, access: ro}
  acceleration_time: {number: 102, scale: 0.01, unit: s, minimum: 0, maximum: 320, storage: eeprom}
  telegram_timeout: {number: 513, type: int16, scale: 0.1, unit: s, storage: eeprom}
"""
INVERTER: dict[str, Any] = {
    'bus': 'main', 'protocol': 'cannord', 'station': 100, 'period': 0.02,
    'cyclic_request': ['frequency_setpoint'], 'cyclic_response': ['actual_frequency'],
    # generous: nothing here may depend on how busy the machine is
    'command_timeout': 20.0, 'missed_limit': 100, 'parameter_timeout': 1.0,
    'control_timeout': 20.0,
}


def inverters(directory: Path, *drives: dict[str, Any]) -> Path:
    """Write a parameter file with inverters at addresses 100 and up, conveyor first."""
    profile = directory / 'inverter.yaml'
    profile.write_text(PROFILE, encoding='utf-8')
    names = ('conveyor', 'lift', 'turntable')
    return bridge_file(directory, drives={
        name: {**INVERTER, 'station': 100 + place, 'profile': str(profile), **keys}
        for place, (name, keys) in enumerate(zip(names, drives or ({},)))})


@pytest.fixture
def peer(connect: Callable[[Answers], Peer]) -> Peer:
    return connect({})


def enable(client: Client, drive: str) -> None:
    success, message = client.control(f'{drive}/enable', True)
    assert success, message


def runs(client: Client, namespace: str, drive: str) -> None:
    """Have a drive, or the group that it leads, run: enabled, armed, commanded."""
    enable(client, drive)
    client.publish(f'{drive}/command/frequency_setpoint', 0.0)
    client.diagnostics(f'{namespace}/drive_can_bridge: drive conveyor', state='^online$')
    client.publish(f'{drive}/command/frequency_setpoint', 25.0)


def test_broadcast(processes: Processes, client: Client, namespace: str,
                   tmp_path: Path) -> None:
    file = inverters(tmp_path, {'broadcast': 'group'}, {'broadcast': 'group'})
    simulator = processes.simulator(file)
    bridge = processes.bridge(file, namespace)
    conveyor, lift = f'/{namespace}/conveyor', f'/{namespace}/lift'
    client.online(conveyor)
    client.online(lift)
    runs(client, namespace, conveyor)
    client.value(f'{conveyor}/actual_frequency', 24.99, 25.01)
    client.value(f'{lift}/actual_frequency', 24.99, 25.01)
    simulator.frame('^403#7F040020 R')
    # each in turn is asked by itself, with the same content
    simulator.frame('^0C8#7F040020 R')
    simulator.frame('^0CA#7F040020 R')
    sent = [frame for frame in simulator.frames(' R$', since=20)
            if frame.startswith(('403#', '0C8#', '0CA#'))]
    start = next(place for place, frame in enumerate(sent) if frame.startswith('403#'))
    cycles = [sent[place:place + 2] for place in range(start, len(sent) - 1, 2)]
    assert all(first[4:] == second[4:] for first, second in cycles)
    assert {first[:4] for first, _ in cycles} == {'403#'}
    asked = [second[:3] for _, second in cycles]
    assert set(asked) == {'0C8', '0CA'}
    assert all(one != other for one, other in zip(asked, asked[1:]))
    # nobody answered the broadcast itself
    assert {frame[:3] for frame in simulator.frames(' T$')} <= {'0C9', '0CB', '2C9', '2CB'}

    # the one with the lowest station takes the commands for all
    success, message = client.control(f'{lift}/enable', True)
    assert not success
    assert 'conveyor' in message
    success, message = client.control(f'{conveyor}/quick_stop')
    assert success, message
    client.value(f'{conveyor}/actual_frequency', 0.0, 0.0)
    client.value(f'{lift}/actual_frequency', 0.0, 0.0)
    # a fault of one stops all
    runs(client, namespace, conveyor)
    client.value(f'{lift}/actual_frequency', 24.99, 25.01)
    simulator.write('lift trip')
    client.bit(f'{lift}/status_word/fault', True)
    client.value(f'{conveyor}/actual_frequency', 0.0, 0.0)
    success, message = client.control(f'{conveyor}/reset_fault')
    assert success, message
    client.bit(f'{lift}/status_word/fault', False)
    assert not [line for line in simulator.lines if 'violation' in line]
    assert bridge.end() == 0


# -- an independent witness: no codec of ours on either side --------------------------------------


def test_unasked_fault_frame_and_bytes_of_the_examples(
        processes: Processes, client: Client, namespace: str, tmp_path: Path,
        peer: Peer) -> None:
    """A peer in literal text: slow exchange, so that only the unasked frame can be so early."""
    peer.answers.update({
        't0C847E040000': 't0C94310B0000', 't0C847F040000': 't0C94370F0000',
        't0C847E040020': 't0C94310B0000',
        't0C847F040020': 't0C94370F0020',
        't2C886610000000000000': 't2C986610000000006700',
        't2C886620000000000F27': 't2C986670000000000200',
        't2C880112000000000000': 't2C980112000000000000'})     # P513 = 0
    bridge = processes.bridge(inverters(tmp_path), namespace)
    drive = f'/{namespace}/conveyor'
    client.online(drive)
    runs(client, namespace, drive)
    client.value(f'{drive}/actual_frequency', 24.99, 25.01)
    assert client.get(drive, 'acceleration_time') == [pytest.approx(1.03)]
    assert client.set(drive, acceleration_time=99.99) == [
        (False, 'refused by the drive: error 2: limit exceeded')]
    client.bit(f'{drive}/status_word/fault', False)
    # once, unasked: the answers before and after it tell of no fault
    peer.send(b't0C94380B0010\r')
    client.flashed(f'{drive}/status_word/fault')
    client.bit(f'{drive}/status_word/fault', False)
    # and it ended the run: only ~/enable starts the drive again
    peer.wait_for('t0C847E04', len(peer.lines), 3)
    assert bridge.end() == 0
    frames = {line for line in peer.lines if line.startswith(('t', 'T'))}
    assert {line[:5] for line in frames} == {'t0C84', 't2C88'}
    assert peer.lines.count('t2C886620000000000F27') == 1
