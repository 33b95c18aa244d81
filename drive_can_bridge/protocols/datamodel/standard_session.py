# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The conversation with one DataModel drive that uses 11-bit identifiers.

There is no cyclic service: once a period all of ``cyclic_response`` is read in one round, and what
changed in ``cyclic_request`` is written, one parameter a frame. Rounds go on while the drive is
silent; that is how it is found. Setpoints are written only to a drive that answers
(:mod:`.setpoint_writer`). One that was lost, or is to be left alone, is written neutral and read
back (:mod:`.stop_writes`).
"""

from enum import Enum
import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.events import ProcessDataReceived
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.roles import Roles
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.datamodel import standard
from drive_can_bridge.protocols.datamodel.acyclic_side import AcyclicSide, map_cells
from drive_can_bridge.protocols.datamodel.channel import Polling
from drive_can_bridge.protocols.datamodel.setpoint_writer import SetpointWriter
from drive_can_bridge.protocols.datamodel.standard_round import StandardRound
from drive_can_bridge.protocols.datamodel.stop_writes import ANSWER_TIME, ATTEMPTS
from drive_can_bridge.protocols.exchange_book import ExchangeBook

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
        strict: bool = options.length_policy == 'strict'
        self._side = AcyclicSide(
            self,
            encode_read=lambda number, count: standard.encode_read_request(
                request, number, count),
            encode_write=lambda number, words: standard.encode_write(request, number, *words),
            decode=lambda frame, step: standard.decode_read_response(
                frame, step.count if step else 0, strict=strict),
            together=1, stop_ended=self._stop_ended, polling=Polling(options.quarantine))
        self._channel = self._side.channel
        self._status_slot = self._side.status_slot
        self._request_identifier = request
        self._identifiers = request, standard.identifier(
            options.response_id_base, drive.station)
        self._round = StandardRound(drive, self._channel.courier, self._status_slot)
        self._writer = SetpointWriter(self, self._side)
        self._phase = Phase.IDLE
        self._book = ExchangeBook(drive, self.statistics)
        self._timer = self._book.timer
        self._in_round = False
        self._void = False  # this round began before the process stood still
        self._received_at = -math.inf
        self._expected = False  # the answer of a read that nobody wants any more may come

    # -- life cycle -------------------------------------------------------------------------------

    def prepare_stop(self, now: float) -> bool:
        self._clear_acyclic()
        self.told.doubt()   # should the stop be confirmed, that is over
        owes = self._phase is not Phase.IDLE and (self.online or self.told.owed)
        if owes:
            self._phase = Phase.STOPPING
        return owes

    def begin_stop(self, now: float) -> bool:
        self._timer.stop()
        self._writer.forget()
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
        self._round.gap = ''
        self._phase = Phase.POLLING
        self._book.missed_in_row = 0
        self._tell_to_stop(now)
        self._timer.start(now)

    def lost(self, now: float, *, was_online: bool) -> None:
        self.told.doubt()
        self._tell_to_stop(now, was_online)

    def _tell_to_stop(self, now: float, was_online: bool = False) -> None:
        """See that a drive stands still that may only have lost its voice, if it may run."""
        self._writer.forget()
        if self.bus_available and (was_online or self.told.owed):
            self._side.begin_stop(now)

    def go_idle(self, advice: str) -> None:
        self._phase = Phase.IDLE
        self._timer.stop()
        self._writer.forget()
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
        self._writer.handle_timer(now)
        self._side.handle_timer(now)
        if now >= self._channel.next_timer():
            self._channel.advance(now)

    def next_timer(self) -> float:
        return min(self._timer.due, self._channel.next_timer(), self._side.next_timer(),
                   self._writer.next_timer())

    def _tick(self, now: float) -> None:
        """Begin a period: look what is to be written, then read."""
        if self.online:
            self.gate.expire(now)
            self._writer.look(now, unanswered=self._in_round)
        if not self._in_round:
            self._book.begin(now)
            self._in_round = True
            self._void = False
            self._writer.write(now)  # before the first read
            self._channel.run(self._round.read(), self._round_done, now)
            return
        self._timer.begun(now)
        if now - self._book.began_at > self._patience:
            self._miss(now)  # somebody keeps disturbing; nothing was read for too long

    @property
    def _patience(self) -> float:
        """Return what a round may take when a read of a user and one of its own go unanswered."""
        return 2 * (self.configuration.period + self.configuration.parameter_timeout
                    + float(self.configuration.options.quarantine))

    def see_to_control_word(self, now: float) -> None:
        control, by_number = self.control, self._side.control_writer
        if control is None or not self.online or self._phase is not Phase.POLLING:
            return
        if by_number is not None:
            by_number.update(now)
        if self._side.control_slot is not None or by_number is not None and control.stopping:
            self._writer.write_word(now)    # setpoints stop with it, and not a period later

    # -- rounds -----------------------------------------------------------------------------------

    def _round_done(self, raws: tuple[int, ...] | None) -> None:
        now = self._channel.now
        self._in_round = False
        if self._void:
            return
        if raws is None:
            self._miss(now)
            return
        self._writer.doubt = False
        self._book.answered(self._received_at)
        courier = self._channel.courier
        if self.online and self.told.ran and courier.asked_at > courier.wrote_at:
            self.told.answered()
        if not self.online:
            self.gate.measured(raws)    # before anything is written
            self._found(now)
        # a status that was asked for before the word left says nothing about the word
        if (self.control is not None and self._status_slot is not None
                and self._round.status_asked_at > self._writer.word_written_at):
            self.control.status_received(raws[self._status_slot], now)
            self.control_changed(now)
        self.gate.measured(raws)
        self.report.note(ProcessDataReceived(raws, self._received_at))

    def _found(self, now: float) -> None:
        self.be_online()
        self._writer.forget()
        self._writer.look(now)
        self._side.found(now)

    def _miss(self, now: float) -> None:
        too_many = self._book.missed()
        self._writer.doubt = True
        if not self.online:
            self.report.advice = self._round.gap or SILENT
        elif too_many:
            reason = f'no complete round of reads for {self.configuration.missed_limit} periods'
            self.lose(': '.join(filter(None, (reason, self._round.gap))), now)

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
            self._side.foreign_master(frame)
            return
        channel = self._channel
        # it may have come before the question
        if channel.outstanding is None or now - age < channel.courier.asked_at:
            channel.disturbed(now)
            if self._expected:
                self._expected = False
            else:
                self.report.reject(f'{frame}: nobody asked for it')
            return
        self._received_at = now - age
        self._side.receive(frame, now)
