# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can monitor`` and bridges that somebody else started: as processes, and on the bench."""

from collections.abc import Callable, Iterator
from contextlib import nullcontext
import os
from pathlib import Path
import re
import signal
import sys
from types import ModuleType

from clocks import REAL
import plant
import pytest
from running import Running, starting, Terminal
from waiting import wait_for
from world import World, world

from drive_can_bridge.cli import monitor as command
from drive_can_bridge.cli.main import understood
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.monitor.model import Model

pytest.importorskip('rclpy')

FILE = plant.text({
    'conveyor': {**plant.CONVEYOR, 'missed_limit': 1000, 'cyclic_request': ['speed_setpoint'],
                 'cyclic_response': ['actual_speed', 'status_word']},
    'lift': {**plant.LIFT, 'missed_limit': 1000, 'cyclic_response': ['status_word']}},
    diagnostics_period=0.5, buses={'main': plant.SLCAN})
Run = Callable[..., Running]


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Run]:
    """Return what starts commands of the package, each with a directory of its own."""
    with starting(tmp_path) as start:
        yield start


def bridge(run: Run, directory: Path, namespace: str = '') -> Running:
    """Start simulated drives and a bridge for them."""
    file, links = directory / 'drives.yaml', directory / f'links{namespace.replace("/", "_")}'
    file.write_text(FILE, encoding='utf-8')
    run('drive_can', 'simulate', '--params-file', str(file), '--pty-link', str(links))
    wait_for((links / 'main').is_symlink, 'the drives')
    place = ['-r', f'__ns:={namespace}'] if namespace else []
    return run('drive_can_bridge', '--ros-args', '--params-file', str(file), '-p',
               f'buses.main.channel:={links / "main"}', *place)


def test_it_attaches_to_whatever_comes_and_says_what_went(run: Run, tmp_path: Path) -> None:
    monitor = run('drive_can', 'monitor')
    only = run('drive_can', 'monitor', '--namespace', '/cell2')
    wait_for(lambda: 'drive_can monitor: ROS domain' in monitor.errors)
    assert monitor.lines == []

    first = bridge(run, tmp_path, '/cell1')
    monitor.line(r'^conveyor online actual_speed=-?\d+\.\d rpm status_word=\d+$')
    monitor.line(r'^lift online status_word=\d+$')
    second = bridge(run, tmp_path, '/cell2')
    monitor.line('^cell1/conveyor online actual_speed=')
    monitor.line('^cell2/conveyor online actual_speed=')
    only.line('^conveyor online actual_speed=')

    # killed: nobody says that it has gone
    seen = len(monitor.lines)
    assert first.end(signal.SIGKILL) == -signal.SIGKILL
    monitor.line(r'^cell1/lift offline( \(|$)', since=seen)
    monitor.line('^cell2/lift online', since=seen)
    # the bridge says it itself
    seen = len(monitor.lines)
    assert second.end(signal.SIGINT) == 0
    monitor.line(r'^cell2/lift offline( \(|$)', since=seen)

    assert not any('cell' in line for line in only.lines)
    for each, signum in ((monitor, signal.SIGINT), (only, signal.SIGTERM)):
        assert each.end(signum) == 0
        assert 'Traceback' not in each.errors


def test_keys_show_a_drive(run: Run, tmp_path: Path) -> None:
    pytest.importorskip('rich')
    terminal = Terminal(100, 29)
    monitor = run('drive_can', 'monitor', job=True, **terminal.options)
    terminal.shows('No bridge yet. Looking for one in ROS domain')
    bridge(run, tmp_path)
    terminal.shows('2 drives.*conveyor.*lift')
    terminal.type('\x1b[B')  # the next one
    terminal.type('\r')
    terminal.shows('/lift.*bus main, station 2.*enabled.*fault.*ready')
    before = len(terminal.read())
    terminal.type('\x1b')
    terminal.shows('2 drives.*lift: online.*in detail', since=before)
    terminal.type('\r')
    before = len(terminal.read())
    terminal.resize(60, 20)
    terminal.shows('drive lift.*esc back', since=before)

    # Ctrl-Z, and back
    before = len(terminal.read())
    terminal.type('\x1a')
    terminal.shows('\x1b\\[\\?1049l', since=before)
    wait_for(lambda: stopped(monitor), 'that it stops')
    assert terminal.echoes
    before = len(terminal.read())
    monitor.process.send_signal(signal.SIGCONT)
    terminal.shows('drive lift.*esc back', since=before)
    assert not terminal.echoes

    terminal.type('q')
    assert monitor.process.wait(60.0) == 0
    assert terminal.echoes
    assert 'Traceback' not in terminal.read()
    terminal.close()


def stopped(process: Running) -> bool:
    """Tell whether a process stands still."""
    status = Path(f'/proc/{process.process.pid}/stat').read_text(encoding='ascii')
    return status.rpartition(')')[2].split()[0] == 'T'


class Watcher:
    """
    Signals, on the bench.

    :param seconds: until there is one.
    """

    def __init__(self, bench: World, seconds: float) -> None:
        self._clock = bench.clock
        self._end = bench.clock.now() + seconds

    def wait(self, timeout: float) -> str | None:
        self._clock.live(timeout)
        return '' if self._clock.now() >= self._end else None


def test_the_bridge_does_not_notice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from bridges import Bridge, LIFT, parameters
    from drive_can_bridge.ros.monitor.client import MonitorClient

    def watch(seconds: float) -> list[str]:
        capsys.readouterr()
        model = Model()
        source = MonitorClient(model)
        command._print_lines(source, model, Watcher(bench, seconds),   # type: ignore[arg-type]
                             bench.clock, as_json=False)
        source.close()
        return capsys.readouterr().out.splitlines()
    with world(int(os.environ['DRIVE_CAN_TEST_SEED']), ros=True) as bench:
        watched = Bridge(tmp_path, parameters(lift=LIFT))
        watched.begin()
        watched.online()
        statistics = watched.node.drives['lift'].session.statistics
        for _ in range(2):      # the first one ends, the other comes
            *_, line = watch(5.0)
            assert re.match(r'lift \S.* actual_speed=', line)
            assert ' offline' not in line
        bench.clock.live(5.0)
        assert watched.node.drives['lift'].session.online
        assert statistics.missed == 0
        watched.close()


def test_a_drive_whose_bridge_says_nothing_is_noticed(tmp_path: Path) -> None:
    from bridges import Bridge, LIFT, parameters
    from drive_can_bridge.ros.monitor.client import MonitorClient
    with world(int(os.environ['DRIVE_CAN_TEST_SEED']), ros=True) as bench:
        silent = Bridge(tmp_path, {**parameters(lift=LIFT), 'diagnostics_period': 60.0},
                        arguments=('-r', '__ns:=/cell'))
        silent.begin()
        silent.online()
        bench.clock.live(5.0)
        models = [Model(place) for place in ('', '/cell', '/other')]
        sources = [MonitorClient(model) for model in models]

        def unheard(seconds: float) -> list[list[str]]:
            for _ in range(round(10 * seconds)):
                for source in sources:
                    source.poll(bench.clock.now())
                bench.clock.live(0.1)
            return [[*model.look(bench.clock.now(), 0.0).unheard] for model in models]
        assert unheard(5.0) == [['/cell/lift'], ['/cell/lift'], []]
        # until it says something
        assert unheard(60.0) == [[], [], []]
        for source in sources:
            source.close()
        silent.close()


def test_without_ros_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    class Incomplete(ModuleType):
        def __getattr__(self, name: str) -> object:
            raise ModuleNotFoundError('no', name='rclpy')
    monkeypatch.setitem(sys.modules, 'drive_can_bridge.ros.monitor.client', Incomplete('client'))
    monkeypatch.setattr(command, 'SignalWatcher', lambda *_, **__: nullcontext())
    _, args = understood(['monitor'])
    args.clock = REAL
    with pytest.raises(DriveCanError, match='drive_can monitor: needs ROS 2'):
        command.run(args)
