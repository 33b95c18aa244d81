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

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.events import Event, ForeignMasterSeen
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.process_image import ProcessImage
from drive_can_bridge.core.roles import publish_it, Roles
from drive_can_bridge.core.session import Session
from drive_can_bridge.core.users import Users
from drive_can_bridge.protocols.access import ChannelServer
from drive_can_bridge.protocols.cannord import procedures
from drive_can_bridge.protocols.cannord.channel import TaskChannel, TaskCourier
from drive_can_bridge.protocols.cannord.control import make_control
from drive_can_bridge.protocols.cannord.identifiers import identifier, MessageObject
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
from drive_can_bridge.protocols.exchange_book import ExchangeBook

if TYPE_CHECKING:
    from drive_can_bridge.protocols.cannord.group import Group

NO_ANSWER = 'no answer to process data'


class CannordSession(Session):
    """
    Process data, parameter tasks, and the state of one inverter that is addressed by itself.

    :param group: the broadcast group of the inverter, if it is in one. The inverter that leads it
        is sent the frames of all; the others are only listened to, beside their parameters.
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
            self.how_to_enable = led_by.how_to_enable
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
        self._channel = TaskChannel(TaskCourier(
            ParameterLayout(options.value_order, options.index_byte),
            lambda payload, left: self.outbox.put(
                Frame(self._task_identifier, payload, self._extended), left), self.retry))
        self._access = procedures.TaskAccess(
            self.retry, last_value=self._samples.last, persist=options.persist_writes)
        # what only a master sends
        self._masters = {self.request_identifier, self._task_identifier,
                         group and group.broadcast}
        self._timeout = TimeoutWatch(drive, self._channel, self._access, self.report.note)
        self.users = Users(
            self, ChannelServer(self._channel, self._access),
            control_refusal=self._control_refusal, answered=self._timeout.request_answered,
            control=None if led_by is None else partial(led_by.stop_for, self))
        self._book = ExchangeBook(drive, self.statistics)
        self._timer = self._book.timer
        self._exchange = CyclicExchange(
            self, self._book, self._encode, slot=0,
            left=None if group is None else group.cycle_left,
            unheard=None if group is None else group.unheard,
            ended=lambda _: self._last_cycle_left())
        self._cycling = self._stopping = False
        self._answer_due = math.inf

    # -- life cycle -------------------------------------------------------------------------------

    def deactivate(self, now: float) -> None:
        if self._group is not None:
            self._group.end(now)
        super().deactivate(now)

    def _last_cycle_left(self) -> None:
        if self._group is None:
            self._exchange.doubt_the_end()
            self.stop_left()
        else:
            self._group.stop_left()

    def wait_out(self, now: float) -> None:
        """Come to the end of a stop that only waits for an answer, if that came."""
        if self._led and self._group is not None:
            self._group.wait_out(now)
        else:
            self._exchange.wait_out(now)

    def prepare_stop(self, now: float) -> bool:
        self._clear_acyclic()
        return self._cycling

    def begin_stop(self, now: float) -> bool:
        self._stopping = True
        if not self._led:   # else it ends with the last frames of its leader
            self._exchange.stop_soon(now)
        return True

    @property
    def stopped(self) -> bool:
        return not self._cycling

    @property
    def longest_stop(self) -> float:
        return self._exchange.longest_stop

    def time_lost(self, now: float) -> None:
        self._channel.time_lost(now)
        if self._cycling and not self._stopping:
            self.stood_still(now)
            self.start_over(now)

    def begin(self, now: float) -> None:
        self._stopping = False
        self._expect_nothing()
        self._cycling = True
        self._exchange.start(math.inf if self._led else now)    # those of the leader are for all
        if self.told.owed:
            self._timer.hurry(now)

    def go_idle(self, advice: str) -> None:
        self._cycling = self._stopping = False
        self.setpoints.allow(False)
        self._clear_acyclic()
        self._expect_nothing()
        self._timer.stop()
        self.be_offline(advice)

    def _clear_acyclic(self) -> None:
        self._channel.clear()
        self._timeout.forget()

    def went_offline(self) -> None:
        self._samples.forget()
        self._timeout.warning = ''
        if self._group is not None:
            self._group.member_lost(self)

    # -- process data, sending --------------------------------------------------------------------

    def _cycle(self, now: float) -> None:
        """Send what is due once a period. The fast path of the timer."""
        if self._stopping and self._exchange.wait_out(now, due=True):
            return
        self._settle(now)
        again = self._stopping and not self._exchange.whole
        payloads = self._exchange.begin(now)
        if self._group is None:
            self.send(self.request_identifier, payloads)
            self.expect_answer(now)
        else:
            self._group.send(payloads, now, stopping=self._stopping, again=again)

    def send(self, addressed: int, payloads: list[bytes]) -> None:
        """Hand out main frame and additional frame of a cycle to one identifier."""
        for payload in payloads:
            self._exchange.put(Frame(addressed, payload, self._extended))

    def see_to_control_word(self, now: float) -> None:
        if self._machine.stopping and not self._stopping and (
                self._machine.word != self._exchange.word
                or self.setpoints.changed and self.told.owed):
            self._timer.hurry(now)

    def _encode(self, raws: list[int]) -> list[bytes]:
        word, *values = raws
        words = [setpoint.parameter.word_from_raw(raw)
                 for setpoint, raw in zip(self.setpoints.items, values)]
        payloads = [encode_main(word, words[:MAIN_VALUES], length=self._length, swap=self._swap)]
        if self._extra:
            payloads.append(encode_extra(words[MAIN_VALUES:]))
        return payloads

    # -- process data, receiving ------------------------------------------------------------------

    def expect_answer(self, now: float, until: float = math.inf) -> None:
        """
        Take note that the inverter was sent its process frames.

        :param until: when the answer counts as missed; infinity: with the next cycle.
        """
        if not self._cycling:
            self._book.stale = 1 + self._extra
            return
        self._settle(now)
        self._book.awaiting = True
        self._book.began_at = now
        self._samples.awaiting = self._extra
        self._answer_due = until

    def _settle(self, now: float) -> None:
        """End an exchange: what has not arrived by now does not count for it any more."""
        self._answer_due = math.inf
        if self._samples.awaiting:
            self._samples.settle()
        if self._book.awaiting and self._book.missed() and not self._stopping:
            self._book.missed_in_row = 0
            if self.online:
                self.lose(f'{NO_ANSWER} for {self.configuration.missed_limit} cycles', now)
            self.report.advice = (f'{NO_ANSWER}: drive silent, wrong station, bit rate or '
                                  'identifier format, or P509 not set to CAN')

    def _expect_nothing(self) -> None:
        """Expect no answer any more; one that is on its way is no surprise, though."""
        self._book.expect_nothing()
        self._book.stale += self._samples.expect_nothing()
        self._answer_due = math.inf

    def receive_frame(self, frame: Frame, now: float, age: float = 0.0) -> None:
        received, data, extended = frame
        try:
            if extended != self._extended:
                self.report.reject(f'{frame}: not of this drive')
            elif received == self._response_identifier:
                if len(data) == EXTRA_LENGTH:
                    self._receive_extra(data)
                else:
                    self._receive_main(data, now, now - age)
                    if self._stopping:
                        self.wait_out(now)
            elif received == self._task_response_identifier:
                self._channel.receive(data, now)
            elif received in self._masters:
                self.report.note(ForeignMasterSeen(
                    f'another master sends to station {self.configuration.station}: {frame}'))
            else:
                self.report.reject(f'{frame}: not of this drive')
        except RemoteProtocolError as error:
            self.report.reject(str(error))

    def _receive_main(self, data: bytes, now: float, received_at: float) -> None:
        """Take status word and actual values. The fast path of the reader."""
        word, values = decode_main(data, swap=self._swap)
        book = self._book
        asked = book.awaiting
        if asked:
            book.answered(received_at)
            if self.told.ran:
                self.told.answered()
        elif not (is_faulted(word) and self.online):
            # a fault while offline is told again by the first exchange
            if not book.take_stale() and not is_faulted(word):
                self.report.reject('process data that nobody asked for')
            return
        if not self.online and not self._stopping:
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
        elif not self._book.take_stale():
            self.report.reject('additional process data that nobody asked for')

    # -- timer ------------------------------------------------------------------------------------

    def handle_timer(self, now: float) -> None:
        if now >= self._answer_due:
            self._settle(now)
        if now >= self._timer.due:
            self._cycle(now)
        if now >= self._machine.next_timer():
            self._machine.handle_timer(now)
            self.control_changed(now)
        if now >= self._channel.next_timer():
            self._channel.advance(now)

    def next_timer(self) -> float:
        return min(self._timer.due, self._answer_due, self._machine.next_timer(),
                   self._channel.next_timer())

    # -- state ------------------------------------------------------------------------------------

    @property
    def warning(self) -> str:
        return self._timeout.warning or self._samples.warning

    # -- as one of a broadcast group --------------------------------------------------------------

    def _control_refusal(self, action: ControlAction, refusal: str) -> str:
        return refusal if self._group is None else self._group.control_refusal(
            self, action, refusal)

    def take_events(self) -> list[Event]:
        events = super().take_events()
        return events if self._group is None or self._led else self._group.delivered(events)

    def facts(self) -> dict[str, str]:
        return {} if self._group is None else {'broadcast': self._group.fact(self)}
