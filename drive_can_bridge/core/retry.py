# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""How long and how often a drive is asked, and what is said when nobody answers."""

from collections.abc import Callable
from dataclasses import dataclass

from drive_can_bridge.core import sentences
from drive_can_bridge.core.requests import Failure


def _never() -> bool:
    return False


@dataclass(slots=True)
class RetryPolicy:
    """
    What everybody who asks a drive has to know; one for each drive, whose time-out may change.

    :param timeout: s to wait for an answer.
    :param attempts: how often a read is sent before it counts as unanswered.
    :param offline: tells whether nobody is there; then one unanswered frame ends a request.
    """

    timeout: float
    attempts: int
    offline: Callable[[], bool] = _never

    def unanswered(self, attempts: int | None = None) -> Failure:
        """Say that nobody answered; ``attempts`` None: as many as configured."""
        if self.offline():
            return Failure(sentences.no_answer_offline())
        return Failure(sentences.no_answer(
            self.timeout, self.attempts if attempts is None else attempts))
