# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The local way between processes: in a network of its own, so that nobody else's bridge is stopped.

The first test runs the others of this file there.
"""

import os
from pathlib import Path
import socket
import subprocess
import sys
import threading
import time
from typing import Any

from parameter_files import bridge_file, LIFT
from processes import command_line, environment, Processes
import pytest
from waiting import DEADLINE

from drive_can_bridge.process import presence
from drive_can_bridge.process.local_way import Line
from drive_can_bridge.process.presence import bridges, SWITCH

#: set where the network is one of its own
INSIDE = 'DRIVE_CAN_TEST_OWN_NETWORK'
pytestmark = pytest.mark.real
inside = pytest.mark.skipif(INSIDE not in os.environ, reason='runs in a network of its own')


@pytest.mark.skipif(INSIDE in os.environ, reason='is there')
def test_in_a_network_of_its_own() -> None:
    own = Path(__file__).parents[2] / 'bench' / 'own_network.py'
    done = subprocess.run(
        [sys.executable, str(own), sys.executable, '-m', 'pytest', '-q', '-x', '--timeout',
         str(8 * DEADLINE), __file__], text=True, check=False, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, env={**os.environ, INSIDE: '1'})
    if done.returncode == 77:
        pytest.skip(done.stdout.strip())
    assert done.returncode == 0, done.stdout
    assert ' passed' in done.stdout


@pytest.fixture
def on(monkeypatch: pytest.MonkeyPatch) -> None:
    """Switch the local way on, for what is started from now on."""
    monkeypatch.setenv(SWITCH, 'on')


def run(*words: str, without_ros: bool = True) -> tuple[int, list[str], float]:
    """Run a command; return exit code, lines, and s that it took."""
    variables = environment()
    if without_ros:     # whoever loads it anyhow ends
        variables['RMW_IMPLEMENTATION'] = 'rmw_none'
    began = time.monotonic()
    done = subprocess.run([*command_line('drive_can'), *words], env=variables, check=False,
                          text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          timeout=DEADLINE)
    return done.returncode, done.stdout.splitlines(), time.monotonic() - began


def started(processes: Processes, tmp_path: Path, name: str, drive: str, station: int) -> Any:
    """Start a bridge with a drive, and wait until that is online."""
    (tmp_path / name).mkdir(exist_ok=True)
    file = bridge_file(tmp_path / name,
                       drives={drive: {**LIFT, 'station': station, 'bus': name}},
                       buses={name: {'interface': 'slcan', 'bitrate': 1_000_000,
                                     'channel': str(processes.directory / 'links' / name)}})
    simulator = processes.simulator(file)
    bridge = processes.bridge(file, name)
    bridge.error(f'{drive}: online')
    return simulator, bridge


@inside
@pytest.mark.usefixtures('on')
def test_inside_commands_and_one_that_hangs(processes: Processes, tmp_path: Path) -> None:
    simulator, one = started(processes, tmp_path, 'one', 'lift', 2)
    _, two = started(processes, tmp_path, 'two', 'hoist', 3)
    assert run('enable', '/one/lift')[:2] == (0, ['one/lift: enabled'])
    assert run('read', '--namespace', 'one', 'ramp_time', '--json')[0] == 0
    assert run('write', '--namespace', 'one', 'ramp_time=2.5')[0] == 0
    two.suspend()
    code, lines, took = run('stop', without_ros=False)
    assert code == 1 and lines == [
        f'two/drive_can_bridge: NOT STOPPED: this bridge of this host (process {two.pid}) does '
        'not answer here: its drives may still be running', 'one/lift: ready']
    assert run('stop', '/one/lift', without_ros=False)[:2] == (0, ['one/lift: ready'])
    two.kill()
    # the graph has it still, and the successor of a name that was killed
    one.kill()
    simulator.kill()
    started(processes, tmp_path, 'one', 'lift', 2)
    assert run('read', '--namespace', 'one', 'ramp_time', '--json')[0] == 0


@inside
@pytest.mark.usefixtures('on')
def test_inside_attacks_cost_a_bridge_nothing(processes: Processes, tmp_path: Path) -> None:
    _, bridge = started(processes, tmp_path, 'one', 'lift', 2)
    found, = bridges()
    ending = threading.Event()

    def flood(packets: list[bytes]) -> None:
        while not ending.is_set():
            caller = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            try:
                caller.connect(found.address)
                for packet in packets:
                    caller.send(packet)
            except OSError:
                pass
            caller.close()
            time.sleep(0.02)
    attacks = [threading.Thread(target=flood, args=[packets], daemon=True) for packets in (
        [], [b'rubbish'], [b'.1\0who'], [b'+' + 4095 * b'x'], [b'.' + 5000 * b'\0'],
        [b'.1\0get\0/one/lift\0ramp_time'], [b'.1\0set\0/one/lift\0\0\0'], [b'.1\0stop\0*'])]
    for each in attacks:
        each.start()
    try:
        for _ in range(3):      # whoever else has the processors: it may be shown by ROS
            assert run('stop', without_ros=False)[:2] == (0, ['one/lift: ready'])
    finally:
        ending.set()
    for each in attacks:
        each.join(DEADLINE)
    assert not [line for line in bridge.errors if 'internal error' in line]
    assert run('enable', 'lift')[:2] == (0, ['one/lift: enabled'])
    assert not bridge.losses()


@inside
@pytest.mark.usefixtures('on')
def test_inside_a_bridge_that_dies_in_the_answer(processes: Processes, tmp_path: Path) -> None:
    _, bridge = started(processes, tmp_path, 'one', 'lift', 2)
    found, = bridges()
    line = Line(found)
    bridge.suspend()
    line.ask('stop', '*')
    bridge.kill()
    with pytest.raises(ConnectionResetError):
        line.take()
    assert not bridges()
    assert presence.bridges() == []
