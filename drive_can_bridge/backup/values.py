# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Values of a backup: how they are written, and which raw integer one of them means."""

import math

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import Parameter, ValueKind
from drive_can_bridge.core.words import describe_type, show


def value_in_file(parameter: Parameter, raw: int) -> str:
    """Write a raw integer as a value that YAML, rcl and :func:`raw_in_file` understand."""
    value = parameter.value_from_raw(raw)
    text = show(value)
    if not isinstance(value, float) or not math.isfinite(value):
        return text
    if _nearest_raw(parameter, float(text)) != raw:
        text = repr(value)
    # without a point, YAML takes 4e+12 for a string
    return text.replace('e', '.0e') if 'e' in text and '.' not in text else text


def raw_in_file(parameter: Parameter, value: object) -> int:
    """
    Return the raw integer that a value stands for, whether or not it may be written.

    :raises ValueRefused: a value of another kind.
    """
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueRefused(f'{value} is not a finite number')
    kind = parameter.kind if parameter.listed else ValueKind.INTEGER
    if kind is ValueKind.BOOL:
        if isinstance(value, bool):
            return int(value)
    elif isinstance(value, bool):
        pass
    elif isinstance(value, int) or (isinstance(value, float) and kind is ValueKind.DOUBLE):
        if not parameter.listed:
            return int(value) if value >= 0 else parameter.word_from_raw(int(value))
        try:
            return parameter.raw_from_value(value)
        except ValueRefused:
            return _nearest_raw(parameter, value)
    raise ValueRefused(f'wrong type: {show(value)} is {describe_type(value)}, allowed is '
                       f'{kind.words}')


def _nearest_raw(parameter: Parameter, value: float) -> int:
    return math.floor((value - parameter.offset) / parameter.scale + 0.5)
