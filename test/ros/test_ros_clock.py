# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The system clock is set while drives move: nothing happens."""

import time

from bridges import CONVEYOR, parameters, StartBridge
from clients import Client, wait_until
import pytest
from rclpy.clock import Clock
from std_msgs.msg import Float64

from drive_can_bridge.ros.stamps import Stamps
from drive_can_bridge.transport.clock import steady_now

REAL_TIME, REAL_TIME_NS = time.time, time.time_ns


@pytest.mark.parametrize('hours', [-48.0, 48.0], ids=['back', 'forward'])
def test_clock_that_is_set(bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch,
                           hours: float) -> None:
    offset = [0.0]

    def set_time() -> float:
        return REAL_TIME() + offset[0]
    monkeypatch.setattr(time, 'time', set_time)
    monkeypatch.setattr(time, 'time_ns', lambda: REAL_TIME_NS() + int(offset[0] * 1e9))
    monkeypatch.setattr('can.bus.time', set_time)
    one = bridge(parameters(conveyor=CONVEYOR))
    one.online()
    session = one.node.drives['conveyor'].session
    client.publish('/conveyor/command/torque_limit', Float64(data=0.0))
    client.publish('/conveyor/command/speed_setpoint', Float64(data=0.0))
    client.publish('/conveyor/command/speed_setpoint', Float64(data=150.0))
    wait_until(lambda: session.setpoints.items[0].raw == 1500 and not session.setpoints.waiting)
    for step in (hours, -hours, hours):
        missed, wanted = session.statistics.missed, session.statistics.exchanges + 20
        offset[0] += 3600.0 * step
        wait_until(lambda wanted=wanted: session.statistics.exchanges >= wanted)
        assert session.statistics.missed <= missed + 5
        assert session.online
        # neither armed again nor timed out
        assert session.setpoints.items[0].raw == 1500
        assert not session.setpoints.waiting
    assert client.get('/conveyor', 'ramp_time') != [None]
    assert not one.errors


def test_a_stamp_is_that_of_the_moment_not_of_the_look() -> None:
    before = time.time()
    seconds, nanoseconds = Stamps(Clock()).at(steady_now() - 1000.0)
    assert before - 1000.001 <= seconds + 1e-9 * nanoseconds <= time.time() - 999.999


def test_the_same_moment_has_the_same_stamp() -> None:
    # a sample that stands in several messages, of ~/joint_states say, is no younger in the first
    stamps, moment = Stamps(Clock()), steady_now()
    assert len({stamps.at(moment) for _ in range(100)}) == 1
    assert stamps.at(moment + 0.001) > stamps.at(moment)
