# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``~/quick_stop`` of drives without a control word, in all families that have such drives."""

from dataclasses import replace
from typing import Any

from builders import LIMIT, SPEED
from partners import Partner, PARTNERS, run
import pytest
from saying import says

from drive_can_bridge.core.control import ControlAction, ControlRequest
from drive_can_bridge.core.events import DriveState
from drive_can_bridge.core.setpoints import CommandOutcome

TORQUE = replace(LIMIT, neutral=100.0, limit=True)
NAMES = sorted(name for name, partner in PARTNERS.items() if not partner.words)     # not built in


def meet(name: str, **options: Any) -> Partner:
    partner = PARTNERS[name](**options)
    if len(options.get('request', ())) == 2:
        partner.registers[123] = 51
    partner.start()
    assert partner.talk.session.online
    partner.talk.events()
    return partner


def stop(partner: Partner, action: ControlAction = ControlAction.QUICK_STOP) -> None:
    partner.talk.now = partner.now
    partner.talk.session.services.submit(ControlRequest(action), partner.now)
    partner.deliver(partner.talk.sent())


def told(partner: Partner) -> list[tuple[bool, object]]:
    """Return what became of the requests since the last look."""
    return [(success, message) for _, success, message in partner.talk.control_outcomes()]


@pytest.mark.parametrize('name', NAMES)
class TestNeutral:

    def test_it_is_neutral_at_once_and_answered_when_the_drive_has_answered(
            self, name: str) -> None:
        partner = meet(name)
        run(partner)
        begun_at = partner.now
        partner.take()
        stop(partner)
        assert partner.talk.session.setpoints.at_rest
        partner.live(0.05)
        assert partner.registers[50] == 0
        sent = [at for at, text in partner.take() if partner.setpoints(text)]
        assert sent[0] < begun_at + 0.03
        partner.live(0.1)
        assert told(partner) == [(True, says('neutral_without_control'))]
        assert partner.talk.session.state is DriveState.NOT_ARMED

    def test_no_command_goes_through_meanwhile_and_neutral_arms_again(self, name: str) -> None:
        partner = meet(name, rearm_immediate=True)
        run(partner)
        partner.deaf = True
        stop(partner)
        for _ in range(2):
            assert partner.talk.commands(0, 50.0, partner.now) is CommandOutcome.NOT_ARMED
        assert partner.talk.session.setpoints.at_rest
        partner.deaf = False
        partner.live(0.3)
        assert told(partner) == [(True, says('neutral_without_control'))]
        assert partner.registers[50] == 0
        assert partner.talk.commands(0, 50.0, partner.now) is CommandOutcome.ARMED

    def test_several_are_answered_together(self, name: str) -> None:
        partner = meet(name)
        run(partner)
        for _ in range(3):
            stop(partner)
        partner.live(0.2)
        assert told(partner) == [(True, says('neutral_without_control'))] * 3

    def test_a_drive_that_stands_is_asked_too(self, name: str) -> None:
        """Somebody else may have told it to run."""
        partner = meet(name, refresh_interval=30.0) if name != 'datamodel_extended' else meet(name)
        partner.live(0.1)
        partner.registers[50] = 77
        stop(partner)
        partner.live(0.2)
        assert told(partner) == [(True, says('neutral_without_control'))]
        assert partner.registers[50] == 0

    def test_a_drive_that_does_not_answer_is_no_success(self, name: str) -> None:
        partner = meet(name, missed_limit=1000, control_timeout=0.5)
        run(partner)
        partner.deaf = True
        stop(partner)
        assert told(partner) == []
        partner.live(1.0)
        assert told(partner) == [(False, says('may_still_be_running',
                                              why=says('neutral_unanswered', timeout=0.5)))]

    def test_a_drive_that_is_lost_meanwhile_is_no_success(self, name: str) -> None:
        partner = meet(name)
        run(partner)
        partner.deaf = True
        stop(partner)
        partner.live(1.9)
        (success, _), = told(partner)
        assert not success
        assert not partner.talk.session.online

    def test_offline_and_inactive_refuse(self, name: str) -> None:
        partner = meet(name)
        partner.deaf = True
        partner.live(1.0)
        stop(partner)
        assert told(partner) == [(False, says('drive_offline'))]
        partner.talk.bus_down(partner.now)
        stop(partner)
        assert told(partner) == [(False, says('bus_down'))]
        partner.deliver(partner.talk.deactivate(partner.now))
        stop(partner)
        assert told(partner) == [(False, says('bridge_inactive'))]

    def test_the_end_of_the_bridge_ends_it(self, name: str) -> None:
        partner = meet(name)
        run(partner)
        partner.deaf = True
        stop(partner)
        partner.deliver(partner.talk.deactivate(partner.now))
        assert told(partner) == [(False, says('bridge_inactive'))]

    def test_a_limit_stays(self, name: str) -> None:
        partner = meet(name, request=(SPEED, TORQUE))
        partner.talk.commands(1, 30.0, partner.now)
        run(partner)
        stop(partner)
        partner.live(0.2)
        assert told(partner) == [(True, says('neutral_without_control'))]
        assert (partner.registers[50], partner.registers[51]) == (0, 300)

    @pytest.mark.parametrize('request_', [(), (TORQUE,)])
    def test_nothing_is_commanded(self, name: str, request_: Any) -> None:
        partner = PARTNERS[name](request=request_)
        partner.registers[122] = 51 if request_ else 0
        partner.start()
        stop(partner)
        assert told(partner) == [(True, says('nothing_commanded'))]

    def test_other_control_is_refused(self, name: str) -> None:
        partner = meet(name)
        for action in (ControlAction.ENABLE, ControlAction.DISABLE, ControlAction.RESET_FAULT):
            stop(partner, action)
            assert told(partner) == [(False, says('no_control_section'))]


def limited(name: str) -> Partner:
    """Have a drive run whose limit comes before its setpoint."""
    partner = meet(name, request=(TORQUE, SPEED), refresh_interval=0.33, command_timeout=0.0)
    for value in (0.0, 100.0):
        partner.talk.commands(1, value, partner.now)
    partner.live(0.1)
    assert partner.registers[50] == 1000
    return partner


@pytest.mark.parametrize('name', ['canopen_pkw', 'datamodel_standard'])
def test_a_limit_is_not_written_by_it(name: str) -> None:
    partner = limited(name)
    partner.registers[51] = 7       # by somebody else
    stop(partner)
    partner.live(0.03)
    assert told(partner) == [(True, says('neutral_without_control'))]
    assert (partner.registers[50], partner.registers[51]) == (0, 7)


@pytest.mark.parametrize('due', [False, True])
def test_no_limit_goes_before_it(due: bool) -> None:
    """Of a device that has lost its voice, each answer is waited for."""
    partner = limited('canopen_pkw')
    if due:     # it is to be written again with the next round
        partner.take()
        partner.live(0.35)
        written_at, = (at for at, text in partner.take() if text.startswith('501#3300'))
        partner.live(written_at + 0.331 - partner.now)
    partner.take()
    partner.deaf = True
    begun_at = round(partner.now, 6)
    stop(partner)
    partner.live(0.06)
    (at, text), *_ = partner.take()
    assert (at, partner.setpoints(text)) == (begun_at, [0])


def test_a_write_that_the_drive_refuses_is_no_success() -> None:
    partner = meet('canopen_pkw')
    run(partner)
    del partner.registers[50]
    stop(partner)
    partner.live(0.3)
    (success, message), = told(partner)
    assert not success
    assert message == says('may_still_be_running', why=says('write_refused'))


def test_an_answer_that_runs_behind_does_not_count() -> None:
    """That to the cycle before: the drive has not heard of the stop yet."""
    partner = meet('datamodel_extended', period=0.1)
    run(partner)
    partner.live(0.1)
    partner.deaf = True
    partner.live(0.1)       # this cycle is answered late
    late = [text for _, text in partner.take() if partner.setpoints(text)][-1]
    stop(partner)
    partner.live(0.02)
    assert [text for _, text in partner.take() if partner.setpoints(text)], 'brought forward'
    for answer in partner.answers(late):
        partner.deliver(partner.talk.hears(answer, partner.now))
    assert told(partner) == []
    partner.deaf = False
    partner.live(0.3)
    assert told(partner) == [(True, says('neutral_without_control'))]
