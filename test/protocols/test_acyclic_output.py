# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What is told by acyclic writes, and when: setpoints, the control word, and the two policies."""

import math

import pytest
from stops import written_again

from drive_can_bridge.core.control import ControlAction, ControlRequest
from drive_can_bridge.core.control_machine import ControlMachine, RESET_CYCLES
from drive_can_bridge.core.profile import ControlTable, StatusPattern
from drive_can_bridge.protocols.acyclic_output import (
    Acknowledged, AcyclicOutput, Judged, Policy,
)

OFF, RUN, RESET = 0x0000, 0x0001, 0x0080
STANDING, ENABLED, FAULT = 0x0001, 0x0003, 0x0008
TABLE = ControlTable(
    parameter='control_word', disable=OFF, enable=RUN, reset_fault=RESET,
    status_parameter='status_word', enabled=StatusPattern(0x0002, 0x0002),
    fault=StatusPattern(0x0008, 0x0008))
UNSEEN = ControlTable(parameter='control_word', disable=OFF, enable=RUN)
JUDGED = Judged(0.02)
WEARS = Judged(0.02, wears=True)
ACKNOWLEDGED = Acknowledged()
#: ms after which a word is written again
AGAIN = [round(1000 * after) for after in written_again()]


def schedule(count: int, *, slot: int | None = None, refresh: float = 0.0) -> AcyclicOutput:
    return AcyclicOutput(None, JUDGED, count, slot=slot, refresh=refresh)


def machine(*statuses: int) -> ControlMachine:
    """Return a machine whose drive has got ``disable`` and reported since."""
    control = ControlMachine(TABLE, timeout=2.0)
    control.word_sent(9.0)
    for status in statuses:
        control.status_received(status, 9.0)
    return control


def ask(control: ControlMachine, action: ControlAction) -> None:
    control.request(ControlRequest(action), 10.0)


def tell(output: AcyclicOutput, control: ControlMachine, now: float) -> None:
    """Let the current word go out, and arrive."""
    word = control.word
    output.word_begun(word)
    assert not output.word_due(now), 'not before it has left'
    assert output.word_left(now, word)


def repeats(policy: Policy, control: ControlMachine, *statuses: int) -> list[int]:
    """Return when the word is written again within 10 s, in ms, while a drive reports that."""
    output, word = AcyclicOutput(control, policy, 0), control.word
    tell(output, control, 10.0)
    again = []
    for tick in range(1, 1000):
        now = 10.0 + tick / 100
        for status in statuses:
            control.status_received(status, now)
        if control.word != word:
            break
        if output.word_due(now):
            again.append(tick * 10)
            tell(output, control, now)
    return again


# -- setpoints ------------------------------------------------------------------------------------


def test_setpoints_are_written_on_change_and_again_after_a_while() -> None:
    writes = schedule(2, refresh=0.5)
    writes.collect_due([0, 7], 10.0)
    assert [writes.next(), writes.next()] == [0, 1]
    assert not writes.waiting
    writes.written(0, 0, 10.0)
    writes.written(1, 7, 10.001)
    writes.collect_due([0, 7], 10.4)
    assert not writes.waiting
    writes.collect_due([0, 8], 10.42)
    writes.collect_due([0, 8], 10.44)
    assert writes.next() == 1
    writes.written(1, 8, 10.44)
    writes.collect_due([0, 8], 10.5)
    assert writes.next() == 0
    assert not writes.waiting


def test_one_may_go_before_the_others() -> None:
    writes = schedule(3, slot=2)
    writes.order_word(first=True)
    writes.collect_due([1, 2, 3], 10.0)
    writes.order_word(first=True)
    assert [writes.next(), writes.next(), writes.next()] == [2, 0, 1]


def test_one_may_go_behind_the_others() -> None:
    writes = schedule(3, slot=0)
    writes.collect_due([1, 2, 3], 10.0)
    writes.order_word(first=False)
    assert [writes.next(), writes.next(), writes.next()] == [1, 2, 0]


def test_without_refresh_only_changes_are_written() -> None:
    writes = schedule(1)
    writes.collect_due([3], 10.0)
    writes.written(writes.next(), 3, 10.0)
    writes.collect_due([3], 1e6)
    assert not writes.waiting


def test_what_failed_and_what_was_forgotten_is_due_again() -> None:
    writes = schedule(2)
    writes.collect_due([1, 2], 10.0)
    writes.written(writes.next(), 1, 10.0)
    index = writes.next()
    writes.failed(index)
    writes.collect_due([1, 2], 10.1)
    assert writes.next() == 1
    assert not writes.waiting
    writes.written(1, 2, 10.1)
    writes.forget()
    writes.collect_due([1, 2], 10.2)
    assert [writes.next(), writes.next()] == [0, 1]


def test_everything_may_be_written_whether_it_has_changed_or_not() -> None:
    writes = schedule(2)
    writes.collect_due([1, 2], 10.0)
    for index, raw in ((0, 1), (1, 2)):
        writes.written(index, raw, 10.0)
    writes.write_all()
    writes.collect_due([1, 2], 10.1, hold=[0])
    assert (writes.next(), writes.waiting) == (1, 0)


# -- setpoints before a word that starts ----------------------------------------------------------


def test_all_setpoints_are_written_again_right_before_enable() -> None:
    control = machine(STANDING)
    output = AcyclicOutput(control, JUDGED, 3, slot=1)
    output.collect_due([0, OFF, 0], 10.0)
    for index in range(3):
        output.written(index, 0, 10.0)
    assert not output.holds_word(), 'nothing starts'
    ask(control, ControlAction.ENABLE)
    assert control.word == RUN
    assert output.holds_word()
    output.collect_due([0, RUN, 0], 10.1, hold=[1])
    assert [output.next(), output.next()] == [0, 2]
    assert not output.has(1), 'that is the word'
    assert not output.has(0)
    assert output.holds_word()
    output.restart()
    assert output.holds_word(), 'nobody knows whether the drive was there to hear it'
    assert [output.has(2), output.has(0)] == [False, True]
    assert not output.holds_word()
    ask(control, ControlAction.DISABLE)
    assert not output.holds_word(), 'a stop waits for nothing'
    output.written(1, OFF, 10.2)
    assert output.word_left(10.2, OFF)
    control.status_received(STANDING, 10.3)
    ask(control, ControlAction.ENABLE)
    assert output.holds_word(), 'every time'


# -- the control word -----------------------------------------------------------------------------


def test_a_stop_of_which_the_drive_takes_no_notice_is_written_ever_more_seldom() -> None:
    for policy in (JUDGED, ACKNOWLEDGED):
        assert repeats(policy, machine(ENABLED), ENABLED) == [
            200, 600, 1400, 3000, 5000, 7000, 9000]
        assert repeats(policy, machine(STANDING), STANDING) == []
        assert repeats(policy, machine(STANDING)) == [], 'nobody reports'


def test_an_eeprom_gets_a_stop_again_a_few_times_and_late() -> None:
    again = repeats(WEARS, machine(ENABLED), ENABLED)
    assert len(again) == 3
    assert again[0] >= 1000, 'not before it runs on for 2 s, from 9 s on, although it shall not'
    assert repeats(WEARS, machine(STANDING), STANDING) == []


@pytest.mark.parametrize(('policy', 'again'), [
    (JUDGED, AGAIN), (WEARS, []), (ACKNOWLEDGED, [])])
def test_what_starts_a_drive_is_repeated_only_where_nobody_acknowledges_it(
        policy: Policy, again: list[int]) -> None:
    control = machine(STANDING)
    ask(control, ControlAction.ENABLE)
    assert repeats(policy, control, STANDING) == again
    assert (control.word, control.operating) == (OFF, False), 'after 2 s the request has failed'


def test_a_drive_at_fault_that_ran_gets_disable_three_times_more() -> None:
    control = machine(STANDING)
    ask(control, ControlAction.ENABLE)
    output = AcyclicOutput(control, JUDGED, 0)
    tell(output, control, 10.0)
    control.status_received(FAULT, 10.0)
    assert control.word == OFF
    again = []
    for tick in range(1000):
        now = 10.01 + tick / 100
        control.status_received(FAULT, now)
        if tick == 0 or output.word_due(now):
            again.append(tick * 10)
            tell(output, control, now)
    assert again == [0, *AGAIN]


@pytest.mark.parametrize(('policy', 'again'), [
    (JUDGED, AGAIN), (WEARS, []), (ACKNOWLEDGED, [])])
def test_a_drive_that_ran_and_reports_nothing_gets_its_stop_three_times_more(
        policy: Policy, again: list[int]) -> None:
    control = ControlMachine(UNSEEN, timeout=2.0)
    control.word_sent(9.0)
    assert repeats(policy, control) == [], 'it did not run'
    ask(control, ControlAction.ENABLE)
    output = AcyclicOutput(control, policy, 0)
    tell(output, control, 10.0)
    assert output.again_at == math.inf, 'that is not repeated'
    ask(control, ControlAction.DISABLE)
    tell(output, control, 10.0)
    last_written = []
    while output.again_at < math.inf:
        now = output.again_at
        assert output.handle_timer(now)
        assert output.word_due(now)
        last_written.append(round(1000 * (now - 10.0)))
        tell(output, control, now)
    assert last_written == again


def test_a_pulse_leaves_as_often_as_it_has_to() -> None:
    control = machine(FAULT)
    ask(control, ControlAction.RESET_FAULT)
    output = AcyclicOutput(control, JUDGED, 1, slot=0)
    *_, last = times = [10.0 + 0.02 * number for number in range(RESET_CYCLES)]
    for now in times:
        assert control.word == RESET
        output.collect_due([RESET], now)
        assert output.next() == 0
        output.written(0, RESET, now)
        assert output.word_left(now, RESET)
        due = output.again_at
        assert due == (math.inf if now == last else pytest.approx(now + 0.02))
        assert not output.handle_timer(now + 0.01)
        assert output.handle_timer(now + 0.021) is (now < last)
    assert control.word == OFF


def test_a_word_that_the_bus_refused_is_written_again_soon() -> None:
    output = AcyclicOutput(machine(STANDING), JUDGED, 0)
    output.word_begun(OFF)
    output.word_refused(RUN, 10.02)
    assert output.word == OFF, 'that was another one'
    output.word_refused(OFF, 10.02)
    assert (output.word, output.again_at) == (None, 10.02)
    output.word_begun(OFF)
    assert output.again_at == math.inf


def test_a_word_that_left_while_another_one_became_current_does_not_count() -> None:
    control = machine(STANDING)
    ask(control, ControlAction.ENABLE)
    output = AcyclicOutput(control, JUDGED, 0)
    output.word_begun(OFF)
    assert not output.word_left(10.0, OFF)
    assert control.word_due
    assert output.word_due(10.0), 'it was to follow, and never left'
    output.forget()
    assert not output.word_due(20.0)
