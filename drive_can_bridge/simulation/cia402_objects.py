# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Which objects a simulated drive of CiA 402 has, whatever its profile lists.

What the profile lists keeps its name, type and limits; the rest is there under its raw name
(``x605a.00``). Types are those of EDS files of several makers, see docs/protocol_cia402.md.
"""

from collections.abc import Mapping
from typing import NamedTuple

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Access, Parameter, ParameterType
from drive_can_bridge.protocols.canopen.addressing import name_of_object
from drive_can_bridge.simulation.canopen.dictionary import Place

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


def own_parameters(configuration: DriveConfiguration) -> Mapping[str, Parameter]:
    """Return the objects of the standard that a profile does not list, by their raw names."""
    listed = {(each.index, each.subindex or 0)
              for each in configuration.profile.parameters.values()}
    return {name: Parameter(name=name, index=place[0], subindex=place[1], type=object_.type,
                            access=object_.access, listed=False)
            for place, object_ in STANDARD.items() if place not in listed
            for name in (name_of_object(*place),)}
