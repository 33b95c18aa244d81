# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The little of CANopen that goes with the mailbox: NMT, boot-up, heartbeat, emergency (CiA 301).

============= ========== ====================================================================
frame         identifier data
============= ========== ====================================================================
NMT command   000h       command, node (0: all nodes)
SYNC          080h       none (one counter byte, where 1019h says so)
emergency     080h+node  error code (low byte first), error register, 5 bytes of the maker
PKW response  480h+node  transmit PDO4, 8 bytes (may be configured otherwise)
PKW request   500h+node  receive PDO4, 8 bytes (may be configured otherwise)
boot-up       700h+node  00h
heartbeat     700h+node  state
============= ========== ====================================================================

All identifiers have 11 bits. PDOs are sent and processed in the state *operational* only; after
boot-up a node waits in *pre-operational* for the command ``start``.
"""

from enum import IntEnum
from typing import NamedTuple

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.errors import LocalProtocolError, RemoteProtocolError
from drive_can_bridge.core.frame import Frame

NODE_MAX = 127
NMT_IDENTIFIER = 0x000
SYNC_IDENTIFIER = 0x080
EMERGENCY_BASE = 0x080
RESPONSE_BASE = 0x480
REQUEST_BASE = 0x500
HEARTBEAT_BASE = 0x700
#: what a node listens to and sends on from the factory (CiA 301, "predefined connection set"),
#: besides emergency messages and heartbeat; plus the node's number
PREDEFINED_SET = {
    0x180: 'transmit PDO1 of', 0x200: 'receive PDO1 of',
    0x280: 'transmit PDO2 of', 0x300: 'receive PDO2 of',
    0x380: 'transmit PDO3 of', 0x400: 'receive PDO3 of',
    RESPONSE_BASE: 'transmit PDO4 of', REQUEST_BASE: 'receive PDO4 of',
    0x580: 'SDO responses of', 0x600: 'SDO requests to',
}
EMERGENCY_LENGTH = 8
NO_ERROR = 0x0000


class NmtCommand(IntEnum):
    """What an NMT master orders."""

    START = 0x01
    STOP = 0x02
    ENTER_PRE_OPERATIONAL = 0x80
    RESET_NODE = 0x81
    RESET_COMMUNICATION = 0x82


class NmtState(IntEnum):
    """What a node reports of itself on its heartbeat identifier."""

    BOOT_UP = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F

    @property
    def text(self) -> str:
        """The state in words."""
        return self.name.lower().replace('_', '-')


class Emergency(NamedTuple):
    """
    An emergency message.

    :param code: error code; 0000h says that there is no error any more.
    :param register: error register (object 1001h).
    :param manufacturer: five bytes that the maker defines.
    """

    code: int
    register: int = 0
    manufacturer: bytes = bytes(5)

    @property
    def text(self) -> str:
        """The message in words, with all its numbers."""
        if self.code == NO_ERROR:
            return 'no error'
        text = f'{self.code:04X}h ({_meaning(self.code)}), error register {self.register:02X}h'
        if any(self.manufacturer):
            text += f', manufacturer {self.manufacturer.hex(" ").upper()}'
        return text


#: meaning of emergency codes by (code & mask): the most exact mask that has an entry wins
_EMERGENCIES = {
    0xFFFF: {
        0x8110: 'CAN overrun',
        0x8120: 'CAN in error passive mode',
        0x8130: 'life guard or heartbeat error',
        0x8140: 'recovered from bus off',
        0x8150: 'collision of CAN identifiers',
        0x8210: 'PDO not processed: wrong length',
        0x8220: 'PDO too long',
        0x8230: 'destination object not available',
        0x8240: 'unexpected SYNC data length',
        0x8250: 'receive PDO timed out',
    },
    0xFF00: {
        0x2100: 'current, input side',
        0x2200: 'current, inside the device',
        0x2300: 'current, output side',
        0x3100: 'mains voltage',
        0x3200: 'voltage inside the device',
        0x3300: 'output voltage',
        0x4100: 'ambient temperature',
        0x4200: 'device temperature',
        0x6100: 'internal software',
        0x6200: 'user software',
        0x6300: 'data set',
        0x8100: 'communication',
        0x8200: 'protocol error',
        0xF000: 'additional functions',
        0xFF00: 'device specific',
    },
    0xF000: {
        0x0000: 'error reset',
        0x1000: 'generic error',
        0x2000: 'current',
        0x3000: 'voltage',
        0x4000: 'temperature',
        0x5000: 'device hardware',
        0x6000: 'device software',
        0x7000: 'additional modules',
        0x8000: 'monitoring',
        0x9000: 'external error',
    },
}


def _meaning(code: int) -> str:
    for mask, meanings in _EMERGENCIES.items():
        text = meanings.get(code & mask)
        if text is not None:
            return text
    return 'unknown error'


# -- encoding -------------------------------------------------------------------------------------


def encode_nmt(command: NmtCommand, node: int) -> Frame:
    """
    Encode an NMT command.

    :param node: 1 to 127; 0: all nodes.
    """
    if node != 0:
        check_node(node)
    return Frame(NMT_IDENTIFIER, bytes((command, node)), False)


def encode_sync() -> Frame:
    """Encode a SYNC without a counter."""
    return Frame(SYNC_IDENTIFIER, b'', False)


def encode_heartbeat(node: int, state: NmtState) -> Frame:
    """Encode a heartbeat; with ``BOOT_UP`` it is the boot-up frame (the device's side)."""
    check_node(node)
    return Frame(HEARTBEAT_BASE + node, bytes((state,)), False)


def encode_emergency(node: int, emergency: Emergency) -> Frame:
    """Encode an emergency message (the device's side)."""
    check_node(node)
    code, register, manufacturer = emergency
    if not (0 <= code <= 0xFFFF and 0 <= register <= 0xFF and len(manufacturer) == 5):
        raise LocalProtocolError(f'{emergency!r} does not fit an emergency message')
    data = code.to_bytes(2, 'little') + bytes((register,)) + manufacturer
    return Frame(EMERGENCY_BASE + node, data, False)


def check_node(node: int) -> None:
    """
    Check a node-ID.

    :raises LocalProtocolError: not 1 to 127.
    """
    if not 1 <= node <= NODE_MAX:
        raise LocalProtocolError(f'node {node} does not exist: 1 to {NODE_MAX}')


# -- decoding -------------------------------------------------------------------------------------


def decode_nmt(data: bytes) -> tuple[int, int]:
    """
    Return command and node of an NMT frame. The command may be one that does not exist.

    :raises RemoteProtocolError: not two bytes.
    """
    if len(data) != 2:
        raise RemoteProtocolError(frame_sentences.telegram_length('NMT frame', len(data), 2))
    return data[0], data[1]


def decode_heartbeat(data: bytes) -> NmtState:
    """
    Return the state of a boot-up frame or heartbeat.

    Bit 7 is left out: answers to node guarding, which have the same identifier, toggle it. Some
    devices send eight bytes; the first one is the state.

    :raises RemoteProtocolError: not one byte, nor eight, or a state that does not exist.
    """
    if not data:
        raise RemoteProtocolError(frame_sentences.heartbeat_empty())
    if len(data) not in (1, 8):
        raise RemoteProtocolError(frame_sentences.telegram_length('heartbeat', len(data), 1))
    try:
        return NmtState(data[0] & 0x7F)
    except ValueError:
        raise RemoteProtocolError(frame_sentences.heartbeat_unknown(data[0])) from None


def decode_emergency(data: bytes) -> Emergency:
    """
    Read an emergency message.

    :raises RemoteProtocolError: not eight bytes.
    """
    if len(data) != EMERGENCY_LENGTH:
        raise RemoteProtocolError(
            frame_sentences.telegram_length('emergency', len(data), EMERGENCY_LENGTH))
    return Emergency(int.from_bytes(data[:2], 'little'), data[2], data[3:])
