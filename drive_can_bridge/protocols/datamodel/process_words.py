# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The process data words of one drive: which parameter travels in which slot, and how to pack them.

Words are 16 bit, high byte first, slot 0 in BYTE0 and BYTE1, as in all telegrams of
:mod:`~drive_can_bridge.protocols.datamodel.extended`; here with the sign of each parameter.
"""

import struct

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.datamodel.extended import PAYLOAD


def words_struct(parameters: tuple[Parameter, ...], *, unsigned: int | None = None,
                 ) -> struct.Struct:
    """
    Return the packer of process data.

    :param unsigned: slot of a control word, which is unsigned whatever its type.
    """
    return struct.Struct('>' + ''.join(
        'h' if parameter.type.signed and slot != unsigned else 'H'
        for slot, parameter in enumerate(parameters)))


def unpack_unusual(parameters: tuple[Parameter, ...], data: bytes, *,
                   strict: bool) -> tuple[tuple[int, ...], str]:
    """
    Unpack a payload that has not eight bytes.

    :return: the words that it holds, as far as they are wanted; and what is wrong with it, ''
        where it holds them all and that will do.
    """
    if strict:
        return (), f'{len(data)} data bytes instead of {PAYLOAD}'
    needed = 2 * len(parameters)
    raws = words_struct(parameters[:len(data) // 2]).unpack_from(data)
    return raws, '' if len(data) >= needed else f'{len(data)} data bytes, {needed} needed'


def slot_of(parameters: tuple[Parameter, ...], name: str) -> int | None:
    """Return the slot of the parameter of this name, or None."""
    for slot, parameter in enumerate(parameters):
        if parameter.name == name:
            return slot
    return None


def wire_numbers(parameters: tuple[Parameter, ...], offset: int) -> tuple[int, ...]:
    """Return the numbers of parameters as they go over the wire, in slot order."""
    return tuple((parameter.number or 0) + offset for parameter in parameters)
