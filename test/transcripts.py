# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What people are shown, as golden files: stories of steps, and all the lines that each step brings.

A file has a transcript for each story. A line that begins with ``$`` is a step, ``$ #`` a remark;
the lines below a step are what it shows, word for word. They are written by hand.
"""

from collections.abc import Callable, Iterable
from pathlib import Path

import yaml

#: does a step, and returns the lines that it brings
Step = Callable[[str], Iterable[str]]


def stories(test: str, name: str) -> dict[str, str]:
    """Return the transcripts of a file that lies beside a test, by story."""
    found: dict[str, str] = yaml.safe_load(
        Path(test).with_name(name).read_text(encoding='utf-8'))
    return found


def shown(lines: Iterable[str], errors: Iterable[str], code: int = 0) -> list[str]:
    """Return what a command shows: its lines, ``!`` before complaints, its exit code if not 0."""
    return [*lines, *(f'! {line}' for line in errors), *([f'[{code}]'] if code else [])]


def replayed(transcript: str, step: Step) -> str:
    """Do the steps of a transcript once more, and return it as it is now."""
    lines: list[str] = []
    for line in transcript.splitlines():
        if line.startswith('$'):
            lines.append(line)
            if not line.startswith('$ #'):
                lines += step(line[2:])
    return ''.join(f'{line}\n' for line in lines)
