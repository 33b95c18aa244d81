# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The flight recorder of a running bridge, and ``~/save_trace``."""

from pathlib import Path
from typing import Any

from bridges import Bridge, CONVEYOR, HASTY, LIFT, parameters, StartBridge
from clients import Client, wait_until
from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import Transition
import pytest
from std_srvs.srv import Trigger

from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core import sentences
from drive_can_bridge.core.events import (
    DriveState, Event, MappingDiffered, Noted, StationFound, StationLost)
from drive_can_bridge.protocols.observer import Telegram, TelegramKind, Verdict
from drive_can_bridge.protocols.telegrams import Direction
from drive_can_bridge.ros.bridge_runtime import TraceTriggers
from drive_can_bridge.ros.diagnostics import StatusEntry
from drive_can_bridge.trace.files import read_records
from drive_can_bridge.trace.tracer import Tracer

OK, ERROR = DiagnosticStatus.OK, DiagnosticStatus.ERROR


class Wanted(list[tuple[str, str, int]]):
    """The traces that were wanted, by bus, reason and rank."""

    def __init__(self) -> None:
        super().__init__()
        self.triggers = TraceTriggers(self._trigger)

    def _trigger(self, bus: str, reason: str, *, rank: int = 0) -> None:
        self.append((bus, reason, rank))

    def tells(self, event: Event, state: DriveState, drive: str = 'lift') -> None:
        self.triggers.drive_told(drive, 'main', event, state)

    def reports(self, *levels: bytes, about: str = 'drive lift') -> None:
        for level in levels:
            self.triggers.reported(StatusEntry(about, level, '', {}), 'main')


def test_each_error_that_begins_is_an_occasion_and_one_that_lasts_is_not() -> None:
    wanted = Wanted()
    wanted.reports(OK, ERROR, ERROR, ERROR)
    assert wanted == [('main', 'lift_error', 0)]
    wanted.reports(ERROR, about='drive conveyor')
    wanted.reports(ERROR, about='bus main')
    assert wanted[1:] == [('main', 'conveyor_error', 0), ('main', 'main_error', 0)]
    for between in (OK, DiagnosticStatus.WARN, DiagnosticStatus.STALE):
        wanted.clear()
        wanted.reports(between, ERROR)
        assert wanted == [('main', 'lift_error', 0)]


def test_each_fault_is_an_occasion_however_short() -> None:
    wanted = Wanted()
    fault, gone = Noted('fault', warning=True), Noted('fault gone', warning=True)
    for _ in range(2):
        wanted.tells(fault, DriveState.FAULT)
        wanted.tells(Noted('anything'), DriveState.FAULT)
        wanted.tells(fault, DriveState.FAULT, 'conveyor')
        wanted.tells(gone, DriveState.DISABLED)
        wanted.tells(gone, DriveState.DISABLED, 'conveyor')
        assert wanted == [('main', 'lift_fault', 2), ('main', 'conveyor_fault', 2)]
        wanted.clear()
    wanted.tells(fault, DriveState.FAULT)
    wanted.triggers.forget('lift')     # the bridge is inactive for a while
    wanted.tells(StationFound(), DriveState.FAULT)
    assert wanted == [('main', 'lift_fault', 2)] * 2


def test_each_loss_is_an_occasion_and_a_fault_that_is_there_afterwards() -> None:
    wanted = Wanted()
    for _ in range(2):
        wanted.tells(StationLost('no answer'), DriveState.OFFLINE)
        wanted.tells(StationFound(), DriveState.FAULT)
    assert wanted == [('main', 'lift_offline', 1), ('main', 'lift_fault', 2)] * 2
    wanted.clear()
    wanted.tells(MappingDiffered('request map'), DriveState.MAPPING_DIFFERS)
    wanted.triggers.bus_lost('main')
    assert wanted == [('main', 'lift_mapping differs', 2), ('main', 'bus_lost', 3)]


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
    one = bridge(recording(tmp_path, conveyor={**CONVEYOR, **HASTY})).online()
    wait_until(lambda: one.node.drives['conveyor'].session.statistics.exchanges >= 5)
    one.played['conveyor'].fault('silent')
    path, = wait_until(lambda: traces(tmp_path))
    assert path.name.startswith('main_') and path.name.endswith('_conveyor_offline.log')
    tracer, told = decoded(one, path)
    answers = [telegram for telegram in told if telegram.kind is TelegramKind.CYCLIC
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


def test_save_trace(bridge: StartBridge, client: Client, tmp_path: Path) -> None:
    bridge(recording(tmp_path)).online()
    answer = client.call('/drive_can_bridge/save_trace', Trigger)
    again = client.call('/drive_can_bridge/save_trace', Trigger)
    assert answer.success and again.success
    assert [answer.message, again.message] == [str(path) for path in traces(tmp_path)]


def test_whoever_waits_for_a_trace_is_answered_before_the_bridge_is_cleaned_up(
        bridge: StartBridge, client: Client, tmp_path: Path) -> None:
    one = bridge(recording(tmp_path)).online()
    future = client.ask('/drive_can_bridge/save_trace', Trigger)
    recorder = one.node._runtime and one.node._runtime._flight
    wait_until(lambda: recorder and recorder._calls == 1)
    assert client.transition(Transition.TRANSITION_DEACTIVATE)
    assert client.transition(Transition.TRANSITION_CLEANUP)
    wait_until(future.done)
    path, = traces(tmp_path)
    assert (future.result().success, future.result().message) == (True, str(path))
    wait_until(lambda: not [service for service in one.node.services
                            if 'save_trace' in service.srv_name])


def test_whoever_calls_takes_no_trace_from_a_failure(bridge: StartBridge, client: Client,
                                                     tmp_path: Path) -> None:
    one = bridge(recording(tmp_path, lift=LIFT)).online()
    assert client.call('/drive_can_bridge/save_trace', Trigger).success
    one.played['lift'].fault('trip')
    wait_until(lambda: [path for path in traces(tmp_path) if 'lift_fault' in path.name], 30.0)


def test_nothing_is_recorded_unless_asked_for(bridge: StartBridge, client: Client) -> None:
    bridge().online()
    answer = client.call('/drive_can_bridge/save_trace', Trigger)
    assert (answer.success, answer.message) == (False, sentences.nothing_recorded())
