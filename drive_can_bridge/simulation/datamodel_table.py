# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The parameter table of a simulated DataModel drive, by wire number: registers, maps, EEPROM.

Both protocols of the family (29-bit and 11-bit identifiers) read and write the same table. All
numbers here are those of the wire; the offset of the configuration is in them already.
"""

from collections.abc import Callable, Sequence
import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter, Storage
from drive_can_bridge.protocols.datamodel.extended import SLOTS
from drive_can_bridge.protocols.datamodel.mapping import effective, padded
from drive_can_bridge.simulation.registers import Registers

# Times are compared with this much tolerance: 1.02 - 1.0 is less than 0.02.
_CLOCK_TOLERANCE = 1e-6


class DataModelTable:
    """
    Everything that can be addressed by a parameter number.

    :param eeprom_time: s that an EEPROM write takes.
    :param violation: called with the rule that was broken.
    """

    def __init__(self, configuration: DriveConfiguration, registers: Registers, *,
                 eeprom_time: float, violation: Callable[[str], None]) -> None:
        options = configuration.options
        self._offset: int = options.parameter_offset
        self._registers = registers
        self._eeprom_time = eeprom_time
        self._violation = violation
        self._eeprom_busy_until = -math.inf
        self._parameters: dict[int, Parameter] = {
            p.number + self._offset: p for p in registers.parameters.values()
            if p.number is not None}
        # what is sent again and again is volatile, unless the profile says otherwise
        self._volatile = {p.name for p in configuration.cyclic_request if p.storage is None}
        self._request_map, self._response_map = (
            [self._parameters[base + self._offset + slot].name for slot in range(SLOTS)]
            for base in (options.request_map_base, options.response_map_base))
        self._maps = {*self._request_map, *self._response_map}
        self.clear_maps()
        # with 11-bit identifiers there is no mapping, and as little to configure
        if getattr(options, 'mapping', '') != 'configure':
            for names, mapped in ((self._request_map, configuration.cyclic_request),
                                  (self._response_map, configuration.cyclic_response)):
                # nor is there a limit to how many are exchanged
                numbers = padded([(p.number or 0) + self._offset for p in mapped[:SLOTS]])
                for name, number in zip(names, numbers, strict=True):
                    registers.set_value(name, number)

    def read(self, number: int, count: int, now: float) -> list[int] | None:
        """Read parameters; None where the drive does not answer."""
        if self._busy(now):
            self._violation('read while an EEPROM write is under way (not answered)')
            return None
        words = [self._word(wanted) for wanted in range(number, number + count)]
        known = [word for word in words if word is not None]
        return known if len(known) == count else None

    def write(self, number: int, words: Sequence[int], now: float) -> None:
        """Write parameters. A frame with a number that does not exist is ignored as a whole."""
        known = [self._parameters[wanted] for wanted in range(number, number + len(words))
                 if wanted in self._parameters]
        if len(known) < len(words):
            return
        # one frame is one EEPROM write, however many words it has
        eeprom = any(map(self._takes_eeprom, known))
        lost = eeprom and self._busy(now)
        if lost:
            self._violation('EEPROM write less than 20 ms after the one before (lost)')
        for parameter, word in zip(known, words, strict=True):
            wears = self._takes_eeprom(parameter)
            if not (wears and lost):
                self._store(parameter, word, wears)
        if eeprom and not lost:
            self._eeprom_busy_until = now + self._eeprom_time

    def exchange(self, words: Sequence[int]) -> list[int]:
        """
        Apply a cyclic request to the parameters of the request map.

        :return: the words of the response; a parameter that does not exist reads 0.
        """
        for number, word in zip(self._mapped(self._request_map), words, strict=False):
            parameter = self._parameters.get(number)
            if parameter is None:
                continue
            if parameter.name in self._maps:
                self._violation('map parameter in the request map (ignored)')
                continue
            wears = parameter.writable and parameter.storage is Storage.EEPROM
            if wears:
                self._violation(f'EEPROM parameter {parameter.name} written cyclically')
            self._store(parameter, word, wears)
        return [self._word(number) or 0 for number in self._mapped(self._response_map)]

    def clear_maps(self) -> None:
        for name in self._maps:
            self._registers.set_value(name, 0)

    def name_of(self, raw: Parameter) -> str | None:
        """Return the name of the register with a number; None: there is none."""
        parameter = self._parameters.get((raw.number or 0) + self._offset)
        return None if parameter is None else parameter.name

    def _mapped(self, names: Sequence[str]) -> tuple[int, ...]:
        """Return the wire numbers that the slots of a telegram stand for."""
        return effective([self._registers.raw(name) for name in names])

    def _word(self, number: int) -> int | None:
        """Return a parameter as unsigned word; None where there is nothing to read."""
        parameter = self._parameters.get(number)
        if parameter is None or not parameter.readable:
            return None
        return self._registers.raw(parameter.name) & 0xFFFF

    def _busy(self, now: float) -> bool:
        return now < self._eeprom_busy_until - _CLOCK_TOLERANCE

    def _takes_eeprom(self, parameter: Parameter) -> bool:
        """Tell whether a write goes to EEPROM: unless it is known not to, or has no effect."""
        return (parameter.writable and parameter.storage is not Storage.RAM
                and parameter.name not in self._volatile)

    def _store(self, parameter: Parameter, word: int, wears: bool) -> None:
        """Write within the limits; what is refused keeps its value, nobody is told."""
        raw = self._registers.clamped(parameter.name, parameter.raw_from_word(word))
        if self._registers.refusal({parameter.name: raw}) is None:
            self._registers.write(parameter.name, raw, wear=int(wears))
