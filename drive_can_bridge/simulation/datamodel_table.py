# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The parameter table of a simulated DataModel drive, by wire number: registers, maps, EEPROM.

Both protocols of the family (29-bit and 11-bit identifiers) read and write the same table. All
numbers here are those of the wire; the offset of the configuration is in them already.
"""

from collections.abc import Callable, Sequence
import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import Parameter, Storage
from drive_can_bridge.protocols.datamodel.extended import SLOTS
from drive_can_bridge.protocols.datamodel.mapping import (
    effective, padded, REQUEST_MAP_BASE, RESPONSE_MAP_BASE,
)
from drive_can_bridge.simulation.plant import Plant

# Times are compared with this much tolerance: 1.02 - 1.0 is less than 0.02.
_CLOCK_TOLERANCE = 1e-6


class DataModelTable:
    """
    Everything that can be addressed by a parameter number.

    :param eeprom_time: s that an EEPROM write takes.
    :param violation: called with the rule that was broken.
    :ivar eeprom_writes: EEPROM cells written.
    :ivar request_map: wire numbers that the slots of a cyclic request stand for, up to the
        first 0.
    :ivar response_map: the same for a cyclic response.
    """

    def __init__(self, configuration: DriveConfiguration, plant: Plant, *, eeprom_time: float,
                 violation: Callable[[str], None]) -> None:
        options = configuration.family_options
        self._offset: int = options.get('parameter_offset', 0)
        self._plant = plant
        self._eeprom_time = eeprom_time
        self._violation = violation
        self._eeprom_busy_until = -math.inf
        self.eeprom_writes = 0
        self._parameters: dict[int, Parameter] = {
            p.number + self._offset: p for p in plant.parameters.values() if p.number is not None}
        request_base = options.get('request_map_base', REQUEST_MAP_BASE) + self._offset
        response_base = options.get('response_map_base', RESPONSE_MAP_BASE) + self._offset
        self._request_numbers = range(request_base, request_base + SLOTS)
        self._response_numbers = range(response_base, response_base + SLOTS)
        # what is sent again and again is volatile, unless the profile says otherwise
        self._volatile = {p.name for p in configuration.cyclic_request if p.storage is None}
        self._map = dict.fromkeys((*self._request_numbers, *self._response_numbers), 0)
        if options.get('mapping') != 'configure':
            self._preset(self._request_numbers, configuration.cyclic_request)
            self._preset(self._response_numbers, configuration.cyclic_response)
        self._maps_changed()

    # -- maps -------------------------------------------------------------------------------------

    def clear_maps(self) -> None:
        """Forget both maps."""
        self._map = dict.fromkeys(self._map, 0)
        self._maps_changed()

    def _maps_changed(self) -> None:
        self.request_map = effective([self._map[number] for number in self._request_numbers])
        self.response_map = effective([self._map[number] for number in self._response_numbers])

    # -- access -----------------------------------------------------------------------------------

    def read(self, number: int, count: int, now: float) -> tuple[int, ...] | None:
        """Read parameters; None where the drive does not answer."""
        if self._busy(now):
            self._violation('read while an EEPROM write is under way (not answered)')
            return None
        words = []
        for wanted in range(number, number + count):
            word = self.word(wanted)
            if word is None:
                return None
            words.append(word)
        return tuple(words)

    def write(self, number: int, words: Sequence[int], now: float) -> None:
        """Write parameters. A frame with a number that does not exist is ignored as a whole."""
        numbers = range(number, number + len(words))
        if not all(wanted in self._map or wanted in self._parameters for wanted in numbers):
            return
        # one frame is one EEPROM write, however many words it has
        eeprom = any(self._takes_eeprom(wanted) for wanted in numbers)
        lost = eeprom and self._busy(now)
        if lost:
            self._violation('EEPROM write less than 20 ms after the one before (lost)')
        for wanted, word in zip(numbers, words, strict=True):
            if not self._takes_eeprom(wanted):
                self._store(wanted, word)
            elif not lost:
                self._store(wanted, word)
                self.eeprom_writes += 1
        if eeprom and not lost:
            self._eeprom_busy_until = now + self._eeprom_time

    def cyclic_write(self, words: Sequence[int]) -> None:
        """Apply a cyclic request to the parameters of the request map."""
        for number, word in zip(self.request_map, words, strict=False):
            parameter = self._parameters.get(number)
            if number in self._map:
                self._violation('map parameter in the request map (ignored)')
            elif parameter is not None and parameter.writable:
                if parameter.storage is Storage.EEPROM:
                    self._violation(f'EEPROM parameter {parameter.name} written cyclically')
                    self.eeprom_writes += 1
                self._store(number, word)

    def cyclic_read(self) -> list[int]:
        """Return the words of a cyclic response; a parameter that does not exist reads 0."""
        return [self.word(number) or 0 for number in self.response_map]

    def word(self, number: int) -> int | None:
        """Return a parameter as unsigned word; None where there is nothing to read."""
        if number in self._map:
            return self._map[number]
        parameter = self._parameters.get(number)
        if parameter is None or not parameter.readable:
            return None
        return self._plant.raw(parameter.name) & 0xFFFF

    # -- raw names --------------------------------------------------------------------------------

    def name_of(self, raw_name: str) -> str | None:
        """Return the name for ``p<number>``: the profile's, itself for a map entry, or None."""
        digits = raw_name[1:]
        if raw_name[:1] != 'p' or not (digits.isascii() and digits.isdigit()):
            return None
        number = int(digits) + self._offset
        if number in self._map:
            return f'p{int(digits)}'
        parameter = self._parameters.get(number)
        return None if parameter is None else parameter.name

    def map_entry(self, raw_name: str) -> int:
        """Return a map entry by its raw name."""
        return self._map[int(raw_name[1:]) + self._offset]

    def set_map_entry(self, raw_name: str, word: int) -> None:
        """
        Set a map entry by hand.

        :raises ValueRefused: not a parameter number.
        """
        if not isinstance(word, int) or not 0 <= word <= 0xFFFF:
            raise ValueRefused(f'{word!r} is not a parameter number: 0 to 65535')
        self._map[int(raw_name[1:]) + self._offset] = word
        self._maps_changed()

    # -- inside -----------------------------------------------------------------------------------

    def _preset(self, numbers: Sequence[int], parameters: Sequence[Parameter]) -> None:
        # with 11-bit identifiers there may be more of them than a map holds
        entries = padded([(p.number or 0) + self._offset for p in parameters[:SLOTS]])
        self._map.update(zip(numbers, entries, strict=True))

    def _busy(self, now: float) -> bool:
        return now < self._eeprom_busy_until - _CLOCK_TOLERANCE

    def _takes_eeprom(self, number: int) -> bool:
        """Tell whether a write goes to EEPROM: unless it is known not to, or has no effect."""
        if number in self._map:
            return True
        parameter = self._parameters[number]
        return (parameter.writable and parameter.storage is not Storage.RAM
                and parameter.name not in self._volatile)

    def _store(self, number: int, word: int) -> None:
        if number in self._map:
            if f'p{number - self._offset}' not in self._plant.stuck:
                self._map[number] = word
                self._maps_changed()
            return
        parameter = self._parameters[number]
        if parameter.writable:
            self._plant.write(parameter.name, parameter.raw_from_word(word))
