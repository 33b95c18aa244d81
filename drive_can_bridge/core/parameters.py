# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A parameter of a drive, and the way between its raw integer and its physical value.

``word``
    what stands on the wire: an unsigned integer of the type's width.
``raw``
    the same bits read by the parameter's type: ``FA24h`` of an int16 is -1500.
``value``
    what users see. ``raw * scale + offset`` as float where the parameter has a scale, an offset or
    a unit; a bool for ``type: bool``; the raw integer otherwise.
"""

from dataclasses import dataclass
from enum import Enum
from functools import cached_property
import math
import sys
from typing import Union

from drive_can_bridge.core import sentences
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.text import value_text

Value = Union[float, int, bool]

#: object of CANopen that is written in hexadecimal
_DEVICE_TYPE = 0x1000
#: Physical limits are compared with this much tolerance, relative to one raw step, so that
#: 30000 * 0.1 = 3000.0000000000005 does not fall out of "maximum: 3000".
STEP_TOLERANCE = 1e-6
# Beyond any integer type, and still an integer for floor().
_STEPS_MAX = 1e18
_NORMAL_MIN = sys.float_info.min


def is_misplaced_integer(value: Value) -> bool:
    """
    Return whether a double is so small that it is none: an integer was put into its field.

    Message classes check no types, and so the bytes in its place are used: the size of the
    integer. 300 arrives as 5e-324, from Python 3.12 on as 4e-323, and 0 as 5e-324.
    """
    return isinstance(value, float) and 0.0 < abs(value) < _NORMAL_MIN


class ParameterType(Enum):
    """
    Width and sign of a parameter on the wire.

    :ivar bits: width.
    :ivar signed: two's complement, or not.
    :ivar raw_range: smallest and largest raw integer.
    """

    BOOL = 'bool'
    INT8 = 'int8'
    UINT8 = 'uint8'
    INT16 = 'int16'
    UINT16 = 'uint16'
    INT32 = 'int32'
    UINT32 = 'uint32'

    def __init__(self, name: str) -> None:
        # no properties: every word of every telegram asks for them
        self.bits = next((bits for bits in (8, 32) if name.endswith(str(bits))), 16)
        self.signed = name.startswith('int')
        if name == 'bool':
            self.raw_range = 0, 1
        elif self.signed:
            self.raw_range = -(1 << self.bits - 1), (1 << self.bits - 1) - 1
        else:
            self.raw_range = 0, (1 << self.bits) - 1


class ValueKind(Enum):
    """The kinds of values, by one rule for topics, commands and services."""

    DOUBLE = 'double'
    INTEGER = 'integer'
    BOOL = 'bool'

    @property
    def words(self) -> str:
        """A value of this kind in words, for a refusal: ``a number``."""
        return _KIND_WORDS[self]


_KIND_WORDS = {ValueKind.DOUBLE: 'a number', ValueKind.INTEGER: 'an integer',
               ValueKind.BOOL: 'true or false'}


class AccessMode(Enum):
    """What a user may do with a parameter."""

    READ_ONLY = 'ro'
    READ_WRITE = 'rw'
    WRITE_ONLY = 'wo'


class Storage(Enum):
    """Where the drive keeps a written value."""

    RAM = 'ram'
    EEPROM = 'eeprom'


@dataclass(frozen=True)
class Parameter:
    """
    One row of a drive's parameter table.

    :param name: profile name, or the raw name (``p30``, ``p465``, ``x2004.10``) it was asked by.
    :param number: parameter number (PNU, register); None where only process data carry it.
    :param scale: physical units per raw step; not zero.
    :param offset: physical value of raw 0.
    :param unit: unit of the physical value, as written in the profile.
    :param storage: None: not in the profile.
    :param minimum: smallest allowed physical value.
    :param maximum: largest allowed physical value.
    :param neutral: value sent while there is no fresh command; None means what encodes to raw 0.
    :param neutral_from: name of the actual value that is sent instead of it: the axis stays where
        it is; '': ``neutral`` holds.
    :param limit: it bounds, and moves nothing: it needs no arming, and the last command stands.
    :param arming_tolerance: how far from neutral a command may be and still arm.
    :param bits: named bits, (name, bit number).
    :param values: names of values, (raw integer, name).
    :param subindex: array index (CANnord) or CANopen sub-index.
    :param index: CANopen index.
    :param listed: stands in the profile; False for a parameter addressed by its raw name.
    :param word_order: 32-bit values: ``high_first`` or ``low_first``; None: as the drive reports.
    :param protected: a restored backup leaves it alone unless requested otherwise.
    :param verified: the profile's own mark on the entry; None: there is none.
    :param width_known: False for a raw name whose width only the drive knows; ``type`` is then the
        widest possible.
    """

    name: str
    type: ParameterType = ParameterType.UINT16
    number: int | None = None
    scale: float = 1.0
    offset: float = 0.0
    unit: str = ''
    access: AccessMode = AccessMode.READ_WRITE
    storage: Storage | None = None
    minimum: float | None = None
    maximum: float | None = None
    neutral: float | None = None
    neutral_from: str = ''
    limit: bool = False
    arming_tolerance: float = 0.0
    description: str = ''
    bits: tuple[tuple[str, int], ...] = ()
    values: tuple[tuple[int, str], ...] = ()
    subindex: int | None = None
    index: int | None = None
    word_order: str | None = None
    scaled: bool = False
    listed: bool = True
    protected: bool = False
    verified: bool | None = None
    width_known: bool = True

    @property
    def kind(self) -> ValueKind:
        """The kind of its values: double, integer or bool."""
        if self.scaled:
            return ValueKind.DOUBLE
        if self.type is ParameterType.BOOL:
            return ValueKind.BOOL
        return ValueKind.INTEGER

    @property
    def readable(self) -> bool:
        """Whether a service can read it."""
        return self.access is not AccessMode.WRITE_ONLY

    @property
    def writable(self) -> bool:
        """Whether a service or command can write it."""
        return self.access is not AccessMode.READ_ONLY

    @property
    def stores(self) -> bool:
        """Whether a write makes the drive store what it has in its RAM: 1010h of CANopen."""
        return self.index == 0x1010

    def text(self, value: Value) -> str:
        """Return a value for people: a CANopen device type (1000h) in hexadecimal, as EDS do."""
        if self.index == _DEVICE_TYPE and not self.scaled:
            return f'{value:08X}h'
        return value_text(value)

    def shown(self, raw: int) -> str:
        """Return a value as the manual writes it: with as many decimals as a raw step has."""
        value = self.value_from_raw(raw)
        decimals = max(0, -math.floor(math.log10(abs(self.scale)) + 1e-9)) if self.scaled else 0
        return f'{value:.{decimals}f}' if decimals <= 6 else value_text(value)

    def name_of(self, value: Value) -> str:
        """Return the name of a value; '' if it has none."""
        return next((name for raw, name in self.values
                     if self.value_from_raw(raw) == value), '') if self.values else ''

    def named(self, value: Value) -> str:
        """Return a value for people, with its name beside it if it has one: ``3 bus``."""
        return f'{self.text(value)} {self.name_of(value)}'.rstrip()

    def value_named(self, name: str) -> Value | None:
        """Return the value of a name; None: there is no such name."""
        return next((self.value_from_raw(raw) for raw, known in self.values if known == name),
                    None)

    @property
    def address(self) -> str:
        """The address as in the drive's manual: ``P30``, ``P613.5``, ``2004h.06h``."""
        if self.number is not None:
            # with an index, the sub-index belongs to that one
            array = self.subindex is not None and self.index is None
            suffix = f'.{self.subindex}' if array else ''
            return f'P{self.number}{suffix}'
        if self.index is not None:
            return f'{self.index:04X}h.{self.subindex or 0:02X}h'
        return 'process data'

    @property
    def neutral_raw(self) -> int:
        """The raw integer that is sent while there is no fresh command."""
        return 0 if self.neutral is None else self.raw_from_value(self.neutral)

    # -- raw <-> word -----------------------------------------------------------------------------

    def raw_from_word(self, word: int) -> int:
        """Read an unsigned wire word by this parameter's type."""
        if self.type.signed and word >> self.type.bits - 1:
            return word - (1 << self.type.bits)
        return word

    def word_from_raw(self, raw: int) -> int:
        """Return the unsigned wire word of a raw integer."""
        return raw & (1 << self.type.bits) - 1

    # -- raw <-> value ----------------------------------------------------------------------------

    def value_from_raw(self, raw: int) -> Value:
        """Return the physical value of a raw integer."""
        if self.scaled:
            return raw * self.scale + self.offset
        if self.type is ParameterType.BOOL:
            return raw != 0
        return raw

    def raw_from_value(self, value: Value) -> int:
        """
        Return the raw integer nearest to a physical value.

        :raises ValueRefused: not finite, subnormal, wrong type, outside ``minimum..maximum``, or
            outside what the type can represent. Nothing is ever clamped.
        """
        # nearly all commands; the rest has reasons
        if type(value) is float and self.scaled:
            low, high = self._carried_limits
            if low <= value <= high and not 0.0 < abs(value) < _NORMAL_MIN:
                raw = math.floor((value - self.offset) / self.scale + 0.5)
                least, most = self.raw_limits
                if least <= raw <= most:
                    return raw
        if self.type is ParameterType.BOOL:
            if value is True or value is False:
                return int(value)
            raise ValueRefused(sentences.not_a_bool(repr(value)))
        if isinstance(value, bool):
            raise ValueRefused(sentences.not_a_number(repr(value)))
        if isinstance(value, float):
            if is_misplaced_integer(value):
                raise ValueRefused(sentences.misplaced_integer(value))
            if math.isnan(value):
                raise ValueRefused(sentences.nan_refused())
            if not math.isfinite(value):
                raise ValueRefused(sentences.not_finite(str(value)))
        self.check_limits(value)
        if not self.scaled:
            if isinstance(value, float) and not value.is_integer():
                raise ValueRefused(sentences.not_an_integer(value_text(value)))
            raw = int(value)
        else:
            raw = math.floor(self.steps(value) + 0.5)
        low, high = self.type.raw_range
        if not low <= raw <= high:
            raise ValueRefused(sentences.not_carried(
                value_text(value), self.type.value,
                _in_words(self.value_range) + self._unit_suffix))
        low, high = self.raw_limits
        if low > high:
            raise ValueRefused(sentences.none_in_range(
                value_text(value), self.type.value, self.range_text))
        return min(max(raw, low), high)

    def raw_nearest(self, value: Value) -> int | None:
        """
        Return the raw integer nearest to a physical value, whatever ``minimum..maximum`` are.

        :return: None where the type cannot represent it.
        """
        steps = self.steps(value) if self.scaled else float(value)
        raw = math.floor(steps + 0.5)
        low, high = self.type.raw_range
        return raw if low <= raw <= high else None

    @cached_property
    def raw_limits(self) -> tuple[int, int]:
        """
        The smallest and largest raw integer whose value lies in ``minimum..maximum``.

        They bound what is sent, however a value was rounded. The first is the larger one where
        the type has no value between the limits.
        """
        ends = sorted((self.steps(-math.inf if self.minimum is None else self.minimum),
                       self.steps(math.inf if self.maximum is None else self.maximum)))
        low, high = self.type.raw_range
        return (max(low, math.ceil(ends[0] - STEP_TOLERANCE)),
                min(high, math.floor(ends[1] + STEP_TOLERANCE)))

    @cached_property
    def _limits(self) -> tuple[float, float]:
        """The profile's limits, with slack for rounding."""
        slack = abs(self.scale) * STEP_TOLERANCE
        return (-math.inf if self.minimum is None else self.minimum - slack,
                math.inf if self.maximum is None else self.maximum + slack)

    @cached_property
    def _carried_limits(self) -> tuple[float, float]:
        """The limits within the range of the type; empty where no number is a value."""
        if self.type is ParameterType.BOOL:
            return math.inf, -math.inf
        (low, high), (least, most) = self._limits, self.value_range
        return max(low, least), min(high, most)

    @cached_property
    def value_range(self) -> tuple[float, float]:
        """The smallest and largest physical value of the type, whatever the limits."""
        first, last = (raw * self.scale + self.offset for raw in self.type.raw_range)
        return (first, last) if first <= last else (last, first)

    def steps(self, value: float) -> float:
        """Return a physical value in raw steps, not rounded, in bounds that floor() can take."""
        steps = (value - self.offset) / self.scale
        return min(max(steps, -_STEPS_MAX), _STEPS_MAX)

    def check_limits(self, value: float) -> None:
        """
        Compare a physical value with the profile's limits.

        :raises ValueRefused: with the range in words.
        """
        low, high = self._limits
        if value < low or value > high:
            raise ValueRefused(sentences.out_of_range(value_text(value), self.range_text))

    @property
    def range_text(self) -> str:
        """The allowed physical range in words, ``-3000 to 3000 rpm``."""
        if self.minimum is not None and self.maximum is not None:
            text = _in_words((self.minimum, self.maximum))
        elif self.minimum is not None:
            text = f'at least {value_text(self.minimum)}'
        elif self.maximum is not None:
            text = f'at most {value_text(self.maximum)}'
        else:
            text = _in_words(self.value_range)
        return text + self._unit_suffix

    @property
    def _unit_suffix(self) -> str:
        return f' {self.unit}' if self.unit else ''


def named_value(parameter: Parameter | None, value: Value) -> str:
    """Return a value for people, as :meth:`Parameter.named`; None: an unknown parameter."""
    return value_text(value) if parameter is None else parameter.named(value)


def _in_words(ends: tuple[float, float]) -> str:
    return f'{value_text(ends[0])} to {value_text(ends[1])}'
