# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Finding CANnord inverters.

They are recognised by requests and answers that follow each other, or by a read.
"""

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.protocols.cannord.identifiers import (
    ADDRESS_MAX, decode_identifier, identifier, MessageObject)
from drive_can_bridge.protocols.cannord.parameter_frame import (
    LENGTH, ParameterLayout, ResponseId, Task)
from drive_can_bridge.protocols.cannord.process_data import decode_main
from drive_can_bridge.protocols.cannord.states import ACKNOWLEDGE, QUICK_STOP, READY, RUN, state_of
from drive_can_bridge.protocols.scanner import Scanner

#: the parameter that is read: the fault number. As a DataModel request its first byte, BCh, is no
#: function, so that it writes nothing there
PARAMETER = 700
_NUMBER_BITS = 0x07FF
#: what an answer may be asked for by
_TASKS = {int(task): task for task in Task if task is not Task.NONE}
#: the service that goes on beside process data
_PARAMETERS = 1
#: control words that masters send; the bits of direction and parameter set left out
_CONTROL_WORDS = (READY, RUN, QUICK_STOP, ACKNOWLEDGE)
_CONTROL_MASK = 0x27FF


class CannordScanner(Scanner):
    """Recognises process data and parameter frames of 11 bits, and reads one parameter."""

    protocol = 'cannord'
    hazard = frame_sentences.hazard_cannord()

    def begin(self) -> None:
        data = ParameterLayout().encode(Task.READ, PARAMETER)
        self._questions += [Frame(identifier(MessageObject.PARAMETER_TASK, address), data, False)
                            for address in range(ADDRESS_MAX + 1)]

    def receive(self, frame: Frame, now: float) -> None:
        found = None if frame.extended else decode_identifier(frame.identifier)
        if found is None:
            return
        kind, station = found
        data = frame.data
        if kind is MessageObject.PROCESS_REQUEST and len(data) in (4, 8) and (
                decode_main(data).word & _CONTROL_MASK in _CONTROL_WORDS):
            self._request(station, data, now)
        elif kind is MessageObject.PARAMETER_TASK and len(data) == LENGTH:
            self._request(station, data, now, service=_PARAMETERS)
        elif kind is MessageObject.PROCESS_RESPONSE and len(data) in (4, 8):
            state = state_of(decode_main(data).word)
            self._answer(station, f'process data, state "{state.value}"', now,
                         lambda request: len(request) == len(data))
        elif kind is MessageObject.PARAMETER_RESPONSE and len(data) == LENGTH:
            self._answer(station, f'answers to tasks for P{_number(data)}', now,
                         lambda request: _follows(request, data), service=_PARAMETERS)


def _follows(request: bytes, data: bytes) -> bool:
    """Return whether a response may follow a task: others use these identifiers, too."""
    task = _TASKS.get(request[1] >> 4)
    return task is not None and _number(request) == _number(data) and (
        data[1] >> 4 in (*task.responses, ResponseId.REFUSED))


def _number(data: bytes) -> int:
    return int.from_bytes(data[:2], 'little') & _NUMBER_BITS
