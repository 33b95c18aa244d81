# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What ``drive_can demo --drive`` commands."""

from collections.abc import Callable
import os
import signal
import sys
from typing import Any

import pytest
pytest.importorskip('rclpy')
import rclpy
from rclpy.node import Node
from rclpy.signals import uninstall_signal_handlers
from waiting import wait_for

from drive_can_bridge.core.parameters import Parameter, ParameterType, Value
from drive_can_bridge.resources import config_file
from drive_can_bridge.ros.demo import commander
from drive_can_bridge.ros.demo.commander import commanded, limits, neutral, SINE_PERIOD

SPEED = Parameter('speed_setpoint', ParameterType.INT16, scale=0.1, unit='rpm', scaled=True,
                  minimum=-3000, maximum=3000)
LIMIT = Parameter('torque_limit', ParameterType.UINT16, scale=0.1, unit='%', scaled=True,
                  minimum=0, maximum=300)
QUARTER = SINE_PERIOD / 4


@pytest.mark.parametrize(('parameter', 'elapsed', 'value'), [
    (SPEED, 0.0, 0.0),
    (SPEED, QUARTER, 900.0),
    (SPEED, 3 * QUARTER, -900.0),
    (LIMIT, QUARTER, 100.0),
    (Parameter('current_limit', ParameterType.INT16, scale=0.1, unit='A', scaled=True, minimum=-10,
               maximum=10), QUARTER, 3.0),
    (Parameter('speed', ParameterType.INT16), QUARTER, 9830),
    (Parameter('speed', ParameterType.INT16, scale=0.5, scaled=True, neutral=100.0, minimum=0,
               maximum=300), QUARTER, 130.0),
    (Parameter('digital_outputs', ParameterType.UINT16, maximum=15), QUARTER, 0),
    (Parameter('brake', ParameterType.BOOL), QUARTER, False),
])
def test_quantities_swing_and_limits_stand(parameter: Parameter, elapsed: float,
                                           value: Value) -> None:
    result = commanded(parameter, elapsed)
    assert result == pytest.approx(value)
    assert type(result) is type(value)


@pytest.mark.parametrize('parameter', [SPEED, LIMIT])
def test_nothing_is_commanded_that_would_be_refused(parameter: Parameter) -> None:
    low, high = limits(parameter)
    for step in range(200):
        value = commanded(parameter, step * SINE_PERIOD / 100)
        assert low <= value <= high
        parameter.raw_from_value(value)


def test_neutral_is_what_arms() -> None:
    parameter = Parameter('speed', scale=0.1, scaled=True, neutral=5.0)
    assert parameter.raw_from_value(neutral(parameter)) == parameter.neutral_raw


@pytest.mark.filterwarnings('error::pytest.PytestUnraisableExceptionWarning')
@pytest.mark.parametrize('number', [signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize(('owner', 'step'), [
    (rclpy, 'init'), (Node, 'create_publisher'), (Node, 'create_client'),
    (Node, 'create_subscription'), (Node, 'create_timer')],
    ids=['init', 'publisher', 'client', 'subscription', 'timer'])
def test_it_may_be_ended_while_it_still_begins(
        monkeypatch: pytest.MonkeyPatch, owner: Any, step: str, number: int) -> None:
    true_step: Callable[..., Any] = getattr(owner, step)

    def ended(*arguments: Any, **options: Any) -> Any:
        done = true_step(*arguments, **options)
        os.kill(os.getpid(), number)
        wait_for(lambda: not rclpy.ok(), 'the handler of rclpy')
        return done
    monkeypatch.setattr(owner, step, ended)
    monkeypatch.setattr(sys, 'argv', ['commander', str(config_file('demo.yaml'))])
    try:
        assert commander.main() == 0
    finally:
        rclpy.try_shutdown()
        uninstall_signal_handlers()
