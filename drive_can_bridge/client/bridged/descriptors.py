# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Parameters of drives out of the messages that describe them."""

from dataclasses import replace

from rcl_interfaces.msg import Parameter as ParameterMessage, ParameterDescriptor

from drive_can_bridge.core.parameters import (
    Access, Parameter, ParameterType as WireType, Storage, Value, ValueKind,
)
from drive_can_bridge.core.roles import Role
from drive_can_bridge.core.text import printable
from drive_can_bridge.core.value_names import taken_apart
from drive_can_bridge.ros.messages import facts_of, limits_of, parameter_message

_TYPES = {ValueKind.DOUBLE: float, ValueKind.INTEGER: int, ValueKind.BOOL: bool}


def parameter_of(message: ParameterDescriptor, *, listed: bool = True) -> Parameter | None:
    """Return what a descriptor describes; None: no parameter of a drive."""
    facts = facts_of(message)
    if 'access' not in facts:
        return None
    try:
        minimum, maximum = limits_of(message) if listed else (None, None)
        made = Parameter(
            name=message.name,
            type=WireType(facts['type']) if 'type' in facts else WireType.UINT32,
            number=_number(facts, 'number'), scale=float(facts.get('scale', 1.0)),
            offset=float(facts.get('offset', 0.0)), unit=facts.get('unit', ''),
            access=Access(facts['access']),
            storage=Storage(facts['storage']) if 'storage' in facts else None,
            minimum=minimum, maximum=maximum,
            subindex=_number(facts, 'subindex'), index=_number(facts, 'index'),
            scaled='scale' in facts, listed=listed, protected=facts.get('protected') == 'true',
            width_known='type' in facts, values=taken_apart(facts.get('values', '')))
    except ValueError:
        return None
    text = printable(message.description)
    end = text.rfind(f' ({made.address}')
    return replace(made, description=text[:end] if end > 0 and listed else '')


def role_of(message: ParameterDescriptor) -> Role | None:
    """Return what the bridge uses a parameter for."""
    role = facts_of(message).get('role')
    return next((each for each in Role if each.value == role), None)


def raw_of(parameter: Parameter, value: Value) -> int:
    """Return the raw integer that a value of the bridge was made of."""
    if parameter.scaled:
        return round((value - parameter.offset) / parameter.scale)
    return int(value)


def message_of(name: str, parameter: Parameter, value: Value) -> ParameterMessage:
    """Return what sets a parameter to a value that fits it."""
    return parameter_message(name, _TYPES[parameter.kind](value))


def _number(facts: dict[str, str], key: str) -> int | None:
    return int(facts[key], 0) if key in facts else None
