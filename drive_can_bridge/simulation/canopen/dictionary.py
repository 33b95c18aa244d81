# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The registers of a simulated drive as a CANopen object dictionary: by index and sub-index."""

from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.protocols.canopen import abort_codes
from drive_can_bridge.simulation.canopen.sdo import checked_length, CODES
from drive_can_bridge.simulation.plant import Refusal
from drive_can_bridge.simulation.registers import Refused, Registers

TOO_HIGH, TOO_LOW = 0x06090031, 0x06090032

#: index and sub-index
Place = tuple[int, int]


def bytes_of(parameter: Parameter) -> int:
    """Return how many bytes an object has; a BOOLEAN is one."""
    return 1 if parameter.type is ParameterType.BOOL else parameter.type.bits // 8


class ObjectDictionary:
    """
    Registers that have an index. Sub-index 0 says how many there are, where none stands there.

    :ivar cells: parameters by index and sub-index.
    """

    def __init__(self, registers: Registers) -> None:
        self._registers = registers
        self.cells: dict[Place, Parameter] = {
            (each.index, each.subindex or 0): each
            for each in registers.parameters.values() if each.index is not None}
        self._counts = {index: subindex for index, subindex in sorted(self.cells)
                        if (index, 0) not in self.cells}

    def name_of(self, raw: Parameter) -> str | None:
        cell = self.cells.get((raw.index or 0, raw.subindex or 0))
        return None if cell is None else cell.name

    def read_object(self, index: int, subindex: int) -> bytes:
        if subindex == 0 and index in self._counts:
            return bytes((self._counts[index],))
        cell = self._cell(index, subindex)
        if not cell.readable:
            raise Refused(abort_codes.READ_OF_WRITE_ONLY)
        return self.content(cell)

    def content(self, cell: Parameter) -> bytes:
        """Return what an object holds, as it travels."""
        word = cell.word_from_raw(self._registers.raw(cell.name))
        return word.to_bytes(cell.type.bits // 8, 'little')[:bytes_of(cell)]

    def write_object(self, index: int, subindex: int, data: bytes) -> None:
        if subindex == 0 and index in self._counts:
            raise Refused(abort_codes.WRITE_OF_READ_ONLY)
        cell = self._cell(index, subindex)
        raw = cell.raw_from_word(int.from_bytes(checked_length(data, bytes_of(cell)), 'little'))
        refusal = self._registers.refusal({cell.name: raw})
        if refusal is Refusal.OUT_OF_RANGE:
            low, high = cell.raw_limits
            raise Refused(TOO_HIGH if raw > high else TOO_LOW if raw < low else
                          abort_codes.VALUE_OUT_OF_RANGE)
        if refusal is not None:
            raise Refused(CODES[refusal])
        self._registers.write(cell.name, raw)

    def raw(self, index: int, subindex: int = 0) -> int:
        """Return the raw integer of an object that there is."""
        return self._registers.raw(self.cells[index, subindex].name)

    def _cell(self, index: int, subindex: int) -> Parameter:
        cell = self.cells.get((index, subindex))
        if cell is None:
            raise Refused(abort_codes.NO_SUCH_SUBINDEX if any(
                place[0] == index for place in self.cells) else abort_codes.NO_SUCH_OBJECT)
        return cell
