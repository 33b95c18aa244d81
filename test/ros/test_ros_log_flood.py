# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A drive whose status flips in every cycle, and what a running bridge writes of it."""

from bridges import LIFT, parameters, StartBridge
from clients import Client, WARN
import pytest

from drive_can_bridge.core.events import Noted, StationFound, StationLost
from drive_can_bridge.ros import log as log_module

FLIPS = 400


def test_what_flips_is_summed_up_and_a_danger_is_told_meanwhile(
        bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log_module, 'SUM_UP', 1.0)
    # nobody answers, so that nothing is told but what is told here
    one = bridge(parameters(lift={**LIFT, 'parameter_timeout': 60.0}), simulated=False)
    client.listen()
    client.wait_logged('active: ')
    lift = one.node.drives['lift']
    before = len(client.logged(0))
    with lift.exchange.lock:
        for _ in range(FLIPS):
            lift.handle_event(Noted('fault (status word 0008h)', warning=True))
            lift.handle_event(StationLost('no answer'))
            lift.handle_event(StationFound())
            lift.handle_event(Noted('fault gone (status word 0001h)', warning=True))
        lift.handle_event(Noted('told to stop, but no answer: it may still be running',
                                warning=True, danger=True))
    assert lift.times_lost == FLIPS
    client.wait_logged('lift: told to stop, but no answer: it may still be running', WARN)
    client.wait_logged('lift: fault gone (status word 0001h) (395 more times in ')
    lines = [line for line in client.logged(0)[before:] if line.startswith('lift')]
    assert lines[:8] == ['lift: fault (status word 0008h)', 'lift: offline: no answer',
                         'lift: online', 'lift: fault gone (status word 0001h)'] * 2
    assert lines.index('lift: told to stop, but no answer: it may still be running') == 20
    client.wait_logged('it may still be running (this came last, ')
    assert len(client.logged(0)) - before <= 20 + 1 + 4 + 1
