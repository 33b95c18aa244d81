# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What people are told of a node: restarts and emergencies, its state, what ails it."""

from drive_can_bridge.core.events import Noted
from drive_can_bridge.core.reporter import Reporter
from drive_can_bridge.protocols.canopen import network
from drive_can_bridge.protocols.canopen.node import Node


class NodeReport:
    """
    Tells of one node.

    :param report: takes what belongs into the log.
    """

    def __init__(self, node: Node, report: Reporter) -> None:
        self._node = node
        self._report = report

    # -- for the log ------------------------------------------------------------------------------

    def restarted(self) -> None:
        """Tell of a boot-up frame."""
        self._report.note(Noted('boot-up: the device has started'))

    def emergency(self, data: bytes) -> None:
        """
        Take an emergency message; tell what is new about it.

        :raises RemoteProtocolError: it is none.
        """
        text = self._node.receive_emergency(network.decode_emergency(data))
        if text:
            self._report.note(Noted(text, warning=self._node.emergency is not None))

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
