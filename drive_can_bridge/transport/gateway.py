# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A CAN bus behind socketcand, in place of python-can's class.

That one (4.3.1 to 4.6.1) tries to connect for ten seconds without a pause, and logs each attempt;
waits for the first message of a gateway without a limit; sends without a limit, too; takes a
connection that was closed for one on which nothing comes; and keeps a message that it cannot read,
and fails at it again at every call.
"""

from collections import deque
from collections.abc import Callable
import errno
import select
import socket
from typing import Any

import can

from drive_can_bridge.core import bus_sentences
from drive_can_bridge.core.text import printable
from drive_can_bridge.transport.serial_writer import Below, SerialWriter

#: s that it may take to connect, greetings of the gateway included
OPEN_TIMEOUT = 2.0
#: bytes of messages that may wait here: as for a terminal, nothing old is to pile up
_QUEUE = 4096
#: bytes of a message that never ends
_MESSAGE_MAX = 1024
_CHUNK = 65536


class GatewayError(OSError):
    """An error of a gateway, in words."""


class _Connection:
    """The connection as a terminal, for a :class:`.SerialWriter` and a port."""

    def __init__(self, connected: socket.socket) -> None:
        self.socket = connected
        self.write: Callable[[bytes], object] = connected.sendall

    @property
    def fd(self) -> int | None:
        """Its descriptor; None: closed."""
        return self.socket.fileno() if self.socket.fileno() >= 0 else None

    def reset_output_buffer(self) -> None:
        """Discard what still waits here when the connection is closed."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b'\1\0\0\0\0\0\0\0')

    def close(self) -> None:
        """Close it."""
        self.socket.close()


class Gateway(can.BusABC):
    """
    A channel of a socketcand gateway.

    :param tcp_tune: send at once, and acknowledge at once.
    :param now: the steady time.
    """

    def __init__(self, channel: str, host: str, port: int, now: Callable[[], float], *,
                 tcp_tune: bool = True, can_filters: Any = None, **_: Any) -> None:
        self._where = f'the gateway {host}:{port}'
        self._now = now
        self._tune = tcp_tune
        self._text = b''
        self._messages: deque[can.Message | ValueError] = deque()
        self.channel_info = f'socketcand {channel}@{host}:{port}'
        self._can_protocol = can.CanProtocol.CAN_20
        deadline = now() + OPEN_TIMEOUT
        self.socket = self._connect(host, int(port), deadline)
        try:
            for words, answer in (('', 'hi'), (f'< open {channel} >', 'ok'),
                                  ('< rawmode >', 'ok')):
                self.socket.sendall(words.encode())
                self._expect(answer, channel, deadline)
            self.socket.settimeout(0.0)
            connection = _Connection(self.socket)
            self.drive_can_below = Below(
                connection, SerialWriter.take_over(connection, now), b'', None)
            super().__init__(channel, can_filters)
        except BaseException:
            self.socket.close()
            raise

    def _connect(self, host: str, port: int, deadline: float) -> socket.socket:
        reason: OSError = GatewayError(bus_sentences.gateway_silent(gateway=self._where))
        for family, kind, protocol, _, address in socket.getaddrinfo(
                host, port, type=socket.SOCK_STREAM):
            opened = socket.socket(family, kind, protocol)
            try:
                opened.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _QUEUE)
                opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, self._tune)
                opened.settimeout(max(deadline - self._now(), 0.001))
                opened.connect(address)
                return opened
            except TimeoutError:
                opened.close()
            except OSError as error:
                opened.close()
                reason = GatewayError(
                    bus_sentences.gateway_refuses(gateway=self._where)
                    if error.errno == errno.ECONNREFUSED else
                    bus_sentences.gateway_failed(gateway=self._where, why=error.strerror))
        raise reason

    def _expect(self, answer: str, channel: str, deadline: float) -> None:
        """Wait for a message of the opening."""
        while b'>' not in self._text:
            self.socket.settimeout(max(deadline - self._now(), 0.001))
            try:
                self._text += self._receive()
            except TimeoutError:
                raise GatewayError(
                    bus_sentences.gateway_silent(gateway=self._where)) from None
            if len(self._text) > _MESSAGE_MAX:
                raise GatewayError(bus_sentences.gateway_of_other_kind(gateway=self._where))
        message, self._text = self._text.split(b'>', 1)
        words = message.decode('latin-1').strip(' <')
        if words != answer:
            raise GatewayError(
                bus_sentences.gateway_refuses_channel(
                    gateway=self._where, channel=channel, words=printable(words))
                if answer == 'ok' else
                bus_sentences.gateway_of_other_kind(gateway=self._where))

    def _receive(self) -> bytes:
        try:
            data = self.socket.recv(_CHUNK)
        except ConnectionResetError:
            data = b''
        if not data:
            raise GatewayError(bus_sentences.gateway_closed(gateway=self._where))
        if self._tune:
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)
        return data

    def take_message(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        """Wait for a message. python-can's name for this is below."""
        if not self._messages:
            if not select.select([self.socket], [], [], timeout)[0]:
                return None, False
            self._text += self._receive()
            self.drive_can_below.heard += 1
            *messages, self._text = self._text.split(b'>')
            if len(self._text) > _MESSAGE_MAX:
                messages, self._text = [*messages, self._text], b''
            self._messages.extend(map(_message_of, messages))
            if not self._messages:
                return None, False
        message = self._messages.popleft()
        if isinstance(message, ValueError):
            raise message
        return message, False

    _recv_internal = take_message

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a data frame, whole or not at all."""
        identifier = f'{msg.arbitration_id:0{8 if msg.is_extended_id else 3}X}'
        data = ''.join(f' {byte:02X}' for byte in msg.data)
        self.drive_can_below.port.write(f'< send {identifier} {msg.dlc}{data} >'.encode())

    def shutdown(self) -> None:
        """Close the connection."""
        super().shutdown()
        self.socket.close()


def _message_of(text: bytes) -> 'can.Message | ValueError':
    """Return a message of raw mode, ``< frame 123 1700000000.123456 0F00``, or its fault."""
    try:
        mark, kind, identifier, stamp, *data = text.decode('ascii').split()
        if mark != '<' or kind not in ('frame', 'error') or len(''.join(data)) > 16:
            raise ValueError(text)
        return can.Message(
            timestamp=float(stamp), arbitration_id=int(identifier, 16),
            is_extended_id=len(identifier) != 3, is_error_frame=kind == 'error',
            # of an error, socketcand passes on its classes only
            data=bytes(8) if kind == 'error' else bytes.fromhex(''.join(data)))
    except ValueError as error:
        return ValueError(f'{text!r}: {error}')
