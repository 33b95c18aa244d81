# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Conversations in cycles: pace, responses of every kind, offline and online."""


from builders import drive, FLAG, frame, read
from conversation import Conversation
from extended_builders import (
    ANSWER, ASK_REQUEST_MAP, ASK_RESPONSE_MAP, checked, cycling, NEUTRAL, online,
    REQUEST_MAP, RESPONSE_MAP, SILENT, TICK, ZEROS,
)
import pytest
from saying import says

from drive_can_bridge.core.events import (
    DriveState, ForeignMasterSeen, FrameRejected, ProcessDataReceived, StationFound,
    StationLost)

# -- pace -----------------------------------------------------------------------------------------


# -- responses ------------------------------------------------------------------------------------


def test_age_of_a_frame_counts_for_stamp_and_latency_only() -> None:
    talk = online()
    talk.at(10.02)
    talk.session.receive_frame(frame('103FFFF0#FFFF8000FFFF1234'), 10.025, 0.003)
    assert talk.events() == [ProcessDataReceived((-1, -32768, 0xFFFF), pytest.approx(10.022))]
    assert talk.session.statistics.latency.count == 2
    assert talk.session.statistics.latency.maximum == pytest.approx(0.002)
    # a stamp from before the request: adapters' clocks drift
    talk.at(10.04)
    talk.session.receive_frame(frame(ANSWER), 10.041, 0.05)
    assert talk.session.statistics.latency.maximum == pytest.approx(0.002)
    assert talk.session.statistics.latency.total == pytest.approx(0.004)


def test_unasked_answer_before_the_first_cycle() -> None:
    talk = Conversation(drive()).begun()
    talk.hears(ANSWER, 10.0005)
    assert talk.events() == [FrameRejected(says('unasked', what='cyclic response'))]
    assert not talk.session.online


@pytest.mark.parametrize('policy, data, what, raws', [
    # what holds everything will do
    ('lenient', '03E800FA0001', '', (1000, 250, 1)),
    ('lenient', '03E800FA00017F', '', (1000, 250, 1)),
    # of the rest, what arrived is published
    ('lenient', '03E800FA00', '5 data bytes, 6 needed', (1000, 250)),
    ('lenient', '03E800FA', '4 data bytes, 6 needed', (1000, 250)),
    ('lenient', '03E800', '3 data bytes, 6 needed', (1000,)),
    ('lenient', '03E8', '2 data bytes, 6 needed', (1000,)),
    ('lenient', 'FF', '1 data bytes, 6 needed', ()), ('lenient', '', '0 data bytes, 6 needed', ()),
    ('strict', '03E800FA00017F', '7 data bytes instead of 8', ()),
    ('strict', '03E8', '2 data bytes instead of 8', ()),
    ('strict', '', '0 data bytes instead of 8', ()),
])
def test_short_response(policy: str, data: str, what: str, raws: tuple[int, ...]) -> None:
    talk = online(length_policy=policy)
    talk.at(10.02)
    talk.hears(f'103FFFF0#{data}', 10.021)
    rejected = [FrameRejected(says('bad_cyclic_response', what=what))] if what else []
    published = [ProcessDataReceived(raws, 10.021)] if raws else []
    assert talk.events() == rejected + published
    statistics = talk.session.statistics
    assert (statistics.rejected, statistics.short) == ((1, 0) if what else (0, 1))
    talk.at(10.04)
    assert statistics.missed == (0 if raws else 1)


def test_after_a_response_without_a_whole_word_the_real_one_may_still_come() -> None:
    talk = online()
    talk.at(10.02)
    talk.hears('103FFFF0#FF', 10.021)
    talk.hears(ANSWER, 10.022)
    assert talk.samples() == [(1000, 250, 1)]
    talk.at(10.04)
    assert talk.session.statistics.missed == 0


def test_strict_policy_holds_for_acyclic_answers_too() -> None:
    talk = Conversation(drive(length_policy='strict')).begun()
    assert talk.hears('102007A4#00320033000000', 10.001) == []
    assert len(talk.events(FrameRejected)) == 1
    assert talk.hears(REQUEST_MAP, 10.002) == [ASK_RESPONSE_MAP]

    lenient = online()
    lenient.submits(read(FLAG), 10.003)
    lenient.hears('102002A1#0001', 10.004)
    assert lenient.outcomes() == [[1]]
    assert lenient.session.statistics.short == 1
    lenient.submits(read(FLAG), 10.005)
    lenient.hears('102002A1#00', 10.006)
    assert lenient.outcomes() == []
    assert lenient.session.statistics.rejected == 1


def test_drive_without_mapped_response_is_online_when_it_answers() -> None:
    talk = Conversation(drive(response=()))
    talk.begins(9.998)
    checked(talk, 9.998)
    talk.at(10.0)
    talk.hears('103FFFF0#', 10.001)
    assert talk.session.online
    assert talk.samples() == [()]


def test_drive_without_setpoints_is_polled_and_never_unarmed() -> None:
    talk = Conversation(drive(request=()))
    talk.begins(9.998)
    talk.hears(f'102007A4#{ZEROS}', 9.999)
    talk.hears(RESPONSE_MAP, 10.0)
    assert talk.at(10.0) == [NEUTRAL]
    talk.hears(ANSWER, 10.001)
    assert talk.session.state is DriveState.ONLINE


# -- frames of others -----------------------------------------------------------------------------


@pytest.mark.parametrize('text', [
    '002001E2#0000000000000000', '003001E2#03E807D000000000', '003FFFF0#0000000000000000',
    '002001E0#0000000000000000',
])
def test_second_master_is_noticed(text: str) -> None:
    talk = online()
    assert talk.hears(text, 10.003) == []
    assert talk.events() == [ForeignMasterSeen(
        says('other_master_asks', station=1, frame=text))]
    assert talk.session.online


@pytest.mark.parametrize('text', [
    '103001E2#03E807D000000000',     # an acknowledged write: there is no such thing
    '102001E0#0000000000000000', '102001EF#0000000000000000',
    '103FFFF1#0000000000000000',     # almost cyclic
    '102FFFF0#0000000000000000',
    '102001E2#03E807D000000000',     # an answer to a read of nobody
    '102001E2#03E807',
    '105FFFF0#03E800FA00010000',     # station 2
    '005FFFF0#03E800FA00010000',
    '7F1#2211000000000000', '3F1#0000000000000000',
])
def test_what_nobody_asked_for_is_counted_and_leaves_no_trace(text: str) -> None:
    talk = online()
    talk.at(10.02)
    assert talk.hears(text, 10.0205) == []
    assert len(talk.events(FrameRejected)) == 1
    assert talk.session.statistics.rejected == 1
    talk.hears(ANSWER, 10.021)
    assert talk.samples() == [(1000, 250, 1)]


@pytest.mark.parametrize('text', [
    '104007A4#0032003300000000',     # of another station
    '102007A3#0032003300000000',     # another count
    '102007E4#0032003300000000',     # another number
    '102007A4#00320033000000',       # too short
])
def test_answer_that_does_not_match_the_question(text: str) -> None:
    talk = Conversation(drive()).begun()
    assert talk.hears(text, 10.001) == []
    assert talk.session.statistics.rejected == 1
    assert talk.hears(REQUEST_MAP, 10.002) == [ASK_RESPONSE_MAP]


# -- offline and online ---------------------------------------------------------------------------


def test_offline_at_the_limit_three_neutral_cycles_then_by_number() -> None:
    talk = online(rearm_immediate=True)
    talk.commands(0, 20.0, 10.003)
    moving = '003FFFF0#00C8000000000000'
    assert talk.until(10.06 + TICK) == [(10.02, moving), (10.04, moving), (10.06, moving)]
    assert talk.session.online
    assert talk.session.statistics.missed == 2

    assert talk.until(10.08 + TICK) == [(10.08, NEUTRAL)]
    assert talk.events() == [StationLost(SILENT)]
    assert not talk.session.online
    assert talk.session.offline_advice == SILENT

    assert talk.until(10.1421) == [
        (10.1, NEUTRAL), (10.12, NEUTRAL),
        # by number, as nobody has answered those
        (10.14, '00300321#0000000000000000'), (10.141, '00300331#0000000000000000'),
        (10.142, '00200321#0000000000000000')]
    assert talk.events() == []


@pytest.mark.parametrize('limit', [1, 2, 5])
def test_limit_of_misses_in_a_row(limit: int) -> None:
    talk = online(missed_limit=limit)
    answered = 10.0 + 0.02 * limit
    talk.until(answered + TICK)
    talk.hears(ANSWER, answered + 0.002)
    talk.until(answered + 0.02 * limit + TICK)
    assert talk.session.online
    talk.until(answered + 0.02 * limit + 0.02 + TICK)
    assert not talk.session.online
    assert talk.session.statistics.missed == 2 * limit - 1
    (lost,) = talk.events(StationLost)
    assert lost.reason == says('silent_for_cycles', cycles=limit)


def test_drive_that_answers_reads_but_no_cycles() -> None:
    talk = cycling()
    assert talk.until(10.06 + TICK) == [
        (10.0, NEUTRAL), (10.02, NEUTRAL), (10.04, NEUTRAL), (10.06, ASK_REQUEST_MAP)]
    checked(talk, 10.061)
    # never closer together than a period, here and elsewhere
    assert talk.until(10.07) == [(10.063, NEUTRAL)]
    assert talk.session.offline_advice == (
        says('cycles_unanswered'))
    assert talk.events(StationFound, StationLost) == []


def test_first_cycle_keeps_its_distance_to_the_last_one() -> None:
    talk = online(period=0.1)
    talk.until(10.4)
    assert talk.hears(ANSWER, 10.401) == []
    assert talk.until(10.45 + TICK) == [(10.45, ASK_REQUEST_MAP)]
    checked(talk, 10.451)
    assert talk.session.next_timer() == pytest.approx(10.5)


# -- bus and time ---------------------------------------------------------------------------------


def test_frames_that_were_not_fetched_die_with_the_bus() -> None:
    talk = online()
    talk.session.handle_timer(10.02)
    assert talk.bus_down(10.021) == []


def test_bus_that_comes_up_twice_makes_the_drive_offline_once() -> None:
    talk = online()
    assert talk.bus_up(10.01) == [ASK_REQUEST_MAP]
    assert talk.events() == [StationLost(says('reconnected'))]
    assert not talk.session.online


def test_lost_time_with_an_answer_in_the_queue() -> None:
    talk = online()
    talk.at(10.02)
    talk.handle_stall(15.0)
    talk.hears(ANSWER, 15.0)
    assert talk.events(FrameRejected, ProcessDataReceived, StationFound) == []
    talk.hears(ANSWER, 15.001)
    assert len(talk.events(FrameRejected)) == 1
