# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Requests of users: all eight functions, what fails and how it is said, and whose turn it is."""

from dataclasses import replace
from typing import Any

from builders import read, write
from conversation import Conversation
from pkw_builders import (
    ANSWER_1, BOOT_UP, CLASS, configuration, CURRENT, DISABLE_1, echo, FLC, FLC_2, IDLE,
    IDLE_ANSWER, KEY, LEVEL, online, POSITION, PRE_OPERATIONAL, READ_1, reading, running, SPEED,
    START, STATUS, TABLE,
)
import pytest
from saying import says

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.directory import ParameterDirectory
from drive_can_bridge.core.events import AnswerLate
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.families import FAMILIES

FAMILY = FAMILIES['canopen_pkw']


def raw(name: str, **options: Any) -> Parameter:
    """Resolve a raw name."""
    drive = configuration(**options)
    found = ParameterDirectory(
        drive.profile.parameters, lambda text: FAMILY.raw_parameter(drive, text)).find(name)
    assert found is not None
    return found


def asked(talk: Conversation, request: Any) -> str:
    """Submit a request and return the frame that it causes."""
    frame, = talk.submits(request, 10.06)
    return frame


# -- what goes over the wire ----------------------------------------------------------------------


@pytest.mark.parametrize('request_, sent, answer, outcome', [
    (read(FLC), '505#8C02002500000000', '485#8C02002564000000', [100]),
    (read(CURRENT), '505#F401002600000000', '485#F401002600008403', [900]),
    (read(FLC, FLC_2), '505#8C02002600000000', '485#8C02002605000600', [5, 6]),
    (read(FLC_2, FLC), '505#8C02002600000000', '485#8C02002605000600', [6, 5]),
    (read(FLC, FLC), '505#8C02002500000000', '485#8C02002505000000', [5, 5]),
    (write((FLC, 90)), '505#8C02002A5A000000', '485#8C02002A00000000', ['written']),
    (write((POSITION, -2)), '505#D002002BFFFFFEFF', '485#D002002B00000000', ['written']),
    (write((POSITION, 0x12345678)), '505#D002002B34127856', '485#D002002B00000000',
     ['written']),
    (write((FLC, 90), (FLC_2, 91), atomic=True), '505#8C02002B5A005B00', '485#8C02002B00000000',
     ['written', 'written']),
    (write((FLC_2, 91), (FLC, 90), atomic=True), '505#8C02002B5A005B00', '485#8C02002B00000000',
     ['written', 'written']),
    (write((POSITION, 1), atomic=True), '505#D002002B00000100', '485#D002002B00000000',
     ['written']),
    (write((FLC, 90), atomic=True), '505#8C02002A5A000000', '485#8C02002A00000000', ['written']),
])
def test_by_register(request_: Any, sent: str, answer: str, outcome: list[object]) -> None:
    check(online(), request_, sent, answer, outcome)


def check(talk: Conversation, request_: Any, sent: str, answer: str, outcome: list[object],
          ) -> None:
    assert asked(talk, request_) == sent
    assert talk.hears(answer, 10.061) == []
    assert talk.outcomes() == [outcome]


@pytest.mark.parametrize('request_, sent, answer, outcome', [
    (read(FLC), '505#0720033500000000', '485#0720033564000000', [100]),
    (read(CURRENT), '505#0420333600000000', '485#0420333600008403', [900]),
    (read(FLC, FLC_2), '505#0720033600000000', '485#0720033605000600', [5, 6]),
    (write((FLC, 90)), '505#0720033A5A000000', '485#0720033A00000000', ['written']),
    (write((POSITION, 65537)), '505#0820153B01000100', '485#0820153B00000000', ['written']),
    (write((FLC, 90), (FLC_2, 91), atomic=True), '505#0720033B5A005B00', '485#0720033B00000000',
     ['written', 'written']),
])
def test_by_index(request_: Any, sent: str, answer: str, outcome: list[object]) -> None:
    check(online_by_index(), request_, sent, answer, outcome)


def online_by_index() -> Conversation:
    talk, sent = reading(addressing='canopen')
    assert sent == ['505#042006B600000000']
    talk.hears('485#042006B641000700', 10.052)
    assert talk.samples() == [(0x41, 7)]
    return talk


@pytest.mark.parametrize('by_index', [False, True])
@pytest.mark.parametrize('name, sent', [
    ('p465', '505#D101002500000000'), ('x2004.10', '505#0420103500000000'),
    ('p704', '505#C002002500000000'), ('x200c.1', '505#0C20013500000000'),
    ('xFFFF.ff', '505#FFFFFF3500000000'), ('p65535', '505#FFFF002500000000'),
    ('p0', '505#0000002500000000'), ('p500', '505#F401002500000000'),     # one half of a value
])
def test_raw_names_say_themselves_how_they_go(name: str, sent: str, by_index: bool) -> None:
    check(online_by_index() if by_index else online(), read(raw(name)), sent,
          sent.replace('505', '485')[:12] + '34120000', [0x1234])


def test_raw_writes_are_16_bits() -> None:
    talk = online()
    assert asked(talk, write((raw('x2007.3'), 0xFFFF))) == '505#0720033AFFFF0000'


def test_word_order_of_a_parameter_wins() -> None:
    swapped = replace(POSITION, word_order='low_first')
    written = '505#D002002B78563412', '485#D002002B00000000', ['written']
    check(online(), write((swapped, 0x12345678)), *written)
    check(online(), read(swapped), '505#D002002600000000', '485#D002002678563412', [0x12345678])
    check(online(word_order='low_first'), write((POSITION, 0x12345678)), *written)


@pytest.mark.parametrize('items', [
    ((FLC, 1), (CLASS, 2)),                    # not adjacent
    ((FLC, 1), (FLC, 2)),                      # the same
    ((FLC, 1), (FLC_2, 2), (CLASS, 3)),        # three
    ((POSITION, 1), (KEY, 2)),                 # three registers
    ((raw('p704'), 1), (raw('x2008.6'), 2)),   # two kinds of address
    ((raw('x2C0.1'), 1), (raw('p704'), 2)),
    ((raw('x2000.ff'), 1), (raw('x2001.0'), 2)),
])
def test_what_fits_no_frame_is_not_written(items: Any) -> None:
    talk = online()
    assert talk.submits(write(*items, atomic=True), 10.06) == []
    (reasons,) = talk.outcomes()
    fits = 'two 16-bit parameters in adjacent registers fit, or one of 32 bits'
    assert reasons == [says('not_in_one_frame', fits=fits)] * len(items)


# -- failures -------------------------------------------------------------------------------------


@pytest.mark.parametrize('answer, number, text', [
    ('30000906', 0x06090030, '06090030h (value out of range)'),
    ('09063000', 0x06090030, '06090030h (value out of range)'),
    ('31000906', 0x06090031, '06090031h (value too high)'),
    ('32000906', 0x06090032, '06090032h (value too low)'),
    ('00000206', 0x06020000, '06020000h (no such register or object)'),
    ('00000106', 0x06010000, '06010000h (access not supported)'),
    ('02000106', 0x06010002, '06010002h (write to a read-only object)'),
    ('41000406', 0x06040041, '06040041h (object cannot be mapped to a PDO)'),
    ('21000008', 0x08000021, '08000021h (data cannot be stored because of local control)'),
    ('22000008', 0x08000022,
     '08000022h (data cannot be stored in the present state of the device)'),
    ('0B000000', 0x0000000B, '0000000Bh (no SDO abort code; as a PROFIBUS device would mean it: '
                             'word value too low)'),
    ('99999999', 0x99999999, '99999999h (unknown code)'),
])
def test_illegal_value_is_refused_with_code_and_text(answer: str, number: int, text: str) -> None:
    talk = online()
    assert asked(talk, write((FLC, 0xFFFF))) == '505#8C02002AFFFF0000'
    assert talk.hears(f'485#8C02004E{answer}', 10.061) == []
    assert talk.outcomes() == [[says('refused_by_drive', number=number, text=text)]]
    assert talk.session.warning == ''


def test_refused_pair_is_read_one_by_one() -> None:
    talk = online()
    assert asked(talk, read(FLC, FLC_2)) == '505#8C02002600000000'
    assert talk.hears('485#8C02004E00000206', 10.061) == ['505#8C0200A500000000']
    assert talk.hears('485#8C0200A507000000', 10.062) == ['505#8D02002500000000']
    talk.hears('485#8D02004E00000206', 10.063)
    assert talk.outcomes() == [[7, says('refused_by_drive', number=0x06020000)]]


def test_read_that_nobody_answers_fails() -> None:
    talk = online(parameter_timeout=0.1, period=5.0)
    assert asked(talk, read(FLC, LEVEL)) == '505#D101002500000000'
    frames = talk.until(11.5)
    assert [text[:12] for _, text in frames if text != IDLE] == [
        '505#D10100A5', '505#D1010025', '505#8C0200A5', '505#8C020025', '505#8C0200A5']
    assert talk.outcomes() == [[says('no_answer', timeout=0.1, attempts=3)] * 2]


def test_lost_answer_of_a_write_is_never_repeated() -> None:
    talk = online(parameter_timeout=0.1, period=5.0)
    assert asked(talk, write((FLC, 90), (CLASS, 10))) == '505#8C02002A5A000000'
    assert talk.until(10.17) == [(10.16, IDLE)]
    assert talk.hears(IDLE_ANSWER, 10.161) == ['505#5E0200AA0A000000'], 'the next one'
    talk.hears('485#5E0200AA00000000', 10.162)
    assert talk.outcomes() == [[says('no_answer', timeout=0.1, attempts=1), 'written']]


@pytest.mark.parametrize('late', ['485#8C02002A00000000', '485#8C02004E30000906'])
def test_late_answer_to_a_write_is_no_sign_of_a_second_station(late: str) -> None:
    talk = online(parameter_timeout=0.2, period=5.0)
    assert asked(talk, write((FLC, 44))) == '505#8C02002A2C000000'
    assert talk.until(10.3) == []
    assert talk.hears(late, 10.36) == []
    assert (talk.session.statistics.late, talk.session.statistics.rejected) == (1, 0)
    late_by, = talk.events(AnswerLate)
    assert late_by == AnswerLate(pytest.approx(0.1))
    talk.hears(late, 10.37)     # and one too many
    assert (talk.session.statistics.late, talk.session.statistics.rejected) == (1, 1)


@pytest.mark.parametrize('foreign', [
    '485#8D02002A00000000', '485#8C02002500000000', '485#8D02004E30000906',
])
def test_what_answers_nothing_that_was_asked_is_rejected(foreign: str) -> None:
    talk = online(parameter_timeout=0.2, period=5.0)
    assert asked(talk, write((FLC, 44))) == '505#8C02002A2C000000'
    assert talk.until(10.3) == []
    talk.hears(foreign, 10.36)
    assert (talk.session.statistics.late, talk.session.statistics.rejected) == (0, 1)


def test_write_that_has_to_make_room_is_never_repeated() -> None:
    talk = running(parameter_timeout=0.2)
    assert talk.submits(write((FLC, 44)), 10.095) == ['505#8C02002A2C000000']
    assert talk.asks(ControlAction.QUICK_STOP, 10.1) == []
    sent = talk.served(11.0, lambda text: None if text[:9] == '505#8C020' else echo(text, '4100'))
    assert sent[0] == (10.15, DISABLE_1)
    assert [text for _, text in sent if text[:9] == '505#8C020'] == []
    assert talk.outcomes() == [[says('no_answer', timeout=0.2, attempts=1)]]


def test_write_waits_until_the_function_byte_is_known() -> None:
    talk = online(parameter_timeout=0.1, period=5.0, parameter_retries=1)
    asked(talk, write((FLC, 90)))
    talk.until(10.165)
    talk.submits(write((FLC, 91)), 10.17)
    frames = talk.until(11.0)
    assert {text for _, text in frames} == {IDLE}
    assert talk.outcomes() == [
        [says('no_answer', timeout=0.1, attempts=attempts)] for attempts in (1, 2)]


# -- restart --------------------------------------------------------------------------------------


def test_restart_in_the_middle_of_a_write() -> None:
    talk = online()
    assert asked(talk, write((FLC, 90))) == '505#8C02002A5A000000'
    talk.submits(read(CLASS), 10.061)
    assert talk.hears(BOOT_UP, 10.062) == [], 'started a moment ago'
    assert talk.outcomes() == [
        [says('no_answer_because', reason=says('device_restarted'))]] * 2
    # the answer, should it still come, is nobody's
    assert talk.hears('485#8C02002A00000000', 10.063) == []
    assert talk.session.statistics.rejected == 1
    assert talk.until(10.151) == [(10.1, START), (10.15, IDLE)]
    assert talk.hears(IDLE_ANSWER, 10.152) == [READ_1]
    talk.hears(ANSWER_1, 10.153)
    assert talk.session.online
    assert talk.submits(write((FLC, 90)), 10.16) == ['505#8C02002A5A000000']


def test_node_that_is_known_to_be_stopped_gets_no_requests() -> None:
    talk = online()
    assert asked(talk, read(FLC)) == '505#8C02002500000000'
    assert talk.hears(PRE_OPERATIONAL, 10.061) == [], 'started a moment ago'
    stopped = says('drive_offline_because', reason=says('node_state', state='pre-operational'))
    assert talk.outcomes() == [[stopped]]
    assert talk.submits(read(FLC, CLASS), 10.07) == []
    assert talk.outcomes() == [[stopped] * 2]


# -- whose turn it is -----------------------------------------------------------------------------


def test_request_waits_for_one_exchange_and_so_does_the_round() -> None:
    talk, sent = reading(response=(STATUS, LEVEL, FLC))
    assert sent == ['505#C70100A500000000']
    assert talk.submits(read(CLASS, CURRENT), 10.0515) == []
    assert talk.hears('485#C70100A541000000', 10.052) == ['505#F401002600000000']
    assert talk.hears('485#F401002600000000', 10.053) == ['505#D10100A500000000']
    assert talk.hears('485#D10100A500000000', 10.054) == ['505#5E02002500000000']
    assert talk.hears('485#5E02002500000000', 10.055) == ['505#8C0200A500000000']
    talk.hears('485#8C0200A500000000', 10.056)
    assert talk.session.online
    assert talk.outcomes() == [[0, 0]]


def test_silent_parameter_delays_the_round_by_its_time_out_only() -> None:
    talk = online(parameter_timeout=0.1)
    assert asked(talk, read(FLC)) == '505#8C02002500000000'
    assert talk.until(10.159) == []
    assert talk.until(10.161) == [(10.16, IDLE)]
    assert talk.hears(IDLE_ANSWER, 10.161) == [READ_1], 'the round goes first'
    assert talk.hears(ANSWER_1, 10.162) == ['505#8C02002500000000']
    assert talk.session.statistics.missed == 0


# -- what users may not do ------------------------------------------------------------------------


def test_raw_names_of_listed_parameters_obey_their_rules() -> None:
    assert not raw('p455').writable
    assert not raw('x2004.6').writable
    assert not raw('x2004.06').writable
    assert raw('p730').readable is False
    directory = ParameterDirectory(
        configuration().profile.parameters,
        lambda text: FAMILY.raw_parameter(configuration(), text))
    for name in ('p652', 'x2007.3'):
        parameter = directory.find(name)
        assert parameter is not None
        assert directory.raw_from_user(parameter, 90) == 90
        with pytest.raises(ValueError, match='out of range: 5 to 100 %'):
            directory.raw_from_user(parameter, 101)


def test_register_and_object_are_one_even_if_the_profile_gives_one_of_them() -> None:
    bare = [replace(entry, index=None, subindex=None) for entry in TABLE]
    assert not raw('x2004.6', table=bare).writable
    talk = online(table=bare, response=bare[:2], request=(bare[10],))
    assert SPEED.name == bare[10].name
    assert talk.session.services.write_refusal(raw('x2008.0B', table=bare)) == says(
        'sent_cyclically', name='speed')


@pytest.mark.parametrize('name, refusal', [
    ('p720', 'one half of position: set that'), ('p721', 'one half of position: set that'),
    ('x2008.16', 'one half of position: set that'), ('p722', ''), ('p9999', ''),
    ('p704', ''), ('x3000.1', ''),
    ('p500', 'read-only: one half of average_current'),
    ('p501', 'read-only: one half of average_current'),
])
def test_write_refusals(name: str, refusal: str) -> None:
    talk = online(request=(SPEED,))
    assert talk.session.services.write_refusal(raw(name)) == refusal


def test_time_out_can_change_while_running() -> None:
    talk = online(period=5.0, parameter_retries=0)
    talk.session.reconfigure(parameter_timeout=0.05)
    asked(talk, read(FLC))
    talk.until(10.2)
    assert talk.outcomes() == [[says('no_answer', timeout=0.05, attempts=1)]]
