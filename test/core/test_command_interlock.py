# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Commands reach a drive that is there and operates; everything is neutral otherwise."""

from builders import CONTROL, SPEED, STATUS
import pytest
from saying import says

from drive_can_bridge.core.command_interlock import CommandInterlock
from drive_can_bridge.core.control import ControlAction, ControlRequest
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.events import DriveState, Noted, SetpointsExpired
from drive_can_bridge.core.messages import NOTHING
from drive_can_bridge.core.reporter import Reporter
from drive_can_bridge.core.setpoints import CommandOutcome, Setpoints
from drive_can_bridge.core.statistics import DriveStatistics

READY, ENABLED, FAULT = 1, 3, 8


class Stand:
    """A interlock, and what stands around it."""

    def __init__(self, *, controlled: bool = True, led: bool = False) -> None:
        self.active = self.online = True
        self.error = NOTHING
        self.setpoints = Setpoints((SPEED,), timeout=0.5, rearm_immediate=True)
        self.control = ControlMachine(CONTROL, timeout=2.0) if controlled else None
        self.leader = ControlMachine(CONTROL, timeout=2.0) if led else None
        self.report = Reporter(DriveStatistics(), '')
        self.interlock = CommandInterlock(
            self, self.setpoints, self.control, (STATUS,), self.report, self.leader)

    def enable(self, machine: ControlMachine | None) -> None:
        assert machine is not None
        machine.request(ControlRequest(ControlAction.ENABLE), 1.0)
        for status in (READY, ENABLED):
            machine.word_sent(1.0)
            machine.status_received(status, 1.0)
        self.interlock.follow()

    def command(self, value: float) -> CommandOutcome:
        return self.setpoints.command(0, value, 1.0)


def test_states_of_a_drive_with_control() -> None:
    stand = Stand()
    stand.online = False
    assert stand.interlock.state is DriveState.OFFLINE
    stand.online = True
    assert stand.interlock.state is DriveState.DISABLED
    stand.enable(stand.control)
    assert stand.interlock.state is DriveState.NOT_ARMED
    assert stand.command(5.0) is CommandOutcome.ARMED
    assert stand.interlock.state is DriveState.ONLINE
    assert stand.control is not None
    stand.control.status_received(FAULT, 1.0)
    stand.interlock.follow()
    assert stand.interlock.state is DriveState.FAULT
    assert stand.setpoints.at_rest, 'a fault takes commands back'


def test_a_drive_without_control_takes_commands_while_it_is_there() -> None:
    stand = Stand(controlled=False)
    for active, online in ((False, True), (True, False)):
        stand.active, stand.online = active, online
        stand.interlock.follow()
        assert stand.command(5.0) is CommandOutcome.NOT_ARMED
    stand.active = stand.online = True
    stand.interlock.follow()
    assert stand.command(5.0) is CommandOutcome.ARMED
    stand.interlock.withdraw('lost', 1.0)
    assert stand.setpoints.at_rest
    assert not stand.interlock.position_unknown, 'it has no axis that would go anywhere'


def test_a_drive_that_is_led_operates_with_its_leader() -> None:
    stand = Stand(led=True)
    stand.enable(stand.control)
    assert stand.interlock.state is DriveState.DISABLED
    stand.enable(stand.leader)
    assert stand.interlock.state is DriveState.NOT_ARMED


@pytest.mark.parametrize('active', [True, False])
def test_what_the_machine_notes_is_a_warning_unless_the_bridge_stops(active: bool) -> None:
    stand = Stand()
    stand.enable(stand.control)
    stand.active = active
    stand.interlock.withdraw('bridge inactive', 2.0)
    assert stand.report.take() == [Noted(
        says('enable_withdrawn', whom='the drive'),
        warning=active)]


def test_commands_that_nobody_repeats_go_neutral_and_are_told_of() -> None:
    stand = Stand(controlled=False)
    stand.interlock.follow()
    stand.command(5.0)
    assert not stand.interlock.expire(1.5)
    assert stand.interlock.expire(1.6)
    assert stand.setpoints.at_rest
    told, = stand.report.take()
    assert told == SetpointsExpired(('speed_setpoint',)) and not told.orderly


def test_whoever_ends_with_neutral_ends_in_order() -> None:
    stand = Stand(controlled=False)
    stand.interlock.follow()
    stand.command(5.0)
    stand.command(0.0)
    assert stand.interlock.expire(1.6) and stand.setpoints.at_rest
    assert not stand.setpoints.items[0].armed, 'it is disarmed all the same'
    told, = stand.report.take()
    assert told == SetpointsExpired(('speed_setpoint',)) and told.orderly
