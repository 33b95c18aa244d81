# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Panels that end with their tests: on the bench, and as processes."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, TYPE_CHECKING

from panel_builders import Run, Site
import pytest
from running import starting

if TYPE_CHECKING:
    from panel_bench import House
    from panel_somebody import Somebody


@pytest.fixture(scope='module')
def house(tmp_path_factory: pytest.TempPathFactory) -> Iterator['House']:
    """Return a panel on the bench that may write, of a bridge with three drives."""
    pytest.importorskip('rclpy')
    pytest.importorskip('nicegui', reason="needs the extra 'panel'")
    import panel_bench
    with panel_bench.house(tmp_path_factory.mktemp('house')) as made:
        yield made


@pytest.fixture
def page(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Return a page, with nobody who looks at it."""
    from nicegui import background_tasks
    from nicegui.client import Client
    from nicegui.page import page as kind
    # so nothing is sent to it; and after a test that has started NiceGUI nothing could be deferred
    monkeypatch.setattr(background_tasks, 'create_or_defer', lambda sends, **_: sends.close())
    client = Client(kind(''))
    with client:
        yield client
    client.delete()


@pytest.fixture
def somebody(site: Site) -> Iterator['Somebody']:
    """Return somebody else, who enables drives and moves them."""
    from panel_somebody import Somebody
    other = Somebody()
    yield other
    other.close()


@pytest.fixture(scope='module')
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """Return what starts commands of the package, each with a directory of its own."""
    with starting(tmp_path_factory.mktemp('run')) as start:
        yield start


@pytest.fixture(scope='module')
def site(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Site:
    """Return a panel that may write, of a bridge with three drives, as processes."""
    return Site(run, Path(tmp_path_factory.mktemp('site')), '--allow-writes')
