# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Watching one CANnord inverter: process data, broadcasts that it leads, parameter tasks.

An answer to process data counts for the last frame that the inverter was sent. In a broadcast
group that is the individual frame of its turn; nobody answers the broadcast.
"""

from collections.abc import Collection, Sequence
from functools import partial
from typing import TypeVar

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.protocols.cannord.identifiers import (
    broadcast_identifier, identifier, MessageObject)
from drive_can_bridge.protocols.cannord.parameter_frame import (
    error_text, ParameterFrame, ParameterLayout, ResponseId, Task)
from drive_can_bridge.protocols.cannord.process_data import (
    decode_extra, decode_main, EXTRA_LENGTH, MAIN_VALUES)
from drive_can_bridge.protocols.cannord.states import (
    CONTROL_PARAMETER, is_faulted, state_of, STATUS_PARAMETER)
from drive_can_bridge.protocols.observer import (
    DriveObserver, Emit, listed_by, raws_of, TelegramKind, Verdict)
from drive_can_bridge.protocols.pairing import (
    CYCLES_WAITED, CyclicWatch, PendingRequests, RequestContent)
from drive_can_bridge.protocols.telegrams import Direction

_REQUEST, _RESPONSE = Direction.REQUEST, Direction.RESPONSE
_CYCLIC, _PARAMETER = TelegramKind.CYCLIC, TelegramKind.PARAMETER

#: what tasks ask for that ask for no value
_TITLES = {Task.NONE: 'no task', Task.READ_ELEMENTS: 'read number of elements'}

#: what responses are called that are none to reads or writes
_ANSWER_TITLES = {ResponseId.NONE: 'no task', ResponseId.ELEMENTS: 'number of elements'}

TaskKey = tuple[int, int]
#: of a task: its key, itself, and whether a double word travels
Span = tuple[TaskKey, Task, bool]
T = TypeVar('T', Task, ResponseId)


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
        }
        self.listen(objects[MessageObject.PARAMETER_TASK], _REQUEST, _PARAMETER, 'parameter task',
                  partial(self._frame, Task), self._take_task)
        self.listen(objects[MessageObject.PARAMETER_RESPONSE], _RESPONSE, _PARAMETER,
                  'parameter response', partial(self._frame, ResponseId), self._take_task_response)
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
        self._requests: PendingRequests[TaskKey] = PendingRequests(
            self, drive.parameter_timeout, self._content, missing='parameter response')

    # -- process data -----------------------------------------------------------------------------

    def _take_broadcast(self, data: bytes, now: float) -> None:
        if len(data) != EXTRA_LENGTH:
            self._cycle.begin_cycle(now)
        self._show_request(data, now, 'broadcast')

    def _take_foreign(self, data: bytes, now: float) -> None:
        self._show_request(data, now, 'broadcast', Verdict.SUSPICIOUS,
                           frame_sentences.broadcast_of_others())

    def _take_request(self, data: bytes, now: float) -> None:
        if len(data) != EXTRA_LENGTH:
            self._cycle.ask(now, begins_cycle=not self._paced_by_broadcast)
        self._show_request(data, now, 'cyclic request')

    def _show_request(self, data: bytes, now: float, title: str,
                      verdict: Verdict = Verdict.NORMAL, remark: str = '') -> None:
        raws = self._main(data, now, _REQUEST, title)
        if raws:
            self.report(now, _REQUEST, _CYCLIC, title, self._parameters[_REQUEST][0], raws,
                      verdict=verdict, remark=remark)

    def _main(self, data: bytes, now: float, direction: Direction, title: str) -> list[int]:
        """Return the content of a main frame; []: an extra one, or malformed (reported)."""
        main, extra = self._parameters[direction]
        if len(data) == EXTRA_LENGTH:
            self.report(now, direction, _CYCLIC, title, extra, raws_of(extra, decode_extra(data)))
            return []
        content = self.decoded(self._decode_main, data, now, direction, _CYCLIC, title)
        return [] if content is None else raws_of(main, (content.word, *content.values))

    def _take_response(self, data: bytes, now: float) -> None:
        title = 'cyclic response'
        raws = self._main(data, now, _RESPONSE, title)
        if not raws:
            return
        parameters, word = self._parameters[_RESPONSE][0], raws[0]
        remark: str = state_of(word).value
        needed = len(parameters)
        verdict, latency = self._cycle.answer(now)
        if len(raws) < needed:      # also where nobody was heard to ask
            verdict = Verdict.MALFORMED if verdict is Verdict.NORMAL else verdict
            remark = frame_sentences.fewer_values(len(raws) - 1, needed - 1, remark)
        if latency != latency and is_faulted(word):     # NaN: nobody asked
            verdict, remark = Verdict.NORMAL, frame_sentences.said_unasked(remark)
        self.report(now, _RESPONSE, _CYCLIC, title, parameters, raws, verdict=verdict,
                  remark=remark, latency=latency)

    # -- parameters -------------------------------------------------------------------------------

    def _frame(self, meaning: type[T], data: bytes) -> tuple[ParameterFrame, T]:
        frame = self._layout.decode(data)
        return frame, meaning(frame.identifier)

    def _take_task(self, told: tuple[ParameterFrame, Task], now: float) -> None:
        frame, task = told
        key = frame.number, frame.index
        words = (frame.value if task.double else frame.word,) if task.writes else None
        self._requests.ask(key, (key, task, task.double), now, words, title=_TITLES.get(task, ''))

    def _take_task_response(self, told: tuple[ParameterFrame, ResponseId], now: float) -> None:
        frame, response = told
        key = self._key_of(frame, response)
        asked = self._requests.about.get(key)
        task: Task = Task.READ if asked is None else asked.span[1]
        refused = response is ResponseId.REFUSED
        span = None if response is ResponseId.NONE else (key, task, response.double)
        fits = asked is None or refused or response in task.responses
        valued = response not in _ANSWER_TITLES
        self._requests.answer(
            key, RequestContent(span, task.writes, title=_ANSWER_TITLES.get(response, '')), now,
            (frame.answered,) if valued else None,
            refusal=error_text(frame.word) if refused else '',
            wrong='' if fits else frame_sentences.response_to_task(int(response), int(task)),
            remark=f'{frame.word} elements' if response is ResponseId.ELEMENTS else '')

    def _key_of(self, frame: ParameterFrame, response: ResponseId) -> TaskKey:
        """Return the task that a response belongs to; a refusal need not repeat the index."""
        key = frame.number, frame.index
        if response is ResponseId.REFUSED and frame.index == 0:
            asked = self._requests.about
            return key if key in asked else next(
                (other for other in reversed(asked) if other[0] == frame.number), key)
        return key

    def _content(self, span: Span | None, words: Sequence[int] | None,
                 ) -> tuple[tuple[Parameter, ...], list[int]]:
        """Return the parameter that a task is about, with the width that travels; its value."""
        if span is None:
            return (), []
        (number, index), task, double = span
        subindex = index if task.array or index else None
        parameter = self._listed.get((number, subindex))
        if parameter is None or (parameter.type.bits == 32) is not double:
            name = parameter.name if parameter is not None else f'p{number}' + (
                '' if subindex is None else f'.{subindex}')
            parameter = Parameter(
                name, ParameterType.UINT32 if double else ParameterType.UINT16,
                number=number, subindex=subindex, listed=False)
        return (parameter,), raws_of([parameter], words or ())
