# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The socket below python-can's SocketCAN: how long its queues are, and what they have lost.

A frame that was sent waits in the kernel until the controller has brought it to the bus, and stays
there while no other node acknowledges it: nobody can take it back. So the queue is kept as short
as the kernel lets it be, and a frame for which there is no room is not sent at all.
"""

import select
import socket
import struct
from typing import Any

import can

# linux/socket.h; Python has no name for it
_SO_MEMINFO = 55
# linux/sock_diag.h: nine counters, the last of which is SK_MEMINFO_DROPS
_MEMORY = struct.Struct('9I')
_DROPS = 8
#: bytes that the kernel charges for one waiting frame (768 up to Linux 6.2, 960 since)
FRAME_CHARGE = 960


class RawSocket:
    """One CAN_RAW socket."""

    def __init__(self, raw: socket.socket) -> None:
        self._socket = raw
        self._readable_memory = True

    @classmethod
    def below(cls, bus: can.BusABC) -> 'RawSocket | None':
        """Return the socket of a bus; None: there is none of this kind below it."""
        raw: Any = getattr(bus, 'socket', None)
        family = getattr(socket, 'AF_CAN', None)
        if family is None or not isinstance(raw, socket.socket) or raw.family != family:
            return None
        return cls(raw)

    def shorten_queue(self, frames: int) -> None:
        """
        Let the socket count as full when about so many frames wait.

        The kernel keeps at least 4.5 kB, half of which fills it: three frames.
        """
        # it doubles the number, and a socket is writable while less than half of that waits
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, frames * FRAME_CHARGE)

    def has_room(self, timeout: float) -> bool:
        """Wait until a frame could be sent; False after ``timeout`` s."""
        return bool(select.select([], [self._socket], [], timeout)[1])

    @property
    def overflowed_frames(self) -> int:
        """Frames that found the receive queue full; 0 where the kernel does not tell (< 4.12)."""
        if not self._readable_memory:
            return 0
        try:
            memory = self._socket.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, _MEMORY.size)
        except OSError:
            self._readable_memory = False
            return 0
        return int(_MEMORY.unpack(memory)[_DROPS]) if len(memory) == _MEMORY.size else 0
