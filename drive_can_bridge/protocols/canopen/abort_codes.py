# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The codes with which a CANopen node refuses a request (CiA 301, SDO abort codes)."""

TOGGLE_NOT_ALTERNATED = 0x05030000
UNKNOWN_COMMAND = 0x05040001
READ_OF_WRITE_ONLY = 0x06010001
WRITE_OF_READ_ONLY = 0x06010002
NO_SUCH_OBJECT = 0x06020000
NO_SUCH_SUBINDEX = 0x06090011
VALUE_OUT_OF_RANGE = 0x06090030
DEVICE_STATE = 0x08000022

TEXTS = {
    0x05030000: 'toggle bit not alternated',
    0x05040000: 'SDO protocol timed out',
    0x05040001: 'unknown command or function code',
    0x05040002: 'invalid block size',
    0x05040003: 'invalid sequence number',
    0x05040004: 'CRC error',
    0x05040005: 'out of memory',
    0x06010000: 'access not supported',
    0x06010001: 'read of a write-only object',
    0x06010002: 'write to a read-only object',
    0x06020000: 'no such register or object',
    0x06040041: 'object cannot be mapped to a PDO',
    0x06040042: 'mapping exceeds the length of the PDO',
    0x06040043: 'parameters are incompatible',
    0x06040047: 'internal incompatibility in the device',
    0x06060000: 'hardware error',
    0x06070010: 'data type or length does not match',
    0x06070012: 'data type does not match, too long',
    0x06070013: 'data type does not match, too short',
    0x06090011: 'no such sub-index',
    0x06090030: 'value out of range',
    0x06090031: 'value too high',
    0x06090032: 'value too low',
    0x06090036: 'maximum is less than minimum',
    0x060A0023: 'resource not available',
    0x08000000: 'general error',
    0x08000020: 'data cannot be transferred or stored',
    0x08000021: 'data cannot be stored because of local control',
    0x08000022: 'data cannot be stored in the present state of the device',
    0x08000023: 'no object dictionary',
    0x08000024: 'no data available',
}


def describe(code: int) -> str:
    """
    Return code and meaning for a user.

    >>> describe(0x06090030)
    '06090030h (value out of range)'
    """
    return f'{code:08X}h ({TEXTS.get(code, "unknown code")})'
