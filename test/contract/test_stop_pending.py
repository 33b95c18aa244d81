# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What every family owes a drive that was told to run: with a control word, and without.

The stories of ``stop_checker`` show that no motor runs on; these show that nothing is said without
need, that a word and its setpoints go at once, and who is answered what.
"""

from typing import Any

from builders import CONTROL, SPEED, WORD
from partners import Partner, PARTNERS, worries
import pytest
from saying import may_run, says

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import DriveState, Noted, StationLost
from drive_can_bridge.core.sentences import internal_error
from drive_can_bridge.core.setpoints import CommandOutcome

WORDLESS = [name for name, partner in sorted(PARTNERS.items()) if not partner.words]
#: a drive as it is, or with a control word that is written by number, or among its setpoints
KINDS: dict[str, tuple[str, dict[str, Any]]] = {
    **{name: (name, {}) for name in sorted(PARTNERS)},
    **{f'{name}, by number': (name, {'control': CONTROL}) for name in WORDLESS},
    **{f'{name}, with its setpoints': (name, {'control': CONTROL, 'request': (SPEED, WORD)})
       for name in WORDLESS}}
CONTROLLED = [kind for kind, (name, more) in KINDS.items() if more or name not in WORDLESS]
TABLED = [kind for kind, (_, more) in KINDS.items() if more]


class Obedient(dict[int, int]):
    """Registers whose status word follows the control word."""

    tripped = False

    def __getitem__(self, number: int) -> int:
        if number == 211:
            return 8 if self.tripped else 1 | 2 * (self.get(52) == 1)
        return super().__getitem__(number)


def meet(kind: str, **options: Any) -> Partner:
    """Return a drive that is online."""
    name, more = KINDS[kind]
    partner = PARTNERS[name](**{**more, **options})
    if more:
        partner.registers = partner.device.registers = Obedient(     # type: ignore[union-attr]
            {**partner.registers, 123: 52 * ('request' in more)})
    partner.start()
    partner.live(partner.configuration.period)
    assert partner.talk.session.online
    partner.talk.events()
    return partner


def enabled(kind: str, **options: Any) -> Partner:
    """Return one that takes commands."""
    partner = meet(kind, **options)
    if partner.talk.session.control is not None:
        asks(partner, ControlAction.ENABLE)
        partner.live(max(0.3, 6 * partner.configuration.period))
        assert [done[:2] for done in partner.talk.control_outcomes()] == [('enable', True)]
    assert partner.talk.session.state is DriveState.NOT_ARMED
    partner.talk.events()
    return partner


def running(kind: str, **options: Any) -> Partner:
    """Return one that runs, at 100 rpm."""
    partner = enabled(kind, **{'command_timeout': 0.0, **options}).commands(0.0, 100.0)
    partner.live(max(0.1, 2 * partner.configuration.period))
    assert partner.registers[50] == 1000
    partner.take()
    partner.talk.events()
    return partner


def asks(partner: Partner, action: ControlAction) -> None:
    partner.deliver(partner.talk.asks(action, partner.now))


# -- the stop -------------------------------------------------------------------------------------


@pytest.mark.parametrize('kind', KINDS)
def test_the_end_of_a_drive_that_runs_and_hears(kind: str) -> None:
    partner = running(kind)
    partner.ends()
    assert partner.registers[50] == 0
    assert worries(partner) == []
    control = partner.talk.session.control
    assert control is None or control.off
    partner.take()
    partner.live(5.0)
    assert partner.take() == []


@pytest.mark.parametrize('kind', KINDS)
def test_a_bus_that_goes_during_the_stop(kind: str) -> None:
    partner = running(kind)
    partner.deaf = True
    partner.deliver(partner.talk.deactivate(partner.now))
    partner.live(0.001)
    partner.talk.events()
    partner.talk.bus_down(partner.now)
    assert partner.talk.session.stopped
    assert worries(partner) == [may_run('bus_lost_before_stop')]
    partner.take()
    partner.deliver(partner.talk.bus_up(partner.now))
    partner.live(1.0)
    assert partner.take() == []


@pytest.mark.parametrize('kind', KINDS)
def test_a_stop_that_the_bus_refuses_for_a_while_goes_on(kind: str) -> None:
    partner = running(kind)
    partner.talk.refusing = lambda text: True
    partner.deliver(partner.talk.deactivate(partner.now))
    partner.live(0.09)
    assert not partner.talk.session.stopped
    partner.talk.refusing = lambda text: False
    partner.live(1.0)
    assert partner.talk.session.stopped
    assert partner.registers[50] == 0
    assert worries(partner) == []


@pytest.mark.parametrize('kind', KINDS)
def test_a_second_end_and_a_stall_meanwhile_change_nothing(kind: str) -> None:
    partner = running(kind)
    partner.deaf = True
    partner.deliver(partner.talk.deactivate(partner.now))
    partner.live(0.03)
    partner.deliver(partner.talk.deactivate(partner.now))
    partner.live(0.03)
    partner.now += 1.5
    partner.deliver(partner.talk.handle_stall(partner.now))
    assert partner.talk.commands(0, 100.0, partner.now) is not CommandOutcome.ACCEPTED
    partner.live(partner.talk.session.longest_stop + 0.5)
    assert partner.talk.session.stopped
    assert set(partner.commanded()) <= {0}
    assert len(worries(partner)) == 1
    assert partner.talk.deactivate(partner.now) == []


@pytest.mark.parametrize('kind', KINDS)
def test_a_silent_drive_that_ran_is_told_of_once(kind: str) -> None:
    partner = running(kind)
    partner.deaf = True
    partner.live(3.0)
    assert len(partner.talk.events(StationLost)) == 1
    partner.take()
    partner.live(20.0)
    assert set(partner.commanded()) <= {0}
    assert worries(partner) == []
    assert partner.talk.session.duty.stop_pending
    partner.deaf = False
    partner.live(2.0)
    assert partner.talk.session.online
    assert partner.registers[50] == 0
    assert not partner.talk.session.duty.stop_pending
    assert worries(partner) == []


@pytest.mark.parametrize('kind', KINDS)
def test_neutral_that_was_heard_is_a_stop(kind: str) -> None:
    partner = running(kind)
    if partner.talk.session.control is not None:
        asks(partner, ControlAction.DISABLE)
    else:
        partner.talk.commands(0, 0.0, partner.now)
    partner.live(0.5)
    partner.take()
    partner.talk.events()
    partner.talk.bus_down(partner.now)
    assert worries(partner) == []
    partner.deliver(partner.talk.bus_up(partner.now))
    partner.live(1.0)
    partner.ends()
    assert worries(partner) == []


@pytest.mark.parametrize('kind', KINDS)
def test_what_the_bus_refused_was_never_told(kind: str) -> None:
    partner = meet(kind) if kind in CONTROLLED else enabled(kind)
    partner.live(0.1)
    partner.talk.refusing = lambda text: True
    if kind in CONTROLLED:
        asks(partner, ControlAction.ENABLE)
    else:
        partner.commands(0.0, 100.0)
    partner.live(0.025)
    assert not partner.talk.session.duty.stop_pending
    partner.talk.bus_down(partner.now)
    assert worries(partner) == []


@pytest.mark.parametrize('kind', KINDS)
def test_an_activation_owes_nothing_of_the_one_before(kind: str) -> None:
    partner = running(kind)
    partner.talk.bus_down(partner.now)
    partner.deliver(partner.talk.deactivate(partner.now))
    assert len(worries(partner)) == 2
    partner.activate()
    assert not partner.talk.session.duty.stop_pending
    assert partner.talk.control_outcomes() == []
    partner.live(1.0)
    assert partner.talk.session.state is PARTNERS[KINDS[kind][0]].idle or kind in TABLED
    partner.talk.bus_down(partner.now)
    assert worries(partner) == []


def stopped_for_a_defect(kind: str, *, mute: bool) -> Partner:
    """Return one that ran, and whose stop for a defect has ended."""
    partner = running(kind)
    session = partner.talk.session
    partner.deaf = mute
    session.fail(internal_error('KeyError', 'x'), partner.now)
    partner.deliver(partner.talk.sent())
    partner.live(session.longest_stop + 0.5)
    assert session.stopped
    return partner


@pytest.mark.parametrize('kind', KINDS)
def test_a_stop_that_failed_for_a_defect_stays_pending(kind: str) -> None:
    """The activation goes on behind it: the drive is told again, and named again at the end."""
    partner = stopped_for_a_defect(kind, mute=True)
    session = partner.talk.session
    assert worries(partner)
    assert session.stop_pending
    session.recover(partner.now)
    partner.deliver(partner.talk.sent())
    partner.live(2.0)
    assert session.stop_pending
    partner.talk.events()
    partner.ends()
    assert len(worries(partner)) == 1


@pytest.mark.parametrize('kind', KINDS)
def test_a_pending_stop_behind_a_defect_is_sent_again_by_the_end(kind: str) -> None:
    """Also within the second for which it is left alone: it may hear this one."""
    partner = stopped_for_a_defect(kind, mute=True)
    session = partner.talk.session
    assert session.stop_pending
    partner.deaf = False
    partner.talk.events()
    partner.ends()
    assert partner.registers[50] == 0
    assert worries(partner) == []
    assert not session.stop_pending


@pytest.mark.parametrize('kind', KINDS)
def test_a_pending_stop_of_a_deaf_drive_behind_a_defect_is_named_once_more(kind: str) -> None:
    partner = stopped_for_a_defect(kind, mute=True)
    partner.talk.events()
    partner.take()
    partner.ends()
    assert partner.take() != []
    assert len(worries(partner)) == 1


@pytest.mark.parametrize('kind', KINDS)
def test_a_drive_without_a_pending_stop_is_left_alone_behind_a_defect(kind: str) -> None:
    partner = stopped_for_a_defect(kind, mute=False)
    session = partner.talk.session
    assert not session.stop_pending
    partner.take()
    partner.ends()
    assert partner.take() == []
    assert worries(partner) == []


@pytest.mark.parametrize('kind', KINDS)
def test_behind_the_end_a_bridge_is_inactive_whatever_the_defect_was(kind: str) -> None:
    partner = meet(kind)
    session = partner.talk.session
    session.fail(internal_error('KeyError', 'x'), partner.now)
    refuses = session.services.control_refusal
    assert refuses(ControlAction.QUICK_STOP).code == 'internal_error'
    partner.ends()
    assert refuses(ControlAction.QUICK_STOP).code == 'bridge_inactive'


# -- control --------------------------------------------------------------------------------------


@pytest.mark.parametrize('immediate', [False, True])
@pytest.mark.parametrize('kind', CONTROLLED)
def test_what_was_left_standing_does_not_move_it_when_it_is_enabled(
        kind: str, immediate: bool) -> None:
    partner = meet(kind, rearm_immediate=immediate)
    assert partner.talk.session.state is DriveState.DISABLED
    for _ in range(10):     # somebody goes on publishing
        assert partner.talk.commands(0, 100.0, partner.now) is CommandOutcome.DISABLED
        partner.live(0.004)
    asks(partner, ControlAction.ENABLE)
    assert partner.talk.commands(0, 100.0, partner.now) is CommandOutcome.DISABLED
    partner.live(0.3)
    assert [done[:2] for done in partner.talk.control_outcomes()] == [('enable', True)]
    assert partner.talk.session.state is DriveState.NOT_ARMED
    assert set(partner.commanded()) <= {0}
    assert partner.talk.commands(0, 100.0, partner.now) is (
        CommandOutcome.ARMED if immediate else CommandOutcome.NOT_ARMED)


@pytest.mark.parametrize('action', [ControlAction.DISABLE, ControlAction.QUICK_STOP])
@pytest.mark.parametrize('kind', CONTROLLED)
def test_a_stop_disarms_and_goes_at_once(kind: str, action: ControlAction) -> None:
    """With its setpoints, however long the period is."""
    more = {} if KINDS[kind][0] not in ('canopen_pkw', 'datamodel_standard') else {
        'refresh_interval': 30.0}       # which would bring neutral as well
    partner = running(kind, period=0.5, control_timeout=5.0, **more)
    partner.live(0.1)
    asked = partner.now
    asks(partner, action)
    assert partner.talk.commands(0, 100.0, partner.now) is CommandOutcome.DISABLED
    partner.live(0.1)
    told = [(at, raw) for at, text in partner.take() for raw in partner.setpoints(text)
            if at >= asked]
    assert [raw for _, raw in told] and {raw for _, raw in told} == {0}
    assert partner.registers[50] == 0
    partner.live(2.0)
    assert [done[:2] for done in partner.talk.control_outcomes()] == [(action.value, True)]
    assert partner.talk.session.state is DriveState.DISABLED


@pytest.mark.parametrize('kind', CONTROLLED)
def test_an_end_that_was_wanted_is_no_warning(kind: str) -> None:
    partner = running(kind)
    partner.ends()
    noted = [note for note in partner.talk.events(Noted) if note.text == says('enable_withdrawn')]
    assert [note.warning for note in noted] == [False]


@pytest.mark.parametrize('kind', CONTROLLED)
def test_who_is_refused(kind: str) -> None:
    name, more = KINDS[kind]
    partner = PARTNERS[name](**more)
    talk, refusal = partner.talk, partner.talk.session.services.control_refusal
    assert refusal(ControlAction.ENABLE) == says('bridge_inactive')
    talk.activate(2.0)
    assert refusal(ControlAction.ENABLE) == says('bus_down')
    talk.bus_up(3.0)
    assert refusal(ControlAction.ENABLE) == says('drive_offline')


@pytest.mark.parametrize('kind', TABLED)
def test_a_trip_ends_it(kind: str) -> None:
    partner = running(kind)
    registers = partner.registers
    assert isinstance(registers, Obedient)
    registers.tripped = True
    partner.live(0.1)
    assert partner.talk.session.state is DriveState.FAULT
    assert [note.text for note in partner.talk.events(Noted)] == [
        says('fault_came', ran=True, status=says('status_word', raw=8))]
    assert (registers[50], registers[52]) == (0, 0)
    asks(partner, ControlAction.ENABLE)
    assert partner.talk.control_outcomes() == [('enable', False, says('reset_first'))]
    registers.tripped = False
    partner.take()
    partner.live(1.0)
    assert (registers[50], registers[52]) == (0, 0)
    assert partner.talk.session.state is DriveState.DISABLED


@pytest.mark.parametrize('kind', TABLED)
def test_an_enable_that_is_not_followed_is_taken_back(kind: str) -> None:
    partner = meet(kind, control_timeout=0.3)
    registers = partner.registers
    asked = partner.now
    partner.device.registers = partner.registers = dict(registers)   # type: ignore[union-attr]
    partner.registers[211] = 1
    asks(partner, ControlAction.ENABLE)
    partner.live(asked + 0.299 - partner.now)
    assert partner.talk.control_outcomes() == []
    partner.live(0.002)
    assert partner.talk.control_outcomes() == [
        ('enable', False, says('stuck', timeout=0.3, state='ready'))]
    partner.live(0.1)
    assert partner.registers[52] == 0
