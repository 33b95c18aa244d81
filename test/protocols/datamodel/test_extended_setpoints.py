# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Conversations about setpoints: neutral until armed, fresh or neutral, refused, not bent."""

import math
from typing import Any

from builders import (
    BOOL, CONTROL, Conversation, drive, FLAG, INT16, parameter, RAM, SPEED, WORD,
)
from extended_builders import ANSWER, checked, exchange, NEUTRAL, online
import pytest

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.events import DriveState, SetpointsExpired
from drive_can_bridge.core.parameters import Value
from drive_can_bridge.core.setpoints import CommandOutcome

ACCEPTED, ARMED, NOT_ARMED = (
    CommandOutcome.ACCEPTED, CommandOutcome.ARMED, CommandOutcome.NOT_ARMED)


@pytest.mark.parametrize('value, outcome, request_frame', [
    (0.0, ARMED, NEUTRAL),
    (0.1, ARMED, '003FFFF0#0001000000000000'),         # one raw step, inclusive
    (-0.1, ARMED, '003FFFF0#FFFF000000000000'),
    (0.2, NOT_ARMED, NEUTRAL), (-0.2, NOT_ARMED, NEUTRAL), (100.0, NOT_ARMED, NEUTRAL),
])
def test_only_neutral_arms(value: float, outcome: CommandOutcome, request_frame: str) -> None:
    talk = online()
    assert talk.commands(0, value, 10.003) is outcome
    assert exchange(talk, 10.02) == request_frame


def test_neutral_that_is_not_zero() -> None:
    talk = online(request=(parameter('level', 60, neutral=50.0),), mapping='assume')
    assert exchange(talk, 10.02) == '003FFFF0#0032000000000000'
    assert talk.commands(0, 0, 10.03) is NOT_ARMED
    assert talk.commands(0, 51, 10.03) is NOT_ARMED     # an integer arms exactly
    assert talk.commands(0, 50, 10.03) is ARMED
    assert talk.commands(0, 51, 10.03) is ACCEPTED
    assert exchange(talk, 10.04) == '003FFFF0#0033000000000000'


@pytest.mark.parametrize('options, value, outcome', [
    # true and 1 may be "run"
    ({'type': BOOL}, True, NOT_ARMED), ({'type': BOOL}, False, ARMED),
    ({}, 1, NOT_ARMED), ({}, 0, ARMED),
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


def test_arming_is_per_setpoint() -> None:
    talk = online()
    talk.commands(0, 0.0, 10.003)
    assert talk.commands(1, 100.0, 10.003) is NOT_ARMED
    assert talk.commands(0, 100.0, 10.004) is ACCEPTED
    assert exchange(talk, 10.02) == '003FFFF0#03E8000000000000'
    assert talk.session.state is DriveState.NOT_ARMED
    talk.commands(1, 0.0, 10.023)
    assert talk.session.state is DriveState.ONLINE
    talk.commands(1, 100.0, 10.024)
    assert exchange(talk, 10.04) == '003FFFF0#03E803E800000000'


def test_commands_before_the_drive_is_online_do_not_arm() -> None:
    talk = Conversation(drive(rearm_immediate=True))
    talk.bus_up(9.0)
    assert talk.commands(0, 0.0, 9.5) is NOT_ARMED
    talk.activate(9.998)
    assert talk.commands(0, 20.0, 9.9985) is NOT_ARMED
    checked(talk, 9.998)
    assert talk.at(10.0) == [NEUTRAL]
    assert talk.commands(0, 20.0, 10.001) is NOT_ARMED
    talk.hears(ANSWER, 10.002)
    assert exchange(talk, 10.02) == NEUTRAL
    assert talk.commands(0, 20.0, 10.023) is ARMED


def test_age_ends_at_the_timeout() -> None:
    talk = online(rearm_immediate=True, command_timeout=0.1)
    talk.commands(0, 100.0, 10.025)
    assert exchange(talk, 10.02) == '003FFFF0#03E8000000000000'
    for cycle in range(2, 7):
        assert exchange(talk, 10.0 + 0.02 * cycle) == '003FFFF0#03E8000000000000'
    assert exchange(talk, 10.14) == NEUTRAL
    assert talk.events(SetpointsExpired) == [SetpointsExpired(('speed_setpoint',))]
    assert talk.session.state is DriveState.NOT_ARMED


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


@pytest.mark.parametrize('value, reason', [
    (math.nan, 'not a finite number'), (math.inf, 'not a finite number'),
    (-math.inf, 'not a finite number'),
    (3000.1, 'out of range: -3000 to 3000 rpm'), (-3000.1, 'out of range'), (True, 'bool'),
])
def test_refused_value_changes_nothing_and_does_not_refresh_the_age(
        value: float, reason: str) -> None:
    talk = online(rearm_immediate=True, command_timeout=0.05)
    talk.commands(0, 100.0, 10.003)
    for now in (10.01, 10.03, 10.05):
        with pytest.raises(ValueRefused, match=reason):
            talk.commands(0, value, now)
    assert exchange(talk, 10.02) == '003FFFF0#03E8000000000000'
    assert exchange(talk, 10.04) == '003FFFF0#03E8000000000000'
    assert exchange(talk, 10.06) == NEUTRAL
    assert talk.session.statistics.commands_refused == 3


def test_refused_value_does_not_arm() -> None:
    talk = online(rearm_immediate=True)
    with pytest.raises(ValueRefused):
        talk.commands(0, math.nan, 10.003)
    assert not talk.session.setpoints.items[0].armed


def test_what_the_type_cannot_carry_is_refused() -> None:
    free = parameter('free', 60, scale=0.1)
    talk = online(request=(free, FLAG, parameter('count', 61)), mapping='assume',
                  rearm_immediate=True)
    for index, value in ((0, -0.1), (0, 6553.6), (1, 1.0), (1, 1), (2, 65536), (2, -1),
                         (2, 0.5), (2, False)):
        with pytest.raises(ValueRefused):
            talk.commands(index, value, 10.003)
    assert exchange(talk, 10.02) == NEUTRAL


@pytest.mark.parametrize('value, word', [
    (0.04, '0000'), (0.05, '0001'), (0.06, '0001'), (-0.04, '0000'), (-0.06, 'FFFF'),
    (2999.96, '7530'), (3000.0, '7530'), (-3000.0, '8AD0'), (1, '000A'),
])
def test_rounding_to_nearest(value: float, word: str) -> None:
    talk = online(rearm_immediate=True)
    talk.commands(0, value, 10.003)
    assert exchange(talk, 10.02) == f'003FFFF0#{word}000000000000'


def test_reconnection_disarms() -> None:
    talk = online(rearm_immediate=True)
    talk.commands(0, 100.0, 10.003)
    talk.bus_down(10.01)
    assert not talk.session.setpoints.items[0].armed
    assert talk.commands(0, 100.0, 10.011) is NOT_ARMED
    talk.bus_up(10.998)
    checked(talk, 10.998)
    assert talk.at(11.0) == [NEUTRAL]
    talk.hears(ANSWER, 11.001)
    assert exchange(talk, 11.02) == NEUTRAL


def test_control_word_is_no_setpoint() -> None:
    talk = online(request=(WORD, SPEED), control=CONTROL, mapping='assume', rearm_immediate=True)
    assert [item.parameter.name for item in talk.session.setpoints.items] == ['speed_setpoint']
    assert exchange(talk, 10.02) == NEUTRAL
