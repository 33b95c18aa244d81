# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Bytes on the wire, against literal ones, and rubbish from the bus.

Every line below is SLCAN: T, 29-bit identifier, length, data. The telegrams are the manual's own
examples: station 1, Reg.30 and Reg.31, setpoint in Reg.50, maps in Reg.122 to Reg.129.
"""

from collections.abc import Callable
from pathlib import Path
import random

from parameter_files import bridge_file, CONVEYOR
from processes import Client, Processes
import pytest
from slcan_peer import Answers, Peer, ZEROS
from waiting import wait_for

READ_REQUEST_MAP = f'T002007A48{ZEROS}'
READ_RESPONSE_MAP = f'T002007E48{ZEROS}'
CYCLIC_REQUEST = 'T003FFFF08'
CYCLIC_RESPONSE = 'T103FFFF08'
READ_30 = f'T002001E18{ZEROS}'
READ_30_AND_31 = f'T002001E28{ZEROS}'

#: Reg.122 = 50, Reg.126 = 209, Reg.127 = 210
DRIVE: dict[str, str | Callable[[str], list[str]]] = {
    READ_REQUEST_MAP: 'T102007A480032000000000000',
    READ_RESPONSE_MAP: 'T102007E4800D100D200000000',
    CYCLIC_REQUEST: f'{CYCLIC_RESPONSE}FC18000000000000',  # Reg.209 = -1000
    READ_30: 'T102001E1803E8CAFEBABE0000',
    READ_30_AND_31: 'T102001E2803E807D0CAFEBABE',
}

PROFILE = """
protocols: [datamodel_extended]
parameters:
  speed_setpoint: {number: 50, type: int16, scale: 0.1, unit: rpm, storage: ram}
  actual_speed: {number: 209, type: int16, scale: 0.1, unit: rpm, access: ro}
  motor_current: {number: 210, type: int16, access: ro}
  first: {number: 30, storage: ram}
  second: {number: 31, storage: ram}
"""


@pytest.fixture
def peer(connect: Callable[[Answers], Peer]) -> Peer:
    return connect(dict(DRIVE))


def witness_file(directory: Path) -> Path:
    """Write the configuration of the manual's examples."""
    profile = directory / 'manual.yaml'
    profile.write_text(PROFILE, encoding='utf-8')
    return bridge_file(directory, drives={'conveyor': {
        **CONVEYOR, 'profile': str(profile), 'cyclic_request': ['speed_setpoint'],
        'cyclic_response': ['actual_speed', 'motor_current']}})


@pytest.mark.real
def test_bytes_of_the_manual(processes: Processes, client: Client, namespace: str,
                             tmp_path: Path, peer: Peer) -> None:
    bridge = processes.bridge(witness_file(tmp_path), namespace)
    drive = f'/{namespace}/conveyor'
    client.online(drive)
    client.value(f'{drive}/actual_speed', -100.0, -100.0)

    # the adapter is set to 125 kbit/s and opened; then the maps, then the exchange
    assert 'S4' in peer.lines
    assert 'O' in peer.lines[peer.lines.index('S4'):]
    frames = [line for line in peer.lines if line.startswith('T')]
    assert frames[:3] == [READ_REQUEST_MAP, READ_RESPONSE_MAP, CYCLIC_REQUEST + ZEROS]

    # Reg.50 := 1500, and -1500
    client.publish(f'{drive}/command/speed_setpoint', 0.0)
    client.diagnostics(f'{namespace}/drive_can_bridge: drive conveyor', state='^online$')
    client.publish(f'{drive}/command/speed_setpoint', 150.0)
    peer.wait_for(f'{CYCLIC_REQUEST}05DC000000000000')
    client.publish(f'{drive}/command/speed_setpoint', -150.0)
    peer.wait_for(f'{CYCLIC_REQUEST}FA24000000000000')

    # reads: alone and together
    assert client.get(drive, 'first') == [1000]
    assert READ_30 in peer.lines
    assert client.get(drive, 'second', 'first') == [2000, 1000]
    assert READ_30_AND_31 in peer.lines
    # writes: alone (Reg.30 := -5), and Reg.30 := 1000 with Reg.31 := 2000 in one frame
    peer.answers[READ_30] = f'T102001E18FFFB{ZEROS[4:]}'
    assert client.set(drive, p30=-5) == [(True, '')]
    assert f'T003001E18FFFB{ZEROS[4:]}' in peer.lines
    (success, reason), = client.set(drive, atomic=True, second=2000, first=1000)
    assert (success, reason) == (True, '')
    assert 'T003001E2803E807D000000000' in peer.lines
    (success, reason), = client.set(drive, atomic=True, first=1, second=1)
    assert not success
    assert 'read back 1000 instead of 1' in reason

    # a stop ends with three neutral frames, and the adapter is closed
    assert bridge.end() == 0
    wait_for(lambda: 'C' in peer.lines[-3:], 'the adapter to be closed')
    frames = [line for line in peer.lines if line.startswith('T')]
    assert frames[-3:] == [CYCLIC_REQUEST + ZEROS] * 3
    known = {READ_REQUEST_MAP, READ_RESPONSE_MAP, READ_30, READ_30_AND_31,
             f'T003001E18FFFB{ZEROS[4:]}', 'T003001E2803E807D000000000',
             'T003001E28000100010000' + '0000'}
    assert {line for line in frames if not line.startswith(CYCLIC_REQUEST)} <= known
    # what clears half a line of a process before, and is no empty line, which would repeat one
    others = {line for line in peer.lines if not line.startswith('T')}
    assert {line for line in others if line.strip('V')} <= {'C', 'S4', 'O'}
    assert '' not in others


MALFORMED = [
    b'T103FFFF0\r', b'T103FFFF08FC18\r', b'T103FFFF08FC1800000000000\r', b'T\r', b't\r', b't7\r',
    b'TXYZFFFF08FC18000000000000\r', b'T103FFFF09FC1800000000000000\r', b'T103FFFF0X\r',
    b'T-03FFFF08FC18000000000000\r', b'TFFFFFFFF8FC18000000000000\r', b'tFFF0\r', b't-010\r',
    b'T103FFFF08\xff\xfe\xfd\r', b'\x00\x80\xc3\r', b'\xc3\x28\r', b'r1230\r', b'R103FFFF00\r',
    b'R103FFFFXX\r', b'd1231\r', b'DXXX\r', b'b\r', b'B103FFFF0F' + b'00' * 64 + b'\r',
    b'x103FFFF08FC18\r', b'\a\a\a', b'\r\r\r\r', b'z\rZ\r', b'V1013\rN1234\rF00\r',
]
FOREIGN = [
    'T103FFFF00', 'T103FFFF012C', 'T103FFFF032C0102', 'T10200000800010002000300',
    'T103001E280003E80000000000', 'T102001E080000000000000000', 'T102001EF80000000000000000',
    'T1FFFFFF080007000000000000', 't3F180102030405060708', 't7FF0', 'T000000000',
    'T003FFFF0801F4000000000000', 'T102007A480000000000000000', 'T002001E180000000000000000',
    't0000', 't7FF80000000000000000',
]


@pytest.mark.real
def test_rubbish_on_the_bus(processes: Processes, client: Client, namespace: str,
                            tmp_path: Path, peer: Peer) -> None:
    bridge = processes.bridge(witness_file(tmp_path), namespace)
    drive = f'/{namespace}/conveyor'
    bus = f'{namespace}/drive_can_bridge: bus main'
    status = f'{namespace}/drive_can_bridge: drive conveyor'
    client.online(drive)
    # a line that lost characters is no shorter frame, nor is there one with nine bytes: the right
    # answer comes after them
    client.value(f'{drive}/actual_speed', -100.0, -100.0)
    peer.answers[CYCLIC_REQUEST] = lambda line: [
        'T103FFFF081234', 'T103FFFF0812345678', 'T103FFFF09123456781234567812',
        str(DRIVE[CYCLIC_REQUEST])]
    peer.wait_for(CYCLIC_REQUEST, len(peer.lines), 20)
    assert client.values(f'{drive}/actual_speed') == [-100.0]
    before = client.diagnostics(bus)
    generator = random.Random(20260101)
    for _ in range(3):
        for junk in MALFORMED:
            peer.send(junk)
        for line in FOREIGN:
            peer.send(line.encode() + b'\r')
        for _ in range(30):
            length = generator.randrange(9)
            peer.send(f'T{generator.randrange(1 << 29):08X}{length}'
                      f'{generator.randbytes(length).hex().upper()}\r'.encode())
            # the end is ours: what follows is a line of its own
            peer.send(generator.randbytes(generator.randrange(60)).replace(b'T', b'U') + b'\r')
        peer.wait_for(CYCLIC_REQUEST, len(peer.lines), 3)
    # counted and told, and the connection was not lost over it
    after = client.diagnostics(bus, frames_rejected='[1-9][0-9]')
    assert after['state'] == 'up'
    assert after['reconnections'] == before['reconnections'] == '0'
    assert int(client.diagnostics(status)['frames_rejected']) > 0
    bridge.error('conveyor: (frame rejected|another master)')
    # a line that never ends does not fill the memory, and what comes after it is read
    for _ in range(10):
        peer.send(b'U' * 1000)
        peer.wait_for(CYCLIC_REQUEST, len(peer.lines), 2)
    peer.send(b'\r')

    # the drive is as usable as ever, and nothing but its own values was published
    peer.answers[CYCLIC_REQUEST] = f'{CYCLIC_RESPONSE}0320000000000000'
    client.value(f'{drive}/actual_speed', 80.0, 80.0)
    assert client.get(drive, 'first') == [1000]
    assert bridge.end() == 0
    assert not [line for line in bridge.errors if 'bus main: ' in line and 'open' not in line]
    # the bridge's own frames stayed the usual ones
    frames = {line[:10] for line in peer.lines if line.startswith('T')}
    assert frames <= {CYCLIC_REQUEST, READ_REQUEST_MAP[:10], READ_RESPONSE_MAP[:10], READ_30[:10]}
