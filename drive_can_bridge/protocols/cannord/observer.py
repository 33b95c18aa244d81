# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Watching one CANnord inverter: process data, broadcasts that it leads, parameter tasks.

An answer to process data counts for the last frame that the inverter was sent. In a broadcast
group that is the individual frame of its turn; nobody answers the broadcast.
"""

from collections.abc import Sequence
from functools import partial

from drive_can_bridge.core.configuration import DriveConfiguration
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
    Direction, DriveObserver, Emit, Handler, Kind, raws_of, Verdict,
)
from drive_can_bridge.protocols.watches import CYCLES_WAITED, CyclicWatch, Questions

_REQUEST, _RESPONSE = Direction.REQUEST, Direction.RESPONSE
_CYCLIC, _PARAMETER = Kind.CYCLIC, Kind.PARAMETER

_DOUBLE_RESPONSES = (Response.DOUBLE, Response.ARRAY_DOUBLE)
_ARRAY_TASKS = {task for (array, _, _), task in WRITE_TASKS.items() if array} | {Task.READ_ARRAY}
_DOUBLE_TASKS = {task for (_, double, _), task in WRITE_TASKS.items() if double}

TaskKey = tuple[int, int]


class CannordObserver(DriveObserver):
    """
    Watches one inverter.

    :param leads: the inverter takes the commands for its broadcast group.
    """

    def __init__(self, drive: DriveConfiguration, emit: Emit, *, leads: bool = False) -> None:
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
        self._paced_by_broadcast = leads and broadcast is not None
        if leads and broadcast is not None:
            self._handlers[broadcast] = self._take_broadcast
        self._decode_main = partial(decode_main, swap=options.swap_setpoints_2_3)
        self._layout = ParameterLayout(options.value_order, options.index_byte)
        self._request_main = (CONTROL_PARAMETER, *drive.cyclic_request[:MAIN_VALUES])
        self._request_extra = drive.cyclic_request[MAIN_VALUES:]
        self._response_main = (STATUS_PARAMETER, *drive.cyclic_response[:MAIN_VALUES])
        self._response_extra = drive.cyclic_response[MAIN_VALUES:]
        self._listed = {(parameter.number, parameter.subindex): parameter
                        for parameter in reversed(list(drive.profile.parameters.values()))
                        if parameter.number is not None}
        # a member of a group is asked once in a while, and has one period to answer
        self._cycle = CyclicWatch(
            self, drive.period * (CYCLES_WAITED if broadcast is None else 1.0))
        self._questions: Questions[TaskKey] = Questions(
            self, drive.parameter_timeout, self._unanswered)
        self._tasks: dict[TaskKey, ParameterFrame] = {}

    def handler(self, identifier: int, extended: bool) -> Handler | None:
        return self._handlers.get(identifier) if extended == self._extended else None

    # -- process data -----------------------------------------------------------------------------

    def _take_broadcast(self, data: bytes, now: float) -> None:
        if len(data) != EXTRA_LENGTH:
            self._cycle.begin_cycle(now)
        self._show_request(data, now, 'broadcast')

    def _take_request(self, data: bytes, now: float) -> None:
        if len(data) != EXTRA_LENGTH:
            self._cycle.ask(now, begins_cycle=not self._paced_by_broadcast)
        self._show_request(data, now, 'cyclic request')

    def _show_request(self, data: bytes, now: float, title: str) -> None:
        content = self._main(data, now, _REQUEST, title, self._request_extra)
        if content is not None:
            self.tell(now, _REQUEST, _CYCLIC, title, self._request_main,
                      raws_of(self._request_main, (content.word, *content.values)))

    def _main(self, data: bytes, now: float, direction: Direction, title: str,
              extra: Sequence[Parameter]) -> ProcessData | None:
        """Return what a main frame holds; None: it is an extra one, or malformed, and told."""
        if len(data) == EXTRA_LENGTH:
            self.tell(now, direction, _CYCLIC, title, extra, raws_of(extra, decode_extra(data)))
            return None
        return self.decoded(self._decode_main, data, now, direction, _CYCLIC, title)

    def _take_response(self, data: bytes, now: float) -> None:
        title = 'cyclic response'
        content = self._main(data, now, _RESPONSE, title, self._response_extra)
        if content is None:
            return
        raws = raws_of(self._response_main, (content.word, *content.values))
        remark = state_of(content.word).value
        needed = len(self._response_main)
        if self._cycle.asked and len(raws) < needed:
            verdict, latency = Verdict.MALFORMED, self._cycle.answer(now)[1]
            remark = f'{len(raws) - 1} values, {needed - 1} needed; {remark}'
        else:
            verdict, latency = self._cycle.answer(now)
        if latency != latency and is_faulted(content.word):     # NaN: nobody asked
            verdict, remark = Verdict.NORMAL, f'{remark}, told without being asked'
        self.tell(now, _RESPONSE, _CYCLIC, title, self._response_main, raws, verdict=verdict,
                  remark=remark, latency=latency)

    # -- parameters -------------------------------------------------------------------------------

    def _task(self, data: bytes) -> tuple[ParameterFrame, Task]:
        frame = self._layout.decode(data)
        return frame, Task(frame.identifier)

    def _answer(self, data: bytes) -> tuple[ParameterFrame, Response]:
        frame = self._layout.decode(data)
        return frame, Response(frame.identifier)

    def _take_task(self, data: bytes, now: float) -> None:
        decoded = self.decoded(self._task, data, now, _REQUEST, _PARAMETER, 'parameter task')
        if decoded is None:
            return
        frame, task = decoded
        key = frame.number, frame.index
        self._tasks.pop(key, None)
        self._tasks[key] = frame    # the newest is the last
        if len(self._tasks) > 64:
            del self._tasks[next(iter(self._tasks))]
        self.observed.requests += 1
        self._questions.ask(key, now)
        parameter = self._parameter(frame, task, task in _DOUBLE_TASKS)
        if task in WRITE_TASKS.values():
            value = frame.value if task in _DOUBLE_TASKS else frame.word
            self.tell(now, _REQUEST, _PARAMETER, 'write', (parameter,),
                      (parameter.raw_from_word(value),))
        else:
            title = {Task.NONE: 'no task', Task.READ_ELEMENTS: 'read number of elements',
                     }.get(task, 'read')
            self.tell(now, _REQUEST, _PARAMETER, title, (parameter,))

    def _take_task_response(self, data: bytes, now: float) -> None:
        decoded = self.decoded(self._answer, data, now, _RESPONSE, _PARAMETER,
                               'parameter response')
        if decoded is None:
            return
        frame, response = decoded
        key = self._key_of(frame, response)
        task = self._tasks.get(key)
        verdict, latency = self._questions.answer(key, now)
        asked = Task.READ if task is None else Task(task.identifier)
        title = 'write' if asked in WRITE_TASKS.values() else 'read'
        double = response in _DOUBLE_RESPONSES
        parameter = self._parameter(frame if task is None else task, asked, double)
        parameters: tuple[Parameter, ...] = (parameter,)
        raws: tuple[int, ...] = ()
        remark = ''
        if response is Response.REFUSED:
            verdict, remark = Verdict.REFUSED, error_text(frame.word)
        elif task is not None and response not in RESPONSES[asked]:
            verdict, remark = Verdict.MALFORMED, f'response {int(response)} to task {int(asked)}'
        if response is Response.NONE:
            title, parameters, remark = 'no task', (), ''
        elif response is Response.ELEMENTS:
            title, remark = 'number of elements', f'{frame.word} elements'
        elif response is not Response.REFUSED:
            raws = parameter.raw_from_word(frame.value if double else frame.word),
        self.tell(now, _RESPONSE, _PARAMETER, title, parameters, raws, verdict=verdict,
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

    def _unanswered(self, key: TaskKey, due: float) -> None:
        task = self._tasks.get(key)
        self.tell_unanswered(due, _PARAMETER, 'parameter response', () if task is None else (
            self._parameter(task, Task(task.identifier), False),))
