# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
One more protocol family, with as little as a family needs.

Words low byte first, in frames of 11 bits; ``n`` is the station:

======= ============================== =====================================================
10h + n to the drive, every period     the setpoints
20h + n from the drive, answers it     the actual values
30h + n to the drive                   1 (read) or 2 (write), number, value
40h + n from the drive, answers it     the same with the value that it has; first byte 3: refused
======= ============================== =====================================================

As a program it is ``drive_can`` with this family, and ``found DIRECTORY`` besides: it writes there
what ``scan -o`` writes for such a drive.
"""

from collections.abc import Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
import re
import struct
import sys
from typing import Any, NamedTuple, Union

from drive_can_bridge.core import complaints, sentences
from drive_can_bridge.core.configuration import BusConfiguration, DriveConfiguration
from drive_can_bridge.core.drive_services import DriveServices
from drive_can_bridge.core.events import ForeignMasterSeen, ProcessDataReceived
from drive_can_bridge.core.frame import Frame, Route, worst_bits
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.requests import Outcome, Written
from drive_can_bridge.core.session import Session, Stage
from drive_can_bridge.protocols.access import Found, OneByOne, ParameterAccess
from drive_can_bridge.protocols.answers import CycleAnswers
from drive_can_bridge.protocols.channel import Channel
from drive_can_bridge.protocols.cyclic_exchange import CyclicExchange
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.family import (
    Claim, Complaint, Family, FamilyParts, option, out_of_range)
from drive_can_bridge.protocols.observer import DriveObserver, Emit, raws_of, TelegramKind
from drive_can_bridge.protocols.pairing import CyclicWatch, PendingRequests, RequestContent
from drive_can_bridge.protocols.scanner import (
    Certainty, Conversation, Finding, Prober, Question, Scanner, Sighting)
from drive_can_bridge.protocols.telegrams import Direction
from drive_can_bridge.protocols.transactor import Answered, Refused, Silence, SILENT, Transactor
from drive_can_bridge.simulation.drive import SimulatedDrive
from drive_can_bridge.simulation.simulation import SIMULATED_DRIVES

CYCLE, SAMPLE, TASK, REPLY = BASES = 0x10, 0x20, 0x30, 0x40
READ, WRITE, REFUSED = 1, 2, 3
STATION_MAX = 15
Reply = Union[Answered[int], Refused, Silence]

# -- wire -----------------------------------------------------------------------------------------


class Task(NamedTuple):
    """A task, or its answer."""

    function: int
    number: int
    value: int = 0


def encode_task(base: int, station: int, task: Task) -> Frame:
    return Frame(base + station, struct.pack('<BHH', *task), False)


def decode_task(data: bytes) -> Task:
    return Task(*struct.unpack('<BHH', data.ljust(5, b'\0')[:5]))


def encode_words(words: Iterable[int]) -> bytes:
    return b''.join(struct.pack('<H', word & 0xFFFF) for word in words)


def decode_words(data: bytes) -> list[int]:
    return [low | high << 8 for low, high in zip(data[::2], data[1::2])]


# -- session --------------------------------------------------------------------------------------


class ToyTransactor(Transactor[Task, Reply]):
    """One task at a time, answered by its number."""

    silent = SILENT

    def __init__(self, session: Session) -> None:
        super().__init__(session.retry)
        self._session = session

    def begin(self, step: Task, now: float) -> None:
        self.expect(step, now + self.retry.timeout)
        self._session.outbox.put(encode_task(TASK, self._session.configuration.station, step))

    def receive(self, answer: Task, now: float) -> Reply | bool:
        if self.step is None or answer.number != self.step.number:
            return False
        self.finish()
        return Answered(answer.value) if answer.function != REFUSED else Refused(
            REFUSED, 'not there')

    def attempts(self, step: Task) -> int:
        return self.retry.attempts

    def key(self, step: Task) -> int:
        return step.number


class ToyAccess(ParameterAccess[Parameter, Task, Reply]):
    """One parameter a task."""

    not_atomic = sentences.not_in_one_frame('a toy frame carries one parameter')

    def read(self, span: Parameter) -> Generator[Task, Reply, Found]:
        reply = yield Task(READ, span.number or 0)
        return (reply.content,) if isinstance(reply, Answered) else self.failed(reply)

    def write_one(self, parameter: Parameter, raw: int) -> Generator[Task, Reply, Outcome]:
        reply = yield Task(WRITE, parameter.number or 0, parameter.word_from_raw(raw))
        return Written() if isinstance(reply, Answered) else self.failed(reply)


class ToySession(Session):
    """Cycles, and tasks beside them."""

    def __init__(self, drive: DriveConfiguration) -> None:
        super().__init__(drive, None)
        self._channel = Channel(ToyTransactor(self))
        self.services = DriveServices(self, ToyAccess(self._channel, self.retry, OneByOne()))
        self._answers = CycleAnswers(self, silence='no sample')
        self._exchange: CyclicExchange[bytes] = CyclicExchange(self._answers, self, slot=0)
        self.set_parts(self._exchange, channel=self._channel)

    def begin(self, now: float) -> None:
        self._exchange.stop()
        self._exchange.start(now)

    def begin_stop(self, now: float) -> bool:
        self._exchange.stop_soon(now)
        return True

    @property
    def longest_stop(self) -> float:
        return self._exchange.longest_stop

    def hand_out_neutral(self, now: float) -> None:
        self._exchange.hand_out_neutral(now)

    def encode_cycle(self, raws: list[int]) -> bytes:
        return encode_words(raws)

    def send_cycle(self, telegram: bytes, now: float) -> None:
        self._exchange.put(Frame(CYCLE + self.configuration.station, telegram, False))
        self._exchange.expect_answer(now)

    def exchange_missed(self, reason: Sentence, now: float) -> None:
        self._answers.lose(reason, now)

    def last_cycle_left(self, now: float) -> None:
        self._exchange.end_stop()

    def receive_frame(self, frame: Frame, now: float, age: float = 0.0) -> None:
        base = frame.identifier - self.configuration.station
        if base == SAMPLE:
            self._receive_sample(frame.data, now, now - age)
        elif base == REPLY:
            if not self._channel.receive(decode_task(frame.data), now):
                self.report.unasked(sentences.unasked('answer'), self._channel.late(now - age),
                                    now)
        else:
            self.report.note(ForeignMasterSeen(
                sentences.other_master(self.configuration.station, str(frame))))

    def _receive_sample(self, data: bytes, now: float, received_at: float) -> None:
        if not self._answers.expects('sample', now, received_at):
            return
        raws = tuple(raws_of(self.sample_parameters, decode_words(data)))
        self._answers.answered(received_at)
        if not self.online and self.stage is Stage.RUNNING:
            self.be_online()
            self.control_changed(now)
        self.interlock.measured(raws)
        self.report.note(ProcessDataReceived(raws, received_at))
        self._exchange.wait_out(now)


# -- tools ----------------------------------------------------------------------------------------


class ToyObserver(DriveObserver):
    """Reads all four frames."""

    def __init__(self, drive: DriveConfiguration, emit: Emit) -> None:
        super().__init__(drive.name, emit)
        self._parameters = {parameter.number: parameter
                            for parameter in drive.profile.parameters.values()}
        self._cycle = CyclicWatch(self, 2.0 * drive.period)
        self._requests: PendingRequests[int] = PendingRequests(
            self, drive.parameter_timeout, self._content)
        for base, direction, listed in (
                (CYCLE, Direction.REQUEST, drive.cyclic_request),
                (SAMPLE, Direction.RESPONSE, drive.cyclic_response)):
            self.handlers[base + drive.station] = partial(self._take_words, direction, listed)
        self.listen(TASK + drive.station, Direction.REQUEST, TelegramKind.PARAMETER, 'task',
                  decode_task, self._take_task)
        self.listen(REPLY + drive.station, Direction.RESPONSE, TelegramKind.PARAMETER, 'answer',
                  decode_task, self._take_reply)

    def _take_words(self, direction: Direction, listed: Sequence[Parameter], data: bytes,
                    now: float) -> None:
        raws = raws_of(listed, decode_words(data))
        if direction is Direction.REQUEST:
            self._cycle.ask(now)
            self.report(now, direction, TelegramKind.CYCLIC, 'cyclic request', listed, raws)
        else:
            verdict, latency = self._cycle.answer(now)
            self.report(now, direction, TelegramKind.CYCLIC, 'cyclic response', listed, raws,
                      verdict=verdict, latency=latency)

    def _take_task(self, task: Task, now: float) -> None:
        self._requests.ask(task.number, task.number, now,
                           (task.value,) if task.function == WRITE else None)

    def _take_reply(self, reply: Task, now: float) -> None:
        asked = self._requests.about.get(reply.number) or RequestContent(reply.number)
        self._requests.answer(reply.number, asked, now, (reply.value,),
                              refusal='not there' if reply.function == REFUSED else '')

    def _content(self, number: int, words: Sequence[int] | None,
                 ) -> tuple[tuple[Parameter, ...], list[int]]:
        parameter = self._parameters.get(number) or Parameter(f'p{number}', number=number)
        return (parameter,), raws_of((parameter,), words or ())


class ToyScanner(Scanner):
    """Reads number 1 of each station."""

    protocol = 'toy'
    hazard = Sentence('toy: 30h is the task of station 0 for all that anybody knows')

    def begin(self) -> None:
        self._questions += [encode_task(TASK, station, Task(READ, 1))
                            for station in range(1, STATION_MAX + 1)]

    def receive(self, frame: Frame, now: float) -> None:
        station = frame.identifier & 0x0F
        if frame.identifier - station == TASK:
            self._request(station, frame.data, now)
        elif frame.identifier - station == REPLY:
            self._answer(station, 'answers', now, certainty=Certainty.CERTAIN)

    def settings(self, station: int) -> dict[str, Any]:
        return {'response_numbers': [1], 'volume': 4}


class ToyProber(Prober):
    """Asks how loud it is."""

    def __init__(self, drive: DriveConfiguration) -> None:
        super().__init__(drive, [Route.of(TASK + drive.station)])

    def converse(self) -> Conversation:
        data = yield from self.ask(Question(
            encode_task(TASK, self.drive.station, Task(READ, 1)), REPLY + self.drive.station,
            shortest=5))
        return [Finding('volume', None if data is None else decode_task(data).value, 'number 1')]


# -- the family -----------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ToyOptions:
    """What only this family has."""

    volume: int = option(3, 'How loud it is.', minimum=0, maximum=11)


class Toy(Family):
    """As the frames above say."""

    name = 'toy'
    cyclic = True
    widths = frozenset((16,))
    options_type = ToyOptions
    probed = ('volume',)

    def check(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        yield from out_of_range('station', drive.station, 1, STATION_MAX, f' ({self.name})')
        for name, parameter in drive.profile.parameters.items():
            if parameter.number is None:
                yield Complaint(f'profile.parameters.{name}.number',
                                complaints.number_missing(family=self.name, most=0xFFFF))

    def claims(self, drive: DriveConfiguration) -> list[Claim]:
        return [Claim(Route.of(base + drive.station), f'{base + drive.station:03X}h')
                for base in BASES]

    def bits_per_second(self, drive: DriveConfiguration) -> float:
        return 2 * worst_bits(8, extended=False) / drive.period

    def raw_parameter(self, drive: DriveConfiguration, name: str) -> Parameter | None:
        match = re.fullmatch('p([0-9]{1,4})', name)
        return None if match is None else Parameter(name, number=int(match[1]), listed=False)

    def parts(self) -> FamilyParts:
        return FamilyParts(ToySession, ToyObserver, ToyScanner, ToyProber)


# -- simulated ------------------------------------------------------------------------------------


class SimulatedToy(SimulatedDrive):
    """Has what its profile lists."""

    def set_up(self) -> None:
        self.table = self
        self._names = {parameter.number: name
                       for name, parameter in self.registers.parameters.items()}

    def name_of(self, raw: Parameter) -> str | None:
        return self._names.get(raw.number)

    def receive(self, frame: Frame, now: float) -> bool:
        drive, base = self.configuration, frame.identifier - self.configuration.station
        if base == CYCLE:
            for parameter, word in zip(drive.cyclic_request, decode_words(frame.data)):
                self.registers.write(parameter.name, parameter.raw_from_word(word))
            self.answer(Frame(SAMPLE + drive.station, encode_words(
                self.registers.raw(each.name) for each in drive.cyclic_response), False), now)
        elif base == TASK:
            self.answer(encode_task(REPLY, drive.station, self._done(decode_task(frame.data))),
                        now)
        return base in (CYCLE, TASK)

    def _done(self, task: Task) -> Task:
        name = self._names.get(task.number)
        if name is None:
            return task._replace(function=REFUSED)
        parameter = self.registers.parameters[name]
        if task.function == WRITE:
            self.registers.write(name, parameter.raw_from_word(task.value))
        return task._replace(value=parameter.word_from_raw(self.registers.raw(name)))

    def foreign_frames(self, answer: Frame) -> Sequence[Iterable[Frame]]:
        return ((Frame(answer.identifier + 0x100, answer.data, False),),)


# -- as a program ---------------------------------------------------------------------------------


def main(arguments: Sequence[str]) -> int:
    FAMILIES['toy'] = Toy()
    SIMULATED_DRIVES['toy'] = SimulatedToy      # type: ignore[index]
    from drive_can_bridge.cli import main as front_end
    if arguments[0] != 'found':
        return front_end.main(arguments)
    from drive_can_bridge.cli.scan import tables_beside, write_parameter_file
    path = Path(arguments[1]) / 'found.yaml'
    write_parameter_file(path, BusConfiguration('main', 'virtual', 'x'), [
        Sighting('toy', 5, 'answers', Certainty.CERTAIN)], [ToyScanner().settings(5)])
    print(*tables_beside(path))
    return front_end.main(['validate', str(path)])


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
