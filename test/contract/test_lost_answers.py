# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""However many answers were lost, the next question that is answered is believed, or the next."""

from collections.abc import Generator
from random import Random
from typing import Any

import builders
from builders import EEPROM, parameter, RO, text_of
from conversation import Conversation
import pytest
from test_late_answers import KINDS, Partner, REGISTERS, SPEED, TIMEOUT

from drive_can_bridge.core.events import RequestCompleted
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.outbox import Outbox
from drive_can_bridge.core.process_image import LastSent
from drive_can_bridge.core.requests import ReadRequest, RetryPolicy, WriteRequest
from drive_can_bridge.protocols.channel import Channel, Priority
from drive_can_bridge.protocols.cia402.transactor import SdoTransactor, Transfer
from drive_can_bridge.protocols.datamodel.transactor import ParameterRead, ParameterTransactor
from drive_can_bridge.protocols.families import FAMILIES

STATUS = parameter('system_status_1', 455, access=RO)
REGISTER = parameter('register_652', 652, storage=EEPROM)


class PkwPartner(Partner):
    """Node 5, a TeSys T: one request at a time, begun by a change of the function byte."""

    drive = builders.drive(
        'canopen_pkw', station=5, request=(), response=(STATUS,), table=(STATUS, REGISTER),
        parameter_timeout=TIMEOUT, parameter_retries=1, missed_limit=1000)
    function_byte = 0

    def hear(self, frame: Frame, now: float) -> None:
        if frame.identifier != 0x505:
            return
        data, self.function_byte, before = frame.data, frame.data[3], self.function_byte
        if data[3] & 0x7F == 0:
            self.answer(Frame(0x485, bytes(3) + data[3:4] + bytes(4), False), now + 0.002)
        elif data[3] == before:
            return
        elif data[3] & 0x7F == 0x2A:
            self.late(now, Frame(0x485, data[:4] + bytes(4), False))
        else:
            self.late(now, Frame(0x485, data[:4] + bytes.fromhex('41000000'), False))


class StandardPartner(Partner):
    """Station 1 with 11-bit identifiers: answers say nothing of what they answer."""

    drive = builders.drive(
        'datamodel_standard', request=(), response=(SPEED,), table=(SPEED, *REGISTERS),
        parameter_timeout=TIMEOUT, parameter_retries=1, missed_limit=1000)

    def hear(self, frame: Frame, now: float) -> None:
        assert frame.identifier == 0x3F1
        number = int.from_bytes(frame.data[1:3], 'little')
        if frame.data[0] == 6:
            self.write(number, int.from_bytes(frame.data[3:5], 'little'), now)
            return
        assert (frame.data[0], frame.data[3]) == (3, 1)
        if number == 200:
            self.answer(Frame(0x7F1, bytes(8), False), now + 0.002)
        else:
            self.late(now, Frame(
                0x7F1, self.value(number).to_bytes(2, 'little') + bytes(6), False))


PARTNERS = {**KINDS, 'canopen_pkw': PkwPartner, 'datamodel_standard': StandardPartner}


def test_every_family_is_here() -> None:
    assert set(PARTNERS) == set(FAMILIES)


class Story:
    """
    A drive that answers everything 2 ms later, but some.

    :ivar losing: so many answers to what users ask are lost from now on.
    :ivar deaf: all of them are lost.
    """

    def __init__(self, kind: type[Partner]) -> None:
        self.partner = kind(Random(0))
        self.deaf = False
        self.partner.late = self._answer    # type: ignore[method-assign]
        self.session = Conversation(kind.drive).session
        self.register = [each for each in kind.drive.profile.parameters.values()
                         if each in (*REGISTERS, REGISTER)
                         or each.name.startswith('register')][0]
        self.losing = 0
        self.now = 10.0
        self.session.bus_up(self.now)
        self.session.activate(self.now)
        self.run(11.0)
        assert self.session.online

    def _answer(self, now: float, frame: Frame) -> None:
        if self.losing:
            self.losing -= 1
            return
        self.partner.answer(frame, now + 0.002)

    def run(self, end: float) -> list[RequestCompleted]:
        """Go on until then, or until a request is answered."""
        answers = self.partner.answers
        while True:
            due = min(self.session.next_timer(), answers[0][0] if answers else end, end)
            self.now = max(self.now, due)
            if answers and answers[0][0] <= self.now:
                self.session.receive_frame(answers.pop(0)[2], self.now)
            elif due < end:
                self.session.handle_timer(self.now)
            for frame in self.session.take_frames():
                if not self.deaf:
                    self.partner.hear(frame, self.now)
            self.session.frames_left(self.now)
            done = [event for event in self.session.take_events()
                    if isinstance(event, RequestCompleted)]
            if done or self.now >= end:
                return done

    def asks(self, request: ReadRequest | WriteRequest) -> str:
        """Return what became of a request."""
        self.session.services.submit(request, self.now)
        event, = self.run(self.now + 30.0)
        return text_of(event.outcomes[0])

    def writes(self, value: int) -> str:
        return self.asks(WriteRequest(((self.register, value),), False))


@pytest.mark.parametrize('lost', [1, 2, 3, 4, 20])
@pytest.mark.parametrize('pause', [0.0, 0.05, 0.3])
@pytest.mark.parametrize('kind', PARTNERS.values(), ids=PARTNERS)
def test_a_users_write_is_believed(kind: type[Partner], pause: float, lost: int) -> None:
    story = Story(kind)
    story.losing = lost
    value = 5
    while story.losing:
        value = 5 + value % 90
        story.writes(value)
        story.run(story.now + pause)
    outcomes = []
    for value in range(20, 26):
        outcomes.append(story.writes(value))
        story.run(story.now + pause)
    assert outcomes[1:] == ['written'] * 5, outcomes


@pytest.mark.parametrize('silence', [0.2, 1.0, 5.0, 60.0])
@pytest.mark.parametrize('lost', [1, 2, 3])
@pytest.mark.parametrize('kind', PARTNERS.values(), ids=PARTNERS)
def test_so_it_is_behind_a_silence(kind: type[Partner], lost: int, silence: float) -> None:
    """Rounds, and what is asked before anything else, were asked in vain meanwhile."""
    story = Story(kind)
    story.losing = lost
    for value in range(10, 10 + lost):
        story.writes(value)
    story.deaf = True
    story.run(story.now + silence)
    story.deaf = False
    while not story.session.online:
        story.run(story.now + 0.01)
    outcomes = [story.writes(value) for value in range(20, 26)]
    assert outcomes[1:] == ['written'] * 5, outcomes


@pytest.mark.parametrize('lost', [1, 2, 3, 7, 20])
@pytest.mark.parametrize('kind', PARTNERS.values(), ids=PARTNERS)
def test_a_users_read_is_believed(kind: type[Partner], lost: int) -> None:
    story = Story(kind)
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
