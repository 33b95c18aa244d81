# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""An enabled servo on a healthy bus, beside a gateway that refuses, or does not answer."""

from typing import Any
from unittest.mock import patch

from bridges import parameters, StartBridge
from clients import Client, wait_until
import pytest
from std_srvs.srv import SetBool
from waiting import clock
import world

from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import BusUnavailable
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.transport import link
from drive_can_bridge.transport.end_point import EndPoint

PERIOD = 0.01
SERVO: dict[str, Any] = {
    'bus': 'main', 'protocol': 'cia402', 'station': 5, 'profile': 'cia402_servo', 'mode': 'pv',
    'period': PERIOD, 'command_timeout': 0.0, 'cyclic_request': ['target_velocity'],
    'cyclic_response': ['actual_velocity']}
BUS = {'interface': 'virtual', 'bitrate': 1_000_000, 'reconnect_period': 0.2}


@pytest.mark.parametrize('takes', [0.0, 2.0, 40.0], ids=['refuses', 'times out', 'hangs'])
def test_a_healthy_bus_waits_for_no_other(bridge: StartBridge, client: Client,
                                          takes: float) -> None:
    content = parameters(
        buses={'main': dict(BUS), 'gateway': dict(BUS)}, servo=SERVO,
        other={**SERVO, 'bus': 'gateway', 'station': 6})
    good, began = link.open_port, clock().now()
    attempts: list[float] = []

    def opened(bus: BusConfiguration, *args: Any, **keys: Any) -> EndPoint:
        if bus.name != 'gateway':
            return good(bus, *args, **keys)
        attempts.append(clock().now())
        clock().wait(clock().now() + takes)
        raise BusUnavailable('the gateway 127.0.0.1:29536 refuses')
    with patch.object(link, 'open_port', opened):
        one = bridge(content)
        assert clock().now() - began < 1.0, 'from the start to the first frame'
        one.online('servo')
        assert client.call('/servo/enable', SetBool, SetBool.Request(data=True)).success
        session = one.node.drives['servo'].session
        cycles: list[float] = []

        def see(frame: Frame) -> None:
            if frame.identifier == 0x080:
                cycles.append(clock().now())
        assert world.current is not None
        world.current.wires.of(one.channel()).watchers.append(see)
        begun, missed = clock().now(), session.statistics.missed
        wait_until(lambda: clock().now() > begun + 5.0)
        # each attempt cost the servo nothing: no exchange is late, none is missing
        gaps = [later - sooner for sooner, later in zip(cycles, cycles[1:])]
        assert len(cycles) >= 495
        assert max(gaps) < 1.5 * PERIOD
        assert session.statistics.missed == missed and session.online
        assert len(attempts) >= {0.0: 10, 2.0: 3, 40.0: 1}[takes]
