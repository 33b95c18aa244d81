# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The socket below python-can's SocketCAN: its frames, the lengths of its queues, their losses.

python-can opens it, with its filters and options. Frames pass it by: for each, python-can makes a
message of a dozen attributes, looks for room twice and for its logger twice, which costs more than
all that the kernel does.
"""

import errno
import os
import select
import socket
import struct
from typing import Any

import can

from drive_can_bridge.compiled import mypyc_attr
from drive_can_bridge.core.frame import Frame

# linux/can.h: bits beside an identifier
EXTENDED, REMOTE, ERROR = 0x80000000, 0x40000000, 0x20000000
#: and one of ours, beyond the kernel's 32: a CAN FD frame, or a length that none has
UNFIT = 0x100000000
#: what has one of these is no data frame
NO_DATA = REMOTE | ERROR | UNFIT

# linux/can.h: struct can_frame is a head and eight bytes of data, struct canfd_frame has 64
_HEAD = struct.Struct('=IB3x')
_FRAME = struct.Struct('=IB3x8s')
_FD_SIZE = 72
_LENGTH_MAX = 8
# struct timespec, as python-can has asked the kernel for it (SO_TIMESTAMPNS)
_STAMP = struct.Struct('@ll')
_STAMP_SPACE = socket.CMSG_SPACE(_STAMP.size)

# linux/socket.h; Python has no name for it
_SO_MEMINFO = 55
# linux/sock_diag.h: nine counters, the last of which is SK_MEMINFO_DROPS
_MEMORY = struct.Struct('9I')
_DROPS = 8
#: bytes that the kernel charges for one waiting frame (768 up to Linux 6.2, 960 since)
FRAME_CHARGE = 960


@mypyc_attr(allow_interpreted_subclasses=True)
class RawSocket:
    """
    The socket of one SocketCAN interface.

    A frame that was sent waits in the kernel until the controller has brought it to the bus, and
    stays there while no other node acknowledges it: it cannot be withdrawn. So the queue is kept
    as short as the kernel lets it be, and a frame for which there is no room is not sent at all.
    """

    def __init__(self, raw: socket.socket) -> None:
        self._socket = raw
        self._waiting = [raw]
        self._readable_memory = True

    @classmethod
    def below(cls, bus: can.BusABC) -> 'RawSocket | None':
        """Return the socket of a bus; None: there is none of this kind below it."""
        raw: Any = getattr(bus, 'socket', None)
        family = getattr(socket, 'AF_CAN', None)
        if family is None or not isinstance(raw, socket.socket) or raw.family != family:
            return None
        return cls(raw)

    def receive(self, timeout: float) -> tuple[int, bytes, int] | None:
        """
        Wait for a frame.

        :param timeout: s.
        :return: the identifier with the bits of this module, the data, and when the kernel had it,
            in ns since 1970 (0: no stamp); None after the time-out.
        :raises OSError: the interface is down, or has gone.
        """
        if not select.select(self._waiting, (), (), timeout)[0]:
            return None
        frame, ancillary, _, _ = self._socket.recvmsg(_FD_SIZE, _STAMP_SPACE)
        if len(frame) < _HEAD.size:
            raise ConnectionResetError(errno.ECONNRESET, os.strerror(errno.ECONNRESET))
        identifier, length = _HEAD.unpack_from(frame)
        if len(frame) != _FRAME.size or length > _LENGTH_MAX:
            identifier |= UNFIT
        stamp = 0
        if ancillary:
            seconds, nanoseconds = _STAMP.unpack(ancillary[0][2])
            stamp = seconds * 1_000_000_000 + nanoseconds
        return identifier, frame[_HEAD.size:_HEAD.size + length], stamp

    def send(self, frame: Frame, timeout: float) -> bool:
        """
        Pass a frame to the kernel; return False: there was no room for ``timeout`` s.

        :raises OSError: it refuses the frame.
        """
        if not select.select((), self._waiting, (), timeout)[1]:
            return False
        identifier, data, extended = frame
        self._socket.send(_FRAME.pack(
            identifier | EXTENDED if extended else identifier, len(data), data))
        return True

    def has_room(self, timeout: float) -> bool:
        """Wait until a frame could be sent; return False after ``timeout`` s."""
        return bool(select.select((), self._waiting, (), timeout)[1])

    def shorten_queue(self, frames: int) -> None:
        """
        Make the socket count as full when about so many frames wait.

        The kernel keeps at least 4.5 kB, half of which fills it: three frames.
        """
        # it doubles the number, and a socket is writable while less than half of that waits
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, frames * FRAME_CHARGE)

    @property
    def overflowed_frames(self) -> int:
        """The frames that found the receive queue full; 0 with kernels before 4.12."""
        if not self._readable_memory:
            return 0
        try:
            memory = self._socket.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, _MEMORY.size)
        except OSError:
            self._readable_memory = False
            return 0
        return int(_MEMORY.unpack(memory)[_DROPS]) if len(memory) == _MEMORY.size else 0
