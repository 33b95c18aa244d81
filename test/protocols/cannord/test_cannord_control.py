# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Control word and status word of one inverter: every way through the states."""

from cannord_session_builders import (
    enabled, exchange, FAULT, online, READY, RUNNING, STANDING, TICK,
)
from conversation import Conversation
import pytest
from saying import says, status_word

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.control_machine import RESET_CYCLES
from drive_can_bridge.core.events import DriveState, Noted
from drive_can_bridge.protocols.cannord.control_words import hint

ENABLE, DISABLE = ControlAction.ENABLE, ControlAction.DISABLE
QUICK_STOP, RESET_FAULT = ControlAction.QUICK_STOP, ControlAction.RESET_FAULT

DISABLED = '003#700B0000'
SWITCHED_ON = '003#330B0000'
BRAKING = '003#170B0010'
RAMPING_DOWN = '003#360F0010'
REACTION = '003#3F0B0010'
NOT_READY = '003#300B0000'


def words(talk: Conversation, now: float, *answers: str) -> list[str]:
    """Exchange every 20 ms; return the control words as they are sent."""
    return [exchange(talk, now + 0.02 * place, answer)[4:8]
            for place, answer in enumerate(answers)]


def running() -> Conversation:
    """Return a conversation with a drive that was enabled; the next cycle is due at 10.08 s."""
    talk = online()
    talk.asks(ENABLE, 10.003)
    assert words(talk, 10.02, READY, SWITCHED_ON, RUNNING) == ['7F04', '7F04', '7F04']
    assert talk.control_outcomes() == [('enable', True, 'operation enabled')]
    assert talk.session.control is not None
    assert talk.session.control.state == 'operation enabled'
    talk.events()
    return talk


def test_walk_from_switch_on_disabled() -> None:
    talk = online(DISABLED)
    talk.asks(ENABLE, 10.003)
    assert words(talk, 10.02, DISABLED, DISABLED, READY) == ['7E04'] * 3
    assert talk.control_outcomes() == []
    assert words(talk, 10.08, READY, SWITCHED_ON) == ['7F04', '7F04']
    assert talk.control_outcomes() == []
    assert words(talk, 10.12, RUNNING, RUNNING) == ['7F04', '7F04']
    assert talk.control_outcomes() == [('enable', True, 'operation enabled')]


def test_enable_sticks_and_says_where_and_why() -> None:
    talk = online('003#700D0000')
    talk.asks(ENABLE, 10.003)
    for place in range(1, 100):
        exchange(talk, 10.0 + 0.02 * place, '003#500D0000')
    assert talk.control_outcomes() == []
    talk.until(12.004)
    assert talk.control_outcomes() == [(
        'enable', False, says(
            'stuck', remarks=[says('quick_stop_active')], state='switch-on disabled',
            status=status_word(0x0D50), timeout=2.0))]


@pytest.mark.parametrize(('status', 'what'), [
    (0x0B60, 'voltage is disabled'), (0x0B50, 'quick stop is active'), (0x0970, 'P509'),
    (0x0B70, ''), (0x0B31, ''), (0x0000 | 8, '')])
def test_hints(status: int, what: str) -> None:
    assert (what in hint(status)) if what else hint(status) == ''


def test_disable_waits_until_the_output_is_off() -> None:
    talk = running()
    talk.asks(DISABLE, 10.07)
    assert words(talk, 10.08, RUNNING, RAMPING_DOWN) == ['7E04', '7E04']
    assert talk.control_outcomes() == []
    assert words(talk, 10.12, READY) == ['7E04']
    assert talk.control_outcomes() == [('disable', True, STANDING)]


def test_quick_stop_holds_its_word_until_the_drive_stands() -> None:
    talk = running()
    talk.asks(QUICK_STOP, 10.07)
    assert words(talk, 10.08, RUNNING, BRAKING, BRAKING) == ['7A04'] * 3
    assert talk.session.control is not None
    assert talk.session.control.state == 'quick stop'
    assert talk.control_outcomes() == []
    assert words(talk, 10.14, '003#500B0000', DISABLED) == ['7A04', '7E04']
    assert talk.control_outcomes() == [('quick_stop', True, 'switch-on disabled')]
    talk.asks(ENABLE, 10.17)
    assert words(talk, 10.18, READY, RUNNING) == ['7E04', '7F04']
    assert talk.control_outcomes() == [('enable', True, 'operation enabled')]


def test_a_fault_told_unasked_disables_with_the_next_frame() -> None:
    talk = running()
    talk.hears(FAULT, 10.065)
    assert talk.session.state is DriveState.FAULT
    assert talk.events(Noted) == [
        Noted(says('fault_came', ran=True, status=status_word(0x0B38)), warning=True)]
    assert words(talk, 10.08, FAULT) == ['7E04']
    talk.asks(ENABLE, 10.09)
    assert talk.control_outcomes() == [('enable', False, says('reset_first'))]


def test_reset_is_a_rising_edge() -> None:
    talk = online(FAULT)
    talk.asks(RESET_FAULT, 10.003)
    assert words(talk, 10.02, FAULT, DISABLED, DISABLED) == ['FE04'] * 3
    assert talk.control_outcomes() == []
    assert words(talk, 10.08, DISABLED, READY) == ['7E04', '7E04']
    assert talk.control_outcomes() == [('reset_fault', True, 'switch-on disabled')]
    assert talk.session.state is not DriveState.FAULT


def test_reset_waits_for_the_end_of_the_fault_reaction() -> None:
    talk = online(REACTION)
    assert talk.session.state is DriveState.FAULT
    talk.asks(RESET_FAULT, 10.003)
    assert words(talk, 10.02, REACTION, REACTION, FAULT, FAULT,
                 *[DISABLED] * (RESET_CYCLES - 1), READY) == [
        *['7E04'] * 3, *['FE04'] * RESET_CYCLES, '7E04']
    assert talk.control_outcomes() == [('reset_fault', True, STANDING)]


def test_reset_pulse_hurries_where_the_period_is_long() -> None:
    talk = online(FAULT, period=0.5)
    talk.asks(RESET_FAULT, 10.003)
    sent = [(now, text[4:8]) for now, text in talk.until(10.44 + 0.1 * RESET_CYCLES)]
    assert [word for _, word in sent] == [*['FE04'] * RESET_CYCLES, '7E04']
    times = [now for now, _ in sent]
    assert times == pytest.approx([
        *(10.5 + 0.1 * n for n in range(RESET_CYCLES)), 10.405 + 0.1 * RESET_CYCLES])


@pytest.mark.parametrize(('status', 'state'), [(BRAKING, 'quick stop'), (NOT_READY, 'not ready')])
def test_a_drive_that_drops_out_by_itself_is_not_started_again(status: str, state: str) -> None:
    talk = running()
    assert words(talk, 10.08, status, RUNNING) == ['7F04', '7E04']
    note, = talk.events(Noted)
    assert note.text == says('dropped_out_for_good')
    assert words(talk, 10.12, status) == ['7E04']
    assert talk.session.control is not None
    assert talk.session.control.state == state


def test_parameter_set_is_in_every_word() -> None:
    talk = online(READY, parameter_set=3)
    talk.asks(ENABLE, 10.003)
    assert words(talk, 10.02, READY, RUNNING) == ['7F84', '7F84']
    talk.asks(QUICK_STOP, 10.05)
    assert words(talk, 10.06, FAULT, FAULT) == ['7A84', '7E84']
    talk.asks(RESET_FAULT, 10.095)
    assert words(talk, 10.1, FAULT, *[READY] * RESET_CYCLES) == [
        *['FE84'] * RESET_CYCLES, '7E84']


# -- asked again for a stop -----------------------------------------------------------------------


def test_the_error_of_a_drive_that_runs_on_stands_while_somebody_asks_again() -> None:
    """It takes no notice of 047Eh; every 1.1 s somebody asks, between a cycle and its answer."""
    talk = enabled(control_timeout=1.0)
    control = talk.session.control
    assert control is not None
    hidden, asks_at = [], 10.041
    for cycle in range(500):
        now = round(10.04 + 0.02 * cycle, 6)
        talk.until(now + TICK)
        if asks_at < now + 0.002:
            talk.asks(DISABLE, now + 0.001)
            asks_at = round(asks_at + 1.1, 6)
        talk.hears(RUNNING, now + 0.002)
        if now > 11.3 and not control.disregard:    # told to stop 1.2 s ago
            hidden.append(now)
    assert hidden == []


def test_a_quick_stop_that_is_asked_for_again_has_its_time() -> None:
    """The inverter brakes for 2.2 s; control_timeout is 1 s."""
    talk = enabled(control_timeout=1.0)
    outcomes = []
    for cycle in range(160):
        now = round(10.04 + 0.02 * cycle, 6)
        talk.until(now + TICK)
        talk.hears(BRAKING if now < 12.25 else DISABLED, now + 0.002)
        if now in (10.06, 12.0):
            talk.asks(QUICK_STOP, now + 0.003)
        outcomes += [(now, action, success) for action, success, _ in talk.control_outcomes()]
    assert [outcome[1:] for outcome in outcomes] == [
        ('quick_stop', False), ('quick_stop', True)], outcomes
