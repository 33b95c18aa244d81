# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
CAN interfaces of the kernel, as netlink shows them: state, bit rate, driver.

Every user may ask, and nothing is opened. What ``ip -details link show type can`` shows, without
``ip``.
"""

from collections.abc import Iterator
import os
import socket
import struct
from typing import NamedTuple

from drive_can_bridge.core import bus_sentences
from drive_can_bridge.core.text import printable

#: linux/if_arp.h, linux/rtnetlink.h, linux/if_link.h, linux/can/netlink.h
_ARPHRD_CAN = 280
_NEW_LINK, _GET_LINK, _DONE, _ERROR = 16, 18, 3, 2
_REQUEST, _DUMP = 0x1, 0x300
_IFF_UP = 0x1
_NAME, _LINK_INFO, _KIND, _DATA = 3, 18, 1, 2
_BIT_TIMING, _CAN_STATE = 1, 4
_HEAD, _LINK, _ATTRIBUTE = struct.Struct('=IHHII'), struct.Struct('=BxHiII'), struct.Struct('=HH')
_STATES = ('error-active', 'error-warning', 'error-passive', 'bus-off', 'stopped', 'sleeping')
#: s for an answer of the kernel, and bytes of one
_PATIENCE, _ANSWER = 2.0, 65536
#: bits that define how the content of an attribute is to be read
_TYPE = 0x3FFF


class KernelInterface(NamedTuple):
    """
    A CAN interface.

    :param number: that it keeps when it is renamed.
    :param kind: of its driver: ``can``, ``vcan``.
    :param bitrate: bit/s; 0: none is set, or it has none.
    :param state: of its controller, '' where there is none.
    """

    name: str
    number: int
    up: bool
    kind: str = ''
    bitrate: int = 0
    state: str = ''

    @property
    def how_up(self) -> str:
        """The command that switches it on."""
        rate = ' type can bitrate 500000' if self.kind == 'can' and not self.bitrate else ''
        return f'ip link set {self.name} up{rate}'


def kernel_interfaces() -> list[KernelInterface]:
    """Return the CAN interfaces of this network namespace; none without netlink."""
    try:
        with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE) as asked:
            asked.settimeout(_PATIENCE)
            asked.send(_HEAD.pack(_HEAD.size + _LINK.size, _GET_LINK, _REQUEST | _DUMP, 1, 0)
                       + _LINK.pack(socket.AF_UNSPEC, 0, 0, 0, 0))
            found: list[KernelInterface] = []
            while True:
                interfaces, more = parsed(asked.recv(_ANSWER))
                found += interfaces
                if not more:
                    return found
    except (OSError, AttributeError):     # no netlink
        return []


def kernel_interface(name: str) -> KernelInterface | None:
    """Return the CAN interface of this name; None: there is none, or it is unknown."""
    return next((each for each in kernel_interfaces() if each.name == name), None)


def index_of(name: str) -> int:
    """Return the number of an interface, which it keeps when it is renamed; 0: there is none."""
    try:
        return socket.if_nametoindex(name)
    except OSError:
        return 0


def name_of(index: int) -> str:
    """Return the name of the interface of this number; '': there is none."""
    try:
        return printable(socket.if_indextoname(index))
    except (OSError, OverflowError):
        return ''


def has_can() -> bool:
    """Return whether this kernel knows CAN."""
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except (OSError, AttributeError):
        return False
    return True


def why_lost(name: str, index: int) -> str:
    """
    Return why an interface does not work; '': nothing can be seen.

    :param index: its number when it worked; 0: it never has.
    """
    if not has_can():
        return ''
    if not index_of(name):
        other = name_of(index) if index else ''
        if other:
            return bus_sentences.interface_renamed(name=name, other=other)
        if index:
            return bus_sentences.interface_gone(name=name)
        return bus_sentences.interface_unknown(
            name=name, names=[each.name for each in kernel_interfaces()])
    found = kernel_interface(name)
    if found is not None and not found.up:
        return bus_sentences.interface_down(name=name, how_up=found.how_up)
    return ''


def parsed(answer: bytes) -> tuple[list[KernelInterface], bool]:
    """Return the CAN interfaces in an answer of the kernel, and whether more is to come."""
    found: list[KernelInterface] = []
    while len(answer) >= _HEAD.size:
        length, kind, *_ = _HEAD.unpack_from(answer)
        if kind in (_DONE, _ERROR) or length < _HEAD.size:
            return found, False
        message, answer = answer[_HEAD.size:length], answer[_aligned(length):]
        if kind != _NEW_LINK or len(message) < _LINK.size:
            continue
        _, hardware, index, flags, _ = _LINK.unpack_from(message)
        if hardware == _ARPHRD_CAN:
            found.append(_interface(index, bool(flags & _IFF_UP), message[_LINK.size:]))
    return found, True


def _interface(index: int, up: bool, attributes: bytes) -> KernelInterface:
    link = dict(_attributes(attributes))
    info = dict(_attributes(link.get(_LINK_INFO, b'')))
    kind = _text(info.get(_KIND, b''))
    data = dict(_attributes(info.get(_DATA, b''))) if kind == 'can' else {}
    timing, state = data.get(_BIT_TIMING, b''), data.get(_CAN_STATE, b'')
    number = struct.unpack_from('=I', state)[0] if len(state) >= 4 else len(_STATES)
    return KernelInterface(
        _text(link.get(_NAME, b'')), index, up, kind,
        struct.unpack_from('=I', timing)[0] if len(timing) >= 4 else 0,
        _STATES[number] if number < len(_STATES) else '')


def _attributes(data: bytes) -> Iterator[tuple[int, bytes]]:
    while len(data) >= _ATTRIBUTE.size:
        length, kind = _ATTRIBUTE.unpack_from(data)
        if length < _ATTRIBUTE.size:
            return
        yield kind & _TYPE, data[_ATTRIBUTE.size:length]
        data = data[_aligned(length):]


def _text(data: bytes) -> str:
    return printable(os.fsdecode(data.rstrip(b'\0')))


def _aligned(length: int) -> int:
    return (length + 3) & ~3
