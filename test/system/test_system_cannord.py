# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A CANnord inverter, the bridge and a ROS node: three processes on one bus and one graph.

The simulated inverter logs every frame and is thereby a witness of what was on the bus; what is
compared here are literal bytes of the manuals' examples, not of our codec.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from parameter_files import bridge_file
from processes import Client, Processes, Simulator
import pytest
from slcan_peer import Peer

PROFILE = """
protocols: [cannord]
parameters:
  frequency_setpoint:
    {type: int16, scale: 0.0030517578125, unit: Hz, minimum: -50, maximum: 50, neutral: 0}
  relative_frequency_setpoint:
    {type: int16, scale: 0.006103515625, unit: '%', minimum: -100, maximum: 100, neutral: 0}
  setpoint_2: {type: int16, scale: 0.006103515625, unit: '%'}
  setpoint_3: {type: int16, scale: 0.006103515625, unit: '%'}
  setpoint_4: {type: int16, scale: 0.006103515625, unit: '%'}
  setpoint_5: {type: int16, scale: 0.006103515625, unit: '%'}
  actual_frequency: {type: int16, scale: 0.0030517578125, unit: Hz, access: ro}
  actual_relative_frequency: {type: int16, scale: 0.006103515625, unit: '%', access: ro}
  actual_value_2: {type: int16, scale: 0.006103515625, unit: '%', access: ro}
  actual_value_3: {type: int16, scale: 0.006103515625, unit: '%', access: ro}
  actual_value_4: {type: int16, scale: 0.006103515625, unit: '%', access: ro}
  actual_value_5: {type: int16, scale: 0.006103515625, unit: '%', access: ro}
  acceleration_time: {number: 102, scale: 0.01, unit: s, minimum: 0, maximum: 320, storage: eeprom}
  acceleration_time_set_2: {number: 102, subindex: 1, scale: 0.01, unit: s}
  offset: {number: 411, type: int16}
  telegram_timeout: {number: 513, type: int16, scale: 0.1, unit: s, storage: eeprom}
  distance: {number: 600, type: int32}
  position_0: {number: 613, subindex: 0, type: int32}
  position_1: {number: 613, subindex: 1, type: int32}
  fault_code: {number: 700, subindex: 0, scale: 0.1, access: ro}
"""
INVERTER: dict[str, Any] = {
    'bus': 'main', 'protocol': 'cannord', 'station': 100, 'period': 0.02,
    'cyclic_request': ['frequency_setpoint'], 'cyclic_response': ['actual_frequency'],
    # generous: nothing here may depend on how busy the machine is
    'command_timeout': 5.0, 'missed_limit': 25, 'parameter_timeout': 0.5, 'control_timeout': 20.0,
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
def peer(tmp_path: Path) -> Iterator[Peer]:
    started = Peer(tmp_path / 'links' / 'main')
    yield started
    started.close()


def no_violation(simulator: Simulator) -> None:
    assert not [line for line in simulator.lines if 'violation' in line]


def enabled(client: Client, drive: str, wanted: bool = True) -> str:
    success, message = client.control(f'{drive}/enable', wanted)
    assert success, message
    return message


def test_enable_run_stop_and_fault(processes: Processes, client: Client, namespace: str,
                                   tmp_path: Path) -> None:
    file = inverters(tmp_path)
    simulator = processes.simulator(file)
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/conveyor'
    status = f'{namespace}/drive_can_bridge: drive conveyor'
    client.online(drive)

    # until somebody enables it, it is told "ready" with setpoint 0, and nothing else
    assert {frame[4:12] for frame in simulator.frames('^0C8#')} == {'7E040000'}
    client.publish(f'{drive}/command/frequency_setpoint', 0.0)
    client.diagnostics(status, state='^online$')
    client.bit(f'{drive}/status_word/enabled', False)
    assert enabled(client, drive) == 'operation enabled'
    client.bit(f'{drive}/status_word/enabled', True)
    simulator.frame('^0C8#7F040000 R')
    client.publish(f'{drive}/command/frequency_setpoint', 25.0)
    client.value(f'{drive}/actual_frequency', 24.99, 25.01)
    simulator.frame('^0C8#7F040020 R')                  # the example of the notes: 50 %
    simulator.frame('^0C9#370B0020 T')
    client.bit(f'{drive}/status_word/rotating_right', True)
    client.publish(f'{drive}/command/frequency_setpoint', -25.0)
    client.value(f'{drive}/actual_frequency', -25.01, -24.99)
    simulator.frame('^0C8#7F0400E0 R')
    client.bit(f'{drive}/status_word/rotating_left', True)

    # quick stop: with bit 2 clear, until the inverter has let go
    success, message = client.control(f'{drive}/quick_stop')
    assert success, message
    simulator.frame('^0C8#7A04')
    client.value(f'{drive}/actual_frequency', 0.0, 0.0)
    client.bit(f'{drive}/status_word/enabled', False)
    # nothing but ~/enable starts it again
    first = len(simulator.frames())
    simulator.frame('^0C8#7E04', since=first, count=5)
    assert not simulator.frames('^0C8#7F', since=first)
    assert enabled(client, drive) == 'operation enabled'
    client.value(f'{drive}/actual_frequency', -25.01, -24.99)
    assert enabled(client, drive, False) in ('ready to switch on', 'switch-on disabled')

    # a fault of the inverter, whose cause is gone at once
    enabled(client, drive)
    assert client.diagnostics(status, control_state='^operation enabled$')['level'] == '0'
    client.bit(f'{drive}/status_word/fault', False)
    simulator.write('conveyor trip')
    client.bit(f'{drive}/status_word/fault', True)
    assert client.diagnostics(status, state='^fault$', control_state='^fault$')['level'] == '2'
    simulator.frame('^0C9#3[08]')
    assert client.control(f'{drive}/enable', True) == (False, 'fault: reset it first')
    assert client.get(drive, 'fault_code') == [7.0]
    success, message = client.control(f'{drive}/reset_fault')
    assert success, message
    simulator.frame('^0C8#FE04')
    client.bit(f'{drive}/status_word/fault', False)
    assert client.get(drive, 'fault_code') == [0.0]
    assert enabled(client, drive) == 'operation enabled'
    no_violation(simulator)
    assert bridge.end() == 0
    # the last words leave it without torque
    assert [frame[4:12] for frame in simulator.frames('^0C8#')[-3:]] == ['7E040000'] * 3
    assert simulator.end() == 0


def test_reset_works_only_after_the_cause_is_gone(
        processes: Processes, client: Client, namespace: str, tmp_path: Path) -> None:
    file = inverters(tmp_path, {'control_timeout': 2.0})
    simulator = processes.simulator(file)
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/conveyor'
    client.online(drive)
    simulator.write('conveyor trip=3600')
    client.bit(f'{drive}/status_word/fault', True)
    success, message = client.control(f'{drive}/reset_fault')
    assert not success
    assert message.startswith('fault still present after 2 s')
    simulator.frame('^0C8#FE040000 R')
    client.bit(f'{drive}/status_word/fault', True)
    # gone from now on; the fault itself stays until it is reset
    simulator.write('conveyor trip=0')
    simulator.line('fault trip=0')
    client.value(f'{drive}/status_word', 0x0008, 0x1FFF, kind='Int64')
    client.bit(f'{drive}/status_word/fault', True)
    success, message = client.control(f'{drive}/reset_fault')
    assert success, message
    client.bit(f'{drive}/status_word/fault', False)
    no_violation(simulator)
    assert bridge.end() == 0


def test_setpoints_in_percent_and_hertz(processes: Processes, client: Client, namespace: str,
                                        tmp_path: Path) -> None:
    """Percent and hertz are the same word; 29-bit identifiers, and words 3 and 4 swapped."""
    file = inverters(
        tmp_path,
        {'cyclic_request': ['relative_frequency_setpoint'],
         'cyclic_response': ['actual_relative_frequency', 'actual_frequency'],
         'extended_identifiers': True},
        {'cyclic_request': ['frequency_setpoint', 'setpoint_2'],
         'cyclic_response': ['actual_frequency', 'actual_value_2', 'actual_value_3'],
         'swap_setpoints_2_3': True, 'parameter_set': 2})
    simulator = processes.simulator(file)
    bridge = processes.bridge(file, namespace)
    conveyor, lift = f'/{namespace}/conveyor', f'/{namespace}/lift'
    for drive, topics in ((conveyor, ['relative_frequency_setpoint']),
                          (lift, ['frequency_setpoint', 'setpoint_2'])):
        client.online(drive)
        for topic in topics:
            client.publish(f'{drive}/command/{topic}', 0.0)
        client.diagnostics(f'{drive[1:].replace("/", "/drive_can_bridge: drive ")}',
                           state='^online$')
        enabled(client, drive)
    client.publish(f'{conveyor}/command/relative_frequency_setpoint', 50.0)
    client.value(f'{conveyor}/actual_relative_frequency', 49.99, 50.01)
    client.value(f'{conveyor}/actual_frequency', 24.99, 25.01)
    # 8 bytes: the response names two values
    simulator.frame('^03200000#7F04002000000000 R')
    simulator.frame('^03240000#370B002000200000 T')
    client.publish(f'{lift}/command/frequency_setpoint', 50.0)
    client.publish(f'{lift}/command/setpoint_2', 25.0)
    client.value(f'{lift}/actual_frequency', 49.99, 50.01)
    client.value(f'{lift}/actual_value_2', 24.99, 25.01)
    # set 2 is bit 14; the second setpoint is in bytes 6 and 7
    simulator.frame('^0CA#7F44004000000010 R')
    simulator.frame('^0CB#374B004000000010 T')
    assert client.get(conveyor, 'p102') != [None]
    simulator.frame('^0B200000#6610000000000000 R')
    no_violation(simulator)
    assert bridge.end() == 0


def test_parameters(processes: Processes, client: Client, namespace: str,
                    tmp_path: Path) -> None:
    file = inverters(tmp_path)
    simulator = processes.simulator(file)
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/conveyor'
    client.online(drive)

    # a word to EEPROM: storage; one of another set to RAM: persist_writes is off
    assert client.set(drive, acceleration_time=99.99) == [(True, '')]
    simulator.frame('^2C8#6620000000000F27 R')
    simulator.frame('^2C9#6610000000000F27 T')
    assert client.set(drive, acceleration_time_set_2=1.0) == [(True, '')]
    simulator.frame('^2C8#66C0010000006400 R')
    simulator.frame('^2C9#6640010000006400 T')
    values = client.get(drive, 'acceleration_time', 'acceleration_time_set_2')
    assert values == [pytest.approx(99.99), 1.0]

    # negative words, double words, array elements
    assert client.set(drive, offset=-5, distance=-2, position_1=100000) == [(True, '')] * 3
    simulator.frame('^2C8#9BE10000FFFFFBFF R')
    simulator.frame('^2C8#58D20000FFFFFEFF R')
    simulator.frame('^2C8#65B201000100A086 R')
    assert client.get(drive, 'offset', 'distance', 'position_1') == [-5, -2, 100000]

    # raw names obey the rules of the listed parameter; the others find their width by themselves
    assert client.get(drive, 'p613.1', 'p102.1', 'p102') == [100000, 100, 9999]
    assert client.get(drive, 'p600', 'p411') == [0xFFFFFFFE, 0xFFFB]
    assert client.set(drive, p600=70000) == [(True, '')]
    assert client.get(drive, 'distance') == [70000]

    # refusals of the drive, and of the bridge, in words
    assert client.get(drive, 'p999', 'distance') == [None, 70000]
    assert 'invalid parameter number' in bridge.error(r'conveyor: read p999 \(P999\)')
    assert client.get(drive, 'p613.9') == [None]
    text = bridge.error(r'conveyor: read p613\.9')
    assert 'wrong sub-index; P613 has 2 elements' in text
    assert client.get(drive, 'p600.1') == [None]
    assert 'not an array' in bridge.error(r'conveyor: read p600\.1')
    (success, reason), = client.set(drive, p102=32001)
    assert not success
    (success, reason), = client.set(drive, fault_code=0.0)
    assert not success
    assert 'read-only' in reason
    (success, reason), = client.set(drive, acceleration_time=321.0)
    assert not success
    assert '320' in reason
    assert client.set(drive, frequency_setpoint=1.0) == [
        (False, 'sent cyclically: publish ~/command/frequency_setpoint')]
    (success, reason), = client.set(drive, atomic=True, offset=1, distance=1)
    assert not success
    assert client.get(drive, 'offset', 'distance') == [-5, 70000]

    # EEPROM is written only where the profile says so
    simulator.write('conveyor')
    assert '1 EEPROM writes' in simulator.line('^conveyor: cannord')
    simulator.write('conveyor silent')
    simulator.line('fault silent')
    (success, reason), = client.set(drive, offset=7)
    assert not success
    assert 'no answer' in reason
    simulator.write('conveyor ok')
    client.online(drive)
    # the write was executed, once
    assert client.get(drive, 'offset') == [7]
    assert len(simulator.frames('^2C8#9BE1000000000700 R')) == 1
    no_violation(simulator)
    assert bridge.end() == 0


def test_extra_setpoints(processes: Processes, client: Client, namespace: str,
                         tmp_path: Path) -> None:
    """SK 54xE: values 4 and 5 in a frame of five bytes after the main one."""
    names = ['setpoint_2', 'setpoint_3', 'setpoint_4', 'setpoint_5']
    file = inverters(tmp_path, {
        'extra_setpoints': True, 'cyclic_request': ['frequency_setpoint', *names],
        'cyclic_response': ['actual_frequency', 'actual_value_2', 'actual_value_3',
                            'actual_value_4', 'actual_value_5']})
    simulator = processes.simulator(file)
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/conveyor'
    client.online(drive)
    for name in ('frequency_setpoint', *names):
        client.publish(f'{drive}/command/{name}', 0.0)
    client.diagnostics(f'{namespace}/drive_can_bridge: drive conveyor', state='^online$')
    enabled(client, drive)
    for name, value in zip(names, (50.0, 25.0, 12.5, -50.0)):
        client.publish(f'{drive}/command/{name}', value)
    for number, value in ((2, 50.0), (3, 25.0), (4, 12.5), (5, -50.0)):
        client.value(f'{drive}/actual_value_{number}', value - 0.01, value + 0.01)
    simulator.frame('^0C8#7F04000000200010 R')
    simulator.frame('^0C8#000800E000 R')
    simulator.frame('^0C9#000800E000 T')
    # always in this order
    sent = [len(frame.split()[0]) for frame in simulator.frames('^0C8#')]
    assert set(sent[:2 * (len(sent) // 2):2]) == {20}
    assert set(sent[1::2]) == {14}
    no_violation(simulator)
    assert bridge.end() == 0


@pytest.mark.parametrize(('how', 'broadcast'), [('group', '403'), ('all', '408')])
def test_broadcast(processes: Processes, client: Client, namespace: str, tmp_path: Path,
                   how: str, broadcast: str) -> None:
    file = inverters(tmp_path, {'broadcast': how}, {'broadcast': how})
    simulator = processes.simulator(file)
    bridge = processes.bridge(file, namespace)
    conveyor, lift = f'/{namespace}/conveyor', f'/{namespace}/lift'
    client.online(conveyor)
    client.online(lift)
    client.publish(f'{conveyor}/command/frequency_setpoint', 0.0)
    client.diagnostics(f'{namespace}/drive_can_bridge: drive conveyor', state='^online$')
    enabled(client, conveyor)
    client.publish(f'{conveyor}/command/frequency_setpoint', 25.0)
    client.value(f'{conveyor}/actual_frequency', 24.99, 25.01)
    client.value(f'{lift}/actual_frequency', 24.99, 25.01)
    simulator.frame(f'^{broadcast}#7F040020 R')
    # each in turn is asked by itself, with the same content
    simulator.frame('^0C8#7F040020 R')
    simulator.frame('^0CA#7F040020 R')
    sent = [frame for frame in simulator.frames(' R$', since=20)
            if frame.startswith((f'{broadcast}#', '0C8#', '0CA#'))]
    start = next(place for place, frame in enumerate(sent) if frame.startswith(broadcast))
    cycles = [sent[place:place + 2] for place in range(start, len(sent) - 1, 2)]
    assert all(first[4:] == second[4:] for first, second in cycles)
    assert {first[:4] for first, _ in cycles} == {f'{broadcast}#'}
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
    enabled(client, conveyor)
    client.value(f'{lift}/actual_frequency', 24.99, 25.01)
    simulator.write('lift trip')
    client.bit(f'{lift}/status_word/fault', True)
    client.value(f'{conveyor}/actual_frequency', 0.0, 0.0)
    success, message = client.control(f'{conveyor}/reset_fault')
    assert success, message
    client.bit(f'{lift}/status_word/fault', False)
    no_violation(simulator)
    assert bridge.end() == 0


def test_telegram_timeout(processes: Processes, client: Client, namespace: str,
                          tmp_path: Path) -> None:
    file = inverters(tmp_path)
    processes.simulator(file)
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/conveyor'
    status = f'{namespace}/drive_can_bridge: drive conveyor'
    client.online(drive)
    # far more than three periods; and this machine may be busy: it is never reached
    assert client.set(drive, telegram_timeout=100.0) == [(True, '')]
    assert client.get(drive, 'telegram_timeout') == [100.0]
    client.diagnostics(status, message='^((?!telegram time-out).)*$')
    assert bridge.end() == 0

    # a bridge that finds a time-out of less than three periods says so
    file = inverters(tmp_path, {'period': 50.0})
    second = processes.bridge(file, f'{namespace}_again')
    second.error(r'conveyor: telegram time-out 100 s \(telegram_timeout, P513\) is too tight')
    assert second.end() == 0


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
    client.publish(f'{drive}/command/frequency_setpoint', 0.0)
    client.diagnostics(f'{namespace}/drive_can_bridge: drive conveyor', state='^online$')
    enabled(client, drive)
    client.publish(f'{drive}/command/frequency_setpoint', 25.0)
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
