# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The conversation with one CANnord inverter.

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

from dataclasses import replace
from functools import partial
import math
from typing import TYPE_CHECKING

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.errors import RemoteProtocolError, Unasked
from drive_can_bridge.core.events import Event, ForeignMasterSeen
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.process_image import ProcessImage
from drive_can_bridge.core.roles import publish_it, Roles
from drive_can_bridge.core.sentences import NOTHING, Sentence
from drive_can_bridge.core.session import Session, Stage
from drive_can_bridge.core.stop_duty import Do, Happened
from drive_can_bridge.core.users import Users
from drive_can_bridge.protocols.cannord import procedures
from drive_can_bridge.protocols.cannord.channel import TaskChannel, TaskCourier
from drive_can_bridge.protocols.cannord.control import make_control
from drive_can_bridge.protocols.cannord.identifiers import (
    broadcasts, identifier, MessageObject,
)
from drive_can_bridge.protocols.cannord.monitoring import TimeoutWatch
from drive_can_bridge.protocols.cannord.parameter_frame import ParameterLayout
from drive_can_bridge.protocols.cannord.process_data import (
    decode_main, encode_extra, encode_main, EXTRA_LENGTH, main_length, MAIN_VALUES,
    values_needed,
)
from drive_can_bridge.protocols.cannord.samples import Samples
from drive_can_bridge.protocols.cannord.states import (
    CONTROL_PARAMETER, is_faulted, STATUS_PARAMETER,
)
from drive_can_bridge.protocols.cyclic_exchange import CyclicExchange

if TYPE_CHECKING:
    from drive_can_bridge.protocols.cannord.group import Group


class CannordSession(Session):
    """
    Process data, parameter tasks, and the state of one inverter that is addressed by itself.

    :param group: the broadcast group of the inverter, if it is in one. The inverter that leads it
        is sent the frames of all; the others are only listened to, beside their parameters.
    :ivar exchange: its cycles; of one that is led, only the answers.
    """

    def __init__(self, drive: DriveConfiguration, group: 'Group | None' = None) -> None:
        options, self._group = drive.options, group
        led_by = None if group is None or group.is_leader(drive) else group
        self._led = led_by is not None
        self._member = drive.name if group is not None and not self._led else ''
        self._machine = group.control if group is not None and not self._led else make_control(
            parameter_set=options.parameter_set, timeout=drive.control_timeout)
        image = ProcessImage.of(
            drive, controlled=True, word=(CONTROL_PARAMETER,), status=(STATUS_PARAMETER,))
        super().__init__(
            drive, self._machine, image=replace(image, setpoints=()) if self._led else image,
            roles=Roles(drive, controlled=True, cells=procedures.cells,
                        refusal=procedures.write_refusal,
                        cyclic_refusal=publish_it if led_by is None else led_by.cyclic_refusal),
            leader=None if group is None else group.control)
        if led_by is not None:
            self.enabled_by = led_by.leads
        self._extended: bool = options.extended_identifiers
        self.request_identifier, self._response_identifier, self._task_identifier, \
            self._task_response_identifier = (
                identifier(kind, drive.station, extended=self._extended)
                for kind in MessageObject)
        places = values_needed(drive) if group is None else group.places
        self._swap: bool = options.swap_setpoints_2_3
        self._length = main_length(min(places, MAIN_VALUES))
        self._extra = places > MAIN_VALUES
        self._samples = Samples(self)
        self._courier = TaskCourier(
            ParameterLayout(options.value_order, options.index_byte),
            lambda payload, left: self.outbox.put(
                Frame(self._task_identifier, payload, self._extended), left), self.retry)
        self._channel = TaskChannel(self._courier)
        access = procedures.TaskAccess(
            self._channel, self.retry, last_value=self._samples.last,
            persist=options.persist_writes,
            signed=procedures.signed_cells(drive.profile.parameters.values()))
        # what only a master sends
        self._masters = self.request_identifier, self._task_identifier
        self._broadcasts = broadcasts(drive.station, extended=self._extended)
        self._timeout = TimeoutWatch(drive, access, self.report.note)
        self.users = Users(
            self, access, control_refusal=self._control_refusal,
            answered=self._timeout.request_answered,
            control=None if led_by is None else partial(led_by.stop_for, self))
        self.exchange = CyclicExchange(
            self, self._encode, self._send_cycle, slot=0, silence='no answer to process data',
            advice='drive silent, wrong station, bit rate or identifier format, or P509 not set '
                   'to CAN',
            settled=self._samples.settle if self._extra else None,
            ended=None if group is None else group.stop_left,
            left=None if group is None else group.cycle_left, in_turn=group is not None,
            audience=None if group is None else lambda: [
                member.exchange for member in group.members],
            unheard=None if group is None else group.unheard)
        self.look_after(self.exchange, channel=self._channel)

    # -- life cycle -------------------------------------------------------------------------------

    def begin(self, now: float) -> None:
        self.exchange.stop()
        self._forget_samples()
        if self._group is not None:     # what it reported before the bridge ended is outdated
            self._group.control.member_lost(self.configuration.name)
        self.exchange.start(math.inf if self._led else now)     # those of the leader are for all
        if self.duty.happened(Happened.STARTED) is Do.STOP:
            self.exchange.timer.hurry(now)

    def prepare_stop(self, now: float) -> bool:
        if self._group is not None:
            self._group.end(self.defect or sentences.bridge_inactive(), now)
        return super().prepare_stop(now)

    def begin_stop(self, now: float) -> bool:
        if not self._led:   # else it ends with the last frames of its leader
            self.exchange.stop_soon(now)
        return True

    @property
    def longest_stop(self) -> float:
        return self.exchange.longest_stop

    def fall_silent(self) -> None:
        super().fall_silent()
        self._forget_samples()

    def _forget_samples(self) -> None:
        self.exchange.book.stale += self._samples.expect_nothing()

    def went_offline(self) -> None:
        self._samples.forget()
        self._timeout.warning = NOTHING
        if self._group is not None:
            self._group.member_lost(self)

    # -- process data, sending --------------------------------------------------------------------

    def see_to_control_word(self, now: float) -> None:
        self.exchange.hurry(now, setpoints=self.owed)

    def _encode(self, raws: list[int]) -> list[bytes]:
        word, *values = raws
        words = [setpoint.parameter.word_from_raw(raw)
                 for setpoint, raw in zip(self.setpoints.items, values)]
        payloads = [encode_main(word, words[:MAIN_VALUES], length=self._length, swap=self._swap)]
        if self._extra:
            payloads.append(encode_extra(words[MAIN_VALUES:]))
        return payloads

    def _send_cycle(self, payloads: list[bytes], now: float) -> None:
        if self._group is None:
            self.send(self.request_identifier, payloads)
            self.expect_answer(now, runs=self.exchange.runs)
        else:
            self._group.send(payloads, now)

    def send(self, addressed: int, payloads: list[bytes],
             *to: CyclicExchange[list[bytes]]) -> None:
        """
        Hand out main frame and additional frame of a cycle to one identifier.

        :param to: the exchanges of the inverters that obey it, where that is not only this one.
        """
        for payload in payloads:
            self.exchange.put(Frame(addressed, payload, self._extended), *to)

    def expect_answer(self, now: float, until: float = math.inf, *, runs: bool) -> None:
        """
        Record that the inverter was sent its process frames.

        :param until: when the answer counts as missed; infinity: with the next cycle.
        :param runs: they hold anything but neutral and ``disable``.
        """
        self.exchange.expect_answer(now, until, runs=runs)
        if self.stage is Stage.IDLE:
            self.exchange.book.expect_nothing()
            self.exchange.book.stale = self._extra
            return
        self._samples.awaiting = self._extra

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
                        (self._group.leader if self._group else self).exchange.wait_out(now)
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
            self.report.unasked(sentences.malformed(str(error)), self._channel.late(
                now - age, partial(self._courier.answers, data)), now)
        except RemoteProtocolError as error:
            self.report.reject(sentences.malformed(str(error)))

    def _receive_main(self, data: bytes, now: float, received_at: float) -> None:
        """Take status word and actual values. The fast path of the reader."""
        word, values = decode_main(data, swap=self._swap)
        book = self.exchange.book
        asked = self.exchange.wanted
        if asked:
            self.exchange.answered(received_at)
        elif not (is_faulted(word) and self.online):
            # a fault while offline is told again by the first exchange
            if not is_faulted(word):
                self.exchange.expects('process data', now, received_at)
            return
        if not self.online and self.stage is Stage.RUNNING:
            self.be_online()
            self._timeout.look(now)
            if self._group is not None:
                self._group.member_found(self)
        if asked and is_faulted(word) and not self._machine.fault:
            book.stale = 1      # it may have been told unasked: then the answer follows
        self._machine.status_received(word, now, self._member)
        self.control_changed(now)
        if self._led and self._group is not None:
            self._group.member_status(self, word, now)
        if not self.online:         # found again by a stop
            return
        if self._samples.take(word, values, received_at, asked=asked) and asked and (
                len(data) < self._length):
            self.statistics.short += 1

    def _receive_extra(self, data: bytes) -> None:
        """Take actual values 4 and 5."""
        if self._samples.awaiting:
            self._samples.take_extra(data)
        elif not self.exchange.book.take_stale():
            self.report.reject(sentences.unasked('additional process data'))

    # -- state ------------------------------------------------------------------------------------

    @property
    def warning(self) -> Sentence:
        return self._timeout.warning or self._samples.warning

    # -- as one of a broadcast group --------------------------------------------------------------

    def _control_refusal(self, action: ControlAction, refusal: Sentence) -> Sentence:
        return refusal if self._group is None else self._group.control_refusal(
            self, action, refusal)

    def take_events(self) -> list[Event]:
        events = super().take_events()
        return events if self._group is None or self._led else self._group.delivered(events)

    def facts(self) -> dict[str, str]:
        return {} if self._group is None else {'broadcast': self._group.fact(self)}
