# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Raw integers as people read them: ``500.0 rpm``, ``0003h (ready, enabled)``."""

from collections.abc import Callable, Mapping
import math

from drive_can_bridge.core.parameters import Parameter, ParameterType

#: digits behind the point that a scale may ask for
_DIGITS_MAX = 6

Format = Callable[[int], str]


class ValueFormat:
    """Formats values; what is the same for all values of a parameter is found out once."""

    def __init__(self) -> None:
        # by identity: the hash of a parameter takes longer than the rest; the reference keeps it
        self._known: dict[int, tuple[Parameter, Format]] = {}

    def of(self, parameter: Parameter) -> Format:
        """Return what turns raw integers of a parameter into its name, value and unit."""
        known = self._known.get(id(parameter))
        if known is not None:
            return known[1]
        chosen = _format_of(parameter)
        if parameter.listed:    # others are made for one telegram
            self._known[id(parameter)] = parameter, chosen
        return chosen


def _format_of(parameter: Parameter) -> Format:
    name, names = parameter.name, dict(parameter.values)
    if parameter.scaled:
        digits = max(_digits(parameter.scale), _digits(parameter.offset))
        scale, offset = parameter.scale, parameter.offset
        unit = f' {parameter.unit}' if parameter.unit else ''
        if parameter.values:
            return lambda raw: (f'{name} {raw * scale + offset:.{digits}f}{unit}'
                                f'{_named(names, raw)}')
        return lambda raw: f'{name} {raw * scale + offset:.{digits}f}{unit}'
    if parameter.type is ParameterType.BOOL:
        return lambda raw: f'{name} {"true" if raw else "false"}'
    if parameter.bits:
        return lambda raw: f'{name} {_bits_text(parameter, raw)}'
    if parameter.values:
        return lambda raw: f'{name} {raw}{_named(names, raw)}'
    return lambda raw: f'{name} {raw}'


def _named(names: Mapping[int, str], raw: int) -> str:
    return f' {names[raw]}' if raw in names else ''


def _digits(step: float) -> int:
    """Return the digits behind the point that tell one step from the next."""
    if step == 0.0 or float(step).is_integer():
        return 0
    digits = max(0, math.ceil(-math.log10(abs(step)) - 1e-9))
    most = min(digits + 1, _DIGITS_MAX)     # of a step like 50/16384 nobody wants them all
    while digits < most and not math.isclose(round(step, digits), step, rel_tol=1e-2):
        digits += 1
    return min(digits, most)


def _bits_text(parameter: Parameter, raw: int) -> str:
    names = ', '.join(name for name, bit in parameter.bits if raw >> bit & 1)
    width = parameter.type.bits // 4
    return f'{raw & (1 << parameter.type.bits) - 1:0{width}X}h' + (f' ({names})' if names else '')
