# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Names of values in one line, as descriptors carry them: ``0:terminals 3:bus``."""

from collections.abc import Iterable
from functools import lru_cache
import re

_ENTRY = re.compile(r'(?:^| )(-?[0-9]+):((?:(?! -?[0-9]+:).)+)', re.ASCII)


def joined(names: Iterable[tuple[int, str]]) -> str:
    """Write names in one line."""
    return ' '.join(f'{number}:{name}' for number, name in names)


@lru_cache(maxsize=4096)
def taken_apart(text: str) -> tuple[tuple[int, str], ...]:
    """Read names from one line; what is none is left out."""
    return tuple((int(number), name) for number, name in _ENTRY.findall(text))
