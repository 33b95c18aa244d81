# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Conversations about the maps: nothing is cycled to a drive that would misunderstand it."""

import math

from builders import ACTUAL, drive, frame, GAIN, RAMP, read, SPEED, write
from conversation import Conversation
from extended_builders import (
    ANSWER, ASK_REQUEST_MAP, ASK_RESPONSE_MAP, checked, exchange, NEUTRAL, online, REQUEST_MAP,
    RESPONSE_MAP, ZEROS,
)
import pytest
from saying import says

from drive_can_bridge.core.events import (
    DriveState, MappingDiffered, MappingWritten, Noted, StationFound, StationLost)

OTHER_REQUEST_MAP = '102007A4#0033003200000000'
#: what a drive answers that has the right maps
WELL = {NEUTRAL: ANSWER, ASK_REQUEST_MAP: REQUEST_MAP, ASK_RESPONSE_MAP: RESPONSE_MAP}


def asked(**options: object) -> Conversation:
    """Return a conversation that asked for the request map at 10 s."""
    talk = Conversation(drive(**options))
    assert talk.begins() == [ASK_REQUEST_MAP]
    return talk


# -- verify ---------------------------------------------------------------------------------------


def test_looks_that_nobody_answers_are_told_while_cycling() -> None:
    talk = online()
    sent = talk.served(13.2, {NEUTRAL: ANSWER}.get)
    assert talk.session.warning == ''
    sent += talk.served(14.0, {NEUTRAL: ANSWER}.get)
    assert [text for _, text in sent].count(ASK_REQUEST_MAP) == 3
    text = ('no answer to 3 mapping reads in a row, although cyclic requests are answered: nobody '
            'knows whether the maps are still right')
    assert talk.session.warning == text
    assert talk.events(Noted) == [Noted(text, warning=True)]
    assert talk.session.online, 'it drives on: it answers'
    talk.served(15.0, WELL.get)
    assert talk.session.warning == ''
    assert talk.events(Noted) == []


def test_longer_response_map_is_accepted() -> None:
    talk = asked(response=(ACTUAL,))
    talk.hears(REQUEST_MAP, 10.001)
    talk.hears(RESPONSE_MAP, 10.002)
    assert talk.at(10.002) == [NEUTRAL]
    talk.hears(ANSWER, 10.004)
    assert talk.samples() == [(1000,)]


@pytest.mark.parametrize('request_map, response_map, text', [
    ('102007A4#0032003300340000', RESPONSE_MAP,
     'request map is 50, 51, 52, configured 50, 51'),
    ('102007A4#0033003200000000', RESPONSE_MAP, 'request map is 51, 50, configured 50, 51'),
    ('102007A4#0032000000330000', RESPONSE_MAP, 'request map is 50, configured 50, 51'),
    ('102007A4#0000003200330000', RESPONSE_MAP, 'request map is empty, configured 50, 51'),
    (REQUEST_MAP, '102007E4#00D100D200000000',
     'response map is 209, 210, configured 209, 210, 211'),
    ('102007A4#0000000000000000', '102007E4#0000000000000000',
     'request map is empty, configured 50, 51; '
     'response map is empty, configured 209, 210, 211'),
])
def test_maps_differ(request_map: str, response_map: str, text: str) -> None:
    talk = asked()
    talk.hears(request_map, 10.001)
    assert talk.hears(response_map, 10.002) == []

    assert talk.events() == [MappingDiffered(text)]
    assert talk.session.state is DriveState.MAPPING_DIFFERS
    assert talk.session.offline_advice == f'mapping differs: {text}'
    assert talk.session.remedy('') == says('maps_to_correct')
    assert talk.until(11.001) == []


def test_a_drive_whose_maps_differ_and_which_falls_silent_is_offline() -> None:
    talk = asked()
    talk.hears(OTHER_REQUEST_MAP, 10.001)
    talk.hears(RESPONSE_MAP, 10.002)
    assert talk.session.state is DriveState.MAPPING_DIFFERS
    told, = talk.events(MappingDiffered)
    talk.until(11.3)    # one look may be lost
    assert talk.session.state is DriveState.MAPPING_DIFFERS
    assert talk.session.offline_advice == says('maps_unread')
    now = talk.until(14.0)[-1][0]
    assert talk.session.state is DriveState.OFFLINE
    talk.hears(OTHER_REQUEST_MAP, now + 0.001)
    talk.hears(RESPONSE_MAP, now + 0.002)
    assert talk.session.state is DriveState.MAPPING_DIFFERS
    assert talk.events(MappingDiffered) == [told]
    assert talk.session.offline_advice == f'mapping differs: {told.text}'


def test_a_difference_that_comes_back_is_told_again() -> None:
    talk = online()
    for _ in range(2):
        now = talk.served(talk.now + 1.5, {**WELL, ASK_REQUEST_MAP: OTHER_REQUEST_MAP}.get)[-1][0]
        assert talk.events(MappingDiffered) == [
            MappingDiffered('request map is 51, 50, configured 50, 51')]
        talk.served(now + 1.5, WELL.get)
        assert talk.session.online


def test_parameter_services_work_while_maps_differ() -> None:
    talk = asked()
    talk.hears(OTHER_REQUEST_MAP, 10.001)
    talk.hears(RESPONSE_MAP, 10.002)
    assert talk.submits(read(GAIN), 10.1) == [f'00200281#{ZEROS}']
    talk.hears('10200281#0007000000000000', 10.101)
    assert talk.outcomes() == [[7]]
    # nobody answers: the drive is there, so it is not called offline
    talk.submits(read(GAIN), 10.2)
    talk.until(10.6)
    assert talk.outcomes() == [[says('no_answer', attempts=3, timeout=0.1)]]


def test_silent_drive_is_looked_for_again_and_again() -> None:
    talk = asked()
    assert talk.session.offline_advice == says('looked_for')
    assert talk.until(10.35) == [(10.1, ASK_REQUEST_MAP), (10.2, ASK_REQUEST_MAP),
                                 (10.3, ASK_REQUEST_MAP)]
    assert talk.session.offline_advice == says('maps_unread')
    assert talk.hears(REQUEST_MAP, 10.36) == [ASK_RESPONSE_MAP]
    # the second answer never comes: from the start
    assert talk.until(10.46) == [(10.46, ASK_REQUEST_MAP)]
    assert talk.events() == []


def test_maps_are_looked_at_every_second_while_cycling() -> None:
    talk = online()
    sent = talk.served(13.0, WELL.get)
    # each a second after the last one ended; the first had to wait for the answer of its cycle
    assert [now for now, text in sent if text == ASK_REQUEST_MAP] == [11.002, 12.006]
    assert {text for _, text in sent} == {*WELL}
    assert talk.session.online


def test_lost_map_while_cycling() -> None:
    talk = online()
    assert talk.commands(0, 0.0, 10.003)
    for cycle in range(1, 50):
        exchange(talk, 10.0 + 0.02 * cycle)
    talk.events()

    # the look that is due at 11.0 s waits for the answer to the cycle at 11.0 s
    assert talk.until(11.0) == [(11.0, NEUTRAL)]
    assert talk.hears(ANSWER, 11.002) == [ASK_REQUEST_MAP]
    # that is enough: not one more setpoint goes to a parameter that it is not for
    assert talk.hears('102007A4#0000000000000000', 11.003) == []

    text = 'request map is empty, configured 50, 51'
    assert talk.events(StationLost, MappingDiffered) == [
        StationLost(f'mapping differs: {text}'), MappingDiffered(text)]
    assert not talk.session.online
    assert talk.until(12.002) == []
    assert talk.until(12.003) == [(12.003, ASK_REQUEST_MAP)]
    checked(talk, 12.003)
    assert talk.at(12.005) == [NEUTRAL]
    talk.hears(ANSWER, 12.008)
    assert talk.events(StationFound) == [StationFound()]
    assert talk.session.state is DriveState.NOT_ARMED  # it wants arming again


def test_difference_is_believed_although_the_rest_is_not_answered() -> None:
    talk = asked()
    assert talk.hears(OTHER_REQUEST_MAP, 10.001) == [ASK_RESPONSE_MAP]
    assert talk.until(10.5) == []
    assert talk.session.state is DriveState.MAPPING_DIFFERS


# -- other numbers --------------------------------------------------------------------------------


def test_bases_and_offset() -> None:
    talk = Conversation(drive(request_map_base=300, response_map_base=500, parameter_offset=-1,
                              request=(SPEED,), response=(ACTUAL,)))
    assert talk.begins() == [f'002012B4#{ZEROS}']                     # 299
    assert talk.hears('102012B4#0031000000000000', 10.001) == [f'00201F34#{ZEROS}']   # 49; 499
    talk.hears('10201F34#00D0000000000000', 10.002)                         # 208
    assert talk.at(10.002) == [NEUTRAL]


def test_offset_moves_parameters() -> None:
    talk = online(parameter_offset=1000, mapping='assume')
    assert talk.submits(write((RAMP, 5)), 10.005) == [f'00204061#{ZEROS}']  # 1030
    assert talk.hears('10204061#0004000000000000', 10.006) == ['00304061#0005000000000000']


# -- assume ---------------------------------------------------------------------------------------


def test_assume_never_looks() -> None:
    talk = Conversation(drive(mapping='assume'))
    assert talk.begins() == []
    sent = talk.until(14.0)
    assert {text for _, text in sent} == {NEUTRAL}
    assert [now for now, _ in sent] == [round(10 + 0.02 * step, 6) for step in range(201)]
    assert talk.events() == []
    assert not talk.session.online
    talk.hears(ANSWER, 14.002)
    assert talk.session.online


# -- configure ------------------------------------------------------------------------------------


def number_of(text: str) -> int:
    return int(text[:8], 16) >> 4 & 0xFFFF


class MapKeeper:
    """A drive that has eight map registers and answers at once."""

    def __init__(self, *entries: int) -> None:
        self.registers = dict(zip(range(122, 130), entries))
        self.read_only: set[int] = set()
        self.silent_after = math.inf
        self.trace: list[str] = []

    def serve(self, talk: Conversation, sent: list[str], now: float) -> None:
        """Answer frames, and the frames that the answers cause."""
        for text in sent:
            number, count = number_of(text), int(text[7], 16)
            if text[2] == '3' and count:
                word = int(text[9:13], 16)
                self.trace.append(f'{now:.3f} {number}:={word}')
                if number not in self.read_only:
                    self.registers[number] = word
            elif count and self.silent_after > 0:
                self.silent_after -= 1
                if count == 1:
                    self.trace.append(f'{now:.3f} {number}?')
                words = ''.join(f'{self.registers[number + step]:04X}' for step in range(count))
                self.serve(talk, talk.hears(f'1{text[1:9]}{words:0<16}', now), now)

    def live(self, talk: Conversation, end: float) -> list[float]:
        """Serve until ``end``; return the times of cyclic frames, which get no answer."""
        cycles = []
        while talk.session.next_timer() <= end:
            now = talk.session.next_timer()
            sent = talk.at(now)
            cycles += [now for text in sent if text.startswith('003FFFF0')]
            self.serve(talk, sent, now)
        return cycles


def configured(keeper: MapKeeper) -> Conversation:
    talk = Conversation(drive(mapping='configure', response=(ACTUAL,)))
    keeper.serve(talk, talk.begins(), 10.0)
    return talk


def test_configure_in_the_safe_order() -> None:
    keeper = MapKeeper(99, 98, 97, 0, 209, 210, 0, 0)
    talk = configured(keeper)
    assert keeper.live(talk, 10.15) == [pytest.approx(time) for time in (10.1, 10.12, 10.14)]
    assert keeper.trace == [
        '10.000 122?', '10.000 122:=0', '10.020 122?',          # off first
        '10.020 123?', '10.020 123:=51', '10.040 123?',
        '10.040 124?', '10.040 124:=0', '10.060 124?',
        '10.060 125?', '10.060 126?',                             # right: not written
        '10.060 127?', '10.060 127:=0', '10.080 127?',
        '10.080 128?', '10.080 129?',
        '10.080 122?', '10.080 122:=50', '10.100 122?',         # on last
    ]
    for place, entry in enumerate(keeper.trace):
        if ':=' in entry:  # a read before, because of the wear, and one after, to believe it
            number = entry.split()[1].split(':')[0]
            assert keeper.trace[place - 1].endswith(f' {number}?')
            assert keeper.trace[place + 1].endswith(f' {number}?')
    assert keeper.registers == dict(zip(range(122, 130), (50, 51, 0, 0, 209, 0, 0, 0)))
    assert talk.events(MappingWritten, MappingDiffered) == [
        MappingWritten(says('maps_written', request=(50, 51), response=(209,)))]


def test_configure_leaves_right_maps_alone() -> None:
    keeper = MapKeeper(50, 51, 0, 0, 209, 0, 0, 0)
    talk = configured(keeper)
    assert keeper.trace == []
    assert talk.at(10.0) == [NEUTRAL]


def test_configure_without_setpoints_switches_the_request_map_off() -> None:
    keeper = MapKeeper(50, 51, 0, 0, 209, 0, 0, 0)
    talk = Conversation(drive(mapping='configure', request=(), response=(ACTUAL,)))
    keeper.serve(talk, talk.begins(), 10.0)
    keeper.live(talk, 10.2)
    assert [keeper.registers[number] for number in range(122, 130)] == [0, 0, 0, 0, 209, 0, 0, 0]


def test_failing_rewrite_backs_off_up_to_a_minute() -> None:
    keeper = MapKeeper(99, 51, 0, 0, 209, 0, 0, 0)
    keeper.read_only = {122}
    talk = configured(keeper)
    assert keeper.live(talk, 400.0) == []
    # 122 := 0 fails, and is read back
    why = says('maps_not_written', why=says(
        'write_read_back', what='map parameter 122', found=99, wanted=0))
    assert talk.events(MappingDiffered, MappingWritten) == [MappingDiffered(why)]
    assert talk.session.offline_advice == says('mapping_differs')
    assert talk.session.remedy('') == says('maps_not_kept')
    assert {entry.split()[1] for entry in keeper.trace if ':=' in entry} == {'122:=0'}
    times = [float(entry.split()[0]) for entry in keeper.trace if ':=' in entry]
    pauses = [round(b - a) for a, b in zip(times, times[1:])]
    assert pauses == [1, 2, 4, 8, 16, 32, 60, 60, 60, 60, 60]


@pytest.mark.parametrize('first, period, times, most', [(10.2, 1.0, 40, 6), (15.0, 5.0, 80, 14)])
def test_rewrites_that_somebody_undoes_become_rare(
        first: float, period: float, times: int, most: int) -> None:
    """Maps that are right for some seconds are no reason to wear the EEPROM out."""
    keeper = MapKeeper(99, 51, 0, 0, 209, 0, 0, 0)
    talk = configured(keeper)
    for number in range(times):
        keeper.live(talk, first + period * number)
        keeper.registers[122] = 99
    starts = [float(entry.split()[0]) for entry in keeper.trace if entry.endswith('122:=0')]
    assert len(starts) <= most
    if period > 1.0:
        assert min(after - before for before, after in zip(starts[-5:], starts[-4:])) >= 60.0
    assert talk.events(MappingDiffered)[0].text == says('maps_wait')
    assert talk.session.remedy('') == says('maps_not_kept')


class Undone(MapKeeper):
    """Somebody else has the maps as they were before, by the time that they are looked at."""

    def serve(self, talk: Conversation, sent: list[str], now: float) -> None:
        if ASK_REQUEST_MAP in sent:
            self.registers[122] = 99
        super().serve(talk, sent, now)


def test_each_rewrite_that_is_undone_at_once_is_told() -> None:
    """Also when the pause does not grow any more, so that the same is said of each."""
    keeper = Undone(99, 51, 0, 0, 209, 0, 0, 0)
    talk = configured(keeper)
    keeper.live(talk, 300.0)
    told = [type(event) for event in talk.events(MappingDiffered, MappingWritten)]
    assert told == [MappingWritten, MappingDiffered] * 10


def test_rewrites_after_a_quiet_minute_are_prompt_again() -> None:
    keeper = MapKeeper(99, 51, 0, 0, 209, 0, 0, 0)
    keeper.read_only = {122}
    talk = configured(keeper)
    keeper.live(talk, 100.0)           # by now the pause is a minute
    keeper.read_only.clear()
    keeper.registers[122] = 50         # somebody helped
    keeper.live(talk, 300.0)
    for _ in range(2):
        keeper.registers[122] = 99
        now = talk.session.next_timer()
        keeper.live(talk, now + 2.5)
        assert keeper.registers[122] == 50


@pytest.mark.parametrize('answers, slot', [
    (2, 99),    # both maps: what cannot be read is not written
    (3, 0)])    # and 122 before it is written: every request word is ignored, that is safe
def test_drive_that_falls_silent_in_a_rewrite(answers: int, slot: int) -> None:
    keeper = MapKeeper(99, 51, 0, 0, 209, 0, 0, 0)
    keeper.silent_after = answers
    talk = configured(keeper)
    assert keeper.live(talk, 10.5) == []
    assert keeper.registers[122] == slot
    assert talk.session.state is DriveState.MAPPING_DIFFERS
    assert talk.events(MappingDiffered) == [
        MappingDiffered(says('maps_not_written', why=says('no_answer_for_map', number=122)))]
    assert talk.session.remedy('') == says('drive_to_correct')


# -- what is not believed -------------------------------------------------------------------------


def test_look_that_began_before_time_was_lost_does_not_count() -> None:
    talk = asked()
    talk.hears(REQUEST_MAP, 10.001)
    assert talk.handle_stall(15.0) == []
    # the answer lay in a queue for five seconds; the drive may have been replaced meanwhile
    assert talk.hears(RESPONSE_MAP, 15.0) == [ASK_REQUEST_MAP]
    checked(talk, 15.0)
    assert talk.at(15.002) == [NEUTRAL]


def test_only_one_look_at_a_time() -> None:
    talk = asked()
    assert talk.bus_up(10.0005) == []
    assert talk.hears(REQUEST_MAP, 10.001) == [ASK_RESPONSE_MAP]
    assert talk.hears(RESPONSE_MAP, 10.002) == [ASK_REQUEST_MAP]


def test_map_from_before_the_question_is_not_believed() -> None:
    """It has waited in a buffer, for a process that stood still for all anybody knows."""
    talk = asked()
    assert talk.until(10.15) == [(10.1, ASK_REQUEST_MAP)]
    talk.session.receive_frame(frame(REQUEST_MAP), 10.15, age=0.06)
    assert talk.sent() == []
    talk.session.receive_frame(frame(REQUEST_MAP), 10.152, age=0.01)
    assert talk.sent() == [ASK_RESPONSE_MAP]
