# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Lines on standard output, for people and for programs.

``drive_can stop`` imports this to print results, so nothing is imported here that
takes time where nothing needs it.
"""

from collections.abc import Mapping

#: exit code of what was asked for and was not done
FAILED = 1


def say(text: str) -> None:
    """Write a line to standard output."""
    if not text.isprintable():
        from drive_can_bridge.core.text import printable
        text = printable(text, None)
    print(text)


def print_json(*documents: Mapping[str, object]) -> None:
    """Print JSON documents, each as a line of standard output; JSON has no inf, and no nan."""
    import json
    import math
    for document in documents:
        print(json.dumps({
            key: str(value) if isinstance(value, float) and not math.isfinite(value) else value
            for key, value in document.items()}, ensure_ascii=False))
