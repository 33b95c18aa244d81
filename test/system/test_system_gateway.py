# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Drives behind a gateway that dies, stands still, or has other clients.

The gateway is a process of its own in front of a real SocketCAN interface (socketcand is packaged
by nobody whose packages CI has).
"""

from pathlib import Path
import signal
import sys

from parameter_files import bridge_file, CONVEYOR, NEIGHBOUR
from processes import Client, command_line, Process, Processes
import pytest
from test_system_reconnection import CYCLIC, goes_on, MOVING, NEUTRAL, rearm_and_move, start_moving
from test_system_socketcan import CHANNEL
from waiting import SLOWNESS, wait_for_end

PERIOD = 0.1
#: what is lost here is a gateway, and not answers that a slow machine gives late
PATIENT = {'period': PERIOD, 'missed_limit': 100, 'parameter_timeout': SLOWNESS,
           'command_timeout': 5.0 * SLOWNESS}
DRIVES = {'conveyor': {**CONVEYOR, **PATIENT}}
#: for what is only told by silence
MISSED_LIMIT = 10
#: cycles that were under way, or that a simulator on a busy machine notes later
SLACK = 5
STOPS = ['003FFFF0#000003E800000000 R'] * 3

pytestmark = [
    pytest.mark.socketcan, pytest.mark.real,
    pytest.mark.skipif(not Path('/sys/class/net', CHANNEL).exists(),
                       reason=f'no SocketCAN interface {CHANNEL}; name one by '
                              f'DRIVE_CAN_SOCKETCAN'),
]


def start_gateway(processes: Processes, port: int = 0) -> tuple[Process, int]:
    """Start a gateway; return it, and its port."""
    gateway = processes.start(
        [sys.executable, str(Path(__file__).with_name('gateway_process.py')), str(port)],
        'gateway')
    return gateway, int(gateway.line('^port ').split()[1])


def file_for(folder: Path, port: int, drives: dict[str, dict[str, object]] = DRIVES) -> Path:
    """Write the parameter file of a bridge behind the gateway."""
    folder.mkdir(exist_ok=True)
    return bridge_file(folder, interface='socketcand', channel=CHANNEL,
                       bus={'host': '127.0.0.1', 'port': port}, drives=drives)


def test_gateway_is_killed_and_restarted(processes: Processes, client: Client, namespace: str,
                                         tmp_path: Path) -> None:
    gateway, port = start_gateway(processes)
    file = file_for(tmp_path, port)
    simulator = processes.simulator(
        file, '--interface', 'socketcan', '--channel', CHANNEL, link=False)
    bridge = processes.bridge(file, namespace)
    drive, bus = f'/{namespace}/conveyor', f'{namespace}/drive_can_bridge: bus main'
    where = f'the gateway 127.0.0.1:{port}'
    start_moving(client, drive)

    gateway.kill()
    client.online(drive, wanted=False)
    bridge.error(fr'\[ERROR\].*bus main: .*{where} has closed the connection; tried again every '
                 r'0\.2 s')
    bridge.error('conveyor: offline: bus main is down$')
    facts = client.diagnostics(bus, state='^down$', message=f'{where} refuses')
    assert facts['level'] == '2'
    assert client.set(drive, ramp_time=1.0) == [(False, 'bus down')]
    told = [line for line in bridge.errors if 'bus main: ' in line and where in line]
    assert len(told) <= 2, told      # not at every attempt

    count = len(simulator.frames())
    _, again = start_gateway(processes, port)
    assert again == port
    rearm_and_move(client, drive, bridge, simulator, count)
    assert client.diagnostics(bus, state='^up$')['reconnections'] == '1'
    assert bridge.end() == 0
    wait_for_end(lambda: simulator.frames('^003FFFF0#.* R$'), STOPS)


def test_gateway_is_suspended(processes: Processes, client: Client, namespace: str,
                              tmp_path: Path) -> None:
    gateway, port = start_gateway(processes)
    file = file_for(tmp_path, port, {
        'conveyor': {**DRIVES['conveyor'], 'missed_limit': MISSED_LIMIT}})
    simulator = processes.simulator(
        file, '--interface', 'socketcan', '--channel', CHANNEL, link=False)
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/conveyor'
    start_moving(client, drive)

    # nothing tells it from drives that are silent; what was sent until then waits in the network
    gateway.suspend()
    client.online(drive, wanted=False)
    bridge.error('conveyor: offline: no cyclic response for')
    assert client.get(drive, 'ramp_time') == [None]
    count = len(simulator.frames())
    gateway.send(signal.SIGCONT)
    client.online(drive)
    simulator.frame(NEUTRAL, count, count=10)
    since = len(simulator.frames())
    cyclic = [simulator.matches(MOVING, frame) for frame in simulator.frames('', count)[
        :since - count] if simulator.matches(CYCLIC, frame) and frame.endswith(' R')]
    # what was sent until it was known, at most so many cycles, and then neutral for good
    assert sum(cyclic) <= MISSED_LIMIT + SLACK
    assert cyclic == sorted(cyclic, reverse=True)
    rearm_and_move(client, drive, bridge, simulator, since)

    # told to end meanwhile: it does not wait, names what it may have left running, and the stop
    # waits in the network in front of nothing
    gateway.suspend()
    assert bridge.end() == 0
    bridge.error('conveyor.*may still be running')
    gateway.send(signal.SIGCONT)
    wait_for_end(lambda: simulator.frames('^003FFFF0#.* R$'), STOPS)


def test_second_client_of_the_gateway(processes: Processes, client: Client, namespace: str,
                                      tmp_path: Path) -> None:
    _, port = start_gateway(processes)
    both = {**DRIVES, 'neighbour': {**NEIGHBOUR, **PATIENT}}
    places = {name: f'{namespace}_{name}' for name in both}
    files = {name: file_for(tmp_path / name, port, {name: both[name]}) for name in both}
    simulator = processes.simulator(file_for(tmp_path / 'all', port, both), '--interface',
                                    'socketcan', '--channel', CHANNEL, link=False)
    live = processes.start([*command_line('drive_can'), 'decode', '--live', '--params-file',
                            str(tmp_path / 'all' / 'bridge.yaml')], 'live')
    bridges = {name: processes.bridge(files[name], places[name]) for name in both}
    conveyor, neighbour = (f'/{places[name]}/{name}' for name in both)
    start_moving(client, conveyor)
    start_moving(client, neighbour)
    # a third one hears both
    for name in both:
        live.line(f'main {name} > cyclic request: speed_setpoint 150')

    bridges['neighbour'].kill()
    live.kill()
    goes_on(client, conveyor, bridges['conveyor'], simulator)
    assert bridges['conveyor'].end() == 0
    wait_for_end(lambda: simulator.frames('^003FFFF0#.* R$'), STOPS)


def test_channel_that_the_gateway_does_not_have(processes: Processes, client: Client,
                                                namespace: str, tmp_path: Path) -> None:
    _, port = start_gateway(processes)
    file = bridge_file(tmp_path, interface='socketcand', channel='nothing7',
                       bus={'host': '127.0.0.1', 'port': port}, drives=DRIVES)
    bridge = processes.bridge(file, namespace)
    why = (f'the gateway 127.0.0.1:{port} refuses channel nothing7: error could not open bus')
    bridge.error(f'bus main: .*{why}')
    client.diagnostics(f'{namespace}/drive_can_bridge: bus main', state='^down$', message=why)
    assert bridge.end() == 0
