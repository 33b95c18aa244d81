# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Conversations with the machine behind ``~/enable``, ``~/reset_fault`` and ``~/quick_stop``."""

from dataclasses import FrozenInstanceError, replace
import math

from hypothesis import settings, strategies as st
from hypothesis.stateful import initialize, invariant, rule, RuleBasedStateMachine
import pytest
from saying import says, status_word

from drive_can_bridge.core import sentences
from drive_can_bridge.core.control import ControlAction, ControlRequest
from drive_can_bridge.core.control_machine import ControlMachine, RESET_CYCLES
from drive_can_bridge.core.profile import ControlTable, StatusPattern

ENABLE = ControlAction.ENABLE
DISABLE = ControlAction.DISABLE
QUICK_STOP = ControlAction.QUICK_STOP
RESET_FAULT = ControlAction.RESET_FAULT

# Control words and status words of the example profile.
OFF, RUN, STOP, RESET = 0x0000, 0x0001, 0x0002, 0x0080
NOT_READY, READY, ENABLED, FAULT = 0x0000, 0x0001, 0x0003, 0x0008

FULL = ControlTable(
    parameter='control_word', disable=OFF, enable=RUN, quick_stop=STOP, reset_fault=RESET,
    status_parameter='status_word', ready=StatusPattern(0x0001, 0x0001),
    enabled=StatusPattern(0x0002, 0x0002), fault=StatusPattern(0x0008, 0x0008))
NO_READY = replace(FULL, ready=None)
NO_FAULT = replace(FULL, fault=None)
ONLY_READY = replace(FULL, enabled=None, fault=None)
ONLY_FAULT = replace(FULL, ready=None, enabled=None)
SILENT = replace(FULL, status_parameter=None, ready=None, enabled=None, fault=None)
BARE = ControlTable(parameter='control_word', disable=OFF, enable=RUN)


def machine(table: ControlTable = FULL) -> ControlMachine:
    return ControlMachine(table, timeout=2.0)


def cycle(control: ControlMachine, raw: int | None, now: float) -> int:
    """Send the current word, then receive a status; return the word that was sent."""
    word = control.word
    control.word_sent(now)
    control.status_received(raw, now + 0.005)
    return word


def asked(control: ControlMachine, action: ControlAction, now: float) -> ControlRequest:
    request = ControlRequest(action)
    control.request(request, now)
    return request


def asking(control: ControlMachine, action: ControlAction, now: float) -> ControlMachine:
    control.request(ControlRequest(action), now)
    return control


def outcomes(control: ControlMachine) -> list[tuple[ControlAction, bool, str]]:
    return [(done.request.action, done.success, done.message)
            for done in control.take_completed()]


def enabled(table: ControlTable = FULL) -> ControlMachine:
    """Return a machine whose drive was enabled at 0.06 s."""
    control = machine(table)
    cycle(control, READY, 0.0)
    control.request(ControlRequest(ENABLE), 0.01)
    cycle(control, READY, 0.02)
    cycle(control, READY, 0.04)
    cycle(control, ENABLED, 0.06)
    assert control.word == RUN
    assert [success for _, success, _ in outcomes(control)] == [True]
    control.take_notes()
    return control


def faulted(table: ControlTable = FULL) -> ControlMachine:
    """Return a machine whose drive reported a fault at 0 s."""
    control = machine(table)
    cycle(control, FAULT, 0.0)
    control.take_notes()
    return control


# -- words that a profile does not have -----------------------------------------------------------

INSTEAD = says('disabled_instead', outcome=says('state_reached'))


def test_what_is_reached_already_needs_no_word() -> None:
    """Like with a word: a quick stop while disabled and a reset without a fault succeed."""
    control = machine(replace(FULL, quick_stop=None, reset_fault=None))
    cycle(control, READY, 0.0)
    control.request(ControlRequest(QUICK_STOP), 0.1)
    control.request(ControlRequest(RESET_FAULT), 0.1)
    assert outcomes(control) == [
        (QUICK_STOP, True, INSTEAD), (RESET_FAULT, True, says('state_reached', state='ready'))]
    cycle(control, FAULT, 0.5)
    control.request(ControlRequest(RESET_FAULT), 0.6)
    assert outcomes(control) == [
        (RESET_FAULT, False, says('no_reset_word'))]
    assert (control.word, control.pending) == (OFF, False)


def test_a_quick_stop_without_a_word_ends_an_enable_that_waits() -> None:
    """What stands, stays: the drive must not start when it becomes ready."""
    control = machine(replace(FULL, quick_stop=None))
    cycle(control, NOT_READY, 0.0)
    control.request(ControlRequest(ENABLE), 0.1)
    cycle(control, NOT_READY, 0.2)
    assert control.pending
    control.request(ControlRequest(QUICK_STOP), 0.3)
    assert outcomes(control) == [
        (ENABLE, False, says('replaced', action='quick_stop')), (QUICK_STOP, True, INSTEAD)]
    for step in range(5):
        assert cycle(control, READY, 0.4 + 0.1 * step) == OFF
    assert control.word == OFF


# -- drives that take no notice -------------------------------------------------------------------

def test_a_drive_that_has_not_answered_since_is_not_unconfirmed() -> None:
    control = enabled()
    assert not control.unconfirmed
    control.request(ControlRequest(DISABLE), 1.0)
    assert not control.unconfirmed
    control.status_received(ENABLED, 1.01)      # older than the word
    assert not control.unconfirmed
    control.word_sent(1.02)
    assert not control.unconfirmed
    control.status_received(ENABLED, 1.03)
    assert control.unconfirmed
    control.status_received(READY, 1.04)
    assert not control.unconfirmed


@pytest.mark.parametrize(('action', 'word', 'raw', 'done'), [
    (ENABLE, RUN, READY, ENABLED), (QUICK_STOP, STOP, ENABLED, READY)])
def test_a_word_is_unconfirmed_until_the_drive_follows(action: ControlAction, word: int, raw: int,
                                                       done: int) -> None:
    control = {ENABLE: machine, QUICK_STOP: enabled}[action]()
    cycle(control, {ENABLE: READY, QUICK_STOP: ENABLED}[action], 0.9)
    control.request(ControlRequest(action), 1.0)
    assert control.word == word
    assert not control.unconfirmed
    cycle(control, raw, 1.01)
    assert control.unconfirmed
    cycle(control, done, 1.03)
    assert not control.unconfirmed


def test_nothing_is_unconfirmed_where_nothing_is_reported() -> None:
    control = machine(BARE)
    cycle(control, None, 0.0)
    control.request(ControlRequest(ENABLE), 0.1)
    cycle(control, None, 0.2)
    assert not control.unconfirmed


def test_running_on_under_disable_is_told_once() -> None:
    """A ramp may take as long as a request; whoever runs on after that takes no notice."""
    control = asking(enabled(), DISABLE, 1.0)
    for step in range(1, 21):
        cycle(control, ENABLED, 1.0 + 0.1 * step)
        assert control.disregard == ''
    control.take_notes()
    for step in range(21, 40):
        cycle(control, ENABLED, 1.0 + 0.1 * step + 0.01)
        assert control.disregard == (
            says(
                'disregards', action='disable', state='enabled', status=status_word(ENABLED),
                word=0))
    assert control.take_notes() == [control.disregard]
    cycle(control, READY, 6.0)
    assert control.disregard == ''
    assert control.take_notes() == []


def test_a_long_ramp_is_nothing_to_tell() -> None:
    control = asking(enabled(), DISABLE, 1.0)
    for step in range(19):
        cycle(control, ENABLED, 1.05 + 0.1 * step)
    cycle(control, READY, 2.98)
    assert outcomes(control) == [(DISABLE, True, 'ready')]
    assert control.take_notes() == []
    assert control.disregard == ''


def test_a_faulted_drive_is_told_of_as_such() -> None:
    control = enabled()
    for step in range(40):
        cycle(control, ENABLED | FAULT, 1.0 + 0.1 * step)
    assert control.disregard == ''
    assert len(control.take_notes()) == 1


def test_a_quick_stop_that_nothing_can_confirm_is_not_unconfirmed() -> None:
    control = machine(ONLY_FAULT)
    cycle(control, READY, 0.0)
    control.request(ControlRequest(ENABLE), 0.1)
    cycle(control, READY, 0.2)
    cycle(control, READY, 0.3)
    control.request(ControlRequest(QUICK_STOP), 0.4)
    assert control.word == STOP
    cycle(control, READY, 0.5)
    assert control.pending
    assert not control.unconfirmed


def test_a_new_word_and_a_loss_end_the_running_on() -> None:
    for end in (lambda control: control.request(ControlRequest(QUICK_STOP), 4.0),
                lambda control: control.withdraw('gone', 4.0)):
        control = asking(enabled(), DISABLE, 1.0)
        cycle(control, ENABLED, 1.1)
        cycle(control, ENABLED, 3.9)
        assert control.disregard
        end(control)
        assert control.disregard == ''


@pytest.mark.parametrize(('action', 'word'), [(ENABLE, RUN), (QUICK_STOP, STOP), (DISABLE, OFF)])
def test_a_refused_word_ends_what_is_under_way(action: ControlAction, word: int) -> None:
    control = machine() if action is ENABLE else enabled()
    cycle(control, READY if action is ENABLE else ENABLED, 0.9)
    control.request(ControlRequest(action), 1.0)
    assert control.word == word
    control.word_refused(word ^ 0x4000, 'not meant', 1.1)
    assert outcomes(control) == []
    reason = sentences.refused_by_drive(0x08000021, '08000021h')
    control.word_refused(word, reason, 1.1)
    assert outcomes(control) == [(action, False, says('word_refused', word=word, reason=reason))]
    assert control.word == OFF
    assert not control.pending


def test_a_refusal_that_nobody_waits_for_changes_nothing() -> None:
    control = enabled()
    control.word_refused(RUN, 'refused', 1.0)
    assert control.word == RUN
    assert outcomes(control) == []


# -- the start ------------------------------------------------------------------------------------

def test_starts_with_disable_and_knows_nothing() -> None:
    control = machine()
    assert (control.word, control.word_due) == (OFF, True)
    assert (control.state, control.fault, control.pending) == ('unknown', False, False)
    assert control.due == math.inf
    assert control.take_completed() == []
    assert control.take_notes() == []


def test_no_status_and_no_time_starts_a_drive() -> None:
    control = machine()
    for step, raw in enumerate((READY, ENABLED, FAULT, READY, None, ENABLED)):
        assert cycle(control, raw, step * 10.0) == OFF
        control.handle_timer(step * 10.0 + 5.0)
    assert control.word == OFF


def test_ticket_is_opaque_and_equal_only_to_itself() -> None:
    ticket, other = ControlRequest(ENABLE), ControlRequest(ENABLE)
    assert ticket != other
    assert len({ticket, other}) == 2
    with pytest.raises(FrozenInstanceError):
        ticket.action = DISABLE  # type: ignore[misc]


@pytest.mark.parametrize(('table', 'raw', 'state'), [
    (FULL, NOT_READY, 'not ready'),
    (FULL, READY, 'ready'),
    (FULL, ENABLED, 'enabled'),
    (FULL, FAULT, 'fault'),
    (FULL, FAULT | ENABLED, 'fault'),
    (FULL, None, 'unknown'),
    (NO_READY, READY, 'disabled'),
    (NO_READY, ENABLED, 'enabled'),
    (NO_FAULT, FAULT, 'not ready'),
    (ONLY_READY, NOT_READY, 'not ready'),
    (ONLY_READY, READY, 'ready'),
    (ONLY_FAULT, FAULT, 'fault'),
    (ONLY_FAULT, READY, 'disable sent'),
    (ONLY_FAULT, None, 'unknown'),
    (SILENT, None, 'disable sent'),
])
def test_state_in_words(table: ControlTable, raw: int | None, state: str) -> None:
    control = machine(table)
    assert control.state == 'unknown'
    cycle(control, raw, 0.0)
    assert control.state == state
    assert control.fault == (state == 'fault')


# -- one request ----------------------------------------------------------------------------------

@pytest.mark.parametrize(('table', 'raw', 'action', 'state'), [
    (NO_READY, READY, DISABLE, 'disabled'), (FULL, FAULT, DISABLE, 'fault'),
    (FULL, READY, QUICK_STOP, 'ready'), (FULL, READY, RESET_FAULT, 'ready'),
    (FULL, ENABLED, ENABLE, 'enabled'), (FULL, ENABLED, RESET_FAULT, 'enabled')])
def test_what_is_so_already_succeeds_at_once(table: ControlTable, raw: int, action: ControlAction,
                                             state: str) -> None:
    control = enabled() if raw == ENABLED else machine(table)
    cycle(control, raw, 1.0)
    word = control.word
    control.request(ControlRequest(action), 1.01)
    assert outcomes(control) == [(action, True, state)]
    assert word == (RUN if raw == ENABLED else OFF)
    assert (control.word, control.pending) == (word, False)


@pytest.mark.parametrize(('stop', 'remarks'), [
    (DISABLE, [says('word_not_followed', word=OFF)]),
    (QUICK_STOP, [says('word_not_followed', word=STOP), says('now_disable')])])
def test_stop_that_is_not_confirmed_fails_and_it_stays_disabled(stop: ControlAction,
                                                                remarks: list[says]) -> None:
    control = asking(enabled(), stop, 1.0)
    cycle(control, ENABLED, 1.02)
    control.handle_timer(3.0)
    assert outcomes(control) == [(stop, False, says(
        'stuck', remarks=remarks, state='enabled', status=status_word(ENABLED), timeout=2.0))]
    assert (control.word, control.pending) == (OFF, False)


@pytest.mark.parametrize('stop', [DISABLE, QUICK_STOP])
def test_stop_ends_a_fault_reset(stop: ControlAction) -> None:
    control = asking(faulted(), RESET_FAULT, 0.01)
    cycle(control, FAULT, 0.02)
    assert control.word == RESET
    control.request(ControlRequest(stop), 0.03)
    assert control.word == OFF
    cycle(control, FAULT, 0.04)
    assert outcomes(control) == [
        (RESET_FAULT, False, says('replaced', action=stop.value)), (stop, True, 'fault')]


# -- enable ---------------------------------------------------------------------------------------

def test_enable_waits_for_ready_then_for_enabled() -> None:
    control = machine()
    cycle(control, NOT_READY, 0.0)
    ticket = asked(control, ENABLE, 0.01)
    assert control.pending
    assert control.due == 2.01
    assert cycle(control, NOT_READY, 0.02) == OFF
    assert cycle(control, READY, 0.04) == OFF
    assert (control.word, control.word_due) == (RUN, True)
    assert cycle(control, READY, 0.06) == RUN
    assert not control.word_due
    assert control.take_completed() == []
    assert cycle(control, ENABLED, 0.08) == RUN
    completed, = control.take_completed()
    assert completed.request is ticket
    assert (completed.success, completed.message) == (True, 'enabled')
    assert (control.word, control.state, control.pending) == (RUN, 'enabled', False)
    assert control.due == math.inf
    assert control.take_notes() == []


def test_status_from_before_the_disable_word_left_confirms_nothing() -> None:
    control = asking(machine(), ENABLE, 0.0)
    control.status_received(READY, 0.01)
    assert control.word == OFF
    control.word_sent(0.02)
    assert control.word == OFF
    control.status_received(READY, 0.03)
    assert control.word == RUN


def test_status_from_before_the_enable_word_left_confirms_nothing() -> None:
    control = machine()
    cycle(control, READY, 0.0)
    control.request(ControlRequest(ENABLE), 0.01)
    control.status_received(ENABLED, 0.02)
    assert control.take_completed() == []
    control.word_sent(0.03)
    assert control.take_completed() == []
    control.status_received(ENABLED, 0.04)
    assert outcomes(control) == [(ENABLE, True, 'enabled')]


def test_missing_status_word_confirms_nothing() -> None:
    control = asking(machine(), ENABLE, 0.0)
    assert cycle(control, None, 0.02) == OFF
    assert cycle(control, None, 0.04) == OFF
    assert control.word == OFF
    cycle(control, READY, 0.06)
    cycle(control, None, 0.08)
    assert control.take_completed() == []
    cycle(control, ENABLED, 0.10)
    assert outcomes(control) == [(ENABLE, True, 'enabled')]


def test_enable_without_a_ready_condition_still_sends_disable_first() -> None:
    control = asking(machine(NO_READY), ENABLE, 0.0)
    assert cycle(control, NOT_READY, 0.0) == OFF
    assert cycle(control, ENABLED, 0.02) == RUN
    assert outcomes(control) == [(ENABLE, True, 'enabled')]


def test_enable_without_an_enabled_condition_succeeds_when_sent() -> None:
    control = asking(machine(ONLY_READY), ENABLE, 0.0)
    cycle(control, READY, 0.0)
    assert (control.word, control.state) == (RUN, 'unknown')
    control.word_sent(0.02)
    message = 'enable sent; the drive does not report its state'
    assert outcomes(control) == [(ENABLE, True, message)]
    assert (control.word, control.state) == (RUN, 'enable sent')
    control.request(ControlRequest(ENABLE), 0.03)
    assert outcomes(control) == [(ENABLE, True, message)]


def test_enable_with_only_a_fault_condition_looks_for_a_fault_first() -> None:
    control = asking(machine(ONLY_FAULT), ENABLE, 0.0)
    control.word_sent(0.0)
    assert control.word == OFF
    control.status_received(READY, 0.01)
    assert control.word == RUN


@pytest.mark.parametrize('table', [SILENT, BARE])
def test_enable_without_any_status_succeeds_when_sent(table: ControlTable) -> None:
    control = asking(machine(table), ENABLE, 0.0)
    assert cycle(control, None, 0.0) == OFF
    assert control.take_completed() == []
    assert cycle(control, None, 0.02) == RUN
    message = 'enable sent; the drive does not report its state'
    assert outcomes(control) == [(ENABLE, True, message)]
    assert cycle(control, None, 0.04) == RUN


def test_a_member_that_drops_out_before_the_others_are_enabled_ends_the_enable() -> None:
    """It would start again with them."""
    control = ControlMachine(FULL, timeout=2.0, members=['mixer', 'fan'])
    for name in ('mixer', 'fan'):
        control.member_found(name)

    def says_all(mixer: int, fan: int, now: float) -> int:
        word = control.word
        control.word_sent(now)
        control.status_received(mixer, now + 0.005, 'mixer')
        control.status_received(fan, now + 0.006, 'fan')
        return word
    says_all(READY, READY, 0.0)
    control.request(ControlRequest(ENABLE), 0.01)
    says_all(READY, READY, 0.02)
    assert says_all(ENABLED, READY, 0.04) == RUN
    assert says_all(ENABLED, READY, 0.06) == RUN
    assert outcomes(control) == []
    says_all(READY, ENABLED, 0.08)
    assert control.word == OFF
    (_, success, why), = outcomes(control)
    assert not success
    assert why == says('dropped_out')


def test_enable_of_an_enabled_drive_waits_while_its_status_is_missing() -> None:
    control = enabled()
    cycle(control, None, 1.0)
    control.request(ControlRequest(ENABLE), 1.01)
    assert (control.take_completed(), control.word) == ([], RUN)
    cycle(control, ENABLED, 1.02)
    assert outcomes(control) == [(ENABLE, True, 'enabled')]
    cycle(control, None, 2.0)
    control.request(ControlRequest(ENABLE), 2.01)
    cycle(control, READY, 2.02)
    assert outcomes(control) == [
        (ENABLE, False, says('dropped_out', status=status_word(READY)))]
    assert control.word == OFF


def test_enabled_under_the_disable_word_is_outdated_and_not_taken_for_success() -> None:
    control = machine()
    cycle(control, ENABLED, 0.0)
    control.request(ControlRequest(ENABLE), 0.01)
    assert cycle(control, ENABLED, 0.02) == OFF
    assert control.word == OFF
    assert cycle(control, READY, 0.04) == OFF
    assert cycle(control, ENABLED, 0.06) == RUN
    assert outcomes(control) == [(ENABLE, True, 'enabled')]


def test_enable_is_refused_while_faulted() -> None:
    control = asking(faulted(), ENABLE, 1.0)
    assert outcomes(control) == [(ENABLE, False, says('reset_first'))]
    assert (control.word, control.pending) == (OFF, False)


@pytest.mark.parametrize(('steps', 'state', 'status', 'remarks'), [
    (((NOT_READY, 0.02),), 'not ready', status_word(NOT_READY), []),
    (((READY, 0.02), (READY, 0.04)), 'ready', status_word(READY), []),
    (((ENABLED, 0.02),), 'enabled', status_word(ENABLED), [says('word_not_followed', word=OFF)]),
    (((READY, 0.02),), 'ready', status_word(READY), [says('word_not_sent', word=RUN)]),
    (((None, 0.02),), 'unknown', says('no_status_word'), [says('no_status_since', word=OFF)]),
    ((), 'unknown', says('no_status_word'), [says('word_not_sent', word=OFF)]),
])
def test_enable_that_is_not_confirmed_is_withdrawn(
        steps: tuple[tuple[int | None, float], ...], state: str, status: says,
        remarks: list[says]) -> None:
    control = asking(machine(), ENABLE, 0.0)
    for raw, now in steps:
        cycle(control, raw, now)
    control.handle_timer(1.999)
    assert control.pending
    control.handle_timer(2.0)
    assert outcomes(control) == [(ENABLE, False, says(
        'stuck', timeout=2.0, state=state, status=status, remarks=remarks))]
    assert (control.word, control.pending) == (OFF, False)
    assert control.due == math.inf
    cycle(control, READY, 2.1)
    cycle(control, ENABLED, 2.2)
    assert control.word == OFF
    assert control.take_completed() == []


def test_status_after_the_deadline_comes_too_late() -> None:
    control = machine()
    cycle(control, READY, 0.0)
    control.request(ControlRequest(ENABLE), 0.0)
    control.word_sent(0.02)
    control.status_received(ENABLED, 2.0)
    (_, success, _), = outcomes(control)
    assert (success, control.word) == (False, OFF)


def test_word_that_leaves_after_the_deadline_is_not_taken_for_the_next_one() -> None:
    control = machine()
    cycle(control, READY, 0.0)
    control.request(ControlRequest(ENABLE), 0.0)
    assert control.word == RUN
    control.word_sent(2.0)
    assert (control.word, control.word_due) == (OFF, True)
    (_, success, message), = outcomes(control)
    assert not success
    assert message == says('stuck', remarks=[says('no_status_since', word=RUN)])


def test_request_after_the_deadline_does_not_find_the_old_one() -> None:
    control = asking(machine(), ENABLE, 0.0)
    control.request(ControlRequest(ENABLE), 2.5)
    assert [success for _, success, _ in outcomes(control)] == [False]
    assert control.due == 4.5


def test_second_enable_joins_the_first() -> None:
    control = machine()
    first = asked(control, ENABLE, 0.0)
    cycle(control, READY, 0.02)
    second = asked(control, ENABLE, 1.0)
    assert control.word == RUN
    assert control.due == 2.0
    assert control.take_completed() == []
    cycle(control, ENABLED, 1.02)
    completed = control.take_completed()
    assert [done.request for done in completed] == [first, second]
    assert [done.message for done in completed] == ['enabled', 'enabled']


# -- faults and drives that drop out --------------------------------------------------------------

@pytest.mark.parametrize('before', [(), ((READY, 0.02),)])
def test_fault_while_enabling_ends_it(before: tuple[tuple[int, float], ...]) -> None:
    control = asking(machine(), ENABLE, 0.0)
    for raw, now in before:
        cycle(control, raw, now)
    control.status_received(FAULT, 0.03)
    assert outcomes(control) == [
        (ENABLE, False, says('fault_while_enabling', status=status_word(FAULT)))]
    assert control.take_notes() == [says('fault_came', ran=False, status=status_word(FAULT))]
    assert (control.word, control.fault, control.pending) == (OFF, True, False)


def test_fault_while_enabled_puts_the_word_back() -> None:
    control = enabled()
    cycle(control, FAULT | ENABLED, 1.0)
    assert (control.word, control.state, control.fault) == (OFF, 'fault', True)
    assert control.take_notes() == [
        says('fault_came', ran=True, status=status_word(FAULT | ENABLED))]
    cycle(control, READY, 1.02)
    cycle(control, ENABLED, 1.04)
    assert control.word == OFF
    assert control.take_completed() == []


def test_fault_is_noted_once_when_it_comes_and_once_when_it_goes() -> None:
    control = machine()
    for now, raw in enumerate((READY, FAULT, FAULT, None, FAULT | READY)):
        cycle(control, raw, float(now))
    assert control.take_notes() == [says('fault_came', ran=False, status=status_word(FAULT))]
    assert control.state == 'fault'
    cycle(control, READY, 10.0)
    cycle(control, READY, 11.0)
    assert control.take_notes() == [says('fault_gone', status=status_word(READY))]
    assert not control.fault
    cycle(control, FAULT, 12.0)
    assert control.take_notes() == [says('fault_came', ran=False, status=status_word(FAULT))]


def test_drive_that_drops_out_is_not_started_again() -> None:
    control = enabled()
    cycle(control, READY, 1.0)
    assert (control.word, control.pending) == (OFF, False)
    assert control.take_notes() == [
        says('dropped_out_for_good', status=status_word(READY))]
    cycle(control, ENABLED, 1.02)
    assert control.word == OFF
    assert control.take_notes() == []
    assert control.take_completed() == []


def test_enabled_drive_survives_a_missing_status_word() -> None:
    control = enabled()
    assert cycle(control, None, 1.0) == RUN
    assert cycle(control, ENABLED, 1.02) == RUN
    assert control.word == RUN


def test_dropping_out_needs_a_condition_for_enabled() -> None:
    control = asking(machine(ONLY_READY), ENABLE, 0.0)
    cycle(control, READY, 0.0)
    cycle(control, READY, 0.02)
    cycle(control, NOT_READY, 0.04)
    assert control.word == RUN


# -- disable --------------------------------------------------------------------------------------

def test_disable_waits_until_not_enabled() -> None:
    control = asking(enabled(), DISABLE, 1.0)
    assert control.word == OFF
    control.status_received(READY, 1.01)
    assert control.take_completed() == []
    assert cycle(control, ENABLED, 1.02) == OFF
    assert control.take_completed() == []
    assert cycle(control, READY, 1.04) == OFF
    assert outcomes(control) == [(DISABLE, True, 'ready')]
    assert control.take_notes() == []


def test_disable_without_a_status_succeeds_when_sent() -> None:
    control = asking(machine(BARE), DISABLE, 0.0)
    assert control.take_completed() == []
    control.word_sent(0.02)
    message = 'disable sent; the drive does not report its state'
    assert outcomes(control) == [(DISABLE, True, message)]


@pytest.mark.parametrize('steps', [(), ((READY, 0.02),)])
def test_disable_wins_over_enable(steps: tuple[tuple[int, float], ...]) -> None:
    control = asking(machine(), ENABLE, 0.0)
    for raw, now in steps:
        cycle(control, raw, now)
    control.request(ControlRequest(DISABLE), 0.1)
    assert control.word == OFF
    cycle(control, READY, 0.12)
    assert outcomes(control) == [(ENABLE, False, says(
        'replaced', action='disable')), (DISABLE, True, 'ready')]
    cycle(control, READY, 0.14)
    assert control.word == OFF


def test_disable_wins_over_a_quick_stop() -> None:
    control = asking(enabled(), QUICK_STOP, 1.0)
    control.request(ControlRequest(DISABLE), 1.01)
    assert control.word == OFF
    assert outcomes(control) == [(QUICK_STOP, False, says('replaced', action='disable'))]


# -- quick stop -----------------------------------------------------------------------------------

def test_quick_stop_brakes_until_not_enabled_then_disables() -> None:
    control = asking(enabled(), QUICK_STOP, 1.0)
    assert control.word == STOP
    control.status_received(READY, 1.01)
    assert control.word == STOP
    assert cycle(control, ENABLED, 1.02) == STOP
    assert control.take_completed() == []
    assert cycle(control, READY, 1.04) == STOP
    assert outcomes(control) == [(QUICK_STOP, True, 'ready')]
    assert (control.word, control.pending) == (OFF, False)
    assert control.take_notes() == []


@pytest.mark.parametrize('sent', [False, True])
def test_quick_stop_of_a_drive_that_is_about_to_run_brakes(sent: bool) -> None:
    control = machine()
    cycle(control, READY, 0.0)
    control.request(ControlRequest(ENABLE), 0.01)
    if sent:
        cycle(control, READY, 0.02)
    control.request(ControlRequest(QUICK_STOP), 0.03)
    assert control.word == STOP
    assert outcomes(control) == [(ENABLE, False, says('replaced', action='quick_stop'))]


def test_quick_stop_before_the_enable_word_needs_no_braking() -> None:
    control = machine()
    cycle(control, NOT_READY, 0.0)
    control.request(ControlRequest(ENABLE), 0.01)
    control.request(ControlRequest(QUICK_STOP), 0.02)
    assert outcomes(control) == [
        (ENABLE, False, says('replaced', action='quick_stop')), (QUICK_STOP, True, 'not ready')]
    assert control.word == OFF


def test_quick_stop_of_a_drive_that_still_runs_under_disable_brakes() -> None:
    control = asking(enabled(), DISABLE, 1.0)
    control.request(ControlRequest(QUICK_STOP), 1.01)
    assert control.word == STOP
    assert outcomes(control) == [(DISABLE, False, says('replaced', action='quick_stop'))]
    control.request(ControlRequest(DISABLE), 1.02)
    cycle(control, ENABLED, 1.03)
    control.request(ControlRequest(QUICK_STOP), 1.04)
    assert control.word == STOP


def test_quick_stop_of_a_drive_nobody_knows_brakes() -> None:
    control = asking(machine(), QUICK_STOP, 0.0)
    assert control.word == STOP
    cycle(control, READY, 0.02)
    assert outcomes(control) == [(QUICK_STOP, True, 'ready')]


BRAKES = ENABLED | 0x0040


def braking() -> ControlMachine:
    """Return the machine of a drive whose quick stop has taken longer than was waited for."""
    control = enabled(replace(FULL, braking=StatusPattern(0x0042, 0x0042)))
    control.request(ControlRequest(QUICK_STOP), 1.0)
    cycle(control, BRAKES, 1.02)
    control.handle_timer(3.0)
    assert outcomes(control) == [(
        QUICK_STOP, False, says(
            'stuck', remarks=[says('word_not_followed', word=2), says('word_stays')],
            state='enabled', status=status_word(BRAKES), timeout=2.0))]
    return control


def test_quick_stop_goes_on_while_the_drive_says_that_it_brakes() -> None:
    """Under ``disable`` the motor may coast."""
    control = braking()
    assert (control.word, control.pending, control.due) == (STOP, True, 5.0)
    cycle(control, BRAKES, 3.1)
    assert control.disregard == says(
        'disregards', state='enabled', status=status_word(BRAKES), action='quick_stop', word=STOP)
    control.request(ControlRequest(ENABLE), 3.2)
    assert outcomes(control)[0][:2] == (ENABLE, False)
    cycle(control, BRAKES, 5.1)
    assert (control.word, outcomes(control)) == (STOP, [])
    control.request(ControlRequest(QUICK_STOP), 5.3)
    assert control.due == pytest.approx(7.3)
    cycle(control, READY, 6.0)
    assert outcomes(control) == [(QUICK_STOP, True, 'ready')]
    assert (control.word, control.pending) == (OFF, False)


def test_quick_stop_that_a_drive_breaks_off_is_followed_by_disable() -> None:
    control = braking()
    cycle(control, ENABLED, 3.1)
    control.handle_timer(5.0)
    assert control.word == OFF


def test_disable_takes_the_place_of_a_quick_stop_that_goes_on() -> None:
    control = braking()
    control.request(ControlRequest(DISABLE), 3.2)
    assert control.word == OFF


def test_fault_during_a_quick_stop_disables_and_the_stop_is_still_watched() -> None:
    control = asking(enabled(), QUICK_STOP, 1.0)
    cycle(control, FAULT | ENABLED, 1.02)
    assert (control.word, control.pending) == (OFF, True)
    cycle(control, FAULT, 1.04)
    assert outcomes(control) == [(QUICK_STOP, True, 'fault')]


def test_second_quick_stop_joins_the_first() -> None:
    control = asking(enabled(), QUICK_STOP, 1.0)
    control.request(ControlRequest(QUICK_STOP), 1.5)
    assert control.due == 3.0
    cycle(control, READY, 1.52)
    assert outcomes(control) == [(QUICK_STOP, True, 'ready')] * 2


def test_quick_stop_of_a_faulted_drive_that_still_runs_is_a_disable() -> None:
    control = machine()
    cycle(control, FAULT | ENABLED, 0.0)
    control.request(ControlRequest(QUICK_STOP), 0.01)
    assert (control.word, control.pending) == (OFF, True)
    cycle(control, FAULT, 0.02)
    assert outcomes(control) == [(QUICK_STOP, True, 'fault')]


def test_quick_stop_without_a_word_disables_and_says_so() -> None:
    control = asking(enabled(replace(FULL, quick_stop=None)), QUICK_STOP, 1.0)
    assert (control.word, control.pending, control.operating) == (OFF, True, False)
    assert cycle(control, ENABLED, 1.02) == OFF
    assert outcomes(control) == []
    cycle(control, READY, 1.04)
    assert outcomes(control) == [(QUICK_STOP, True, INSTEAD)]
    assert (control.word, control.pending) == (OFF, False)


def test_it_joins_a_disable() -> None:
    control = asking(enabled(replace(FULL, quick_stop=None)), DISABLE, 1.0)
    control.request(ControlRequest(QUICK_STOP), 1.01)
    cycle(control, ENABLED, 1.02)
    cycle(control, READY, 1.04)
    assert outcomes(control) == [
        (DISABLE, True, says('state_reached', state='ready')), (QUICK_STOP, True, INSTEAD)]


def test_quick_stop_without_a_status_is_answered_when_sent_and_keeps_braking() -> None:
    control = asking(machine(SILENT), ENABLE, 0.0)
    cycle(control, None, 0.0)
    cycle(control, None, 0.02)
    control.take_completed()
    control.request(ControlRequest(QUICK_STOP), 1.0)
    assert control.take_completed() == []
    assert cycle(control, None, 1.02) == STOP
    message = 'quick_stop sent; the drive does not report its state'
    assert outcomes(control) == [(QUICK_STOP, True, message)]
    assert (control.word, control.pending, control.due) == (STOP, True, 3.0)
    assert control.state == 'quick_stop sent'
    control.request(ControlRequest(QUICK_STOP), 1.5)
    assert outcomes(control) == [(QUICK_STOP, True, message)]
    control.request(ControlRequest(ENABLE), 1.6)
    assert outcomes(control) == [
        (ENABLE, False, says('stop_under_way', action='enable', stop='quick_stop'))]
    control.handle_timer(3.0)
    assert (control.word, control.pending) == (OFF, False)
    assert control.take_completed() == []


def test_quick_stop_without_a_status_after_disable_was_sent_succeeds_at_once() -> None:
    control = machine(SILENT)
    control.word_sent(0.0)
    control.request(ControlRequest(QUICK_STOP), 0.01)
    message = 'disable sent; the drive does not report its state'
    assert outcomes(control) == [(QUICK_STOP, True, message)]
    assert (control.word, control.pending) == (OFF, False)


def test_fault_ends_the_braking_of_a_drive_that_reports_only_faults() -> None:
    control = asking(machine(ONLY_FAULT), QUICK_STOP, 0.0)
    cycle(control, READY, 0.0)
    assert (control.word, control.pending) == (STOP, True)
    control.take_completed()
    cycle(control, FAULT, 0.02)
    assert control.word == OFF
    cycle(control, FAULT, 0.04)
    assert not control.pending
    assert control.take_completed() == []


def test_quick_stop_whose_word_is_the_disable_word() -> None:
    control = asking(enabled(replace(FULL, quick_stop=OFF)), QUICK_STOP, 1.0)
    assert cycle(control, ENABLED, 1.02) == OFF
    assert cycle(control, READY, 1.04) == OFF
    assert outcomes(control) == [(QUICK_STOP, True, 'ready')]
    assert not control.word_due


@pytest.mark.parametrize('stop', [DISABLE, QUICK_STOP])
@pytest.mark.parametrize('start', [ENABLE, RESET_FAULT])
def test_no_start_cuts_a_stop_short(stop: ControlAction, start: ControlAction) -> None:
    control = asking(enabled(NO_FAULT), stop, 1.0)
    word = control.word
    control.request(ControlRequest(start), 1.01)
    assert outcomes(control) == [(
        start, False, says('stop_under_way', stop=stop.value, action=start.value))]
    assert control.word == word
    cycle(control, READY, 1.02)
    assert outcomes(control) == [(stop, True, 'ready')]
    assert control.word == OFF


def test_fault_reset_with_nothing_to_reset_does_not_disturb_a_stop() -> None:
    control = asking(enabled(), QUICK_STOP, 1.0)
    control.request(ControlRequest(RESET_FAULT), 1.01)
    assert outcomes(control) == [(RESET_FAULT, True, 'enabled')]
    assert (control.word, control.pending) == (STOP, True)
    cycle(control, FAULT | ENABLED, 1.02)
    control.request(ControlRequest(RESET_FAULT), 1.03)
    assert outcomes(control) == [(
        RESET_FAULT, False, says('stop_under_way', action='reset_fault', stop='quick_stop'))]


# -- fault reset ----------------------------------------------------------------------------------

def test_reset_pulses_then_disables_and_waits_for_the_status() -> None:
    control = asking(faulted(), RESET_FAULT, 0.01)
    assert control.word == RESET
    assert [cycle(control, FAULT, 0.02 * n) for n in range(1, 4)] == [RESET] * 3
    assert not control.pulsing
    assert [cycle(control, FAULT, 0.02 * n) for n in range(4, 7)] == [OFF] * 3
    assert control.take_completed() == []
    cycle(control, READY, 0.14)
    assert outcomes(control) == [(RESET_FAULT, True, 'ready')]
    assert control.take_notes() == [says('fault_gone', status=status_word(READY))]
    assert (control.word, control.pending) == (OFF, False)
    control.request(ControlRequest(ENABLE), 0.15)
    assert control.word == RUN


def test_pulse_is_one_word_where_that_is_acknowledged() -> None:
    control = ControlMachine(FULL, timeout=2.0, pulse=1)
    cycle(control, FAULT, 0.0)
    control.request(ControlRequest(RESET_FAULT), 0.01)
    assert [cycle(control, FAULT, 0.02), cycle(control, READY, 0.04)] == [RESET, OFF]
    assert outcomes(control) == [(RESET_FAULT, True, 'ready')]


@pytest.mark.parametrize('gone', [0, 1, 2])
def test_pulse_is_the_same_when_the_fault_goes_meanwhile(gone: int) -> None:
    """What counts is a status that came after the pulse was over."""
    control = asking(faulted(), RESET_FAULT, 0.01)
    if gone == 0:
        control.status_received(READY, 0.02)
    assert [cycle(control, READY if n >= gone else FAULT, 0.02 + 0.02 * n)
            for n in range(RESET_CYCLES)] == [RESET] * RESET_CYCLES
    assert (control.word, control.take_completed()) == (OFF, [])
    cycle(control, READY, 0.2)
    assert outcomes(control) == [(RESET_FAULT, True, 'ready')]


def test_reset_that_does_not_help_fails_and_disables() -> None:
    control = asking(faulted(), RESET_FAULT, 0.0)
    assert [cycle(control, FAULT, 0.1 * n) for n in range(1, RESET_CYCLES + 2)] == [
        *[RESET] * RESET_CYCLES, OFF]
    control.handle_timer(2.0)
    assert outcomes(control) == [
        (RESET_FAULT, False, says('fault_present', status=status_word(FAULT), timeout=2.0))]
    assert (control.word, control.fault, control.pending) == (OFF, True, False)


def test_reset_that_could_not_be_sent_says_so() -> None:
    control = asking(faulted(), RESET_FAULT, 0.0)
    control.handle_timer(2.0)
    assert outcomes(control) == [(
        RESET_FAULT, False, says(
            'stuck', remarks=[says('word_not_sent', word=128)], state='fault',
            status=status_word(FAULT), timeout=2.0))]


def test_word_that_was_not_acknowledged_says_so() -> None:
    """Nobody knows whether it arrived."""
    control = ControlMachine(FULL, timeout=2.0, pulse=1)
    cycle(control, FAULT, 0.0)
    control.request(ControlRequest(RESET_FAULT), 0.0)
    control.handle_timer(2.0)
    (_, _, text), = outcomes(control)
    assert text == says('stuck', remarks=[says('word_not_acknowledged', word=RESET)])


def test_each_reset_is_one_rising_edge() -> None:
    control = asking(faulted(), RESET_FAULT, 0.0)
    cycle(control, FAULT, 0.02)
    control.request(ControlRequest(RESET_FAULT), 1.0)
    assert cycle(control, FAULT, 1.02) == RESET
    control.handle_timer(2.0)
    assert [success for _, success, _ in outcomes(control)] == [False, False]
    control.request(ControlRequest(RESET_FAULT), 2.01)
    assert control.word == OFF
    control.status_received(FAULT, 2.02)
    assert control.word == OFF
    assert cycle(control, FAULT, 2.03) == OFF
    assert cycle(control, FAULT, 2.05) == RESET


def test_reset_of_a_drive_nobody_knows_looks_first() -> None:
    control = asking(machine(), RESET_FAULT, 0.0)
    control.word_sent(0.0)
    assert control.word == OFF
    control.status_received(READY, 0.01)
    assert outcomes(control) == [(RESET_FAULT, True, 'ready')]
    control = asking(machine(), RESET_FAULT, 0.0)
    cycle(control, FAULT, 0.0)
    assert control.word == RESET


@pytest.mark.parametrize('table', [SILENT, NO_FAULT])
def test_reset_of_a_drive_that_reports_no_faults_is_one_pulse(table: ControlTable) -> None:
    control = asking(machine(table), RESET_FAULT, 0.0)
    assert cycle(control, READY, 0.0) == OFF
    assert [cycle(control, READY, 0.02 * n) for n in range(1, RESET_CYCLES + 1)] == [
        RESET] * RESET_CYCLES
    assert control.take_completed() == []
    assert cycle(control, READY, 0.2) == OFF
    message = 'reset_fault sent; the drive does not report faults'
    assert outcomes(control) == [(RESET_FAULT, True, message)]
    assert (control.word, control.pending) == (OFF, False)


def test_reset_of_an_enabled_drive_that_reports_no_faults_disables_it() -> None:
    control = asking(enabled(NO_FAULT), RESET_FAULT, 1.0)
    assert [cycle(control, READY, 1.0 + 0.1 * n) for n in range(RESET_CYCLES + 2)] == [
        OFF, *[RESET] * RESET_CYCLES, OFF]


def test_reset_replaces_an_enable() -> None:
    control = machine()
    cycle(control, READY, 0.0)
    control.request(ControlRequest(ENABLE), 0.01)
    cycle(control, READY, 0.02)
    control.request(ControlRequest(RESET_FAULT), 0.03)
    assert control.word == OFF
    cycle(control, READY, 0.04)
    assert outcomes(control) == [
        (ENABLE, False, says('replaced', action='reset_fault')), (RESET_FAULT, True, 'ready')]
    cycle(control, READY, 0.06)
    assert control.word == OFF


def test_enable_is_refused_during_a_reset_and_does_not_disturb_it() -> None:
    control = asking(faulted(), RESET_FAULT, 0.01)
    control.request(ControlRequest(ENABLE), 0.02)
    assert outcomes(control) == [(ENABLE, False, says('reset_first'))]
    assert (control.word, control.pending) == (RESET, True)


def test_enable_replaces_a_reset_where_no_fault_is_known() -> None:
    control = asking(machine(NO_FAULT), RESET_FAULT, 0.0)
    cycle(control, READY, 0.0)
    assert control.word == RESET
    control.request(ControlRequest(ENABLE), 0.01)
    assert control.word == OFF
    assert outcomes(control) == [(RESET_FAULT, False, says('replaced', action='enable'))]
    cycle(control, READY, 0.02)
    assert control.word == RUN


# -- withdraw -------------------------------------------------------------------------------------

def test_withdraw_puts_an_enabled_drive_back() -> None:
    control = enabled()
    control.withdraw('drive offline', 1.0)
    assert (control.word, control.word_due, control.state) == (OFF, True, 'unknown')
    assert control.take_notes() == [
        says('enable_withdrawn', reason='drive offline', whom='the drive')]
    assert control.take_completed() == []
    cycle(control, READY, 1.02)
    cycle(control, ENABLED, 1.04)
    assert control.word == OFF
    control.withdraw('bridge stops', 2.0)
    assert control.take_notes() == []


@pytest.mark.parametrize('action', [ENABLE, DISABLE, QUICK_STOP])
def test_withdraw_fails_what_is_under_way(action: ControlAction) -> None:
    control = asking(machine(), action, 0.0)
    control.request(ControlRequest(action), 0.01)
    control.withdraw('drive offline', 1.0)
    assert outcomes(control) == [(action, False, 'drive offline')] * 2
    assert (control.word, control.pending, control.due) == (OFF, False, math.inf)
    assert control.take_notes() == []


def test_withdraw_fails_a_reset_and_remembers_the_fault() -> None:
    control = asking(faulted(), RESET_FAULT, 0.01)
    control.withdraw('drive offline', 1.0)
    assert outcomes(control) == [(RESET_FAULT, False, 'drive offline')]
    assert (control.word, control.fault) == (OFF, True)
    control.request(ControlRequest(ENABLE), 2.0)
    assert outcomes(control) == [(ENABLE, False, says('reset_first'))]
    cycle(control, FAULT, 3.0)
    assert control.take_notes() == []
    cycle(control, READY, 4.0)
    assert control.take_notes() == [says('fault_gone', status=status_word(READY))]


def test_withdraw_forgets_that_there_was_no_fault() -> None:
    control = machine()
    cycle(control, READY, 0.0)
    control.withdraw('drive offline', 1.0)
    control.request(ControlRequest(RESET_FAULT), 2.0)
    assert (control.take_completed(), control.word, control.pending) == ([], OFF, True)


def test_withdraw_after_the_deadline_names_the_deadline() -> None:
    control = asking(machine(), ENABLE, 0.0)
    control.withdraw('drive offline', 2.0)
    (_, _, message), = outcomes(control)
    assert message == says('stuck', timeout=2.0)


def test_status_from_before_a_withdrawal_confirms_nothing() -> None:
    control = machine()
    cycle(control, READY, 0.0)
    control.withdraw('drive offline', 1.0)
    control.request(ControlRequest(ENABLE), 1.01)
    assert control.word == OFF
    control.status_received(READY, 1.02)
    control.word_sent(1.025)
    assert control.word == OFF
    cycle(control, READY, 1.03)
    assert control.word == RUN


def test_withdraw_ends_the_braking_of_a_drive_that_does_not_report() -> None:
    control = asking(machine(SILENT), QUICK_STOP, 0.0)
    control.word_sent(0.02)
    control.take_completed()
    control.withdraw('bridge stops', 0.03)
    assert (control.word, control.pending) == (OFF, False)
    assert control.take_completed() == []


# -- whatever happens -----------------------------------------------------------------------------

class AnyConversation(RuleBasedStateMachine):
    """Requests, words, statuses and time in any order, held against the rules of safety."""

    @initialize(table=st.sampled_from(
        [FULL, NO_READY, NO_FAULT, ONLY_READY, ONLY_FAULT, SILENT, BARE]))
    def start(self, table: ControlTable) -> None:
        self.table = table
        self.control = ControlMachine(table, timeout=2.0)
        self.now = 0.0
        self.open: dict[ControlRequest, float] = {}
        self.closed: set[ControlRequest] = set()
        self.may_enable = False     # an ENABLE that nothing has ended since
        self.last_sent: int | None = None

    def collect(self) -> None:
        for done in self.control.take_completed():
            assert done.request in self.open, 'no outcome without request, none twice'
            assert done.message
            del self.open[done.request]
            self.closed.add(done.request)
            if done.request.action is ENABLE and not done.success and not self.refused:
                self.may_enable = False
        self.refused = False

    refused = False

    @rule(action=st.sampled_from(ControlAction))
    def request(self, action: ControlAction) -> None:
        self.expire()
        word, pending = self.control.word, self.control.pending
        running = word == self.table.enable
        stopping = pending and not self.open or any(
            ticket.action in (DISABLE, QUICK_STOP) for ticket in self.open)
        ticket = asked(self.control, action, self.now)
        self.open[ticket] = self.now + 2.0
        completed = self.control.take_completed()
        by_ticket = {done.request: done for done in completed}
        assert len(by_ticket) == len(completed), 'no outcome twice'
        mine = by_ticket.get(ticket)
        refused = mine is not None and not mine.success
        if refused:
            assert len(completed) == 1
            assert self.control.word == word, 'a refused request changes nothing'
            assert self.control.pending == pending
        elif action is ENABLE:
            assert not self.control.fault
            assert not stopping, 'no start cuts a stop short'
            self.may_enable = True
        elif action in (DISABLE, QUICK_STOP):
            assert self.control.word != self.table.enable, 'a stop takes effect at once'
            if action is QUICK_STOP and running:    # a faulted drive does not get here
                assert self.control.word == (
                    self.table.disable if self.table.quick_stop is None else self.table.quick_stop)
            self.may_enable = False
        for done in completed:
            assert done.request in self.open
            del self.open[done.request]
            self.closed.add(done.request)
            if done.message.startswith('replaced by'):
                assert not refused
                self.may_enable = action is ENABLE

    @rule()
    def send(self) -> None:
        word = self.control.word
        if word == RESET and self.table.reset_fault == RESET:
            assert self.last_sent in (OFF, RESET), 'the pulse has a rising edge'
        if word == RUN:
            assert self.last_sent in (OFF, RUN), 'enable follows disable'
        self.last_sent = word
        self.control.word_sent(self.now)
        self.collect()

    @rule(raw=st.one_of(st.none(), st.sampled_from(
        [NOT_READY, READY, ENABLED, FAULT, FAULT | ENABLED])))
    def receive(self, raw: int | None) -> None:
        self.expire()
        self.control.status_received(raw, self.now)
        fault = self.table.fault
        if raw is not None and fault is not None:
            assert self.control.fault == fault.matches(raw)
            if self.control.fault:
                self.may_enable = False
        self.collect()

    @rule(seconds=st.sampled_from([0.0, 0.02, 0.5, 1.0, 2.0]))
    def wait(self, seconds: float) -> None:
        self.now += seconds
        self.expire()

    def expire(self) -> None:
        self.control.handle_timer(self.now)
        self.collect()
        assert all(deadline > self.now for deadline in self.open.values())
        assert self.control.due > self.now

    @rule()
    def withdraw(self) -> None:
        self.control.withdraw('drive offline', self.now)
        self.may_enable = False
        self.collect()
        assert not self.open
        assert (self.control.word, self.control.word_due) == (OFF, True)

    @rule()
    def follow(self) -> None:
        """Play a healthy drive for some cycles: whatever was asked must come true."""
        wanted = {ticket.action for ticket in self.open}
        state = READY
        for _ in range(6):
            word = self.control.word
            self.send()
            state = {OFF: READY, RUN: ENABLED, STOP: READY, RESET: READY}[word]
            self.control.status_received(state, self.now)
            completed = self.control.take_completed()
            for done in completed:
                assert done.success, done.message
                assert done.request in self.open
                del self.open[done.request]
        assert not self.open
        if ENABLE in wanted:
            assert self.control.word == RUN

    @invariant()
    def enable_only_for_an_enable(self) -> None:
        if self.control.word == RUN:
            assert self.may_enable

    @invariant()
    def faulted_drive_is_never_enabled(self) -> None:
        if self.control.fault:
            assert self.control.word in (OFF, RESET)

    @invariant()
    def open_tickets_are_watched(self) -> None:
        assert not self.open or self.control.pending
        assert self.control.pending == (self.control.due < math.inf)
        assert self.control.state
        assert all(self.control.take_notes())


TestAnyConversation = AnyConversation.TestCase
TestAnyConversation.settings = settings(stateful_step_count=40)
