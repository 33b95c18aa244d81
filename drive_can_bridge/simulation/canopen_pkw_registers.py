# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The 16-bit registers of a simulated controller, by register number and by CANopen address.

A value of 32 bits takes two registers, the order of its words is that of the configuration. A
refused access changes nothing and carries an SDO abort code.
"""

from collections import Counter
from typing import NamedTuple

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter, Storage
from drive_can_bridge.protocols.canopen import abort_codes
from drive_can_bridge.protocols.canopen_pkw.object_map import BLOCKS, object_of, register_of
from drive_can_bridge.protocols.canopen_pkw.pkw import Address, WORD_MAX
from drive_can_bridge.simulation.canopen.sdo import checked_length, CODES
from drive_can_bridge.simulation.registers import Refused, Registers


class Cell(NamedTuple):
    """One register: the parameter it belongs to, and the lowest bit of what it holds of it."""

    parameter: Parameter
    shift: int


class RegisterTable:
    """Everything that can be addressed."""

    def __init__(self, configuration: DriveConfiguration, registers: Registers) -> None:
        self._registers = registers
        self._word_order = configuration.options.word_order
        self._cells: dict[Address, Cell] = {}
        parameters = list(registers.parameters.values())
        # what the profile says goes before what follows from the table of the vendor
        for parameter in parameters:
            if parameter.number is not None:
                self._enter(parameter, Address(parameter.number))
            if parameter.index is not None:
                self._enter(parameter, Address(parameter.index, parameter.subindex or 0))
        for parameter in parameters:
            register = register_number(parameter)
            place = None if register is None else object_of(register)
            if register is not None:
                self._enter(parameter, Address(register))
            if place is not None and parameter.index is None:
                self._enter(parameter, Address(*place))

    def _enter(self, parameter: Parameter, address: Address) -> None:
        shifts = range(0, parameter.type.bits, 16)
        if (parameter.word_order or self._word_order) == 'high_first':
            shifts = shifts[::-1]
        for shift in shifts:
            self._cells.setdefault(address, Cell(parameter, shift))
            address = address.next

    def read(self, address: Address, count: int) -> tuple[int, ...]:
        """
        Read one register or two adjacent ones.

        :raises Refused: there is none, or it cannot be read.
        """
        cells = self._find(address, count)
        for cell in cells:
            if not cell.parameter.readable:
                raise Refused(abort_codes.READ_OF_WRITE_ONLY)
        return tuple([self._value(cell.parameter) >> cell.shift & WORD_MAX for cell in cells])

    def write(self, address: Address, words: tuple[int, ...]) -> None:
        """
        Write one register or two adjacent ones, or none of them.

        :raises Refused: there is none, it is read-only, or it does not take the value.
        """
        values: dict[str, int] = {}
        wear: Counter[str] = Counter()
        for cell, word in zip(self._find(address, len(words)), words, strict=True):
            parameter = cell.parameter
            value = values.get(parameter.name, self._value(parameter))
            values[parameter.name] = value & ~(WORD_MAX << cell.shift) | word << cell.shift
            wear[parameter.name] += parameter.storage is Storage.EEPROM
        raws = {name: self._registers.parameters[name].raw_from_word(value)
                for name, value in values.items()}
        refusal = self._registers.refusal(raws)
        if refusal is not None:
            raise Refused(CODES[refusal])
        for name, raw in raws.items():
            self._registers.write(name, raw, wear=wear[name])

    def highest_subindex(self, index: int) -> int | None:
        return max((address.subindex for address in self._cells
                    if address.subindex is not None and address.word == index), default=None)

    def read_object(self, index: int, subindex: int) -> bytes:
        """Read a register, or how many of them an index has."""
        highest = self.highest_subindex(index)
        if subindex == 0 and highest is not None:
            return bytes((highest,))
        return self.read(Address(index, subindex), 1)[0].to_bytes(2, 'little')

    def write_object(self, index: int, subindex: int, data: bytes) -> None:
        address = Address(index, subindex)
        if address in self._cells:
            checked_length(data, 2)
        self.write(address, (int.from_bytes(data[:2], 'little'),))

    def name_of(self, raw: Parameter) -> str | None:
        """Return the name of the parameter at a register or object; None: there is none."""
        address = Address(raw.index or 0, raw.subindex) if raw.number is None else (
            Address(raw.number))
        cell = self._cells.get(address)
        return None if cell is None else cell.parameter.name

    def _find(self, address: Address, count: int) -> list[Cell]:
        addresses = (address,) if count == 1 else (address, address.next)
        for each in addresses:
            if each not in self._cells:
                # no such number or index, or no such sub-index
                known = (any(block.index == each.word for block in BLOCKS)
                         or self.highest_subindex(each.word) is not None)
                raise Refused(abort_codes.NO_SUCH_SUBINDEX if each.by_object and known
                              else abort_codes.NO_SUCH_OBJECT)
        return [self._cells[each] for each in addresses]

    def _value(self, parameter: Parameter) -> int:
        return parameter.word_from_raw(self._registers.raw(parameter.name))


def register_number(parameter: Parameter) -> int | None:
    """Return the register of a parameter, by its number or by its CANopen address."""
    if parameter.number is not None or parameter.index is None:
        return parameter.number
    return register_of(parameter.index, parameter.subindex or 0)

