# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Find a drive's parameters by name, and turn users' values into raw integers.

A raw name (``p30``) of a parameter that the profile lists obeys the listed one's rules: access,
storage, limits. Only its value is raw: the unsigned integer on the wire.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
import re

from drive_can_bridge.core import sentences
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.parameters import (
    AccessMode, Parameter, ParameterType, Storage, Value, ValueKind)
from drive_can_bridge.core.text import nearest, printable

# Strictest first: where several listed parameters have one address, a raw name obeys them all.
_ACCESS = (AccessMode.READ_ONLY, AccessMode.WRITE_ONLY, AccessMode.READ_WRITE)
_STORAGE = (Storage.EEPROM, None, Storage.RAM)
#: bits of an integer that are looked at; no type has as many
_BITS_MAX = 64
#: index and sub-index, or number
_NUMBER = re.compile('(?:0x|[xp])?([0-9][0-9a-f]{0,4})h?(?:[.:]([0-9a-f]{1,3})h?)?', re.ASCII)
#: characters of an unknown name: it stands beside another in one line
NAME_SHOWN = 80


class ParameterDirectory:
    """
    All parameters of one drive.

    :param listed: the profile's table.
    :param raw_parameter: the family's way to resolve a raw name; None for other names.
    """

    def __init__(self, listed: dict[str, Parameter],
                 raw_parameter: Callable[[str], Parameter | None]) -> None:
        self.listed = listed
        self._raw_parameter = raw_parameter

    def find(self, name: str) -> Parameter | None:
        """Return a parameter by profile name or raw name; None if there is no such thing."""
        if name in self.listed:
            return self.listed[name]
        raw = self._raw_parameter(name)
        if raw is None:
            return None
        twins = self.twins(raw)
        if twins:
            access = {twin.access for twin in twins}
            storage = {twin.storage for twin in twins}
            raw = replace(raw, access=next(entry for entry in _ACCESS if entry in access),
                          storage=next(entry for entry in _STORAGE if entry in storage),
                          protected=any(twin.protected for twin in twins))
            if not raw.width_known:
                bits = max(twin.type.bits for twin in twins)
                raw = replace(raw, width_known=True, type=ParameterType(f'uint{bits}'))
        return raw

    def twins(self, parameter: Parameter) -> list[Parameter]:
        """Return the listed parameters whose rules apply: itself, or those of its address."""
        if parameter.listed:
            return [parameter]
        return [other for other in self.listed.values() if _place(other) == _place(parameter)]

    def unnamed(self, name: str, value: Value) -> Parameter | None:
        """Return the listed parameter that has names for values, but none for this one, if any."""
        parameter = self.find(name)
        if parameter is None:
            return None
        word = parameter.word_from_raw(self.raw_from_user(parameter, value))
        return next((twin for twin in self.twins(parameter) if twin.values and (
            twin.raw_from_word(word) not in dict(twin.values))), None)

    def unknown(self, name: str, *, hint: bool = True) -> Sentence:
        """Return that a name is unknown, with the nearest known one (which takes milliseconds)."""
        near = (self._raw_name(name) or nearest(name, self.listed)) if hint else None
        shown = printable(name, NAME_SHOWN) or "''"
        return sentences.unknown_parameter(shown, near)

    def _raw_name(self, written: str) -> str | None:
        """Return the raw name of a number as manuals write it (6041h, 1018:01, P102), if any."""
        number = _NUMBER.fullmatch(written.lower())
        if number is None:
            return None
        main, sub = number.groups()
        guesses = (f'p{main}.{sub}', f'x{main}.{sub}') if sub else (f'p{main}', f'x{main}.0')
        return next((guess for guess in guesses if self._raw_parameter(guess)), None)

    def raw_from_user(self, parameter: Parameter, value: object) -> int:
        """
        Return the raw integer for a value that a user wants to set.

        :raises ValueRefused: read-only, wrong type, out of range or not representable, in words.
        """
        if not parameter.writable:
            raise ValueRefused(sentences.read_only())
        kind = parameter.kind
        if kind is ValueKind.BOOL:
            right = isinstance(value, bool)
        elif kind is ValueKind.DOUBLE:
            right = isinstance(value, (int, float)) and not isinstance(value, bool)
        else:
            right = isinstance(value, int) and not isinstance(value, bool)
        if right and isinstance(value, int) and value.bit_length() > _BITS_MAX:
            # neither floats nor texts take what no type can carry by far
            raise ValueRefused(sentences.too_many_bits(
                value.bit_length(), parameter.range_text))
        if not right:
            raise ValueRefused(sentences.wrong_type(_type_name(value), kind.value))
        if parameter.listed:
            return parameter.raw_from_value(value)  # type: ignore[arg-type]
        return self._raw_from_integer(parameter, value)  # type: ignore[arg-type]

    def _raw_from_integer(self, parameter: Parameter, value: int) -> int:
        high = parameter.type.raw_range[1]
        if not -(high + 1) // 2 <= value <= high:
            raise ValueRefused(sentences.not_in_bits(
                value, parameter.type.bits, -(high + 1) // 2, high))
        if not parameter.width_known:
            return value  # how many bits its two's complement has, only the drive knows
        word = parameter.word_from_raw(value)
        for twin in self.twins(parameter):
            try:
                twin.check_limits(twin.value_from_raw(twin.raw_from_word(word)))
            except ValueRefused as error:
                raise ValueRefused(sentences.raw_refused(
                    value, twin.name, error.sentence)) from None
        return word


def contradictions(items: Sequence[tuple[Parameter, int]]) -> list[Sentence]:
    """
    Return, for each parameter to be set, which other one gives it another value; '' of none.

    Of two values that are written one after the other the first would be reported as written, and
    be overwritten.

    :param items: found by name, with raw integers.
    """
    wanted: dict[object, dict[int, Parameter]] = {}     # by place, by word: the first parameter
    asked = []
    for parameter, raw in items:
        addressed = parameter.number is not None or parameter.index is not None
        words = wanted.setdefault(_place(parameter) if addressed else parameter, {})
        word = parameter.word_from_raw(raw)
        words.setdefault(word, parameter)
        asked.append((words, word))
    return [next((sentences.contradicted(other.name) for another, other in words.items()
                  if another != word), NOTHING) for words, word in asked]


def _place(parameter: Parameter) -> tuple[int | None, int, int | None]:
    # without a sub-index it is the first element
    return parameter.number, parameter.subindex or 0, parameter.index


def _type_name(value: object) -> str:
    if value is None:
        return 'not set'
    if isinstance(value, (list, tuple)) or hasattr(value, 'typecode'):
        return 'array'
    return {bool: 'bool', int: 'integer', float: 'double', str: 'string'}.get(
        type(value), type(value).__name__)
