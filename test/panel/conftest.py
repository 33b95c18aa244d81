# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Panels that end with their tests: on the bench, and as processes."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from panel_builders import Run, Site
import pytest
from running import Running

if TYPE_CHECKING:
    from panel_bench import House


@pytest.fixture(scope='module')
def house(tmp_path_factory: pytest.TempPathFactory) -> Iterator['House']:
    """Return a panel on the bench that may write, of a bridge with three drives."""
    pytest.importorskip('rclpy')
    pytest.importorskip('nicegui', reason="needs the extra 'panel'")
    import panel_bench
    with panel_bench.house(tmp_path_factory.mktemp('house')) as made:
        yield made


@pytest.fixture(scope='module')
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """Return what starts commands of the package, each with a directory of its own."""
    running: list[Running] = []

    def start(*command: str, **options: object) -> Running:
        running.append(Running(tmp_path_factory.mktemp('run'), *command, **options))
        return running[-1]
    yield start
    for each in reversed(running):
        each.close()


@pytest.fixture(scope='module')
def site(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Site:
    """Return a panel that may write, of a bridge with three drives, as processes."""
    return Site(run, Path(tmp_path_factory.mktemp('site')), '--allow-writes')
