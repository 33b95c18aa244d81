# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A bridge with another middleware: it is seen, and sent nothing.

The gids are those of rmw_cyclonedds 2.2.2 (Cyclone DDS 0.10.5): they begin with 01 10.
"""

from typing import Any

from bridges import LIFT, parameters, StartBridge
from clients import Client
import graph
import pytest
from rclpy.impl.implementation_singleton import rclpy_implementation
from waiting import clock

from drive_can_bridge.core.errors import SilentBridge
from drive_can_bridge.monitor.snapshot import OperationOutcome, StopAction as StopKind
from drive_can_bridge.ros.client.drive_commands import StopRequests
from drive_can_bridge.ros.client.graph import Graph
from drive_can_bridge.ros.client.search import find_bridges, find_drives
from drive_can_bridge.ros.monitor.client import ServiceOperations

CYCLONE = bytes.fromhex('0110a1b2c3d4e5f60718293a00001304')
FAST = bytes.fromhex('010f78fdf93be12b0000000000001304')
OTHER = bytes.fromhex('010178fdf93be12b0000000000001304')
TEXT = ('the bridge /drive_can_bridge runs on Cyclone DDS, this shell on Fast DDS '
        '(RMW_IMPLEMENTATION): services do not work between them')


class Seen:
    """
    What the graph shows of who serves.

    :ivar gids: of all services.
    :ivar sent: how many requests were sent.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.gids = [CYCLONE]
        self.sent = 0
        send = graph.Client.send_request

        def counted(client: Any, request: Any) -> Any:
            self.sent += 1
            return send(client, request)
        monkeypatch.setattr(graph.Client, 'send_request', counted)
        monkeypatch.setattr(
            rclpy_implementation, 'rclpy_get_subscriptions_info_by_topic',
            lambda node, topic, mangled: [{'endpoint_gid': [*gid]} for gid in self.gids]
            if mangled and topic.startswith('rq/') and topic.endswith('Request') else [])


@pytest.fixture(name='seen')
def _seen(bridge: StartBridge, monkeypatch: pytest.MonkeyPatch) -> Seen:
    bridge(parameters(lift=LIFT)).online()
    return Seen(monkeypatch)


@pytest.fixture(name='here')
def _here(seen: Seen) -> Any:
    here = Graph(clock())
    yield here
    here.close()


def test_it_is_named_at_once_and_sent_nothing(seen: Seen, here: Graph) -> None:
    for find in (lambda: find_drives(here, None), lambda: find_bridges(here, '*')):
        began = clock().now()
        with pytest.raises(SilentBridge) as told:
            find()
        assert str(told.value) == TEXT
        assert clock().now() - began < 1.0
    assert not seen.sent


def test_a_stop_says_that_it_may_still_be_running(seen: Seen, here: Graph) -> None:
    stop = StopRequests(here.client_node, None, [], ())
    assert here.wait(stop.look, 1.0)
    answers = {answer.name: answer.text for answer in stop.answers()}
    stop.close()
    assert answers == {'/drive_can_bridge': TEXT,
                       '/lift': f'{TEXT}: may still be running'}
    assert not seen.sent


def test_views_say_it_of_stops_and_values(seen: Seen, here: Graph) -> None:
    operations = ServiceOperations(here.client_node)
    said: list[OperationOutcome] = []
    operations.stop('/lift', StopKind.QUICK_STOP, said.append, clock().now())
    operations.write('/lift', 'ramp_time', 1.0, said.append, clock().now())

    def done(now: float) -> bool:
        operations.poll({}, now)
        return len(said) == 2
    assert here.wait(done, 2.0)
    assert {outcome.success for outcome in said} == {False}
    assert {outcome.text for outcome in said} == {TEXT, f'{TEXT}: it may still be running'}
    assert not seen.sent


@pytest.mark.parametrize('gids', [[FAST], [FAST, CYCLONE], [OTHER], []], ids=[
    'ours', 'of both', 'one that nobody knows', 'not found yet'])
def test_all_others_are_asked(seen: Seen, here: Graph, client: Client, gids: list[bytes]) -> None:
    seen.gids = gids
    assert find_drives(here, None) == {'lift': '/drive_can_bridge'}
    assert seen.sent
