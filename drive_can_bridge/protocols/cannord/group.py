# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Broadcast groups: several inverters that are told the same.

Each cycle one broadcast frame carries control word and setpoints for all. Nobody answers it, so
one inverter of the group, in turn, also gets the frame to itself, and its answer brings its status
and actual values: with four inverters each is heard every fourth period.

The inverter with the lowest station leads. Its session sends everything and has the setpoints;
its services bring the whole group to a state. The sessions of the others receive, serve the
parameters of their inverter, and refuse what only the leader can do; but who stops one of
them stops all.

All sessions of a group live on one bus, under one lock, so that they may call each other.
"""

from collections.abc import Sequence
import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.core.events import Event
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.sentences import NOTHING, Sentence
from drive_can_bridge.core.session import Stage
from drive_can_bridge.core.stop_duty import Happened
from drive_can_bridge.protocols.cannord.broadcast import broadcast_identifier
from drive_can_bridge.protocols.cannord.control import make_control
from drive_can_bridge.protocols.cannord.process_data import values_needed
from drive_can_bridge.protocols.cannord.session import CannordSession
from drive_can_bridge.protocols.cyclic_exchange import STOP_CYCLES


def make_group(drives: Sequence[DriveConfiguration]) -> list[CannordSession]:
    """
    Make the sessions of a group.

    :param drives: the leader first.
    """
    group = Group(drives)
    for member in group.members:
        member.partners = [other for other in group.members if other is not member]
    return group.members


class Group:
    """
    What the sessions of a group have in common.

    :param drives: the leader first.
    :ivar members: all sessions of the group, in the same order.
    :ivar broadcast: the identifier of frames for all.
    :ivar places: how many values the frames hold at least.
    :ivar control: the control word of all, and what they report.
    """

    def __init__(self, drives: Sequence[DriveConfiguration]) -> None:
        self._lead = own = drives[0]
        self.broadcast = broadcast_identifier(own) or 0
        self.places = max(values_needed(drive) for drive in drives)
        self.control = make_control(
            parameter_set=own.options.parameter_set, timeout=own.control_timeout,
            members=[drive.name for drive in drives], unheard=self._unheard)
        self._asked_by: dict[ControlRequest, CannordSession] = {}
        self._turn = 0
        self._turn_begun = 0    # what it was when this cycle began
        self.members: list[CannordSession] = []
        self.members = [CannordSession(drive, self) for drive in drives]

    def is_leader(self, drive: DriveConfiguration) -> bool:
        """Tell whether an inverter leads the group."""
        return drive is self._lead

    @property
    def leader(self) -> CannordSession:
        """The session that sends for all."""
        return self.members[0]

    # -- sending ----------------------------------------------------------------------------------

    def send(self, payloads: list[bytes], now: float) -> None:
        """Send a cycle: to all, and to one or some of them alone."""
        leader, members = self.leader, self.members
        exchange, count = leader.exchange, len(members)
        stopping = leader.stage is Stage.STOPPING
        if stopping and exchange.again:     # nobody of a stop is left out for that
            self._turn = self._turn_begun
        self._turn_begun = self._turn
        leader.send(self.broadcast, payloads, *(member.exchange for member in members))
        if exchange.insisting:
            alone = [member for member in members if member.unshown]
        else:   # a stop reaches also those that do not listen to broadcasts
            turns = math.ceil(count / STOP_CYCLES) if stopping else 1
            alone = [members[(self._turn + place) % count] for place in range(turns)]
            self._turn = (self._turn + turns) % count
        for member in alone:
            leader.send(member.request_identifier, payloads, member.exchange)
            member.exchange.settle(now)
            member.expect_answer(now, now + leader.configuration.period, runs=exchange.runs)

    def cycle_left(self) -> None:
        """Record that a cycle has left: it told everybody the same."""
        for member in self.members[1:]:
            member.sent.raws = self.leader.sent.raws

    # -- the end of a stop ------------------------------------------------------------------------

    def unheard(self) -> bool:
        """Tell whether an inverter that ran has not answered since all were told to stop."""
        return any(member.unshown for member in self.members)

    def stop_left(self, now: float) -> None:
        """End the stop of all: who ran and did not answer may still be running."""
        for member in self.members:
            member.duty.happened(Happened.SILENT)
            if not member.stopped:
                member.stop_left()

    # -- what becomes of its members --------------------------------------------------------------

    def member_found(self, member: CannordSession) -> None:
        """Record that an inverter of the group came online: it must not jump."""
        self.leader.setpoints.disarm()
        self.control.member_found(member.configuration.name)

    def member_lost(self, member: CannordSession) -> None:
        """Record that an inverter of the group is offline."""
        if member.active:       # else the bridge ends: what it reported last is to be told
            self.control.member_lost(member.configuration.name)
            self.leader.gate.follow()

    def end(self, reason: Sentence, now: float) -> None:
        """Record that all are stopped: that, and no member that goes, takes the enable back."""
        self.control.withdraw(reason, now, lost=False)

    def member_status(self, member: CannordSession, word: int, now: float) -> None:
        """Take the status word of an inverter that is led."""
        self.control.status_received(word, now, member.configuration.name)
        self.leader.control_changed(now)

    def _unheard(self) -> Sentence:
        """Say which inverters were told to run, and have not answered since they were stopped."""
        names = [member.configuration.name for member in self.members
                 if member.unshown and not member.online]
        return sentences.members_may_run(names) if names else NOTHING

    # -- what the leader does for all -------------------------------------------------------------

    def control_refusal(self, member: CannordSession, action: ControlAction,
                        refusal: Sentence) -> Sentence:
        """
        Say why a control action cannot be asked for; '' if it can.

        :param refusal: what would be said of an inverter alone.
        """
        if member is not self.leader and action not in _STOPS:
            lead = self._lead.name
            return sentences.group_is_led(lead, _SERVICES[action])
        # a stop is good for those that are there
        there = any(each.online for each in self.members)
        return NOTHING if refusal.code == 'drive_offline' and there else refusal

    def stop_for(self, member: CannordSession, request: ControlRequest, now: float) -> None:
        """Stop all, as a user of an inverter that is led has asked for: none stops alone."""
        self._asked_by[request] = member
        self.control.request(request, now)
        self.leader.control_changed(now)

    def delivered(self, events: list[Event]) -> list[Event]:
        """Hand the outcomes of such requests to whom they belong; return all other events."""
        if not self._asked_by:
            return events
        others = []
        for event in events:
            member = (self._asked_by.pop(event.request, None)
                      if isinstance(event, ControlCompleted) else None)
            if member is None:
                others.append(event)
            else:
                member.report.note(event)
        return others

    def cyclic_refusal(self, parameter: Parameter) -> Sentence:
        """Say why a setpoint of an inverter that is led is not written by request."""
        return sentences.sent_by_group(parameter.name, self._lead.name)

    @property
    def leads(self) -> str:
        """Name of the inverter that takes the commands for all."""
        return self._lead.name

    def fact(self, member: CannordSession) -> str:
        """Say who leads whom."""
        if member is not self.leader:
            return f'led by {self._lead.name}'
        return f'leads {", ".join(each.name for each in self._others) or "nobody else"}'

    @property
    def _others(self) -> list[DriveConfiguration]:
        return [member.configuration for member in self.members[1:]]


_STOPS = (ControlAction.DISABLE, ControlAction.QUICK_STOP)
_SERVICES = {ControlAction.ENABLE: 'enable', ControlAction.RESET_FAULT: 'reset_fault'}
