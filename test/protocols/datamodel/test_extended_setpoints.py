# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Conversations about setpoints: what arms, fresh or neutral, refused, not bent."""

import math
from typing import Any

from builders import BOOL, INT16, parameter, RAM
from extended_builders import exchange, NEUTRAL, online
import pytest

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.events import SetpointsExpired
from drive_can_bridge.core.parameters import Value
from drive_can_bridge.core.setpoints import CommandOutcome

ACCEPTED, ARMED, NOT_ARMED = (
    CommandOutcome.ACCEPTED, CommandOutcome.ARMED, CommandOutcome.NOT_ARMED)


@pytest.mark.parametrize('options, value, outcome', [
    # true and 1 may be "run"
    ({'type': BOOL}, True, NOT_ARMED), ({'type': BOOL}, False, ARMED),
    ({}, 1, NOT_ARMED), ({}, 0, ARMED),
    ({'neutral': 50.0}, 51, NOT_ARMED), ({'neutral': 50.0}, 50, ARMED),
    # within one raw step, compared as values and not after rounding
    ({'scale': 10.0}, 14.9, NOT_ARMED), ({'scale': 10.0}, 10.0, ARMED),
    ({'scale': 10.0}, 10.1, NOT_ARMED), ({'scale': -10.0, 'type': INT16}, 10.0, ARMED),
    ({'scale': 0.1, 'neutral': 1.0}, 1.1, ARMED), ({'scale': 0.1, 'neutral': 1.0}, 1.2, NOT_ARMED),
    ({'scale': 0.1, 'offset': -5.0, 'type': INT16}, 0.0, NOT_ARMED),
    ({'scale': 0.1, 'offset': -5.0, 'type': INT16}, -5.0, ARMED),
])
def test_what_arms(options: dict[str, Any], value: Value, outcome: CommandOutcome) -> None:
    talk = online(request=(parameter('level', 60, storage=RAM, **options),), mapping='assume')
    assert talk.commands(0, value, 10.003) is outcome


def test_timeout_between_two_cycles_counts_as_well() -> None:
    talk = online(command_timeout=0.05, period=1.0)
    talk.commands(0, 0.0, 10.003)
    assert talk.commands(0, 100.0, 10.05) is ACCEPTED
    assert talk.commands(0, 100.0, 10.11) is NOT_ARMED
    assert talk.commands(0, 0.0, 10.12) is ARMED
    assert talk.session.setpoints.items[1].raw == 0
    talk.until(11.0)
    assert talk.events(SetpointsExpired) == [
        SetpointsExpired(('speed_setpoint',))] * 2


def test_timeout_that_is_set_while_running() -> None:
    talk = online(rearm_immediate=True, command_timeout=0.0)
    talk.commands(0, 100.0, 10.003)
    talk.session.reconfigure(command_timeout=0.01)
    assert exchange(talk, 10.02) == NEUTRAL
    talk.session.reconfigure(rearm_immediate=False)
    assert talk.commands(0, 100.0, 10.03) is NOT_ARMED
    talk.session.reconfigure(rearm_immediate=True, command_timeout=0.5)
    assert talk.commands(0, 100.0, 10.03) is ARMED
    assert talk.session.configuration.command_timeout == 0.5
    assert talk.session.configuration.rearm_immediate


def test_refused_value_arms_nothing_and_does_not_refresh_the_age() -> None:
    talk = online(rearm_immediate=True, command_timeout=0.05)
    with pytest.raises(ValueRefused):
        talk.commands(0, math.nan, 10.003)
    assert not talk.session.setpoints.items[0].armed
    talk.commands(0, 100.0, 10.003)
    for now, value in ((10.01, math.nan), (10.03, -3000.1), (10.05, True)):
        with pytest.raises(ValueRefused):
            talk.commands(0, value, now)
    assert exchange(talk, 10.02) == '003FFFF0#03E8000000000000'
    assert exchange(talk, 10.04) == '003FFFF0#03E8000000000000'
    assert exchange(talk, 10.06) == NEUTRAL
    assert talk.session.statistics.commands_refused == 4


@pytest.mark.parametrize('value, word', [
    (0.04, '0000'), (0.05, '0001'), (0.06, '0001'), (-0.04, '0000'), (-0.06, 'FFFF'),
    (2999.96, '7530'), (3000.0, '7530'), (-3000.0, '8AD0'), (1, '000A'),
])
def test_rounding_to_nearest(value: float, word: str) -> None:
    talk = online(rearm_immediate=True)
    talk.commands(0, value, 10.003)
    assert exchange(talk, 10.02) == f'003FFFF0#{word}000000000000'


