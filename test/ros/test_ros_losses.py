# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What counts as the loss of a drive, and what a defect says."""

from typing import Any

from bridges import LIFT, parameters, StartBridge
from clients import Client, wait_until
import pytest


def test_a_defect_counts_as_one_loss_and_a_stop_that_was_asked_for_as_none(
        bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    one = bridge(parameters(lift={**LIFT, 'missed_limit': 10}))
    one.online()
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
