# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Notes of a node: at once, then one a second of each kind, with how many there were."""

import math

from drive_can_bridge.core.events import Noted
from drive_can_bridge.protocols.canopen.notes import PacedNotes


def test_first_of_each_kind_at_once_and_then_one_a_second() -> None:
    told: list[Noted] = []
    notes = PacedNotes(told.append)
    assert notes.next_timer() == math.inf
    notes.note('boot-up', 'started', 10.0)
    notes.note('emergency', 'hot', 10.1, warning=True)
    assert told == [Noted('started'), Noted('hot', warning=True)]
    assert notes.next_timer() == math.inf
    notes.note('emergency', 'hotter', 10.2, warning=True)
    notes.note('boot-up', 'started', 10.3)
    notes.note('emergency', 'cold', 10.4, warning=True)
    assert notes.next_timer() == 11.0
    notes.handle_timer(10.999)
    assert len(told) == 2
    notes.handle_timer(11.0)
    notes.handle_timer(11.1)
    assert told[2:] == [Noted('started (1 more)'), Noted('cold (2 more)', warning=True)]
    assert notes.next_timer() == math.inf
    notes.note('boot-up', 'started', 11.5)
    assert notes.next_timer() == 12.0
    notes.note('boot-up', 'started again', 12.5)     # nobody looked at the clock
    assert told[4:] == [Noted('started again (1 more)')]


def test_flush_tells_the_rest() -> None:
    told: list[Noted] = []
    notes = PacedNotes(told.append)
    for _ in range(3):
        notes.note('boot-up', 'started', 10.0)
    notes.flush(10.0)
    assert told == [Noted('started'), Noted('started (2 more)')]
    assert notes.next_timer() == math.inf
