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

import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlMachine
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.events import (
    ForeignMasterSeen, Noted, ProcessDataReceived,
)
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.outbox import Left
from drive_can_bridge.core.parameters import Access, Parameter
from drive_can_bridge.core.requests import (
    BRIDGE_INACTIVE, Failure, Outcome, ReadRequest, ReadValue, Request, WriteRequest, Written,
)
from drive_can_bridge.core.roles import Cells
from drive_can_bridge.core.session import (
    Session, STOP_CYCLES,
)
from drive_can_bridge.protocols.cannord import procedures
from drive_can_bridge.protocols.cannord.channel import TaskChannel
from drive_can_bridge.protocols.cannord.control import make_control
from drive_can_bridge.protocols.cannord.identifiers import identifier, MessageObject
from drive_can_bridge.protocols.cannord.monitoring import (
    TIMEOUT_NUMBER, timeout_parameter, timeout_warning,
)
from drive_can_bridge.protocols.cannord.parameter_frame import ParameterLayout
from drive_can_bridge.protocols.cannord.process_data import (
    decode_extra, decode_main, encode_extra, encode_main, EXTRA_LENGTH, main_length, MAIN_VALUES,
)
from drive_can_bridge.protocols.cannord.states import is_faulted, STATUS_BITS, STATUS_WORD
from drive_can_bridge.protocols.channel import Lane
from drive_can_bridge.protocols.cycle_timer import CycleTimer

NO_ANSWER = 'no answer to process data'
#: what the inverter is told, for the books of what it was told
CYCLE = 'cycle'
#: s until a telegram time-out that nobody answered is asked for again
UNKNOWN_TIMEOUT_PAUSE = 10.0

STATUS_PARAMETER = Parameter(
    name=STATUS_WORD, access=Access.READ_ONLY, bits=tuple(STATUS_BITS.items()),
    description='Status word of the inverter')
CONTROL_PARAMETER = Parameter(
    name='control_word', access=Access.WRITE_ONLY, description='Control word of the inverter')


def values_needed(drive: DriveConfiguration) -> int:
    """Return how many values travel: the longer of both lists decides."""
    return max(len(drive.cyclic_request), len(drive.cyclic_response))


class CannordSession(Session):
    """
    Process data, parameter tasks, and the state of one inverter that is addressed by itself.

    :param control: the machine to be used; None: one for this inverter alone.
    :param places: how many values the frames to and from the inverter hold at least.
    """

    def __init__(self, drive: DriveConfiguration, control: ControlMachine | None = None, *,
                 places: int = 0) -> None:
        options = drive.options
        self._machine = control or make_control(
            parameter_set=options.parameter_set, timeout=drive.control_timeout)
        super().__init__(drive, self._machine)
        self._extended: bool = options.extended_identifiers
        self.request_identifier, self._response_identifier, self._task_identifier, \
            self._task_response_identifier = (
                identifier(kind, drive.station, extended=self._extended)
                for kind in MessageObject)
        places = max(places, values_needed(drive))
        self._swap: bool = options.swap_setpoints_2_3
        self._length = main_length(min(places, MAIN_VALUES))
        self._extra = places > MAIN_VALUES
        self._main_response = drive.cyclic_response[:MAIN_VALUES]
        self._extra_response = drive.cyclic_response[MAIN_VALUES:]
        self._channel = TaskChannel(
            ParameterLayout(options.value_order, options.index_byte), self._send_task,
            self.retry)
        self._access = procedures.TaskAccess(
            self.retry, last_value=self._last_value, persist=options.persist_writes)
        self._cycling = False
        self._stopping = False
        self._cycles_left = 0               # before a stop is complete
        self._payloads: list[bytes] = []    # of the frames of a cycle, main frame first
        self._payloads_words: tuple[int, ...] | None = None     # in them, until they have left
        self._payloads_run = False          # they hold anything but neutral and disable
        self._frames_out = 0                # of this cycle, of which nobody has said what became
        self._whole = True                  # the bus has taken all frames of this cycle so far
        self._sent_word: int | None = None
        self._awaiting = False
        self._awaiting_extra = False
        self._forgiven = 0                  # answers to frames that were given up
        self._held: ProcessDataReceived | None = None   # until values 4 and 5 arrive
        self._extra_missing = False
        self._last_sample: tuple[int, ...] = ()
        self._sent_at = -math.inf
        self._answer_due = math.inf
        self._timer = CycleTimer(drive.period)
        self._missed_in_row = 0
        self._timeout_warning = ''
        self._asking_timeout = False
        self._ask_timeout_at = -math.inf

    @property
    def builtin_parameters(self) -> tuple[Parameter, ...]:
        return (STATUS_PARAMETER,)

    @property
    def request_parameters(self) -> tuple[Parameter, ...]:
        return (CONTROL_PARAMETER, *self.drive.cyclic_request)

    # -- life cycle -------------------------------------------------------------------------------

    def deactivate(self, now: float) -> None:
        self.active = False
        self._fail_requests(BRIDGE_INACTIVE)
        self._withdraw(BRIDGE_INACTIVE, now)
        if not self._cycling:
            if not self.bus_available:
                self._leave_owing()
            self._go_idle('deactivated')
            return
        self._stopping = True
        self._cycles_left = STOP_CYCLES
        self._timer.no_later(max(now, self._timer.began_at + self._stop_spacing))
        self._timer.hurry(now)

    @property
    def stopped(self) -> bool:
        return not self._cycling

    def time_lost(self, now: float) -> None:
        self._channel.time_lost(now)
        if not self._cycling or self._stopping:
            return
        self._lose('the bridge stood still', now)
        self._begin(now)

    def _begin(self, now: float) -> None:
        """Start over: nothing is known of the inverter."""
        (self._lose if self.online else self._withdraw)('the drive is being reconnected', now)
        self.setpoints.forget()
        self._stopping = False
        self._stop_awaiting()
        self._missed_in_row = 0
        self._cycling = True
        self._timer.start(self._first_cycle(now))
        if self.told.owed:
            self._timer.hurry(now)

    def _first_cycle(self, now: float) -> float:
        return max(now, self._timer.began_at + self.drive.period)

    def _go_idle(self, advice: str) -> None:
        self._cycling = self._stopping = False
        self.setpoints.allow(False)
        self._timer.stop()
        self._stop_awaiting()
        self._advice = advice
        self._be_offline(advice)

    def _be_offline(self, reason: str) -> None:
        self._held = None
        self._last_sample = ()
        self._extra_missing = False
        self._timeout_warning = ''
        super()._be_offline(reason)

    def _withdraw(self, reason: str, now: float) -> None:
        """Go neutral, and back to ``disable``."""
        self.setpoints.allow(False)
        self._machine.withdraw(reason, now)
        self._control_changed(now)

    # -- process data, sending --------------------------------------------------------------------

    def _cycle(self, now: float) -> None:
        """Send what is due once a period. The fast path of the timer."""
        self._settle(now)
        self._expire(now)
        if self.setpoints.changed or self._machine.word != self._sent_word:
            self._payloads = self._encode()
        error = self._timer.begun(now, self._stop_spacing if self._stopping else None)
        if error == error:  # not NaN
            self.statistics.period_error.add(error)
        self._frames_out, self._whole = 0, True
        self._transmit(now)

    def _transmit(self, now: float) -> None:
        """Hand out the frames of this cycle."""
        self._put(self.request_identifier)
        self.expect_answer(now)

    def _put(self, addressed: int) -> None:
        """Hand out main frame and additional frame to one identifier."""
        for payload in self._payloads:
            self._frames_out += 1
            self._outbox.put(Frame(addressed, payload, self._extended), self._frame_left)

    def _frame_left(self, sent: bool, now: float) -> None:
        """Take note of a frame; one that may start somebody counts even alone."""
        self._frames_out -= 1
        if not sent:
            self._whole = False
        elif self._payloads_run:
            self.told.note(CYCLE, runs=True)
        if not self._frames_out and self._whole:
            self._cycle_left(now)

    def _cycle_left(self, now: float) -> None:
        """Take note of a cycle of which the bus has taken every frame: only then it counts."""
        self.told.note(CYCLE, runs=self._payloads_run)
        if self._payloads_words is not None:    # the first time that they left
            self.sent.take(self._payloads_words)
            self._payloads_words = None
        if self._machine.word == self._sent_word:   # nobody was lost meanwhile
            fresh = self._machine.word_due
            self._machine.word_sent(now)
            if fresh or self._machine.word != self._sent_word:
                self._control_changed(now)
            if self._machine.pulsing:
                self._timer.no_later(now + self._stop_spacing)
        if self._stopping:
            self._cycles_left -= 1
            if self._cycles_left == 0:
                self._go_idle('deactivated')

    def _see_to_control_word(self, now: float) -> None:
        if self._machine.stopping and not self._stopping and (
                self._machine.word != self._sent_word
                or self.setpoints.changed and self.told.owed):
            self._timer.hurry(now)

    def _encode(self) -> list[bytes]:
        self._sent_word = self._machine.word
        self._payloads_run = not (self._machine.at_rest and self.setpoints.at_rest)
        words = [setpoint.parameter.word_from_raw(setpoint.raw)
                 for setpoint in self.setpoints.items]
        self.setpoints.changed = False
        self._payloads_words = (self._sent_word, *words)
        payloads = [encode_main(self._sent_word, words[:MAIN_VALUES], length=self._length,
                                swap=self._swap)]
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
            self._forgiven = 1 + self._extra
            return
        self._settle(now)
        self._awaiting = True
        self._awaiting_extra = self._extra
        self._sent_at = now
        self._answer_due = until

    def _settle(self, now: float) -> None:
        """End an exchange: what has not arrived by now does not count for it any more."""
        self._answer_due = math.inf
        self._awaiting_extra = False
        if self._held is not None:
            self._extra_missing = True
            self._publish_held()
        if not self._awaiting:
            return
        self._awaiting = False
        self._forgiven = 1      # one answer too many is on its way, if this one is only late
        self.statistics.missed += 1
        self._missed_in_row += 1
        if self._missed_in_row >= self.drive.missed_limit and not self._stopping:
            self._missed_in_row = 0
            if self.online:
                self._lose(f'{NO_ANSWER} for {self.drive.missed_limit} cycles', now)
            self._advice = (f'{NO_ANSWER}: drive silent, wrong station, bit rate or identifier '
                            'format, or P509 not set to CAN')

    def _stop_awaiting(self) -> None:
        """Expect no answer any more; one that is on its way is no surprise, though."""
        self._forgiven = self._awaiting + self._awaiting_extra
        self._awaiting = self._awaiting_extra = False
        self._answer_due = math.inf
        self._held = None

    def receive_frame(self, frame: Frame, now: float, age: float = 0.0) -> None:
        received, data, extended = frame
        if extended != self._extended:
            self._reject(f'{frame}: not of this drive')
        elif received == self._response_identifier:
            if len(data) == EXTRA_LENGTH:
                self._receive_extra(data)
            else:
                self._receive_main(data, now, now - age)
        elif received == self._task_response_identifier:
            try:
                self._channel.receive(data, now)
            except RemoteProtocolError as error:
                self._reject(str(error))
        elif received in (self.request_identifier, self._task_identifier):
            self._see_foreign_master(frame)
        else:
            self._reject(f'{frame}: not of this drive')

    def _receive_main(self, data: bytes, now: float, received_at: float) -> None:
        """Take status word and actual values. The fast path of the reader."""
        try:
            word, values = decode_main(data, swap=self._swap)
        except RemoteProtocolError as error:
            self._reject(str(error))
            return
        asked = self._awaiting
        if asked:
            self._awaiting = False
            self._missed_in_row = 0
            self.statistics.exchanges += 1
            latency = received_at - self._sent_at
            self.statistics.latency.add(latency if latency > 0.0 else 0.0)
        elif not (is_faulted(word) and self.online):
            if self._forgiven:
                self._forgiven -= 1
            elif not is_faulted(word):  # while offline: the first exchange tells it again
                self._reject('process data that nobody asked for')
            return
        if not self.online and not self._stopping:
            self._found(now)
        if asked and is_faulted(word) and not self._machine.fault:
            self._forgiven = 1      # it may have been told unasked: then the answer follows
        self._take_status(word, now)
        if not self.online:         # found again by a stop
            return
        wanted = self._main_response
        raws = (word, *(parameter.raw_from_word(value)
                        for parameter, value in zip(wanted, values)))
        if len(values) < len(wanted):
            self._reject(f'process data with {len(values)} values, {len(wanted)} needed')
        elif asked and len(data) < self._length:
            self.statistics.short += 1
        if self._held is not None:      # its values 4 and 5 would come after these
            self._publish_held()
        sample = ProcessDataReceived(raws, received_at)
        if asked and self._awaiting_extra and self._extra_response and len(
                raws) > len(wanted):
            self._held = sample
        else:
            self._publish(sample)

    def _receive_extra(self, data: bytes) -> None:
        """Take actual values 4 and 5."""
        if not self._awaiting_extra:
            if self._forgiven:
                self._forgiven -= 1
            else:
                self._reject('additional process data that nobody asked for')
            return
        self._awaiting_extra = False
        held, self._held = self._held, None
        if held is not None:    # else: nobody wants them, or what they belong to did not come
            self._extra_missing = False
            values = (parameter.raw_from_word(value) for parameter, value
                      in zip(self._extra_response, decode_extra(data)))
            self._publish(ProcessDataReceived((*held.raws, *values), held.received_at))

    def _publish_held(self) -> None:
        held, self._held = self._held, None
        if held is not None:
            self._publish(held)

    def _publish(self, sample: ProcessDataReceived) -> None:
        self._measured(sample.raws)
        self._last_sample = (*sample.raws, *self._last_sample[len(sample.raws):])
        self._events.append(sample)

    def _found(self, now: float) -> None:
        self._be_online()
        self._look_at_timeout(now)

    def _take_status(self, word: int, now: float) -> None:
        self._machine.status_received(word, now)
        self._control_changed(now)

    def _see_foreign_master(self, frame: Frame) -> None:
        self._events.append(ForeignMasterSeen(
            f'another master sends to station {self.drive.station}: {frame}'))

    # -- parameters -------------------------------------------------------------------------------

    def _send_task(self, payload: bytes, left: Left) -> None:
        self._outbox.put(Frame(self._task_identifier, payload, self._extended), left)

    def _last_value(self, name: str) -> int | None:
        """Return the raw integer of a parameter that was received last."""
        for parameter, raw in zip(self.sample_parameters, self._last_sample):
            if parameter.name == name:
                return raw
        return None

    def _enqueue(self, request: Request, now: float) -> None:
        def done(outcomes: tuple[Outcome, ...]) -> None:
            self._answer(request, outcomes)
            if isinstance(request, WriteRequest) and any(
                    parameter.number == TIMEOUT_NUMBER and isinstance(outcome, Written)
                    for (parameter, _), outcome in zip(request.items, outcomes)):
                self._ask_timeout_at = -math.inf    # now it is known to answer
                self._look_at_timeout(self._channel.now)

        self._channel.run(
            self._access.serve(request), done, now, Lane.USERS)

    def _waiting_requests(self) -> int:
        return self._channel.waiting_users

    def _fail_requests(self, reason: str) -> None:
        self._channel.clear()
        self._asking_timeout = False
        self._fail_open_requests(reason)

    def cells(self, parameter: Parameter) -> Cells:
        # a task without sub-index acts on the first element
        return (frozenset() if parameter.number is None
                else frozenset([(parameter.number, parameter.subindex or 0)]))

    def write_refusal(self, parameter: Parameter) -> str:
        refusal = super().write_refusal(parameter)
        if not refusal and parameter.number is None:
            return procedures.PROCESS_DATA_ONLY
        return refusal

    # -- the inverter's own time-out --------------------------------------------------------------

    def _look_at_timeout(self, now: float) -> None:
        """Read the telegram time-out, where the profile lists it."""
        parameter = timeout_parameter(self.drive.profile)
        if parameter is None or self._asking_timeout or now < self._ask_timeout_at:
            return
        self._asking_timeout = True

        def done(outcomes: tuple[Outcome, ...]) -> None:
            outcome, = outcomes
            self._asking_timeout = False
            if isinstance(outcome, ReadValue):
                self._timeout_warning = timeout_warning(
                    parameter, float(parameter.value_from_raw(outcome.raw)), self.drive.period)
                if self._timeout_warning:
                    self._events.append(Noted(self._timeout_warning, warning=True))
            elif isinstance(outcome, Failure):
                self._ask_timeout_at = self._channel.now + UNKNOWN_TIMEOUT_PAUSE
                self._events.append(Noted(f'telegram time-out ({parameter.address}) unknown: '
                                          f'{outcome.reason}'))

        self._channel.run(self._access.serve(ReadRequest((parameter,))), done, now)

    # -- timer ------------------------------------------------------------------------------------

    def handle_timer(self, now: float) -> None:
        if now >= self._answer_due:
            self._settle(now)
        if now >= self._timer.due:
            self._cycle(now)
        if now >= self._machine.next_timer():
            self._machine.handle_timer(now)
            self._control_changed(now)
        if now >= self._channel.next_timer():
            self._channel.advance(now)

    def next_timer(self) -> float:
        return min(self._timer.due, self._answer_due, self._machine.next_timer(),
                   self._channel.next_timer())

    # -- state ------------------------------------------------------------------------------------

    @property
    def warning(self) -> str:
        if self._timeout_warning:
            return self._timeout_warning
        if self._extra_missing:
            return ('values 4 and 5 do not arrive: the drive does not answer the additional '
                    'frame; extra_setpoints is for SK 540E and SK 545E')
        return ''
