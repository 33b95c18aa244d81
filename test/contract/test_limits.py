# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What bounds a drive and moves nothing (``limit: true``), in all families."""

from dataclasses import replace
import math
from typing import Any

from builders import CONTROL, LIMIT, SPEED
from partners import Partner, PARTNERS, run, warnings
import pytest

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.events import DriveState, SetpointsExpired, StationLost
from drive_can_bridge.core.setpoints import CommandOutcome

TORQUE = replace(LIMIT, neutral=100.0, limit=True)
#: without a control word where a family has none of its own; and with one of the profile
KINDS = [*((name, None) for name in sorted(PARTNERS)),
         *((name, CONTROL) for name in sorted(PARTNERS) if name != 'cannord')]


def meet(name: str, **options: Any) -> Partner:
    """Have a drive online that gets a speed, and a torque limit."""
    partner = PARTNERS[name](request=(SPEED, TORQUE), **options)
    if name == 'datamodel_extended':
        partner.registers[123] = 51
    partner.start()
    assert partner.talk.session.online
    return partner


def limits(partner: Partner, value: float) -> CommandOutcome:
    """Command the limit."""
    return partner.talk.commands(1, value, partner.now)


@pytest.fixture(params=KINDS, name='partner')
def _partner(request: pytest.FixtureRequest) -> Partner:
    name, control = request.param
    return meet(name, control=control)


class TestInEveryState:

    def test_it_begins_with_neutral_and_needs_no_arming(self, partner: Partner) -> None:
        assert partner.registers[51] == 1000
        waiting = partner.talk.session.setpoints.waiting
        assert [setpoint.parameter for setpoint in waiting] == [partner.own(SPEED)]

    def test_commands_are_taken_while_nothing_is_armed_or_enabled(self, partner: Partner) -> None:
        assert limits(partner, 30.0) is CommandOutcome.ACCEPTED
        partner.live(0.1)
        assert partner.registers[51] == 300
        assert partner.registers[50] == 0
        assert partner.talk.session.state in (DriveState.NOT_ARMED, DriveState.DISABLED)
        assert partner.talk.session.setpoints.ignored_at == -math.inf

    def test_the_last_one_stands_and_is_not_written_by_a_stop(self, partner: Partner) -> None:
        limits(partner, 30.0)
        partner.live(3.0)
        assert partner.registers[51] == 300
        assert partner.talk.events(SetpointsExpired) == []
        assert math.isnan(partner.talk.session.setpoints.age(partner.now))
        partner.ends(1.0)
        assert partner.registers[51] == 300

    def test_the_next_activation_begins_with_neutral(self, partner: Partner) -> None:
        limits(partner, 30.0)
        partner.live(0.1)
        partner.ends(1.0)
        assert limits(partner, 50.0) is not CommandOutcome.ACCEPTED
        partner.deliver(partner.talk.activate(partner.now))
        partner.live(0.3)
        assert partner.registers[51] == 1000

    def test_after_a_loss_the_last_one_is_sent(self, partner: Partner) -> None:
        partner.deaf = True
        partner.live(1.0)
        assert len(partner.talk.events(StationLost)) == 1
        assert limits(partner, 30.0) is CommandOutcome.ACCEPTED
        partner.talk.bus_down(partner.now)
        partner.registers[51] = 7       # whoever had it meanwhile
        assert limits(partner, 40.0) is CommandOutcome.ACCEPTED
        partner.deaf = False
        partner.deliver(partner.talk.bus_up(partner.now))
        partner.live(1.0)
        assert partner.talk.session.online
        assert partner.registers[51] == 400

    def test_it_is_no_part_of_what_a_drive_runs_by(self, partner: Partner) -> None:
        limits(partner, 30.0)
        partner.live(0.1)
        session = partner.talk.session
        assert not session.duty.stop_pending
        assert session.setpoints.at_rest

    @pytest.mark.parametrize('value', [30.0, 100.0, 50.0])
    def test_old_commands_change_nothing(self, partner: Partner, value: float) -> None:
        """Not even one that equals neutral."""
        limits(partner, 30.0)
        partner.talk.session.setpoints.old_command(1, value)
        partner.live(0.1)
        assert partner.registers[51] == 300

    def test_a_value_that_cannot_be_sent_changes_nothing(self, partner: Partner) -> None:
        limits(partner, 30.0)
        with pytest.raises(ValueRefused):
            limits(partner, 300.1)
        partner.live(0.1)
        assert partner.registers[51] == 300


@pytest.mark.parametrize('name', sorted(PARTNERS))
def test_a_drive_that_runs_keeps_it_to_its_last_frame(name: str) -> None:
    """It may need that torque to brake."""
    partner = meet(name)
    partner.enable()
    limits(partner, 30.0)
    run(partner)
    assert partner.registers[51] == 300
    partner.live(2.0)                   # the command has expired
    assert (partner.registers[50], partner.registers[51]) == (0, 300)
    run(partner)
    partner.ends(1.0)
    assert (partner.registers[50], partner.registers[51]) == (0, 300)


@pytest.mark.parametrize('name', ['canopen_pkw', 'datamodel_standard'])
def test_a_stop_by_number_leaves_it_alone(name: str) -> None:
    partner = meet(name)
    limits(partner, 30.0)
    run(partner)
    partner.registers[51] = 7
    partner.ends(1.0)
    assert (partner.registers[50], partner.registers[51]) == (0, 7)
    assert warnings(partner) == []


def test_a_drive_whose_maps_differ_is_stopped_without_it() -> None:
    partner = meet('datamodel_extended')
    limits(partner, 30.0)
    run(partner)
    partner.deaf = True
    partner.live(1.0)
    partner.deaf = False
    partner.registers[122], partner.registers[51] = 60, 7
    partner.registers[60] = 0
    partner.live(1.0)
    assert partner.talk.session.state is DriveState.MAPPING_DIFFERS
    assert (partner.registers[50], partner.registers[51]) == (0, 7)


def test_a_drive_with_nothing_but_a_limit_is_online_at_once() -> None:
    partner = PARTNERS['datamodel_standard'](request=(TORQUE,)).start()
    assert partner.talk.session.state is DriveState.ONLINE
    partner.ends(1.0)
