# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The local way to a bridge: the messages on its socket, and the caller's end of it.

The socket is of the type SEQPACKET. A *message* is a list of texts; it travels in as many packets
as it needs, each of at most :data:`PACKET` bytes. The first byte of a packet shows whether more of
its message follows; the rest are the texts in UTF-8 with a zero between two of them.

A request begins with the version of this protocol, and an action; it is answered by messages, of
which the last is ``end``:

====================================== ============================================================
asked                                  answered
====================================== ============================================================
``stop`` PLACE WORD…                   ``bridge`` NAME DOMAIN BRIDGE…, ``drives`` NAME…;
                                       ``drive`` NAME OK ONLINE TEXT for each that is meant;
                                       ``around`` NAME…: drives that it sees; ``end``.
                                       PLACE: a namespace, or a pattern of some, ``*`` for all
``pass`` BRIDGE… '' NAME… '' WORD…     ``passing``, at once and again as long as it lasts;
                                       ``drives`` NAME…; ``passed`` NAME OK TEXT IS_BRIDGE for
                                       each; ``end``: a stop for bridges of other hosts, but for
                                       drives that are stopped already
``who``                                ``bridge`` …, ``drives`` …, ``end``
``enable``, ``disable``, ``reset``     ``drive`` NAME OK ONLINE TEXT for each; ``end``
NAME…                                  (``unoffered`` NAME: it has no such service)
``get`` NODE NAME…                     ``value`` TEXT for each; ``end``
``describe`` NODE NAME…                ``described`` NAME TEXT FACTS MINIMUM MAXIMUM for each;
                                       ``end``
``list`` NODE                          ``names`` NAME…; ``end``
``set`` NODE NAME VALUE                ``result`` OK TEXT; ``end``
``status`` NODE                        ``fact`` KEY VALUE for each; ``end``
anything                               ``no`` TEXT: not by this way
====================================== ============================================================

``drive_can stop`` imports this before it has stopped anything, so nothing is imported here that
takes time.
"""

from collections.abc import Callable, Sequence
import os
import socket
import sys

from drive_can_bridge.host_texts import is_pattern
from drive_can_bridge.process.presence import Present

VERSION = '1'
#: bytes of a packet; of all packets of what is asked
PACKET, ASKED_MAX = 4096, 65536
#: s that a bridge may take to begin to answer
PATIENCE = 1.0
#: s after which one that passes a stop on reports so again: it may take long, and does not hang
PASSING_PERIOD = 0.25
END, NO = 'end', 'no'
#: stands for any namespace
ANYWHERE = '*'
_MORE, _LAST = b'+', b'.'
_ZERO = '\0'
#: bytes of ``struct ucred``: process, user, group
_CREDENTIALS = 12
_KINDS: dict[str, Callable[[str], object]] = {
    'b': lambda text: text == '1', 'i': int, 'd': float, 's': str,
    'l': lambda text: tuple(text.split('\n')) if text else ()}


def meant(words: Sequence[str], node: str) -> bool:
    """Return whether words mean a drive; no words mean all."""
    return not words or any(matches(word, node) for word in words)


def matches(word: str, node: str) -> bool:
    """Return whether a word, a pattern or a full name means a drive."""
    name = node if word.startswith('/') else node.rpartition('/')[2]
    if name == word:
        return True
    if not is_pattern(word):
        return False
    from fnmatch import fnmatchcase
    return fnmatchcase(name, word)


class Rubbish(Exception):
    """A packet that is malformed."""


def packets_of(message: Sequence[str]) -> list[bytes]:
    """Return the packets of a message; a zero in a text becomes a blank."""
    content = _ZERO.join(text.replace(_ZERO, ' ') for text in message).encode(
        'utf-8', 'surrogateescape')
    room = PACKET - 1
    pieces = [content[at:at + room] for at in range(0, len(content), room)] or [b'']
    return [*(_MORE + piece for piece in pieces[:-1]), _LAST + pieces[-1]]


class Inbound:
    """
    Assembles messages from packets.

    :param limit: bytes of a message.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._content = bytearray()

    def take(self, packet: bytes) -> list[str] | None:
        """
        Add a packet; return the message that it completes, None if it completes none.

        :raises Rubbish: it is malformed.
        """
        if len(packet) > PACKET or packet[:1] not in (_MORE, _LAST):
            raise Rubbish
        self._content += packet[1:]
        if len(self._content) > self._limit:
            raise Rubbish
        if packet[:1] == _MORE:
            return None
        content, self._content = bytes(self._content), bytearray()
        try:
            return content.decode('utf-8', 'surrogateescape').split(_ZERO)
        except UnicodeDecodeError:
            raise Rubbish from None


def value_text(value: object) -> str:
    """Return a value as text with its type: bool, number, text, list of texts; '' for none."""
    if isinstance(value, bool):
        return f'b{value:d}'
    if isinstance(value, int):
        return f'i{value}'
    if isinstance(value, float):
        return f'd{value!r}'
    if isinstance(value, str):
        return f's{value}'
    if isinstance(value, (list, tuple)):
        return 'l' + '\n'.join(map(str, value))
    return ''


def value_of(text: str) -> object:
    """
    Return the value in a text of :func:`value_text`; None for none.

    :raises Rubbish: it is no such text.
    """
    try:
        return _KINDS[text[0]](text[1:]) if text else None
    except (KeyError, ValueError):
        raise Rubbish from None


def peer_of(peer: socket.socket) -> tuple[int, int]:
    """
    Return process and user at the other end, as the kernel knew them when it connected.

    Process 0: one of another name space.
    """
    found = peer.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS)
    return int.from_bytes(found[:4], sys.byteorder), int.from_bytes(found[4:8], sys.byteorder)


def trusted_users() -> tuple[int, int]:
    """Return root, and the user of this process: no others are trusted, or obeyed."""
    return 0, os.geteuid()


class Line:
    """
    A connection to a bridge of this host.

    :raises OSError: there is no listener, or it accepts no calls now (``BlockingIOError``).
    :ivar believed: the bridge is root's, or of our user.
    """

    def __init__(self, bridge: Present) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            self.socket.setblocking(False)
            self.socket.connect(bridge.address)
            # as the kernel recorded it when the bridge began to listen
            self.believed = peer_of(self.socket)[1] in trusted_users()
        except BaseException:
            self.socket.close()
            raise
        self._inbound = Inbound(1 << 26)

    def ask(self, *words: str) -> None:
        """
        Send a request.

        :raises OSError: the bridge is gone, or accepts nothing.
        """
        for packet in packets_of([VERSION, *words]):
            self.socket.send(packet)

    def take(self) -> list[str] | None:
        """
        Return a message that has arrived; None: there is none.

        :raises OSError: the other end is gone.
        :raises Rubbish: it is no bridge.
        """
        while True:
            try:
                packet = self.socket.recv(PACKET + 1)
            except BlockingIOError:
                return None
            if not packet:
                raise ConnectionResetError
            message = self._inbound.take(packet)
            if message is not None:
                return message

    def close(self) -> None:
        """Close the connection."""
        self.socket.close()
