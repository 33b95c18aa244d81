# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""How long parameter requests wait for a drive, and what is said when nobody answers."""

from collections.abc import Callable
from dataclasses import dataclass

from drive_can_bridge.core.requests import Failure, NO_ANSWER_OFFLINE


@dataclass(frozen=True)
class Patience:
    """
    What every family's parameter requests need to know of their drive.

    :param offline: tells whether nobody is there; then one unanswered frame ends the request.
    :param timeout: s to wait for an answer.
    :param attempts: how often a read is sent before it counts as unanswered.
    """

    offline: Callable[[], bool]
    timeout: float
    attempts: int

    def unanswered(self, attempts: int | None = None) -> Failure:
        """Say that nobody answered; ``attempts`` None: as many as configured."""
        if self.offline():
            return Failure(NO_ANSWER_OFFLINE)
        attempts = self.attempts if attempts is None else attempts
        noun = 'attempt' if attempts == 1 else 'attempts'
        return Failure(f'no answer in {self.timeout:g} s, {attempts} {noun}')
