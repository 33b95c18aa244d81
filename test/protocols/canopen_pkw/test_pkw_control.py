# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Control register 704: written on change, acknowledged, never repeated blindly."""

from dataclasses import replace

from builders import Conversation
from pkw_builders import (
    ANSWER_0, ANSWER_1, CONTROL, DISABLE_0, DISABLE_1, DISABLED_0, DISABLED_1, driven, echo,
    ENABLE_0, ENABLE_1, ENABLED_1, IDLE, IDLE_ANSWER, READ_0, READ_1, reading, ready, running,
    RUNS_0, RUNS_1, START, STILL_0, TABLE, TRIPPED_0, WORD,
)
import pytest
from saying import says, status_word

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import DriveState, Noted, StationLost
from drive_can_bridge.core.parameters import Access


def test_enable_and_disable() -> None:
    talk = running()
    assert talk.session.state is DriveState.ONLINE
    assert talk.asks(ControlAction.DISABLE, 10.095) == [DISABLE_0]
    assert talk.hears(DISABLED_0, 10.096) == []
    assert talk.control_outcomes() == []
    talk.until(10.1101)
    talk.hears(RUNS_1, 10.112)
    assert talk.control_outcomes() == [], 'it still runs'
    talk.until(10.1301)
    talk.hears(ANSWER_0, 10.132)
    assert talk.control_outcomes() == [('disable', True, 'ready')]


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


def test_trip_puts_the_word_back() -> None:
    talk = running()
    assert talk.until(10.1101) == [(10.11, READ_0)]
    assert talk.hears(TRIPPED_0, 10.111) == [DISABLE_1]
    assert talk.hears(DISABLED_1, 10.112) == []
    assert talk.session.state is DriveState.FAULT
    assert [text for _, text in talk.until(10.1301)] == [READ_0]
    talk.hears(ANSWER_0, 10.131)
    assert talk.until(10.1501) == [(10.15, READ_1)], 'and stays there'


def test_trip_is_known_from_the_first_round_on() -> None:
    talk, _ = reading(control=CONTROL)
    assert talk.hears('485#C70100A644000000', 10.052) == [DISABLE_0]
    assert talk.session.state is DriveState.FAULT


def test_drive_that_refuses_its_status_is_not_driven_on() -> None:
    """455 and 456 share a read until it is refused; 456 alone is answered."""
    talk = driven(command_timeout=0.0)
    sent: list[str] = []
    while DISABLE_1 not in sent and DISABLE_0 not in sent:
        now = talk.session.next_timer()
        assert now < 10.6
        asked = talk.at(now)
        while asked:
            text = asked.pop(0)
            sent.append(text)
            answer = echo(text)
            if text.startswith('505#C701'):     # function 4Eh, 0602 0000h: no such object
                answer = f'485#C70100{"CE" if text[10] == "A" else "4E"}00000206'
            asked += talk.hears(answer, now + 0.001)
    together, alone, rest = '505#C701002600000000', '505#C70100A500000000', '505#C801002500000000'
    assert sent == [together, *3 * [alone, rest], DISABLE_1, STILL_0]
    assert says('enable_withdrawn', reason=says('status_missing', answers=3)) in [
        note.text for note in talk.events(Noted)]


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
    secret = replace(WORD, access=Access.WRITE_ONLY)
    talk = ready(parameter_timeout=0.1, table=[
        secret if entry is WORD else entry for entry in TABLE])
    assert talk.asks(ControlAction.ENABLE, 10.075) == [ENABLE_0]
    now, sent = 10.175, talk.at(10.175)
    while not (outcomes := talk.control_outcomes()):
        while sent:
            text = sent.pop()
            assert text not in (ENABLE_0, ENABLE_1)
            now += 0.001
            sent += talk.hears(echo(text, '4100'), now)
        now = max(now, talk.session.next_timer())
        sent = talk.at(now)
    (_, success, message), = outcomes
    assert now == pytest.approx(12.075)
    assert not success
    assert message == says('stuck', timeout=2.0)
    assert sent == [DISABLE_1], 'it is not known to be disabled any more'


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


def rounds(talk: Conversation, begin: float, end: float, status: str,
           ) -> list[tuple[float, str]]:
    """Answer each round after 1 ms until something else is sent; return that, and when."""
    now = begin
    while now < end:
        for at, text in talk.until(now):
            if text[10:12] not in ('26', 'A6'):
                return [(at, text)]
            sent = talk.hears(f'485#C70100{text[10:12]}{status}', at + 0.001)
            if sent:
                return [(at + 0.001, sent[0])]
        now += 0.005
    return []


def settle(talk: Conversation, reply: str, now: float, status: str) -> None:
    """Answer a write, and the read that it held up."""
    for text in talk.hears(reply, now):
        assert talk.hears(f'485#C70100{text[10:12]}{status}', now + 0.001) == []


def test_refused_disable_is_tried_again_until_the_drive_takes_it() -> None:
    """A motor that runs and does not take its stop: nobody leaves it at that."""
    talk = running()
    assert talk.asks(ControlAction.DISABLE, 10.095) == ['505#C002002A00000000']
    assert talk.hears('485#C002004E22000008', 10.096) == []
    (action, success, message), = talk.control_outcomes()
    assert (action, success) == ('disable', False)
    refused = says('refused_by_drive', number=0x08000022)
    assert message == says('word_refused', word=0, reason=refused)
    assert talk.session.warning == says('word_not_taken', what=says(
        'write_refused', what='control_register_1 0000h', reason=refused))
    (at, text), = rounds(talk, 10.1, 12.0, '81000000')
    assert text[:10] == '505#C00200' and text[12:] == '00000000'
    assert 10.34 < at < 10.38
    refused = '485#C002004E22000008' if text[10:12] == '2A' else '485#C00200CE22000008'
    settle(talk, refused, at + 0.001, '81000000')
    (again, text), = rounds(talk, at + 0.002, 12.0, '81000000')
    assert 0.24 < again - at < 0.3
    settle(talk, text.replace('505#', '485#'), again + 0.001, '41000000')
    assert talk.session.warning == ''
    assert rounds(talk, again + 0.002, again + 1.0, '41000000') == []


def test_a_new_request_after_a_refusal_is_tried() -> None:
    talk = running()
    talk.asks(ControlAction.DISABLE, 10.095)
    talk.hears('485#C002004E22000008', 10.096)
    assert talk.control_outcomes()[0][:2] == ('disable', False)
    talk.asks(ControlAction.DISABLE, 10.097)
    (at, text), = rounds(talk, 10.1, 12.0, '81000000')
    settle(talk, text.replace('505#', '485#'), at + 0.001, '41000000')
    assert rounds(talk, at + 0.002, at + 0.1, '41000000') == []
    assert talk.control_outcomes() == [('disable', True, 'ready')]


def test_a_drive_that_runs_on_under_disable_is_told_of() -> None:
    talk = running()
    assert talk.asks(ControlAction.DISABLE, 10.095) == ['505#C002002A00000000']
    talk.hears('485#C002002A00000000', 10.096)
    again = []
    now = 10.1
    while written := rounds(talk, now, 12.09, '81000000'):
        (now, text), = written
        assert text[:10] + text[12:] == '505#C0020000000000', 'it may have taken no notice'
        settle(talk, text.replace('505#', '485#'), now + 0.001, '81000000')
        again.append(round(now, 1))
        now += 0.003
    assert again == [10.3, 10.7, 11.5]
    assert talk.session.control is not None
    assert talk.session.control.disregard == ''
    rounds(talk, 12.09, 12.3, '81000000')
    text = talk.session.control.disregard
    assert text == says(
        'disregards', state='enabled', status=status_word(0x0081), action='disable', word=0)
    assert Noted(text, warning=True) in talk.events(Noted)
    asked, = talk.asks(ControlAction.DISABLE, 12.302)
    assert asked[4:8] + asked[12:] == 'C00200000000', 'at once for who asks again'
    settle(talk, asked.replace('505#', '485#'), 12.303, '81000000')
    rounds(talk, 12.305, 12.4, '41000000')
    assert talk.session.control.disregard == ''


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


# -- the word among the cyclic requests -----------------------------------------------------------


def test_enable_that_is_acknowledged_is_not_repeated_although_nothing_starts() -> None:
    """What has arrived needs no repetition: started anew by one, a drive would surprise people."""
    talk = ready()
    assert talk.asks(ControlAction.ENABLE, 10.075) == [ENABLE_0]
    settle(talk, '485#C002002A00000000', 10.076, '41000000')
    assert rounds(talk, 10.08, 12.07, '41000000') == [], 'ready, say a hundred rounds'
    assert talk.control_outcomes() == []
    (at, text), = rounds(talk, 12.07, 12.2, '41000000')
    assert (round(at, 3), text[:10] + text[12:]) == (12.075, '505#C0020000000000'), 'disable'
    (action, success, _), = talk.control_outcomes()
    assert (action, success) == ('enable', False)


def test_enable_is_refreshed_only_with_a_status_that_was_read_just_now() -> None:
    """A drive that was off for a moment, unseen, must not start by a repetition."""
    talk = ready(request=(WORD,), refresh_interval=0.05, parameter_timeout=0.06)
    assert talk.asks(ControlAction.ENABLE, 10.075) == [ENABLE_0]
    assert talk.hears('485#C002002A00000000', 10.076) == []
    assert talk.until(10.135) == [(10.09, READ_1)], 'no answer; and the refresh is due'
    assert talk.until(10.1501) == [(10.15, IDLE)], 'before the word'
    assert talk.hears(IDLE_ANSWER, 10.151) == [READ_0]
    assert talk.hears(ANSWER_0, 10.152) == [ENABLE_1], 'it is there, and has not started'


def test_word_among_the_cyclic_requests_is_refreshed() -> None:
    talk = ready(request=(WORD,), refresh_interval=0.05)
    assert talk.session.setpoints.items == ()
    written = []
    for due in (10.09, 10.11, 10.13, 10.15, 10.17):
        sent = [text for _, text in talk.until(due + 1e-4)]
        while sent:
            text = sent.pop()
            written += [due] if text in (DISABLE_0, DISABLE_1) else []
            sent += talk.hears(echo(text, '4100'), due + 0.001)
    assert written == [10.11, 10.17]
