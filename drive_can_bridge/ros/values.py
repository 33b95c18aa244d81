# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Between drive parameters and ROS messages: one rule for types everywhere."""

import re
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange, IntegerRange, ParameterDescriptor, ParameterType, ParameterValue,
)
from std_msgs.msg import Bool, Float64, Int64

from drive_can_bridge.core.parameters import Parameter, Value, ValueKind
from drive_can_bridge.core.roles import Role
from drive_can_bridge.core.text import joined, printable

TOPIC_TYPES: dict[ValueKind, Any] = {
    ValueKind.DOUBLE: Float64, ValueKind.INTEGER: Int64, ValueKind.BOOL: Bool,
}
PARAMETER_TYPES: dict[ValueKind, int] = {
    ValueKind.DOUBLE: ParameterType.PARAMETER_DOUBLE,
    ValueKind.INTEGER: ParameterType.PARAMETER_INTEGER,
    ValueKind.BOOL: ParameterType.PARAMETER_BOOL,
}
#: field of a ParameterValue that carries each kind
VALUE_FIELDS: dict[ValueKind, str] = {
    ValueKind.DOUBLE: 'double_value', ValueKind.INTEGER: 'integer_value',
    ValueKind.BOOL: 'bool_value',
}
#: largest end of an integer range: Qt's sliders have 32 bits, and an OverflowError beyond
SLIDER_MAX = 2 ** 31 - 1


def parameter_value(parameter: Parameter, value: Value) -> ParameterValue:
    """Return a typed ParameterValue."""
    kind = parameter.kind
    return ParameterValue(type=PARAMETER_TYPES[kind], **{VALUE_FIELDS[kind]: value})


def constraints(parameter: Parameter, role: Role | None, error: str = '') -> str:
    """
    Return a parameter's properties for tools: ``unit="N m" number=209 type=int16 …``.

    What does not apply is absent. ``shlex.split`` takes it apart.

    :param error: why it had no value when it was last read.
    """
    by_object = parameter.index is not None
    fields: dict[str, object] = {
        'unit': parameter.unit or None,
        'number': parameter.number,
        'index': f'{parameter.index:#06x}' if parameter.index is not None else None,
        'subindex': f'{parameter.subindex:#04x}' if by_object and parameter.subindex is not None
                    else parameter.subindex,
        'type': parameter.type.value if parameter.width_known else None,
        'scale': _exact(parameter.scale) if parameter.scaled else None,
        'offset': _exact(parameter.offset) if parameter.scaled else None,
        'access': parameter.access.value,
        'storage': None if parameter.storage is None else parameter.storage.value,
        'protected': str(parameter.protected).lower(),
        'role': None if role is None else role.value,
        'values': None if parameter.scaled else joined(parameter.values) or None,
        'bits': joined((bit, name) for name, bit in parameter.bits) or None,
        'error': printable(error) or None,
    }
    return ' '.join(f'{key}={_quoted(str(value))}' for key, value in fields.items()
                    if value is not None)


def _exact(value: float) -> str:
    short = f'{value:g}'
    return short if float(short) == value else repr(value)


def _quoted(text: str) -> str:
    if not re.search(r'[\s"\'\\]', text):
        return text
    escaped = text.replace('\\', '\\\\').replace('"', '\\"')
    return f'"{escaped}"'


def descriptor(name: str, parameter: Parameter, *, role: Role | None = None,
               unreadable: bool = False, error: str = '') -> ParameterDescriptor:
    """
    Describe a parameter: type, unit, number, storage, access, range with step = scale.

    Editors such as rqt_reconfigure take the type from here and the value from
    ``get_parameters``, and give up on the whole node where a typed parameter has no value. So what
    has no value to show has no type here either; the description names it.

    :param role: what the bridge itself uses the parameter for.
    :param unreadable: there is no value to be had.
    :param error: why there was none when it was last read; '' where there was one.
    """
    facts = [parameter.address]
    if parameter.unit:
        facts.append(f'unit {parameter.unit}')
    if parameter.storage is not None:
        facts.append(f'storage {parameter.storage.value}')
    if parameter.verified is False:
        facts.append('unverified')
    kind = parameter.kind
    untyped = unreadable or not parameter.readable
    if untyped:
        facts.append(kind.value)
    if not parameter.readable:
        facts.append('write-only')
    elif unreadable:
        facts.append('could not be read')
    text = parameter.description or ('raw access' if not parameter.listed else '')
    message = ParameterDescriptor(
        name=name, read_only=not parameter.writable,
        type=ParameterType.PARAMETER_NOT_SET if untyped else PARAMETER_TYPES[kind],
        description=f'{text} ({", ".join(facts)})' if text else ', '.join(facts),
        additional_constraints=constraints(parameter, role, error))
    low, high = _range(parameter)
    if low >= high:  # one value only: a slider of no length
        return message
    if kind is ValueKind.DOUBLE:
        message.floating_point_range = [FloatingPointRange(
            from_value=_tidy(low), to_value=_tidy(high), step=abs(parameter.scale))]
    elif kind is ValueKind.INTEGER and high <= SLIDER_MAX:
        message.integer_range = [IntegerRange(from_value=int(low), to_value=int(high), step=1)]
    return message


def _tidy(value: float) -> float:
    """Return a product without binary noise: 3276.7, not 3276.7000000000003."""
    return float(f'{value:.12g}')


def _range(parameter: Parameter) -> tuple[float, float]:
    """Return the smallest and the largest physical value."""
    low_raw, high_raw = parameter.type.raw_range
    low, high = sorted((low_raw * parameter.scale + parameter.offset,
                        high_raw * parameter.scale + parameter.offset))
    return (low if parameter.minimum is None else parameter.minimum,
            high if parameter.maximum is None else parameter.maximum)
