# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can simulate`` as a user runs it: a process, its output, its signals, its input."""

from collections.abc import Iterator
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
from typing import Any

import can
import pytest
from waiting import wait_for

from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.exchange.one_master import END_FIRST, InUse, Ownership

#: against the wall clock (test/real.py)
pytestmark = pytest.mark.real

PARAMETERS = """
/**/drive_can_bridge:
  ros__parameters:
    buses:
      main: {interface: virtual, channel: x}
      second: {interface: virtual, channel: x2}
    drives:
      conveyor:
        bus: main
        protocol: datamodel_extended
        station: 1
        profile: datamodel_example
        cyclic_request: [speed_setpoint, torque_limit]
        cyclic_response: [actual_speed, motor_current, status_word]
      lift:
        bus: second
        protocol: datamodel_extended
        station: 2
        profile: datamodel_example
        cyclic_request: [speed_setpoint]
        cyclic_response: [actual_speed]
"""


class Command:
    """A running ``drive_can simulate``."""

    def __init__(self, directory: Path, *arguments: str, **options: Any) -> None:
        file = directory / 'bridge.yaml'
        file.write_text(PARAMETERS, encoding='utf-8')
        self.out, self.err = directory / 'out', directory / 'err'
        options.setdefault('stdin', subprocess.PIPE)
        with self.out.open('wb') as out, self.err.open('wb') as err:
            self.process = subprocess.Popen(
                [sys.executable, '-m', 'drive_can_bridge.cli.main', 'simulate',
                 '--params-file', str(file), *arguments], stdout=out, stderr=err, **options)

    @property
    def lines(self) -> list[str]:
        return self.out.read_text(encoding='utf-8').splitlines()

    @property
    def errors(self) -> list[str]:
        return self.err.read_text(encoding='utf-8').splitlines()

    def line(self, pattern: str, errors: bool = False) -> str:
        """Wait for a line of the output."""
        def find() -> str | None:
            lines = self.errors if errors else self.lines
            return next((line for line in lines if re.search(pattern, line)), None)
        return str(wait_for(lambda: find() or self.process.poll() is not None and 'ended',
                            f'line {pattern}', 30.0))

    def write(self, text: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(text.encode())
        self.process.stdin.flush()

    def end(self, signum: int = signal.SIGTERM) -> int:
        self.process.send_signal(signum)
        return self.process.wait(30.0)

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        if self.process.stdin is not None:
            self.process.stdin.close()


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Any]:
    running: list[Command] = []

    def make(*arguments: str, **options: Any) -> Command:
        running.append(Command(tmp_path, *arguments, **options))
        return running[-1]
    yield make
    for command in running:
        command.close()


@pytest.mark.parametrize('signum', [signal.SIGINT, signal.SIGTERM])
def test_drives_behind_a_pseudo_terminal(start: Any, tmp_path: Path, signum: int) -> None:
    command = start('--pty', '--pty-link', str(tmp_path / 'links'), '--log-frames')
    command.line('drive lift')
    assert re.fullmatch('bus main: slcan /dev/pts/[0-9]+', command.lines[0])
    assert re.fullmatch('bus second: slcan /dev/pts/[0-9]+', command.lines[1])
    assert os.readlink(tmp_path / 'links' / 'main') == command.lines[0].split()[-1]
    with can.Bus(interface='slcan', channel=str(tmp_path / 'links' / 'main'), bitrate=125_000,
                 sleep_after_open=0.0, ignore_config=True) as bus:
        bus.send(can.Message(arbitration_id=0x3FFFF0, data=bytes(8)))
        message = bus.recv(10.0)
        assert message is not None
        assert message.arbitration_id == 0x103FFFF0
        bus.send(can.Message(arbitration_id=0x3001E0, data=bytes(8)))
        command.line('conveyor: violation: frame that the manual does not define')
    assert re.fullmatch(r'\([0-9]+\.[0-9]{6}\) main 003FFFF0#0{16} R',
                        command.line('003FFFF0'))
    assert command.line('103FFFF0').endswith(' T')
    assert command.end(signum) == 0
    assert command.errors == []
    assert ('conveyor: violation: frame that the manual does not define (ignored): 1 times'
            in command.lines)
    assert list((tmp_path / 'links').iterdir()) == []


def test_standard_input(start: Any) -> None:
    command = start('--pty', '--fault', 'conveyor:late=0.15', '--fault', 'lift:off')
    assert 'faults: late=0.15' in command.line('drive conveyor')
    assert 'faults: off' in command.line('drive lift')
    command.write('conveyor ok\nlift nonsense\nconv')
    command.line('conveyor: no fault any more')
    assert "unknown fault 'nonsense'" in command.line('nonsense', errors=True)
    command.write('eyor trip\n')
    command.line('conveyor: fault trip')
    command.process.stdin.close()
    with pytest.raises(subprocess.TimeoutExpired):
        command.process.wait(0.3)
    assert command.end() == 0
    assert len(command.errors) == 1


def test_axes_and_wear(start: Any) -> None:
    command = start('--pty', '--axis', 'lift:load=0.3,noise=1')
    command.line('drive lift')
    command.write('status\n')
    command.line('^conveyor: datamodel_extended')
    assert command.end() == 0
    assert command.errors == []


@pytest.mark.parametrize('how', ['closed', 'nothing'])
def test_without_standard_input(start: Any, how: str) -> None:
    options: dict[str, Any] = {'stdin': subprocess.DEVNULL}
    if how == 'closed':
        options = {'stdin': None, 'preexec_fn': lambda: os.close(0)}
    command = start('--pty', **options)
    command.line('drive lift')
    with pytest.raises(subprocess.TimeoutExpired):
        command.process.wait(0.3)
    assert command.end() == 0
    assert command.errors == []


def test_python_can_interface(start: Any) -> None:
    command = start('--interface', 'virtual', '--channel', 'z')
    command.line('drive lift')
    assert command.lines[:2] == ['bus main: virtual z', 'bus second: virtual z']
    assert command.end() == 0


@pytest.mark.parametrize(('arguments', 'status', 'message'), [
    (('--pty', '--interface', 'virtual'), 2, 'exclude each other'),
    (('--fault', 'conveyor'), 2, 'write DRIVE:FAULT'),
    (('--fault', 'belt:silent'), 2, "no drive 'belt'; drives: conveyor, lift"),
    (('--fault', 'lift:later'), 2, "unknown fault 'later'"),
    (('--fault', 'lift:stuck=ramp'), 2, "lift has no parameter 'ramp'"),
    (('--fault', 'lift:refuse=ramp'), 2, "lift has no parameter 'ramp'"),
    (('--axis', 'lift'), 2, 'write DRIVE:KEY=VALUE'),
    (('--axis', 'lift:load=2'), 2, "'load=2' is not possible; allowed: load=0…1"),
    (('--interface', 'nonsense'), 1, 'nonsense'),
    (('--pty-link', '/dev/null/x'), 1, '/dev/null'),
    (('--params-file', '/nowhere.yaml'), 1, 'drive_can simulate: /nowhere.yaml: No such file'),
    (('--params-file', '/dev/null'), 1, 'drive_can simulate: /dev/null: not a regular file'),
])
def test_what_cannot_be(start: Any, arguments: tuple[str, ...], status: int, message: str,
                        ) -> None:
    command = start(*arguments)
    assert command.process.wait(30.0) == status
    assert len(command.errors) == 1
    assert message in command.errors[0]


def test_a_bit_rate_that_cannot_be(start: Any) -> None:
    command = start('--bitrate', '99')
    assert command.process.wait(30.0) == 2
    assert command.errors[-1].endswith(
        '--bitrate: 99: allowed are 1000 to 8000000 bit/s, also as 500k; '
        'see drive_can simulate --help')


def test_reader_of_the_output_who_left(start: Any) -> None:
    reading, writing = os.pipe()
    command = start('--pty')
    command.close()
    process = subprocess.Popen(
        [sys.executable, '-m', 'drive_can_bridge.cli.main', 'simulate', '--pty',
         '--params-file', str(command.out.parent / 'bridge.yaml')],
        stdout=writing, stderr=subprocess.PIPE, stdin=subprocess.PIPE)
    os.close(writing)
    try:
        assert os.read(reading, 4096).startswith(b'bus main: slcan')
        os.close(reading)
        assert process.stdin is not None
        process.stdin.write(b'list\nlist\n')
        process.stdin.flush()
        process.send_signal(signal.SIGTERM)
        _, errors = process.communicate(timeout=30.0)
        assert (process.returncode, errors) == (0, b'')
    finally:
        process.kill()
        process.wait()


class TestASerialPort:
    """One process reads from it: it is locked as a whole, whoever opens it."""

    @pytest.fixture(name='port')
    def port_fixture(self) -> Iterator[str]:
        ends = os.openpty()
        yield os.ttyname(ends[1])
        for end in ends:
            os.close(end)

    def test_of_a_bridge_is_left_alone(self, start: Any, port: str, tmp_path: Path) -> None:
        file = tmp_path / 'adapter.yaml'
        file.write_text(PARAMETERS.replace('virtual, channel: x}', f'slcan, channel: {port}}}'))
        bus = BusConfiguration('main', 'slcan', port)
        with Ownership([(bus, ())], 'drive_can_bridge', END_FIRST):
            command = start('--params-file', str(file))
            assert command.process.wait(30.0) == 1
        assert command.errors == [f'bus main: the serial port {port} is used by process '
                                  f'{os.getpid()}; end that first']
        assert command.lines == []

    def test_of_the_simulation_is_its_own(self, start: Any, port: str) -> None:
        command = start('--interface', 'slcan', '--channel', port)
        command.line('bus main: slcan')
        with pytest.raises(InUse, match=rf'{command.process.pid} \(drive_can simulate\)'):
            Ownership([(BusConfiguration('main', 'slcan', port), ())], 'x', END_FIRST)
