# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What is under way for a drive's control word, and who waits for it."""

from dataclasses import dataclass, field

from drive_can_bridge.core import sentences
from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.core.sentences import Sentence


@dataclass(slots=True)
class Operation:
    """
    What is under way.

    :ivar requests: those that wait for it; a quick stop for which there is no word waits for
        ``disable``.
    :ivar pulsed: the reset word has left as often as it has to.
    :ivar held: it is answered, and only keeps its word: whatever else is wanted may end it.
    """

    action: ControlAction
    deadline: float
    requests: list[ControlRequest] = field(default_factory=list)
    pulsed: bool = False
    held: bool = False


class Answers:
    """The outcomes of requests until somebody takes them."""

    def __init__(self) -> None:
        self._completed: list[ControlCompleted] = []

    def complete(self, request: ControlRequest, success: bool, message: Sentence) -> None:
        """Answer one request."""
        self._completed.append(ControlCompleted(request, success, message))

    def answer(self, operation: Operation, success: bool, message: Sentence) -> None:
        """Answer all that wait for an operation."""
        for request in operation.requests:
            instead = request.action is not operation.action
            self.complete(
                request, success, sentences.disabled_instead(message) if instead else message)
        operation.requests.clear()

    def take(self) -> list[ControlCompleted]:
        """Return the outcomes since the last call."""
        completed = self._completed
        if completed:
            self._completed = []
        return completed
