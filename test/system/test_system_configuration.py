# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What the bridge says about configurations that cannot work, and about absent buses."""

from pathlib import Path
import re

from parameter_files import bridge_file, CONVEYOR
from processes import Client, command_line, Process, Processes
import pytest

#: how rclpy writes a line
LOGGED = re.compile(r'\[(ERROR|FATAL|WARN|INFO)\] \[[0-9.]+\] \[[\w.]+\]: (.*)')


def problems(bridge: Process) -> list[str]:
    """Wait for the end with exit code 1; return what was logged as an error, one per line."""
    assert bridge.wait() == 1
    assert not bridge.lines
    found = [LOGGED.fullmatch(line) for line in bridge.errors]
    assert all(found), 'a line that the logger did not write'
    return [match.group(2) for match in found if match and match.group(1) in ('ERROR', 'FATAL')]


def test_every_problem_is_named(processes: Processes, tmp_path: Path) -> None:
    file = bridge_file(
        tmp_path, bus={'bitrate': 'fast'},
        drives={'conveyor': {**CONVEYOR, 'statoin': 1, 'station': 128},
                'lift': {**CONVEYOR, 'station': 2, 'bus': 'second'},
                'table': {**CONVEYOR, 'station': 3, 'cyclic_request': ['speed_setpiont']}},
        diagnostic_period=1.0)
    texts = problems(processes.bridge(file))
    for path, *words in (('buses.main.bitrate', 'fast'),
                         ('drives.conveyor.statoin', 'station'),
                         ('drives.conveyor.station', '128', '127'),
                         ('drives.lift.bus', 'second', 'main'),
                         ('drives.table.cyclic_request', 'speed_setpiont', 'speed_setpoint'),
                         ('diagnostic_period', 'diagnostics_period')):
        text, = [text for text in texts if text.startswith(f'{path}:')]
        assert all(word in text for word in words), text
    assert len(texts) == len(set(texts))


@pytest.mark.parametrize(('bus', 'words'), [
    ({'interface': 'slkan'}, ("'slkan'", "'slcan'")),
    ({'bitrate': 123_456}, ('123456', '125000')),
], ids=['interface', 'bit rate'])
def test_bus_that_can_never_work(processes: Processes, tmp_path: Path, bus: dict[str, object],
                                 words: tuple[str, ...]) -> None:
    text, = problems(processes.bridge(bridge_file(tmp_path, bus=bus)))
    assert text.startswith(f'buses.main.{next(iter(bus))}:')
    assert all(word in text for word in words)


def test_adapter_key_close_to_one_of_ours(processes: Processes, tmp_path: Path) -> None:
    text, = problems(processes.bridge(bridge_file(tmp_path, bus={'reconect_period': 0.5})))
    assert 'buses.main.reconect_period' in text
    assert 'reconnect_period' in text


def test_same_text_from_the_configure_transition(processes: Processes, client: Client,
                                                 namespace: str, tmp_path: Path) -> None:
    bridge = processes.bridge(bridge_file(tmp_path, autostart=False, bus={'bitrate': 123_456}),
                              namespace)
    node = f'/{namespace}/drive_can_bridge'
    assert client.ask('transition', node=node, number=1) is False
    bridge.error('buses.main.bitrate: 123456 is impossible with slcan')
    assert bridge.end() == 0


def test_key_that_stands_twice(processes: Processes, namespace: str, tmp_path: Path) -> None:
    """The values that rcl hands over do not show it."""
    file = bridge_file(tmp_path)
    lines = file.read_text(encoding='utf-8').splitlines(keepends=True)
    place, = [number for number, line in enumerate(lines) if line.strip().startswith('period:')]
    lines.insert(place + 1, lines[place].replace('0.02', '0.5'))
    # the other section is none of this node's business
    lines += ['other:\n', '  ros__parameters:\n', '    a: 1\n', '    a: 2\n']
    file.write_text(''.join(lines), encoding='utf-8')
    assert problems(processes.bridge(file, namespace)) == [
        f'{file}:{place + 2}: drives.conveyor.period: duplicate key, allowed is one (the first is '
        f'in line {place + 1})']


def test_file_for_another_node(processes: Processes, namespace: str, tmp_path: Path) -> None:
    file = bridge_file(tmp_path, node='/other/can_bridge')
    text, = problems(processes.bridge(file, namespace))
    assert f'/{namespace}/drive_can_bridge' in text
    assert '/other/can_bridge' in text
    assert str(file) in text


def test_file_with_a_namespace_of_its_own(processes: Processes, namespace: str,
                                          tmp_path: Path) -> None:
    file = tmp_path / 'nested.yaml'
    file.write_text('cell:\n  can_bridge:\n    ros__parameters: {a: 1}\n'
                    'other: {ros__parameters: {b: 1}}\n', encoding='utf-8')
    text, = problems(processes.bridge(file, namespace))
    assert f'{file} is for cell/can_bridge, other' in text


def test_no_file_at_all(processes: Processes, namespace: str) -> None:
    text, = problems(processes.bridge(None, namespace))
    assert f'/{namespace}/drive_can_bridge got neither buses nor drives' in text
    assert '--params-file' in text


@pytest.mark.parametrize('content', [
    '/**/drive_can_bridge:\n  ros__parameters:\n    buses: {main: {channel: [1, a]}}\n',
    '/**/drive_can_bridge:\n  ros__parameters:\n    buses: &bus {}\n    drives: *bus\n',
    'no yaml: [',
    None,
], ids=['mixed list', 'alias', 'no yaml', 'no file'])
def test_what_rcl_refuses(processes: Processes, tmp_path: Path, content: str | None) -> None:
    file = tmp_path / 'refused.yaml'
    if content is not None:
        file.write_text(content, encoding='utf-8')
    bridge = processes.bridge(file)
    assert bridge.wait() == 1
    assert not bridge.lines
    line, = bridge.errors
    assert line.startswith('drive_can_bridge: ')
    assert str(file) in line or 'Sequence' in line


@pytest.mark.parametrize(('arguments', 'word'), [
    (['-r', '__ns:=not a namespace'], 'not a namespace'),
    (['-r', 'nonsense'], 'nonsense'),
    (['-p', 'x'], 'x'),
    (['--unknown'], '--unknown'),
])
def test_ros_arguments_that_rcl_refuses(processes: Processes, arguments: list[str],
                                        word: str) -> None:
    bridge = processes.bridge(None, '', *arguments)
    assert bridge.wait() == 1
    line, = bridge.errors
    assert line.startswith('drive_can_bridge: ')
    assert word in line


@pytest.mark.parametrize('arguments', [['bridge.yaml'], ['--params-file', 'x.yaml'],
                                       ['--verbose', '--ros-args', '-r', '__ns:=/x']])
def test_arguments_that_are_not_for_ros(processes: Processes, arguments: list[str]) -> None:
    bridge = processes.start([*command_line('drive_can_bridge'), *arguments], 'bridge')
    assert bridge.wait() == 2
    line, = bridge.errors
    assert arguments[0] in line
    assert '--ros-args --params-file FILE' in line


def test_device_that_appears_later(processes: Processes, client: Client, namespace: str,
                                   tmp_path: Path) -> None:
    file = bridge_file(tmp_path)
    bridge = processes.bridge(file, namespace)
    line = bridge.error('bus main: ')
    assert str(tmp_path / 'links' / 'main') in line
    assert 'No such file or directory' in line
    assert 'tried again every 0.2 s' in line
    status = client.diagnostics(f'{namespace}/drive_can_bridge: bus main', state='^down$')
    assert status['level'] == '2'
    assert 'No such file or directory' in status['message']
    drive = f'/{namespace}/conveyor'
    client.online(drive, wanted=False)
    assert client.set(drive, ramp_time=1.0) == [(False, 'bus down')]
    processes.simulator(file)
    client.online(drive)
    assert client.set(drive, ramp_time=2.0) == [(True, '')]
    assert len([line for line in bridge.errors if '[ERROR]' in line and 'bus main' in line]) == 1
    assert bridge.end() == 0
