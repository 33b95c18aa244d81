# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Conversations about setpoints: what arms, fresh or neutral, refused, not bent."""

import math
from typing import Any

from builders import BOOL, INT16, parameter, RAM
from extended_builders import exchange, NEUTRAL, online
import pytest

from drive_can_bridge.core.errors import ValueRefused
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


def test_refused_value_arms_nothing_and_does_not_refresh_the_age() -> None:
    talk = online(rearm_immediate=True, command_timeout=0.05)
    with pytest.raises(ValueRefused):
        talk.commands(0, math.nan, 10.003)
    assert not talk.session.setpoints.items[0].armed
    talk.commands(0, 100.0, 10.003)
    assert exchange(talk, 10.02) == '003FFFF0#03E8000000000000'
    with pytest.raises(ValueRefused):
        talk.commands(0, -3000.1, 10.03)
    assert exchange(talk, 10.04) == '003FFFF0#03E8000000000000'
    assert exchange(talk, 10.06) == NEUTRAL
