# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A node beside the session of its drive: NMT commands to it, what it says of itself, who is told.

When PDOs may be sent, :mod:`.node` knows; what becomes of the exchange, the session says.
"""

import math
from typing import Protocol

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.events import Noted
from drive_can_bridge.core.outbox import Outbox
from drive_can_bridge.core.reporter import Reporter
from drive_can_bridge.core.sentences import NOTHING, Sentence
from drive_can_bridge.core.users import Users
from drive_can_bridge.protocols.canopen import network
from drive_can_bridge.protocols.canopen.node import Change, Node


class NodeUser(Protocol):
    """What a session does about its node; the session itself."""

    configuration: DriveConfiguration
    outbox: Outbox
    report: Reporter
    users: Users
    online: bool

    def lose(self, reason: Sentence, now: float) -> None:
        """Make the drive offline, if it is not."""

    def node_free(self, free_at: float, now: float, *, anew: bool) -> None:
        """
        Send nothing to the node before ``free_at`` but what stops its drive.

        :param anew: the exchange begins then; otherwise it keeps its beat.
        """

    def node_closed(self, now: float) -> None:
        """Handle a node that takes no PDOs: none that was sent is answered any more."""

    def node_silent(self, now: float) -> None:
        """Handle a drive that was online and is silent: it may be listening."""


class Supervision:
    """
    The node of one session.

    :ivar node: what is known of it.
    """

    def __init__(self, session: NodeUser) -> None:
        drive = session.configuration
        self.node = Node(drive.station, nmt_start=drive.options.nmt_start,
                         heartbeat_timeout=drive.options.heartbeat_timeout)
        self._session = session
        self._in_use = False

    def begin(self, now: float) -> None:
        """Begin to use the node: it is started."""
        self._in_use = True
        self.node.begin(now)
        self._send()
        self._follow(now)

    def stop(self) -> None:
        """Send nothing any more, but go on listening."""
        self._in_use = False
        self.node.stop()

    def refusal(self, now: float) -> Sentence:
        """Say why nothing can be asked by PDOs for a while; '' if it can."""
        text = self.node.refusal(now) if self._in_use else NOTHING
        return sentences.drive_offline_because(text) if text else NOTHING

    def receive(self, identifier: int, data: bytes, now: float) -> bool:
        """
        Take a frame with 11 bits; tell whether it was the node's heartbeat or emergency message.

        :raises RemoteProtocolError: malformed.
        """
        base = identifier - self.node.number
        if base == network.HEARTBEAT_BASE:
            self._take_heartbeat(network.decode_heartbeat(data), now)
        elif base == network.EMERGENCY_BASE:
            text = self.node.receive_emergency(network.decode_emergency(data))
            if text:
                self._session.report.note(Noted(text, warning=self.node.emergency is not None))
        else:
            return False
        return True

    def silent(self, reason: Sentence, now: float) -> None:
        """Handle a drive that does not answer, or whose heartbeats have ceased."""
        was_online = self._session.online
        self._session.lose(reason, now)
        self.node.offline(now)
        if was_online:
            self._session.node_silent(now)

    def _close(self, reason: Sentence, failure: Sentence, now: float) -> None:
        self._session.lose(reason, now)
        self._session.users.fail_all(failure)
        self._session.node_closed(now)

    def _take_heartbeat(self, state: network.NmtState, now: float) -> None:
        session = self._session
        change = self.node.receive_heartbeat(state, now, self._in_use)
        if not self._in_use:
            return
        self._send()    # before a stop: the node hears that only when it was started
        if change is Change.RESTARTED:
            session.report.note(Noted(sentences.booted()))
            reason = sentences.device_restarted()
            self._close(reason, sentences.no_answer_because(reason), now)
            session.report.advice = sentences.restarted_waiting()
        elif change is Change.NOT_OPERATIONAL:
            reason = self.node.refusal(now)
            self._close(reason, sentences.drive_offline_because(reason), now)
        self._follow(now, fresh=change is not Change.NONE)

    def _follow(self, now: float, *, fresh: bool = True) -> None:
        """
        Let the session begin when the node takes PDOs; while offline, see to it that it does.

        :param fresh: something is new.
        """
        offline = not self._session.online
        if offline:
            self.node.offline(now)
        free_at = self.node.free_at
        self._session.node_free(free_at, now, anew=offline and (fresh or now < free_at))

    def _send(self) -> None:
        for frame in self.node.take_frames():
            self._session.outbox.put(frame)

    # -- timer ------------------------------------------------------------------------------------

    def handle_timer(self, now: float) -> None:
        """Do what is due."""
        if self._in_use and now >= self.node.next_timer():
            change = self.node.handle_timer(now)
            self._send()
            if change is Change.HEARTBEAT_LOST:
                self.silent(sentences.no_heartbeat(self.node.heartbeat_timeout), now)

    def next_timer(self) -> float:
        """Return when ``handle_timer`` has something to do."""
        return self.node.next_timer() if self._in_use else math.inf
