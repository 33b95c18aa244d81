# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The conversation with one DataModel drive that uses 11-bit identifiers.

There is no cyclic service: once a period all of ``cyclic_response`` is read in one round, and what
changed in ``cyclic_request`` is written, one parameter a frame. Rounds go on while the drive is
silent; that is how it is found. Setpoints are written only to a drive that answers. One that was
lost, or is to be left alone, is written neutral and read back (:mod:`.stop_writes`).

Setpoints do not wait for answers: they go out while a read is under way, or in quarantine.
"""

from enum import Enum
import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.events import ForeignMasterSeen, ProcessDataReceived
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.roles import Roles
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.datamodel import standard
from drive_can_bridge.protocols.datamodel.acyclic_side import AcyclicSide, map_cells
from drive_can_bridge.protocols.datamodel.channel import Polling, Procedure, Read, Write
from drive_can_bridge.protocols.datamodel.standard_round import places, reads
from drive_can_bridge.protocols.datamodel.stop_writes import ANSWER_TIME, ATTEMPTS
from drive_can_bridge.protocols.exchange_book import ExchangeBook
from drive_can_bridge.protocols.polling import Chunk, Round, WriteSchedule

SILENT = 'no answer to reads: drive silent, wrong station, bit rate or identifier mode'


class Phase(Enum):
    """What the session is doing."""

    IDLE = 'idle'
    POLLING = 'polling'
    STOPPING = 'last neutral setpoints'


class StandardSession(Session):
    """Rounds of reads, setpoints on change, and the acyclic frames between them."""

    def __init__(self, drive: DriveConfiguration) -> None:
        table, options = drive.profile.control, drive.options
        control = None if table is None else ControlMachine(table, timeout=drive.control_timeout)
        super().__init__(drive, control, roles=Roles(
            drive, controlled=table is not None, maps=map_cells(options)))
        request = standard.identifier(options.request_id_base, drive.station)
        self._side = AcyclicSide(
            self,
            encode_read=lambda number, count: standard.encode_read_request(
                request, number, count),
            encode_write=lambda number, words: standard.encode_write(request, number, *words),
            together=1, stop_ended=self._stop_ended, polling=Polling(options.quarantine))
        self._channel = self._side.channel
        self._control_slot, self._status_slot = self._side.control_slot, self._side.status_slot
        self._request_identifier = request
        self._identifiers = request, standard.identifier(
            options.response_id_base, drive.station)
        self._strict: bool = options.length_policy == 'strict'
        self._places = places(drive)
        self._reads = reads(drive)
        self._status_read = None if self._status_slot is None else next(
            chunk for chunk in self._reads if chunk.address
            <= self._places[self._status_slot].address < chunk.address + chunk.size)
        self._writes = WriteSchedule(len(drive.cyclic_request), options.refresh_interval)
        self._phase = Phase.IDLE
        self._book = ExchangeBook(drive, self.statistics)
        self._timer = self._book.timer
        self._in_round = False
        self._void = False  # this round began before the process stood still
        self._status_asked_at = -math.inf
        self._word_written_at = -math.inf
        self._pulse_at = math.inf  # when the control word is due again, whatever it was
        self._received_at = -math.inf
        self._expected = False  # the answer of a read that nobody wants any more may come
        self._doubt = False  # a read went unanswered since the status was read
        self._gap = ''  # what the last round asked for in vain, though others were answered

    # -- life cycle -------------------------------------------------------------------------------

    def prepare_stop(self, now: float) -> bool:
        self._clear_acyclic()
        owes = self._phase is not Phase.IDLE and (self.online or self.told.owed)
        if owes:
            self._phase = Phase.STOPPING
        return owes

    def begin_stop(self, now: float) -> bool:
        self._timer.stop()
        self._writes.forget()
        self._side.begin_stop(now)
        return self._side.stop.running

    def _stop_ended(self) -> None:
        if self._phase is Phase.STOPPING:
            self.go_idle('deactivated')

    @property
    def stopped(self) -> bool:
        return self._phase is Phase.IDLE

    @property
    def longest_stop(self) -> float:
        return ATTEMPTS * (ANSWER_TIME + float(self.configuration.options.quarantine))

    def time_lost(self, now: float) -> None:
        self._expected = self._expected or self._channel.outstanding is not None
        self._void = self._in_round
        self._channel.time_lost(now)
        if self._phase is Phase.POLLING:
            self.stood_still(now)
            self._timer.start(now)

    def begin(self, now: float) -> None:
        self.report.advice = SILENT
        self._gap = ''
        self._phase = Phase.POLLING
        self._book.missed_in_row = 0
        self._tell_to_stop(now)
        self._timer.start(now)

    def lost(self, now: float, *, was_online: bool) -> None:
        self._tell_to_stop(now, was_online)

    def _tell_to_stop(self, now: float, was_online: bool = False) -> None:
        """See that a drive stands still that may only have lost its voice, if it may run."""
        self._writes.forget()
        if self.bus_available and (was_online or self.told.owed):
            self._side.begin_stop(now)

    def go_idle(self, advice: str) -> None:
        self._phase = Phase.IDLE
        self._timer.stop()
        self._writes.forget()
        self.setpoints.allow(False)
        self._clear_acyclic()
        self.be_offline(advice)

    def _clear_acyclic(self) -> None:
        self._expected = self._expected or self._channel.outstanding is not None
        self._side.clear()
        self._in_round = False

    # -- the beat ---------------------------------------------------------------------------------

    def handle_timer(self, now: float) -> None:
        if now >= self._timer.due:
            self._tick(now)
        if now >= self._pulse_at and self._control_slot is not None:
            self._pulse_at = math.inf
            self._writes.failed(self._control_slot)
            self.see_to_control_word(now)
        self._write_setpoint(now)
        self._side.handle_timer(now)
        if now >= self._channel.next_timer():
            self._channel.advance(now)

    def next_timer(self) -> float:
        soonest = min(self._timer.due, self._pulse_at, self._channel.next_timer(),
                      self._side.next_timer())
        return min(soonest, self._channel.courier.free_at) if self._writes.waiting else soonest

    def _tick(self, now: float) -> None:
        """Begin a period: look what is to be written, then read."""
        if self.online:
            self.gate.expire(now)
            self._look(now, unanswered=self._in_round)
        if not self._in_round:
            self._book.begin(now)
            self._in_round = True
            self._void = False
            self._write_setpoint(now)  # before the first read
            self._channel.run(self._round(), self._round_done, now)
            return
        self._timer.begun(now)
        if now - self._book.began_at > self._patience:
            self._miss(now)  # somebody keeps disturbing; nothing was read for too long

    @property
    def _patience(self) -> float:
        """Return what a round may take when a read of a user and one of its own go unanswered."""
        return 2 * (self.configuration.period + self.configuration.parameter_timeout
                    + float(self.configuration.options.quarantine))

    # -- setpoints --------------------------------------------------------------------------------

    def _raws(self) -> list[int]:
        raws = [setpoint.raw for setpoint in self.setpoints.items]
        if self.control is not None and self._control_slot is not None:
            raws.insert(self._control_slot, self.control.word)
        return raws

    def _neutral_raws(self) -> list[int]:
        raws = [setpoint.neutral for setpoint in self.setpoints.items]
        if self.control is not None and self._control_slot is not None:
            raws.insert(self._control_slot, self.control.table.disable)
        return raws

    def _look(self, now: float, *, unanswered: bool = False) -> None:
        """
        Find out what is to be written.

        :param unanswered: what was asked a period ago still waits for its answer.
        """
        control = self.control
        # nobody knows whether the drive was off meanwhile: it is not started by a repetition
        doubt = (self._doubt or unanswered) and control is not None and not (
            control.at_rest or control.stopping)
        hold = [self._control_slot] if doubt else []
        hold += [index for index, parameter in enumerate(self.configuration.cyclic_request)
                 if parameter.name in self.setpoints.unknown]
        self._writes.look(self._raws(), now, hold=hold)

    def _write_setpoint(self, now: float) -> None:
        """Write one that is due, if there is one, with the value that it has now."""
        if not self._writes.waiting or now < self._channel.courier.free_at:
            return
        index = self._writes.next()
        parameter, raw = self.configuration.cyclic_request[index], self._raws()[index]
        # now: a neutral value that follows the axis may be another one when the frame leaves
        runs = raw != self._neutral_raws()[index]
        # What is sent cyclically is volatile: EEPROM parameters are refused by the configuration.
        self._channel.courier.write(
            Write((parameter.number or 0) + self._side.offset, (parameter.word_from_raw(raw),),
                  eeprom=False),
            lambda sent, then: self._written(index, raw, sent, then, runs=runs), now)
        self._writes.written(index, raw, now)  # at once: a look meanwhile must not find it due

    def _written(self, index: int, raw: int, sent: bool, now: float, *, runs: bool) -> None:
        """Take note of a setpoint, or control word, that left; the refused ones are due again."""
        if not sent:
            self._writes.failed(index)
            return
        self.told.note(index, runs=runs)
        control = self.control
        if index != self._control_slot or control is None:
            return
        self._word_written_at = now
        if raw == control.word:
            control.word_sent(now)
            if control.pulsing:
                self._pulse_at = now + self._timer.stop_spacing
            self.control_changed(now)

    def see_to_control_word(self, now: float) -> None:
        if self.control is None or not self.online or self._phase is not Phase.POLLING:
            return
        if self._control_slot is not None:
            # a stop does not wait for the next period, nor for setpoints
            self._look(now)
            if self.control.stopping or not self.setpoints.held:
                self._writes.hurry(self._control_slot)
            self._write_setpoint(now)
        elif self._side.control_writer is not None:
            self._side.control_writer.update(now)
            if self.control.stopping:   # setpoints stop with it, and not a period later
                self._look(now)
                self._write_setpoint(now)

    # -- rounds -----------------------------------------------------------------------------------

    def _round(self) -> Procedure:
        result = Round(self._places)
        for chunk in self._reads:
            words = yield Read(chunk.address, chunk.size, attempts=1)
            if words is None:
                self._gap = '' if chunk is self._reads[0] else (
                    f'no answer to the read of {self._names(chunk)}, though others are answered: '
                    f'does this drive have it')
                return None
            if chunk is self._status_read:
                self._status_asked_at = self._channel.courier.asked_at
            result.take(chunk, words)
        return tuple(
            parameter.raw_from_word(word)
            for parameter, (word,) in zip(self.configuration.cyclic_response, result.words()))

    def _names(self, chunk: Chunk) -> str:
        """Name what a read is for."""
        numbers = range(chunk.address, chunk.address + chunk.size)
        return ', '.join(f'{parameter.name} ({parameter.address})'
                         for parameter, place in zip(
                             self.configuration.cyclic_response, self._places)
                         if place.address in numbers)

    def _round_done(self, raws: tuple[int, ...] | None) -> None:
        now = self._channel.now
        self._in_round = False
        if self._void:
            return
        if raws is None:
            self._miss(now)
            return
        self._doubt = False
        self._book.answered(self._received_at)
        if not self.online:
            self.gate.measured(raws)    # before anything is written
            self._found(now)
        # a status that was asked for before the word left says nothing about the word
        if (self.control is not None and self._status_slot is not None
                and self._status_asked_at > self._word_written_at):
            self.control.status_received(raws[self._status_slot], now)
            self.control_changed(now)
        self.gate.measured(raws)
        self.report.note(ProcessDataReceived(raws, self._received_at))

    def _found(self, now: float) -> None:
        self.be_online()
        self._writes.forget()
        self._look(now)
        self._side.found(now)

    def _miss(self, now: float) -> None:
        too_many = self._book.missed()
        self._doubt = True
        if not self.online:
            self.report.advice = self._gap or SILENT
        elif too_many:
            reason = f'no complete round of reads for {self.configuration.missed_limit} periods'
            self.lose(f'{reason}: {self._gap}' if self._gap else reason, now)

    # -- control ----------------------------------------------------------------------------------

    def withdrawn(self, now: float) -> None:
        super().withdrawn(now)
        self._side.withdrawn()

    def facts(self) -> dict[str, str]:
        return {'short_frames': str(self.statistics.short)}

    # -- frames from the drive --------------------------------------------------------------------

    def receive_frame(self, frame: Frame, now: float, age: float = 0.0) -> None:
        if frame.extended or frame.identifier not in self._identifiers:
            self.report.reject(f'{frame}: of somebody else')
            return
        if frame.identifier == self._request_identifier:
            self.report.note(ForeignMasterSeen(
                f'another master sends requests to station {self.configuration.station}: {frame}'))
            return
        step = self._channel.outstanding
        # it may have come before the question
        if step is None or now - age < self._channel.courier.asked_at:
            self._channel.disturbed(now)
            if self._expected:
                self._expected = False
            else:
                self.report.reject(f'{frame}: nobody asked for it')
            return
        try:
            words = standard.decode_read_response(frame, step.count, strict=self._strict)
        except RemoteProtocolError as error:
            self.report.reject(str(error))
            return
        if len(frame.data) != standard.PAYLOAD:
            self.statistics.short += 1
        self._received_at = now - age
        self._channel.receive(words, now)
