# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The conversation with one CANnord inverter, as far as it is told and asked by itself.

.. code-block:: text

    IDLE ──activate, bus up──► CYCLING: control word and setpoints every period; the inverter
      ▲                           │     answers each frame with status word and actual values
      └─3 neutral cycles──deactivate

An inverter that does not answer is offline after ``missed_limit`` frames; it goes on being sent
047Eh ("ready") with neutral setpoints, which is how it is found again.

Beyond answers, an inverter sends its process data once by itself when a fault occurs. Such a frame
is a sample like any other. Tasks of the parameter channel go out whenever there is one, process
data beside them: lower identifiers win on the bus.
"""

from collections.abc import Sequence
from dataclasses import replace

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction, ControlRequest
from drive_can_bridge.core.drive_services import DriveServices
from drive_can_bridge.core.errors import RemoteProtocolError, Unasked
from drive_can_bridge.core.events import Event, ForeignMasterSeen
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.process_image import ProcessImage
from drive_can_bridge.core.requests import Outcomes, Request
from drive_can_bridge.core.roles import publish_it, Roles
from drive_can_bridge.core.session import Session, Stage
from drive_can_bridge.core.stop_duty import Do, Happened
from drive_can_bridge.protocols.answers import CycleAnswers
from drive_can_bridge.protocols.cannord import procedures
from drive_can_bridge.protocols.cannord.control_words import make_control
from drive_can_bridge.protocols.cannord.group import Group, GroupMember
from drive_can_bridge.protocols.cannord.identifiers import broadcasts, identifier, MessageObject
from drive_can_bridge.protocols.cannord.monitoring import TimeoutWatch
from drive_can_bridge.protocols.cannord.parameter_frame import ParameterLayout
from drive_can_bridge.protocols.cannord.process_data import decode_main, EXTRA_LENGTH, Samples
from drive_can_bridge.protocols.cannord.states import (
    CONTROL_PARAMETER, is_faulted, STATUS_PARAMETER)
from drive_can_bridge.protocols.cannord.transactor import TaskChannel, TaskTransactor

_SILENCE = 'no answer to process data'
_ADVICE = 'drive silent, wrong station, bit rate or identifier format, or P509 not set to CAN'


def make_group(drives: Sequence[DriveConfiguration]) -> list['CannordSession']:
    """
    Make the sessions of a broadcast group.

    :param drives: the leader first.
    """
    group = Group(drives)
    return [CannordSession(drive, group) for drive in drives]


class CannordSession(Session):
    """
    Process data, parameter tasks, and the state of one inverter.

    :param group: those that are told the same. Of the inverters that another one leads, all but
        the parameters is only listened to.
    """

    def __init__(self, drive: DriveConfiguration, group: Group | None = None) -> None:
        options = drive.options
        self._group = group = group or Group([drive])
        self._led = drive.name != group.leads
        self._machine = group.control if not self._led else make_control(
            parameter_set=options.parameter_set, timeout=drive.control_timeout)
        image = ProcessImage.of(
            drive, controlled=True, word=(CONTROL_PARAMETER,), status=(STATUS_PARAMETER,))
        super().__init__(
            drive, self._machine, image=replace(image, setpoints=()) if self._led else image,
            roles=Roles(drive, controlled=True, cells=procedures.cells,
                        refusal=procedures.write_refusal,
                        cyclic_refusal=group.cyclic_refusal if self._led else publish_it),
            leader=group.control)
        self.enabled_by = group.leads
        self._faulted = False
        self._extended: bool = options.extended_identifiers
        request_identifier, self._response_identifier, task_identifier, \
            self._task_response_identifier = (
                identifier(kind, drive.station, extended=self._extended)
                for kind in MessageObject)
        self._swap: bool = options.swap_setpoints_2_3
        self._samples = Samples(self)
        self._transactor = TaskTransactor(
            ParameterLayout(options.value_order, options.index_byte), self.outbox,
            task_identifier, extended=self._extended, retry=self.retry)
        self._channel = TaskChannel(self._transactor)
        access = procedures.TaskAccess(
            self._channel, self.retry, samples=self._samples, persist=options.persist_writes,
            signed=procedures.signed_cells(drive.profile.parameters.values()))
        # what only a master sends
        self._masters = request_identifier, task_identifier
        self._broadcasts = broadcasts(drive.station, extended=self._extended)
        self._timeout = TimeoutWatch(drive, access, self.report)
        self.services = DriveServices(self, access)
        self._answers = CycleAnswers(self, silence=_SILENCE, advice=_ADVICE,
                                     in_turn=not group.alone)
        group.join(GroupMember(self, request_identifier, self._answers, self._samples))
        self._cycles = self._answers if self._led else group.exchange
        self.set_parts(self._cycles, channel=self._channel)

    # -- life cycle -------------------------------------------------------------------------------

    def begin(self, now: float) -> None:
        self._cycles.stop()
        self._forget_samples()
        self._group.forget(self)
        stop_pending = self.duty.happened(Happened.STARTED) is Do.STOP
        if not self._led:   # its cycles are for all
            self._group.exchange.start(now)
            if stop_pending:
                self._group.exchange.timer.hurry(now)

    def prepare_stop(self, now: float) -> bool:
        self._group.end(self.defect or sentences.bridge_inactive(), now)
        return super().prepare_stop(now)

    def begin_stop(self, now: float) -> bool:
        if not self._led:   # else it ends with the last cycles of all
            self._group.exchange.stop_soon(now)
        return True

    @property
    def longest_stop(self) -> float:
        return self._group.exchange.longest_stop

    def fall_silent(self) -> None:
        super().fall_silent()
        self._forget_samples()

    def _forget_samples(self) -> None:
        self._answers.book.stale += self._samples.expect_nothing()

    def went_offline(self) -> None:
        self._samples.forget()
        self._timeout.warning = NOTHING
        self._group.lost(self)

    # -- process data, sending --------------------------------------------------------------------

    def update_control_word(self, now: float) -> None:
        if not self._led:
            self._group.exchange.hurry(now, setpoints=self.stop_pending)

    def exchange_missed(self, reason: Sentence, now: float) -> None:
        self._answers.lose(reason, now)

    def exchange_ended(self) -> None:
        if self._group.extra:
            self._samples.settle()

    # -- process data, receiving ------------------------------------------------------------------

    def receive_frame(self, frame: Frame, now: float, age: float = 0.0) -> None:
        received, data, extended = frame
        try:
            if extended != self._extended:
                self.report.reject(sentences.not_of_this_drive(str(frame)))
            elif received == self._response_identifier:
                if len(data) == EXTRA_LENGTH:
                    self._receive_extra(data)
                else:
                    self._receive_main(data, now, now - age)
                    if self.stage is Stage.STOPPING:
                        self._group.exchange.wait_out(now)
            elif received == self._task_response_identifier:
                self._channel.receive(data, now)
            elif received in self._masters:
                self.report.note(ForeignMasterSeen(
                    sentences.other_master(self.configuration.station, str(frame))))
            elif received in self._broadcasts:
                self.report.note(ForeignMasterSeen(
                    sentences.other_master_broadcasts(self.configuration.station, str(frame))))
            else:
                self.report.reject(sentences.not_of_this_drive(str(frame)))
        except Unasked as error:
            self.report.unasked(sentences.malformed(error.sentence), self._channel.late(
                now - age, data), now)
        except RemoteProtocolError as error:
            self.report.reject(sentences.malformed(error.sentence))

    def _receive_main(self, data: bytes, now: float, received_at: float) -> None:
        """Handle status word and actual values. The fast path of the reader."""
        word, values = decode_main(data, swap=self._swap)
        self._faulted = is_faulted(word)
        answers = self._answers
        asked = answers.wanted
        if asked:
            answers.answered(received_at)
        elif not (self._faulted and self.online):
            # a fault while offline is told again by the first exchange
            if not self._faulted:
                answers.expects('process data', now, received_at)
            return
        if not self.online and self.stage is Stage.RUNNING:
            self.be_online()
            self._timeout.poll(now)
            self._group.found(self)
        if asked and self._faulted and not self._machine.fault:
            answers.book.stale = 1      # it may have been told unasked: then the answer follows
        if self._led:
            self._machine.status_received(word, now)
            self.control_changed(now)
        self._group.status(self, word, now)
        if not self.online:         # found again by a stop
            return
        if self._samples.take(word, values, received_at, asked=asked) and asked and (
                len(data) < self._group.length):
            self.statistics.short += 1

    def _receive_extra(self, data: bytes) -> None:
        """Handle actual values 4 and 5."""
        if self._samples.awaiting:
            self._samples.take_extra(data)
        elif not self._answers.book.take_stale():
            self.report.reject(sentences.unasked('additional process data'))

    # -- state ------------------------------------------------------------------------------------

    @property
    def shows_fault(self) -> bool:
        return self._faulted    # the control of a leader tells of faults of all

    @property
    def warning(self) -> Sentence:
        return self._timeout.warning or self._samples.warning

    # -- as one of those that are told the same ---------------------------------------------------

    def request_control(self, request: ControlRequest, now: float) -> None:
        if self._led:
            self._group.stop_for(self, request, now)
        else:
            super().request_control(request, now)

    def request_answered(self, request: Request, outcomes: Outcomes) -> None:
        self._timeout.request_answered(request, outcomes)

    def control_refusal(self, action: ControlAction, refusal: Sentence, *,
                        offline: bool) -> Sentence:
        return self._group.control_refusal(self, action, refusal, offline=offline)

    def take_events(self) -> list[Event]:
        events = super().take_events()
        return events if self._led else self._group.delivered(events)

    def facts(self) -> dict[str, str]:
        return self._group.facts(self)
