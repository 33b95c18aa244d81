# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Whatever was told to run is told to stop, soon, and by frames that really left."""

from dataclasses import replace
import math

from builders import BOOL, parameter, RAM, read
from conversation import Conversation
from pkw_builders import (
    ANSWER_0, ANSWER_1, answered, BOOT_UP, CLASS, CONTROL, DISABLE_0, DISABLE_1, DISABLED_0,
    DISABLED_1, driven, echo, ENABLE_0, IDLE, IDLE_ANSWER, online, PRE_OPERATIONAL, READ_0, READ_1,
    ready, running, RUNS_0, RUNS_1, SPEED, SPEED_1, START, STILL_0, STILL_1, STOPPED, TABLE, WORD,
)
import pytest
from saying import may_run, says

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import DriveState, Noted
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import ControlTable
from drive_can_bridge.core.setpoints import CommandOutcome

READ_CLASS_0 = '505#5E02002500000000'
READ_CLASS_1 = '505#5E0200A500000000'
CLASS_0 = '485#5E02002507000000'
CLASS_1 = '485#5E0200A507000000'
WITH_QUICK_STOP = replace(CONTROL, quick_stop=0x0002)


def worries(talk: Conversation) -> list[str]:
    return [note.text for note in talk.events(Noted) if 'may still be running' in note.text]


# -- in every state -------------------------------------------------------------------------------


def test_the_end_of_a_drive_that_never_ran_and_does_not_answer_is_told() -> None:
    talk = online(control=CONTROL)
    assert talk.deactivate(10.06) == [DISABLE_1]
    assert talk.until(14.0) == [(10.56, DISABLE_0), (11.06, DISABLE_1)]
    assert talk.session.stopped
    assert [note.text for note in talk.events(Noted)] == [
        says(
            'stop_failed', what=[says('write_not_acknowledged', attempts=3,
            what='control_register_1 0000h')])]


def test_stall() -> None:
    talk = running()
    assert talk.handle_stall(15.0) == [START, DISABLE_0]
    assert talk.hears(DISABLED_0, 15.003) == []
    assert talk.until(15.0501) == [(15.05, READ_1)], 'the answer has synchronised the mailbox'
    assert worries(talk) == []


@pytest.mark.parametrize('way', ['the end', 'a defect', 'a stall', 'the bus'])
@pytest.mark.parametrize('control', [CONTROL, None], ids=['word', 'no word'])
def test_a_command_that_is_too_old_by_then_changes_no_stop(
        way: str, control: ControlTable | None) -> None:
    def sent(command_timeout: float) -> list[tuple[float, str]]:
        talk = commanded(command_timeout) if control is None else driven(
            command_timeout=command_timeout)
        session, found = talk.session, talk.until(10.114)
        if way == 'the end':
            found += [(10.115, text) for text in talk.deactivate(10.115)]
        elif way == 'a defect':
            session.fail(says('internal_error_in_callback', kind='', text=''), 10.115)
        elif way == 'a stall':
            found += [(10.115, text) for text in talk.handle_stall(10.115)]
        elif way == 'the bus':
            talk.bus_down(10.115)
            talk.bus_up(10.12)
        assert session.setpoints.expires_at == math.inf, 'nothing is to be looked at'
        return found + talk.until(16.0)
    assert sent(0.3) == sent(0.0) != []


def commanded(command_timeout: float) -> Conversation:
    """Return a drive without a control word that runs at 10 Hz."""
    talk = online(request=(SPEED,), control=None, command_timeout=command_timeout)
    answered(talk, talk.at(10.07), 10.071)
    assert talk.commands(0, 0.0, 10.095) is CommandOutcome.ARMED
    assert talk.commands(0, 10.0, 10.095) is CommandOutcome.ACCEPTED
    answered(talk, talk.at(10.09), 10.096)
    answered(talk, talk.at(10.11), 10.111)
    return talk


def test_signal_that_comes_before_anybody_noticed_the_stall() -> None:
    talk = running()
    assert talk.until(10.1101) == [(10.11, READ_0)]
    assert talk.deactivate(15.0) == [DISABLE_1], 'nobody waits for that answer any more'


def test_slow_device_after_the_bus_came_back() -> None:
    """It answers after 0.3 s: that is too late for the attempts in between, not for the last."""
    talk = running()
    talk.bus_down(10.2)
    sent = [(11.0, text) for text in talk.bus_up(11.0)]
    sent += talk.until(11.45)
    stops = [(now, text) for now, text in sent if text in (DISABLE_0, DISABLE_1)]
    assert len(stops) == 3
    talk.hears(DISABLED_1 if stops[-1][1] == DISABLE_1 else DISABLED_0, stops[-1][0] + 0.3)
    talk.until(12.5)
    assert worries(talk) == [may_run('bus_lost_before_stop')]


@pytest.mark.parametrize('heard', [PRE_OPERATIONAL, STOPPED])
@pytest.mark.parametrize('confirmed', [False, True])
def test_stop_while_the_heartbeat_holds_rounds_back(heard: str, confirmed: bool) -> None:
    """The network module says so; what the motor does is another matter."""
    talk = running()
    assert talk.hears(heard, 10.3) == [START, DISABLE_0]
    if confirmed:
        assert talk.hears(DISABLED_0, 10.302) == []
    now = 11.0 if confirmed else 10.32
    assert talk.until(now) == []
    assert talk.deactivate(now) == []
    if not confirmed:
        assert talk.until(10.371) == [(10.37, DISABLE_1)], '50 ms for the answer under way'
        assert talk.hears(DISABLED_1, 10.38) == []
    assert talk.session.stopped
    assert worries(talk) == []


# -- frames that the bus refuses ------------------------------------------------------------------


def refuse(talk: Conversation, part: str = '505#') -> None:
    talk.refusing = lambda text: part in text


def accept(talk: Conversation) -> None:
    talk.refusing = lambda text: False


def test_refused_stop_is_tried_until_the_bus_takes_it() -> None:
    talk = running()
    refuse(talk)
    assert talk.deactivate(10.1) == []
    assert talk.until(10.135) == []
    accept(talk)
    assert talk.until(10.2) == [(10.14, DISABLE_0)], 'every 10 ms'
    assert not talk.session.stopped
    assert talk.hears(DISABLED_0, 10.201) == ['505#C70100A500000000']
    assert talk.hears('485#C70100A5C3000000', 10.202) == []
    assert talk.session.stopped
    assert talk.session.control is not None
    assert talk.session.control.state == 'enabled', 'that is what it says, and nobody else'
    assert not talk.session.control.off
    assert worries(talk) == []


def test_bus_that_takes_no_stop_at_all() -> None:
    talk = running()
    refuse(talk)
    assert talk.deactivate(10.1) == []
    assert talk.until(11.59) == []
    assert not talk.session.stopped
    assert talk.until(11.7) == []
    assert talk.session.stopped, '0.5 s for each of three attempts'
    assert worries(talk) == [may_run('stop_failed', what=[
        says('write_not_taken', what='control_register_1 0000h')])]


def test_disable_that_the_bus_takes_at_last_has_time_for_its_answer() -> None:
    """Half of what it would have had; without, its time of 0.5 s would be over at 10.595 s."""
    talk = running()
    refuse(talk)
    assert talk.asks(ControlAction.DISABLE, 10.095) == []
    assert talk.until(10.584) == []
    accept(talk)
    assert talk.until(10.83) == [(10.585, DISABLE_0)]
    talk.hears(DISABLED_0, 10.834)
    assert talk.control_outcomes() == []        # the status is still to be read
    assert talk.session.statistics.rejected == 0
    assert not talk.session.duty.stop_pending


def test_enable_that_is_due_again_goes_behind_setpoints() -> None:
    talk = online(request=(SPEED,), control=CONTROL, refresh_interval=0.035)
    assert talk.until(10.0701) == [(10.07, READ_0)]
    assert talk.hears(ANSWER_0, 10.071) == []
    refuse(talk)
    assert talk.asks(ControlAction.ENABLE, 10.075) == []
    accept(talk)
    assert talk.until(10.0901) == [(10.09, STILL_1)]
    assert talk.hears('485#C60200AA00000000', 10.091) == [ENABLE_0]


def test_refused_neutral_at_a_command_time_out_is_written_although_nothing_refreshes() -> None:
    talk = online(request=(SPEED,), command_timeout=0.05, refresh_interval=0.0)
    talk.commands(0, 0.0, 10.06)
    talk.commands(0, 10.0, 10.06)
    assert talk.at(10.07) == [SPEED_1]
    assert talk.hears('485#C60200AA00000000', 10.071) == [READ_0]
    assert talk.hears(ANSWER_0, 10.072) == []
    refuse(talk, 'C602')
    assert talk.until(10.0901) == [(10.09, READ_1)]
    assert talk.hears(ANSWER_1, 10.091) == []
    assert talk.until(10.1101) == [(10.11, READ_0)]
    assert talk.hears(ANSWER_0, 10.1111) == [], 'the time-out was at 10.11'
    assert talk.until(10.135) == [], 'nothing else goes before it'
    accept(talk)
    (at, text), = talk.until(10.142)
    assert (round(at, 4), text) == (10.1411, STILL_1), 'it is tried every 10 ms'
    assert talk.hears('485#C60200AA00000000', 10.142) == [READ_0]
    assert worries(talk) == []


# -- soon -----------------------------------------------------------------------------------------


STOP_WORDS = pytest.mark.parametrize(('action', 'word'), [
    (ControlAction.DISABLE, '00'), (ControlAction.QUICK_STOP, '02')])


@STOP_WORDS
def test_control_stop_waits_for_the_answer_under_way_and_neutral_is_right_behind(
        action: ControlAction, word: str) -> None:
    talk = driven(control=WITH_QUICK_STOP)
    assert talk.session.state is DriveState.ONLINE
    assert talk.submits(read(CLASS), 10.114) == [READ_CLASS_0]
    assert talk.asks(action, 10.115) == []
    assert talk.hears(CLASS_0, 10.116) == [f'505#C00200AA{word}000000']
    assert talk.outcomes() == [[7]]
    assert talk.hears('485#C00200AA00000000', 10.117) == [STILL_0]
    assert talk.hears('485#C602002A00000000', 10.118) == []


@STOP_WORDS
def test_control_stop_waits_50_ms_at_most(action: ControlAction, word: str) -> None:
    """Function 00h does not go first: its answer might be waited for as well."""
    talk = running(control=WITH_QUICK_STOP)
    assert talk.submits(read(CLASS), 10.093) == [READ_CLASS_0]
    assert talk.asks(action, 10.095) == []
    assert talk.until(10.16) == [(10.145, f'505#C00200AA{word}000000')]
    # the round's turn, and then the read again that made room: it was not its fault
    assert talk.hears('485#C00200AA00000000', 10.161) == [READ_0]
    assert talk.hears(RUNS_0, 10.162) == [READ_CLASS_1]
    assert talk.hears(CLASS_1, 10.163) == []
    assert talk.outcomes() == [[7]]


def test_read_of_the_round_makes_room_too() -> None:
    talk = running()
    assert talk.until(10.1101) == [(10.11, READ_0)]
    assert talk.asks(ControlAction.DISABLE, 10.115) == []
    assert talk.until(10.17) == [(10.165, DISABLE_1)]
    assert talk.hears(DISABLED_1, 10.171) == [READ_0]
    assert talk.hears(ANSWER_0, 10.172) == []
    assert talk.control_outcomes() == [('disable', True, 'ready')]
    assert talk.session.statistics.missed == 0


@STOP_WORDS
def test_stop_word_whose_frame_got_lost_is_repeated_before_anything_else(
        action: ControlAction, word: str) -> None:
    """The adapter took it, the bus never had it. Once more does no harm."""
    talk = driven(control=WITH_QUICK_STOP)
    assert talk.asks(action, 10.115) == [f'505#C002002A{word}000000']
    assert talk.submits(read(CLASS), 10.12) == []
    assert talk.until(10.166) == [(10.165, f'505#C00200AA{word}000000')], 'no function 00h'
    assert talk.hears('485#C00200AA00000000', 10.167) == [STILL_0], 'and no read-back'
    assert talk.hears('485#C602002A00000000', 10.168) == [READ_CLASS_1]
    assert talk.session.duty.stop_pending is (word != '00')
    assert worries(talk) == []


@STOP_WORDS
def test_stop_word_that_is_never_answered_has_three_attempts_before_others_go_on(
        action: ControlAction, word: str) -> None:
    """The last of them has the time that any request has."""
    talk = driven(control=WITH_QUICK_STOP, refresh_interval=0.05)
    assert talk.asks(action, 10.115) == [f'505#C002002A{word}000000']
    assert talk.until(10.714) == [(10.165, f'505#C00200AA{word}000000'),
                                  (10.215, f'505#C002002A{word}000000')]
    assert talk.until(10.72) == [(10.715, IDLE)], 'setpoints still go out'
    assert talk.hears(IDLE_ANSWER, 10.721) == [STILL_1]
    assert talk.until(11.23) == [(11.221, IDLE)]
    assert talk.hears(IDLE_ANSWER, 11.231) == [READ_0], 'of the round that was due at 10.13'
    sent = talk.until(11.76)
    assert [text for _, text in sent] == [f'505#C00200AA{word}000000'], 'with the next round'
    assert talk.hears('485#C00200AA00000000', 11.765) == [STILL_0], 'which was due as well'


def test_word_that_changes_while_a_stop_is_repeated() -> None:
    """A quick stop gives up after 0.2 s: what is repeated is the newest word."""
    talk = driven(control=WITH_QUICK_STOP, control_timeout=0.07)
    assert talk.asks(ControlAction.QUICK_STOP, 10.115) == ['505#C002002A02000000']
    assert talk.until(10.164) == []
    assert talk.until(10.166) == [(10.165, '505#C00200AA02000000')]
    assert [text for _, text in talk.until(10.24)] == [DISABLE_0], 'no more quick stop'


def test_stop_does_not_wait_for_the_answer_to_an_enable() -> None:
    """Nor does it rely on the disable that the drive had before; and it has all its attempts."""
    talk = ready()
    assert talk.asks(ControlAction.ENABLE, 10.075) == [ENABLE_0]
    assert talk.asks(ControlAction.DISABLE, 10.08) == []
    assert talk.until(10.72) == [(10.13, DISABLE_1), (10.18, DISABLE_0), (10.23, DISABLE_1)]
    assert talk.hears(DISABLED_1, 10.721) == [READ_0], 'of the round that was due at 10.09'


def test_enable_that_the_bus_refused_leaves_the_drive_with_what_it_had() -> None:
    talk = ready()
    refuse(talk)
    assert talk.asks(ControlAction.ENABLE, 10.075) == []
    accept(talk)
    assert talk.asks(ControlAction.DISABLE, 10.08) == [DISABLE_0], 'whoever asks gets a frame'
    assert talk.hears(DISABLED_0, 10.081) == []
    assert talk.until(10.0901) == [(10.09, READ_1)]


def test_short_time_outs_make_short_attempts() -> None:
    talk = running(parameter_timeout=0.03)
    assert talk.asks(ControlAction.DISABLE, 10.095) == [DISABLE_0]
    assert talk.until(10.184) == [(10.125, DISABLE_1), (10.155, DISABLE_0)]


# -- nothing stale --------------------------------------------------------------------------------


def test_setpoint_that_waits_for_function_zero_is_forgotten_with_the_rest() -> None:
    """The mailbox was being synchronised for a setpoint when everything began anew."""
    talk = online(request=(SPEED,), command_timeout=0.0, parameter_timeout=0.05)
    assert talk.until(10.0701) == [(10.07, READ_1)]
    talk.commands(0, 0.0, 10.075)
    talk.commands(0, 10.0, 10.075)
    assert talk.until(10.1201) == [(10.12, IDLE)], 'before 710 = 100'
    assert talk.activate(10.125) == [START]
    assert talk.hears(IDLE_ANSWER, 10.13) == []
    assert talk.until(10.1751) == [(10.175, READ_0)]


# -- nothing starts by itself ---------------------------------------------------------------------


def test_restart_that_nobody_saw() -> None:
    """The boot-up frame and one answer got lost; the word is among the cyclic requests."""
    talk = running(request=(WORD,), refresh_interval=0.05, parameter_timeout=0.05)
    assert talk.until(10.1101) == [(10.11, READ_0)]
    assert talk.until(10.1601) == [(10.16, IDLE)], 'no answer; and the refresh is due'
    assert talk.hears(IDLE_ANSWER, 10.171) == [READ_1], 'the status first'
    assert talk.hears(ANSWER_1, 10.172) == [DISABLE_0], 'it is off: it stays off'
    assert talk.hears(DISABLED_0, 10.173) == []
    assert talk.session.state is DriveState.DISABLED
    sent = talk.served(10.6, lambda text: echo(text, '4100'), 0.001)
    assert not {text[4:8] + text[12:16] for _, text in sent} & {'C0020100'}


def test_restart_in_the_middle_of_a_refresh() -> None:
    """Nobody knows whether the word arrived: the status is read before even that is looked at."""
    talk = running(request=(WORD,), refresh_interval=0.05, parameter_timeout=0.01)
    assert talk.until(10.1101) == [(10.11, READ_0)]
    assert talk.hears(RUNS_0, 10.111) == []
    assert talk.until(10.1301) == [(10.13, READ_1)]
    assert talk.hears(RUNS_1, 10.131) == [ENABLE_0], 'the refresh: it was seen running'
    assert talk.until(10.1501) == [(10.15, IDLE)], 'no answer; the device has restarted'
    assert talk.hears(IDLE_ANSWER, 10.151) == [READ_1], 'no read-back that would find nothing'
    assert talk.hears(ANSWER_1, 10.152) == [DISABLE_0]


def test_refresh_goes_on_while_the_drive_is_seen_running() -> None:
    talk = running(request=(WORD,), refresh_interval=0.05)
    sent = talk.served(10.3, echo, 0.001)
    assert [(at, text[12:]) for at, text in sent if text[4:8] == 'C002'] == [
        (10.131, '01000000'), (10.191, '01000000'), (10.251, '01000000')]


# -- nothing jumps --------------------------------------------------------------------------------


@pytest.mark.parametrize(('what', 'value', 'arms'), [
    (WORD, 0, True), (WORD, 1, False),      # LTMR: 704 = 1 is "run forward"
    (parameter('lamp', 731, type=BOOL, storage=RAM), False, True),
    (parameter('lamp', 731, type=BOOL, storage=RAM), True, False),
    (SPEED, 0.1, True), (SPEED, 0.149, False), (SPEED, 0.04, True)])
def test_what_arms(what: Parameter, value: float, arms: bool) -> None:
    talk = online(request=(what,), table=(*TABLE, what), command_timeout=0.0)
    assert talk.commands(0, value, 10.06) is (
        CommandOutcome.ARMED if arms else CommandOutcome.NOT_ARMED)


# -- a node in a loop -----------------------------------------------------------------------------


@pytest.mark.parametrize('runs', [False, True])
def test_boot_up_frames_in_a_flood(runs: bool) -> None:
    talk = running() if runs else online()
    talk.events()
    sent = []
    for place in range(1000):
        now = 10.9 + 0.0001 * place
        sent += talk.until(now)
        sent += [(now, text) for text in talk.hears(BOOT_UP, now)]
    sent += talk.until(11.9)
    starts = [when for when, text in sent if text == START]
    assert starts[:2] == [10.9, pytest.approx(11.0)], 'put off, not left out'
    assert all(later - sooner > 0.0999 for sooner, later in zip(starts, starts[1:]))
    stops = [when for when, text in sent if text in (DISABLE_0, DISABLE_1)]
    assert len(stops) == (3 if runs else 0), 'three attempts, and not three for each frame'
    notes = [note.text for note in talk.events(Noted) if note.text.startswith('boot-up')]
    assert notes == [says('booted')] * 1000
    assert talk.session.facts()['nmt_state'] == 'pre-operational'
