# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can simulate``: what it refuses, and as a process with output, signals and input."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
import os
from pathlib import Path
import re
import signal
import subprocess
from typing import Any

import can
import plant
import pytest
from running import Running, starting
from simulation_builders import RULES
from waiting import wait_for

from drive_can_bridge.cli import main as front_end, simulate
from drive_can_bridge.clock import SteadyClock
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.exchange.one_master import END_FIRST, InUse, Ownership

PARAMETERS = plant.text({
    'conveyor': plant.CONVEYOR,
    'lift': {**plant.CONVEYOR, 'bus': 'second', 'station': 2, 'cyclic_request': ['speed_setpoint'],
             'cyclic_response': ['actual_speed']}},
    buses={'main': plant.VIRTUAL, 'second': {**plant.VIRTUAL, 'channel': 'x2'}})


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Running]]:
    file = tmp_path / 'bridge.yaml'
    file.write_text(PARAMETERS, encoding='utf-8')
    with starting(tmp_path, 'drive_can', 'simulate', '--params-file', str(file),
                  stdin=subprocess.PIPE) as make:
        yield make


def write(command: Running, text: str) -> None:
    assert command.process.stdin is not None
    command.process.stdin.write(text.encode())
    command.process.stdin.flush()


@pytest.mark.real
def test_drives_behind_a_pseudo_terminal(start: Any, tmp_path: Path) -> None:
    command = start('--pty', '--pty-link', str(tmp_path / 'links'), '--log-frames')
    command.line('drive lift')
    for bus, line in zip(('main', 'second'), command.lines):
        assert re.fullmatch(f'bus {bus}: slcan /dev/pts/[0-9]+', line)
    assert os.readlink(tmp_path / 'links' / 'main') == command.lines[0].split()[-1]
    with can.Bus(interface='slcan', channel=str(tmp_path / 'links' / 'main'), bitrate=125_000,
                 sleep_after_open=0.0, ignore_config=True) as bus:
        bus.send(can.Message(arbitration_id=0x3FFFF0, data=bytes(8)))
        message = bus.recv(10.0)
        assert message is not None
        assert message.arbitration_id == 0x103FFFF0
        bus.send(can.Message(arbitration_id=0x3001E0, data=bytes(8)))
        command.line(f'conveyor: violation: {re.escape(RULES["undefined"])}')
    command.line(r'^\([0-9]+\.[0-9]{6}\) main 003FFFF0#0{16} R$')
    assert command.line('103FFFF0').endswith(' T')
    assert command.end(signal.SIGINT) == 0
    assert command.errors == ''
    command.line(f'^conveyor: violation: {re.escape(RULES["undefined"])}: 1 times$')
    assert list((tmp_path / 'links').iterdir()) == []


@pytest.mark.real
def test_a_link_of_a_running_simulation_is_left_alone(start: Any, tmp_path: Path) -> None:
    """Told before anything is announced; the first one's drives are reached as before."""
    links, same = tmp_path / 'links', tmp_path / 'same'
    first = start('--pty-link', str(links))
    first.line('drive lift')
    shown = {each.name: os.readlink(each) for each in links.iterdir()}
    same.symlink_to(links)
    for directory in (links, same):     # under another name it is the same directory
        second = start('--pty-link', str(directory))
        assert second.process.wait(20) == 1
        assert second.lines == [] and second.errors.splitlines() == [
            f'drive_can simulate: --pty-link: {directory}/main belongs to process '
            f'{first.process.pid}, which runs: end that first, or give another directory']
        assert {each.name: os.readlink(each) for each in links.iterdir()} == shown
    first.process.kill()
    first.process.wait(20)
    assert {each.name: os.readlink(each) for each in links.iterdir()} == shown      # stale
    third = start('--pty-link', str(links))
    third.line('drive lift')
    assert os.readlink(links / 'main') == third.lines[0].split()[-1]
    assert third.end(signal.SIGINT) == 0
    assert list(links.iterdir()) == []


def test_a_link_to_something_else_is_left_alone(capsys: pytest.CaptureFixture[str],
                                                tmp_path: Path) -> None:
    """One that somebody made, to an adapter for example, is not ours to replace."""
    adapter = tmp_path / 'adapter'
    adapter.write_text('', encoding='utf-8')
    (tmp_path / 'main').symlink_to(adapter)
    code, errors = refused(capsys, tmp_path, '--pty-link', str(tmp_path))
    assert code == 1 and len(errors) == 1
    assert f'{tmp_path}/main exists and is not a link to a pseudo-terminal' in errors[0]
    assert os.readlink(tmp_path / 'main') == str(adapter)


@pytest.mark.real
def test_standard_input(start: Any) -> None:
    command = start('--pty', '--fault', 'conveyor:late=0.15', '--fault', 'lift:off', '--axis',
                    'lift:load=0.3,noise=1')
    assert 'faults: late=0.15' in command.line('drive conveyor')
    assert 'faults: off' in command.line('drive lift')
    write(command, 'conveyor ok\nlift nonsense\nstatus\nconv')
    command.line('conveyor: no fault any more')
    command.line('^conveyor: datamodel_extended')
    wait_for(lambda: "unknown fault 'nonsense'" in command.errors, 'complaint')
    write(command, 'eyor trip\n')
    command.line('conveyor: fault trip')
    command.process.stdin.close()
    with pytest.raises(subprocess.TimeoutExpired):
        command.process.wait(0.3)
    assert command.end(signal.SIGTERM) == 0
    assert len(command.errors.splitlines()) == 1


def test_frames_on_a_full_disk(capsys: pytest.CaptureFixture[str]) -> None:
    """Told once; the drives are played on, and that the log is closed is no failure."""
    with ExitStack() as stack:
        show = simulate._frame_log(stack, SteadyClock(), simulate._Output(None), Path('/dev/full'))
        assert show is not None
        for _ in range(2):
            show('main', Frame(0x3FFFF0, bytes(8), True), True)
    told, = capsys.readouterr().err.splitlines()
    assert '/dev/full: incomplete: ' in told


def refused(capsys: pytest.CaptureFixture[str], directory: Path, *arguments: str) -> tuple[
        int, list[str]]:
    """Run the command in this process; return its exit code, and what it complains of."""
    file = directory / 'bridge.yaml'
    file.write_text(PARAMETERS, encoding='utf-8')
    try:
        code = front_end.main(['simulate', '--params-file', str(file), *arguments])
    except SystemExit as end:
        code = int(str(end.code))
    return code, capsys.readouterr().err.splitlines()


@pytest.mark.usefixtures('threads')
@pytest.mark.parametrize(('arguments', 'status', 'message'), [
    (('--pty', '--interface', 'virtual'), 2, 'exclude each other'),
    (('--channel', 'x'), 2, 'puts the buses main, second on one: '),
    (('--interface', 'socketcan', '--channel', 'x'), 2, 'puts the buses main, second on one: '),
    (('--fault', 'conveyor'), 2, 'write DRIVE:FAULT'),
    (('--fault', 'belt:silent'), 2, "no drive 'belt'; drives: conveyor, lift"),
    (('--fault', 'lift:later'), 2, "unknown fault 'later'"),
    (('--fault', 'lift:stuck=ramp'), 2, "lift has no parameter 'ramp'"),
    (('--fault', 'lift:refuse=ramp'), 2, "lift has no parameter 'ramp'"),
    (('--axis', 'lift'), 2, 'write DRIVE:KEY=VALUE'),
    (('--bitrate', '99'), 2, '--bitrate: 99: allowed are 1000 to 8000000 bit/s, also as 500k; '
                             'see drive_can simulate --help'),
    (('--axis', 'lift:load=2'), 2, "'load=2' is not possible; allowed: load=0…1"),
    (('--without', 'lift'), 2, 'write DRIVE=OBJECT, for example servo=6007h,1800h.05h'),
    (('--without', 'lift=6007h'), 2,
     'lift: it is a drive of datamodel_extended, allowed are those of cia402'),
    (('--without', 'lift=6o07h'), 2, "'6o07h' is no object; write 6007h or 1800h.05h"),
    (('--without', 'lift=605Ah,6041h'), 2, '6041h: no servo can be simulated without it'),
    (('--habit', 'belt:start=1'), 2, "no drive 'belt'"),
    (('--habit', 'lift:start=-1'), 2, "'start=-1' is not possible; allowed: "
                                      'mapping=checked|operational|unchecked, start=0…60, '),
    (('--interface', 'nonsense'), 1,
     "drive_can simulate: --interface: 'nonsense' is no interface of python-can, allowed: "),
    (('--pty-link', '/dev/null/x'), 1, '/dev/null'),
    (('--pty-link', '/proc'), 1, 'drive_can simulate: /proc/main: '),
    (('--params-file', '/nowhere.yaml'), 1, 'drive_can simulate: /nowhere.yaml: No such file'),
    (('--params-file', '/dev/null'), 1, 'drive_can simulate: /dev/null: not a regular file'),
])
def test_what_cannot_be(capsys: pytest.CaptureFixture[str], tmp_path: Path,
                        arguments: tuple[str, ...], status: int, message: str) -> None:
    code, errors = refused(capsys, tmp_path, *arguments)
    assert code == status
    assert len(errors) == 1
    assert message in errors[0]


@pytest.mark.real
def test_reader_of_the_output_who_left(start: Any) -> None:
    reading, writing = os.pipe()
    command = start('--pty', stdout=writing, stderr=subprocess.PIPE)
    os.close(writing)
    assert os.read(reading, 4096).startswith(b'bus main: slcan')
    os.close(reading)
    write(command, 'list\nlist\n')
    command.process.send_signal(signal.SIGTERM)
    _, errors = command.process.communicate(timeout=30.0)
    assert (command.process.returncode, errors) == (0, b'')


class TestASerialPort:
    """One process reads from it: it is locked as a whole, whoever opens it."""

    @pytest.fixture(name='port')
    def port_fixture(self) -> Iterator[str]:
        ends = os.openpty()
        yield os.ttyname(ends[1])
        for end in ends:
            os.close(end)

    @pytest.fixture(name='file')
    def file_fixture(self, port: str, tmp_path: Path) -> str:
        path = tmp_path / 'adapter.yaml'
        path.write_text(PARAMETERS.replace(
            'virtual\n        channel: x\n', f'slcan\n        channel: {port}\n'))
        return str(path)

    def test_of_a_bridge_is_left_alone(self, capsys: pytest.CaptureFixture[str], port: str,
                                       file: str, tmp_path: Path) -> None:
        bus = BusConfiguration('main', 'slcan', port)
        with Ownership([(bus, ())], 'drive_can_bridge', END_FIRST):
            code, errors = refused(capsys, tmp_path, '--params-file', file)
        assert code == 1
        assert errors == [f'bus main: the serial port {port} is used by process '
                          f'{os.getpid()}; end that first']

    @pytest.mark.real
    def test_of_the_simulation_is_its_own(self, start: Any, port: str, file: str) -> None:
        """Without standard input, too."""
        # the other bus is elsewhere: two on one port end the simulation, and with it the lock
        command = start('--params-file', file, stdin=None, preexec_fn=lambda: os.close(0))
        command.line('drive lift')
        assert command.lines[0].split() == ['bus', 'main:', 'slcan', port]
        with pytest.raises(InUse, match=rf'{command.process.pid} \(drive_can simulate\)'):
            Ownership([(BusConfiguration('main', 'slcan', port), ())], 'x', END_FIRST)
        assert command.end(signal.SIGTERM) == 0
