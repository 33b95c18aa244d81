# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Control register 704: written on change, acknowledged, never repeated blindly."""

from dataclasses import replace

from pkw_builders import (
    ANSWER_0, ANSWER_1, answered, CONTROL, denied, DISABLE_0, DISABLE_1, DISABLED_0, DISABLED_1,
    driven, echo, ENABLE_0, ENABLE_1, ENABLED_1, IDLE, IDLE_ANSWER, online, READ_0, READ_1,
    reading, ready, running, RUNS_0, RUNS_1, SPEED, START, STILL_0, TABLE, TRIPPED_0, WORD,
)
import pytest
from saying import says, status_word
from timeline import Timeline

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import DriveState, Noted, StationLost
from drive_can_bridge.core.parameters import AccessMode
from drive_can_bridge.core.setpoints import CommandOutcome


def test_status_read_before_the_word_confirms_nothing() -> None:
    """The round was half way when the drive was enabled: its status is from before."""
    talk = ready()
    assert talk.until(10.0901) == [(10.09, READ_0)]
    assert talk.asks(ControlAction.ENABLE, 10.0902) == [], 'one exchange at a time'
    assert talk.hears(RUNS_0, 10.091) == [ENABLE_1]   # it runs already, whoever did that
    assert talk.hears(ENABLED_1, 10.092) == []
    assert talk.control_outcomes() == []
    talk.until(10.1101)
    assert talk.hears(RUNS_0, 10.112) == []
    assert talk.control_outcomes() == [('enable', True, 'enabled')]


def test_drive_that_reports_nothing_takes_commands_as_soon_as_enable_is_acknowledged() -> None:
    talk = online(control=replace(CONTROL, status_parameter=None, ready=None, enabled=None,
                                  fault=None), request=(SPEED,))
    answered(talk, talk.asks(ControlAction.ENABLE, 10.06), 10.061)
    assert talk.control_outcomes() == [
        ('enable', True, says('state_not_reported', action='enable'))]
    assert talk.commands(0, 0.0, talk.now) is CommandOutcome.ARMED


def test_reset_of_a_trip() -> None:
    talk = ready()
    talk.until(10.0901)
    talk.hears(TRIPPED_0, 10.091)
    assert talk.session.state is DriveState.FAULT
    assert talk.events(Noted) == [Noted(says(
        'fault_came', ran=False, status=status_word(0x0044)), warning=True)]
    assert talk.asks(ControlAction.RESET_FAULT, 10.095) == ['505#C00200AA08000000']
    assert talk.hears('485#C00200AA00000000', 10.096) == [DISABLE_0], 'one acknowledged write'
    assert talk.hears(DISABLED_0, 10.097) == []
    assert talk.control_outcomes() == []
    assert talk.until(10.1101) == [(10.11, READ_1)]
    assert talk.hears(ANSWER_1, 10.111) == []
    assert talk.control_outcomes() == [('reset_fault', True, 'ready')]


def test_trip_is_known_from_the_first_round_on() -> None:
    talk, _ = reading(control=CONTROL)
    assert talk.hears('485#C70100A644000000', 10.052) == [DISABLE_0]
    assert talk.session.state is DriveState.FAULT


def test_drive_that_refuses_its_status_is_not_driven_on() -> None:
    """455 and 456 share a read until it is refused; 456 alone is answered."""
    def answer(text: str) -> str:
        return denied(text, '00000206') if text.startswith('505#C701') else echo(text)
    talk = driven(command_timeout=0.0)
    sent = [text for _, text in talk.served(10.6, answer, 0.001)]
    together, alone, rest = '505#C701002600000000', '505#C70100A500000000', '505#C801002500000000'
    assert sent[:9] == [together, *3 * [alone, rest], DISABLE_1, STILL_0]
    assert says('enable_withdrawn', reason=says('status_missing', answers=3)) in [
        note.text for note in talk.events(Noted)]


def test_an_enable_that_fails_disables_before_an_old_command_is_taken_back() -> None:
    """A process that was late finds both at once, of a drive that has refused its status."""
    talk = driven(command_timeout=0.2, control_timeout=0.1, missed_limit=9)
    sent = talk.at(10.13)
    while sent:
        text, = sent
        sent = talk.hears(denied(text) if text.startswith('505#C701') else echo(text), 10.131)
    assert talk.asks(ControlAction.ENABLE, 10.14) == []
    assert talk.control_outcomes() == []
    assert talk.session.state is DriveState.ONLINE
    assert talk.at(10.32) in ([DISABLE_0], [DISABLE_1])
    assert [outcome[:2] for outcome in talk.control_outcomes()] == [('enable', False)]


# -- lost answers ---------------------------------------------------------------------------------


def test_lost_acknowledgement_of_enable_is_read_back_not_repeated() -> None:
    talk = ready(parameter_timeout=0.1)
    assert talk.asks(ControlAction.ENABLE, 10.075) == [ENABLE_0]
    assert talk.until(10.18) == [(10.175, IDLE)]
    assert talk.hears(IDLE_ANSWER, 10.18) == [READ_1]
    assert talk.hears(RUNS_1, 10.181) == ['505#C002002500000000'], 'what stands there?'
    assert talk.hears('485#C002002501000000', 10.182) == []
    assert talk.control_outcomes() == []
    talk.at(10.19)
    talk.hears(RUNS_1, 10.191)
    assert talk.control_outcomes() == [('enable', True, 'enabled')]


def test_lost_enable_is_written_again_when_it_is_not_there() -> None:
    talk = ready(parameter_timeout=0.1)
    assert talk.asks(ControlAction.ENABLE, 10.075) == [ENABLE_0]
    talk.until(10.18)
    talk.hears(IDLE_ANSWER, 10.18)
    assert talk.hears(ANSWER_1, 10.181) == ['505#C002002500000000']
    assert talk.hears('485#C002002500000000', 10.182) == [ENABLE_1]
    assert talk.hears(ENABLED_1, 10.183) == []
    talk.at(10.19)
    talk.hears(RUNS_0, 10.191)
    assert talk.control_outcomes() == [('enable', True, 'enabled')]


def test_word_that_cannot_be_read_back_is_never_repeated() -> None:
    secret = replace(WORD, access=AccessMode.WRITE_ONLY)
    talk = ready(parameter_timeout=0.1, table=[
        secret if entry is WORD else entry for entry in TABLE])
    assert talk.asks(ControlAction.ENABLE, 10.075) == [ENABLE_0]
    *sent, (withdrawn_at, last) = talk.served(12.0751, lambda text: echo(text, '4100'), 0.001)
    assert not {ENABLE_0, ENABLE_1} & {text for _, text in sent}
    assert (withdrawn_at, last) == (12.075, DISABLE_0), 'it is not known to be disabled any more'
    assert talk.control_outcomes() == [('enable', False, says('stuck', timeout=2.0))]


def test_unsent_word_waits_for_the_mailbox() -> None:
    """Function 00h is not answered: nobody knows whether a write would be executed."""
    talk = ready(parameter_timeout=0.1)
    talk.until(10.0901)
    assert [text for _, text in talk.until(10.1955)] == [IDLE]     # the read was lost
    assert talk.asks(ControlAction.ENABLE, 10.196) == []
    (_, text), = talk.until(10.291)
    assert text == READ_1, 'the read goes out, and synchronises'
    assert talk.hears(ANSWER_1, 10.3) == [ENABLE_0]


# -- refusals -------------------------------------------------------------------------------------


LOCAL = says('refused_by_drive', number=0x08000021)


def test_refused_enable_fails_with_the_reason_of_the_drive() -> None:
    talk = ready()
    assert talk.asks(ControlAction.ENABLE, 10.075) == [ENABLE_0]
    assert talk.hears('485#C002004E21000008', 10.076) == [DISABLE_1], 'it is withdrawn'
    assert talk.control_outcomes() == [
        ('enable', False, says('word_refused', word=1, reason=LOCAL))]
    refused = says('write_refused', what='control_register_1 0001h', reason=LOCAL)
    assert talk.events(Noted) == [Noted(says('write_failed', what=refused), warning=True)]
    assert talk.session.warning == says('word_not_taken', what=refused)
    assert talk.hears(DISABLED_1, 10.077) == []
    assert talk.session.warning == ''
    assert talk.until(10.0901) == [(10.09, READ_0)]
    talk.hears(ANSWER_0, 10.091)
    assert talk.until(10.1101) == [(10.11, READ_1)], 'and that is all'


@pytest.mark.parametrize(('refusals', 'asked_again'), [(2, False), (1, True)])
def test_refused_disable_is_tried_again_until_the_drive_takes_it(
        refusals: int, asked_again: bool) -> None:
    """A motor that runs and does not take its stop: nobody leaves it at that."""
    talk = running()
    tried: list[float] = []

    def answer(text: str) -> tuple[float, str]:
        if text[4:8] == 'C002':
            assert text[12:] == '00000000'
            tried.append(talk.now)
            if len(tried) <= refusals:
                return 0.001, denied(text)
        return 0.001, echo(text, 'C320' if len(tried) <= refusals else '4100')

    line = Timeline(talk, answer)
    line.took(talk.asks(ControlAction.DISABLE, 10.095))
    line.live(10.0961)
    refused = says('refused_by_drive', number=0x08000022)
    assert talk.control_outcomes() == [
        ('disable', False, says('word_refused', word=0, reason=refused))]
    assert talk.session.warning == says('word_not_taken', what=says(
        'write_refused', what='control_register_1 0000h', reason=refused))
    if asked_again:
        line.took(talk.asks(ControlAction.DISABLE, 10.097))
    line.live(12.0)
    if not asked_again:
        _, first, second = tried
        assert 10.34 < first < 10.38
        assert 0.24 < second - first < 0.3
    assert len(tried) == refusals + 1
    assert talk.session.warning == ''
    assert talk.control_outcomes() == [('disable', True, 'ready')] * asked_again


def test_a_stop_that_is_asked_for_again_while_it_is_under_way_is_written_at_once() -> None:
    talk = running()
    text, = talk.asks(ControlAction.DISABLE, 10.1)
    assert talk.hears(echo(text), 10.101) == []
    text, = talk.at(10.11)
    assert talk.hears(echo(text), 10.111) == [], 'runs on, says the status'
    assert talk.session.control is not None
    assert talk.session.control.unconfirmed
    text, = talk.asks(ControlAction.DISABLE, 10.115)
    assert text[4:10] == 'C00200'


# -- restart and loss -----------------------------------------------------------------------------


def test_restart_puts_the_word_back() -> None:
    talk = running()
    assert talk.hears('705#00', 10.1) == [START, DISABLE_0], 'it was told to run'
    lost, = talk.events(StationLost)
    assert lost.reason == says('device_restarted')
    assert talk.hears(DISABLED_0, 10.11) == []
    assert talk.until(10.151) == [(10.15, READ_1)]
    assert talk.hears(ANSWER_1, 10.153) == [DISABLE_0]
    talk.hears(DISABLED_0, 10.154)
    assert [text for _, text in talk.until(10.1701)] == [READ_1]
    talk.hears(ANSWER_1, 10.171)
    assert talk.until(10.1901) == [(10.19, READ_0)]


def test_silent_drive_is_told_to_stand_still() -> None:
    """It may have lost its voice only."""
    talk = running(parameter_timeout=0.05)
    sent = talk.until(10.7)
    assert talk.session.state is DriveState.OFFLINE
    words = [text for _, text in sent if text.startswith('505#C002')]
    assert words == [DISABLE_1, DISABLE_0, DISABLE_1]


def test_enabling_stuck_on_the_way_fails_when_the_device_restarts() -> None:
    talk = ready()
    talk.asks(ControlAction.ENABLE, 10.075)
    talk.hears('705#00', 10.08)
    assert talk.control_outcomes() == [('enable', False, says('device_restarted'))]
