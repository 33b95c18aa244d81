# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Finding drives on a bus that nobody has described: what a family recognises, and what it may ask.

A *scout* hears every frame and notes which stations of its family talk, and whether a master asks
them. What it may ask are reads; but on 11-bit identifiers a read of one family is a command of
another, so that each scout says what its questions would mean to others.
"""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable
from enum import Enum
from typing import Any, NamedTuple

from drive_can_bridge.core.frame import Frame

#: s within which a frame may be the answer to the one before
ANSWER_TIME = 0.1
#: requests to a station, answered or not, that tell of a master
_MASTER_REQUESTS = 3


class Certainty(Enum):
    """How sure a sighting is."""

    CERTAIN = 'certain'
    LIKELY = 'likely'


class Sighting(NamedTuple):
    """
    A station that was seen.

    :param text: what it said or answered.
    """

    protocol: str
    station: int
    text: str
    certainty: Certainty


class Scout(ABC):
    """
    Looks for the drives of one family.

    :ivar protocol: name of the family.
    :ivar sightings: by station.
    :ivar nodes: what is known of devices that may take what other families ask for commands.
    :ivar master: what somebody else asked last; '': nobody did.
    :ivar unmistakable: its questions mean nothing to devices of any other family.
    :ivar hazard: what its questions would mean to devices of others.
    """

    protocol: str
    unmistakable = False
    hazard = ''

    def __init__(self) -> None:
        self.sightings: dict[int, Sighting] = {}
        self.nodes: dict[int, str] = {}
        self.master = ''
        #: by station and service of it
        self._asked: dict[tuple[int, int], tuple[float, bytes, bool]] = {}
        self._ours = False      # what is heard now is a question of our own
        self._pairs: Counter[int] = Counter()
        self._alone: Counter[tuple[int, int]] = Counter()
        self._questions: list[Frame] = []

    @abstractmethod
    def hear(self, frame: Frame, now: float) -> None:
        """Take a frame from the bus (not one of our own)."""

    @abstractmethod
    def begin(self) -> None:
        """Prepare the first questions to all stations that may exist."""

    def settings(self, station: int) -> dict[str, Any]:
        """Return the drive keys of a parameter file that follow from what was seen."""
        return {}

    def asked(self, frame: Frame, now: float) -> None:
        """Record a question of our own: its answer is no sign of a master."""
        self._ours = True
        self.hear_request(frame, now)
        self._ours = False

    def hear_request(self, frame: Frame, now: float) -> None:
        """Note a request, where answers are only known by what was asked."""
        return

    def take_question(self) -> Frame | None:
        """Return the next question; answers may bring further ones."""
        return self._questions.pop(0) if self._questions else None

    def _see(self, station: int, text: str, certainty: Certainty) -> None:
        """Note a station; what is more certain, or as certain and newer, wins."""
        known = self.sightings.get(station)
        if known is None or certainty in (Certainty.CERTAIN, known.certainty):
            self.sightings[station] = Sighting(self.protocol, station, text, certainty)

    def _request(self, station: int, data: bytes, now: float, *, service: int = 0) -> None:
        """Note what looks like a request to a station; some in a row are a master's."""
        key = station, service
        self._asked[key] = now, data, self._ours
        if not self._ours:
            self._alone[key] += 1
            if self._alone[key] >= _MASTER_REQUESTS:
                self.master = f'what looks like requests of {self.protocol}'

    def _answer(self, station: int, text: str, now: float,
                fits: Callable[[bytes], bool] = lambda request: True, *,
                service: int = 0, certainty: Certainty = Certainty.LIKELY) -> bool:
        """
        Note a frame of a station if it follows a request that it fits to; tell whether it does.

        An answer to a question that is not our own may be chance: it takes two. One that nobody
        but the station asked can give, to a question of ours, may take its time.
        """
        asked = self._asked.pop((station, service), None)
        if asked is None or not fits(asked[1]):
            return False
        asked_at, _, ours = asked
        if now - asked_at > ANSWER_TIME and not (ours and self.unmistakable):
            return False
        if not ours:
            self._pairs[station] += 1
            if self._pairs[station] < 2:
                return True
            self.master = f'requests to station {station} of {self.protocol}'
        self._see(station, text, certainty)
        return True
