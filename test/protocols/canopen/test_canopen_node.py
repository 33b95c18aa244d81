# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a node says of itself by heartbeats and emergency messages, with literal times."""

import math

import pytest
from saying import says

from drive_can_bridge.protocols.canopen.network import Emergency, NmtState
from drive_can_bridge.protocols.canopen.node import NodeChange, WatchedNode

BOOT_UP, STOPPED, OPERATIONAL, PRE_OPERATIONAL = NmtState
OVERLOAD = Emergency(0x2310, 0x02, bytes(5))


def node(*, heartbeat_timeout: float = 0.0) -> WatchedNode:
    made = WatchedNode(5, heartbeat_timeout=heartbeat_timeout)
    made.begin(10.0)
    return made


def hears(watched: WatchedNode, state: NmtState, now: float) -> NodeChange:
    return watched.receive_heartbeat(state, now)


def test_nothing_is_known_of_a_node_that_has_not_said_anything() -> None:
    watched = node()
    assert watched.free_at == 10.0
    assert watched.facts()['nmt_state'] == 'unknown'
    assert watched.refusal(10.0) == ''
    assert watched.due == math.inf


def test_a_node_that_is_started_is_free_a_moment_later() -> None:
    watched = node()
    watched.started(10.0)
    assert watched.free_at == pytest.approx(10.05)
    assert hears(watched, PRE_OPERATIONAL, 10.02) is NodeChange.NOT_OPERATIONAL
    watched.started(10.1)
    assert watched.free_at == pytest.approx(11.02), 'its heartbeats know better'


def test_boot_up() -> None:
    watched = node()
    assert hears(watched, BOOT_UP, 10.5) is NodeChange.RESTARTED
    assert watched.facts()['nmt_state'] == 'pre-operational'
    assert watched.free_at == pytest.approx(10.55), 'no heartbeats: nobody will ever say so'
    assert watched.refusal(10.5) == ''


@pytest.mark.parametrize('state, text', [
    (PRE_OPERATIONAL, 'node is pre-operational'), (STOPPED, 'node is stopped')])
def test_heartbeats_say_when_pdos_may_be_sent(state: NmtState, text: str) -> None:
    watched = node()
    assert hears(watched, state, 10.2) is NodeChange.NOT_OPERATIONAL
    assert watched.refusal(10.2) == text
    assert watched.free_at == pytest.approx(11.2)
    assert hears(watched, state, 10.35) is NodeChange.STILL_NOT
    assert watched.free_at == pytest.approx(11.35)
    assert hears(watched, OPERATIONAL, 10.4) is NodeChange.OPERATIONAL
    assert watched.free_at == 10.4
    assert watched.refusal(10.4) == ''
    assert hears(watched, OPERATIONAL, 10.5) is NodeChange.NONE


def test_boot_up_of_a_node_with_heartbeats_waits_for_operational() -> None:
    watched = node()
    hears(watched, OPERATIONAL, 10.1)
    assert hears(watched, BOOT_UP, 20.0) is NodeChange.RESTARTED
    assert watched.free_at == pytest.approx(21.0)
    assert watched.refusal(20.5) == says('node_state', state='pre-operational')
    assert hears(watched, OPERATIONAL, 20.1) is NodeChange.OPERATIONAL
    assert watched.free_at == 20.1


def test_slow_heartbeats_are_believed_for_three_intervals() -> None:
    watched = node()
    for now in (20.0, 25.0):
        hears(watched, PRE_OPERATIONAL, now)
    assert watched.free_at == pytest.approx(40.0)
    assert watched.refusal(39.9) == says('node_state', state='pre-operational')
    assert watched.refusal(40.1) == '', 'heartbeats ceased: nothing is known any more'


def test_pause_longer_than_any_interval_is_none() -> None:
    watched = node()
    hears(watched, OPERATIONAL, 20.0)
    hears(watched, PRE_OPERATIONAL, 1000.0)
    assert watched.free_at == pytest.approx(1001.0)


def test_what_was_heard_before_the_beginning_still_counts() -> None:
    watched = WatchedNode(5, heartbeat_timeout=0.0)
    hears(watched, PRE_OPERATIONAL, 11.0)
    watched.begin(11.5)
    assert watched.free_at == pytest.approx(12.0)
    watched.begin(12.0)
    assert watched.free_at == 12.0


def test_heartbeat_time_out() -> None:
    watched = node(heartbeat_timeout=0.5)
    assert watched.due == math.inf, 'watched from the first one'
    hears(watched, OPERATIONAL, 11.0)
    assert watched.due == 11.5
    assert watched.handle_timer(11.499) is NodeChange.NONE
    hears(watched, OPERATIONAL, 11.4)
    assert watched.handle_timer(11.5) is NodeChange.NONE
    assert watched.handle_timer(11.9) is NodeChange.HEARTBEAT_LOST
    assert watched.heartbeat_lost
    assert watched.handle_timer(12.5) is NodeChange.NONE, 'told once'
    assert hears(watched, OPERATIONAL, 13.0) is NodeChange.OPERATIONAL
    assert not watched.heartbeat_lost
    assert watched.due == 13.5


def test_heartbeats_are_watched_after_boot_up_too() -> None:
    watched = node(heartbeat_timeout=0.5)
    hears(watched, BOOT_UP, 11.0)
    assert watched.handle_timer(11.5) is NodeChange.HEARTBEAT_LOST


def test_heartbeats_are_not_watched_by_default() -> None:
    watched = node()
    hears(watched, OPERATIONAL, 11.0)
    assert watched.due == math.inf
    assert watched.handle_timer(1000.0) is NodeChange.NONE


def test_no_heartbeat_was_due_while_nobody_listened() -> None:
    watched = node(heartbeat_timeout=0.5)
    hears(watched, OPERATIONAL, 11.0)
    watched.begin(20.0)
    assert watched.handle_timer(20.4) is NodeChange.NONE
    assert watched.handle_timer(20.5) is NodeChange.HEARTBEAT_LOST


#: CiA 301: classes of emergency codes
CLASSES = '10 20 21 22 23 30 31 32 33 40 41 42 50 60 61 62 63 70 80 81 82 90 F0 FF'


def test_the_emergency_codes_of_the_standard_have_words() -> None:
    for code in CLASSES.split():
        assert 'unknown' not in Emergency(int(f'{code}05', 16)).text
    for code in ('A0', 'E0'):
        assert 'unknown' in Emergency(int(f'{code}00', 16)).text


def test_emergencies_last_until_they_are_over() -> None:
    watched = node()
    text = '2310h (current, output side), error register 02h'
    assert watched.receive_emergency(OVERLOAD) == says('emergency', text=text)
    assert watched.emergency == OVERLOAD
    assert watched.receive_emergency(OVERLOAD) == '', 'nothing new'
    assert watched.receive_emergency(Emergency(0)) == (
        says('emergency_over'))
    assert watched.emergency is None
    assert watched.receive_emergency(Emergency(0)) == ''


def test_boot_up_ends_an_emergency() -> None:
    watched = node()
    watched.receive_emergency(OVERLOAD)
    hears(watched, BOOT_UP, 11.0)
    assert watched.emergency is None


def test_forgetting() -> None:
    watched = node(heartbeat_timeout=0.5)
    watched.receive_emergency(OVERLOAD)
    hears(watched, PRE_OPERATIONAL, 11.0)
    watched.forget()
    assert (watched.state, watched.emergency, watched.due) == (None, None, math.inf)
    assert watched.free_at == math.inf
