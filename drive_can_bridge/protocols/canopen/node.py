# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The device as a CANopen node: may PDOs be sent to it, has it restarted, what ails it.

A node takes PDOs in the state *operational* only. What its state is, the bridge learns from the
boot-up frame and from heartbeats; a node without heartbeats is taken to be operational a moment
after it was started, because nobody will ever say so.

=============================== ==================================================================
heard                           PDOs
=============================== ==================================================================
nothing                         allowed; after our *start* only when a moment has passed
boot-up, no heartbeats known    allowed again after the same moment
boot-up, or heartbeat that says none until a heartbeat says operational; but if heartbeats cease
stopped or pre-operational      (for 1 s, or three of their intervals), nothing is known any more
heartbeat: operational          allowed
=============================== ==================================================================

Who starts a node, and when, the sessions decide.
"""

from collections.abc import Callable
from enum import Enum
import math
from typing import Protocol

from drive_can_bridge.core import sentences
from drive_can_bridge.core.events import Noted
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.reporter import Reporter
from drive_can_bridge.core.session import Stage
from drive_can_bridge.protocols.canopen import network
from drive_can_bridge.protocols.canopen.network import Emergency, NmtState

#: s that a node is given to become operational
START_PAUSE = 0.05
#: s between two *start* commands to a node that is offline
START_PERIOD = 1.0
#: least s between two *start* commands, however often the node asks for them
START_SPACING = 0.1
#: s for which a heartbeat is believed at least, and intervals for which it is
BELIEF_TIME = 1.0
BELIEF_INTERVALS = 3.0
#: longest s between two heartbeats that a node can be configured for (16 bits of ms)
INTERVAL_MAX = 65.535


class NodeChange(Enum):
    """What a frame, or the passage of time, changes about a node."""

    NONE = 'nothing new'
    RESTARTED = 'boot-up'
    NOT_OPERATIONAL = 'heartbeat: not operational'
    STILL_NOT = 'heartbeat: not operational, as before'
    OPERATIONAL = 'heartbeat: operational'
    HEARTBEAT_LOST = 'heartbeats ceased'


class WatchedNode:
    """
    One node, watched.

    :param heartbeat_timeout: s without heartbeat until it counts as lost; 0: never.
    :ivar state: what the node last said of itself, or None.
    :ivar emergency: what it last said of its errors; None: nothing, or no error any more.
    :ivar free_at: when PDOs may be sent.
    :ivar heartbeat_lost: a heartbeat is overdue.
    :ivar silent_for: s that a heartbeat was overdue and more, when it has come at last; 0: it was
        not, or the device has restarted.
    :ivar pdo_at: when it sent a PDO last, for those who look at them.
    :ivar heard_at: when it said anything else last, likewise.
    """

    def __init__(self, number: int, *, heartbeat_timeout: float) -> None:
        self.number = number
        self.heartbeat_timeout = heartbeat_timeout
        self.forget()

    def forget(self) -> None:
        """Know nothing."""
        self.state: NmtState | None = None
        self.emergency: Emergency | None = None
        self.free_at = math.inf
        self.heartbeat_lost = self.without_content = False
        self.silent_for = 0.0
        self.pdo_at = self.heard_at = -math.inf
        self._heartbeat_at = self._said_at = -math.inf      # or the boot-up frame
        self._interval: float | None = None     # None: there was no heartbeat yet
        self._blocked_until = -math.inf         # a heartbeat is believed until then

    def begin(self, now: float) -> None:
        """Begin to use the node; what was received from it before still counts."""
        self.free_at = self._blocked_until if self._blocked(now) else now
        self.heartbeats_begin(now)      # none was due while nobody listened

    def heartbeats_begin(self, now: float) -> None:
        """Record that none was due before."""
        self._heartbeat_at = max(self._heartbeat_at, now)

    def started(self, at: float) -> None:
        """Record when the node is started: unless its heartbeats know better, it is free then."""
        if not self._blocked(at):
            self.free_at = at + START_PAUSE

    # -- input ------------------------------------------------------------------------------------

    def receive(self, frame: Frame, report: Reporter, take: Callable[[NmtState, float], None],
                now: float) -> bool:
        """
        Handle a heartbeat or emergency message of the node; return whether it was one.

        :param take: takes the state in a heartbeat.
        :raises RemoteProtocolError: it is malformed.
        """
        base = frame.identifier - self.number
        if base == network.HEARTBEAT_BASE and not frame.data:
            self.take_empty_heartbeat(report, now)
        elif base == network.HEARTBEAT_BASE:
            take(network.decode_heartbeat(frame.data), now)
        elif base == network.EMERGENCY_BASE:
            self.take_emergency(frame.data, report)
        else:
            return False
        return True

    def receive_heartbeat(self, state: NmtState, now: float) -> NodeChange:
        """Handle a boot-up frame or heartbeat."""
        was_blocked, interval = self._blocked(now), now - self._heartbeat_at
        recovered, self.heartbeat_lost = self.heartbeat_lost, False
        self.silent_for = (
            now - self._said_at if recovered and state is not NmtState.BOOT_UP else 0.0)
        self._heartbeat_at = self._said_at = self.heard_at = now
        if state is NmtState.BOOT_UP:
            self.state = NmtState.PRE_OPERATIONAL
            self.emergency = None
            self.free_at = now + START_PAUSE
            if self._interval is not None:
                self.free_at = self._blocked_until = now + self._belief
            return NodeChange.RESTARTED
        self.without_content = False
        if self._interval is None:
            self._interval = 0.0
        elif interval <= INTERVAL_MAX:
            self._interval = interval
        self.state = state
        if state is NmtState.OPERATIONAL:
            waited, self.free_at = now < self.free_at, min(self.free_at, now)
            self._blocked_until = -math.inf
            return NodeChange.OPERATIONAL if waited or recovered else NodeChange.NONE
        self.free_at = self._blocked_until = now + self._belief
        return NodeChange.STILL_NOT if was_blocked else NodeChange.NOT_OPERATIONAL

    def take_empty_heartbeat(self, report: Reporter, now: float) -> None:
        """Handle a heartbeat without content, and report the first."""
        self.heard_at = now
        if not self.without_content:
            self.without_content = True
            report.reject(sentences.heartbeat_without_content())

    def receive_emergency(self, emergency: Emergency) -> Sentence:
        """
        Record an emergency message.

        :return: what is new about it, in words; '': nothing.
        """
        known = self.emergency
        self.emergency = None if emergency.code == network.NO_ERROR else emergency
        if self.emergency == known:
            return NOTHING
        if self.emergency is None:
            return sentences.emergency_over()
        return sentences.emergency(self.emergency.text)

    def take_emergency(self, data: bytes, report: Reporter) -> None:
        """
        Handle the data of an emergency message, and report what is new about it.

        :raises RemoteProtocolError: it is malformed.
        """
        text = self.receive_emergency(network.decode_emergency(data))
        if text:
            lasts = self.emergency is not None
            report.note(Noted(text, warning=lasts, new=lasts))

    def handle_timer(self, now: float) -> NodeChange:
        """Do what is due."""
        if now >= self.due:
            self.heartbeat_lost = True
            return NodeChange.HEARTBEAT_LOST
        return NodeChange.NONE

    @property
    def due(self) -> float:
        """When ``handle_timer`` wants to be called; infinity: never."""
        if (self.state is None or self.heartbeat_lost or self.without_content
                or self.heartbeat_timeout <= 0.0):
            return math.inf
        return self._heartbeat_at + self.heartbeat_timeout

    # -- state ------------------------------------------------------------------------------------

    def refusal(self, now: float) -> Sentence:
        """Return why no PDO can be sent for a while; '' if it can."""
        if not self._blocked(now) or self.state is None:
            return NOTHING
        return sentences.node_state(self.state.text)

    def said(self, now: float) -> NmtState | None:
        """Return the state in its last heartbeat; None: none is recent, or it has left that."""
        recent = now - self._said_at <= (self.heartbeat_timeout or BELIEF_TIME) and not (
            self.state is NmtState.STOPPED and max(self.heard_at, self.pdo_at) > self._said_at)
        return self.state if recent else None

    def said_since(self, at: float) -> NmtState | None:
        """Return the state in a heartbeat since then; None: there was none."""
        return self.state if self._said_at > at else None

    @property
    def interval(self) -> float | None:
        """How many s there are between its heartbeats, as far as known; None: it sends none."""
        return None if self.heartbeat_lost else self._interval

    @property
    def ailing(self) -> Sentence:
        """The emergency that the node reports, and what to do; '' if none."""
        emergency = self.emergency
        return NOTHING if emergency is None else sentences.emergency_lasts(emergency.text)

    @property
    def ceased(self) -> bool:
        """There were heartbeats, not only a boot-up frame, and there are none any more."""
        return self.heartbeat_lost and self.heartbeat_timeout > 0.0 and self._interval is not None

    @property
    def missing(self) -> Sentence:
        """What the node should say, but does not; '' if nothing."""
        if self.without_content and self.heartbeat_timeout > 0:
            return sentences.heartbeat_without_content()
        never = self.state is None or self.heartbeat_lost and self._interval is None
        return sentences.heartbeat_missing() if never and self.heartbeat_timeout > 0 else NOTHING

    def facts(self) -> dict[str, str]:
        """Return its state and its errors in words, for diagnostics."""
        return {'nmt_state': 'unknown' if self.state is None else self.state.text,
                'emergency': 'none' if self.emergency is None else self.emergency.text}

    # -- inside -----------------------------------------------------------------------------------

    def _blocked(self, now: float) -> bool:
        """Return whether a recent heartbeat reports a state in which the node takes no PDOs."""
        return now < self._blocked_until

    @property
    def _belief(self) -> float:
        return max(BELIEF_TIME, BELIEF_INTERVALS * (self._interval or 0.0))


class OfNode(Protocol):
    """The session of a node."""

    stage: Stage

    def heartbeat_lost(self, now: float) -> None:
        """Handle a node whose heartbeats have ceased."""


class HeartbeatWatch:
    """The part of a session that waits for the heartbeats of its node."""

    def __init__(self, session: OfNode, node: WatchedNode) -> None:
        self._session, self._node = session, node

    @property
    def due(self) -> float:
        """When one is overdue, of a node that is looked for or in exchange."""
        return self._node.due if self._session.stage is Stage.RUNNING else math.inf

    def handle_timer(self, now: float) -> None:
        """Lose a node whose heartbeats have ceased."""
        if now >= self.due and self._node.handle_timer(now) is NodeChange.HEARTBEAT_LOST:
            self._session.heartbeat_lost(now)

    def stop(self) -> None:
        """Do nothing: the stage says it."""
