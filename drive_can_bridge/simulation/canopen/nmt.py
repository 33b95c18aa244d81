# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The NMT side of a simulated CANopen node: states, boot-up frame, heartbeat (CiA 301)."""

import math

from drive_can_bridge.core.frame import Frame
from drive_can_bridge.protocols.canopen_pkw.network import (
    encode_heartbeat, NmtCommand, NmtState,
)


class NmtNode:
    """
    One node.

    :param default_heartbeat: ms between heartbeats after power came on.
    :ivar state: boot-up: without power, or still starting.
    :ivar heartbeat: ms between heartbeats; 0: none (object 1017h).
    """

    def __init__(self, node: int, default_heartbeat: int) -> None:
        self._node = node
        self._default_heartbeat = default_heartbeat
        self.heartbeat = default_heartbeat
        self.state = NmtState.BOOT_UP
        #: when the boot-up frame is due; -infinity: as soon as somebody looks
        self._boots_at = -math.inf
        self._beats_at = math.inf

    @property
    def starting(self) -> bool:
        """Has not sent its boot-up frame yet."""
        return self.state is NmtState.BOOT_UP

    @property
    def communicates(self) -> bool:
        """Takes and sends SDOs and emergencies."""
        return self.state in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL)

    @property
    def operational(self) -> bool:
        """Takes and sends PDOs."""
        return self.state is NmtState.OPERATIONAL

    def switch_off(self) -> None:
        """Lose power."""
        self.state = NmtState.BOOT_UP
        self._boots_at = self._beats_at = math.inf

    def start(self, ready_at: float) -> None:
        """Begin anew; the boot-up frame leaves when the node is ready."""
        self.switch_off()
        self.heartbeat = self._default_heartbeat
        self._boots_at = ready_at

    def command(self, command: int) -> None:
        """Change the state as the master orders; resets are not for here."""
        if self.state is NmtState.BOOT_UP:
            return
        if command == NmtCommand.START:
            self.state = NmtState.OPERATIONAL
        elif command == NmtCommand.STOP:
            self.state = NmtState.STOPPED
        elif command == NmtCommand.ENTER_PRE_OPERATIONAL:
            self.state = NmtState.PRE_OPERATIONAL

    def set_heartbeat(self, milliseconds: int, now: float) -> None:
        """Change the time between heartbeats, beginning with the next one."""
        self.heartbeat = milliseconds
        self._plan(now)

    def next_timer(self) -> float:
        """Return when :meth:`handle_timer` has something to do."""
        return min(self._boots_at, self._beats_at)

    def handle_timer(self, now: float) -> list[Frame]:
        """Return the boot-up frame or the heartbeat that is due."""
        if self._boots_at <= now:
            self._boots_at = math.inf
            self.state = NmtState.PRE_OPERATIONAL
            self._plan(now)
            return [encode_heartbeat(self._node, NmtState.BOOT_UP)]
        if self._beats_at <= now:
            # late ones are left out, the beat is kept
            period = self.heartbeat / 1000.0
            self._beats_at += period * (math.floor((now - self._beats_at) / period) + 1)
            return [encode_heartbeat(self._node, self.state)]
        return []

    def _plan(self, now: float) -> None:
        self._beats_at = now + self.heartbeat / 1000.0 if self.heartbeat else math.inf
