# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Panels that end with their tests."""

from collections.abc import Iterator
from pathlib import Path

from panel_builders import Run, Site
import pytest
from running import Running


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
    """Return a panel that may write, of a bridge with three drives."""
    return Site(run, Path(tmp_path_factory.mktemp('site')), '--allow-writes')
