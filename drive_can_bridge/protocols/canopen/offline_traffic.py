# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What arrives from a node that is offline all the same.

Power, cable and station are in order where anything arrives: what is said of such a drive names
that instead of its silence.
"""

import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.sentences import Absence
from drive_can_bridge.protocols.canopen.network import NmtState
from drive_can_bridge.protocols.canopen.node import WatchedNode

#: s for which something that arrived counts
HEARD_TIME = 3.0


class OfflineTraffic:
    """
    Frames of one node while it is not online.

    :param lacks: what there is none of, so that it is offline.
    """

    def __init__(self, lacks: str) -> None:
        self._lacks = lacks
        self.clear()

    def clear(self) -> None:
        """Forget all: it was online until now."""
        self._at = self._wrong_at = -math.inf
        self._wrong = NOTHING

    def came(self, now: float) -> None:
        """Record a frame."""
        self._at = now

    def wrong(self, what: Sentence, now: float) -> None:
        """Record one that cannot be understood."""
        self._wrong, self._wrong_at = what, now

    def instead_of(self, advice: Sentence, node: WatchedNode, now: float) -> Sentence:
        """Return what to say: the advice, unless that speaks of silence and something arrives."""
        came, wrong = now - self._at <= HEARD_TIME, now - self._wrong_at <= HEARD_TIME
        if advice.kind not in (Absence.SILENT, Absence.NO_HEARTBEAT) or not (came or wrong):
            return advice
        state, emergency = node.said(now), node.emergency
        what = '' if emergency is None else (
            f'emergency {emergency.code:04X}h, register {emergency.register:02X}h')
        if state not in (None, NmtState.OPERATIONAL):
            return sentences.node_state(state.text, answers=True, emergency=what)
        if wrong:
            return self._wrong
        if advice.kind is Absence.NO_HEARTBEAT:
            return advice.also(answers=True)
        return sentences.answers_without(self._lacks, what)
