# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""However slowly a drive answers its stop, it is over when the session says."""

from dataclasses import replace
from functools import partial

from builders import ACTUAL, CURRENT, DAMPING, drive, frame, GAIN, LIMIT, RAM, SPEED, STATUS
from conversation import Conversation
from drives import ExtendedDrive, Registers, StandardDrive
import pytest
from timeline import Timeline

from drive_can_bridge.core.events import Noted
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Storage

MAY_RUN = 'it may still be running'

#: s, just in time: an answer to a stop is waited for for 0.1 s
SLOW = 0.0995
REQUEST = (SPEED, LIMIT, GAIN, DAMPING)
REGISTERS = {50: 0, 51: 0, 40: 0, 41: 0, 209: 0, 210: 0, 211: 0,
             122: 50, 123: 51, 124: 40, 125: 41, 126: 209, 127: 210, 128: 211, 129: 0}


class Stubborn(Registers):
    """Registers that keep what they have, once told so."""

    stuck = False

    def __setitem__(self, number: int, raw: int) -> None:
        if not self.stuck:
            super().__setitem__(number, raw)


@pytest.mark.parametrize('storage', [RAM, None])
@pytest.mark.parametrize('protocol', ['datamodel_standard', 'datamodel_extended'])
def test_a_stop_that_does_not_take_ends_in_time(protocol: str, storage: Storage | None) -> None:
    registers = Stubborn(REGISTERS)
    device = (StandardDrive if protocol == 'datamodel_standard' else ExtendedDrive)(registers)
    request = [replace(each, storage=storage) for each in REQUEST]
    talk = Conversation(drive(protocol, request=request, response=(ACTUAL, CURRENT, STATUS),
                              command_timeout=0.0))
    delay = 0.001

    def answer(text: str) -> tuple[float, str] | None:
        answers: list[Frame] = device.takes(frame(text))
        return (delay, str(answers[0])) if answers else None
    line = Timeline(talk, answer)
    line.took(talk.begins())
    line.live(10.5)
    for index in range(4):
        for value in (0.0, 5.0) if index < 2 else (0, 5):
            talk.commands(index, value, 10.5)
    line.live(11.0)
    assert min(registers[number] for number in (50, 51, 40, 41)) > 0
    registers.stuck, delay = True, SLOW
    if protocol == 'datamodel_extended':    # whose maps have to be read again: stopped by numbers
        line.took(talk.handle_stall(11.0))
    line.plan(11.0001, partial(talk.deactivate))
    line.live(11.0001 + talk.session.longest_stop)
    assert talk.session.stopped
    said = [note.text for note in talk.events(Noted) if note.warning]
    assert any(MAY_RUN in text and 'read back' in text for text in said), said
