# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can demo`` in a terminal: what arrives at its other end, and which process may die."""

from collections.abc import Callable
import os
from pathlib import Path
import signal

import pytest
from running import Running, Terminal
from waiting import wait_for

pytest.importorskip('rclpy')
pytest.importorskip('rich')

ENTERED, LEFT = '\x1b[?1049h', '\x1b[?1049l'
Start = Callable[..., Running]


@pytest.fixture
def demo(start: Start, terminal: Terminal) -> Running:
    """Return a demo whose view is up."""
    running = start(**terminal.options)
    terminal.shows('not armed.*online')
    return running


def all_gone(children: dict[str, int]) -> bool:
    """Tell whether none of the processes exists any more."""
    return not any(Path(f'/proc/{number}').exists() for number in children.values())


def test_the_view_comes_and_goes(demo: Running, terminal: Terminal) -> None:
    assert ENTERED in terminal.read()
    assert LEFT not in terminal.read()
    assert not terminal.echoes
    # the log is inside the view, and never written across it
    assert '[INFO]' not in terminal.read()

    before = len(terminal.read())
    terminal.resize(80, 24)
    terminal.shows('── bus ──.*quit', since=before)

    children = demo.children()
    assert set(children) == {'monitor', 'simulate', 'drive_can_bridge'}
    terminal.type('\x03')
    assert demo.process.wait(60.0) == 0
    view, _, rest = terminal.read().rpartition(LEFT)
    assert 'conveyor' in view
    assert ' missed, period error ' in rest
    assert 'Traceback' not in terminal.read()
    assert terminal.echoes
    assert all_gone(children)


def test_it_is_not_suspended(demo: Running, terminal: Terminal) -> None:
    before = len(terminal.read())
    terminal.type('\x1a')
    terminal.shows('drives would run on with nobody to stop them', since=before)
    for process in (demo.process.pid, demo.children()['monitor']):
        status = Path(f'/proc/{process}/stat').read_text(encoding='ascii')
        assert status.rpartition(')')[2].split()[0] != 'T'
    assert LEFT not in terminal.read()
    terminal.type('\x1c')      # Ctrl-\\: as all of them, but it says so
    assert demo.process.wait(60.0) == 128 + signal.SIGQUIT
    assert LEFT in terminal.read()
    assert terminal.echoes


def test_without_its_view_the_bridge_runs_on_and_it_is_said(demo: Running,
                                                            terminal: Terminal) -> None:
    children = demo.children()
    os.kill(children['monitor'], signal.SIGKILL)
    terminal.shows(r'the view has ended \(killed by signal 9\); bridge and drives run on')
    assert demo.process.poll() is None
    assert set(demo.children()) == {'simulate', 'drive_can_bridge'}
    assert LEFT in terminal.read()
    assert demo.end(signal.SIGTERM) == 0
    assert terminal.echoes
    assert all_gone(children)


def test_without_its_bridge_every_drive_is_offline_in_words(demo: Running,
                                                            terminal: Terminal) -> None:
    # what the view has not seen yet, it never will
    for name in ('conveyor', 'lift', 'turntable'):
        terminal.shows(f'{name}.*(not armed|disabled|online)')
    children = demo.children()
    os.kill(children['drive_can_bridge'], signal.SIGKILL)
    since = len(terminal.read())
    terminal.shows('bridge silent since .*its drives may still be running', since=since)
    for name in ('conveyor', 'lift', 'turntable'):
        terminal.shows(f'{name}.*unknown', since=since)
    assert demo.end(signal.SIGINT) == 0
    assert all_gone(children)


def test_what_the_demo_dies_of_its_processes_end(demo: Running) -> None:
    children = demo.children()
    assert set(children) == {'monitor', 'simulate', 'drive_can_bridge'}
    demo.end(signal.SIGKILL)
    wait_for(lambda: all_gone(children), 'the end of all processes')
