# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The frames of a stop, for tests of what happens before, beside and behind it.

How many there are is a promise that ``test_cyclic_exchange`` counts, and one test of each family
and of the exchange; all others go by the names of the product.
"""

from drive_can_bridge.protocols.cyclic_exchange import MORE_CYCLES, STOP_CYCLES

#: cycles of the stop of a drive that ran and answers none of them
UNANSWERED_CYCLES = STOP_CYCLES + MORE_CYCLES


def last_cycles(text: str, first: float, period: float = 0.02) -> list[tuple[float, str]]:
    """Return the last cycles before silence, as ``Conversation.until`` does."""
    return [(round(first + period * place, 6), text) for place in range(STOP_CYCLES)]
