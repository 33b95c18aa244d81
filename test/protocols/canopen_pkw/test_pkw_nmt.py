# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""NMT, heartbeats and emergency messages as the session handles them."""

from builders import read
from conversation import Conversation
from pkw_builders import (
    ANSWER_0, ANSWER_1, BOOT_UP, configuration, CONTROL, DISABLE_0, DISABLE_1, driven, FLC, IDLE,
    IDLE_ANSWER, LEVEL, online, OPERATIONAL, PRE_OPERATIONAL, READ_0, READ_1, reading, START,
    started, STATUS, STOPPED, TRIPPED_1,
)
import pytest
from saying import says

from drive_can_bridge.core.events import (
    DriveState, Noted, ProcessDataReceived, StationFound, StationLost)

TRIP = '085#1023020A00000000'


# -- what comes first -----------------------------------------------------------------------------


def test_start_is_the_first_frame_and_pdos_wait() -> None:
    talk = started()
    assert talk.submits(read(FLC), 10.01) == []
    assert talk.until(10.0499) == []
    assert [text for _, text in talk.until(10.0501)] == [IDLE]


def test_nothing_but_nmt_before_the_node_is_operational() -> None:
    talk = started()
    assert talk.hears(PRE_OPERATIONAL, 10.02) == [], 'started 20 ms ago'
    sent = []
    for beat in range(1, 20):
        now = 10.02 + 0.1 * beat
        sent += [text for _, text in talk.until(now)]
        sent += talk.hears(PRE_OPERATIONAL, now)
    assert set(sent) == {START}
    assert talk.session.offline_advice == says('node_state', state='pre-operational')
    assert talk.session.facts()['nmt_state'] == 'pre-operational'
    assert talk.hears(OPERATIONAL, 12.0) == []
    assert talk.at(12.0) == [IDLE]
    assert talk.hears(IDLE_ANSWER, 12.001) == [READ_1]
    talk.hears(ANSWER_1, 12.002)
    assert talk.session.online
    assert talk.session.facts()['nmt_state'] == 'operational'


def test_what_a_silent_mailbox_sends_all_the_same_is_named() -> None:
    talk = started(parameter_timeout=0.05)
    for beat in range(40):
        talk.until(10.02 + 0.1 * beat)
        talk.hears('085#0010010000000000', 10.02 + 0.1 * beat)
        talk.hears('705#', 10.03 + 0.1 * beat)
    assert talk.session.offline_advice == (
        'answers, but there is no complete round of reads: emergency 1000h, register 01h')
    assert talk.session.statistics.rejected == 1    # a heartbeat without content, told once
    talk.until(20.0)
    assert talk.session.offline_advice == says('rounds_unanswered')


def test_start_once_a_second_until_the_drive_is_found() -> None:
    talk = started(parameter_timeout=0.5)
    assert [at for at, text in talk.until(13.5) if text == START] == [11.0, 12.0, 13.0]
    talk.events()
    text = IDLE
    while text != READ_1:   # whatever is under way
        (_, text), = talk.until(talk.session.next_timer())
        if text == IDLE:
            text, = talk.hears(IDLE_ANSWER, 13.75)
    talk.hears(ANSWER_1, 13.76)
    assert talk.session.online
    sent = [text for _, text in talk.until(14.25)]
    assert sent and START not in sent, 'it needs none, and its reads are not yet missed'


def test_drive_that_is_lost_is_started_at_once_and_then_once_a_second() -> None:
    talk = online(parameter_timeout=0.02, missed_limit=1)
    assert [at for at, text in talk.until(11.5) if text == START] == [11.0], 'a second after that'
    talk = online(parameter_timeout=0.02, missed_limit=1)
    for tick in range(60):      # 10.07, 10.09, ...: it answers for longer than a second
        (at, text), = talk.until(10.0701 + 0.02 * tick)
        talk.hears(ANSWER_1 if text == READ_1 else ANSWER_0, at + 0.001)
    assert talk.session.online
    starts = [at for at, text in talk.until(13.5) if text == START]
    assert starts == [pytest.approx(11.29), pytest.approx(12.29), pytest.approx(13.29)]


def test_start_is_put_off_once_however_often_a_node_starts_anew() -> None:
    talk = started()
    assert talk.hears(BOOT_UP, 10.04) == []
    assert talk.hears(BOOT_UP, 10.09) == []
    assert talk.until(10.1499) == [(10.1, START)]
    assert talk.until(10.1501) == [(10.15, IDLE)]
    assert talk.events() == [Noted(says('booted'))] * 2
    assert talk.hears(BOOT_UP, 10.3) == [START]


def test_node_that_stays_closed_is_started_no_more_than_ten_times_a_second() -> None:
    talk = online()
    assert talk.hears(PRE_OPERATIONAL, 10.2) == [START]
    for beat in range(1, 9):
        assert talk.hears(PRE_OPERATIONAL, 10.2 + 0.01 * beat) == []
    assert talk.until(10.3999) == [(10.3, START)]
    assert [text for _, text in talk.until(11.2799)] == [], 'believed for 1 s'
    assert talk.until(11.2801) == [(11.28, IDLE)], 'heartbeats have ceased: nobody knows'


def test_node_that_is_operational_is_not_started_soon() -> None:
    talk = started()
    assert talk.hears(BOOT_UP, 10.02) == []
    assert talk.hears(OPERATIONAL, 10.03) == []
    assert talk.at(10.03) == [IDLE]
    assert [at for at, text in talk.until(10.9) if text == START] == []


def test_node_is_only_listened_to_once_its_drive_was_stopped() -> None:
    talk = online(heartbeat_timeout=0.5)
    talk.deactivate(10.06)
    talk.until(11.0)
    for text in (BOOT_UP, PRE_OPERATIONAL, TRIP):
        assert talk.hears(text, 12.0) == []
    assert talk.until(20.0) == []
    assert talk.session.facts()['nmt_state'] == 'pre-operational'
    assert talk.session.facts()['emergency'].startswith('2310h')


def test_requests_of_tools_do_not_wait_for_a_node_that_nobody_starts() -> None:
    talk = Conversation(configuration())
    talk.bus_up(9.0)
    talk.session.serve()
    assert talk.hears(PRE_OPERATIONAL, 10.0) == []
    assert talk.submits(read(FLC), 10.01) == [IDLE]


def test_no_nmt_at_all() -> None:
    talk = online(nmt_start=False, parameter_timeout=0.1)
    sent = [text for _, text in talk.until(15.0)]
    for text in (BOOT_UP, PRE_OPERATIONAL, STOPPED):
        sent += talk.hears(text, 15.0)
        sent += [entry for _, entry in talk.until(18.0)]
    assert len(sent) > 20
    assert not any(text.startswith('000#') for text in sent), 'polling goes on, NMT is silent'


# -- heartbeats -----------------------------------------------------------------------------------


@pytest.mark.parametrize('text, reason', [
    (PRE_OPERATIONAL, 'node is pre-operational'), (STOPPED, 'node is stopped')])
def test_node_that_leaves_operational_is_offline_at_once(text: str, reason: str) -> None:
    talk = online()
    assert talk.hears(text, 11.0) == [START]
    assert talk.events(StationLost) == [StationLost(reason)]
    assert talk.until(11.9) == []
    assert talk.hears(OPERATIONAL, 11.9) == []
    assert talk.at(11.9) == [IDLE]


@pytest.mark.parametrize('heard', [OPERATIONAL, '705#85'])      # node guarding toggles bit 7
def test_heartbeats_of_an_operational_node_change_nothing(heard: str) -> None:
    talk = online()
    for now in (10.055, 10.06, 10.065):
        assert talk.hears(heard, now) == []
    assert talk.until(10.0701) == [(10.07, READ_0)]
    assert talk.session.facts() == {'nmt_state': 'operational', 'emergency': 'none'}
    assert talk.session.warning == ''
    assert talk.session.statistics.rejected == 0


def test_lost_heartbeat_ends_the_round_under_way() -> None:
    talk, _ = reading(response=(STATUS, LEVEL), heartbeat_timeout=0.025, parameter_timeout=0.1)
    talk.hears('485#C70100A541000000', 10.052)
    talk.hears('485#D101002507000000', 10.053)
    talk.hears(OPERATIONAL, 10.06)
    assert talk.until(10.0701) == [(10.07, '505#C70100A500000000')]
    assert talk.hears('485#C70100A541000000', 10.072) == ['505#D101002500000000']
    assert talk.until(10.1351) == [(10.135, IDLE)]
    assert not talk.session.online
    # what comes next is the beginning of another one
    assert talk.hears(IDLE_ANSWER, 10.136) == ['505#C70100A500000000']


def test_lost_heartbeat_stops_a_drive_before_its_old_command_is_taken_back() -> None:
    """A process that was late finds both at once: `disable` goes before any setpoint."""
    talk = driven(command_timeout=0.2, heartbeat_timeout=0.1)
    talk.hears(OPERATIONAL, 10.195)
    sent = talk.at(10.3)
    assert not talk.session.online
    assert sent in ([DISABLE_0], [DISABLE_1])


def test_status_of_a_drive_whose_heartbeats_have_ceased_says_nothing() -> None:
    talk = online(heartbeat_timeout=0.025, control=CONTROL, missed_limit=1, parameter_timeout=0.02)
    talk.hears(OPERATIONAL, 10.055)
    talk.until(10.0701)
    talk.hears(ANSWER_1, 10.071)
    assert talk.until(10.141)[-1] == (10.14, IDLE)
    assert not talk.session.online
    talk.events()
    assert talk.hears(IDLE_ANSWER, 10.141) == [READ_1]
    assert talk.hears(TRIPPED_1, 10.142) == []
    assert talk.events() == []


def test_lost_heartbeat_stays_the_advice_while_nothing_is_answered() -> None:
    talk = online(heartbeat_timeout=0.025, missed_limit=1, parameter_timeout=0.02)
    talk.hears(OPERATIONAL, 10.055)
    talk.until(10.0701)
    talk.hears(ANSWER_0, 10.071)
    talk.until(10.2)
    assert talk.session.statistics.missed > 1
    assert talk.session.offline_advice == says('no_heartbeat', timeout=0.025)


def test_lost_heartbeat_makes_it_offline_until_it_is_back() -> None:
    talk = online(heartbeat_timeout=0.1)
    assert talk.session.warning == (
        says('heartbeat_missing'))
    talk.hears(OPERATIONAL, 10.06)
    assert talk.session.warning == ''
    for beat in range(5):
        (at, text), = talk.until(10.0701 + 0.02 * beat)
        talk.hears(ANSWER_1 if text == READ_1 else ANSWER_0, at + 0.001)
    talk.events()
    assert [text for _, text in talk.until(10.161)] == []
    assert talk.events() == [StationLost(says('no_heartbeat', timeout=0.1))]
    assert talk.session.offline_advice == says('no_heartbeat', timeout=0.1)
    # its answers alone do not bring it back
    assert [text for _, text in talk.until(10.1701)] == [READ_1]
    talk.hears(ANSWER_1, 10.171)
    assert talk.session.state is DriveState.OFFLINE
    assert talk.events() == []
    talk.hears(OPERATIONAL, 10.175)
    sent = talk.at(10.175)
    assert sent == [READ_0]
    talk.hears(ANSWER_0, 10.176)
    assert talk.events(StationFound, ProcessDataReceived) == [
        StationFound(), ProcessDataReceived((0x41, 0), 10.176)]


# -- emergencies ----------------------------------------------------------------------------------


def test_emergency_is_shown_until_it_is_over() -> None:
    talk = online()
    assert talk.hears(TRIP, 10.06) == []
    text = ('2310h (current, output side), error register 02h, manufacturer 0A 00 00 00 00')
    assert talk.events() == [Noted(says('emergency', text=text), warning=True, new=True)]
    assert talk.session.facts()['emergency'] == text
    assert talk.session.warning == says('emergency_lasts', text=text)
    assert talk.session.online
    talk.hears(TRIP, 10.061)
    assert talk.events() == [], 'told once'
    talk.hears('085#0000000000000000', 10.062)
    assert talk.events() == [Noted(says('emergency_over'))]
    assert talk.session.facts()['emergency'] == 'none'
    assert talk.session.warning == ''


def test_bus_down_ends_all_knowledge() -> None:
    talk = online()
    talk.hears(TRIP, 10.06)
    talk.hears(PRE_OPERATIONAL, 10.07)
    talk.bus_down(10.08)
    assert talk.session.facts() == {'nmt_state': 'unknown', 'emergency': 'none'}
    assert talk.bus_up(12.0) == [START]
    assert talk.until(12.0501) == [(12.05, IDLE)]
