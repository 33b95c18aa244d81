# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Demos that end with the test."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from running import Running, starting, Terminal

Start = Callable[..., Running]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Return what starts a demo with arguments."""
    with starting(tmp_path, 'drive_can', 'demo') as start_one:
        yield start_one


@pytest.fixture
def terminal() -> Iterator[Terminal]:
    """Return a pseudo-terminal."""
    opened = Terminal()
    yield opened
    opened.close()
