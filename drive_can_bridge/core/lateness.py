# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Why answers are late: one drive, or what all drives of a bus have in common."""

from collections.abc import Mapping
from typing import NamedTuple

from drive_can_bridge.core import sentences
from drive_can_bridge.core.adapter import AdapterTraits
from drive_can_bridge.core.messages import Sentence

#: s, and share of the longest delay, by which delays of one cause differ
_SPREAD, _SHARE = 0.002, 0.25
#: s that a drive needs to answer, at most, beside what its adapter keeps
_ANSWERING = 0.005


class AnswerTiming(NamedTuple):
    """
    Count and delay of a drive's late answers.

    :param late: how many were late since the start.
    :param late_by: s by which the last of them was.
    """

    late: int
    late_by: float
    period: float
    online: bool


class Lateness:
    """
    Compares the late answers of all drives of one bus.

    :ivar shared: since the update before, the answers of all of them came late, by the same time.
    """

    def __init__(self) -> None:
        self.shared = False
        self._before: dict[str, int] = {}

    def look(self, drives: Mapping[str, AnswerTiming]) -> None:
        """Update with the present answers of all drives of the bus."""
        here = {name: each for name, each in drives.items() if each.online}
        late = [each.period + each.late_by for name, each in here.items()
                if each.late > self._before.get(name, 0)]
        self._before = {name: each.late for name, each in drives.items()}
        self.shared = (len(late) == len(here) > 1
                       and max(late) - min(late) <= max(_SPREAD, _SHARE * max(late)))

    def told(self, bus: str, answers: AnswerTiming, traits: AdapterTraits | None) -> Sentence:
        """Return the text for a late answer, with its probable cause."""
        if traits is not None and traits.latency > 0.001 and (
                answers.period + answers.late_by <= traits.latency + _ANSWERING):
            return sentences.answer_kept(
                answers.late_by, traits.title, traits.latency, remedy=traits.remedy)
        if not self.shared:
            return sentences.answer_late(answers.late_by)
        return sentences.answers_late(
            answers.late_by, bus, 'adapter' if traits is None else traits.title)
