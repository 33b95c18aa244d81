# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A CAN bus over a Unix socket: python-can on this side, one process of drives on the other.

Costs what python-can's SocketCAN costs (one system call per frame, a 16-byte ``struct can_frame``,
a ``can.Message`` per received frame), needs neither kernel CAN nor root, and keeps the drives out
of the measured process: python-can's ``virtual`` bus would charge deep copies to the sender.
"""

import select
import socket
import struct
import time
from typing import Any

import can
import can.interfaces

INTERFACE = 'drive_can_bench'
CAN_FRAME = struct.Struct('=IB3x8s')
EXTENDED = 0x80000000


class UnixBus(can.BusABC):
    """The measured side."""

    def __init__(self, channel: Any = None, can_filters: Any = None, **kwargs: Any) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.socket.connect(channel)
        self.channel_info = f'unix socket {channel}'
        super().__init__(channel=channel, can_filters=can_filters, **kwargs)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        identifier = msg.arbitration_id | EXTENDED if msg.is_extended_id else msg.arbitration_id
        self.socket.send(CAN_FRAME.pack(identifier, msg.dlc, bytes(msg.data)))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        ready, _, _ = select.select([self.socket], [], [], timeout)
        if not ready:
            return None, False
        data = self.socket.recv(16)
        if not data:
            raise can.CanOperationError('the drives are gone')
        identifier, length, payload = CAN_FRAME.unpack(data)
        return can.Message(
            timestamp=time.time(), arbitration_id=identifier & 0x1FFFFFFF,
            is_extended_id=bool(identifier & EXTENDED), dlc=length,
            data=payload[:length], check=False), True

    def _apply_filters(self, filters: Any) -> None:
        """Leave filtering to the drives' side: only wanted frames arrive."""

    def shutdown(self) -> None:
        super().shutdown()
        self.socket.close()


def register() -> None:
    """Make the interface known to python-can."""
    can.interfaces.BACKENDS[INTERFACE] = (__name__, 'UnixBus')
