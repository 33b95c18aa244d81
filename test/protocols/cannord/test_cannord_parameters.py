# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The parameter channel: tasks, responses, errors, repeats, and what is late."""

from typing import Any

from builders import read, write
from cannord_session_builders import (
    ACCELERATION, ACCELERATION_2, ACTUAL, COUNTER, exchange, FAULT_NUMBER, FLAG, FREQUENCY,
    inverter, MONITORING, OFFSET, online, PARAMETERS, POSITION, SETPOINTS, VALUES,
)
from conversation import Conversation
import pytest
from saying import says

from drive_can_bridge.core.directory import ParameterDirectory
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.events import FrameRejected, Noted
from drive_can_bridge.core.parameters import Parameter, Storage
from drive_can_bridge.protocols.families import FAMILIES


def asked(talk: Conversation, request: Any, *talks: tuple[str, str]) -> list[object]:
    """
    Submit a request at 10.003 s, and hold the talk that follows.

    :param talks: (task that is sent, response that is heard).
    :return: the outcomes.
    """
    sent = talk.submits(request, 10.003)
    for place, (task, response) in enumerate(talks):
        assert sent == [f'202#{task}'], place
        sent = talk.hears(f'203#{response}', 10.004 + 0.001 * place)
    assert sent == []
    outcomes, = talk.outcomes()
    return outcomes


def no_answer(talk: Conversation) -> None:
    """Let the time pass that a request at 10.003 s has, while process data are answered."""
    for place in range(1, 6):
        exchange(talk, 10.0 + 0.02 * place)
    talk.until(10.11)


# -- reading --------------------------------------------------------------------------------------


@pytest.mark.parametrize(('wanted', 'talks', 'outcomes'), [
    pytest.param([ACCELERATION], [('6610000000000000', '6610000000006700')], [103], id='word'),
    pytest.param([FAULT_NUMBER], [('BC62000000000000', 'BC42000000006400')], [100],
                 id='element-of-an-array'),
    pytest.param([ACCELERATION_2], [('6660010000000000', '6640010000006400')], [100],
                 id='of-another-set'),
    pytest.param([OFFSET], [('9B11000000000000', '9B110000FFFFFBFF')], [-5], id='negative'),
    pytest.param([OFFSET], [('9B11000000000000', '9B1100000000FBFF')], [-5],
                 id='high-half-of-a-word-says-nothing'),
    pytest.param([POSITION], [('6562150000000000', '65521500FFFF6079')], [-34464], id='double'),
    pytest.param([COUNTER], [('CA12000000000000', 'CA2200000100A086')], [100000], id='unsigned'),
    pytest.param([ACCELERATION, FLAG, OFFSET], [
        ('6610000000000000', '6610000000006700'), ('7810000000000000', '7810000000000100'),
        ('9B11000000000000', '9B11000000000500')], [103, 1, 5], id='one-after-the-other')])
def test_reads(wanted: list[Parameter], talks: list[tuple[str, str]], outcomes: list[object],
               ) -> None:
    assert asked(online(), read(*wanted), *talks) == outcomes


@pytest.mark.parametrize(('number', 'text'), [
    (0, 'error 0: invalid parameter number'), (1, 'error 1: parameter value cannot be changed'),
    (2, 'error 2: limit exceeded'), (3, 'error 3: wrong sub-index'), (4, 'error 4: not an array'),
    (5, 'error 5: invalid data type'),
    (6, 'error 6: only resettable (only 0 may be written)'),
    (7, 'error 7: description element cannot be changed'),
    (9, 'error 9: description data missing'),
    (201, 'error 201: invalid task identifier in the last task'),
    (202, 'error 202: internal response identifier cannot be represented'),
    (77, 'error 77: unknown')])
def test_errors_in_words(number: int, text: str) -> None:
    response = f'667000000000{number:02X}00'
    assert asked(online(), read(ACCELERATION), ('6610000000000000', response)) == [
        says('refused_by_drive', number=number, text=text)]


def test_a_wrong_element_tells_how_many_there_are() -> None:
    assert asked(online(), read(POSITION),
                 ('6562150000000000', '6572150000000300'),
                 ('6592000000000000', '6562000000000500')) == [
        says('no_such_element', elements=5, number=3, parameter=613)]
    assert asked(online(), read(POSITION),
                 ('6562150000000000', '6572150000000300'),
                 ('6592000000000000', '6572000000000400')) == [
        says('refused_by_drive', number=3)]


@pytest.mark.parametrize(('parameter', 'task', 'response', 'text'), [
    (ACCELERATION, '6610000000000000', '6620000000006700',
     'the drive answers with a double word, the profile says uint16: correct the profile to '
     'int32 or uint32'),
    (COUNTER, 'CA12000000000000', 'CA12000000006700',
     'the drive answers with a word, the profile says uint32: correct the profile to '
     'bool, int16 or uint16')])
def test_a_profile_with_the_wrong_width(parameter: Parameter, task: str, response: str,
                                        text: str) -> None:
    assert asked(online(), read(parameter), (task, response)) == [text]


# -- writing --------------------------------------------------------------------------------------


@pytest.mark.parametrize(('parameter', 'raw', 'persist', 'task', 'response'), [
    pytest.param(ACCELERATION, 9999, False, '6620000000000F27', '6610000000000F27', id='2-word'),
    pytest.param(Parameter('p', COUNTER.type, 714, storage=Storage.EEPROM), 100000, False,
                 'CA3200000100A086', 'CA2200000100A086', id='3-double'),
    pytest.param(Parameter('p', number=102, subindex=1, storage=Storage.EEPROM), 100, False,
                 '6670010000006400', '6640010000006400', id='7-array-word'),
    pytest.param(POSITION, 100000, False, '658215000100A086', '655215000100A086',
                 id='8-array-double'),
    pytest.param(Parameter('p', COUNTER.type, 613, subindex=0x15, storage=Storage.RAM), 100000,
                 False, '65B215000100A086', '655215000100A086', id='11-array-double-ram'),
    pytest.param(ACCELERATION_2, 100, False, '66C0010000006400', '6640010000006400',
                 id='12-array-word-ram'),
    pytest.param(COUNTER, 70000, False, 'CAD2000001007011', 'CA22000001007011',
                 id='13-double-ram'),
    pytest.param(FLAG, 1, False, '78E0000000000100', '7810000000000100', id='14-word-ram'),
    pytest.param(OFFSET, -5, False, '9BE10000FFFFFBFF', '9B110000FFFFFBFF',
                 id='no-storage-is-ram'),
    pytest.param(OFFSET, -5, True, '9B210000FFFFFBFF', '9B110000FFFFFBFF',
                 id='no-storage-persistent'),
    pytest.param(FLAG, 1, True, '78E0000000000100', '7810000000000100',
                 id='explicit-ram-wins'),
    pytest.param(OFFSET, -5, False, '9BE10000FFFFFBFF', '9B1100000000FBFF',
                 id='high-half-of-a-word-says-nothing'),
])
def test_write_tasks(parameter: Parameter, raw: int, persist: bool, task: str,
                     response: str) -> None:
    talk = online(persist_writes=persist)
    assert asked(talk, write((parameter, raw)), (task, response)) == ['written']


def test_layout_variants() -> None:
    talk = online(value_order='low_first')
    assert asked(talk, write((ACCELERATION, 9999)),
                 ('662000000F270000', '661000000F270000')) == ['written']
    assert asked(talk, read(POSITION), ('6562150000000000', '65521500A0860100')) == [100000]
    assert asked(talk, read(ACCELERATION), ('6610000000000000', '6670000002000000')) == [
        says('refused_by_drive', number=2)]
    talk = online(index_byte='high')
    assert asked(talk, write((ACCELERATION_2, 100)),
                 ('66C0000100006400', '6640000100006400')) == ['written']
    assert asked(talk, read(POSITION), ('6562001500000000', '655200150100A086')) == [100000]


def test_write_refused() -> None:
    assert asked(online(), write((ACCELERATION, 9999), (FLAG, 1)),
                 ('6620000000000F27', '6670000000000200'),
                 ('78E0000000000100', '7810000000000100')) == [
        says('refused_by_drive', number=2), 'written']


def test_no_answer_to_a_write_while_online() -> None:
    talk = online()
    talk.submits(write((ACCELERATION, 9999)), 10.003)
    no_answer(talk)
    assert talk.outcomes() == [[says('no_answer', attempts=1, timeout=0.1)]]


def test_both_halves_of_a_double_word_are_acknowledged() -> None:
    talk = online()
    talk.submits(write((POSITION, 100000)), 10.003)
    talk.hears('203#655215000000A086', 10.004)
    what = 'response to writing P613.21 with another value'
    assert talk.events(FrameRejected) == [FrameRejected(says('malformed', what=what))]
    talk.hears('203#655215000100A086', 10.005)
    assert talk.outcomes() == [['written']]


def test_an_acknowledgement_with_another_value_is_none() -> None:
    talk = online()
    talk.submits(write((ACCELERATION, 9999)), 10.003)
    talk.hears('203#6610000000006400', 10.004)
    what = 'response to writing P102.0 with another value'
    assert talk.events(FrameRejected) == [FrameRejected(says('malformed', what=what))]
    talk.hears('203#6610000000000F27', 10.006)     # that was a late one, this is the right one
    assert talk.outcomes() == [['written']]
    talk.submits(write((ACCELERATION, 9999)), 10.007)
    talk.hears('203#6610000000006400', 10.008)
    no_answer(talk)
    assert talk.outcomes() == [[says('read_back_differs', found='1', wanted='99.99')]]


def test_another_value_is_forgotten_with_its_write() -> None:
    talk = online()
    talk.submits(write((ACCELERATION, 9999), (FLAG, 1)), 10.003)
    talk.hears('203#6610000000006400', 10.004)
    assert talk.hears('203#6610000000000F27', 10.005) == ['202#78E0000000000100']
    no_answer(talk)
    assert talk.outcomes() == [['written', says('no_answer', attempts=1, timeout=0.1)]]


def test_only_one_fits_a_frame() -> None:
    talk = online()
    assert talk.submits(write((FLAG, 1), (OFFSET, 2), atomic=True), 10.003) == []
    fits = 'a CANnord frame carries one parameter'
    assert talk.outcomes() == [[says('not_in_one_frame', fits=fits)] * 2]
    assert asked(talk, write((FLAG, 1), atomic=True),
                 ('78E0000000000100', '7810000000000100')) == ['written']


# -- repeats, and what is late --------------------------------------------------------------------


def test_reads_are_repeated() -> None:
    talk = online(parameter_timeout=0.013, parameter_retries=2)
    assert talk.submits(read(ACCELERATION), 10.003) == ['202#6610000000000000']
    assert talk.until(10.0165) == [(10.016, '202#6610000000000000')]
    assert talk.until(10.0195) == []
    exchange(talk, 10.02)
    assert talk.until(10.0295) == [(10.029, '202#6610000000000000')]
    talk.hears('203#6610000000006700', 10.03)
    assert talk.outcomes() == [[103]]
    talk.hears('203#6610000000006700', 10.031)     # the answer to an earlier attempt
    assert (talk.session.statistics.late, talk.session.statistics.rejected) == (1, 0)
    for at in (10.032, 10.033):     # two attempts were given up
        talk.hears('203#6610000000006700', at)
    what = 'parameter response that nobody asked for'
    assert talk.events(FrameRejected) == [FrameRejected(says('malformed', what=what))]


def test_no_answer_after_all_attempts() -> None:
    talk = online(parameter_timeout=0.005, parameter_retries=1)
    talk.submits(read(ACCELERATION, OFFSET), 10.003)
    assert talk.until(10.0181) == [
        (10.008, '202#6610000000000000'), (10.013, '202#9B11000000000000'),
        (10.018, '202#9B11000000000000')]
    exchange(talk, 10.02)
    talk.until(10.03)
    assert talk.outcomes() == [[says('no_answer', attempts=2, timeout=0.005)] * 2]


@pytest.mark.parametrize('late', [
    '6610000000006700',     # another parameter
    '9B61000000000500',     # number of elements: no answer to a read
    '9B41000000000500',     # of an array
    '9B11010000000500',     # another sub-index
    '9B31000000000500', '9B81000000000500', '9B01000000000500',     # no such response, or none
    '9B71010000000200',     # a refusal for another sub-index
    '9B19000000000500'])    # bit 11
def test_what_does_not_belong_to_the_task_is_discarded(late: str) -> None:
    talk = online()
    talk.submits(read(OFFSET), 10.003)
    talk.hears(f'203#{late}', 10.004)
    assert len(talk.events(FrameRejected)) == 1
    assert talk.session.statistics.rejected == 1
    talk.hears('203#9B11000000000700', 10.006)
    assert talk.outcomes() == [[7]]


def test_a_refusal_may_leave_the_sub_index_away() -> None:
    assert asked(online(), write((ACCELERATION_2, 100)),
                 ('66C0010000006400', '6670000000000200')) == [
        says('refused_by_drive', number=2)]


def test_a_late_refusal_without_sub_index_is_that_of_no_other_element() -> None:
    talk = online(period=5.0)
    assert talk.submits(write((ACCELERATION_2, 100)), 10.003) == ['202#66C0010000006400']
    assert talk.until(10.104) == []
    assert talk.submits(write((ACCELERATION, 50)), 10.105) == []
    assert talk.hears('203#6670000000000300', 10.15) == []
    (_, task), = talk.until(10.25)
    assert task == '202#6620000000003200'
    assert talk.hears('203#6610000000003200', 10.251) == []
    assert talk.outcomes() == [[says('no_answer', attempts=1, timeout=0.1)], ['written']]


@pytest.mark.parametrize('size', [0, 4, 7])
def test_malformed_responses(size: int) -> None:
    what = f'{size} data bytes: parameter frames have 8'
    talk = online()
    talk.submits(read(OFFSET), 10.003)
    talk.hears('203#' + '00' * size, 10.004)
    assert talk.events(FrameRejected) == [FrameRejected(says('malformed', what=what))]


def test_an_absent_drive_ends_a_request_with_its_first_name() -> None:
    talk = online()
    talk.until(10.2)
    talk.submits(read(OFFSET, ACTUAL, FLAG, COUNTER), 10.2)
    sent = [text for _, text in talk.until(11.0) if text.startswith('202')]
    assert sent == ['202#9B11000000000000'] * 2
    assert talk.outcomes() == [[
        says('no_answer_offline'), says('process_data_not_received'),
        says('no_answer_offline'), says('no_answer_offline')]]


def test_an_absent_drive_is_sent_one_write_only() -> None:
    talk = online()
    talk.until(10.2)
    talk.submits(write((OFFSET, 1), (ACTUAL, 2), (FLAG, 1)), 10.2)
    assert [text for _, text in talk.until(11.0) if text.startswith('202')] == []
    assert talk.outcomes() == [[
        says('no_answer_offline'), says('process_data_only'), says('no_answer_offline')]]


def test_time_out_may_change() -> None:
    talk = online()
    talk.session.reconfigure(parameter_timeout=0.005)
    talk.submits(write((FLAG, 1)), 10.003)
    talk.until(10.009)
    assert talk.outcomes() == [[says('no_answer', attempts=1, timeout=0.005)]]


# -- what exists in process data only -------------------------------------------------------------


def test_process_data_are_read_without_a_frame() -> None:
    talk = online('003#310B0020')
    assert talk.submits(read(ACTUAL), 10.003) == []
    assert talk.outcomes() == [[8192]]
    assert talk.submits(read(FREQUENCY), 10.003) == []
    assert talk.outcomes() == [[says('process_data_not_received')]]


def test_process_data_are_not_written() -> None:
    talk = online(request=SETPOINTS[:1], response=VALUES[:1])
    refusal = talk.session.services.write_refusal
    assert refusal(FREQUENCY) == says('sent_cyclically', name='frequency_setpoint')
    assert refusal(SETPOINTS[1]) == says('process_data_only')
    assert refusal(ACCELERATION) == ''
    talk.submits(write((SETPOINTS[1], 5), (ACTUAL, 5)), 10.003)
    assert talk.outcomes() == [[says('process_data_only')] * 2]


# -- raw names ------------------------------------------------------------------------------------


def raw(name: str) -> Parameter:
    drive = inverter()
    directory = ParameterDirectory(
        {entry.name: entry for entry in PARAMETERS},
        lambda other: FAMILIES['cannord'].raw_parameter(drive, other))
    found = directory.find(name)
    assert found is not None
    return found


def user_value(name: str, value: int) -> tuple[Parameter, int]:
    """Return what becomes of a user's value."""
    parameter = raw(name)
    return parameter, ParameterDirectory({}, lambda _: None).raw_from_user(parameter, value)


def test_raw_names_are_as_wide_as_the_drive_says() -> None:
    assert asked(online(), read(raw('p310')), ('3611000000000000', '36110000FFFFFBFF')) == [65531]
    assert asked(online(), read(raw('p310')), ('3611000000000000', '36210000FFFFFBFF')) == [
        0xFFFFFFFB]
    assert asked(online(), read(raw('p310.7')), ('3661070000000000', '36510700FFFFFBFF')) == [
        0xFFFFFFFB]


def test_raw_writes_ask_for_the_width_first() -> None:
    talk = online()
    assert asked(talk, write(user_value('p310', -5)),
                 ('3611000000000000', '3611000000000000'),
                 ('36E10000FFFFFBFF', '36110000FFFFFBFF')) == ['written']
    assert asked(talk, write(user_value('p310', -5)),
                 ('3611000000000000', '3621000000000000'),
                 ('36D10000FFFFFBFF', '36210000FFFFFBFF')) == ['written']
    assert asked(talk, write(user_value('p310.21', 100000)),
                 ('3661150000000000', '3651150000000000'),
                 ('36B115000100A086', '365115000100A086')) == ['written']
    assert asked(talk, write(user_value('p310', 65531)),
                 ('3611000000000000', '3611000000000000'),
                 ('36E100000000FBFF', '36110000FFFFFBFF')) == ['written']


def test_raw_writes_follow_persist_writes() -> None:
    assert asked(online(persist_writes=True), write(user_value('p310', 5)),
                 ('3611000000000000', '3611000000000000'),
                 ('3621000000000500', '3611000000000500')) == ['written']


def test_raw_writes_that_do_not_fit_or_are_refused() -> None:
    talk = online()
    assert asked(talk, write(user_value('p310', 65536)),
                 ('3611000000000000', '3611000000000000')) == [
        says('not_in_bits', bits=16, high=65535, low=-32768, value=65536)]
    assert asked(talk, write(user_value('p310', -32769)),
                 ('3611000000000000', '3611000000000000')) == [
        says('not_in_bits', bits=16, high=65535, low=-32768, value=-32769)]
    assert asked(talk, write(user_value('p310', 1)), ('3611000000000000', '3671000000000000')) == [
        says('refused_by_drive', number=0)]
    with pytest.raises(ValueRefused, match='4294967296 is not representable in 32 bits'):
        user_value('p310', 1 << 32)


def test_raw_names_of_listed_parameters_obey_their_rules() -> None:
    # P613.21 is listed as int32 in EEPROM: nothing has to be asked
    assert asked(online(), write(user_value('p613.21', 100000)),
                 ('658215000100A086', '655215000100A086')) == ['written']
    # P411 is listed as int16: a negative one has FFFFh in PWE1, by whatever name
    for value in (-5, 65531):
        assert asked(online(), write(user_value('p411', value)),
                     ('9BE10000FFFFFBFF', '9B110000FFFFFBFF')) == ['written']
    assert asked(online(), write(user_value('p411', 32767)),
                 ('9BE100000000FF7F', '9B1100000000FF7F')) == ['written']
    # P102 as uint16, in EEPROM
    assert asked(online(), write(user_value('p102', 65531)),
                 ('662000000000FBFF', '661000000000FBFF')) == ['written']
    with pytest.raises(ValueRefused, match='read-only'):
        user_value('p700.0', 1)
    # a task without sub-index acts on the first element
    assert raw('p700').access.value == 'ro'
    assert raw('p700.1').access.value == 'rw'


# -- the inverter's own time-out ------------------------------------------------------------------


def monitored(**options: Any) -> tuple[Conversation, list[str]]:
    talk = Conversation(inverter(table=(FREQUENCY, ACTUAL, MONITORING), **options)).begun()
    talk.at(10.0)
    return talk, talk.hears('003#310B0000', 10.002)


@pytest.mark.parametrize(('period', 'deciseconds', 'tight'), [
    (0.02, '0000', False), (0.02, 'FFFF', False), (0.02, '0100', False), (0.04, '0100', True),
    (0.1, '0300', False), (0.1, '0200', True), (0.5, '0500', True)])
def test_telegram_time_out(period: float, deciseconds: str, tight: bool) -> None:
    talk, sent = monitored(period=period)
    assert sent == ['202#0112000000000000']
    high = 'FFFF' if deciseconds == 'FFFF' else '0000'
    talk.hears(f'203#01120000{high}{deciseconds}', 10.005)
    assert bool(talk.session.warning) is tight
    none = deciseconds in ('0000', 'FFFF')
    assert [event.text.code for event in talk.events(Noted)] == (
        ['not_monitored'] if none else ['timeout_too_tight'] * tight)


@pytest.mark.parametrize('raw_value', [-1, 65535])
def test_telegram_time_out_that_is_negative(raw_value: int) -> None:
    """-0.1 s: errors of the bus do not stop the drive. By its number too, whatever a user says."""
    talk, _ = monitored()
    drive = talk.session.configuration
    found = ParameterDirectory(
        drive.profile.parameters,
        lambda name: FAMILIES['cannord'].raw_parameter(drive, name)).find('p513')
    assert found is not None
    talk.hears('203#0112000000000000', 10.005)
    item = (MONITORING, -1) if raw_value == -1 else (found, raw_value)
    assert talk.submits(write(item), 10.006) == ['202#01220000FFFFFFFF']


def test_that_nothing_stops_an_inverter_is_told_once() -> None:
    """P513 = -0.1 s: it runs on when telegrams end; so it does with 0, as delivered."""
    talk, _ = monitored()
    talk.hears('203#01120000FFFFFFFF', 10.005)
    event, = talk.events(Noted)
    assert event.warning and event.text == says(
        'not_monitored', name='telegram_timeout', address='P513', timeout=pytest.approx(-0.1))
    assert talk.session.warning == ''
    # looked at again behind a write
    for raw_value, told in ((-1, []), (0, ['not_monitored']), (5, []), (0, ['not_monitored'])):
        word = f'{(raw_value & 0xFFFF).to_bytes(2, "little").hex().upper()}'
        high = 'FFFF' if raw_value < 0 else '0000'
        talk.submits(write((MONITORING, raw_value)), talk.now + 0.0001)
        talk.hears(f'203#01120000{high}{word}', talk.now + 0.0001)
        talk.hears(f'203#01120000{high}{word}', talk.now + 0.0001)
        assert [each.text.code for each in talk.events(Noted)] == told


def test_telegram_time_out_in_words() -> None:
    talk, _ = monitored(period=0.1)
    talk.hears('203#0112000000000200', 10.005)
    assert talk.session.warning == (
        says(
            'timeout_too_tight', address='P513', least=pytest.approx(0.3),
            name='telegram_timeout', period=0.1, timeout=0.2))
    talk.until(11.0)
    assert not talk.session.online
    assert talk.session.warning == ''
    assert talk.hears('003#310B0000', 11.001) == ['202#0112000000000000']


def test_telegram_time_out_is_looked_at_again_when_it_was_written() -> None:
    """Users have their turn behind that."""
    talk, _ = monitored(period=0.1)
    talk.hears('203#0112000000000200', 10.005)
    assert talk.session.warning
    assert talk.submits(write((MONITORING, 5)), 10.006) == ['202#0122000000000500']
    assert talk.submits(read(COUNTER), 10.0065) == []
    assert talk.hears('203#0112000000000500', 10.007) == ['202#0112000000000000']
    assert talk.outcomes() == [['written']]
    assert talk.hears('203#0112000000000500', 10.008) == ['202#CA12000000000000']
    assert talk.session.warning == ''


def test_telegram_time_out_that_cannot_be_read() -> None:
    talk, _ = monitored()
    talk.hears('203#0172000000000000', 10.005)
    assert talk.events(Noted) == [Noted(
        says('timeout_unknown', address='P513', reason=says('refused_by_drive', number=0)))]
    assert talk.session.warning == ''
    assert talk.outcomes() == []


def test_telegram_time_out_that_was_not_answered_is_looked_at_when_it_was_written() -> None:
    """Nobody asks for ten seconds what nobody answered; but now it does answer."""
    talk, _ = monitored(period=1.0, parameter_retries=0)
    talk.until(10.3)
    assert len(talk.events(Noted)) == 1
    talk.submits(write((MONITORING, 5)), 10.4)
    assert talk.until(10.42) == [(10.41, '202#0122000000000500')]
    assert talk.hears('203#0112000000000500', 10.421) == ['202#0112000000000000']
    talk.hears('203#0112000000000500', 10.422)
    assert talk.session.warning == says('timeout_too_tight', timeout=0.5)
