# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
r"""
The serial protocol of SLCAN adapters, seen from the adapter: bytes in, frames and bytes out.

Commands end with ``\r`` and are answered with ``\r`` (done) or ``\a`` (refused), as the adapters
of Lawicel do and many after them:

============== ===================================================================
command        meaning
============== ===================================================================
S0 … S9, sXXXX bit rate, bus timing registers; only while closed
O, L, C        open, open without sending, close
tiiildd…       send an 11-bit frame: identifier, length, data, all hexadecimal
Tiiiiiiiildd…  send a 29-bit frame
riiil, R…l     send a remote frame; accepted and gone, no drive here answers any
V, N, F        version, serial number, status flags
Z0, Z1         received frames without, with a time stamp in ms
============== ===================================================================

A frame that was taken for sending is *not* answered. Adapters differ there, clients do not wait
for it, and python-can's reader returns from ``recv(timeout=0)`` empty-handed once per such answer.
"""

import re

from drive_can_bridge.core.frame import Frame

DONE = b'\r'
REFUSED = b'\a'
#: commands of which nobody here needs to know more: version, serial number, and filters, polling
#: and serial speed by their first letters
ANSWERS = {'V': b'V1013\r', 'N': b'NSIM1\r', 'F': b'F00\r', **dict.fromkeys('MmWXU', DONE)}
BIT_RATES = {'S0': 10_000, 'S1': 20_000, 'S2': 50_000, 'S3': 100_000, 'S4': 125_000,
             'S5': 250_000, 'S6': 500_000, 'S7': 750_000, 'S8': 1_000_000, 'S9': 83_300}
_TIMING = re.compile('s[0-9A-Fa-f]{4}')
#: identifier of 11 or 29 bits, length, data
_FRAME = re.compile(r'(?:[tr]([0-7]\h\h)|[TR]([01]\h{7}))([0-8])((?:\h\h)*)'.replace(
    r'\h', '[0-9A-Fa-f]'))
# Z1 stamps wrap once a minute
_STAMP_WRAP = 60_000
# the longest command is a 29-bit frame with eight bytes: 26 characters
_COMMAND_MAX = 64


class SlcanAdapter:
    """
    The state of an adapter.

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
        self._stamps = False
        self._begun = b''
        self._replies = bytearray()

    @property
    def connected(self) -> bool:
        """Frames pass: the channel is open, with the bit rate of the bus as far as we know."""
        return self.is_open and self._set == self._bitrate

    def receive_bytes(self, data: bytes) -> list[Frame]:
        """Take what the client wrote; return the frames it sends. Any bytes will do."""
        *commands, begun = (self._begun + data).split(DONE)
        # of what is too long already, enough is kept to be refused when it ends
        self._begun = begun[:_COMMAND_MAX + 1]
        frames = [self._obey(command.decode('latin-1')) for command in commands if command]
        return [frame for frame in frames if frame is not None]

    def take_replies(self) -> bytes:
        replies, self._replies = bytes(self._replies), bytearray()
        return replies

    def encode(self, frame: Frame, now: float) -> bytes:
        """Return what the adapter writes when it receives a frame from the bus."""
        head = (f'T{frame.identifier:08X}' if frame.extended else f't{frame.identifier:03X}')
        stamp = f'{int(now * 1000.0) % _STAMP_WRAP:04X}' if self._stamps else ''
        return f'{head}{len(frame.data)}{frame.data.hex().upper()}{stamp}\r'.encode()

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
                self._set = BIT_RATES.get(command, self._bitrate)   # s…: by somebody who knows
        elif command in ('Z0', 'Z1'):
            self._stamps = command == 'Z1'
        elif command == 'F' and not self.is_open:
            reply = REFUSED
        else:
            reply = ANSWERS.get(command if kind in 'VNF' else kind, REFUSED)
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
