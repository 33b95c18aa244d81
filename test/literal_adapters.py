# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Adapters and gateways as they are: what each makes of the bytes that it is handed.

None of them asks our code anything. What they do was seen, or is in their firmware's source; each
says which. A firmware is handed bytes as they come (:meth:`Firmware.take`), returns its answer,
and keeps what it has brought to the bus in ``frames``, as ``201#0F0010270000``.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
import os
import select
import socket
import threading
import tty

from waiting import DEADLINE

HEX = '0123456789ABCDEF'


class Firmware(ABC):
    """
    Of an SLCAN adapter.

    :ivar frames: what it has brought to the bus.
    :ivar channel_open: it takes part in the bus.
    """

    def __init__(self) -> None:
        self.frames: list[str] = []
        self.channel_open = False

    def take(self, data: bytes) -> bytes:
        """Take bytes; return the answer."""
        return b''.join(self.take_byte(byte) for byte in data)

    @abstractmethod
    def take_byte(self, byte: int) -> bytes:
        """Take one."""

    def send(self, identifier: int, length: int, data: list[int], *, extended: bool) -> None:
        """Bring a frame to the bus, if the channel is open."""
        if self.channel_open:
            self.frames.append(f'{identifier:0{8 if extended else 3}X}#'
                               + ''.join(f'{byte & 0xFF:02X}' for byte in data[:length]))


class Canable(Firmware):
    """
    CANable, canable-fw 8ca5d39 (seen; parser as in its source).

    Answers nothing, but ``V``. Digits are made numbers in the buffer, which stays as it is: an
    empty line is the line before, once more. A line that is too long begins again at its start.
    The length of data is not compared with the line.
    """

    size = 30
    version = b'b6b9f8d github.com/normaldotcom/canable-fw.git\r'

    def __init__(self) -> None:
        super().__init__()
        self._line = [0] * 256
        self._length = 0

    def take_byte(self, byte: int) -> bytes:
        if byte == 0x0D:
            length, self._length = self._length, 0
            return self._obey(length)
        if self._length >= self.size:
            self._length = 0
        self._line[self._length] = byte
        self._length += 1
        return b''

    def _obey(self, length: int) -> bytes:
        line = self._line
        for place in range(1, length):
            letter = line[place]
            line[place] = (letter - 0x57 if letter >= 0x61 else
                           letter - 0x37 if letter >= 0x41 else letter - 0x30) & 0xFF
        kind = chr(line[0])
        if kind in 'OC':
            self.channel_open = kind == 'O'
        elif kind == 'V':
            return self.version
        elif kind in 'tT':
            end = 9 if kind == 'T' else 4
            identifier = 0
            for digit in line[1:end]:
                identifier = 16 * identifier + digit
            if (size := line[end]) <= 8:
                data = [16 * line[end + 1 + 2 * at] + line[end + 2 + 2 * at] for at in range(size)]
                self.send(identifier, size, data, extended=kind == 'T')
        return b''


class Canable2(Canable):
    """CANable 2, canable2-fw b158aa7 (source): as CANable, but for 155 characters a line."""

    size = 155
    version = b'CANable2 b158aa7'      # without an end


class Usbtin(Firmware):
    """
    USBtin, firmware 1.4 (its parser was run by others; here by what it answered).

    CR, or BEL for what it does not want: an empty line, ``C`` when closed, ``O`` and ``S`` when
    open. Lines end at 99 characters, the rest overwrites the last one. What follows the data of a
    frame is not looked at.
    """

    size = 99
    done, sent, refused = b'\r', {'t': b'z\r', 'T': b'Z\r'}, b'\a'
    version = b'V0104\r'
    rates = '012345678'

    def __init__(self) -> None:
        super().__init__()
        self._line = ''

    def take_byte(self, byte: int) -> bytes:
        if byte == 0x0D:
            line, self._line = self._line, ''
            return self._obey(line)
        if byte != 0x0A:
            self._line = self._line[:self.size - 1] + chr(byte)
        return b''

    def _obey(self, line: str) -> bytes:
        kind = line[:1]
        if kind == 'V':
            return self.version
        if kind in ('O', 'L') and not self.channel_open:
            self.channel_open = True
            return self.done
        if kind == 'C' and self.channel_open:
            self.channel_open = False
            return self.done
        if kind == 'S' and not self.channel_open and line[1:2] and line[1] in self.rates:
            return self.done
        if kind in ('t', 'T') and self.channel_open and self._frame(line, 8 if kind == 'T' else 3):
            return self.sent[kind]
        return self.refused

    def _frame(self, line: str, digits: int) -> bool:
        head, length = line[1:1 + digits], line[1 + digits:2 + digits]
        if length == '' or length not in '012345678':
            return False
        data = line[2 + digits:2 + digits + 2 * int(length)]
        if len(data) < 2 * int(length) or any(
                letter.upper() not in HEX for letter in head + data):
            return False
        self.send(int(head, 16), int(length), list(bytes.fromhex(data)), extended=digits == 8)
        return True


class Lawicel(Usbtin):
    """LAWICEL CANUSB, V1013 (as described, not tried): as USBtin, but frames get CR alone."""

    sent = {'t': b'\r', 'T': b'\r'}
    version = b'V1013\r'


class WeAct(Usbtin):
    """
    WeAct USB2CANFDV1 (by what it answers): BEL to an empty line.

    How much of a line it looks at is not known; the worst is a whole line without its end.
    """

    version = b'V1.0.0.6\r'


class Canable25(Usbtin):
    """
    CANable, firmware 2.5 of ElmueSoft 3c94657 (source).

    ``C`` is never answered, an empty line by CR. What follows the data of a frame is refused. A
    line of more than 165 characters begins again at its start.
    """

    size = 165
    sent = {'t': b'\r', 'T': b'\r'}
    version = b'+Board: Multiboard\tSlcan: 101\r'
    rates = '0123456789'

    def take_byte(self, byte: int) -> bytes:
        if byte != 0x0D and len(self._line) >= self.size:
            self._line = ''
        return super().take_byte(byte)

    def _obey(self, line: str) -> bytes:
        if line == 'C':
            self.channel_open = False
            return b''
        length = {'t': 5, 'T': 10}.get(line[:1])
        if length is None and line[:1] != 'S':
            length = 1
        elif length is not None and line[length - 1:length].isdecimal():
            length += 2 * int(line[length - 1])
        if line and len(line) != (length or 2):
            return self.refused
        return super()._obey(line) if line else self.done


class Esp32(Firmware):
    """
    ESP32-SLCAN, mintynet f1f6b22 (source).

    Drops a line of 32 characters, with BEL. Acknowledges frames that never leave. A digit that is
    none leaves the number as it was.
    """

    size = 32

    def __init__(self) -> None:
        super().__init__()
        self._line = ''

    def take_byte(self, byte: int) -> bytes:
        self._line += chr(byte)
        if len(self._line) == self.size:
            self._line = ''
            return b'\a'
        if byte != 0x0D:
            return b''
        line, self._line = self._line, ''
        kind = line[0]
        if kind in 'OC':
            self.channel_open = kind == 'O'
        elif kind == 'V':
            return b'V1234\r'
        elif kind in 'tT':
            end = 9 if kind == 'T' else 4
            length = int(line[end]) if line[end:end + 1].isdecimal() else 0
            identifier = int(line[1:end], 16) if set(line[1:end]) <= set(HEX) else 0
            data, byte = [], 0
            for at in range(end + 1, end + 1 + 2 * length, 2):
                digits = line[at:at + 2]
                byte = int(digits, 16) if digits and set(digits) <= set(HEX) else byte
                data.append(byte)
            if identifier and length:       # NMT and SYNC never leave
                self.send(identifier, length, data, extended=kind == 'T')
        elif not (kind == 'S' and line[1] in '345678'):
            return b'\a'
        return b'\r'


class Attached:
    """
    An adapter with this firmware at a pseudo-terminal, until it is closed.

    :ivar path: of the terminal.
    :ivar written: everything that it was handed.
    """

    #: stands behind what :meth:`handled` waits for
    _MARK = b'<here>'

    def __init__(self, take: Callable[[bytes], bytes]) -> None:
        self.written = b''
        self._take = take
        self.master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.path = os.ttyname(self._slave)
        self._end, self._stop = os.pipe()
        self._handled, self._marked = threading.Event(), False
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while True:
            ready = select.select([self.master, self._end], [], [])[0]
            if self._end in ready:
                return
            data = os.read(self.master, 65536)
            if marked := self._marked:
                while not data.endswith(self._MARK):
                    data += os.read(self.master, 65536)
                data = data.removesuffix(self._MARK)
                self._marked = False
            self.written += data
            if answer := self._take(data):
                os.write(self.master, answer)
            if marked:
                self._handled.set()

    def handled(self) -> bytes:
        """Return what it was handed, when all that was written is."""
        self._handled.clear()
        self._marked = True
        os.write(self._slave, self._MARK)
        assert self._handled.wait(DEADLINE)
        return self.written

    def close(self) -> None:
        """Take it away."""
        os.write(self._stop, b'.')
        self._thread.join()
        for each in (self.master, self._slave, self._end, self._stop):
            os.close(each)


class Socketcand:
    """
    A gateway, socketcand (linux-can, protocol of its doc/protocol.md), until it is closed.

    :param words: what it answers, in order: at first, to ``open``, to ``rawmode``.
    :ivar port: where it listens, on the loopback.
    :ivar sent: what it was to bring to the bus.
    :ivar connections: how often somebody has connected.
    :ivar raw: how often somebody has got as far as raw mode.
    """

    WORDS = ('< hi >', '< ok >', '< ok >')

    def __init__(self, words: tuple[str, ...] = WORDS) -> None:
        self.sent: list[str] = []
        self.connections = self.raw = 0
        self._words = words
        self._listening = socket.create_server(('127.0.0.1', 0))
        self.port: int = self._listening.getsockname()[1]
        self._connected: socket.socket | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while True:
            try:
                self._connected, _ = self._listening.accept()
            except OSError:
                return
            self.connections += 1
            with self._connected, suppress(OSError):
                self._serve(self._connected, list(self._words))

    def _serve(self, connected: socket.socket, words: list[str]) -> None:
        text = ''
        if words:
            connected.sendall(words.pop(0).encode())
        while data := connected.recv(4096):
            *messages, text = (text + data.decode()).split('>')
            for message in messages:
                if message.startswith('< send '):
                    self.sent.append(message[7:].strip())
                elif words:
                    connected.sendall(words.pop(0).encode())
                    self.raw += not words

    def say(self, text: str | bytes) -> None:
        """Write to who is connected."""
        assert self._connected is not None
        self._connected.sendall(text if isinstance(text, bytes) else text.encode())

    def drop(self) -> None:
        """Close the connection, and go on listening."""
        if self._connected is not None:
            with suppress(OSError):     # it is closed
                self._connected.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Refuse from now on."""
        with suppress(OSError):     # it was closed before
            self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()
        self.drop()
        self._thread.join()
