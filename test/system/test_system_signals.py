# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""SIGINT, SIGTERM, SIGHUP, SIGSTOP and SIGKILL of the bridge, whatever it is doing."""

from pathlib import Path
import signal

from parameter_files import bridge_file, CONVEYOR
from processes import Client, Process, Processes
import pytest
from test_system_datamodel_standard import SHORT
from test_system_reconnection import moving, NEUTRAL, rearm_and_move, start_moving
from waiting import wait_for, wait_for_end
from world import World


def looks_after_signals(process: Process) -> bool:
    """Tell whether the process has taken SIGTERM over: from then on it is the bridge's code."""
    status = Path(f'/proc/{process.pid}/status').read_text(encoding='ascii')
    caught = next(line for line in status.splitlines() if line.startswith('SigCgt'))
    return bool(int(caught.split()[1], 16) & 1 << signal.SIGTERM - 1)


@pytest.mark.real
def test_while_active(processes: Processes, client: Client, namespace: str, tmp_path: Path,
                      ) -> None:
    file = bridge_file(tmp_path)
    simulator, bridge, _ = moving(processes, client, namespace, file)
    bridge.send(signal.SIGTSTP)     # Ctrl-Z would leave it running
    bridge.error('drive_can_bridge: Ctrl-Z refused: ')
    assert bridge.end(signal.SIGTERM) == 0
    # nobody tells the drive that a bridge has gone: three neutral frames have to
    wait_for_end(lambda: simulator.frames('^003FFFF0.* R$'),
                 ['003FFFF0#000003E800000000 R'] * 3)
    assert '003FFFF0#05DC03E800000000 R' in simulator.frames('^003FFFF0.* R$')[-8:]
    # and then nothing at all
    client.online(f'/{namespace}/conveyor', wanted=False)
    count = len(simulator.frames(' R$'))
    simulator.write('list')
    simulator.line('^conveyor: ')
    assert len(simulator.frames(' R$')) == count
    bridge.error('conveyor: stopped')
    assert not [line for line in bridge.errors if '[ERROR]' in line]


@pytest.mark.parametrize(('numbers', 'code'), [
    ([signal.SIGINT], 0), ([signal.SIGHUP], 0), ([signal.SIGQUIT], 131),
    ([signal.SIGINT, signal.SIGTERM], 0)], ids=['SIGINT', 'SIGHUP', 'SIGQUIT', 'one breath'])
def test_whichever_it_is_what_moves_is_stopped(processes: Processes, client: Client,
                                               namespace: str, tmp_path: Path,
                                               numbers: list[int], code: int) -> None:
    file = bridge_file(tmp_path)
    simulator, bridge, _ = moving(processes, client, namespace, file)
    for number in numbers:
        bridge.send(number)
    assert bridge.wait() == code
    assert simulator.frames('^003FFFF0.* R$')[-4:] == [
        '003FFFF0#05DC03E800000000 R', *['003FFFF0#000003E800000000 R'] * 3]
    bridge.error('conveyor: stopped')


def test_drive_that_falls_silent_together_with_the_end(
        processes: Processes, client: Client, namespace: str, tmp_path: Path) -> None:
    file = bridge_file(tmp_path)
    simulator, bridge, _ = moving(processes, client, namespace, file)
    simulator.write('conveyor silent')
    assert bridge.end() == 0
    bridge.error('conveyor: told to stop, but it does not answer: it may still be running')
    assert not [line for line in bridge.errors if line.endswith('conveyor: stopped')]


def test_while_the_bus_is_absent(processes: Processes, namespace: str, tmp_path: Path,
                                 world: World) -> None:
    world.wires.of('/dev/no_such_adapter').lose('slcan /dev/no_such_adapter: is not there')
    bridge = processes.bridge(bridge_file(tmp_path, channel='/dev/no_such_adapter'), namespace)
    bridge.error('active: 1 drive on 1 bus')
    bridge.error('bus main: ')      # it has been tried by now
    assert bridge.end() == 0
    text, = [line for line in bridge.errors if 'bus main' in line]
    assert '/dev/no_such_adapter' in text
    assert 'tried again every 0.2 s' in text


def test_while_unconfigured(processes: Processes, client: Client, namespace: str, tmp_path: Path,
                            ) -> None:
    bridge = processes.bridge(bridge_file(tmp_path, autostart=False), namespace)
    node = f'/{namespace}/drive_can_bridge'
    assert client.ask('transition', node=node, number=3) is False  # activate: not possible
    bridge.error('transition number 3 is not possible in state unconfigured '
                 r'\(possible are configure, shutdown\)')
    assert bridge.end() == 0
    assert len([line for line in bridge.errors if 'ransition' in line]) == 1    # rcl's own, too
    assert not [line for line in bridge.errors if 'bus main' in line]


def test_while_inactive(processes: Processes, client: Client, namespace: str,
                        tmp_path: Path) -> None:
    file = bridge_file(tmp_path, autostart=False)
    simulator = processes.simulator(file)
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/conveyor'
    assert client.ask('transition', node=f'/{namespace}/drive_can_bridge', number=1) is True
    client.online(drive, wanted=False)
    bridge.error('bus main: open')
    assert bridge.end() == 0
    assert simulator.frames() == []


@pytest.mark.real
@pytest.mark.parametrize(('number', 'library'), [
    (signal.SIGINT, ''), (signal.SIGTERM, 'librmw_fastrtps_cpp')])
def test_during_start_up(processes: Processes, namespace: str, tmp_path: Path, number: int,
                         library: str) -> None:
    # some moments of the start-up, told by what has been loaded by then
    bridge = processes.bridge(bridge_file(tmp_path, channel='/dev/no_such_adapter'), namespace)
    maps = Path(f'/proc/{bridge.pid}/maps')

    def reached() -> bool:
        loaded = maps.read_text(encoding='utf-8')
        ready = looks_after_signals(bridge)
        # loading the ROS libraries takes a second, in which a signal must not go wrong
        assert ready or '_rclpy_pybind11' not in loaded
        return ready and library in loaded
    wait_for(reached, f'{library} loaded')
    assert bridge.end(number) == 0
    assert not [line for line in bridge.errors if 'bus main' not in line and 'active' not in line]


@pytest.mark.real
def test_drives_that_a_second_signal_leaves_unstopped_are_named(
        processes: Processes, client: Client, namespace: str, tmp_path: Path) -> None:
    """It has to be told by writes that nobody confirms, which takes longer than the grace."""
    file = bridge_file(tmp_path, drives={'conveyor': SHORT})
    simulator, bridge, _ = moving(processes, client, namespace, file)
    simulator.suspend()
    try:
        bridge.send(signal.SIGINT)
        client.ask('rest', seconds=0.1)     # twice in the same breath is one signal
        bridge.send(signal.SIGINT)
        assert bridge.wait() == 128 + signal.SIGINT
    finally:
        simulator.send(signal.SIGCONT)
    bridge.error('^conveyor: the bridge ends before the drive has confirmed its stop: '
                 'it may still be running')


@pytest.mark.real
def test_process_that_stood_still(processes: Processes, client: Client, namespace: str,
                                  tmp_path: Path) -> None:
    # a command would still be fresh: only the lost time may stop it
    file = bridge_file(tmp_path, drives={'conveyor': {**CONVEYOR, 'command_timeout': 60.0}})
    simulator, bridge, drive = moving(processes, client, namespace, file)
    bridge.suspend()
    client.ask('rest', seconds=0.3)     # what was on its way when it stopped arrives
    simulator.write('list')
    simulator.line('^conveyor: ')
    count = len(simulator.frames())
    # more than the second after which nothing is believed any more
    client.ask('rest', seconds=1.2)
    stopped = len(simulator.frames())
    assert simulator.frames(' R$', since=count) == []
    bridge.send(signal.SIGCONT)
    bridge.error('conveyor: offline: the bridge stood still')
    requests = wait_for(lambda: [frame for frame in simulator.frames(' R$', since=stopped)
                                 if len(simulator.frames(NEUTRAL, since=stopped)) >= 3],
                        'neutral frames')
    # no burst of what would have been due in the meantime: one frame at most was under way
    assert sum(frame.startswith('003FFFF0#05DC') for frame in requests) <= 1
    rearm_and_move(client, drive, bridge, simulator, stopped + 4)
    assert bridge.end() == 0


@pytest.mark.real
def test_what_was_sent_while_it_stood_still_is_thrown_away(
        processes: Processes, client: Client, namespace: str, tmp_path: Path) -> None:
    # neither a command time-out nor a lost second: only the age of the commands tells
    file = bridge_file(tmp_path, drives={'conveyor': {**CONVEYOR, 'command_timeout': 60.0}})
    simulator = processes.simulator(file)
    bridge = processes.bridge(file, namespace)
    topic = f'/{namespace}/conveyor/command/speed_setpoint'
    start_moving(client, f'/{namespace}/conveyor')
    bridge.suspend()
    client.publish(topic, 200.0, rate=100.0)
    client.ask('rest', seconds=0.1)
    client.silence(topic)       # whoever said 200 has changed his mind long before it goes on
    client.ask('rest', seconds=0.5)
    count = len(simulator.frames())
    bridge.send(signal.SIGCONT)
    requests = simulator.frame('^003FFFF0.* R$', since=count, count=50)
    assert not [frame for frame in requests if frame.startswith('003FFFF0#07D0')]
    bridge.error('commands? .*thrown away|offline: the bridge stood still')
    # what is said now counts
    client.publish(topic, 0.0)
    simulator.frame(NEUTRAL, since=count)
    client.publish(topic, 250.0)
    simulator.frame('^003FFFF0#09C4', since=count)
    assert not simulator.frames('^003FFFF0#07D0')
    assert bridge.end() == 0


@pytest.mark.real
def test_killed(processes: Processes, client: Client, namespace: str, tmp_path: Path) -> None:
    file = bridge_file(tmp_path)
    simulator, bridge, _ = moving(processes, client, namespace, file)
    assert bridge.end(signal.SIGKILL) == -signal.SIGKILL
    # nothing is left behind that goes on feeding the drive, or keeps the adapter busy
    simulator.write('list')
    simulator.line('^conveyor: ')
    count = len(simulator.frames())
    second = processes.bridge(file, f'{namespace}_again')
    drive = f'/{namespace}_again/conveyor'
    client.publish(f'{drive}/command/speed_setpoint', 150.0)
    requests = simulator.frame(' R$', since=count, count=10)
    assert not requests[0].startswith('003FFFF0')
    rearm_and_move(client, drive, second, simulator, count)
    assert second.end() == 0
