# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Conversations about parameter requests: acyclic frames, their pace, and what became of them."""

from builders import (
    BOOL, DAMPING, drive, FLAG, GAIN, KEY, MAXIMUM, ORDER, parameter, RAM, RAMP, read, SPEED,
    write,
)
from conversation import Conversation
from extended_builders import ANSWER, NEUTRAL, online, TICK, ZEROS
import pytest
from saying import says


ASK_GAIN = f'00200281#{ZEROS}'
ASK_DAMPING = f'00200291#{ZEROS}'
ASK_BOTH = f'00200282#{ZEROS}'
ASK_RAMP = f'002001E1#{ZEROS}'


def quiet(**options: object) -> Conversation:
    """Return a conversation with an online drive that is cycled once in ten seconds."""
    options.setdefault('mapping', 'assume')
    return online(period=10.0, **options)


# -- reading --------------------------------------------------------------------------------------


def test_consecutive_numbers_share_frames() -> None:
    many = [parameter(f'r{number}', number) for number in (43, 300, 40, 42, 44, 41, 40)]
    talk = quiet()
    assert talk.submits(read(*many), 10.1) == [f'00200284#{ZEROS}']
    assert talk.hears('10200284#00280029002A002B', 10.101) == [f'002002C1#{ZEROS}']
    assert talk.hears('102002C1#002C000000000000', 10.102) == [f'002012C1#{ZEROS}']
    talk.hears('102012C1#012C000000000000', 10.103)
    assert talk.outcomes() == [[43, 300, 40, 42, 44, 41, 40]]


def test_shared_frame_falls_apart_when_nobody_answers() -> None:
    talk = quiet()
    assert talk.submits(read(GAIN, DAMPING), 10.1) == [ASK_BOTH]
    assert talk.until(10.4 + TICK) == [(10.2, ASK_BOTH), (10.3, ASK_BOTH), (10.4, ASK_GAIN)]
    assert talk.hears('10200281#0007000000000000', 10.41) == [ASK_DAMPING]
    assert talk.until(10.8) == [(10.51, ASK_DAMPING), (10.61, ASK_DAMPING)]
    assert talk.outcomes() == [[7, says('no_answer', attempts=3, timeout=0.1)]]
    assert talk.session.statistics.requests_ok == 1
    assert talk.session.statistics.requests_failed == 1


@pytest.mark.parametrize('retries, timeout, text', [
    (2, 0.1, 'no answer in 0.1 s, 3 attempts'), (0, 0.25, 'no answer in 0.25 s, 1 attempt'),
    (1, 1.0, 'no answer in 1 s, 2 attempts'),
])
def test_time_out(retries: int, timeout: float, text: str) -> None:
    talk = quiet(parameter_retries=retries)
    talk.session.reconfigure(parameter_timeout=timeout)
    talk.submits(read(GAIN), 10.1)
    end = 10.1 + (retries + 1) * timeout
    sent = talk.until(end - TICK)
    assert len(sent) == retries
    assert talk.outcomes() == []
    talk.until(end + TICK)
    assert talk.outcomes() == [[text]]


def test_offline_drive_that_answers_anyway() -> None:
    talk = Conversation(drive(parameter_retries=0, mapping='assume', period=10.0)).begun()
    talk.at(10.0)
    talk.submits(read(GAIN, RAMP), 16.0)
    assert talk.hears('102001E1#0005000000000000', 16.001) == [ASK_GAIN]
    talk.until(16.2)
    assert talk.outcomes() == [[says('no_answer_offline'), 5]]


# -- writing --------------------------------------------------------------------------------------


def test_read_back_of_something_else() -> None:
    talk = quiet()
    talk.submits(write((GAIN, 7), (SPEED, -150)), 10.1)
    talk.until(10.11)
    assert talk.hears('10200281#0006000000000000', 10.12) == ['00300321#FF6A000000000000']
    talk.until(10.13)
    talk.hears('10200321#FF6B000000000000', 10.14)
    assert talk.outcomes() == [
        [says('read_back_differs', found='6', wanted='7'),
         says('read_back_differs', found='-14.9', wanted='-15')]]


def test_bool_is_read_back_as_a_bool() -> None:
    assert FLAG.type is BOOL
    for word, outcome in (('0001', 'written'), ('FFFF', 'written'),
                          ('0000', 'read back false instead of true')):
        talk = quiet()
        assert talk.submits(write((FLAG, 1)), 10.1) == ['003002A1#0001000000000000']
        talk.until(10.11)
        talk.hears(f'102002A1#{word}000000000000', 10.12)
        assert talk.outcomes() == [[outcome]]


def test_write_that_is_not_read_back() -> None:
    talk = quiet()
    talk.submits(write((GAIN, 7)), 10.1)
    assert [text for _, text in talk.until(10.5)] == [ASK_GAIN] * 3      # written once
    assert talk.outcomes() == [[says('no_answer', attempts=3, timeout=0.1)]]


def test_writes_without_verification() -> None:
    talk = quiet(verify_writes=False)
    note = 'sent; this protocol does not acknowledge writes'
    assert talk.submits(write((GAIN, 7), (DAMPING, 8)), 10.1) == ['00300281#0007000000000000']
    assert talk.until(10.11) == [(10.101, '00300291#0008000000000000')]
    assert talk.outcomes() == [[note, note]]
    # an EEPROM cell is looked at all the same
    assert talk.submits(write((RAMP, 5)), 10.2) == [ASK_RAMP]
    assert talk.hears('102001E1#0004000000000000', 10.201) == ['003001E1#0005000000000000']
    assert talk.outcomes() == [[note]]
    assert len(talk.submits(write((GAIN, 7), (DAMPING, 8), atomic=True), 10.3)) == 1
    assert talk.outcomes() == [[note, note]]


def test_write_only_parameters_are_never_read() -> None:
    talk = quiet()
    note = 'sent; this protocol does not acknowledge writes'
    assert talk.submits(write((ORDER, 1)), 10.1) == ['003002B1#0001000000000000']
    assert talk.submits(write((KEY, 1)), 10.2) == ['003002C1#0001000000000000']
    # nor what is written together with one
    assert len(talk.submits(write((FLAG, 1), (ORDER, 2), atomic=True), 10.3)) == 1
    assert talk.until(10.5) == []
    assert talk.outcomes() == [[note], [note], [note, note]]


def test_parameter_65535_is_refused() -> None:
    talk = quiet()
    last = parameter('p65535', 65535, listed=False)
    assert talk.submits(write((last, 1), (GAIN, 7)), 10.1) == ['00300281#0007000000000000']
    talk.until(10.11)
    talk.hears('10200281#0007000000000000', 10.12)
    assert talk.outcomes() == [[
        says('never_written', number=65535), 'written']]
    assert talk.submits(read(last), 10.2) == [f'002FFFF1#{ZEROS}']
    talk.hears('102FFFF1#0009000000000000', 10.201)
    assert talk.outcomes() == [[9]]


# -- EEPROM ---------------------------------------------------------------------------------------


def test_equal_value_is_not_written_to_eeprom() -> None:
    talk = quiet()
    assert talk.submits(write((RAMP, 5)), 10.1) == [ASK_RAMP]
    assert talk.hears('102001E1#0005000000000000', 10.101) == []
    assert talk.outcomes() == [['written']]


def test_eeprom_that_does_not_answer_is_not_written() -> None:
    talk = quiet()
    talk.submits(write((RAMP, 5)), 10.1)
    assert [text for _, text in talk.until(10.5)] == [ASK_RAMP, ASK_RAMP]
    assert talk.outcomes() == [[says('no_answer', attempts=3, timeout=0.1)]]


@pytest.mark.parametrize('gap', [0.02, 0.05])
def test_eeprom_writes_are_paced_and_reads_wait(gap: float) -> None:
    talk = quiet(eeprom_write_gap=gap)
    assert talk.submits(write((RAMP, 5), (MAXIMUM, 6)), 10.1) == [ASK_RAMP]
    assert talk.hears('102001E1#0004000000000000', 10.11) == ['003001E1#0005000000000000']
    assert talk.submits(read(GAIN), 10.111) == []
    assert talk.until(10.11 + gap - TICK) == []
    assert [text for _, text in talk.until(10.11 + gap + TICK)] == [ASK_RAMP]
    now = 10.11 + gap + 0.001
    assert talk.hears('102001E1#0005000000000000', now) == [f'002001F1#{ZEROS}']
    assert talk.hears('102001F1#0005000000000000', now) == ['003001F1#0006000000000000']
    assert talk.until(now + gap - TICK) == []
    assert [text for _, text in talk.until(now + gap + TICK)] == [f'002001F1#{ZEROS}']
    assert talk.hears('102001F1#0006000000000000', now + gap + 0.001) == [ASK_GAIN]
    assert talk.outcomes() == [['written', 'written']]


def test_a_user_who_writes_to_ram_waits_for_the_eeprom_too() -> None:
    """The manual: 20 ms between a write to the EEPROM and the next, wherever that goes."""
    talk = quiet(verify_writes=False)
    talk.submits(write((RAMP, 5), (GAIN, 7)), 10.1)
    assert talk.hears('102001E1#0004000000000000', 10.11) == ['003001E1#0005000000000000']
    assert talk.until(10.14) == [(10.13, '00300281#0007000000000000')]


def test_what_the_profile_does_not_say_is_eeprom() -> None:
    talk = quiet()
    raw = parameter('p600', 600, listed=False)
    assert talk.submits(write((raw, 5)), 10.1) == [f'00202581#{ZEROS}']
    assert talk.hears('10202581#0004000000000000', 10.11) == ['00302581#0005000000000000']
    assert talk.until(10.13 - TICK) == []
    assert talk.until(10.13 + TICK) == [(10.13, f'00202581#{ZEROS}')]


# -- together -------------------------------------------------------------------------------------


def test_together_in_one_frame() -> None:
    talk = quiet()
    assert talk.submits(write((DAMPING, 8), (GAIN, 7), atomic=True), 10.1) == [
        '00300282#0007000800000000']
    assert talk.until(10.11) == [(10.101, ASK_BOTH)]
    talk.hears('10200282#0007000900000000', 10.12)
    assert talk.outcomes() == [[says('read_back_differs', found='9', wanted='8'), 'written']]


@pytest.mark.parametrize('items', [
    ((GAIN, 1), (FLAG, 1)),                                                 # a gap
    ((GAIN, 1), (GAIN, 2)),
    ((RAMP, 1), (MAXIMUM, 1)),                                              # EEPROM
    ((ORDER, 1), (KEY, 1)),                                                 # nobody knows
    tuple((parameter(f'r{number}', number, storage=RAM), 1) for number in range(300, 305)),
])
def test_what_does_not_fit_one_frame_is_not_written(items: tuple[tuple[object, int], ...]) -> None:
    talk = quiet()
    assert talk.submits(write(*items, atomic=True), 10.1) == []
    (outcome, *rest), = talk.outcomes()
    assert rest == [outcome] * (len(items) - 1)
    assert outcome == says('not_in_one_frame')
    assert talk.until(10.5) == []


def test_four_at_most() -> None:
    talk = quiet(verify_writes=False)
    items = [(parameter(f'r{number}', number, storage=RAM), number) for number in range(300, 304)]
    assert talk.submits(write(*items, atomic=True), 10.1) == ['003012C4#012C012D012E012F']


def test_one_alone_is_written_like_any_other() -> None:
    talk = quiet()
    assert talk.submits(write((RAMP, 5), atomic=True), 10.1) == [ASK_RAMP]
    talk.hears('102001E1#0005000000000000', 10.101)
    assert talk.outcomes() == [['written']]


# -- refusals -------------------------------------------------------------------------------------


def test_moved_maps_are_guarded_too() -> None:
    talk = Conversation(drive(request_map_base=300, response_map_base=310, parameter_offset=-1))
    talk.begins()
    refused = [number for number in range(100, 400) if talk.session.services.write_refusal(
        parameter(f'p{number}', number, listed=False))]
    assert refused == [300, 301, 302, 303, 310, 311, 312, 313]


# -- beside the cycle -----------------------------------------------------------------------------


def test_acyclic_frames_wait_for_the_cyclic_response() -> None:
    talk = online(mapping='assume')
    assert talk.at(10.02) == [NEUTRAL]
    assert talk.submits(read(GAIN), 10.021) == []
    assert talk.hears(ANSWER, 10.023) == [ASK_GAIN]


@pytest.mark.parametrize('period, wait', [(0.02, 0.01), (10.0, 0.25)])
def test_or_for_half_a_period_and_no_longer_than_for_an_answer(
        period: float, wait: float) -> None:
    talk = online(mapping='assume', period=period, parameter_timeout=0.25)
    begin = 10.0 + period
    assert talk.until(begin + TICK) == [(begin, NEUTRAL)]
    talk.submits(read(GAIN), begin + 0.001)
    assert talk.until(begin + wait - TICK) == []
    assert talk.until(begin + wait + TICK) == [(begin + wait, ASK_GAIN)]
