# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What people are told of a node: restarts and emergencies, its state, what ails it."""

from drive_can_bridge.core.reporter import Reporter
from drive_can_bridge.protocols.canopen import network
from drive_can_bridge.protocols.canopen.node import Node
from drive_can_bridge.protocols.canopen.notes import PacedNotes


class NodeReport:
    """
    Tells of one node.

    :param report: takes what belongs into the log.
    """

    def __init__(self, node: Node, report: Reporter) -> None:
        self._node = node
        self._notes = PacedNotes(report.note)

    # -- for the log ------------------------------------------------------------------------------

    def restarted(self, now: float) -> None:
        """Tell of a boot-up frame."""
        self._notes.note('boot-up', 'boot-up: the device has started', now)

    def emergency(self, data: bytes, now: float) -> None:
        """
        Take an emergency message; tell what is new about it.

        :raises RemoteProtocolError: it is none.
        """
        text = self._node.receive_emergency(network.decode_emergency(data))
        if text:
            ails = self._node.emergency is not None
            self._notes.note('emergency' if ails else 'emergency over', text, now, warning=ails)

    def handle_timer(self, now: float) -> None:
        """Tell what was held back for long enough."""
        self._notes.handle_timer(now)

    def next_timer(self) -> float:
        """Return when ``handle_timer`` has something to do; infinity: never."""
        return self._notes.next_timer()

    def flush(self, now: float) -> None:
        """Tell everything that was held back: nobody will call any more."""
        self._notes.flush(now)

    # -- for diagnostics --------------------------------------------------------------------------

    @property
    def ailing(self) -> str:
        """What the node says of its errors, and what to do; '' if nothing."""
        emergency = self._node.emergency
        return '' if emergency is None else f'emergency {emergency.text}: remove its cause'

    @property
    def missing(self) -> str:
        """What the node should say, but does not; '' if nothing."""
        if self._node.heartbeat_timeout <= 0.0 or self._node.heard_heartbeat:
            return ''
        return ('no heartbeat although heartbeat_timeout is set: configure the '
                "device's heartbeat producer (1017h)")

    def facts(self) -> dict[str, str]:
        """Return its state and its errors in words."""
        emergency = self._node.emergency
        return {'nmt_state': self._node.state_text,
                'emergency': 'none' if emergency is None else emergency.text}
