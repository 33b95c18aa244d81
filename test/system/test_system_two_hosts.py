# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can stop`` on one of two hosts: who stands beside a bridge has it passed on."""

from pathlib import Path
import signal
import subprocess

from parameter_files import bridge_file, LIFT
from processes import command_line, environment, Process, Processes, Simulator
import pytest
from two_hosts import Host, two_hosts
from waiting import DEADLINE, wait_for

from drive_can_bridge.process.presence import SWITCH

pytestmark = pytest.mark.real
#: cyclic requests with a control word: that runs, that does not
RUN, REST = '005FFFF0#0001', '005FFFF0#0000'


def started(processes: Processes, tmp_path: Path, host: Host, name: str, drive: str,
            ) -> tuple[Simulator, Process]:
    """Start a bridge with a drive on a host, and wait until that is online."""
    (tmp_path / name).mkdir()
    channel = processes.directory / 'links' / name
    file = bridge_file(tmp_path / name, drives={drive: {**LIFT, 'bus': name}}, buses={name: {
        'interface': 'slcan', 'bitrate': 1_000_000, 'channel': str(channel)}})
    simulator = processes.simulator(file)   # a terminal is where its bridge is
    bridge = processes.start(host.command(
        *command_line('drive_can_bridge'), '--ros-args', '--params-file', str(file), '-r',
        f'__ns:=/{name}'), f'bridge_{name}')
    bridge.error(f'{drive}: online')
    return simulator, bridge


def run(host: Host, *words: str) -> tuple[int, list[str]]:
    """Run a command on a host, where nothing goes without the local way: ROS is not there."""
    done = subprocess.run(
        host.command('env', 'RMW_IMPLEMENTATION=rmw_none', *command_line('drive_can'), *words),
        env=environment(), check=False, text=True, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, timeout=DEADLINE)
    return done.returncode, done.stdout.splitlines()


def test_a_stop_is_passed_on_to_the_other_host(processes: Processes, tmp_path: Path) -> None:
    with two_hosts({SWITCH: 'on'}) as (here, there):
        near, _ = started(processes, tmp_path, here, 'near', 'lift')
        far, bridge = started(processes, tmp_path, there, 'far', 'hoist')
        both = 0, ['far/hoist: ready', 'near/lift: ready']

        def stopped(host: Host) -> bool:
            code, lines = run(host, 'stop')
            return (code, sorted(lines)) == both
        for host in (here, there):      # as soon as the bridges have found each other
            wait_for(lambda host=host: stopped(host), 'both to be stopped')
            assert run(here, 'enable', '/near/lift') == (0, ['near/lift: enabled'])
            assert run(there, 'enable', '/far/hoist') == (0, ['far/hoist: enabled'])
            since = len(near.frames()), len(far.frames())
            assert stopped(host)
            for drive, begin in zip((near, far), since):
                drive.frame(REST, begin)
                words = [frame.startswith(RUN) for frame in drive.frames(f'{RUN}|{REST}', begin)]
                assert words == sorted(words, reverse=True)     # ran, and then did not
        assert run(here, 'stop', 'hoist') == (0, ['far/hoist: ready'])
        bridge.suspend()    # it is seen still, and named
        code, lines = run(here, 'stop')
        assert code == 1 and lines == [
            'far/drive_can_bridge: NOT STOPPED: this bridge does not answer: its drives may still '
            'be running', 'far/hoist: NOT STOPPED: no answer yet: may still be running',
            'near/lift: ready']
        bridge.send(signal.SIGCONT)
        processes.end()
