# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The frames of a stop, for tests of what happens before, beside and behind it.

How many there are is a promise that ``test_cyclic_exchange`` counts, and one test of each family
and of the exchange; how long words and stops wait is counted by ``test_acyclic_output`` and
``test_standard_stop_again``. All others go by the names of the product.
"""

import math

from drive_can_bridge.protocols.acyclic_output import REPEAT_FIRST, UNSEEN_REPEATS
from drive_can_bridge.protocols.cyclic_exchange import MORE_CYCLES, STOP_CYCLES
from drive_can_bridge.protocols.safe_stop import PAUSE

#: cycles of the stop of a drive that ran and answers none of them
UNANSWERED_CYCLES = STOP_CYCLES + MORE_CYCLES


def last_cycles(text: str, first: float, period: float = 0.02) -> list[tuple[float, str]]:
    """Return the last cycles before silence, as ``Conversation.until`` does."""
    return [(round(first + period * place, 6), text) for place in range(STOP_CYCLES)]


def written_again(first: float = 0.0) -> list[float]:
    """Return when a word that nobody takes notice of is written once more, ever more seldom."""
    return [first + (2 ** count - 1) * REPEAT_FIRST for count in range(1, UNSEEN_REPEATS + 1)]


def bursts(times: list[float], *, slack: float = math.inf) -> list[float]:
    """
    Return when stops began that are told again; each has some attempts.

    :param slack: s, beside the pause, that may lie between the end of one and the next.
    """
    gaps = [later - sooner for sooner, later in zip(times, times[1:])]
    begun = [place for place, gap in enumerate(gaps, 1) if gap > 0.9 * PAUSE]
    assert all(PAUSE <= gaps[place - 1] <= PAUSE + slack for place in begun)
    return [times[place] for place in (0, *begun)]
