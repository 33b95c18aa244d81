# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The conversation with one DataModel drive that uses 11-bit identifiers.

There is no cyclic service: once a period all of ``cyclic_response`` is read in one round, and what
changed in ``cyclic_request`` is written, one parameter a frame. Rounds go on while the drive is
silent; that is how it is found. Setpoints are written only to a drive that answers
(:mod:`.setpoint_writer`). One that was lost, or is to be left alone, is written neutral and read
back (:mod:`.acyclic_side`).
"""

import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.roles import Roles
from drive_can_bridge.core.session import Session, Stage
from drive_can_bridge.core.stop_duty import Do, Happened
from drive_can_bridge.protocols.datamodel import standard
from drive_can_bridge.protocols.datamodel.acyclic_side import AcyclicSide, map_cells
from drive_can_bridge.protocols.datamodel.setpoint_writer import SetpointWriter
from drive_can_bridge.protocols.datamodel.standard_round import StandardRound
from drive_can_bridge.protocols.datamodel.transactor import Procedure
from drive_can_bridge.protocols.polled_exchange import PolledExchange, Raws


class StandardSession(Session):
    """Rounds of reads, setpoints on change, and the acyclic frames between them."""

    present = True

    def __init__(self, drive: DriveConfiguration) -> None:
        table, options = drive.profile.control, drive.options
        control = None if table is None else ControlMachine(table, timeout=drive.control_timeout)
        super().__init__(drive, control, roles=Roles(
            drive, controlled=table is not None, maps=map_cells(options)))
        request = standard.identifier(options.request_id_base, drive.station)
        strict: bool = options.length_policy == 'strict'
        self._side = AcyclicSide(
            self, standard.StandardAcyclicCodec(request, strict), quarantine=options.quarantine,
            known=self._status_known)
        self._channel = self._side.channel
        self._status_slot = self._side.status_slot
        self._request_identifier = request
        self._identifiers = request, standard.identifier(
            options.response_id_base, drive.station)
        self._round = StandardRound(drive, self._side.transactor, self._status_slot)
        self._exchange = PolledExchange(self, self, self._channel)
        self._timer = self._exchange.timer
        self._writer = SetpointWriter(
            self, self._exchange, self._side.transactor, self._side.numbers, self._side.output,
            slot=self._side.control_slot)
        self.set_parts(self._writer, *self._side.parts, channel=self._channel)
        self._expected = False  # the answer of a read that nobody wants any more may come
        self._missed = False            # a round, since the last one that was answered
        self._heard_at = -math.inf      # when that was asked for

    # -- life cycle -------------------------------------------------------------------------------

    def prepare_stop(self, now: float) -> bool:
        self._clear_acyclic()
        self.duty.happened(Happened.SILENT)     # should the stop be confirmed, that is over
        pending = self.duty.happened(Happened.ENDS) is Do.STOP
        return self.stage is not Stage.IDLE and (self.online or pending)

    def begin_stop(self, now: float) -> bool:
        self._writer.stop()
        self._side.begin_stop(now)
        return self._side.stop.running

    @property
    def longest_stop(self) -> float:
        return self._side.longest_stop()

    def handle_stall(self, now: float) -> None:
        self._expected = self._expected or self._side.transactor.outstanding is not None
        self._exchange.disregard()
        self._channel.handle_stall(now)
        if self.stage is Stage.RUNNING:
            self.lose_after_stall(now)
            self._timer.start(now)

    def begin(self, now: float) -> None:
        self.report.guess(sentences.reads_unanswered())
        self._round.gap = NOTHING
        self._command_stop(now, self.duty.happened(Happened.STARTED))
        self._timer.start(now)

    def lost(self, now: float, *, was_online: bool) -> None:
        self.duty.happened(Happened.SILENT)     # it may only have lost its voice
        do = self.duty.happened(Happened.LOST)
        self._command_stop(now, Do.STOP if was_online else do)

    def _command_stop(self, now: float, do: Do) -> None:
        self._writer.stop()
        if self.bus_available and do is Do.STOP:
            self._side.begin_stop(now)

    def fall_silent(self) -> None:
        self._clear_acyclic()
        super().fall_silent()

    def _clear_acyclic(self) -> None:
        self._expected = self._expected or self._side.transactor.outstanding is not None
        self._side.clear()
        self._exchange.stop()

    # -- the beat ---------------------------------------------------------------------------------

    def handle_timer(self, now: float) -> None:
        if self.interlock.expire(now):
            self._writer.collect_due(now, unanswered=self._exchange.reading)
        if now >= self._timer.due:
            self._tick(now)
        super().handle_timer(now)

    def next_timer(self) -> float:
        return min(self._timer.due, self.setpoints.expires_at, super().next_timer())

    def _tick(self, now: float) -> None:
        """Begin a period: write what is due, then read."""
        if self.online:
            self._writer.collect_due(now, unanswered=self._exchange.reading)
            by_number = self._side.control_writer
            if by_number is not None and self._writer.wants_status(now):
                by_number.poll_soon(now)
        if self._exchange.reading:
            self._exchange.wait(now, self._patience)    # somebody may keep disturbing
            return
        self._writer.write(now)  # before the first read
        self._exchange.begin(now)

    @property
    def _patience(self) -> float:
        """
        Return what a round may take: a read of a user and one of its own may go unanswered.

        Behind a write to the EEPROM it waits: what we do not ask for is not missed.
        """
        drive = self.configuration
        return float(drive.options.eeprom_write_gap) + 2 * (
            drive.period + drive.parameter_timeout + float(drive.options.quarantine))

    def hand_out_neutral(self, now: float) -> None:
        self._writer.write_all(now)

    def update_control_word(self, now: float) -> None:
        control, by_number = self.control, self._side.control_writer
        if control is None or not self.online or self.stage is not Stage.RUNNING:
            return
        waits = self._writer.holds_word(now)
        if by_number is not None and not waits:
            by_number.update(now)
        if self._side.control_slot is not None or waits or control.stopping:
            self._writer.write_word(now)    # setpoints stop with it, and not a period later

    # -- rounds -----------------------------------------------------------------------------------

    def read_round(self) -> Procedure[Raws | None]:
        return self._round.read()

    def round_found(self, now: float) -> None:
        self.be_online()
        self._writer.stop()
        self._writer.collect_due(now)
        self._side.found(now)

    def round_answered(self, raws: Raws, now: float, *, found: bool) -> None:
        transactor = self._side.transactor
        missed, self._missed = self._missed, False
        since, self._heard_at = self._heard_at, transactor.asked_at
        # what left while rounds were missed, the drive may have missed, too
        if not found and not (missed and self._writer.write_again(since, now)) and (
                transactor.asked_at > transactor.wrote_at):
            self.neutral_stop.answered()
            self.duty.happened(Happened.ANSWERED)
        if self.control is None:
            return
        asked_at = self._round.status_asked_at
        if self._status_slot is None:
            if self._side.control_writer is None:   # which looks at it otherwise
                self._status_known(now)
        elif asked_at > self.control.word_left_at:
            self.interlock.status(raws[self._status_slot], now)
            self.control_changed(now)
            if transactor.is_news(asked_at, now):
                self._status_known(now)

    def _status_known(self, now: float) -> None:
        """Write a word that may start the drive: its status was read just now, or it has none."""
        if self._side.control_slot is not None and self.online and self.stage is Stage.RUNNING:
            self._writer.write_word(now, known=True)

    def exchange_missed(self, reason: Sentence, now: float) -> None:
        self._missed = True
        if not self.online:
            self.report.guess(sentences.reads_unanswered(), unless=self._round.gap)
        elif reason:
            gap = self._round.gap
            self.lose(sentences.lost_because(reason, gap) if gap else reason, now)

    # -- control ----------------------------------------------------------------------------------

    def withdrawn(self, now: float) -> None:
        super().withdrawn(now)
        self._side.withdrawn()

    def facts(self) -> dict[str, str]:
        return {'short_frames': str(self.statistics.short)}

    # -- frames from the drive --------------------------------------------------------------------

    def receive_frame(self, frame: Frame, now: float, age: float = 0.0) -> None:
        if frame.extended or frame.identifier not in self._identifiers:
            self.report.reject(sentences.of_somebody_else(str(frame)))
            return
        if frame.identifier == self._request_identifier:
            self._side.foreign_master(frame)
            return
        self._side.again.sign_of_life(now)
        transactor = self._side.transactor
        # it may have come before the question
        if transactor.outstanding is None or now - age < transactor.asked_at:
            self._channel.disturbed(now)
            late = self._channel.late(now - age)
            if late is not None or not self._expected:
                self.report.unasked(sentences.nobody_asked(str(frame)), late, now)
            self._expected = False
            return
        self._exchange.received_at = now - age
        self._side.receive(frame, now)
