# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The acyclic side of a DataModel drive, whatever its identifiers look like.

Requests of users, a control or status word without a slot in cyclic telegrams, stops by number.
"""

from collections.abc import Callable, Generator, Sequence
import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.drive_services import DriveServices
from drive_can_bridge.core.errors import RemoteProtocolError, Unasked
from drive_can_bridge.core.events import ForeignMasterSeen
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.parameters import Parameter, Storage
from drive_can_bridge.core.process_image import control_word, status_word
from drive_can_bridge.core.roles import Cells
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.access import SentWrites
from drive_can_bridge.protocols.acyclic_output import AcyclicOutput, Judged
from drive_can_bridge.protocols.channel import Channel
from drive_can_bridge.protocols.datamodel import procedures
from drive_can_bridge.protocols.datamodel.extended import PAYLOAD, SLOTS
from drive_can_bridge.protocols.datamodel.options import DataModelOptions
from drive_can_bridge.protocols.datamodel.procedures import Numbers
from drive_can_bridge.protocols.datamodel.setpoint_writer import ControlByNumber
from drive_can_bridge.protocols.datamodel.transactor import (
    AcyclicChannel, AcyclicCodec, ParameterRead, ParameterTransactor, ParameterWrite, Reply, Step,
    STOP_EEPROM_WAIT, Words)
from drive_can_bridge.protocols.exchange_book import stop_spacing
from drive_can_bridge.protocols.safe_stop import (
    SafeStop, StatusRead, STOP_ATTEMPTS, StopAgain, StopWrite)


class AcyclicSide:
    """
    The acyclic side of one session.

    :param codec: of the frames.
    :param quarantine: given where the exchange itself goes through the channel.
    :param invalidate: see :class:`.ControlByNumber`; ``known``, too.
    :ivar channel: everything acyclic goes through it, by the ``transactor``.
    :ivar numbers: where the parameters of the drive stand.
    :ivar control_slot: of the control word in ``cyclic_request``, or None.
    :ivar status_slot: of the status word in ``cyclic_response``, or None.
    :ivar output: what is written, and when.
    :ivar control_writer: looks after words that have no slot, or None.
    :ivar parts: what acts at times of its own.
    :ivar shows_up: something has arrived since this was reset.
    :ivar again: tells a drive to stop again that is offline and shows up.
    """

    def __init__(self, session: Session, codec: AcyclicCodec, *,
                 quarantine: float | None = None,
                 invalidate: Callable[[], None] = lambda: None,
                 known: Callable[[float], None] = lambda now: None) -> None:
        drive, options = session.configuration, session.configuration.options
        self.numbers = Numbers(drive)
        self._session = session
        self._decode = codec.decode
        self.transactor = ParameterTransactor(
            codec, send=session.outbox.put, sent=SentWrites(session.sent, self.numbers),
            retry=session.retry, eeprom_gap=options.eeprom_write_gap, quarantine=quarantine)
        self.channel: AcyclicChannel = Channel(self.transactor)
        session.services = DriveServices(session, procedures.DataModelAccess(
            self.channel, session.retry, self.numbers, verify=drive.verify_writes,
            together=codec.together))
        word = control_word(drive, controlled=session.control is not None)
        status = status_word(drive)
        # what a drive that hears a stop can be asked, where it cannot be asked what it was told
        heard = (*filter(None, (status,)), *drive.cyclic_response)
        self._witnesses = tuple(dict.fromkeys(
            self.numbers.number(each) for each in heard if each.readable))
        self.control_slot = _slot(drive.cyclic_request, word)
        self.status_slot = _slot(drive.cyclic_response, status)
        word = word if self.control_slot is None else None
        # where rounds are read, it does not come by itself in the end
        at_end = status if self.transactor.anonymous or self.status_slot is None else None
        status = status if self.status_slot is None else None
        wears = word is not None and word.storage is not Storage.RAM
        polled = self.transactor.anonymous     # else setpoints go by cycles, all at once
        self.output = AcyclicOutput(
            session.control, Judged(stop_spacing(drive.period), wears),
            len(drive.cyclic_request) if polled else 1, slot=self.control_slot if polled else None,
            refresh=options.refresh_interval if polled else 0.0)
        self.control_writer = None if session.control is None or not (word or status) else (
            ControlByNumber(session, session.control, self.channel, self.transactor, self.numbers,
                            self.output, word=word, status=status, invalidate=invalidate,
                            known=known))
        self.parts = () if self.control_writer is None else (self.control_writer,)
        self.stop: SafeStop[Step, Reply] = SafeStop(
            session, self.channel, session.stop_ended, at_end, self._read_status)
        self.shows_up = False
        self.again = StopAgain(
            session, self.channel, self.stop, lambda now: self.begin_stop(now, again=True),
            wears=wears)

    def clear(self) -> None:
        """Forget everything acyclic, and whatever waits for its outcome."""
        self.channel.clear()
        self.channel.hold(-math.inf)
        self.stop.forget()
        if self.control_writer is not None:
            self.control_writer.stop()

    # -- frames from the drive, or its address ----------------------------------------------------

    def receive(self, frame: Frame, now: float, age: float = 0.0) -> None:
        """Handle an answer that has waited for ``age``: to the outstanding read, or to nothing."""
        session, self.shows_up = self._session, True
        try:
            asked = self.transactor.outstanding
            if (asked is not None and asked.late_will_do and not self.stop.running
                    and now - age < self.transactor.asked_at):
                asked = None    # maps as they were before a stall
            words = self._decode(frame, None if asked is None else asked.key)
        except Unasked as error:
            late = self.channel.late(now, frame)
            session.report.unasked(sentences.malformed(error.sentence), late, now)
            return
        except RemoteProtocolError as error:
            session.report.reject(sentences.malformed(error.sentence))
            return
        if len(frame.data) != PAYLOAD:
            session.statistics.short += 1
        self.channel.receive(words, now)

    def foreign_master(self, frame: Frame) -> None:
        """Record a request that is not ours."""
        session = self._session
        session.report.note(ForeignMasterSeen(
            sentences.other_master_asks(session.configuration.station, str(frame))))

    # -- control and status word without a slot ---------------------------------------------------

    def found(self, now: float) -> None:
        """Record that the drive is online."""
        if self.control_writer is not None:
            self.control_writer.begin(now)
        self._session.control_changed(now)

    def withdrawn(self) -> None:
        """Record that the control word is ``disable`` again."""
        if self.control_writer is not None:
            self.control_writer.end()

    # -- stopping by acyclic writes ---------------------------------------------------------------

    def longest_stop(self, *, setpoints: bool = True) -> float:
        """
        Return how many s a stop by acyclic writes takes at most, and the read of the status then.

        :param setpoints: as for :meth:`begin_stop`.
        """
        told, answer = self._stop_writes(setpoints), self.stop.answer_time
        worn = sum(each.parameter.storage is not Storage.RAM for each in told)
        longest = ((STOP_ATTEMPTS * len(told) + 1) * answer
                   + (STOP_ATTEMPTS * worn + 1) * STOP_EEPROM_WAIT)
        if self.transactor.anonymous:   # each silence, and that of what was asked before
            silence = self.transactor.silence
            longest += self._session.retry.timeout + (STOP_ATTEMPTS + 2) * silence
        # late answers are not believed, and what others ask now may be answered late, too
        asked = {self.numbers.number(each.parameter) for each in told}.union(self._witnesses)
        return longest + answer * (1 + sum(
            self.channel.late_answers(ParameterRead(each)) for each in asked))

    def begin_stop(self, now: float, *, setpoints: bool = True, again: bool = False) -> None:
        """
        Write ``disable`` and neutral setpoints by their numbers, which no map can misroute.

        The writes go at once, whatever is under way and wherever the drive keeps the values. A
        stop that is under way goes on as it is.

        :param setpoints: False: what is in ``cyclic_request`` is stopped by cyclic frames.
        :param again: a stop before this one has failed, which was told.
        """
        stop = self.stop
        told = self._stop_writes(setpoints)
        if not told or stop.running:
            return
        writes = [(each.parameter, self.numbers.write(each.parameter, each.raw)) for each in told]
        # what is kept in RAM does not wait until an EEPROM is done
        writes.sort(key=lambda each: each[1].eeprom)
        stop.running = True     # before the first of them leaves
        for _, write in writes:
            self.transactor.write_now(write, lambda sent, then: None, now)
        stop.begin(confirm(writes, stop.answer_time, self._witnesses), now,
                   setpoints=setpoints, again=again)

    def _stop_writes(self, setpoints: bool) -> list[StopWrite]:
        return self.stop.writes(word=setpoints or self.control_slot is None, setpoints=setpoints)

    def _read_status(self, status: Parameter, timeout: float) -> StatusRead[Step, Reply]:
        words = yield ParameterRead(
            self.numbers.number(status), attempts=1, late_will_do=True, timeout=timeout)
        return None if words is None else status.raw_from_word(words[0])


def confirm(writes: Sequence[tuple[Parameter, ParameterWrite]], timeout: float,
            witnesses: Sequence[int]) -> Generator[Step, Words | None, list[Sentence]]:
    """
    Read back what stops a drive, since it is not acknowledged, and write it again as needed.

    What cannot be read is written as often as possible. A drive that answers anything behind that
    counts as one that has heard it.

    :param writes: what was written.
    :param witnesses: numbers that can be read.
    :return: what failed, in words.
    """
    blind = [each for each in writes if not each[0].readable]
    readable = wrong = [each for each in writes if each[0].readable]
    failed: list[Sentence] = []
    taken: set[ParameterWrite] = set()
    silent = True
    for attempt in range(STOP_ATTEMPTS):
        for each in (*blind, *wrong) if attempt else ():
            if (yield each[1]) is not None:
                taken.add(each[1])
        late_answers, failed, silent = wrong, [], False
        wrong = []
        for parameter, write in late_answers:
            reply = None if silent else (yield ParameterRead(
                write.number, attempts=1, late_will_do=True, timeout=timeout))
            silent = reply is None
            if reply == write.words:
                continue
            wrong.append((parameter, write))
            what = f'{parameter.name} ({parameter.address})'
            failed.append(sentences.write_unanswered(what) if reply is None else
                          sentences.write_read_back(what, reply[0], write.words[0]))
        if not wrong and not blind:
            return failed
    if not late_answers:    # nothing was read behind the last write
        silent = True
        numbers = *(write.number for _, write in readable), *witnesses
        # the first one twice: its answer may be late
        for number in (*numbers[:1], *numbers)[:STOP_ATTEMPTS]:
            silent = (yield ParameterRead(
                number, attempts=1, late_will_do=True, timeout=timeout)) is None
            if not silent:
                break
    for parameter, write in blind:
        what = f'{parameter.name} ({parameter.address})'
        if write not in taken:
            failed.append(sentences.write_not_taken(what))
        elif silent:
            failed.append(sentences.write_unanswered(what))
    return failed


def _slot(parameters: tuple[Parameter, ...], parameter: Parameter | None) -> int | None:
    return parameters.index(parameter) if parameter in parameters else None


def map_cells(options: DataModelOptions) -> Cells:
    """Return the mapping parameters: numbers of the profile."""
    return frozenset(base + slot for slot in range(SLOTS)
                     for base in (options.request_map_base, options.response_map_base))
