# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Watching one CANnord inverter: process data, broadcasts that it leads, parameter tasks.

An answer to process data counts for the last frame that the inverter was sent. In a broadcast
group that is the individual frame of its turn; nobody answers the broadcast.
"""

from collections.abc import Collection
from functools import partial
from typing import TypeVar

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.protocols.cannord.broadcast import broadcast_identifier
from drive_can_bridge.protocols.cannord.identifiers import identifier, MessageObject
from drive_can_bridge.protocols.cannord.parameter_frame import (
    DOUBLE_RESPONSES, error_text, ParameterFrame, ParameterLayout, Response, RESPONSES, Task,
    WRITES,
)
from drive_can_bridge.protocols.cannord.process_data import (
    decode_extra, decode_main, EXTRA_LENGTH, MAIN_VALUES,
)
from drive_can_bridge.protocols.cannord.states import (
    CONTROL_PARAMETER, is_faulted, state_of, STATUS_PARAMETER,
)
from drive_can_bridge.protocols.observer import (
    Direction, DriveObserver, Emit, Kind, listed_by, raws_of, Verdict,
)
from drive_can_bridge.protocols.watches import CYCLES_WAITED, CyclicWatch, Questions

_REQUEST, _RESPONSE = Direction.REQUEST, Direction.RESPONSE
_CYCLIC, _PARAMETER = Kind.CYCLIC, Kind.PARAMETER

#: what tasks ask for that ask for no value
_TITLES = {Task.NONE: 'no task', Task.READ_ELEMENTS: 'read number of elements'}

TaskKey = tuple[int, int]
T = TypeVar('T', Task, Response)


class CannordObserver(DriveObserver):
    """
    Watches one inverter.

    :param leads: the inverter takes the commands for its broadcast group.
    :param foreign: broadcast identifiers that it may obey, and on which the bridge sends nothing.
    """

    def __init__(self, drive: DriveConfiguration, emit: Emit, *, leads: bool = False,
                 foreign: Collection[int] = ()) -> None:
        options = drive.options
        extended: bool = options.extended_identifiers
        super().__init__(drive.name, emit, extended=extended)
        objects = {kind: identifier(kind, drive.station, extended=extended)
                   for kind in MessageObject}
        self.handlers |= {
            objects[MessageObject.PROCESS_REQUEST]: self._take_request,
            objects[MessageObject.PROCESS_RESPONSE]: self._take_response,
            objects[MessageObject.PARAMETER_TASK]: self._take_task,
            objects[MessageObject.PARAMETER_RESPONSE]: self._take_task_response,
        }
        broadcast = broadcast_identifier(drive)
        self._paced_by_broadcast = leads and broadcast is not None
        if leads and broadcast is not None:
            self.handlers[broadcast] = self._take_broadcast
        self.handlers |= dict.fromkeys(foreign, self._take_foreign)
        self._decode_main = partial(decode_main, swap=options.swap_setpoints_2_3)
        self._layout = ParameterLayout(options.value_order, options.index_byte)
        #: of main frames, and of extra ones
        self._parameters = {
            direction: ((word, *values[:MAIN_VALUES]), values[MAIN_VALUES:])
            for direction, word, values in (
                (_REQUEST, CONTROL_PARAMETER, drive.cyclic_request),
                (_RESPONSE, STATUS_PARAMETER, drive.cyclic_response))}
        self._listed = listed_by(drive.profile.parameters.values(),
                                 lambda parameter: (parameter.number, parameter.subindex))
        # a member of a group is asked once in a while, and has one period to answer
        self._cycle = CyclicWatch(
            self, drive.period * (CYCLES_WAITED if broadcast is None else 1.0))
        self._questions: Questions[TaskKey, Task] = Questions(
            self, drive.parameter_timeout, self._unanswered)

    # -- process data -----------------------------------------------------------------------------

    def _take_broadcast(self, data: bytes, now: float) -> None:
        if len(data) != EXTRA_LENGTH:
            self._cycle.begin_cycle(now)
        self._show_request(data, now, 'broadcast')

    def _take_foreign(self, data: bytes, now: float) -> None:
        self._show_request(data, now, 'broadcast', Verdict.SUSPICIOUS,
                           'of another master: the file has no drive with this broadcast')

    def _take_request(self, data: bytes, now: float) -> None:
        if len(data) != EXTRA_LENGTH:
            self._cycle.ask(now, begins_cycle=not self._paced_by_broadcast)
        self._show_request(data, now, 'cyclic request')

    def _show_request(self, data: bytes, now: float, title: str,
                      verdict: Verdict = Verdict.NORMAL, remark: str = '') -> None:
        raws = self._main(data, now, _REQUEST, title)
        if raws:
            self.tell(now, _REQUEST, _CYCLIC, title, self._parameters[_REQUEST][0], raws,
                      verdict=verdict, remark=remark)

    def _main(self, data: bytes, now: float, direction: Direction, title: str) -> list[int]:
        """Return what a main frame holds; nothing: it is an extra one, or malformed, and told."""
        main, extra = self._parameters[direction]
        if len(data) == EXTRA_LENGTH:
            self.tell(now, direction, _CYCLIC, title, extra, raws_of(extra, decode_extra(data)))
            return []
        content = self.decoded(self._decode_main, data, now, direction, _CYCLIC, title)
        return [] if content is None else raws_of(main, (content.word, *content.values))

    def _take_response(self, data: bytes, now: float) -> None:
        title = 'cyclic response'
        raws = self._main(data, now, _RESPONSE, title)
        if not raws:
            return
        parameters, word = self._parameters[_RESPONSE][0], raws[0]
        remark = state_of(word).value
        needed = len(parameters)
        verdict, latency = self._cycle.answer(now)
        if len(raws) < needed:      # also where nobody was heard to ask
            verdict = Verdict.MALFORMED if verdict is Verdict.NORMAL else verdict
            remark = f'{len(raws) - 1} values, {needed - 1} needed; {remark}'
        if latency != latency and is_faulted(word):     # NaN: nobody asked
            verdict, remark = Verdict.NORMAL, f'{remark}, told without being asked'
        self.tell(now, _RESPONSE, _CYCLIC, title, parameters, raws, verdict=verdict,
                  remark=remark, latency=latency)

    # -- parameters -------------------------------------------------------------------------------

    def _frame(self, meaning: type[T], data: bytes) -> tuple[ParameterFrame, T]:
        frame = self._layout.decode(data)
        return frame, meaning(frame.identifier)

    def _take_task(self, data: bytes, now: float) -> None:
        decoded = self.decoded(partial(self._frame, Task), data, now, _REQUEST, _PARAMETER,
                               'parameter task')
        if decoded is None:
            return
        frame, task = decoded
        key = frame.number, frame.index
        self.observed.requests += 1
        self._questions.ask(key, task, now)
        _, double, _ = WRITES.get(task, (False, False, False))
        parameter = self._parameter(key, task, double=double)
        if task in WRITES:
            self.tell(now, _REQUEST, _PARAMETER, 'write', (parameter,),
                      (parameter.raw_from_word(frame.value if double else frame.word),))
        else:
            self.tell(now, _REQUEST, _PARAMETER, _TITLES.get(task, 'read'), (parameter,))

    def _take_task_response(self, data: bytes, now: float) -> None:
        decoded = self.decoded(partial(self._frame, Response), data, now, _RESPONSE, _PARAMETER,
                               'parameter response')
        if decoded is None:
            return
        frame, response = decoded
        key = self._key_of(frame, response)
        asked = self._questions.about.get(key)
        task = Task.READ if asked is None else asked
        verdict, latency = self._questions.answer(key, now)
        title = 'write' if task in WRITES else 'read'
        parameter = self._parameter(key, task, double=response in DOUBLE_RESPONSES)
        parameters: tuple[Parameter, ...] = (parameter,)
        raws: tuple[int, ...] = ()
        remark = ''
        if response is Response.REFUSED:
            verdict, remark = Verdict.REFUSED, error_text(frame.word)
        elif asked is not None and response not in RESPONSES[asked]:
            verdict, remark = Verdict.MALFORMED, f'response {int(response)} to task {int(asked)}'
        if response is Response.NONE:
            title, parameters, remark = 'no task', (), ''
        elif response is Response.ELEMENTS:
            title, remark = 'number of elements', f'{frame.word} elements'
        elif response is not Response.REFUSED:
            raws = parameter.raw_from_word(frame.answered),
        self.tell(now, _RESPONSE, _PARAMETER, title, parameters, raws, verdict=verdict,
                  remark=remark, latency=latency)

    def _key_of(self, frame: ParameterFrame, response: Response) -> TaskKey:
        """Return the task that a response belongs to; a refusal need not repeat the index."""
        key = frame.number, frame.index
        if response is Response.REFUSED and frame.index == 0:
            asked = self._questions.about
            return key if key in asked else next(
                (other for other in reversed(asked) if other[0] == frame.number), key)
        return key

    def _parameter(self, key: TaskKey, task: Task, *, double: bool) -> Parameter:
        """Return the parameter that a task is about, with the width that travels."""
        number, index = key
        array, _, _ = WRITES.get(task, (task is Task.READ_ARRAY, False, False))
        subindex = index if array or index else None
        listed = self._listed.get((number, subindex))
        if listed is not None and (listed.type.bits == 32) is double:
            return listed
        name = listed.name if listed is not None else f'p{number}' + (
            '' if subindex is None else f'.{subindex}')
        return Parameter(name, ParameterType.UINT32 if double else ParameterType.UINT16,
                         number=number, subindex=subindex, listed=False)

    def _unanswered(self, key: TaskKey, task: Task, due: float) -> None:
        self.tell_unanswered(due, _PARAMETER, 'parameter response',
                             (self._parameter(key, task, double=False),))
