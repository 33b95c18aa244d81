# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Between drive parameters and ROS messages: one rule for types everywhere."""

from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange, IntegerRange, ParameterDescriptor, ParameterType, ParameterValue,
)
from std_msgs.msg import Bool, Float64, Int64

from drive_can_bridge.core.parameters import Parameter, Value, ValueKind

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
_FIELDS_BY_TYPE = {
    ParameterType.PARAMETER_BOOL: 'bool_value',
    ParameterType.PARAMETER_INTEGER: 'integer_value',
    ParameterType.PARAMETER_DOUBLE: 'double_value',
    ParameterType.PARAMETER_STRING: 'string_value',
    ParameterType.PARAMETER_BYTE_ARRAY: 'byte_array_value',
    ParameterType.PARAMETER_BOOL_ARRAY: 'bool_array_value',
    ParameterType.PARAMETER_INTEGER_ARRAY: 'integer_array_value',
    ParameterType.PARAMETER_DOUBLE_ARRAY: 'double_array_value',
    ParameterType.PARAMETER_STRING_ARRAY: 'string_array_value',
}


def parameter_value(parameter: Parameter, value: Value) -> ParameterValue:
    """Return a typed ParameterValue."""
    kind = parameter.kind
    return ParameterValue(type=PARAMETER_TYPES[kind], **{VALUE_FIELDS[kind]: value})


def value_of(message: ParameterValue) -> object:
    """Return the Python value of a ParameterValue; None for NOT_SET."""
    field = _FIELDS_BY_TYPE.get(message.type)
    if field is None:
        return None
    value = getattr(message, field)
    return value if isinstance(value, (bool, int, float, str)) else list(value)


def value_text(value: Value) -> str:
    """Write a value as one would publish it: ``0``, ``12.5``, ``false``."""
    return str(value).lower() if isinstance(value, bool) else f'{value:g}'


def descriptor(name: str, parameter: Parameter) -> ParameterDescriptor:
    """Describe a parameter: type, unit, number, storage, access, range with step = scale."""
    facts = [parameter.address]
    if parameter.unit:
        facts.append(f'unit {parameter.unit}')
    if parameter.storage is not None:
        facts.append(f'storage {parameter.storage.value}')
    if not parameter.readable:
        facts.append('write-only')
    text = parameter.description or ('raw access' if not parameter.listed else '')
    message = ParameterDescriptor(
        name=name, type=PARAMETER_TYPES[parameter.kind],
        description=f'{text} ({", ".join(facts)})' if text else ', '.join(facts),
        read_only=not parameter.writable)
    low_raw, high_raw = parameter.type.raw_range
    if parameter.kind is ValueKind.DOUBLE:
        ends = sorted((low_raw * parameter.scale + parameter.offset,
                       high_raw * parameter.scale + parameter.offset))
        message.floating_point_range = [FloatingPointRange(
            from_value=float(parameter.minimum if parameter.minimum is not None else ends[0]),
            to_value=float(parameter.maximum if parameter.maximum is not None else ends[1]),
            step=abs(parameter.scale))]
    elif parameter.kind is ValueKind.INTEGER:
        message.integer_range = [IntegerRange(
            from_value=int(parameter.minimum if parameter.minimum is not None else low_raw),
            to_value=int(parameter.maximum if parameter.maximum is not None else high_raw),
            step=1)]
    return message
