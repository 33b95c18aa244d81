# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The polled exchange: what is read, what is published, what counts as missed."""

from typing import Any

from builders import write
from pkw_builders import (
    ANSWER_0, ANSWER_1, CONTROL, CURRENT, FLC, IDLE, IDLE_ANSWER, LEVEL, online, RATIO, READ_0,
    READ_1, reading, START, started, STATUS, STATUS_2,
)
import pytest
from saying import says

from drive_can_bridge.core.events import (
    AnswerLate, DriveState, FrameRejected, Noted, ProcessDataReceived, StationFound, StationLost)

READ_SINGLE_0 = '505#C701002500000000'


def test_rounds_keep_their_beat_and_alternate_the_toggle() -> None:
    talk = online()
    for due, read, answer in [(10.07, READ_0, ANSWER_0), (10.09, READ_1, ANSWER_1),
                              (10.11, READ_0, ANSWER_0)]:
        assert talk.until(due + 1e-6) == [(pytest.approx(due), read)]
        assert talk.hears(answer, due + 0.004) == []
    assert talk.samples() == [(0x41, 0)] * 3
    statistics = talk.session.statistics
    assert (statistics.exchanges, statistics.missed, statistics.rejected) == (4, 0, 0)
    assert statistics.latency.maximum == pytest.approx(0.004)
    assert statistics.period_error.maximum < 1e-6


@pytest.mark.parametrize('response, requests', [
    ((LEVEL,), ['D10100A5']),
    ((RATIO, LEVEL), ['D10100A6']),
    ((STATUS, LEVEL, RATIO, STATUS_2), ['C70100A6', 'D1010026']),
    ((STATUS, LEVEL), ['C70100A5', 'D1010025']),
    ((CURRENT, STATUS), ['C70100A5', 'F4010026']),
])
def test_adjacent_registers_share_a_read(response: Any, requests: list[str]) -> None:
    talk, sent = reading(response=response)
    seen = []
    while sent:
        request, = sent
        seen.append(request[4:12])
        sent = talk.hears(f'485#{request[4:12]}01000200', 10.052)
    assert seen == requests
    assert talk.session.online


def test_values_come_in_the_order_of_the_configuration() -> None:
    talk, sent = reading(response=(RATIO, CURRENT, LEVEL))
    assert sent == ['505#D10100A600000000']
    assert talk.hears('485#D10100A605000600', 10.052) == ['505#F401002600000000']
    assert talk.hears('485#F401002601000002', 10.053) == []
    assert talk.samples() == [(6, 0x00010200, 5)]


@pytest.mark.parametrize('options, raw', [
    ({}, 0x00000384), ({'word_order': 'low_first'}, 0x03840000)])
def test_word_order(options: dict[str, Any], raw: int) -> None:
    talk, _ = reading(response=(CURRENT,), **options)
    talk.hears('485#F40100A600008403', 10.052)
    assert talk.samples() == [(raw,)]


@pytest.mark.parametrize('layout, read, answer, written, acknowledged', [
    ('dword_swapped', '505#00A6C70100000000', '485#00A6C70100004100',
     '505#002A8C0200005A00', '485#002A8C0200000000'),
    ('word_be', '505#01C7A60000000000', '485#01C7A60000410000',
     '505#028C2A00005A0000', '485#028C2A0000000000'),
])
def test_other_layouts(layout: str, read: str, answer: str, written: str,
                       acknowledged: str) -> None:
    talk, sent = reading(layout=layout)
    assert sent == [read]
    assert talk.hears(answer, 10.052) == []
    assert talk.samples() == [(0x41, 0)]
    assert talk.submits(write((FLC, 90)), 10.06) == [written]
    talk.hears(acknowledged, 10.061)
    assert talk.outcomes() == [['written']]


def test_other_identifiers() -> None:
    talk = started(request_cob_id=0x301, response_cob_id=0x281)
    assert talk.at(10.05) == ['301#0000000000000000']
    assert talk.hears(IDLE_ANSWER, 10.051) == []
    assert talk.hears('281#0000000000000000', 10.051) == ['301#C70100A600000000']
    talk.hears('281#C70100A641000000', 10.052)
    assert talk.samples() == [(0x41, 0)]


# -- trouble --------------------------------------------------------------------------------------


def test_lost_response_costs_one_round_and_is_not_believed_later() -> None:
    talk = online(parameter_timeout=0.1)
    assert talk.until(10.075) == [(10.07, READ_0)]
    assert talk.until(10.18) == [(10.17, IDLE)], 'the next round begins with function 00h'
    assert talk.hears(ANSWER_0, 10.18) == []
    assert (talk.session.statistics.late, talk.session.statistics.rejected) == (1, 0)
    assert talk.events() == [AnswerLate(pytest.approx(0.01))]
    talk.hears(ANSWER_0, 10.1805)       # and one too many
    message = 'function 26h, register 455'
    assert talk.events() == [FrameRejected(says('unasked_pkw', message=message))]
    assert talk.hears(IDLE_ANSWER, 10.181) == [READ_1]
    talk.hears(ANSWER_1, 10.182)
    assert talk.samples() == [(0x41, 0)]
    assert talk.session.statistics.missed == 1
    assert talk.session.online


def test_three_missed_rounds_make_it_offline_and_one_good_one_online() -> None:
    talk = online(parameter_timeout=0.1)
    sent = talk.until(10.6)
    assert [text for _, text in sent] == [READ_0, IDLE, READ_1, IDLE, READ_0, IDLE]
    lost, = talk.events(StationLost)
    assert lost == StationLost(says('no_round', periods=3))
    assert talk.session.offline_advice == lost.reason
    assert talk.session.statistics.missed == 3
    assert talk.session.state is DriveState.OFFLINE
    assert talk.until(10.7) == [(10.67, READ_1)]
    talk.hears(ANSWER_1, 10.71)
    assert talk.session.online
    assert talk.events(StationFound, ProcessDataReceived) == [
        StationFound(), ProcessDataReceived((0x41, 0), 10.71)]


def test_slow_device_gets_no_bursts() -> None:
    """It answers after 50 ms: the next round begins when the last one is over, once."""
    talk = online()
    assert talk.until(10.11) == [(10.07, READ_0)]
    assert talk.hears(ANSWER_0, 10.12) == []
    assert talk.at(10.12) == [READ_1]
    assert talk.until(10.169) == []
    assert talk.hears(ANSWER_1, 10.17) == []
    assert talk.at(10.17) == [READ_0]
    assert talk.session.statistics.missed == 0


def test_half_of_a_round_publishes_nothing() -> None:
    talk, _ = reading(parameter_timeout=0.1, response=(STATUS, LEVEL))
    assert talk.hears('485#C70100A541000000', 10.052) == ['505#D101002500000000']
    assert talk.until(10.16) == [(10.152, IDLE)], 'a new round, from its first read'
    assert talk.hears(IDLE_ANSWER, 10.153) == ['505#C70100A500000000']
    assert talk.events(ProcessDataReceived, StationFound) == []
    assert talk.session.statistics.missed == 1


# -- refusals -------------------------------------------------------------------------------------


def test_a_refused_round_between_two_that_are_missed() -> None:
    talk, _ = reading(response=(STATUS, LEVEL), parameter_timeout=0.015, missed_limit=2)
    talk.hears('485#C70100A541000000', 10.052)
    talk.hears('485#D101002507000000', 10.053)
    assert talk.until(10.0901) == [(10.07, '505#C70100A500000000'), (10.09, IDLE)]
    assert talk.hears(IDLE_ANSWER, 10.091) == [READ_SINGLE_0]
    assert talk.hears('485#C701004E00000206', 10.092) == ['505#D10100A500000000']
    assert talk.hears('485#D10100CE00000206', 10.093) == []
    assert talk.until(10.1301) == [(10.11, READ_SINGLE_0), (10.13, IDLE)]
    assert talk.session.statistics.missed == 2
    assert talk.session.online, 'they were not in a row'


def test_what_was_missed_before_a_restart_counts_no_more() -> None:
    talk = online(parameter_timeout=0.015)
    talk.until(10.106)
    assert talk.session.statistics.missed == 1
    assert talk.hears('705#00', 10.107) == [START]
    talk.until(10.22)
    assert talk.session.statistics.missed == 3
    assert talk.session.offline_advice == says('restarted_waiting')
    talk.until(10.26)
    assert talk.session.statistics.missed == 4
    assert talk.session.offline_advice == says('rounds_unanswered')


def test_refused_poll_is_an_answer_but_shown() -> None:
    talk, _ = reading(response=(STATUS, LEVEL))
    assert talk.hears('485#C70100A541000000', 10.052) == ['505#D101002500000000']
    assert talk.hears('485#D101004E00000206', 10.053) == []
    assert talk.session.online
    assert talk.session.statistics.missed == 0
    assert talk.session.statistics.exchanges == 0
    reason = says('refused_by_drive', number=0x06020000)
    assert talk.session.warning == says(
        'poll_refused', what=says('write_refused', what='thermal_level', reason=reason))
    assert talk.events() == [
        Noted(says('read_refused', names='thermal_level', reason=reason), warning=True),
        StationFound()]
    # told once; gone when it is answered
    talk.until(10.0701)
    talk.hears('485#C70100A541000000', 10.071)
    talk.hears('485#D101004E00000206', 10.072)
    assert talk.events() == []
    talk.until(10.0901)
    talk.hears('485#C70100A541000000', 10.091)
    talk.hears('485#D101002507000000', 10.092)
    assert talk.session.warning == ''
    assert talk.samples() == [(0x41, 7)]
    talk.until(10.1101)
    talk.hears('485#C70100A541000000', 10.111)
    talk.hears('485#D101004E00000206', 10.112)
    assert talk.session.online
    assert talk.samples() == [], 'a value is of its own round, or of none'


def test_refused_pair_is_read_one_by_one_until_a_new_beginning() -> None:
    talk, _ = reading()
    assert talk.hears('485#C70100CE00000206', 10.052) == [READ_SINGLE_0]
    assert talk.hears('485#C701002541000000', 10.053) == ['505#C80100A500000000']
    assert talk.hears('485#C80100A507000000', 10.054) == []
    assert talk.samples() == [(0x41, 7)]
    assert talk.session.warning == ''
    assert talk.until(10.0701) == [(10.07, READ_SINGLE_0)]
    talk.bus_down(10.08)
    talk.bus_up(11.0)
    assert talk.until(11.0501) == [(11.05, IDLE)]
    assert talk.hears(IDLE_ANSWER, 11.051) == [READ_1]      # both in one


def test_refused_32_bits_have_no_halves() -> None:
    talk, _ = reading(response=(CURRENT,))
    assert talk.hears('485#F40100CE00000206', 10.052) == []
    assert talk.session.online
    assert 'average_current refused' in talk.session.warning


def test_status_that_is_no_response_is_read_along() -> None:
    talk, sent = reading(response=(LEVEL,), control=CONTROL)
    assert sent == ['505#C70100A500000000']
    assert talk.hears('485#C70100A541000000', 10.052) == ['505#D101002500000000']
    assert talk.hears('485#D101002507000000', 10.053) == ['505#C00200AA00000000']
    assert talk.samples() == [(7,)]


# -- what is no answer ----------------------------------------------------------------------------


@pytest.mark.parametrize('text', [
    '485#C701002641000000',        # nobody asked
    '485#', '485#00', '485#C7010026410000',
    '705#', '705#01', '705#0500', '085#', '085#1023',
])
def test_malformed_and_unasked_frames_are_counted(text: str) -> None:
    talk = online()
    assert talk.hears(text, 10.06) == []
    assert talk.session.statistics.rejected == 1
    assert len(talk.events(FrameRejected)) == 1
    assert talk.session.online


@pytest.mark.parametrize('text', [
    '486#C701002641000000', '00000485#C701002641000000', '000#0206', '000#0105FF', '123#00',
    '00000705#00', '706#00', '706#05', '086#1023000000000000'])
def test_frames_of_others_do_not_matter(text: str) -> None:
    talk = online()
    assert talk.hears(text, 10.06) == []
    assert talk.session.facts() == {'nmt_state': 'unknown', 'emergency': 'none'}
    assert talk.session.statistics.rejected == 0
    assert talk.events() == []
    assert talk.session.online


@pytest.mark.parametrize(('frame', 'code', 'facts'), [
    ('505#C002002A01000000', 'other_master_asks_node', {'node': 5, 'what': 'PKW requests'}),
    ('605#4000100000000000', 'other_master_reads', {'node': 5}),
    ('605#2B17100000000000', 'heartbeats_ended', {'node': 5}),
    ('000#8200', 'other_master_resets',
     {'command': 'reset communication', 'whom': 'all nodes'}),
    ('000#0200', 'other_master_nmt', {'command': 'stop', 'whom': 'all nodes'}),
    ('000#0105', 'other_master_nmt', {'command': 'start', 'whom': 'node 5'}),
])
def test_another_master_is_noticed(frame: str, code: str, facts: dict[str, Any]) -> None:
    talk = online()
    assert talk.hears(frame, 10.06) == []
    event, = talk.events()
    assert event.text == says(code, frame=frame, **facts)
    assert talk.session.online
