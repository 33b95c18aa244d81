# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Nobody reads the log any more: the drives must not notice, nor the way out."""

from collections.abc import Iterator
from pathlib import Path
import signal

from parameter_files import bridge_file, CONVEYOR, NEIGHBOUR
from processes import Client, command_line, Processes
import pytest
from stuck_output import StuckOutput
from test_system_reconnection import start_moving
from waiting import wait_for_end

REQUEST = '003FFFF0'

pytestmark = pytest.mark.real


@pytest.fixture
def output() -> Iterator[StuckOutput]:
    """Return a pipe that takes nothing."""
    with StuckOutput() as stuck:
        assert stuck.full
        yield stuck


def test_a_drive_falls_silent_and_the_bridge_is_stopped(
        processes: Processes, client: Client, namespace: str, tmp_path: Path,
        output: StuckOutput) -> None:
    file = bridge_file(tmp_path, drives={'conveyor': CONVEYOR, 'neighbour': NEIGHBOUR})
    simulator = processes.simulator(file)
    bridge = processes.bridge(file, namespace, stderr=output.write)
    start_moving(client, f'/{namespace}/conveyor')
    client.online(f'/{namespace}/neighbour')
    client.ask('listen_to_log')
    simulator.write('neighbour silent')
    client.online(f'/{namespace}/neighbour', wanted=False)
    # whoever listens to the log gets it all the same
    client.ask('logged', text='neighbour: offline: no cyclic response for 25 cycles')
    # the other one is asked as if nothing had happened, with what it is told to do
    count = len(simulator.frames())
    requests = simulator.frame(f'^{REQUEST}.* R$', since=count, count=100)
    assert set(requests) == {f'{REQUEST}#05DC03E800000000 R'}
    assert client.get(f'/{namespace}/conveyor', 'ramp_time') == [1.0]
    assert output.full
    assert bridge.end(signal.SIGTERM, timeout=10.0) == 0
    wait_for_end(lambda: simulator.frames(f'^{REQUEST}.* R$'),
                 [f'{REQUEST}#000003E800000000 R'] * 3)


def test_second_signal(processes: Processes, client: Client, namespace: str, tmp_path: Path,
                       output: StuckOutput) -> None:
    # three stop frames 0.1 s apart, so that the first signal takes its time
    file = bridge_file(tmp_path, drives={'conveyor': {**CONVEYOR, 'period': 0.1}})
    processes.simulator(file)
    bridge = processes.bridge(file, namespace, stderr=output.write)
    start_moving(client, f'/{namespace}/conveyor')
    bridge.send(signal.SIGINT)
    client.ask('rest', seconds=0.06)    # in the same breath they are one signal
    bridge.send(signal.SIGTERM)
    assert bridge.wait(timeout=10.0) == 128 + signal.SIGTERM
    assert output.full


def test_whoever_closes_its_outputs_gets_a_bridge_all_the_same(
        processes: Processes, client: Client, namespace: str, tmp_path: Path) -> None:
    file = bridge_file(tmp_path)
    simulator = processes.simulator(file)
    bridge = processes.start(
        ['sh', '-c', 'exec "$@" <&- >&- 2>&-', 'sh', *command_line('drive_can_bridge'),
         '--ros-args', '--params-file', str(file), '-r', f'__ns:=/{namespace}'], 'bridge')
    start_moving(client, f'/{namespace}/conveyor')
    assert bridge.end(signal.SIGTERM) == 0
    wait_for_end(lambda: simulator.frames(f'^{REQUEST}.* R$'),
                 [f'{REQUEST}#000003E800000000 R'] * 3)
