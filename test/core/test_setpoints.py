# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Arming and ageing of setpoints, without a session around them."""

import math

from builders import INT16, LIMIT, parameter, SPEED
from hypothesis import given, strategies as st
import pytest

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.process_image import LastSent
from drive_can_bridge.core.setpoints import CommandOutcome, Setpoints


def setpoints(*, timeout: float = 0.5, immediate: bool = False, enabled: bool = True) -> Setpoints:
    made = Setpoints((SPEED, LIMIT), timeout=timeout, rearm_immediate=immediate)
    made.enabled = enabled
    made.changed = False
    return made


def test_starts_neutral_unarmed_and_closed() -> None:
    made = Setpoints((SPEED, parameter('n', 1, neutral=7.0)), timeout=0.5, rearm_immediate=True)
    assert [item.raw for item in made.items] == [0, 7]
    assert made.waiting == list(made.items)
    assert made.changed
    assert made.command(0, 0.0, 1.0) is CommandOutcome.NOT_ARMED


@pytest.mark.parametrize(('tolerance', 'arms', 'does_not'), [
    (0.0, 0.5, 0.6), (0.2, 0.5, 0.6), (2.0, 2.0, 2.1)])
@pytest.mark.parametrize('scale', [0.5, -0.5])
def test_what_arms_a_double_is_a_step_or_the_tolerance(scale: float, tolerance: float, arms: float,
                                                       does_not: float) -> None:
    """Whichever is more; the edge belongs to it."""
    coarse = parameter('coarse', 60, type=INT16, scale=scale, arming_tolerance=tolerance)
    for sign in (1.0, -1.0):
        made = Setpoints((coarse,), timeout=0.5, rearm_immediate=False)
        made.enabled = True
        assert made.command(0, sign * does_not, 1.0) is CommandOutcome.NOT_ARMED
        assert made.command(0, sign * arms, 1.0) is CommandOutcome.ARMED


def test_changed_says_whether_something_else_is_to_be_sent() -> None:
    made = setpoints(immediate=True)
    made.command(0, 0.0, 1.0)
    assert not made.changed
    made.command(0, 5.0, 1.0)
    assert made.changed
    made.changed = False
    made.command(0, 5.0, 1.1)
    assert not made.changed
    assert len(made.expire(2.0)) == 1
    assert made.changed


@pytest.mark.parametrize(('value', 'stops'), [
    (0.0, True), (0.1, True), (0.2, False), (5.0, False), (math.nan, False), (math.inf, False)])
def test_a_command_that_is_too_old_can_only_stop(value: float, stops: bool) -> None:
    made = setpoints(immediate=True)
    made.old_command(0, value)
    assert not made.changed and made.waiting == list(made.items)     # it arms nothing
    for index in (0, 1):
        made.command(index, 5.0, 1.0)
    made.changed = False
    made.old_command(0, value)
    assert [item.raw for item in made.items] == [0 if stops else 50, 50]
    assert [item.armed for item in made.items] == [not stops, True]
    assert made.changed is stops
    assert made.expire(1.4) == []     # nor does it refresh anything
    assert len(made.expire(2.0)) == 2 - stops


@pytest.mark.parametrize('value', [5e-324, -5e-324, 300 * 5e-324, 2.2e-308])
def test_an_integer_in_a_float_field_is_refused_and_stops(value: float) -> None:
    """It may have been the 0 that was to stop."""
    limit = parameter('torque', 4, type=INT16, limit=True)
    made = Setpoints((SPEED, LIMIT, limit), timeout=0.5, rearm_immediate=False)
    made.allow(True)
    with pytest.raises(ValueRefused, match=r'write 300\.0, not 300'):
        made.command(0, value, 1.0)
    assert not made.items[0].armed      # it equals neutral, and arms nothing
    for index in (0, 1):
        made.command(index, 0.0, 1.0)
        made.command(index, 5.0, 1.0)
    made.command(2, 7, 1.0)
    made.changed = False
    for index in (0, 2):
        with pytest.raises(ValueRefused, match=r'write 300\.0, not 300'):
            made.command(index, value, 1.1)
    assert made.changed
    assert [item.armed for item in made.items] == [False, True, True]
    assert [item.raw for item in made.items] == [0, 50, 7]
    made.old_command(1, value)          # one that is too late stops as well
    assert [item.armed for item in made.items] == [False, False, True]


def test_a_held_axis_stays_where_it_was_sent_by_an_integer_in_a_float_field() -> None:
    position = parameter('position', 60, type=INT16, neutral_from='actual', arming_tolerance=2.0)
    sent = LastSent([position])
    made = Setpoints((position,), timeout=0.5, rearm_immediate=False,
                     sample=(parameter('actual', 61, type=INT16),), sent=sent)
    made.measure([100], driven=False)
    made.allow(True)
    made.command(0, 100, 1.0)
    made.command(0, 130, 1.1)
    sent.take([120])
    with pytest.raises(ValueRefused):
        made.command(0, 300 * 5e-324, 1.2)
    assert (made.items[0].raw, made.items[0].armed) == (120, False)


def test_a_negative_integer_in_a_float_field_is_nan() -> None:
    made = setpoints()
    with pytest.raises(ValueRefused, match=r'^nan is not a finite .* write 300\.0, not 300'):
        made.command(0, math.nan, 1.0)


def test_an_axis_stays_what_was_sent_last() -> None:
    position = parameter('position', 60, type=INT16, neutral_from='actual', arming_tolerance=2.0)
    actual = parameter('actual', 61, type=INT16)
    sent = LastSent([position])
    made = Setpoints((position,), timeout=0.5, rearm_immediate=False, sample=(actual,), sent=sent)
    made.measure([100], driven=False)
    made.allow(True)
    made.command(0, 100, 1.0)
    made.command(0, 130, 1.1)
    sent.take([120])
    made.old_command(0, 110)        # the position that was latched is 100
    assert made.items[0].raw == 130
    made.old_command(0, 101)
    assert made.items[0].raw == 120
    assert not made.items[0].armed


def test_a_topic_that_begins_again_disarms_its_setpoint_and_no_limit() -> None:
    made = Setpoints((SPEED, LIMIT, parameter('torque', 4, type=INT16, limit=True)), timeout=0.5,
                     rearm_immediate=True)
    made.allow(True)
    for index in range(3):
        made.command(index, 5.0, 1.0)
    made.changed = False
    made.disarm_one(2)
    assert not made.changed
    made.disarm_one(0)
    assert made.changed
    assert [item.armed for item in made.items] == [False, True, True]
    assert [item.raw for item in made.items] == [0, 50, 5]


def test_refused_values_are_refused_even_while_closed() -> None:
    made = setpoints(enabled=False)
    with pytest.raises(ValueRefused):
        made.command(0, math.nan, 1.0)


def test_age_is_that_of_the_oldest_command() -> None:
    made = setpoints(immediate=True)
    assert math.isnan(made.age(1.0))
    made.command(0, 5.0, 1.0)
    made.command(1, 5.0, 1.2)
    assert made.age(1.3) == pytest.approx(0.3)
    made.disarm()
    assert math.isnan(made.age(1.3))


def test_disarm_forgets_what_expired_unnoticed() -> None:
    made = setpoints(immediate=True)
    made.command(0, 5.0, 1.0)
    made.command(0, 5.0, 3.0)
    made.disarm()
    assert made.expire(3.1) == []


def test_time_out_is_inclusive() -> None:
    made = setpoints(immediate=True)
    made.command(0, 5.0, 1.0)
    assert made.expire(1.5) == []
    assert made.expire(1.5 + 1e-9) == [made.items[0]]
    assert made.expire(9.0) == []


@given(st.lists(st.tuples(st.integers(0, 1), st.sampled_from([0.0, 0.1, 5.0, 10.0]),
                          st.sampled_from([0.0, 0.1, 0.2, 0.3, 0.6])), max_size=40),
       st.booleans(), st.sampled_from([0.0, 0.5]))
def test_agrees_with_a_simple_model(steps: list[tuple[int, float, float]], immediate: bool,
                                    timeout: float) -> None:
    made = setpoints(timeout=timeout, immediate=immediate)
    model: dict[int, tuple[int, float]] = {}
    now = 1.0
    for index, value, pause in steps:
        now += pause
        raw = round(value * 10)
        for key, (_, since) in list(model.items()):
            if 0 < timeout and now > since + timeout:
                del model[key]
        outcome = made.command(index, value, now)
        if index in model or immediate or raw <= 1:
            assert outcome is (CommandOutcome.ACCEPTED if index in model
                               else CommandOutcome.ARMED)
            model[index] = raw, now
        else:
            assert outcome is CommandOutcome.NOT_ARMED
        made.expire(now)
        assert [item.raw for item in made.items] == [
            model.get(key, (0, 0.0))[0] for key in range(2)]
        assert [item.armed for item in made.items] == [key in model for key in range(2)]
