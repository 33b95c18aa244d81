# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Broadcast groups: several inverters that are told the same.

Each cycle one broadcast frame carries control word and setpoints for all. Nobody answers it, so
one inverter of the group, in turn, also gets the frame to itself, and its answer brings its status
and actual values: with four inverters each is heard every fourth period.

The inverter with the lowest station leads. Its session sends everything and has the setpoints;
its services bring the whole group to a state. The sessions of the others receive, serve the
parameters of their inverter, and refuse what only the leader can do.

All sessions of a group live on one bus, under one lock, so that they may call each other.
"""

from collections.abc import Sequence
import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction, ControlMachine
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.requests import BRIDGE_INACTIVE
from drive_can_bridge.core.session import DRIVE_OFFLINE, STOP_CYCLES
from drive_can_bridge.core.setpoints import Setpoints
from drive_can_bridge.protocols.cannord.broadcast import broadcast_identifier
from drive_can_bridge.protocols.cannord.control import make_control
from drive_can_bridge.protocols.cannord.session import CannordSession, values_needed


def make_group(drives: Sequence[DriveConfiguration]) -> 'list[GroupSession]':
    """
    Make the sessions of a group.

    :param drives: the leader first.
    """
    places = max(values_needed(drive) for drive in drives)
    leader = LeaderSession(drives, places=places)
    members = [MemberSession(drive, leader, places=places) for drive in drives[1:]]
    leader.members = [leader, *members]
    for member in leader.members:
        member.partners = [other for other in leader.members if other is not member]
    return leader.members


class GroupSession(CannordSession):
    """What leader and members share: frames of a foreign master on the broadcast identifier."""

    def __init__(self, drive: DriveConfiguration, control: ControlMachine | None = None, *,
                 places: int) -> None:
        super().__init__(drive, control, places=places)
        self._broadcast = broadcast_identifier(drive) or 0

    def receive_frame(self, frame: Frame, now: float, age: float = 0.0) -> None:
        if frame.identifier == self._broadcast and frame.extended == self._extended:
            self._see_foreign_master(frame)
        else:
            super().receive_frame(frame, now, age)


class LeaderSession(GroupSession):
    """
    The session that sends for the whole group.

    :ivar members: all sessions of the group, this one first.
    """

    def __init__(self, drives: Sequence[DriveConfiguration], *, places: int) -> None:
        own = drives[0]
        self._group = make_control(
            parameter_set=own.options.parameter_set, timeout=own.control_timeout,
            members=[drive.name for drive in drives])
        super().__init__(own, self._group, places=places)
        self.members: list[GroupSession] = [self]
        self._turn = 0
        self._turn_begun = 0    # what it was when this cycle began

    # -- sending ----------------------------------------------------------------------------------

    def _transmit(self, now: float) -> None:
        self._turn_begun = self._turn
        self._put(self._broadcast)
        count = len(self.members)
        # a stop reaches also those that do not listen to broadcasts
        for _ in range(math.ceil(count / STOP_CYCLES) if self._stopping else 1):
            member = self.members[self._turn % count]
            self._turn = (self._turn + 1) % count
            self._put(member.request_identifier)
            member.expect_answer(now, now + self.drive.period)

    def _frame_left(self, sent: bool, now: float) -> None:
        if not sent and self._stopping:     # the stop does not end without those left out
            self._turn = self._turn_begun
        super()._frame_left(sent, now)
        for member in self.members[1:]:
            member.sent.raws = self.sent.raws

    # -- the group --------------------------------------------------------------------------------

    @property
    def operating(self) -> bool:
        """The group is enabled, all of it."""
        return self._group.operating

    def member_found(self, name: str) -> None:
        """Take note that an inverter of the group came online: it must not jump."""
        self.setpoints.disarm()
        self._group.member_found(name)

    def member_lost(self, name: str) -> None:
        """Take note that an inverter of the group is offline."""
        self._group.member_lost(name)
        self._tell_notes()
        self._let_commands_through()

    def member_status(self, name: str, word: int, now: float) -> None:
        """Take the status word of an inverter of the group."""
        self._group.status_received(word, now, name)
        self._control_changed(now)

    def _found(self, now: float) -> None:
        super()._found(now)
        self.member_found(self.drive.name)

    def _be_offline(self, reason: str) -> None:
        super()._be_offline(reason)
        self.member_lost(self.drive.name)

    def _take_status(self, word: int, now: float) -> None:
        self.member_status(self.drive.name, word, now)

    def control_refusal(self, action: ControlAction) -> str:
        refusal = super().control_refusal(action)
        # a stop is good for those that are there
        there = any(member.online for member in self.members)
        return '' if refusal == DRIVE_OFFLINE and there else refusal

    def facts(self) -> dict[str, str]:
        names = ', '.join(member.drive.name for member in self.members[1:]) or 'nobody else'
        return {'broadcast': f'leads {names}'}


class MemberSession(GroupSession):
    """The session of an inverter that is told what to do by the leader of its group."""

    def __init__(self, drive: DriveConfiguration, leader: LeaderSession, *, places: int) -> None:
        super().__init__(drive, places=places)
        self._leader = leader
        self.setpoints = Setpoints((), timeout=drive.command_timeout,
                                   rearm_immediate=drive.rearm_immediate)

    def deactivate(self, now: float) -> None:
        # the last frames are the leader's business
        self.active = False
        self._fail_requests(BRIDGE_INACTIVE)
        self._withdraw(BRIDGE_INACTIVE, now)
        self._go_idle('deactivated')

    def _first_cycle(self, now: float) -> float:
        return math.inf

    @property
    def _operating(self) -> bool:
        return self._leader.operating

    def _found(self, now: float) -> None:
        super()._found(now)
        self._leader.member_found(self.drive.name)

    def _take_status(self, word: int, now: float) -> None:
        super()._take_status(word, now)
        self._leader.member_status(self.drive.name, word, now)

    def _be_offline(self, reason: str) -> None:
        super()._be_offline(reason)
        self._leader.member_lost(self.drive.name)

    # -- what the leader does for all -------------------------------------------------------------

    def control_refusal(self, action: ControlAction) -> str:
        return (f'{self._leader.drive.name} leads the broadcast group: call ~/{_SERVICES[action]} '
                f'of {self._leader.drive.name}')

    def _cyclic_refusal(self, parameter: Parameter) -> str:
        return (f'sent cyclically by the broadcast group: publish '
                f'{self._leader.drive.name}/command/{parameter.name}')

    @property
    def how_to_enable(self) -> str:
        return f'call ~/enable of {self._leader.drive.name}, which leads the broadcast group'

    def facts(self) -> dict[str, str]:
        return {'broadcast': f'led by {self._leader.drive.name}'}


_SERVICES = {
    ControlAction.ENABLE: 'enable', ControlAction.DISABLE: 'enable',
    ControlAction.QUICK_STOP: 'quick_stop', ControlAction.RESET_FAULT: 'reset_fault',
}
