# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can jog`` as a process: however it ends while the drive moves, the drive stops."""

from collections.abc import Iterator
import os
from pathlib import Path
import signal

from parameter_files import bridge_file, CONVEYOR
from processes import command_line, Process, Processes, Simulator
import pytest

pytestmark = pytest.mark.real

#: 300.0 rpm, and neutral, on the bus
MOVING, NEUTRAL = '^003FFFF0#0BB8', '^003FFFF0#0000'
#: signal -> exit code
SIGNALS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129}
#: what is said of setpoints that nobody keeps
TIMED_OUT = 'no command for 2 s: speed_setpoint neutral until armed again'


@pytest.fixture
def scene(processes: Processes, tmp_path: Path) -> Iterator[tuple[Process, Simulator]]:
    """Return a bridge, and its simulated drive."""
    file = bridge_file(tmp_path, drives={'conveyor': {
        **CONVEYOR, 'command_timeout': 2.0, 'missed_limit': 250, 'parameter_timeout': 2.0}})
    drives = processes.simulator(file)
    bridge = processes.bridge(file)
    bridge.error('conveyor: online')
    yield bridge, drives


def moving(processes: Processes, drives: Simulator, **streams: int) -> tuple[Process, int]:
    """Return a jog that moves the drive, and how many frames there were by then."""
    since = len(drives.frames())
    jog = processes.start([*command_line('drive_can'), 'jog', 'conveyor', '300', '--for', '60',
                           '--yes'], 'jog', **streams)
    drives.frame(MOVING, since)
    return jog, len(drives.frames())


def stands(drives: Simulator, since: int) -> None:
    """See that neutral came, and nothing else behind it."""
    drives.frame(NEUTRAL, since)
    cycles = drives.frames('^003FFFF0', since)
    last_moving = max((place for place, frame in enumerate(cycles)
                       if not frame.startswith('003FFFF0#0000')), default=-1)
    first_neutral = next(place for place, frame in enumerate(cycles)
                         if frame.startswith('003FFFF0#0000'))
    assert last_moving < first_neutral


def test_signals_end_it_with_neutral(processes: Processes,
                                     scene: tuple[Process, Simulator]) -> None:
    bridge, drives = scene
    for number, code in SIGNALS.items():
        jog, since = moving(processes, drives)
        jog.send(signal.SIGTSTP)    # would leave the drive running
        jog.error('Ctrl-Z refused')
        assert jog.end(number) == code, jog.errors
        stands(drives, since)
        assert any('back to neutral' in line for line in jog.errors)
    assert not any('WARN' in line and TIMED_OUT in line for line in bridge.errors)


def test_when_it_is_killed_command_timeout_ends_it(processes: Processes,
                                                   scene: tuple[Process, Simulator]) -> None:
    bridge, drives = scene
    jog, since = moving(processes, drives)
    assert jog.end(signal.SIGKILL) == -signal.SIGKILL
    bridge.error(f'WARN.*{TIMED_OUT}')
    stands(drives, since)


def test_when_nobody_reads_what_it_shows(processes: Processes,
                                         scene: tuple[Process, Simulator]) -> None:
    _, drives = scene
    reading, writing = os.pipe()
    jog, since = moving(processes, drives, stdout=writing)
    os.close(writing)
    os.close(reading)
    assert jog.wait() == 1
    stands(drives, since)
