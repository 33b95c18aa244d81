# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Parameters by their descriptors, and values the way people read them."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
import math
import re

from drive_can_bridge.core import sentences
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import ParameterType, Value, ValueKind
from drive_can_bridge.core.text import printable, taken_apart

_DECIMALS_MAX = 6
#: columns for an unknown value
_WIDTH = 8
#: state words of a drive are read in hexadecimal
_WORD_SUFFIX = 'word'
_BOOLS = {'true': True, 'on': True, 'false': False, 'off': False}
#: what the bridge uses a parameter for, and so writes itself
_ROLES = {'cyclic': sentences.setpoint_of_bridge(), 'control': sentences.word_of_bridge(),
          'map': sentences.map_of_bridge()}
#: names that show what a profile cannot: setpoints, those of CiA 402 (targets) too
_MOVING = re.compile(r'(setpoint|control_?word)$|(^|_)target(_|$)')
#: the second of them and so on; one that is stored is no setpoint, but the preset of one
_NUMBERED = re.compile(r'(setpoint|control_?word)_?[0-9]+$')
#: of an integer in a message, without its sign
_BITS_MAX = 63
_EXAMPLES = {ValueKind.INTEGER: ', such as 12 or 0x0C', ValueKind.DOUBLE: ', such as 12.5'}


@dataclass(frozen=True, slots=True)
class ParameterInfo:
    """
    A parameter of a drive, by its descriptor.

    :param minimum: smallest allowed value; None: unlimited.
    :param facts: of ``additional_constraints``: unit, number, type, scale, access, storage, role …
    """

    name: str
    kind: ValueKind = ValueKind.DOUBLE
    read_only: bool = False
    description: str = ''
    minimum: float | None = None
    maximum: float | None = None
    facts: dict[str, str] = field(default_factory=dict)

    @property
    def unit(self) -> str:
        """The unit of the value, or ''."""
        return self.facts.get('unit', '')

    @property
    def names(self) -> dict[int, str]:
        """The names of values, of those that have one."""
        return dict(taken_apart(self.facts.get('values', '')))

    @property
    def bits(self) -> dict[str, int]:
        """The numbers of bits, of those that have a name."""
        return {name: number for number, name in taken_apart(self.facts.get('bits', ''))}

    @property
    def readable(self) -> bool:
        """Whether a service can read it."""
        return self.facts.get('access') != 'wo'

    @property
    def address(self) -> str:
        """The address as in the drive's manual: ``P30``, ``P613.5``, ``2004h.06h``."""
        number, index = self.facts.get('number'), self.facts.get('index', '')
        subindex = self.facts.get('subindex')
        if number:
            return f'P{number}.{subindex}' if subindex and not index else f'P{number}'
        if index:
            return (f'{index.removeprefix("0x")}h.'
                    f'{(subindex or "00").removeprefix("0x")}h')
        return ''

    @property
    def range_text(self) -> str:
        """The allowed range, ``-3000 … 3000``; '' where it is unknown."""
        if self.minimum is None or self.maximum is None:
            return ''
        return f'{self.minimum:.10g} … {self.maximum:.10g}'

    @property
    def width(self) -> int:
        """The characters of the longest possible value: columns must not move."""
        if self.kind is ValueKind.BOOL:
            return len('false')
        kind = next((kind for kind in ParameterType if kind.value == self.facts.get('type')), None)
        if kind is None:
            return _WIDTH
        if self.kind is ValueKind.INTEGER:
            return max(len(self.text(each)) for each in (*kind.raw_range, *self.names))
        scale, offset = self._number('scale', 1.0), self._number('offset', 0.0)
        return max(len(self.text(end * scale + offset)) for end in kind.raw_range)

    def text(self, value: Value) -> str:
        """Return a value as text: as many decimals as it has, words in hexadecimal."""
        if isinstance(value, bool):
            return 'true' if value else 'false'
        if isinstance(value, int):
            text = str(value)
            if self.name.endswith(_WORD_SUFFIX) and value >= 0:
                text = f'0x{value:0{8 if "32" in self.facts.get("type", "") else 4}X}'
            return f'{text} {name}' if (name := self.names.get(value)) else text
        if not math.isfinite(value):
            return str(value)
        decimals = self._decimals
        text = f'{value:.3f}' if decimals is None else f'{value:.{decimals}f}'
        # what is rounded to nothing has no sign
        return text.removeprefix('-') if not float(text) else text

    def assignment(self, value: Value) -> str:
        """Return ``actual_speed=12.3 rpm``; integers as they are, for programs to read."""
        text = self.text(value)
        if isinstance(value, int) and not isinstance(value, bool):
            text = f'{value} {name}' if (name := self.names.get(value)) else str(value)
        return f'{self.name}={text}{f" {self.unit}" if self.unit else ""}'

    def parse(self, text: str) -> Value:
        """
        Return the value that a user has typed; the bridge decides whether it is allowed.

        :raises ValueRefused: not a value of this kind; with what is one.
        """
        word = text.strip()
        for number, name in self.names.items():
            if word in (name, f'{number} {name}'):
                return number
        try:
            # Python reads 1_5 as 15, and digits of all scripts
            if '_' in word or not word.isascii():
                raise ValueError(word)
            if self.kind is ValueKind.BOOL:
                return _BOOLS[word.lower()]
            if self.kind is ValueKind.INTEGER:
                number = int(word, 0)
                if number.bit_length() > _BITS_MAX:
                    raise ValueError(word)
                return number
            value = float(word)
        except (KeyError, ValueError):
            value = math.nan
        if not math.isfinite(value):
            raise ValueRefused(sentences.no_such_value(
                word=repr(printable(word)), kind=self.kind.words,
                example=_EXAMPLES.get(self.kind, '')))
        return value

    @property
    def refusal(self) -> str:
        """Return why a view does not write it: it moves a drive, or is protected; '' if it may."""
        if self.read_only:
            return sentences.read_only()
        role = self.facts.get('role')
        if role is not None:
            return _ROLES.get(role, role)
        if _MOVING.search(self.name) or (   # also while it is not mapped
                self.facts.get('storage') != 'eeprom' and _NUMBERED.search(self.name)):
            return sentences.moves_the_drive()
        return sentences.protected() * (
            self.facts.get('protected') == 'true')

    def _number(self, fact: str, default: float) -> float:
        try:
            number = float(self.facts.get(fact, default))
        except ValueError:
            return default
        return number if math.isfinite(number) else default

    @property
    def _decimals(self) -> int | None:
        """The digits behind the point that one raw step needs; None while the step is unknown."""
        step = abs(self._number('scale', 0.0))
        if not step:
            return None
        for decimals in range(_DECIMALS_MAX):
            scaled = step * 10 ** decimals
            if scaled >= 0.5 and math.isclose(scaled, round(scaled), rel_tol=1e-6):
                return decimals
        # no round number: the first digit of a step
        return min(max(0, -math.floor(math.log10(step))), _DECIMALS_MAX)


#: messages per second
BUDGET = 1000.0
#: s of a turn: discovery, and some samples for a view that looks four times a second
TURN = 1.5


class SamplingPlan:
    """Chooses the drives to be sampled, in turns."""

    def __init__(self, budget: float = BUDGET) -> None:
        self._budget = budget
        self._turn_ends = 0.0
        self._next = 0
        self._chosen: frozenset[str] = frozenset()

    def choose(self, rates: Mapping[str, float], focus: Collection[str], now: float,
               ) -> frozenset[str]:
        """
        Return the drives to be sampled.

        :param rates: exchanges per second of all drives; 0 while unknown, or offline.
        :param focus: the drives in focus.
        """
        known = {name for name in rates if name in focus}
        if now < self._turn_ends and known <= self._chosen <= rates.keys():
            return self._chosen
        self._turn_ends = now + TURN
        chosen = set(known)
        left = self._budget - sum(rates[name] for name in known)
        names: Sequence[str] = [name for name in rates if name not in known]
        for _ in names:
            name = names[self._next % len(names)]
            # one in turn at least, or none ever would be
            if rates[name] > left and len(chosen) > len(known):
                break
            left -= rates[name]
            chosen.add(name)
            self._next += 1
        self._chosen = frozenset(chosen)
        return self._chosen
