# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The tables of control requests: each of their rows is needed, in a conversation with a drive."""

from collections.abc import Iterator
from itertools import product

from extent import some
import pytest
from test_control import (
    cycle, ENABLE, ENABLED, FAULT, FULL, NO_FAULT, ONLY_FAULT, READY, RESET, RUN,
)

from drive_can_bridge.core import control_machine
from drive_can_bridge.core.control import (
    ControlAction, ControlRequest, ControlStep, Meeting, MEETINGS, STEPS, Then)
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.profile import ControlTable

#: states of a drive, and the cycle in which the first request comes then
STATES = {'unknown': 0, 'off': 2, 'faulted': 2, 'enabled': 5, 'fails': 6}
#: what the drive is when the first request comes, the requests, and cycles between them
Story = tuple[ControlTable, str, ControlAction, ControlAction, int]


def stories() -> Iterator[Story]:
    yield from product((FULL, NO_FAULT, ONLY_FAULT), STATES, ControlAction, ControlAction,
                       (0, 1, 2, 6))


def live(story: Story) -> list[object]:
    """
    Return the words that a drive gets, whether it counts as operating, and the answers.

    It runs by the second 0001h, brakes for three cycles, also when it fails, and loses a fault by
    the third 0080h.
    """
    table, state, first, second, later = story
    control = ControlMachine(table, timeout=2.0)
    said: list[object] = []
    asks = [(STATES[state], first), (STATES[state] + later, second)]
    if state in ('enabled', 'fails'):
        asks.insert(0, (0, ENABLE))
    faulted, resets, starting, running = state == 'faulted', 0, 0, 0
    for place in range(16):
        now = 0.02 * place
        for at, action in asks:
            if at == place:
                control.request(ControlRequest(action), now)
        word = control.word
        resets += word == RESET
        faulted = (faulted or state == 'fails' and place == 5) and resets < 3
        starting = starting + 1 if word == RUN and not faulted else 0
        running = 3 if starting > 1 else max(0, running - 1)
        status = (ENABLED if running else READY) & ~int(faulted) | FAULT * faulted
        said.append(cycle(control, None if place == 0 else status, now))
        said += [(done.request.action, done.success) for done in control.take_completed()]
        said += ['operating'] * control.operating
    return said


@pytest.fixture(scope='module', name='expected')
def _expected() -> dict[Story, list[object]]:
    return {story: live(story) for story in stories()}


@pytest.mark.parametrize('step', STEPS)
def test_each_step_is_needed(step: ControlStep, expected: dict[Story, list[object]],
                             monkeypatch: pytest.MonkeyPatch) -> None:
    """Missing, with anything else that follows, or with one condition less."""
    place = STEPS.index(step)
    changes = [(), *[(step._replace(then=then),) for then in Then if then is not step.then],
               *[(step._replace(when=tuple(seen for seen in step.when if seen is not left)),)
                 for left in step.when]]
    for change in some(changes, 4):
        monkeypatch.setattr(
            control_machine, 'STEPS', (*STEPS[:place], *change, *STEPS[place + 1:]))
        assert any(live(story) != words for story, words in expected.items()), change


@pytest.mark.parametrize('pair', MEETINGS)
def test_each_meeting_is_needed(pair: tuple[ControlAction, ControlAction],
                                expected: dict[Story, list[object]],
                                monkeypatch: pytest.MonkeyPatch) -> None:
    for meeting in Meeting:
        if meeting is not MEETINGS[pair]:
            monkeypatch.setattr(control_machine, 'MEETINGS', {**MEETINGS, pair: meeting})
            assert any(live(story) != words for story, words in expected.items()), meeting
