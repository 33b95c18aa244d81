# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A pseudo-terminal that behaves like the serial port of an SLCAN adapter.

A bridge in another process opens it with ``interface: slcan``. There is no kernel CAN in it, and
no root. It never blocks: without a reader, the oldest frames are dropped. The slave side is kept
open here too, so that bridges may come and go.
"""

from array import array
from collections import deque
from collections.abc import Callable
from contextlib import suppress
import fcntl
import os
from pathlib import Path
import re
import select
import termios
import threading
import tty

from drive_can_bridge.core.adapter import S7_RATES
from drive_can_bridge.core.errors import BusUnavailable
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.transport.end_point import EndPoint

DONE = b'\r'
REFUSED = b'\a'
#: commands that need no answer of their own here: version, serial number, and filters, polling
#: and serial speed by their first letters
ANSWERS = {'V': b'V1013\r', 'N': b'NSIM1\r', 'F': b'F00\r', 'Z0': DONE,
           **dict.fromkeys('MmWXU', DONE)}
BIT_RATES = {'S0': 10_000, 'S1': 20_000, 'S2': 50_000, 'S3': 100_000, 'S4': 125_000,
             'S5': 250_000, 'S6': 500_000, 'S7': 750_000, 'S8': 1_000_000, 'S9': 83_300}
_TIMING = re.compile('s[0-9A-Fa-f]{4}')
#: identifier of 11 or 29 bits, length, data
_FRAME = re.compile(r'(?:[tr]([0-7]\h\h)|[TR]([01]\h{7}))([0-8])((?:\h\h)*)'.replace(
    r'\h', '[0-9A-Fa-f]'))
# the longest command is a 29-bit frame with eight bytes: 26 characters
_COMMAND_MAX = 64
#: frames that wait while a client does not read, beside what the kernel holds
BACKLOG = 256
#: s after which such a frame is not worth reading any more
BACKLOG_AGE = 1.0
#: bytes that a client may leave unread in the kernel's buffer of 4096
_UNREAD_MAX = 2048
_CHUNK = 4096
#: what the path of every pseudo-terminal begins with
_TERMINALS = '/dev/pts/'
#: s between two looks at a client that does not read
_BACKLOG_PERIOD = 0.005


class SlcanAdapter:
    r"""
    The state of an adapter.

    Commands end with ``\r`` and are answered with ``\r`` (done) or ``\a`` (refused), as the
    adapters of Lawicel do and many after them:

    ============== ===================================================================
    command        meaning
    ============== ===================================================================
    S0 … S9, sXXXX bit rate, bus timing registers; only while closed
    O, L, C        open, open without sending, close
    tiiildd…       send an 11-bit frame: identifier, length, data, all hexadecimal
    Tiiiiiiiildd…  send a 29-bit frame
    riiil, R…l     send a remote frame; accepted and gone, no drive here answers any
    V, N, F        version, serial number, status flags
    Z0             received frames without a time stamp
    ============== ===================================================================

    A frame that was taken for sending is *not* answered. Adapters differ there, clients do not
    wait for it, and python-can's reader returns from ``recv(timeout=0)`` empty-handed once per
    such answer.

    :param bitrate: of its bus, bit/s: with another one set by ``S…`` no frame passes; None: any.
    :ivar is_open: the channel is open.
    :ivar opened: how often a client opened the channel.
    """

    def __init__(self, bitrate: int | None = None) -> None:
        self._bitrate = bitrate
        self._set = bitrate
        self.is_open = False
        self.opened = 0
        self._listen_only = False
        self._begun = b''
        self._replies = bytearray()

    @property
    def connected(self) -> bool:
        """Whether frames pass: the channel is open, with the bus's bit rate if known."""
        return self.is_open and self._set == self._bitrate

    def receive_bytes(self, data: bytes) -> list[Frame]:
        """Handle bytes of the client; return the frames it sends. Any bytes will do."""
        *commands, begun = (self._begun + data).split(DONE)
        # of what is too long already, enough is kept to be refused when it ends
        self._begun = begun[:_COMMAND_MAX + 1]
        frames = [self._obey(command.decode('latin-1')) for command in commands if command]
        return [frame for frame in frames if frame is not None]

    def take_replies(self) -> bytes:
        replies, self._replies = bytes(self._replies), bytearray()
        return replies

    @staticmethod
    def encode(frame: Frame) -> bytes:
        """Return what the adapter writes for a frame from the bus."""
        head = (f'T{frame.identifier:08X}' if frame.extended else f't{frame.identifier:03X}')
        return f'{head}{len(frame.data)}{frame.data.hex().upper()}\r'.encode()

    def _obey(self, command: str) -> Frame | None:
        kind, reply = command[0], DONE
        if kind in 'tTrR':
            return self._transmit(command)
        if len(command) > _COMMAND_MAX:
            reply = REFUSED
        elif kind in 'OL':
            # real adapters refuse this while open; a client that crashed never closed
            self.is_open = True
            self._listen_only = kind == 'L'
            self.opened += 1
        elif kind == 'C':
            self.is_open = False
        elif kind in 'Ss':
            if self.is_open or not (command in BIT_RATES or _TIMING.fullmatch(command)):
                reply = REFUSED
            elif self._bitrate is not None:
                rate = BIT_RATES.get(command, self._bitrate)   # s…: not checked
                # S7 is the one or the other, by adapter
                self._set = self._bitrate if (rate, self._bitrate) == S7_RATES else rate
        elif command == 'F' and not self.is_open:
            reply = REFUSED
        else:
            reply = ANSWERS.get(command if kind in 'VNFZ' else kind, REFUSED)
        self._replies += reply
        return None

    def _transmit(self, command: str) -> Frame | None:
        remote, match = command[0] in 'rR', _FRAME.fullmatch(command)
        if (match is None or len(match[4]) != (0 if remote else 2 * int(match[3]))
                or not self.is_open or self._listen_only):
            self._replies += REFUSED
            return None
        if remote or not self.connected:
            return None
        return Frame(int(match[1] or match[2], 16), bytes.fromhex(match[4]), match[1] is None)


class SlcanTerminal(EndPoint):
    """
    A bus end point on a pseudo-terminal. One thread may receive while others send.

    :param now: the steady time.
    :param bitrate: of the bus, bit/s: a client that sets another receives nothing; None: any.
    :ivar path: the device that a client opens.
    :raises BusUnavailable: the system has no pseudo-terminal left.
    """

    def __init__(self, now: Callable[[], float], bitrate: int | None = None) -> None:
        super().__init__()
        self._now = now
        try:
            self._master, self._slave = os.openpty()
        except OSError as error:
            raise BusUnavailable(f'pseudo-terminal: {error.strerror}') from error
        # Raw before others may write: an echo would send every frame back into the bus.
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)
        self._lock = threading.Lock()
        self._adapter = SlcanAdapter(bitrate)
        self._received: deque[Frame] = deque()
        # with the time it has waited since; the oldest makes room
        self._outgoing: deque[tuple[float, bytes]] = deque(maxlen=BACKLOG)
        self._started = b''         # rest of what the kernel took a part of
        self._links: list[Path] = []
        self._closed = False

    @property
    def is_open(self) -> bool:
        return self._adapter.is_open

    def receive(self, timeout: float) -> Frame | None:
        """
        Wait for a frame from the client.

        :raises BusUnavailable: closed.
        """
        deadline = self._now() + timeout
        while not self._received:
            self._check_open()
            left = max(deadline - self._now(), 0.0)
            waiting = bool(self._started or self._outgoing)
            readable, _, _ = select.select(
                [self._master], [], [], min(left, _BACKLOG_PERIOD) if waiting else left)
            with self._lock:
                # in this order: a new client's first command ends the backlog of the one before
                if readable:
                    self._read()
                if waiting:
                    self._flush()
            if not readable and left <= 0.0:
                break
        return self._received.popleft() if self._received else None

    def send(self, frame: Frame, timeout: float = 0.0) -> None:
        """
        Pass a frame to the client. It is dropped while that is not connected.

        :raises BusUnavailable: closed.
        """
        self._check_open()
        with self._lock:
            if not self._adapter.connected:
                return
            self._outgoing.append((self._now(), self._adapter.encode(frame)))
            self._flush()

    def link(self, path: Path) -> None:
        """
        Make a symbolic link to this terminal, for as long as it is open.

        A link to another terminal is replaced: its simulation has ended without removing it.

        :raises OSError: it cannot be made, or something that is no such link is in the way.
        """
        if path.exists() and not path.is_symlink():
            raise FileExistsError(f'{path} exists and is not a symbolic link')
        if path.is_symlink() and not os.readlink(path).startswith(_TERMINALS):
            raise FileExistsError(f'{path} exists and is not a link to a pseudo-terminal')
        path.parent.mkdir(parents=True, exist_ok=True)
        # a name of its own first: others find the old link or the new one, never none
        temporary = path.with_name(f'.{path.name}.{os.getpid()}')
        try:
            temporary.unlink(missing_ok=True)
            temporary.symlink_to(self.path)
            temporary.replace(path)
        except OSError as error:
            error.filename = str(path)      # not the terminal, nor the other name
            raise
        self._links.append(path)

    def close(self) -> None:
        """Close the terminal and remove its links. Never raises."""
        if self._closed:
            return
        self._closed = True
        for path in self._links:
            # another simulation may have taken the name over
            with suppress(OSError):
                if os.readlink(path) == self.path:
                    path.unlink()
        os.close(self._master)
        os.close(self._slave)

    def _check_open(self) -> None:
        if self._closed:
            raise BusUnavailable('pseudo-terminal closed')

    def _read(self) -> None:
        try:
            data = os.read(self._master, _CHUNK)
        except BlockingIOError:
            return
        except OSError as error:
            raise BusUnavailable(f'pseudo-terminal: {error.strerror}') from error
        before = self._adapter.is_open, self._adapter.opened
        self._received.extend(self._adapter.receive_bytes(data))
        if before != (self._adapter.is_open, self._adapter.opened):
            # what an earlier client has not read is not for the next one (the kernel's share
            # is for the client to discard: doing that here would race with its first read)
            self._outgoing.clear()
        replies = self._adapter.take_replies()
        if replies:
            self._outgoing.append((self._now(), replies))
            self._flush()

    def _flush(self) -> None:
        """Write as much as the client reads, without waiting."""
        oldest = self._now() - BACKLOG_AGE
        while self._outgoing and self._outgoing[0][0] < oldest:
            self._outgoing.popleft()
        try:
            while self._has_room() and (self._started or self._outgoing):
                if not self._started:
                    self._started = self._outgoing.popleft()[1]
                self._started = self._started[os.write(self._master, self._started):]
        except BlockingIOError:
            pass
        except OSError as error:
            raise BusUnavailable(f'pseudo-terminal: {error.strerror}') from error

    def _has_room(self) -> bool:
        """Return whether the client reads; far before the kernel would cut a line in two."""
        unread = array('i', [0])
        fcntl.ioctl(self._slave, termios.FIONREAD, unread)
        return unread[0] < _UNREAD_MAX
