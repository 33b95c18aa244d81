# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Cycles that are brought forward, for a stop or as commands are too old, do no harm."""

from functools import partial
from typing import Any

from builders import drive, INT16, parameter
from conversation import Conversation
import pytest
from timeline import Timeline

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import StationLost

SETPOINTS = tuple(parameter(f'setpoint_{number}', None, type=INT16) for number in (1, 2, 3))


def inverter(count: int, delay: float, **options: Any) -> Timeline:
    """Return an enabled inverter at 10.45 s: 10 cycles a second, each answered after ``delay``."""
    talk = Conversation(drive(
        'cannord', table=SETPOINTS, request=SETPOINTS[:count], response=(), period=0.1,
        **options))

    def answer(text: str) -> tuple[float, str] | None:
        if not text.startswith('002#'):     # a broadcast
            return None
        status = '370B' if text.startswith('002#7F04') else '310B'
        return delay, f'003#{status}{"0000" * count}'

    line = Timeline(talk, answer)
    talk.begins()
    line.plan(10.15, partial(talk.asks, ControlAction.ENABLE))
    line.live(10.45)
    assert talk.session.online
    assert operating(line)
    return line


def command(line: Timeline, index: int, value: float, now: float) -> list[str]:
    line.talk.commands(index, value, now)
    return line.talk.at(now)


def operating(line: Timeline) -> bool:
    control = line.talk.session.control
    return control is not None and control.operating


@pytest.mark.parametrize('limit', [1, 3])
def test_an_inverter_that_answers_everything_is_not_lost(limit: int) -> None:
    """Commands cease; a cycle for each of them would come before the answer to the last one."""
    line = inverter(3, 0.02, missed_limit=limit, command_timeout=0.5)
    for index in range(3):      # cycles begin at 10.5, 10.6, ... 11.0
        line.plan(10.46 + 0.006 * index, partial(command, line, index, 0.0))
        line.plan(10.505 + 0.006 * index, partial(command, line, index, 5.0))
    line.live(12.0)
    assert line.talk.events(StationLost) == [], line.log
    assert [at for at, _ in line.log if 11.0 < at < 11.1], 'brought forward, all the same'


@pytest.mark.parametrize('broadcast', ['none', 'group'])
@pytest.mark.parametrize('since', [0.006, 0.015, 0.03])
def test_nor_is_one_by_its_stop(since: float, broadcast: str) -> None:
    """What is under way has its time, even if a stop does not wait for that."""
    line = inverter(1, 0.04, missed_limit=1, broadcast=broadcast)
    line.plan(10.5 + since, partial(line.talk.asks, ControlAction.QUICK_STOP))
    line.live(12.0)
    assert line.talk.events(StationLost) == [], line.log
    assert line.when('002#7A040000')[0] == pytest.approx(10.5 + since)
    assert [done[:2] for done in line.talk.control_outcomes()][-1] == ('quick_stop', True)


def test_one_that_answers_no_more_is_lost_however_often_cycles_are_brought_forward() -> None:
    line = inverter(1, 0.02, missed_limit=3, command_timeout=0.06, rearm_immediate=True)
    for place in range(60):
        line.plan(10.5 + 0.065 * place, partial(command, line, 0, 5.0 + place % 2))
    line.live(11.0)
    line.answer = lambda text: None
    line.live(11.5)
    assert len(line.talk.events(StationLost)) == 1


def test_neutral_that_expires_hurries_nothing() -> None:
    """0 is commanded every 30 ms, and is too old after 20 ms: that changes nothing."""
    line = inverter(1, 0.002, command_timeout=0.02)
    for place in range(51):
        line.plan(10.5 + 0.03 * place, partial(command, line, 0, 0.0))
    line.live(12.0)
    assert operating(line)
    late = [text for at, text in line.log if at > 11.0]
    assert set(late) == {'002#7F040000'}
    assert len(late) <= 11
