# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Settling by harmless reads what the manuals leave open: what a family asks, and what follows.

A *prober* is a conversation as a generator: it yields questions and is sent the answer, or None
where there was none. Who drives it keeps the time and the bus.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator
from typing import Any, NamedTuple

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import Frame, Route


#: data bytes of answers, in every family
LENGTH = 8


class Question(NamedTuple):
    """
    A read.

    :param response: identifier of the answer, which has the format of the question and eight
        bytes.
    :param fits: tells whether the data of such a frame answer it.
    :param quiet: s of silence that follow when there is no answer.
    """

    frame: Frame
    response: int
    fits: Callable[[bytes], bool] = lambda data: True
    quiet: float = 0.0

    def answers(self, frame: Frame) -> bool:
        """Tell whether a frame from the bus is an answer to it."""
        return (frame.identifier == self.response and frame.extended == self.frame.extended
                and len(frame.data) == LENGTH and self.fits(frame.data))


class Finding(NamedTuple):
    """
    A key of the drive that was looked at.

    :param value: what it should be; None: undecided.
    :param reason: which bytes that rests on, or what is missing.
    """

    key: str
    value: Any
    reason: str


Conversation = Generator[Question, Frame | None, list[Finding]]


class Prober(ABC):
    """
    Asks one drive.

    :ivar requests: what only a master of the drive sends.
    :ivar hazard: what its questions would mean to devices that the file does not name, or ''.
    :ivar notes: what else was seen.
    :ivar answered: there was an answer to some question.
    """

    def __init__(self, drive: DriveConfiguration, requests: list[Route],
                 hazard: str = '') -> None:
        self.drive = drive
        self.requests = requests
        self.hazard = hazard
        self.notes: list[str] = []
        self.answered = False

    def start_frame(self) -> Frame | None:
        """Return what makes the drive answer at all, sent only when asked for; None: nothing."""
        return None

    @abstractmethod
    def converse(self) -> Conversation:
        """Ask; every question may be asked again where there is no answer."""

    def ask(self, question: Question) -> Generator[Question, Frame | None, bytes | None]:
        """Ask one question; return the data of the answer."""
        frame = yield question
        if frame is None:
            return None
        self.answered = True
        return frame.data


def conclude(key: str, votes: dict[str, list[str]], *, what: str, missing: str) -> Finding:
    """
    Return what votes, each with what it rests on, say about a key: they should all agree.

    :param what: whose votes they are, in the plural.
    :param missing: what there was none of.
    """
    told = '; '.join(text for texts in votes.values() for text in texts)
    if len(votes) == 1:
        return Finding(key, next(iter(votes)), told)
    return Finding(key, None, f'{what} contradict each other: {told}' if votes else missing)


def spaced(data: bytes) -> str:
    """Write bytes as the manuals do: ``66 70 00 00``."""
    return data.hex(' ').upper()
