# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The object dictionary of a simulated drive of CiA 402: by index and sub-index, over the registers.

What the profile lists keeps its name, type and limits; the rest of what the standard has is there
under its raw name (``x605a.00``). Which types and defaults: manuals of several makers, see
docs/protocol_cia402.md. Nothing survives a loss of power but what 1010h stored.
"""

from collections.abc import Mapping
from typing import NamedTuple

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Access, Parameter, ParameterType
from drive_can_bridge.protocols.canopen import abort_codes
from drive_can_bridge.protocols.canopen.addressing import name_of_object
from drive_can_bridge.simulation.canopen.sdo import checked_length, CODES
from drive_can_bridge.simulation.registers import Refusal, Refused, Registers

#: index and sub-index
Place = tuple[int, int]

_TYPES = {'u8': ParameterType.UINT8, 'i8': ParameterType.INT8, 'u16': ParameterType.UINT16,
          'i16': ParameterType.INT16, 'u32': ParameterType.UINT32, 'i32': ParameterType.INT32}


class Standard(NamedTuple):
    """An object of the standard: its type, whether it may be written, and what is in a new one."""

    type: ParameterType
    access: Access
    initial: int = 0


def _standard(text: str) -> dict[Place, Standard]:
    """Read a table: index[.sub-index], type, access, and what is in it at first."""
    found = {}
    for line in text.split('\n'):
        for row in filter(None, map(str.strip, line.split(';'))):
            where, kind, access, *initial = row.split()
            index, _, subindex = where.partition('.')
            found[int(index, 16), int(subindex or '0', 16)] = Standard(
                _TYPES[kind], Access(access), int(initial[0], 0) if initial else 0)
    return found


#: 605Ah 2: quick-stop ramp; 605Ch 1 and 605Dh 1: slow-down ramp; 605Bh 0: power off; 605Eh 2:
#: quick-stop ramp; 6007h 1: a lost bus is a fault. 6065h: an increment is 1/10,000 revolution
STANDARD = _standard("""
    1002 u32 ro; 1005 u32 rw 0x80; 1006 u32 rw; 1019 u8 rw; 1029.1 u8 rw
    6007 i16 rw 1; 603F u16 ro; 6040 u16 rw; 6041 u16 ro
    6042 i16 rw; 6043 i16 ro; 6044 i16 ro; 6046.1 u32 rw; 6046.2 u32 rw 3000
    6048.1 u32 rw 3000; 6048.2 u16 rw 1; 6049.1 u32 rw 3000; 6049.2 u16 rw 1
    605A i16 rw 2; 605B i16 rw; 605C i16 rw 1; 605D i16 rw 1; 605E i16 rw 2
    6060 i8 rw; 6061 i8 ro; 6062 i32 ro; 6064 i32 ro; 6065 u32 rw 20000
    606B i32 ro; 606C i32 ro; 6071 i16 rw; 6072 u16 rw 2000; 6074 i16 ro; 6075 u32 rw 4000
    6076 u32 rw 1270; 6077 i16 ro; 6078 i16 ro; 6079 u32 ro
    607A i32 rw; 607C i32 rw; 607D.1 i32 rw -0x80000000; 607D.2 i32 rw 0x7FFFFFFF
    607F u32 rw 500000; 6081 u32 rw 100000; 6083 u32 rw 500000; 6084 u32 rw 500000
    6085 u32 rw 2500000; 6086 i16 rw; 6087 u32 rw 1000
    6098 i8 rw 35; 6099.1 u32 rw 20000; 6099.2 u32 rw 5000; 609A u32 rw 500000
    60C0 i16 rw; 60C1.1 i32 rw; 60C2.1 u8 rw 1; 60C2.2 i8 rw -3
    60F4 i32 ro; 60FD u32 ro; 60FF i32 rw; 6502 u32 ro 0x3EF
""")
#: sub-index 0 of those that have others: how many
_COUNTS = {index: max(s for i, s in STANDARD if i == index) for index, sub in STANDARD if sub}


def own_parameters(configuration: DriveConfiguration) -> Mapping[str, Parameter]:
    """Return the objects of the standard that a profile does not list, by their raw names."""
    listed = {(each.index, each.subindex or 0)
              for each in configuration.profile.parameters.values()}
    return {name: Parameter(name=name, index=place[0], subindex=place[1], type=object_.type,
                            access=object_.access, listed=False)
            for place, object_ in STANDARD.items() if place not in listed
            for name in (name_of_object(*place),)}


def bytes_of(parameter: Parameter) -> int:
    """Return how many bytes an object has; a BOOLEAN is one."""
    return 1 if parameter.type is ParameterType.BOOL else parameter.type.bits // 8


class ObjectDictionary:
    """
    The registers as objects.

    :ivar cells: parameters by index and sub-index.
    """

    def __init__(self, registers: Registers) -> None:
        self._registers = registers
        self.cells: dict[Place, Parameter] = {
            (each.index, each.subindex or 0): each
            for each in registers.parameters.values() if each.index is not None}

    def name_of(self, raw: Parameter) -> str | None:
        cell = self.cells.get((raw.index or 0, raw.subindex or 0))
        return None if cell is None else cell.name

    def read_object(self, index: int, subindex: int) -> bytes:
        if subindex == 0 and (index, 0) not in self.cells and index in _COUNTS:
            return bytes((_COUNTS[index],))
        cell = self._cell(index, subindex)
        if not cell.readable:
            raise Refused(abort_codes.READ_OF_WRITE_ONLY)
        return self.content(cell)

    def content(self, cell: Parameter) -> bytes:
        """Return what an object holds, as it travels."""
        return cell.word_from_raw(self._registers.raw(cell.name)).to_bytes(
            max(bytes_of(cell), cell.type.bits // 8), 'little')[:bytes_of(cell)]

    def write_object(self, index: int, subindex: int, data: bytes) -> None:
        if subindex == 0 and (index, 0) not in self.cells and index in _COUNTS:
            raise Refused(abort_codes.WRITE_OF_READ_ONLY)
        cell = self._cell(index, subindex)
        raw = cell.raw_from_word(int.from_bytes(checked_length(data, bytes_of(cell)), 'little'))
        refusal = self._registers.refusal({cell.name: raw})
        if refusal is not None:
            low, high = cell.raw_limits
            raise Refused(CODES[refusal] if refusal is not Refusal.OUT_OF_RANGE else
                          0x06090031 if raw > high else 0x06090032 if raw < low else
                          abort_codes.VALUE_OUT_OF_RANGE)
        self._registers.write(cell.name, raw)

    def raw(self, index: int, subindex: int = 0) -> int:
        """Return the raw integer of an object that the standard has."""
        return self._registers.raw(self.cells[index, subindex].name)

    def _cell(self, index: int, subindex: int) -> Parameter:
        cell = self.cells.get((index, subindex))
        if cell is None:
            raise Refused(abort_codes.NO_SUCH_SUBINDEX if any(
                place[0] == index for place in self.cells) else abort_codes.NO_SUCH_OBJECT)
        return cell
