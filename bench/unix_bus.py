# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
SocketCAN over a Unix socket: python-can's class on this side, one process of drives on the other.

All of python-can's code for SocketCAN runs, on a socket of another family with the same frames
(a 16-byte ``struct can_frame``, stamped by the kernel): what is measured is what a user of
``can0`` pays, but for the kernel's part below the socket. It needs neither kernel CAN nor root,
and keeps the drives out of the measured process: python-can's ``virtual`` bus would charge deep
copies to the sender.
"""

import socket
import threading
from typing import Any

import can
from can.bus import CanProtocol
import can.interfaces
from can.interfaces.socketcan.constants import SO_TIMESTAMPNS
from can.interfaces.socketcan.socketcan import SocketcanBus

INTERFACE = 'socketcan'


class UnixBus(SocketcanBus):
    """The measured side; its channel is the path of a socket."""

    def __init__(self, channel: Any = None, can_filters: Any = None, **kwargs: Any) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.socket.connect(channel)
        self.socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self.channel, self.channel_info = channel, f'unix socket {channel}'
        self._bcm_sockets: dict[str, socket.socket] = {}
        self._task_id, self._task_id_guard = 0, threading.Lock()
        self._can_protocol = CanProtocol.CAN_20
        can.BusABC.__init__(self, channel=channel, can_filters=can_filters)

    def _apply_filters(self, filters: Any) -> None:
        """Leave filtering to the drives' side: only wanted frames arrive."""
        self._is_filtered = True


def register() -> None:
    """Put it in the place of SocketCAN."""
    can.interfaces.BACKENDS[INTERFACE] = (__name__, 'UnixBus')
    socket.AF_CAN = socket.AF_UNIX      # what looks after CAN sockets looks after this one
