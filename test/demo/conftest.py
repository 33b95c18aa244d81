# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Demos that end with the test."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from running import Running, Terminal

Start = Callable[..., Running]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Return what starts a demo with arguments."""
    demos: list[Running] = []

    def start_one(*arguments: str, **options: Any) -> Running:
        demos.append(Running(tmp_path, 'drive_can', 'demo', *arguments, **options))
        return demos[-1]
    yield start_one
    for demo in demos:
        demo.close()


@pytest.fixture
def terminal() -> Iterator[Terminal]:
    """Return a pseudo-terminal."""
    opened = Terminal()
    yield opened
    opened.close()
