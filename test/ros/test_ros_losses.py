# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What counts as the loss of a drive, and what a defect says."""

from contextlib import nullcontext
from typing import Any

from bridges import late, LIFT, parameters, StartBridge
from clients import Client, wait_until
import pytest
from std_msgs.msg import Bool
from waiting import pause

LIFT_STATUS = 'drive_can_bridge: drive lift'


def test_a_defect_counts_as_one_loss_and_a_stop_that_was_asked_for_as_none(
        bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    one = bridge(parameters(lift={**LIFT, 'missed_limit': 10})).online()
    lift = one.node.drives['lift']
    assert lift.times_lost == 0

    def fail(*_: Any) -> None:
        monkeypatch.undo()
        raise KeyError('a defect')
    monkeypatch.setattr(type(lift.session), 'handle_timer', fail)
    wait_until(lambda: lift.session.defect, what='the defect')
    assert client.set('/lift', ramp_time=1.0) == [(False, lift.session.defect)]
    wait_until(lambda: not lift.session.online, what='its end')
    one.online()
    assert lift.times_lost == 1
    one.played['lift'].fault('off')
    wait_until(lambda: not lift.session.online, what='the loss')
    one.played['lift'].fault('ok')
    one.online()
    assert lift.times_lost == 2
    assert client.transition(label='deactivate')
    assert not lift.session.online
    assert lift.times_lost == 2


def test_a_drive_whose_bus_hangs_is_not_online_until_that_is_over(
        bridge: StartBridge, client: Client) -> None:
    """Nobody of its bus can say so; whoever looks at it from outside does."""
    one = bridge(parameters(lift=LIFT))
    topic = client.latched('/lift/online', Bool)
    one.online()
    wait_until(lambda: topic.values[-1:] == [True])
    with late(one.node.exchanges['main']):
        wait_until(lambda: topic.values[-1:] == [False])
        client.diagnostics(LIFT_STATUS, lambda lift: lift['code'] == 'bus_hangs')
        pause(5.0)
        told = len(topic.messages)
        pause(5.0)
        assert topic.values[told - 1:] == [False]
    one.online()
    wait_until(lambda: topic.values[-1:] == [True])
    pause(5.0)
    assert topic.values[-1]


@pytest.mark.interpreted    # replaces a method
def test_a_look_that_came_too_late_is_put_right_by_the_next(
        bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever waited in vain for the lock of a bus tells so when the bus may be back."""
    one = bridge({**parameters(lift=LIFT), 'diagnostics_period': 3600.0})
    topic = client.latched('/lift/online', Bool)
    one.online()
    wait_until(lambda: topic.values[-1:] == [True])
    diagnostics = one.node.diagnostics
    assert diagnostics is not None
    with monkeypatch.context() as patch:
        patch.setattr(one.node.exchanges['main'], 'entered', lambda: nullcontext(False))
        diagnostics.publish()
    wait_until(lambda: topic.values[-1:] == [False])
    diagnostics.publish()
    wait_until(lambda: topic.values[-1:] == [True])
