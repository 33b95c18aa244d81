# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The conversation with the inverters that are told the same: a broadcast group, or one alone.

Each cycle one broadcast frame carries control word and setpoints for all. Nobody answers it, so
one inverter of the group, in turn, also gets the frame to itself, and its answer brings its status
and actual values: with four inverters each is heard every fourth period. An inverter that is
addressed by itself is a group of one without a broadcast: it gets each frame to itself.

There is one cyclic exchange and one control word. The inverter with the lowest station leads: the
setpoints are its, and its services bring the whole group to a state. What concerns one inverter
only (status, samples, parameters, whether it is there, its pending stop) is with its session. The
others refuse what only the leader can do; but who stops one of them stops all.

All sessions of a group live on one bus, under one lock, so that they may be called from here.
"""

from collections.abc import Sequence
from dataclasses import dataclass
import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.core.events import Event
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.session import Session, Stage
from drive_can_bridge.protocols.answers import CycleAnswers
from drive_can_bridge.protocols.cannord.control_words import make_control
from drive_can_bridge.protocols.cannord.identifiers import broadcast_identifier
from drive_can_bridge.protocols.cannord.process_data import (
    encode_extra, encode_main, main_length, MAIN_VALUES, Samples, values_needed)
from drive_can_bridge.protocols.cyclic_exchange import CyclicExchange, STOP_CYCLES

_STOPS = (ControlAction.DISABLE, ControlAction.QUICK_STOP)
_SERVICES = {ControlAction.ENABLE: 'enable', ControlAction.RESET_FAULT: 'reset_fault'}


@dataclass(frozen=True)
class GroupMember:
    """
    An inverter of a group.

    :ivar identifier: of the process frames that it gets to itself.
    :ivar answers: what it answers to those.
    """

    session: Session
    identifier: int
    answers: CycleAnswers
    samples: Samples


class Group:
    """
    What all inverters of a group are commanded, and what becomes of it.

    :param drives: the leader first, as it joins first.
    :ivar exchange: the cycles of all; the answers of the leader.
    :ivar control: the control word of all, and what they report.
    :ivar length: of main frames, in bytes.
    :ivar extra: an additional frame follows each main frame.
    """

    exchange: CyclicExchange[list[bytes]]

    def __init__(self, drives: Sequence[DriveConfiguration]) -> None:
        self._lead = lead = drives[0]
        self._broadcast = broadcast_identifier(lead)
        self._extended: bool = lead.options.extended_identifiers
        self._swap: bool = lead.options.swap_setpoints_2_3
        places = max(values_needed(drive) for drive in drives)
        self.length = main_length(min(places, MAIN_VALUES))
        self.extra = places > MAIN_VALUES
        self.control = make_control(
            parameter_set=lead.options.parameter_set, timeout=lead.control_timeout,
            members=[] if self.alone else [drive.name for drive in drives],
            unheard=self._unheard)
        self._asked_by: dict[ControlRequest, Session] = {}
        self._turn = 0
        self._turn_begun = 0    # what it was when this cycle began
        self._members: list[GroupMember] = []
        self._sessions: list[Session] = []

    def join(self, member: GroupMember) -> None:
        """Add an inverter."""
        session = member.session
        if not self._members:
            self.exchange = CyclicExchange(member.answers, self, slot=0)
        else:
            self.exchange.audience.append(member.answers)
            session.sent = self._leader.sent
        self._members.append(member)
        self._sessions.append(session)
        session.partners = self._sessions

    @property
    def alone(self) -> bool:
        """It is one inverter that is addressed by itself."""
        return self._broadcast is None

    @property
    def leads(self) -> str:
        """Name of the inverter that takes the commands for all."""
        return self._lead.name

    @property
    def _leader(self) -> Session:
        return self._members[0].session

    # -- sending ----------------------------------------------------------------------------------

    def encode_cycle(self, raws: list[int]) -> list[bytes]:
        word, *values = raws
        words = [setpoint.parameter.word_from_raw(raw)
                 for setpoint, raw in zip(self._leader.setpoints.items, values)]
        payloads = [encode_main(word, words[:MAIN_VALUES], length=self.length, swap=self._swap)]
        if self.extra:
            payloads.append(encode_extra(words[MAIN_VALUES:]))
        return payloads

    def send_cycle(self, payloads: list[bytes], now: float) -> None:
        """Send it to all, and to one or some of them alone."""
        exchange, members = self.exchange, self._members
        if self._broadcast is None:
            self._put(members[0].identifier, payloads)
            self._expect(members[0], now, math.inf)
            return
        stopping, count = self._leader.stage is Stage.STOPPING, len(members)
        if stopping and exchange.again:     # nobody of a stop is left out for that
            self._turn = self._turn_begun
        self._turn_begun = self._turn
        self._put(self._broadcast, payloads, *exchange.audience)
        if exchange.sending_more:
            alone = [member for member in members if member.session.unacknowledged]
        else:   # a stop reaches also those that do not listen to broadcasts, whose answers may lag
            turns = math.ceil(count / (STOP_CYCLES - 1)) if stopping else 1
            alone = [members[(self._turn + place) % count] for place in range(turns)]
            self._turn = (self._turn + turns) % count
        for member in alone:
            self._put(member.identifier, payloads, member.answers)
            exchange.settle(member.answers, now)
            self._expect(member, now, now + self._lead.period)

    def last_cycle_left(self, now: float) -> None:
        self.exchange.end_stop()

    def _put(self, identifier: int, payloads: list[bytes], *to: CycleAnswers) -> None:
        for payload in payloads:
            self.exchange.put(Frame(identifier, payload, self._extended), *to)

    def _expect(self, member: GroupMember, now: float, until: float) -> None:
        """Expect an answer: the inverter was sent its process frames."""
        answers = member.answers
        answers.expect(now, until, runs=self.exchange.runs)
        if member.session.stage is Stage.IDLE:
            answers.book.expect_nothing()
            answers.book.stale = self.extra
        else:
            member.samples.awaiting = self.extra

    # -- what becomes of its members --------------------------------------------------------------

    def forget(self, session: Session) -> None:
        """Record that what an inverter reported before the bridge ended is outdated."""
        self.control.member_lost(session.configuration.name)

    def found(self, session: Session) -> None:
        """Record that an inverter came online: those of a group must not jump."""
        if not self.alone:
            self._leader.setpoints.disarm()
            self.control.member_found(session.configuration.name)

    def lost(self, session: Session) -> None:
        """Record that an inverter is offline."""
        if session.active:      # else the bridge ends: what it reported last is to be told
            self.control.member_lost(session.configuration.name)
            self._leader.interlock.follow()

    def end(self, reason: Sentence, now: float) -> None:
        """Record that all are stopped: that, and no member that goes, takes the enable back."""
        self.control.withdraw(reason, now, lost=False)

    def status(self, session: Session, word: int, now: float) -> None:
        """Handle the status word of an inverter."""
        self.control.status_received(word, now, '' if self.alone else session.configuration.name)
        self._leader.control_changed(now)

    def _unheard(self) -> Sentence:
        """Return which inverters were commanded, and have not answered since they were stopped."""
        names = [session.configuration.name for session in self._sessions
                 if session.unacknowledged and not session.online]
        return sentences.members_may_run(names) if names else NOTHING

    # -- what the leader does for all -------------------------------------------------------------

    def control_refusal(self, session: Session, action: ControlAction,
                        refusal: Sentence, *, offline: bool) -> Sentence:
        """
        Return why a control action cannot be asked for; '' if it can.

        :param refusal: what would be said of an inverter alone.
        :param offline: that is that it is offline.
        """
        if session is not self._leader and action not in _STOPS:
            return sentences.group_is_led(self.leads, _SERVICES[action])
        # a stop is good for those that are there; who is missing for an enable, it says itself
        there = action is not ControlAction.RESET_FAULT and any(
            each.online for each in self._sessions)
        return NOTHING if offline and there else refusal

    def stop_for(self, session: Session, request: ControlRequest, now: float) -> None:
        """Stop all, as a user of an inverter that is led has asked for: none stops alone."""
        self._asked_by[request] = session
        self.control.request(request, now)
        self._leader.control_changed(now)

    def delivered(self, events: list[Event]) -> list[Event]:
        """Hand the outcomes of such requests to whom they belong; return all other events."""
        if not self._asked_by:
            return events
        others = []
        for event in events:
            session = (self._asked_by.pop(event.request, None)
                       if isinstance(event, ControlCompleted) else None)
            if session is None:
                others.append(event)
            else:
                session.report.note(event)
        return others

    def cyclic_refusal(self, parameter: Parameter) -> Sentence:
        """Return why a setpoint of an inverter that is led is not written by request."""
        return sentences.sent_by_group(parameter.name, self.leads)

    def facts(self, session: Session) -> dict[str, str]:
        """Return leader and members of the group, for diagnostics."""
        if self.alone:
            return {}
        if session is not self._leader:
            return {'broadcast': f'led by {self.leads}'}
        led = ', '.join(each.configuration.name for each in self._sessions[1:])
        return {'broadcast': f'leads {led or "nobody else"}'}
