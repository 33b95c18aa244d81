# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""No thread keeps the interpreter for long."""

from pathlib import Path
import sys

import pytest

from drive_can_bridge.process import scheduling

SOURCES = Path(scheduling.__file__).parents[1]


def test_switch_interval() -> None:
    before = sys.getswitchinterval()
    try:
        scheduling.let_others_in()
        assert sys.getswitchinterval() == pytest.approx(0.0001)
    finally:
        sys.setswitchinterval(before)


@pytest.mark.parametrize('path', ['ros/main.py', 'ros/demo/application.py'])
def test_whoever_runs_a_bridge_asks_for_it(path: str) -> None:
    assert '    let_others_in()\n' in (SOURCES / path).read_text(encoding='utf-8')
