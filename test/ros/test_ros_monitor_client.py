# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a monitor learns of a bridge, and what it asks for while it looks."""

from collections.abc import Callable
from typing import Any

from bridges import LIFT, parameters, StartBridge
from clients import Client, wait_until
import pytest
from rcl_interfaces.srv import ListParameters
from waiting import clock

from drive_can_bridge.monitor.model import Model
from drive_can_bridge.monitor.snapshot import DriveSnapshot, Place, Snapshot, Status, StopAction
from drive_can_bridge.ros.client import calls
from drive_can_bridge.ros.monitor import client as monitor_client
from drive_can_bridge.ros.monitor.client import MonitorClient, ServiceOperations


class Looking:
    """A monitor's node, and somebody who looks at what it has found."""

    def __init__(self) -> None:
        self.model = Model()
        self.source = MonitorClient(self.model)

    def look(self) -> Snapshot:
        """Let it look once."""
        self.source.poll(clock().now())
        return self.model.look(clock().now(), 0.0)

    def sees(self, condition: Callable[[DriveSnapshot], Any]) -> DriveSnapshot:
        """Return the lift as soon as it is as wanted."""
        def found() -> DriveSnapshot | None:
            lift = self.look().drive('/lift')
            return lift if lift is not None and condition(lift) else None
        lift = wait_until(found, 10.0, 'the lift')
        assert isinstance(lift, DriveSnapshot)
        return lift


@pytest.fixture(name='looking')
def _looking(bridge: StartBridge) -> Any:
    bridge(parameters(lift=LIFT)).online()
    looking = Looking()
    yield looking
    looking.source.close()


def test_where_a_drive_is_and_what_it_has(looking: Looking, client: Client,
                                          monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(monitor_client, '_BATCH', 2)
    names = client.call('/lift/list_parameters', ListParameters).result.names
    assert len(names) > 4
    lift = looking.sees(lambda lift: len(lift.parameters) >= len(names))
    assert sorted(info.name for info in lift.parameters) == sorted(names)
    assert lift.place == Place('main', '2', 'datamodel_extended', 0.02)
    assert lift.online
    assert ('INFO', 'online') in [(line.level, line.text.rpartition(': ')[2])
                                  for line in looking.look().log]


def test_hundreds_of_drives_are_got_to_know_a_few_at_a_time(
        looking: Looking, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []

    def noted(kind: type) -> type:
        class Noted(kind):  # type: ignore[misc, valid-type]
            def __init__(self, node: Any, of: Any, name: str, *more: Any) -> None:
                made.append(name)
                super().__init__(node, of, name, *more)
        return Noted
    monkeypatch.setattr(monitor_client, 'Inbox', noted(monitor_client.Inbox))
    monkeypatch.setattr(monitor_client, 'Service', noted(monitor_client.Service))
    monkeypatch.setattr(calls, 'Service', noted(calls.Service))
    drives = [f'drive_{number}' for number in range(150)]
    facts = {'state': 'online', 'exchanges': '1', 'missed_exchanges': '0'}
    looking.model.diagnosed([Status(f'many: drive {drive}', 0, '', facts) for drive in drives],
                            0.0, clock().now())
    stops = {f'/{drive}': (StopAction.QUICK_STOP,) for drive in drives}
    operations = ServiceOperations(looking.source.node)
    looks = 0
    # each of these takes DDS a while, during which nobody sees or stops anything
    while not all(f'/{drive}/{name}' in made for drive in drives
                  for name in ('online', 'response', 'list_parameters', 'quick_stop')):
        looking.source.focus('/drive_140')
        before = len(made)
        looking.look()
        assert len(made) - before <= 80
        before = len(made)
        operations.poll(stops, clock().now())
        assert len(made) - before <= 16
        looks += 1
        if looks == 1:      # what is looked at comes first
            assert {'/drive_140/response', '/drive_140/list_parameters'} <= set(made)
        assert looks < 50


def test_a_bridge_that_tells_seldom_is_not_silent(bridge: StartBridge, client: Client) -> None:
    bridge({**parameters(lift={**LIFT, 'period': 0.5}), 'diagnostics_period': 10.0}).online()
    looking = Looking()

    def silent(seconds: float) -> set[bool]:
        found, end = set(), clock().now() + seconds
        while clock().now() < end:
            clock().wait(clock().now() + 0.5)
            found |= {each.silent > 0.0 for each in looking.look().bridges}
        return found
    assert silent(35.0) == {False}
    # what was told is true no longer
    assert client.set('/drive_can_bridge', diagnostics_period=1.0) == [(True, '')]
    assert silent(5.0) == {False}
    assert client.set('/drive_can_bridge', diagnostics_period=60.0) == [(True, '')]
    assert silent(150.0) == {False}
    looking.source.close()


def test_samples_are_asked_for_while_somebody_looks(looking: Looking, client: Client) -> None:
    def listeners() -> int:
        return sum(client.node.count_subscribers(f'/lift/{kind}')
                   for kind in ('request', 'response'))
    looking.sees(lambda lift: lift.sampled and lift.setpoints and lift.values)
    assert listeners() == 2
    looking.source.watch(False)
    looking.sees(lambda lift: lift.asked_for == 0.0 and listeners() == 0)
    looking.source.watch(True)
    looking.sees(lambda lift: lift.asked_for > 0.0 and listeners() == 2)


def test_bits_are_those_of_the_drive_that_is_looked_at_closely(looking: Looking,
                                                               client: Client) -> None:
    def listeners() -> int:
        return int(client.node.count_subscribers('/lift/status_word/fault'))
    looking.sees(lambda lift: lift.sampled)
    assert listeners() == 0
    looking.source.focus('/lift')
    lift = looking.sees(lambda lift: lift.bits.get('status_word', {}).keys() >= {'fault'})
    assert lift.bits.keys() == {'status_word'}
    assert lift.bits['status_word']['fault'] is False
    looking.source.focus()
    looking.sees(lambda _: listeners() == 0)


def test_a_glance_takes_samples_only(looking: Looking) -> None:
    looking.source.focus('/lift')
    before = looking.sees(lambda lift: lift.sampled and lift.parameters)
    told = looking.look().log
    for _ in range(50):
        clock().wait(clock().now() + 0.1)
        looking.source.glance(clock().now())
    after = looking.model.look(clock().now(), 0.0)
    assert after.log == told
    lift = after.drive('/lift')
    assert lift is not None
    assert lift.exchanges == before.exchanges   # which diagnostics tell
