# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How far tests look that try one rule in many places: a run by hand some of them, CI all of them.

DRIVE_CAN_TEST_PROFILE says which, DRIVE_CAN_TEST_SEED where a run by hand begins. What differs in
what is promised, each family and each kind, is to be met by every run: it comes first in what is
listed, and each has several places.
"""

from collections.abc import Iterable
import os
import random
from typing import TypeVar

PROFILE = 'DRIVE_CAN_TEST_PROFILE'
SEED = 'DRIVE_CAN_TEST_SEED'
#: whether everything is looked at
LONG = os.environ.get(PROFILE) == 'long'
# who is started here inherits it
os.environ.setdefault(SEED, str(random.randrange(1_000_000)))

T = TypeVar('T')


def some(places: Iterable[T], one_in: int) -> list[T]:
    """Return every so many-th place, from one that the seed chooses; in the long profile, all."""
    everything = list(places)
    if LONG:
        return everything
    step = min(one_in, len(everything))
    return everything[int(os.environ[SEED]) % step::step]


def times(short: int, long: int) -> int:
    """Return how often something by chance is tried."""
    return long if LONG else short
