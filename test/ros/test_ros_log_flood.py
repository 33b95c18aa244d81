# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A drive whose status flips in every cycle, and what a running bridge writes of it."""

from typing import Any

from bridges import LIFT, parameters, StartBridge
from clients import Client, WARN
import pytest

from drive_can_bridge.core import sentences
from drive_can_bridge.core.events import Noted, StationFound, StationLost
from drive_can_bridge.core.messages import NOTHING
from drive_can_bridge.core.reporter import Reporter
from drive_can_bridge.core.statistics import DriveStatistics
from drive_can_bridge.protocols.canopen.network import Emergency, encode_emergency
from drive_can_bridge.protocols.canopen.node import WatchedNode
from drive_can_bridge.ros import log as log_module

FLIPS = 400
FAULT = sentences.fault_came(sentences.status_word(8), False)
GONE = sentences.fault_gone(sentences.status_word(1))
DANGER = sentences.may_still_be_running(sentences.stop_not_answered())


@pytest.fixture
def lift(bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a drive that nobody answers for: nothing is told but what is told here."""
    monkeypatch.setattr(log_module, 'SUM_UP', 1.0)
    one = bridge(parameters(lift={**LIFT, 'parameter_timeout': 60.0}), simulated=False)
    client.listen()
    client.wait_logged('active: ')
    return one.node.drives['lift']


def test_what_flips_is_summed_up_and_a_danger_is_told_meanwhile(lift: Any, client: Client) -> None:
    before = len(client.logged(0))
    with lift.exchange.lock:
        for _ in range(FLIPS):
            lift.handle_event(Noted(FAULT, warning=True))
            lift.handle_event(StationLost('silent'))
            lift.handle_event(StationFound())
            lift.handle_event(Noted(GONE, warning=True))
        lift.handle_event(Noted(DANGER, warning=True, danger=True))
    assert lift.times_lost == FLIPS
    client.wait_logged(f'lift: {DANGER}', WARN)
    client.wait_logged(f'lift: {GONE} (395 more times in ')
    lines = [line for line in client.logged(0)[before:] if line.startswith('lift')]
    assert lines[:8] == [
        f'lift: {text}' for text in (FAULT, 'offline: silent', 'online', GONE)] * 2
    assert lines.index(f'lift: {DANGER}') == 20
    client.wait_logged(f'{DANGER} (this came last, ')
    assert len(client.logged(0)) - before <= 20 + 1 + 4 + 1


def test_emergencies_that_vary_are_a_few_lines_and_a_sum(lift: Any, client: Client) -> None:
    told = [Emergency(0x2300 + number) for number in range(200)]
    node, report = WatchedNode(5, heartbeat_timeout=0.0), Reporter(DriveStatistics(), NOTHING)
    for emergency in told:
        node.take_emergency(encode_emergency(5, emergency).data, report)
    with lift.exchange.lock:
        for event in report.take():
            lift.handle_event(event)
    assert node.facts()['emergency'] == told[-1].text
    newest = sentences.emergency(told[-1].text)
    client.wait_logged(f'lift: {newest} (and 194 more like it in ', WARN)
    lines = [line for line in client.logged(0) if line.startswith('lift: emergency')]
    assert lines[:-1] == [f'lift: {sentences.emergency(each.text)}' for each in told[:5]]
