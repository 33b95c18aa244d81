# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Watching one CANnord inverter: process data, broadcasts that it leads, parameter tasks.

An answer to process data counts for the last frame that the inverter was sent. In a broadcast
group that is the individual frame of its turn; nobody answers the broadcast.
"""

import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.protocols.cannord.broadcast import broadcast_identifier
from drive_can_bridge.protocols.cannord.identifiers import identifier, MessageObject
from drive_can_bridge.protocols.cannord.parameter_frame import (
    error_text, ParameterFrame, ParameterLayout, Response, RESPONSES, Task, WRITE_TASKS,
)
from drive_can_bridge.protocols.cannord.process_data import (
    decode_extra, decode_main, EXTRA_LENGTH, MAIN_VALUES, ProcessData,
)
from drive_can_bridge.protocols.cannord.states import (
    CONTROL_PARAMETER, is_faulted, state_of, STATUS_PARAMETER,
)
from drive_can_bridge.protocols.observer import (
    Direction, DriveObserver, Emit, Handler, Kind, Questions, Verdict,
)

_REQUEST, _RESPONSE = Direction.REQUEST, Direction.RESPONSE
_CYCLIC, _PARAMETER = Kind.CYCLIC, Kind.PARAMETER
#: periods after which process data count as unanswered although no other followed
_PATIENCE = 2.0

_DOUBLE_RESPONSES = (Response.DOUBLE, Response.ARRAY_DOUBLE)
_ARRAY_TASKS = {task for (array, _, _), task in WRITE_TASKS.items() if array} | {Task.READ_ARRAY}
_DOUBLE_TASKS = {task for (_, double, _), task in WRITE_TASKS.items() if double}

TaskKey = tuple[int, int]


class CannordObserver(DriveObserver):
    """
    Watches one inverter.

    :param leads: the inverter takes the commands for its broadcast group.
    """

    def __init__(self, drive: DriveConfiguration, emit: Emit, *, leads: bool) -> None:
        super().__init__(drive.name, emit)
        options = drive.options
        self._extended: bool = options.extended_identifiers
        objects = {kind: identifier(kind, drive.station, extended=self._extended)
                   for kind in MessageObject}
        self._handlers: dict[int, Handler] = {
            objects[MessageObject.PROCESS_REQUEST]: self._take_request,
            objects[MessageObject.PROCESS_RESPONSE]: self._take_response,
            objects[MessageObject.PARAMETER_TASK]: self._take_task,
            objects[MessageObject.PARAMETER_RESPONSE]: self._take_task_response,
        }
        broadcast = broadcast_identifier(drive)
        self._grouped = broadcast is not None
        self._paced_by_broadcast = leads and broadcast is not None
        if leads and broadcast is not None:
            self._handlers[broadcast] = self._take_broadcast
        self._swap: bool = options.swap_setpoints_2_3
        self._layout = ParameterLayout(options.value_order, options.index_byte)
        self._request_main = (CONTROL_PARAMETER, *drive.cyclic_request[:MAIN_VALUES])
        self._request_extra = drive.cyclic_request[MAIN_VALUES:]
        self._response_main = (STATUS_PARAMETER, *drive.cyclic_response[:MAIN_VALUES])
        self._response_extra = drive.cyclic_response[MAIN_VALUES:]
        self._listed = {(parameter.number, parameter.subindex): parameter
                        for parameter in reversed(list(drive.profile.parameters.values()))
                        if parameter.number is not None}
        # a member of a group is asked once in a while, and has one period to answer
        self._patience = drive.period if self._grouped else _PATIENCE * drive.period
        self._questions: Questions[TaskKey] = Questions(drive.parameter_timeout)
        self._tasks: dict[TaskKey, ParameterFrame] = {}
        self._asked = math.nan
        self._last = -math.inf
        self._stale = False
        self._heard_request = False

    def handler(self, identifier: int, extended: bool) -> Handler | None:
        return self._handlers.get(identifier) if extended == self._extended else None

    # -- process data -----------------------------------------------------------------------------

    def _take_broadcast(self, data: bytes, now: float) -> None:
        if len(data) != EXTRA_LENGTH:
            self._pace(now)
        self._show_request(data, now, 'broadcast')

    def _take_request(self, data: bytes, now: float) -> None:
        if len(data) != EXTRA_LENGTH:
            if self._asked == self._asked:      # not NaN
                self._miss(now)
            if not self._paced_by_broadcast:
                self._pace(now)
            self._asked = now
            self._heard_request = True
            self.deadline = min(self.deadline, now + self._patience)
        self._show_request(data, now, 'cyclic request')

    def _pace(self, now: float) -> None:
        if self._last > -math.inf:
            self.observed.period.add(now - self._last)
        self._last = now

    def _show_request(self, data: bytes, now: float, title: str) -> None:
        if len(data) == EXTRA_LENGTH:
            self._tell(now, _REQUEST, _CYCLIC, title, self._request_extra,
                       _raws(self._request_extra, decode_extra(data)))
            return
        content = self._main(data, now, _REQUEST, title)
        if content is not None:
            self._tell(now, _REQUEST, _CYCLIC, title, self._request_main,
                       _raws(self._request_main, (content.word, *content.values)))

    def _main(self, data: bytes, now: float, direction: Direction, title: str,
              ) -> ProcessData | None:
        try:
            return decode_main(data, swap=self._swap)
        except RemoteProtocolError as error:
            self._tell(now, direction, _CYCLIC, title, verdict=Verdict.MALFORMED,
                       remark=str(error))
            return None

    def _take_response(self, data: bytes, now: float) -> None:
        if len(data) == EXTRA_LENGTH:
            self._tell(now, _RESPONSE, _CYCLIC, 'cyclic response', self._response_extra,
                       _raws(self._response_extra, decode_extra(data)))
            return
        content = self._main(data, now, _RESPONSE, 'cyclic response')
        if content is None:
            return
        raws = _raws(self._response_main, (content.word, *content.values))
        verdict, remark, latency = Verdict.NORMAL, state_of(content.word).value, math.nan
        if self._asked == self._asked:      # not NaN
            latency = now - self._asked
            self._asked = math.nan
            self.observed.exchanges += 1
            self.observed.latency.add(latency)
            if len(raws) < len(self._response_main):
                verdict = Verdict.MALFORMED
                remark = (f'{len(raws) - 1} values, {len(self._response_main) - 1} needed; '
                          f'{remark}')
        elif self._stale:
            self._stale = False
            verdict = Verdict.LATE
        elif is_faulted(content.word):
            remark = f'{remark}, told without being asked'
        elif self._heard_request:   # else it was asked before the trace began
            verdict = Verdict.UNASKED
        self._tell(now, _RESPONSE, _CYCLIC, 'cyclic response', self._response_main, raws,
                   verdict=verdict, remark=remark, latency=latency)

    def _miss(self, now: float) -> None:
        self._tell(now, _RESPONSE, _CYCLIC, 'cyclic response', verdict=Verdict.LOST,
                   remark=f'no answer in {1e3 * (now - self._asked):.0f} ms')
        self._asked = math.nan
        self._stale = True
        self.observed.missed += 1

    # -- parameters -------------------------------------------------------------------------------

    def _take_task(self, data: bytes, now: float) -> None:
        try:
            frame = self._layout.decode(data)
            task = Task(frame.identifier)
        except (RemoteProtocolError, ValueError) as error:
            self._tell(now, _REQUEST, _PARAMETER, 'parameter task', verdict=Verdict.MALFORMED,
                       remark=str(error))
            return
        key = frame.number, frame.index
        self._tasks[key] = frame
        if len(self._tasks) > 64:
            del self._tasks[next(iter(self._tasks))]
        self.observed.requests += 1
        self._questions.ask(key, now)
        self.deadline = min(self.deadline, self._questions.deadline)
        parameter = self._parameter(frame, task, task in _DOUBLE_TASKS)
        if task in WRITE_TASKS.values():
            value = frame.value if task in _DOUBLE_TASKS else frame.word
            self._tell(now, _REQUEST, _PARAMETER, 'write', (parameter,),
                       (parameter.raw_from_word(value),))
        else:
            title = {Task.NONE: 'no task', Task.READ_ELEMENTS: 'read number of elements',
                     }.get(task, 'read')
            self._tell(now, _REQUEST, _PARAMETER, title, (parameter,))

    def _take_task_response(self, data: bytes, now: float) -> None:
        try:
            frame = self._layout.decode(data)
            response = Response(frame.identifier)
        except (RemoteProtocolError, ValueError) as error:
            self._tell(now, _RESPONSE, _PARAMETER, 'parameter response',
                       verdict=Verdict.MALFORMED, remark=str(error))
            return
        key = self._key_of(frame, response)
        task = self._tasks.get(key)
        verdict, latency = self._questions.answer(key, now)
        asked = Task.READ if task is None else Task(task.identifier)
        title = 'write' if asked in WRITE_TASKS.values() else 'read'
        double = response in _DOUBLE_RESPONSES
        parameter = self._parameter(frame if task is None else task, asked, double)
        if response is Response.REFUSED:
            self._tell(now, _RESPONSE, _PARAMETER, title, (parameter,), remark=error_text(
                frame.word), verdict=Verdict.REFUSED, latency=latency)
            return
        remark = ''
        if task is not None and response not in RESPONSES[asked]:
            verdict, remark = Verdict.MALFORMED, f'response {int(response)} to task {int(asked)}'
        if response is Response.NONE:
            self._tell(now, _RESPONSE, _PARAMETER, 'no task', verdict=verdict, latency=latency)
            return
        if response is Response.ELEMENTS:
            self._tell(now, _RESPONSE, _PARAMETER, 'number of elements', (parameter,),
                       verdict=verdict, remark=f'{frame.word} elements', latency=latency)
            return
        raw = parameter.raw_from_word(frame.value if double else frame.word)
        self._tell(now, _RESPONSE, _PARAMETER, title, (parameter,), (raw,), verdict=verdict,
                   remark=remark, latency=latency)

    def _key_of(self, frame: ParameterFrame, response: Response) -> TaskKey:
        """Return the task that a response belongs to; a refusal need not repeat the index."""
        key = frame.number, frame.index
        if response is Response.REFUSED and frame.index == 0 and key not in self._tasks:
            for other in reversed(self._tasks):
                if other[0] == frame.number:
                    return other
        return key

    def _parameter(self, frame: ParameterFrame, task: Task, double: bool) -> Parameter:
        """Return the parameter that a task is about, with the width that travels."""
        subindex = frame.index if task in _ARRAY_TASKS or frame.index else None
        listed = self._listed.get((frame.number, subindex))
        width = 32 if double else 16
        if listed is not None and listed.type.bits == width:
            return listed
        name = listed.name if listed is not None else f'p{frame.number}' + (
            '' if subindex is None else f'.{subindex}')
        return Parameter(name, ParameterType.UINT32 if double else ParameterType.UINT16,
                         number=frame.number, subindex=subindex, listed=False)

    # -- time -------------------------------------------------------------------------------------

    def expire(self, now: float) -> None:
        if self._asked + self._patience <= now:
            self._miss(self._asked + self._patience)
        for key, due in self._questions.overdue(now):
            self.observed.unanswered += 1
            task = self._tasks[key] if key in self._tasks else None
            parameters = () if task is None else (
                self._parameter(task, Task(task.identifier), False),)
            self._tell(due, _RESPONSE, _PARAMETER, 'parameter response', parameters,
                       verdict=Verdict.LOST, remark='no answer')
        cyclic = self._asked + self._patience
        self.deadline = min(self._questions.deadline, cyclic if cyclic == cyclic else math.inf)


def _raws(parameters: tuple[Parameter, ...], words: tuple[int, ...]) -> list[int]:
    return [parameter.raw_from_word(word) for parameter, word in zip(parameters, words)]
