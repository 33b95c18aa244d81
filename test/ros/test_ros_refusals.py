# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What the executable says about what it cannot work with, and its exit code.

Its ``main`` runs in this process; every problem of a file: ``system/test_system_commands.py``.
"""

from collections.abc import Callable
import os
from pathlib import Path
import re
import subprocess
import sys
import tempfile
from typing import Any

from bridges import CONVEYOR, parameters
from clients import wait_until
import pytest
from rclpy.utilities import get_rmw_implementation_identifier
import yaml

from drive_can_bridge.cli.main import main as drive_can
from drive_can_bridge.core import complaints
from drive_can_bridge.core.sentences import profiles_not_read, protection_not_read
from drive_can_bridge.process.fast_dds import RELEASES, running
from drive_can_bridge.ros.main import _quiet_rcl, main

#: how rclpy writes a line
LOGGED = re.compile(r'\[(ERROR|FATAL)\] \[[0-9.]+\] \[[\w.]+\]: (.*)')
NODE = '/refused/drive_can_bridge'

#: runs the executable with a parameter file; returns its exit code and its standard error
Run = Callable[..., tuple[int, list[str]]]


@pytest.fixture(name='run')
def _run(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
         threads: None) -> Run:
    # a bridge asks for punctual threads, which is none of this process's business
    monkeypatch.setattr(sys, 'setswitchinterval', lambda _: None)

    def run(*arguments: str) -> tuple[int, list[str]]:
        code = main(['drive_can_bridge', *arguments])
        told = ''

        def look() -> bool:
            nonlocal told
            out, err = capfd.readouterr()
            assert out == ''
            told += err
            return told.endswith('\n')
        wait_until(look, what='a line on standard error')  # it is written by a thread
        return code, told.splitlines()
    return run


def with_file(file: Path) -> list[str]:
    return ['--ros-args', '--params-file', str(file), '-r', '__ns:=/refused']


def written(directory: Path, *, node: str = '/**/drive_can_bridge', **bus: Any) -> Path:
    """Write a parameter file with a conveyor; ``bus``: further keys of its bus."""
    file = directory / 'bridge.yaml'
    content = parameters(buses={'main': {
        'interface': 'slcan', 'channel': str(directory / 'nothing'), 'bitrate': 125_000, **bus}},
        conveyor=CONVEYOR)
    file.write_text(yaml.safe_dump({node: {'ros__parameters': content}}, sort_keys=False),
                    encoding='utf-8')
    return file


def problem(told: tuple[int, list[str]]) -> str:
    """Return the one problem that was logged; behind it stands what names its line."""
    code, (line, *more) = told
    assert code == 1
    assert [each for each in more if 'drive_can validate ' not in each] == []
    match = LOGGED.fullmatch(line)
    assert match, line
    return match.group(2)


@pytest.mark.parametrize(('bus', 'words'), [
    ({'interface': 'slkan'}, ("'slkan'", "'slcan'")),
    ({'bitrate': 123_456}, ('123456', '125000')),
    ({'reconect_period': 0.5}, ('reconnect_period',)),
], ids=['interface', 'bit rate', 'key close to one of ours'])
def test_bus_that_can_never_work(run: Run, tmp_path: Path, bus: dict[str, object],
                                 words: tuple[str, ...]) -> None:
    text = problem(run(*with_file(written(tmp_path, **bus))))
    assert text.startswith(f'buses.main.{next(iter(bus))}:')
    assert all(word in text for word in words)


def test_a_file_is_to_be_validated_where_it_is_wrong_itself(run: Run, tmp_path: Path) -> None:
    wrong = '-p', 'buses.main.bitrate:=123456'
    code, told = run(*with_file(written(tmp_path)), *wrong)
    assert (code, len(told)) == (1, 1)
    code, told = run(*with_file(written(tmp_path, interface='slkan')), *wrong)
    assert (code, len(told)) == (1, 2)
    assert f'drive_can validate {tmp_path}/bridge.yaml ' in told[-1]


def test_key_that_stands_twice(run: Run, tmp_path: Path) -> None:
    """The values that rcl hands over do not show it."""
    file = written(tmp_path)
    lines = file.read_text(encoding='utf-8').splitlines(keepends=True)
    place, = [number for number, line in enumerate(lines) if line.strip().startswith('period:')]
    lines.insert(place + 1, lines[place].replace('0.02', '0.5'))
    # the other section is none of this node's business
    lines += ['other:\n', '  ros__parameters:\n', '    a: 1\n', '    a: 2\n']
    file.write_text(''.join(lines), encoding='utf-8')
    assert problem(run(*with_file(file))) == (
        f'{file}:{place + 2}: drives.conveyor.period: {complaints.duplicate_key(first=place + 1)}')


def test_empty_mapping(run: Run, tmp_path: Path) -> None:
    """What follows is put into it by rcl: nothing of that is worth a word."""
    file = written(tmp_path)
    lines = file.read_text(encoding='utf-8').splitlines(keepends=True)
    place, = [number for number, line in enumerate(lines) if line.strip().startswith('period:')]
    lines.insert(place, lines[place].replace('period: 0.02', 'joint: {}'))
    file.write_text(''.join(lines), encoding='utf-8')
    assert problem(run(*with_file(file))) == (
        f'{file}:{place + 1}: drives.conveyor.joint: {complaints.garbling_mapping()}')


def test_file_for_another_node(run: Run, tmp_path: Path) -> None:
    file = written(tmp_path, node='/other/can_bridge')
    assert problem(run(*with_file(file))) == '; '.join((
        complaints.nothing_configured(node=NODE),
        complaints.file_is_for(file=file, nodes='/other/can_bridge')))


def test_file_with_a_namespace_of_its_own(run: Run, tmp_path: Path) -> None:
    file = tmp_path / 'nested.yaml'
    file.write_text('cell:\n  can_bridge:\n    ros__parameters: {a: 1}\n'
                    'other: {ros__parameters: {b: 1}}\n', encoding='utf-8')
    assert complaints.file_is_for(file=file, nodes='cell/can_bridge, other') in problem(
        run(*with_file(file)))


def test_no_file_at_all(run: Run) -> None:
    assert problem(run('--ros-args', '-r', '__ns:=/refused')) == complaints.nothing_configured(
        node=NODE)


@pytest.fixture(name='unread')
def _unread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, str, str]:
    """Return a file that the other version would read, what runs here, and what that reads."""
    middleware = running(get_rmw_implementation_identifier())
    if middleware.release is None:
        pytest.skip('another middleware')
    monkeypatch.chdir(tmp_path)
    other, = (each for each in RELEASES.values() if each is not middleware.release)
    return tmp_path / other.file, middleware.name, middleware.release.file


def test_profiles_that_nobody_reads(run: Run, unread: tuple[Path, str, str]) -> None:
    file, running_here, read = unread
    file.write_text('<profiles/>', encoding='utf-8')
    code, (warning, *more) = run('--ros-args', '-r', '__ns:=/refused')
    assert warning.endswith(f': {profiles_not_read(file.name, running_here, read)}')
    assert '[WARN]' in warning
    assert problem((code, more)) == complaints.nothing_configured(node=NODE)


def test_no_bridge_without_the_protection_that_was_meant(
        run: Run, unread: tuple[Path, str, str], capfd: pytest.CaptureFixture[str]) -> None:
    file, running_here, read = unread
    assert drive_can(['security', str(written(file.parent)), '-o', '.']) == 0
    capfd.readouterr()
    (file.parent / 'tls_bridge.xml').rename(file)
    assert run(*with_file(file.parent / 'bridge.yaml')) == (1, [
        f'drive_can_bridge: {protection_not_read(file.name, running_here, file.name, read)}'])


@pytest.mark.parametrize('content', [
    '/**/drive_can_bridge:\n  ros__parameters:\n    buses: {main: {channel: [1, a]}}\n',
    '/**/drive_can_bridge:\n  ros__parameters:\n    buses: &bus {}\n    drives: *bus\n',
    'no yaml: [', None,
], ids=['mixed list', 'alias', 'no yaml', 'no file'])
def test_what_rcl_refuses(run: Run, tmp_path: Path, content: str | None) -> None:
    file = tmp_path / 'refused.yaml'
    if content is not None:
        file.write_text(content, encoding='utf-8')
    code, (line,) = run(*with_file(file))
    assert code == 1
    assert line.startswith('drive_can_bridge: ')
    assert str(file) in line or 'Sequence' in line


@pytest.mark.parametrize(('arguments', 'word'), [
    (['-r', '__ns:=not a namespace'], 'not a namespace'),
    (['-r', 'nonsense'], 'nonsense'),
    (['-p', 'x'], 'x'),
    (['--unknown'], '--unknown'),
])
def test_ros_arguments_that_rcl_refuses(run: Run, arguments: list[str], word: str) -> None:
    code, (line,) = run('--ros-args', *arguments)
    assert code == 1
    assert line.startswith('drive_can_bridge: ')
    assert word in line


def test_no_place_for_temporary_files_is_needed(run: Run, monkeypatch: pytest.MonkeyPatch,
                                                tmp_path: Path) -> None:
    with monkeypatch.context() as patch:    # pytest does need one
        patch.setattr(tempfile, 'tempdir', str(tmp_path / 'read_only'))
        told = run('--ros-args', '-r', '__ns:=/refused')
    assert problem(told) == complaints.nothing_configured(node=NODE)


def test_what_rcl_itself_writes_is_shown_if_all_went_well(capfd: pytest.CaptureFixture[str],
                                                          ) -> None:
    with _quiet_rcl():
        os.write(2, b'a word\n')
        assert capfd.readouterr().err == ''
    assert capfd.readouterr().err == 'a word\n'
    with pytest.raises(ZeroDivisionError), _quiet_rcl():
        os.write(2, b'a word\n')
        raise ZeroDivisionError
    os.write(2, b'the next\n')
    assert capfd.readouterr().err == 'the next\n'


def test_more_than_can_be_held_back_holds_up_nobody(capfd: pytest.CaptureFixture[str]) -> None:
    with _quiet_rcl():
        assert os.get_blocking(2) is False
        with pytest.raises(BlockingIOError):
            while True:
                os.write(2, b'x' * 1024)
    assert os.get_blocking(2) is True
    assert len(capfd.readouterr().err) >= 4096


def test_a_domain_that_cannot_be(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fast DDS would end the process, with words that nobody sees."""
    monkeypatch.setenv('ROS_DOMAIN_ID', '999')
    code, (line,) = run('--ros-args', '-r', '__ns:=/refused')
    assert code == 1
    assert line.startswith('drive_can_bridge: ') and '999' in line


@pytest.mark.usefixtures('programs')
def test_a_middleware_that_is_not_installed() -> None:
    """While rcl is loaded it ends the process, and says why; that is not to get lost."""
    done = subprocess.run(
        [sys.executable, '-m', 'drive_can_bridge.ros.start', '--ros-args'], check=False,
        env={**os.environ, 'RMW_IMPLEMENTATION': 'rmw_none'}, capture_output=True, text=True)
    assert done.returncode > 0
    assert 'rmw_none' in done.stderr


@pytest.mark.parametrize('arguments', [['bridge.yaml'], ['--params-file', 'x.yaml'],
                                       ['--verbose', '--ros-args', '-r', '__ns:=/x']])
def test_arguments_that_are_not_for_ros(run: Run, arguments: list[str]) -> None:
    code, (line,) = run(*arguments)
    assert code == 2
    assert arguments[0] in line
    assert '--ros-args --params-file FILE' in line
