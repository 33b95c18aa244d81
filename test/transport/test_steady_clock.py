# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Only the steady clock decides when something happens: the system clock may be set any time."""

import ast
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2] / 'drive_can_bridge'

#: Who may look at the system clock, and how often: for stamps and for what people read.
ALLOWED = {
    # the age of a frame, believed below a tenth of a second only
    'transport/port.py': 1,
    # how old a command is, where the middleware does not say when it came
    'ros/command_topic.py': 1,
    # stamps of messages
    'ros/stamps.py': 1,
    # times shown to people
    'cli/simulate.py': 1,
    'ros/demo/frame_log.py': 1,
    'ros/demo/log_lines.py': 1,
    'ros/demo/view.py': 2,
}
SYSTEM_CLOCK = {'time', 'time_ns', 'localtime', 'gmtime', 'strftime', 'ctime', 'asctime',
                'CLOCK_REALTIME', 'datetime'}


def looks(path: Path) -> int:
    """Count the places where a module looks at the system clock."""
    tree = ast.parse(path.read_text(encoding='utf-8'))
    count = 0
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr in SYSTEM_CLOCK and isinstance(
                node.value, ast.Name) and node.value.id in ('time', 'datetime'):
            count += 1
        elif isinstance(node, ast.ImportFrom) and node.module in ('time', 'datetime'):
            count += sum(alias.name in SYSTEM_CLOCK for alias in node.names)
        elif isinstance(node, ast.Import):
            count += sum(alias.name == 'datetime' for alias in node.names)
    return count


def test_who_looks_at_the_system_clock() -> None:
    found = {path.relative_to(PACKAGE).as_posix(): looks(path) for path in PACKAGE.rglob('*.py')}
    assert {path: count for path, count in found.items() if count} == ALLOWED
