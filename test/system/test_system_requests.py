# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Requests that the middleware cannot read: cycles, stops, signals and their times."""

import itertools
from pathlib import Path
import signal
import sys
import time

from parameter_files import bridge_file, CONVEYOR
from processes import Client, Process, Processes, Simulator
import pytest
from test_system_reconnection import start_moving
from waiting import pause, wait_for

pytestmark = pytest.mark.real

PERIOD = 0.02
#: what the middleware does with a request
TROUBLES = 'sleep', 'throw', 'fill'
#: s: an ordinary process on a machine that does other things, too
LATE = 0.5


def _burdened(processes: Processes, file: Path, namespace: str, tmp_path: Path,
              monkeypatch: pytest.MonkeyPatch) -> tuple[Process, Path]:
    trouble = tmp_path / 'trouble'
    monkeypatch.setenv('TROUBLE', str(trouble))
    script = Path(__file__).with_name('burdened_bridge.py')
    return processes.start(
        [sys.executable, str(script), '--ros-args', '--params-file', str(file),
         '-r', f'__ns:=/{namespace}'], 'bridge'), trouble


def _gaps(simulator: Simulator, since: int) -> list[float]:
    """Return the s between cycles, as the drive has received them."""
    times = [float(line.split(')')[0][1:]) for line in simulator.lines[since:]
             if line.startswith('(') and ' 003FFFF0#' in line and line.endswith(' R')]
    return [later - earlier for earlier, later in itertools.pairwise(times)]


@pytest.mark.parametrize('what', TROUBLES)
def test_nobody_else_notices(processes: Processes, client: Client, namespace: str, tmp_path: Path,
                             monkeypatch: pytest.MonkeyPatch, what: str) -> None:
    file = bridge_file(tmp_path, memory_limit_mb=128, drives={
        'conveyor': {**CONVEYOR, 'period': PERIOD, 'missed_limit': 10}})
    simulator = processes.simulator(file)
    bridge, trouble = _burdened(processes, file, namespace, tmp_path, monkeypatch)
    drive = f'/{namespace}/conveyor'
    start_moving(client, drive)
    assert client.get(drive, 'ramp_time') != [None]
    trouble.write_text(what, encoding='ascii')
    since, began = len(simulator.lines), time.monotonic()
    asker = processes.drive_can('read', 'conveyor', 'ramp_time', '--namespace', f'/{namespace}')
    wait_for(lambda: not trouble.exists())
    asked = time.monotonic()
    assert client.control(f'{drive}/quick_stop')[1]
    assert time.monotonic() - asked < 1.0
    if what == 'fill':
        bridge.error('filled with')
    pause(1.0)
    gaps = _gaps(simulator, since)
    assert len(gaps) > (time.monotonic() - began - LATE) / PERIOD * 0.9
    assert max(gaps) < LATE
    assert not [line for line in bridge.errors if 'offline' in line]
    if what == 'throw':
        bridge.error('the middleware cannot read a request of .*/conveyor/get_parameters: '
                     'std::bad_alloc')
    if what != 'sleep':
        assert client.get(drive, 'ramp_time') != [None]
    asked = time.monotonic()
    assert bridge.end(signal.SIGTERM) == 0
    assert time.monotonic() - asked < 3.0
    bridge.error('conveyor: stopped')
    assert simulator.frames('^003FFFF0.* R$')[-1] == '003FFFF0#000003E800000000 R'
    asker.kill()


def test_the_end_while_there_is_no_memory(
        processes: Processes, client: Client, namespace: str, tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch) -> None:
    file = bridge_file(tmp_path, memory_limit_mb=128, drives={
        'conveyor': {**CONVEYOR, 'period': PERIOD}})
    simulator = processes.simulator(file)
    bridge, trouble = _burdened(processes, file, namespace, tmp_path, monkeypatch)
    start_moving(client, f'/{namespace}/conveyor')
    trouble.write_text('fill', encoding='ascii')
    asker = processes.drive_can('read', 'conveyor', 'ramp_time', '--namespace', f'/{namespace}')
    wait_for(lambda: not trouble.exists())
    asked = time.monotonic()
    bridge.send(signal.SIGTERM)
    simulator.frame('^003FFFF0#000003E800000000 R$', count=3)
    assert time.monotonic() - asked < 1.0
    assert bridge.wait() == 0
    bridge.error('conveyor: stopped')
    assert not [line for line in bridge.errors if '[ERROR]' in line]
    asker.kill()
