# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The same on a real SocketCAN bus, with candump as the witness.

Needs an interface named by DRIVE_CAN_SOCKETCAN, or vcan0; interfaces that are taken down and
deleted are made here, which needs root.
"""

from collections.abc import Iterator
import json
import os
from pathlib import Path
import re
import shutil
import signal
import socket
import struct
import subprocess

from kernel_adapter import ip
from parameter_files import bridge_file, CONVEYOR
from processes import Client, command_line, Processes
import pytest
from repeating import again_and_again
from test_system_reconnection import goes_on, rearm_and_move, start_moving
from waiting import SLOWNESS, wait_for, wait_for_end

from drive_can_bridge.transport.kernel_interfaces import index_of

CHANNEL = os.environ.get('DRIVE_CAN_SOCKETCAN', 'vcan0')
#: two controllers with a bit rate on one wire, where there are some
CONTROLLERS = os.environ.get('DRIVE_CAN_CONTROLLERS', '').split()
#: made and deleted here, where there are none
OWN = 'vcandrive'
PERIOD = 0.1
#: what is lost here is a bus, and not answers that a slow machine gives late
DRIVES = {'conveyor': {**CONVEYOR, 'period': PERIOD, 'missed_limit': 100,
                       'parameter_timeout': SLOWNESS, 'command_timeout': 5.0 * SLOWNESS}}

pytestmark = [
    pytest.mark.socketcan,
    pytest.mark.skipif(not Path('/sys/class/net', CHANNEL).exists(),
                       reason=f'no SocketCAN interface {CHANNEL}; name one by '
                              f'DRIVE_CAN_SOCKETCAN'),
]


def make_own() -> None:
    """Create the interface of our own, and switch it on."""
    ip('link', 'add', 'dev', OWN, 'type', 'vcan')
    ip('link', 'set', 'dev', OWN, 'up')


@pytest.fixture
def ends() -> Iterator[tuple[str, str]]:
    """Return the interface of a bridge that a test may do anything with, and its drives' one."""
    if os.geteuid() != 0:
        pytest.skip('taking interfaces down needs root')
    if len(CONTROLLERS) == 2:
        yield CONTROLLERS[0], CONTROLLERS[1]
        return
    try:
        make_own()
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f'no virtual CAN interface can be made: {error}')
    yield OWN, OWN
    subprocess.run(['ip', 'link', 'delete', 'dev', OWN], check=False, capture_output=True)


def seen(lines: list[str], interface: str) -> list[tuple[float, str]]:
    """Return time and frame of candump's log lines, those of a stranger left out."""
    matches = [re.fullmatch(rf'\(([0-9.]+)\) {interface} (\S+)(?: [RT])?', line)
               for line in lines]
    assert all(matches)
    return [(float(match.group(1)), match.group(2)) for match in matches
            if match and not match.group(2).startswith('7A')]


@pytest.mark.skipif(shutil.which('candump') is None, reason='candump is not installed')
def test_candump_sees_the_right_frames_and_decode_reads_them(
        processes: Processes, client: Client, namespace: str, tmp_path: Path) -> None:
    file = bridge_file(tmp_path, interface='socketcan', channel=CHANNEL, drives=DRIVES)
    decode = [*command_line('drive_can'), 'decode', '--params-file', str(file), '--json']
    live = processes.start([*decode, '--live'], 'live')
    candump = processes.start(['stdbuf', '-oL', 'candump', '-L', CHANNEL], 'candump')
    # both listen as soon as both have heard somebody
    with stranger(CHANNEL) as raw, again_and_again(
            lambda: raw.send(packed(0x7A0, '0102030405060708'))):
        live.line('7A0')
        candump.line('7A0')
    simulator = processes.simulator(file, link=False)
    assert f'bus main: socketcan {CHANNEL}' in simulator.lines
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/conveyor'
    start_moving(client, drive)
    assert client.set(drive, ramp_time=7.25) == [(True, '')]
    assert client.get(drive, 'ramp_time') == [7.25]
    simulator.write('conveyor stuck=ramp_time')
    simulator.line('conveyor: fault stuck')
    assert client.set(drive, ramp_time=8.0) == [(False, 'read back 7.25 instead of 8')]
    # once more where the whole machine stood still meanwhile: the drive is offline then
    told = 'conveyor: read p9999 (P9999): no answer in'
    wait_for(lambda: client.get(drive, 'p9999') == [None] and any(
        told in line for line in bridge.errors), told)
    assert bridge.end() == 0
    wait_for_end(lambda: [text for _, text in seen(candump.lines, CHANNEL)
                          if text.startswith('003FFFF0#')], ['003FFFF0#000003E800000000'] * 3)

    def unanswered() -> int:
        return sum({'003': 1, '103': -1}.get(text[:3], 0)
                   for _, text in seen(candump.lines, CHANNEL) if text[3:8] == 'FFFF0')
    wait_for(lambda: abs(unanswered()) <= 1, 'the answers')

    frames = seen(candump.lines, CHANNEL)
    texts = [text for _, text in frames]
    # nothing cyclic before both maps were read, which is done once more after a stall
    first = texts.index('003FFFF0#000003E800000000')
    requests = [text for text in texts[:first] if text.startswith('002')]
    answers = [text for text in texts[:first] if text.startswith('102')]
    assert len(requests) + len(answers) == first
    assert requests[-2:] == ['002007A4#0000000000000000', '002007E4#0000000000000000']
    assert set(requests[:-2]) <= set(requests[-2:])
    assert answers[-2].startswith('102007A4#00320033')
    assert answers[-1].startswith('102007E4#00D100D200D3')
    cyclic = [(at, text) for at, text in frames if text.startswith('003FFFF0#')]
    assert '003FFFF0#05DC03E800000000' in texts
    assert '003001E1#02D5000000000000' in texts
    # as many as the period allows, and not many fewer, but for seconds that all stood still
    times = [at for at, _ in frames if at >= cyclic[0][0]]
    stalls = [later - sooner for sooner, later in zip(times, times[1:])
              if later - sooner > 5.0 * PERIOD]
    cycles = (cyclic[-1][0] - cyclic[0][0]) / PERIOD
    assert 0.5 * (cycles - sum(stalls) / PERIOD) <= len(cyclic) <= cycles + 3
    assert candump.running

    # what was recorded reads as what was heard live
    with stranger(CHANNEL) as raw:
        raw.send(packed(0x7A1, '0807060504030201'))
    live.line('7A1')
    candump.line('7A1')
    assert live.end(signal.SIGINT) == 0
    trace = tmp_path / 'candump.log'
    trace.write_text(''.join(f'{line}\n' for line in candump.lines), encoding='ascii')
    read = processes.start([*decode, str(trace)], 'read')
    assert read.wait() == 0

    def telegrams(lines: list[str]) -> list[dict[str, object]]:
        """Leave out what listeners may differ in: when they began, and microseconds."""
        entries = [json.loads(line) for line in lines]
        return [{key: value for key, value in entry.items() if key not in ('time', 'latency_ms')}
                for entry in entries if '7A0' not in str(entry)]
    heard = telegrams(live.lines)
    assert heard == telegrams(read.lines)
    # each request of a cycle, and its answer
    assert sum(entry['kind'] == 'cyclic' for entry in heard) > 20
    assert {'speed_setpoint', 'ramp_time'} <= {
        name for entry in heard for name in entry.get('values') or {}}


def test_two_bridges_on_one_bus(processes: Processes, client: Client, namespace: str,
                                tmp_path: Path) -> None:
    both = {**DRIVES, 'neighbour': {**DRIVES['conveyor'], 'station': 2}}
    places = {name: f'{namespace}_{name}' for name in both}

    def file(*names: str) -> Path:
        folder = tmp_path / '_'.join(names)
        folder.mkdir()
        return bridge_file(folder, interface='socketcan', channel=CHANNEL,
                           drives={name: both[name] for name in names})
    simulator = processes.simulator(file(*both), link=False)
    files = {name: file(name) for name in both}
    bridges = {name: processes.bridge(files[name], places[name]) for name in both}
    conveyor, neighbour = (f'/{places[name]}/{name}' for name in both)
    start_moving(client, conveyor)
    start_moving(client, neighbour)

    # a drive has one master, and that is named
    third = processes.bridge(files['conveyor'], f'{namespace}_third')
    assert third.wait() == 1
    assert f'process {bridges["conveyor"].pid}' in '\n'.join(third.errors)

    # one dies: the other one goes on as if nothing had been, and takes no notice of its drive
    bridges['neighbour'].kill()
    goes_on(client, conveyor, bridges['conveyor'], simulator)

    assert bridges['conveyor'].end() == 0
    wait_for_end(lambda: simulator.frames('^003FFFF0#.* R$'), ['003FFFF0#000003E800000000 R'] * 3)


def test_interface_taken_down_and_up_deleted_and_created(
        processes: Processes, client: Client, namespace: str, tmp_path: Path,
        ends: tuple[str, str]) -> None:
    own, there = ends
    file = bridge_file(tmp_path, interface='socketcan', channel=own, drives=DRIVES)
    simulator = processes.simulator(file, '--channel', there, link=False)
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/conveyor'
    bus = f'{namespace}/drive_can_bridge: bus main'
    start_moving(client, drive)
    bridge.error('bus main: open')      # which may be read only now
    told = len(bridge.errors)
    ip('link', 'set', 'dev', own, 'down')
    client.online(drive, wanted=False)
    why = f'interface {own} is down: ip link set {own} up'
    bridge.error(fr'bus main: {why}; tried again every 0\.2 s')
    client.diagnostics(bus, state='^down$')
    for _ in range(3):  # at every attempt: SocketCAN opens an interface that is down
        facts = client.diagnostics(bus)
        assert (facts['state'], facts['level']) == ('down', '2')
        assert why in facts['message']
    assert client.set(drive, ramp_time=1.0) == [(False, 'bus down')]
    # told when it went, and not at each attempt
    told_of = [line for line in bridge.errors[told:] if 'bus main: ' in line]
    assert len(told_of) <= 2 and all(why in line for line in told_of), told_of
    if own == there:
        simulator.error(f'lost|{why}')
    count = len(simulator.frames())
    ip('link', 'set', 'dev', own, 'up')
    rearm_and_move(client, drive, bridge, simulator, count)
    facts = client.diagnostics(bus)
    assert (facts['state'], facts['error_frames']) == ('up', '0')

    if own == OWN:
        told = len(bridge.errors)
        ip('link', 'delete', 'dev', own)
        client.online(drive, wanted=False)
        # first the interface goes down, then there is none
        client.diagnostics(bus, state='^down$', message='is gone: unplugged, or deleted')
        bridge.error(fr'bus main: interface {own} is gone: unplugged, or deleted', since=told)
        count = len(simulator.frames())
        make_own()
        rearm_and_move(client, drive, bridge, simulator, count)
    assert bridge.end() == 0
    assert simulator.end() == 0


def test_interface_that_is_renamed(processes: Processes, client: Client, namespace: str,
                                   tmp_path: Path, ends: tuple[str, str]) -> None:
    """It is still the interface of this number, but not the one that the file names."""
    own, there = ends
    if own != OWN:
        pytest.skip('the drives are on another interface')
    other = f'{own}2'
    file = bridge_file(tmp_path, interface='socketcan', channel=own, drives=DRIVES)
    simulator = processes.simulator(file, '--channel', there, link=False)
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/conveyor'
    start_moving(client, drive)
    bridge.error('bus main: open')
    told = len(bridge.errors)
    ip('link', 'set', 'dev', own, 'down')
    try:
        ip('link', 'set', 'dev', own, 'name', other)
        ip('link', 'set', 'dev', other, 'up')
        client.online(drive, wanted=False)
        why = f'interface {own} is called {other} now'
        client.diagnostics(f'{namespace}/drive_can_bridge: bus main', state='^down$',
                           message=why)
        bridge.error(f'bus main: {why}: write it as channel, or', since=told)
        # nothing is sent on an interface that the file does not name
        count = len(simulator.frames())
        assert client.set(drive, ramp_time=1.0) == [(False, 'bus down')]
        assert not simulator.frames(' R$', count)
    finally:
        name = other if index_of(other) else own
        ip('link', 'set', 'dev', name, 'down')
        if name == other:
            ip('link', 'set', 'dev', other, 'name', own)
        ip('link', 'set', 'dev', own, 'up')
    rearm_and_move(client, drive, bridge, simulator, count)
    assert bridge.end() == 0
    wait_for_end(lambda: simulator.frames('^003FFFF0#.* R$'),
                 ['003FFFF0#000003E800000000 R'] * 3)


def stranger(channel: str) -> socket.socket:
    """Return a raw socket on the bus."""
    raw = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    raw.bind((channel,))
    return raw


def packed(identifier: int, data: str) -> bytes:
    """Return a frame as the kernel wants it: linux/can.h, struct can_frame."""
    return struct.pack('=IB3x8s', identifier, len(data) // 2, bytes.fromhex(data))


def test_error_frames_and_lost_frames(processes: Processes, client: Client, namespace: str,
                                      tmp_path: Path) -> None:
    file = bridge_file(tmp_path, interface='socketcan', channel=CHANNEL, drives=DRIVES)
    simulator = processes.simulator(file, link=False)
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/conveyor'
    bus = f'{namespace}/drive_can_bridge: bus main'
    start_moving(client, drive)
    with stranger(CHANNEL) as raw:
        # CAN_ERR_FLAG with CAN_ERR_PROT: stuff error in the data; then CAN_ERR_CRTL: warning
        with again_and_again(lambda: raw.send(packed(0x20000008, '0000040A00000000'))):
            facts = client.diagnostics(bus, message='stuff error in the data')
        assert facts['level'] == '1'
        assert facts['message'].endswith('check cable, shield, termination and bit rate')
        raw.send(packed(0x20000004, '0008000000000000'))
        client.diagnostics(bus, state='^error-warning$', level='^1$')
        raw.send(packed(0x20000004, '0040000000000000'))
        client.diagnostics(bus, state='^up$', level='^0$')

        # bus-off, and the controller is restarted (this one never left): re-armed, not resumed
        count = len(simulator.frames())
        raw.send(packed(0x20000040, '0000000000000000'))
        client.online(drive, wanted=False)
        bridge.error('conveyor: offline: bus main is down$')
        client.online(drive)
        rearm_and_move(client, drive, bridge, simulator, count + 8)
        facts = client.diagnostics(bus, state='^up$')
        assert (facts['bus_off_count'], facts['reconnections']) == ('1', '1')

        # a process that does not read loses frames, and says so when it can again
        def fall_asleep() -> None:
            bridge.send(signal.SIGSTOP)
            for _ in range(2000):
                raw.send(packed(0x903FFFF0, '0000000000000000'))
            bridge.send(signal.SIGCONT)
        with again_and_again(fall_asleep, 0.5 * SLOWNESS):
            facts = client.diagnostics(bus, message='[0-9]+ received frames lost')
        assert facts['level'] == '1'
    assert bridge.end() == 0
