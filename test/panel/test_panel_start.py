# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A signal while ``drive_can panel`` starts: it ends, with no address of what is not there."""

from collections.abc import Callable
from pathlib import Path
import signal

from clocks import REAL
from panel_builders import NEEDS_PANEL, Run
import pytest
from waiting import wait_for

pytest.importorskip('rclpy')

pytestmark = NEEDS_PANEL


def test_while_it_is_being_loaded(run: Run, tmp_path: Path) -> None:
    module = 'nicegui'
    # it is held in the middle of an import, in which the signal comes
    gate, reached = tmp_path / 'gate', tmp_path / 'reached'
    (tmp_path / f'{module}.py').write_text(f"""
import importlib, pathlib, sys, time
pathlib.Path({str(reached)!r}).touch()
while not pathlib.Path({str(gate)!r}).exists():
    time.sleep(0.01)
sys.path.remove({str(tmp_path)!r})
del sys.modules[__name__]
importlib.invalidate_caches()
importlib.import_module(__name__)
""", encoding='utf-8')
    panel = run('drive_can', 'panel', '--port', '0', environment={
        'PYTHONPATH': f'{tmp_path}:{Path(__file__).parents[2]}'})
    wait_for(reached.exists, f'{module} being imported')
    panel.process.send_signal(signal.SIGTERM)
    gate.touch()
    assert panel.process.wait(60.0) == 0
    assert panel.lines == []
    line, = panel.errors.splitlines()
    assert line.startswith('drive_can panel: ')


@pytest.mark.parametrize('wanted', [1, 2], ids=['before it serves', 'while it begins to'])
def test_a_server_that_is_to_end_before_it_is_there(wanted: int) -> None:
    pytest.importorskip('nicegui')
    from drive_can_bridge.panel.access import PanelAccess
    from drive_can_bridge.panel.server import listen, serve
    looks, ready = [], []

    def ended() -> bool:
        looks.append(1)
        return len(looks) >= wanted
    listener = listen('127.0.0.1', 0)
    serve(_application, listener, PanelAccess(port=0), REAL, ended=ended,
          ready=lambda: ready.append(1))
    assert ready == []


async def _application(scope: object, receive: Callable[..., object],
                       send: Callable[..., object]) -> None:
    """Do nothing but begin and end."""
