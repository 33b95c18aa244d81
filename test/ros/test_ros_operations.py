# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Stops that a monitor or panel asks for."""

from typing import Any

from clients import Client, wait_until
import rclpy
from std_srvs.srv import Trigger

from drive_can_bridge.monitor.source import Outcome, Stop
from drive_can_bridge.ros.monitor.inbox import OFFER_TIMEOUT
from drive_can_bridge.ros.monitor.operations import Operations


def test_a_stop_waits_a_moment_for_whoever_offers_it(client: Client) -> None:
    """A drive has several services, and each is found by itself."""
    def answer(_: Any, response: Any) -> Any:
        response.success, response.message = True, 'stopped'
        return response

    now, told = 100.0, list[Outcome]()
    node = rclpy.create_node('asking', context=client.node.context, enable_rosout=False,
                             start_parameter_services=False)
    operations = Operations(node)
    try:
        operations.poll(['/lift'], now)
        operations.stop('/lift', Stop.QUICK_STOP, told.append, now)
        assert operations.poll(['/lift'], now)
        assert told == []
        service = client.node.create_service(Trigger, '/lift/quick_stop', answer)
        try:
            wait_until(lambda: not operations.poll(['/lift'], now), what='an answer')
            assert told == [Outcome(True, 'stopped')]
            operations.stop('/lift', Stop.DISABLE, told.append, now)
            assert operations.poll(['/lift'], now + OFFER_TIMEOUT - 0.1)
            assert not operations.poll(['/lift'], now + OFFER_TIMEOUT)
            assert told[1:] == [Outcome(False, 'nobody answered: is its bridge still running?')]
            operations.stop('/conveyor', Stop.DISABLE, told.append, now)
            assert 'nobody offers /conveyor/enable: no control word' in told[-1].text
        finally:
            client.node.destroy_service(service)
    finally:
        node.destroy_node()
