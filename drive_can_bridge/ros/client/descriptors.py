# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Parameters of drives out of the messages that describe them, and values out of messages."""

from dataclasses import replace
import shlex
from typing import Any

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterDescriptor, ParameterType, ParameterValue

from drive_can_bridge.core.parameters import (
    Access, Parameter, ParameterType as WireType, Storage, Value, ValueKind,
)
from drive_can_bridge.core.roles import Role
from drive_can_bridge.core.text import printable

_FIELDS = {ParameterType.PARAMETER_BOOL: 'bool_value',
           ParameterType.PARAMETER_INTEGER: 'integer_value',
           ParameterType.PARAMETER_DOUBLE: 'double_value',
           ParameterType.PARAMETER_STRING: 'string_value'}
_TYPES = {ValueKind.DOUBLE: (ParameterType.PARAMETER_DOUBLE, 'double_value', float),
          ValueKind.INTEGER: (ParameterType.PARAMETER_INTEGER, 'integer_value', int),
          ValueKind.BOOL: (ParameterType.PARAMETER_BOOL, 'bool_value', bool)}


def facts_of(message: ParameterDescriptor) -> dict[str, str]:
    """Return the ``key=value`` pairs of a descriptor; none of one that is not understood."""
    try:
        words = shlex.split(message.additional_constraints)
    except ValueError:
        return {}
    pairs = (word.partition('=') for word in words)
    return {key: printable(value) for key, separator, value in pairs if separator}


def parameter_of(message: ParameterDescriptor, *, listed: bool = True) -> Parameter | None:
    """Return what a descriptor describes; None: no parameter of a drive."""
    facts = facts_of(message)
    if 'access' not in facts:
        return None
    try:
        ranges = [*message.floating_point_range, *message.integer_range]
        made = Parameter(
            name=message.name,
            type=WireType(facts['type']) if 'type' in facts else WireType.UINT32,
            number=_number(facts, 'number'), scale=float(facts.get('scale', 1.0)),
            offset=float(facts.get('offset', 0.0)), unit=facts.get('unit', ''),
            access=Access(facts['access']),
            storage=Storage(facts['storage']) if 'storage' in facts else None,
            minimum=float(ranges[0].from_value) if ranges and listed else None,
            maximum=float(ranges[0].to_value) if ranges and listed else None,
            subindex=_number(facts, 'subindex'), index=_number(facts, 'index'),
            scaled='scale' in facts, listed=listed, protected=facts.get('protected') == 'true',
            width_known='type' in facts)
    except ValueError:
        return None
    text = printable(message.description)
    end = text.rfind(f' ({made.address}')
    return replace(made, description=text[:end] if end > 0 and listed else '')


def role_of(message: ParameterDescriptor) -> Role | None:
    """Return what the bridge uses a parameter for."""
    role = facts_of(message).get('role')
    return next((each for each in Role if each.value == role), None)


def plain(message: ParameterValue) -> Any:
    """Return the number, bool or text in a message; None for NOT_SET and arrays."""
    field = _FIELDS.get(message.type)
    return None if field is None else getattr(message, field)


def raw_of(parameter: Parameter, value: Value) -> int:
    """Return the raw integer that a value of the bridge was made of."""
    if parameter.scaled:
        return round((value - parameter.offset) / parameter.scale)
    return int(value)


def message_of(name: str, parameter: Parameter, value: Value) -> ParameterMessage:
    """Return what sets a parameter to a value that fits it."""
    kind, field, convert = _TYPES[parameter.kind]
    return ParameterMessage(
        name=name, value=ParameterValue(type=kind, **{field: convert(value)}))


def _number(facts: dict[str, str], key: str) -> int | None:
    return int(facts[key], 0) if key in facts else None
