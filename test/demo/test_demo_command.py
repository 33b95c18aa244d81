# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can demo`` without a terminal: as a user runs it, and what it refuses."""

from collections.abc import Callable
import os
from pathlib import Path
import re
import signal
import subprocess
import termios

import pytest
from running import Running, Terminal
from waiting import wait_for

from drive_can_bridge.cli import demo, main as front_end
from drive_can_bridge.demo.child import Child

pytest.importorskip('rclpy')

LINE = re.compile(r'(conveyor|lift|turntable) '
                  r'(?:offline(?: \(.+\))?|online( \w+=-?[\d.]+( [^\s=]+)?)+)')
FRAME = re.compile(r'\(\d+\.\d{6}\) (\w+) ([0-9A-F]{3}|[0-9A-F]{8})#((?:[0-9A-F]{2}){0,8})')
#: what drives are sent that stand still: torque limits stay at 100 %
NEUTRAL = {'003FFFF0': '000003E800000000', '005FFFF0': '0000000000000000',
           '007FFFF0': '000003E800000000'}

OWN_FILE = """
/cell/own_name:
  ros__parameters:
    autostart: false
    diagnostics_period: 30.0
    buses:
      field: {interface: socketcan, channel: can7, bitrate: 500000, fd_option: 1}
    drives:
      axis:
        bus: field
        protocol: datamodel_extended
        station: 9
        profile: datamodel_example
        cyclic_request: [speed_setpoint]
        cyclic_response: [actual_speed]
"""

Start = Callable[..., Running]
Refused = Callable[..., tuple[int, str, list[str]]]


@pytest.mark.usefixtures('programs')
def test_a_directory_with_the_name_of_the_package_does_not_matter(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / 'drive_can_bridge').mkdir()
    (tmp_path / 'drive_can_bridge' / '__init__.py').write_text('raise ImportError\n')
    monkeypatch.chdir(tmp_path)
    with (tmp_path / 'out').open('wb') as output:
        child = Child('the child', 'drive_can', '--version', output=output)
    assert child.wait(20.0) and child.code == 0
    assert (tmp_path / 'out').read_text().startswith('drive_can ')


@pytest.mark.usefixtures('programs')
def test_a_signal_to_a_child_that_has_hardly_begun(tmp_path: Path) -> None:
    """Until a program takes signals they wait, from its first moment on."""
    child = Child('the child', 'drive_can', 'profile', 'list', log=tmp_path / 'log')
    child.ask_to_end(signal.SIGINT)
    assert child.wait(20.0)
    assert (child.code, child.errors()) == (130, 'drive_can profile: interrupted\n')


def test_a_terminal_that_has_gone_is_not_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    other_end, keyboard = os.openpty()
    get, put = termios.tcgetattr, termios.tcsetattr
    monkeypatch.setattr(termios, 'tcgetattr', lambda _: get(keyboard))
    monkeypatch.setattr(termios, 'tcsetattr', lambda _, *how: put(keyboard, *how))
    try:
        with demo._terminal_restored():
            os.close(other_end)
    finally:
        os.close(keyboard)


def requests(log: Path) -> dict[str, list[str]]:
    """Return the data of all cyclic requests in a frame log, by identifier."""
    found: dict[str, list[str]] = {}
    if not log.exists():
        return found
    # the last line may be half written
    for line in log.read_text(encoding='ascii').split('\n')[:-1]:
        match = FRAME.fullmatch(line)
        assert match, line
        if match[2] in ('003FFFF0', '005FFFF0', '007FFFF0'):
            found.setdefault(match[2], []).append(match[3])
    return found


def test_it_prints_a_line_per_drive_and_stops_them_neutral(start: Start, tmp_path: Path,
                                                           ) -> None:
    log = tmp_path / 'frames.log'
    demo = start('--drive', '--log-frames', str(log))
    demo.line(r'^conveyor online actual_speed=-?\d+\.\d rpm motor_current=\d+\.\d\d A '
              r'status_word=\d+ dc_link_voltage=\d+\.\d V$')
    # lift has a control word, which has to be 1, and a speed setpoint behind it
    wait_for(lambda: any(re.match('0001(?!0000)', data)
                         for data in requests(log).get('005FFFF0', [])), 'speed for lift')
    wait_for(lambda: any(data[:4] != '0000' for data in requests(log)['003FFFF0']),
             'speed for conveyor')
    # one that is found later than others is not in the first
    wait_for(lambda: 2 * 'conveyor lift turntable ' in ''.join(
        f'{line.split()[0]} ' for line in demo.lines), 'two rounds of lines')
    assert demo.end(signal.SIGINT) == 0
    for identifier, sent in requests(log).items():
        assert set(sent[-3:]) == {NEUTRAL[identifier]}, identifier
    assert len(requests(log)) == 3
    lines = demo.lines
    assert [line for line in lines if not LINE.fullmatch(line)] == []
    assert 'Traceback' not in demo.errors
    # of its own commands; one that is under way when a stall costs a drive is told, and rightly
    assert 'has no effect' not in demo.errors.split(': offline: ')[0]
    assert log.read_text(encoding='ascii').endswith('\n')


def test_it_commands_nothing_unless_asked_to(start: Start, tmp_path: Path) -> None:
    log = tmp_path / 'frames.log'
    demo = start('--log-frames', str(log))
    demo.line('^turntable online')
    wait_for(lambda: len(requests(log)) == 3 and min(map(len, requests(log).values())) > 100)
    assert demo.end(signal.SIGINT) == 0
    assert {identifier: set(sent) for identifier, sent in requests(log).items()} == {
        identifier: {data} for identifier, data in NEUTRAL.items()}


def test_it_ends_after_its_time_and_stays_on_this_machine(start: Start) -> None:
    domain = os.environ['ROS_DOMAIN_ID']
    demo = start('--duration', '1.5', '--domain-id', domain, environment={
        'ROS_DOMAIN_ID': None, 'ROS_AUTOMATIC_DISCOVERY_RANGE': None})
    assert demo.process.wait(60.0) == 0
    assert f'drive_can demo: ROS domain {domain}, on this machine only' in demo.errors


def test_any_parameter_file_will_do_and_a_dumb_terminal_gets_lines(
        start: Start, tmp_path: Path, terminal: Terminal) -> None:
    file = tmp_path / 'bridge.yaml'
    file.write_text(OWN_FILE, encoding='utf-8')
    demo = start('--params-file', str(file),
                 **{**terminal.options, 'environment': {'TERM': 'dumb'}})
    terminal.shows(r'axis online actual_speed=-?\d+\.\d rpm\r?\n')
    assert demo.end(signal.SIGTERM) == 0
    assert '\x1b[?' not in terminal.read()


def test_it_ends_when_nobody_reads(start: Start, tmp_path: Path) -> None:
    log = tmp_path / 'frames.log'
    demo = start('--drive', '--log-frames', str(log), stdout=subprocess.PIPE)
    assert demo.process.stdout is not None
    demo.process.stdout.readline()
    wait_for(lambda: any(data[:4] != '0000' for data in requests(log).get('003FFFF0', [])),
             'speed for conveyor')
    demo.process.stdout.close()
    assert demo.process.wait(60.0) == 1
    # the bridge stopped its drives all the same; one that a stall made offline then, before that
    for identifier, sent in requests(log).items():
        assert set(sent[-3:]) == {NEUTRAL[identifier]}, identifier
    assert 'Traceback' not in demo.errors


def test_a_silent_drive_is_offline_and_two_signals_in_one_breath_are_one_stop(
        start: Start) -> None:
    """A terminal and a launcher both signal; how a second stop ends: test_signal_watcher."""
    demo = start('--fault', 'lift:silent')
    demo.line('^conveyor online')
    demo.line(r'^lift offline \(not seen since start: ')
    demo.process.send_signal(signal.SIGTERM)
    demo.process.send_signal(signal.SIGINT)
    assert demo.process.wait(60.0) in (0, 128 + signal.SIGINT)     # the machine may have paused


@pytest.fixture
def refused(threads: None, monkeypatch: pytest.MonkeyPatch,
            capsys: pytest.CaptureFixture[str]) -> Refused:
    """Return what runs a demo that is refused, in this process: code, output, errors."""
    for name in ('ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE'):
        monkeypatch.setenv(name, os.environ[name])      # put back afterwards

    def run(*arguments: str) -> tuple[int, str, list[str]]:
        try:
            code = front_end.main(['demo', *arguments])
        except SystemExit as end:
            code = int(str(end.code))
        out, errors = capsys.readouterr()
        return code, out, errors.splitlines()
    return run


@pytest.mark.parametrize(('arguments', 'code', 'words'), [
    (['--fault', 'lift'], 2, 'write DRIVE:FAULT'),
    (['--fault', 'lfit:silent'], 2, "no drive 'lfit'; drives: conveyor, lift, turntable"),
    (['--fault', 'lift:slient'], 2, "unknown fault 'slient' (nearest: silent)"),
    (['--fault', 'lift:stuck=nothing'], 2, 'nothing'),
    (['--params-file', 'nowhere.yaml'], 1, 'nowhere.yaml: No such file or directory'),
    (['--log-frames', '/nowhere/frames.log'], 1, '/nowhere/frames.log: No such file'),
])
def test_a_mistake_is_one_line(refused: Refused, arguments: list[str], code: int,
                               words: str) -> None:
    found, out, errors = refused(*arguments)
    assert (found, out) == (code, '')
    assert words in errors[-1]


@pytest.mark.parametrize('arguments', [
    ['--duration', 'soon'], ['--duration', '-1'], ['--duration', 'nan'], ['--domain-id', '233'],
    ['--domain-id', '-1'], ['--domain-id', 'x'], ['--speed']])
def test_wrong_usage(refused: Refused, arguments: list[str]) -> None:
    code, _, errors = refused(*arguments)
    assert code == 2
    assert len(errors) == 1
    assert errors[0].startswith('drive_can demo: ')


def test_the_problems_of_a_parameter_file_have_lines(refused: Refused, tmp_path: Path) -> None:
    file = tmp_path / 'bridge.yaml'
    file.write_text('/**/drive_can_bridge:\n  ros__parameters:\n    buses:\n'
                    '      main: {interface: virtual, channel: x, bitrat: 1}\n', encoding='utf-8')
    code, _, errors = refused('--params-file', str(file))
    assert code == 1
    assert any(line.startswith(f'{file}:4: buses.main.bitrat: ') for line in errors)


def test_without_ros_it_says_what_to_install(start: Start, tmp_path: Path) -> None:
    (tmp_path / 'rclpy.py').write_text("raise ModuleNotFoundError('no', name='rclpy')\n",
                                       encoding='utf-8')
    demo = start(environment={'PYTHONPATH': f'{tmp_path}:{Path(__file__).parents[2]}'})
    assert demo.process.wait(60.0) == 1
    [line] = demo.errors.splitlines()
    assert 'needs ROS 2' in line
    assert "pip install '.[ros]'" in line
