# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""However many answers were lost, the next question that is answered is believed, or the next."""

from collections.abc import Generator
from typing import Any

from builders import parameter
from partners import PARTNERS
import pytest
from test_late_answers import Line, REGISTERS, TIMEOUT

from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.outbox import Outbox
from drive_can_bridge.core.process_image import LastSent
from drive_can_bridge.core.requests import ReadRequest, RetryPolicy, WriteRequest
from drive_can_bridge.protocols.channel import Channel, Priority
from drive_can_bridge.protocols.cia402.transactor import SdoTransactor, Transfer
from drive_can_bridge.protocols.datamodel.transactor import ParameterRead, ParameterTransactor


class Story(Line):
    """
    A drive that answers everything 2 ms later, but some.

    :ivar losing: so many answers to what users ask are lost from now on.
    :ivar deaf: all of them are lost.
    """

    def __init__(self, family: str) -> None:
        self.losing, self.deaf = 0, False
        super().__init__(family, self._late)
        self.register = self.own[REGISTERS[0]]

    def _late(self) -> float | None:
        if not self.losing:
            return 0.002
        self.losing -= 1
        return None

    def heard(self, text: str) -> tuple[float, str] | None:
        return None if self.deaf else super().heard(text)

    def passes(self, seconds: float) -> None:
        self.live(self.talk.now + seconds)

    def asks(self, request: ReadRequest | WriteRequest) -> object:
        """Return what became of a request."""
        self.submits(request)
        end = self.talk.now + 30.0
        while not (outcomes := self.talk.outcomes()):
            assert self.talk.now < end
            self.passes(0.001)
        return outcomes[0][0]

    def writes(self, value: int) -> object:
        return self.asks(WriteRequest(((self.register, value),), False))


@pytest.mark.parametrize('lost', [1, 2, 3, 4, 20])
@pytest.mark.parametrize('pause', [0.0, 0.05, 0.3])
@pytest.mark.parametrize('family', sorted(PARTNERS))
def test_a_users_write_is_believed(family: str, pause: float, lost: int) -> None:
    story = Story(family)
    story.losing = lost
    value = 5
    while story.losing:
        value = 5 + value % 90
        story.writes(value)
        story.passes(pause)
    outcomes = []
    for value in range(20, 26):
        outcomes.append(story.writes(value))
        story.passes(pause)
    assert outcomes[1:] == ['written'] * 5, outcomes


@pytest.mark.parametrize('silence', [0.2, 1.0, 5.0, 60.0])
@pytest.mark.parametrize('lost', [1, 2, 3])
@pytest.mark.parametrize('family', sorted(PARTNERS))
def test_so_it_is_behind_a_silence(family: str, lost: int, silence: float) -> None:
    """Rounds, and what is asked before anything else, were asked in vain meanwhile."""
    story = Story(family)
    story.losing = lost
    for value in range(10, 10 + lost):
        story.writes(value)
    story.deaf = True
    story.passes(silence)
    story.deaf = False
    while not story.talk.session.online:
        story.passes(0.01)
    outcomes = [story.writes(value) for value in range(20, 26)]
    assert outcomes[1:] == ['written'] * 5, outcomes


@pytest.mark.parametrize('lost', [1, 2, 3, 7, 20])
@pytest.mark.parametrize('family', sorted(PARTNERS))
def test_a_users_read_is_believed(family: str, lost: int) -> None:
    story = Story(family)
    story.losing = lost
    read = ReadRequest((story.register,))
    while story.losing:
        story.asks(read)
    outcomes = [story.asks(read) for _ in range(5)]
    assert all(isinstance(outcome, int) for outcome in outcomes[1:]), outcomes


# -- stops: what shows that the drive has heard one -----------------------------------------------


class Sdo:
    """Node 5 by SDO; what is told is 6040h := 0."""

    def __init__(self) -> None:
        self.outbox = Outbox()
        word = parameter('word', None, index=0x6040, subindex=0)
        self.channel: Channel[Any, Any] = Channel(
            SdoTransactor(5, self.outbox, RetryPolicy(TIMEOUT, attempts=1), LastSent((word,))))
        self.lost = self.step = Transfer(0x6040, 0, bytes(2))
        self.told = '2B40600000000000'
        self.answers = {
            self.told: bytes.fromhex('6040600000000000'),
            '4000100000000000': bytes.fromhex('4300100092010200')}

    def sent(self, now: float) -> list[str]:
        frames = self.outbox.take()
        self.outbox.left(now)
        return [frame.data.hex().upper() for frame in frames]


class Numbers:
    """Frames whose identifiers are number and count."""

    together = 4

    def encode_read(self, number: int, count: int) -> Frame:
        return Frame(number << 4 | count, b'', True)

    def encode_write(self, number: int, words: tuple[int, ...]) -> Frame:
        raise NotImplementedError

    def decode(self, frame: Frame, asked: tuple[int, int] | None) -> tuple[int, ...]:
        raise NotImplementedError


class Station:
    """One with 29-bit identifiers; what is read back is P50."""

    def __init__(self) -> None:
        self.found: list[Frame] = []
        self.channel: Channel[Any, Any] = Channel(ParameterTransactor(
            Numbers(), send=lambda frame, left: self.found.append(frame),
            retry=RetryPolicy(TIMEOUT, attempts=1), eeprom_gap=0.02))
        self.lost, self.step = ParameterRead(50), ParameterRead(50, attempts=1, late_will_do=True)
        self.told = '321'
        self.answers: dict[str, Any] = {self.told: (0,), '7A1': (50,)}

    def sent(self, now: float) -> list[str]:
        found, self.found = self.found, []
        return [f'{frame.identifier:X}' for frame in found]


def asking(step: Any) -> Generator[Any, Any, Any]:
    return (yield step)


@pytest.mark.parametrize('lost', [0, 1, 2, 3, 6])
@pytest.mark.parametrize('kind', [Sdo, Station])
def test_a_stop_is_believed_at_the_second_answer(kind: type[Sdo | Station], lost: int) -> None:
    talk = kind()
    for _ in range(lost):
        talk.channel.run(asking(talk.lost), lambda _: None, 1.0)
        assert talk.sent(1.0) == [talk.told]
        talk.channel.clear()
        talk.channel._quarantine._until.clear()     # each of them may be asked at once
        talk.channel._transactor.free_at = 0.0      # type: ignore[attr-defined]
    results: list[Any] = []
    talk.channel.run(asking(talk.step), results.append, 1.01, Priority.STOP)
    now, sent, answered = 1.01, talk.sent(1.01), []
    while sent:
        text, = sent
        answered.append(text)
        talk.channel.receive(talk.answers[text], now := now + 0.002)
        talk.channel.advance(now := now + 0.002)
        sent = talk.sent(now)
    assert len(results) == 1
    assert answered.count(talk.told) == min(lost + 1, 2)
    assert len(answered) == min(lost + 1, 3)
