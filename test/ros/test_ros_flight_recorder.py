# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The flight recorder of a running bridge, and ``~/save_trace``."""

from pathlib import Path
from typing import Any

from bridges import Bridge, CONVEYOR, HASTY, LIFT, parameters, StartBridge
from clients import Client, wait_until
import pytest
from std_srvs.srv import Trigger

from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.protocols.observer import Direction, Kind, Telegram, Verdict
from drive_can_bridge.trace.files import read_records
from drive_can_bridge.trace.tracer import Tracer


def recording(tmp_path: Path, **drives: dict[str, Any]) -> dict[str, Any]:
    content = parameters(**drives)
    content['buses']['main'].update(trace_seconds=30.0, trace_directory=str(tmp_path / 'traces'))
    return content


def traces(tmp_path: Path) -> list[Path]:
    return sorted((tmp_path / 'traces').glob('*.log'))


def decoded(bridge: Bridge, path: Path) -> tuple[Tracer, list[Telegram]]:
    told: list[Telegram] = []
    tracer = Tracer(configuration_from_file(bridge.file),
                    lambda _, telegram: told.append(telegram))
    for record in read_records(path, pytest.fail):
        tracer.take(record)
    return tracer, told


def test_a_drive_that_falls_silent(bridge: StartBridge, tmp_path: Path) -> None:
    one = bridge(recording(tmp_path, conveyor={**CONVEYOR, **HASTY}))
    one.online()
    wait_until(lambda: one.node.drives['conveyor'].session.statistics.exchanges >= 5)
    one.played['conveyor'].fault('silent')
    path, = wait_until(lambda: traces(tmp_path))
    assert path.name.startswith('main_') and path.name.endswith('_conveyor_offline.log')
    tracer, told = decoded(one, path)
    answers = [telegram for telegram in told if telegram.kind is Kind.CYCLIC
               and telegram.direction is Direction.RESPONSE]
    lost = [telegram for telegram in answers if telegram.verdict is Verdict.LOST]
    # the last answer is in it, and every request that got none
    assert answers[0].verdict is Verdict.NORMAL
    assert len(lost) >= HASTY['missed_limit']
    assert all(telegram.time > answers[4].time for telegram in lost)
    observed = tracer.observed()['conveyor']
    statistics = one.node.drives['conveyor'].session.statistics
    assert abs(observed.exchanges - statistics.exchanges) <= 1
    # whatever was sent is marked so: a second master would show
    assert not [telegram for telegram in told if telegram.verdict is Verdict.SUSPICIOUS]


def test_a_fault(bridge: StartBridge, tmp_path: Path) -> None:
    one = bridge(recording(tmp_path, lift=LIFT))
    one.online()
    one.played['lift'].fault('trip')
    path, = wait_until(lambda: traces(tmp_path))
    assert path.name.endswith('_lift_fault.log')


def test_save_trace(bridge: StartBridge, client: Client, tmp_path: Path) -> None:
    one = bridge(recording(tmp_path))
    one.online()
    answer = client.call('/drive_can_bridge/save_trace', Trigger)
    path, = traces(tmp_path)
    assert (answer.success, answer.message) == (True, str(path))
    again = client.call('/drive_can_bridge/save_trace', Trigger)
    assert not again.success and again.message.endswith(f'is {path}')


def test_nothing_is_recorded_unless_asked_for(bridge: StartBridge, client: Client) -> None:
    one = bridge()
    one.online()
    answer = client.call('/drive_can_bridge/save_trace', Trigger)
    assert (answer.success, answer.message) == (
        False, 'nothing is recorded: set trace_seconds of a bus')
