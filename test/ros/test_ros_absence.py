# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What is said of drives that are not there."""

from contextlib import nullcontext
import time
from types import SimpleNamespace
from typing import Any

import pytest
from saying import says
from waiting import clock

pytest.importorskip('rclpy')

from drive_can_bridge.core import sentences
from drive_can_bridge.core.events import DriveState
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.ros.diagnostics import absence, PresenceCheck


def drive(name: str = 'lift', **changes: Any) -> Any:
    """Return what a drive node has of it."""
    facts: dict[str, Any] = {
        'bus_state': 'up', 'advice': sentences.maps_unread(), 'ever_online': False,
        'online': False, 'active': True, 'defect': '', 'state': DriveState.OFFLINE, 'lost_at': 0,
        'lost_for': NOTHING, 'hangs': False, 'guesses': True, **changes}
    exchange = SimpleNamespace(bus=SimpleNamespace(name='main'), bus_state=facts['bus_state'],
                               entered=lambda: nullcontext(not facts['hangs']))
    session = SimpleNamespace(offline_advice=facts['advice'], **{
        key: facts[key]
        for key in ('ever_online', 'online', 'active', 'defect', 'guesses', 'state')})
    return SimpleNamespace(name=name, exchange=exchange, session=session,
                           lost_at=facts['lost_at'], lost_for=facts['lost_for'])


class Lines:
    """A log."""

    def __init__(self) -> None:
        self.lines: list[tuple[str, str]] = []

    def source(self, name: str) -> Any:
        return SimpleNamespace(warning=lambda text: self.lines.append((name, text)))

    def warning(self, text: str) -> None:
        self.lines.append(('', text))


def test_one_that_was_never_seen_is_told_what_to_correct() -> None:
    assert absence(drive()) == says('never_seen', why=sentences.maps_unread())


def test_one_that_was_online_has_the_right_station_and_bit_rate() -> None:
    at = int(time.mktime((2026, 3, 4, 17, 4, 58, 0, 0, -1))) * 10**9
    why = sentences.silent_for_cycles('no cyclic response', 3)
    told = absence(drive(ever_online=True, lost_at=at, lost_for=why))
    assert told == says('silent_since', since='17:04:58', why=why)


def test_what_is_known_of_it_now_is_said() -> None:
    why = sentences.node_state('pre-operational')
    told = absence(drive(ever_online=True, advice=why, guesses=False,
                         lost_for=sentences.no_heartbeat(0.1)))
    assert told == says('silent_since', why=why)


@pytest.mark.parametrize('advice', [
    sentences.node_state('pre-operational', answers=True, emergency='emergency 1000h'),
    sentences.no_heartbeat(0.1, answers=True), sentences.pdo_length(1, 2, 6),
    sentences.answers_without('no complete set of PDOs', ''),
    sentences.answers_otherwise('SDO with 3 data bytes instead of 8')])
@pytest.mark.parametrize('ever', [True, False])
def test_one_that_sends_something_has_power_and_a_cable(advice: Sentence, ever: bool) -> None:
    told = absence(drive(ever_online=ever, advice=advice))
    assert told == says('offline_since' if ever else 'not_online', why=advice)
    assert 'cable' not in told and 'silent' not in told


@pytest.mark.parametrize(('state', 'ever', 'expected'), [
    ('down', True, 'bus_of_drive_down'), ('down', False, 'bus_of_drive_down'),
    ('opening', False, 'bus_of_drive_opening')])
def test_a_bus_that_is_lost_is_told_at_the_bus(state: str, ever: bool, expected: str) -> None:
    assert absence(drive(bus_state=state, ever_online=ever)) == says(expected, bus='main')


def test_who_is_missing_is_told_with_a_sum() -> None:
    log = Lines()
    seen = [drive(f'd{number}', ever_online=True, online=True, state=DriveState.ONLINE)
            for number in range(12)]
    lost = drive('lost', ever_online=True)
    other = drive('other', state=DriveState.MAPPING_DIFFERS)    # it answers
    PresenceCheck(log, [*seen, drive('a'), lost, other, drive('b')], clock()).look()  # type: ignore[arg-type]
    assert log.lines == [
        ('a', says('never_seen')), ('b', says('never_seen')),
        ('', says('drives_missing', online=12, drives=16, missing=['a', 'b']))]


@pytest.mark.parametrize(('bus', 'expected'), [
    ({'bus_state': 'down'}, 'bus_of_drive_down'), ({'hangs': True}, 'bus_hangs')])
def test_on_a_bus_that_is_down_they_are_told_too(bus: dict[str, Any], expected: str) -> None:
    log = Lines()
    PresenceCheck(log, [drive(**bus)], clock()).look()     # type: ignore[arg-type, list-item]
    assert log.lines == [
        ('lift', says('not_seen', why=says(expected, bus='main'))),
        ('', says('drives_missing', online=0, drives=1, missing=['lift']))]


def test_where_all_were_seen_nothing_is_said() -> None:
    log = Lines()
    PresenceCheck(log, [drive(ever_online=True)], clock()).look()  # type: ignore[arg-type, list-item]
    assert log.lines == []
