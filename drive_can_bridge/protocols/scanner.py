# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Finding drives on a bus that nobody has described: what a family recognises, and what it may ask.

A *scanner* hears every frame and notes which stations of its family talk, and whether a master
asks them. What it may ask are reads; but on 11-bit identifiers a read of one family is a command
of another, so that each scanner says what its questions would mean to others.

A *prober* settles by harmless reads what the manuals leave open of a drive that is configured. It
is a conversation as a generator: it yields questions and is sent the answer, or None where there
was none. Who drives it keeps the time and the bus.
"""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Generator
from enum import Enum
from typing import Any, NamedTuple, TypeVar

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import Frame, Route


#: s within which a frame may be the answer to the one before
ANSWER_TIME = 0.1
#: requests to a station, answered or not, that tell of a master
_MASTER_REQUESTS = 3
#: data bytes of answers, in every family
LENGTH = 8


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


class Scanner(ABC):
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
    def receive(self, frame: Frame, now: float) -> None:
        """Handle a frame from the bus (not one of our own)."""

    @abstractmethod
    def begin(self) -> None:
        """Prepare the first questions to all stations that may exist."""

    def settings(self, station: int) -> dict[str, Any]:
        """Return the drive keys of a parameter file that follow from what was seen."""
        return {}

    def asked(self, frame: Frame, now: float) -> None:
        """Record a question of our own: its answer is no sign of a master."""
        self._ours = True
        self.receive_request(frame, now)
        self._ours = False

    def receive_request(self, frame: Frame, now: float) -> None:
        """Note a request, where answers are only known by what was asked."""
        self.receive(frame, now)

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
                self.master = frame_sentences.seems_requests(self.protocol)

    def _answer(self, station: int, text: str, now: float,
                fits: Callable[[bytes], bool] = lambda request: True, *,
                service: int = 0, certainty: Certainty = Certainty.LIKELY) -> bool:
        """
        Note a frame of a station if it follows a request that it fits to; return whether it does.

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
            self.master = frame_sentences.requests_to_station(station, self.protocol)
        self._see(station, text, certainty)
        return True


class Question(NamedTuple):
    """
    A read.

    :param response: identifier of the answer, which has the format of the question and eight
        bytes.
    :param fits: tells whether the data of such a frame answer it.
    :param quiet: s of silence that follow when there is no answer.
    :param shortest: data bytes of an answer at least, where it need not have eight.
    """

    frame: Frame
    response: int
    fits: Callable[[bytes], bool] = lambda data: True
    quiet: float = 0.0
    shortest: int = LENGTH

    def answers(self, frame: Frame) -> bool:
        """Return whether a frame from the bus is an answer to it."""
        return (frame.identifier == self.response and frame.extended == self.frame.extended
                and self.shortest <= len(frame.data) <= LENGTH and self.fits(frame.data))


class Finding(NamedTuple):
    """
    What was found out about a key of the drive.

    :param value: what it should be; None: undecided.
    :param reason: which bytes that rests on, or what is missing.
    """

    key: str
    value: Any
    reason: str


T = TypeVar('T')
#: yields questions, is sent each answer, or None, and returns something
Asking = Generator[Question, Frame | None, T]
Conversation = Asking[list[Finding]]


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

    def ask(self, question: Question) -> Asking[bytes | None]:
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
    return Finding(key, None, frame_sentences.contradiction(what, told) if votes else missing)


def undecided(key: str, why: str) -> Finding:
    """Return that nothing is concluded about a key: silence and most refusals prove nothing."""
    return Finding(key, None, frame_sentences.undecided(why))


def spaced(data: bytes) -> str:
    """Write bytes as the manuals do: ``66 70 00 00``."""
    return data.hex(' ').upper()
