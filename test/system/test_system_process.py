# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What happens to the process itself: a signal at an awkward moment, nothing left to open."""

from collections.abc import Iterator
import os
from pathlib import Path
import resource
import signal
import threading
import tty

from parameter_files import bridge_file, CONVEYOR
from processes import Client, Process, Processes
import pytest
from test_system_reconnection import moving, rearm_and_move
from waiting import clock, pause, wait_for, wait_for_end

DEACTIVATE = 4


@pytest.fixture
def terminal() -> Iterator[str]:
    """Return a pseudo-terminal that takes everything and answers nothing."""
    master, slave = os.openpty()
    tty.setraw(slave)
    ending = threading.Event()

    def drain() -> None:
        os.set_blocking(master, False)
        while not ending.wait(0.01):
            try:
                os.read(master, 65536)
            except OSError:
                pass
    thread = threading.Thread(target=drain)
    thread.start()
    yield os.ttyname(slave)
    ending.set()
    thread.join()
    os.close(master)
    os.close(slave)


def has_open(process: Process, path: str) -> bool:
    """Tell whether a process has a file open."""
    for entry in Path(f'/proc/{process.pid}/fd').iterdir():
        try:
            if os.readlink(entry) == path:
                return True
        except OSError:
            pass
    return False


@pytest.mark.real
def test_signal_while_configuring(processes: Processes, namespace: str, tmp_path: Path,
                                  terminal: str) -> None:
    # an adapter that takes its time: configure waits three seconds for the first attempt
    bridge = processes.bridge(
        bridge_file(tmp_path, channel=terminal, bus={'sleep_after_open': 600.0}), namespace)
    wait_for(lambda: has_open(bridge, terminal), 'the adapter to be opened')
    assert bridge.end(signal.SIGINT) == 0
    # nothing was begun that would have had to be stopped
    assert not [line for line in bridge.errors if 'active' in line]


@pytest.mark.parametrize('delay', [0.0, 0.15, 0.4])
def test_signal_while_deactivating(processes: Processes, client: Client, namespace: str,
                                   tmp_path: Path, delay: float) -> None:
    # three neutral cycles of 0.1 s; whatever is under way when the signal comes
    file = bridge_file(tmp_path, drives={'conveyor': {**CONVEYOR, 'period': 0.2}})
    simulator, bridge, _ = moving(processes, client, namespace, file)
    def send() -> None:
        pause(delay)
        bridge.send(signal.SIGTERM)
    thread = clock().worker(send, 'the signal')
    thread.start()
    try:
        client.ask('transition', node=f'/{namespace}/drive_can_bridge', number=DEACTIVATE,
                   timeout=5.0)
    except AssertionError:
        pass  # it has gone before it could answer
    thread.join()
    assert bridge.wait() == 0
    wait_for_end(lambda: simulator.frames('^003FFFF0.* R$'),
                 ['003FFFF0#000003E800000000 R'] * 3)
    assert not [line for line in bridge.errors if '[ERROR]' in line]


@pytest.mark.real
def test_out_of_file_descriptors(processes: Processes, client: Client, namespace: str,
                                 tmp_path: Path) -> None:
    file = bridge_file(tmp_path)
    simulator, bridge, drive = moving(processes, client, namespace, file)
    # no further file can be opened, whatever is closed
    before = resource.prlimit(bridge.pid, resource.RLIMIT_NOFILE)
    resource.prlimit(bridge.pid, resource.RLIMIT_NOFILE, (3, before[1]))
    simulator.kill()
    client.online(drive, wanted=False)
    again = processes.simulator(file)
    bridge.error('bus main: .*Too many open files')
    facts = client.diagnostics(f'{namespace}/drive_can_bridge: bus main',
                               message='Too many open files')
    assert facts['level'] == '2'
    assert client.set(drive, ramp_time=1.0) == [(False, 'bus down')]
    resource.prlimit(bridge.pid, resource.RLIMIT_NOFILE, before)
    rearm_and_move(client, drive, bridge, again)
    assert bridge.end() == 0
