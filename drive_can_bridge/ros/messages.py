# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The contents of parameter messages: for the bridge, and for its clients."""

from rcl_interfaces.msg import Parameter as ParameterMessage, ParameterDescriptor, ParameterValue
from rclpy.parameter import Parameter, parameter_value_to_python

from drive_can_bridge.core.parameters import Value
from drive_can_bridge.core.text import facts_in


def value_of(message: ParameterValue) -> object:
    """Return the content of a value; None for NOT_SET, and for a type that does not exist."""
    try:
        return parameter_value_to_python(message)
    except RuntimeError:
        return None


def plain(message: ParameterValue) -> Value | str | None:
    """Return the number, bool or text in a value; None for anything else."""
    value = value_of(message)
    return value if isinstance(value, (bool, int, float, str)) else None


def drive_value(message: ParameterValue) -> Value | None:
    """Return the value of a drive's parameter, which is no text; None where it has none."""
    value = plain(message)
    return None if isinstance(value, str) else value


def parameter_message(name: str, value: Value) -> ParameterMessage:
    """Return the message that sets a parameter to a value of its type."""
    return Parameter(name, value=value).to_parameter_msg()


def facts_of(message: ParameterDescriptor) -> dict[str, str]:
    """Return the ``key=value`` pairs of a descriptor; none of one that is not understood."""
    return facts_in(message.additional_constraints)


def limits_of(message: ParameterDescriptor) -> tuple[float | None, float | None]:
    """Return the smallest and the largest value of a descriptor; None: unlimited."""
    for limits in (*message.floating_point_range, *message.integer_range):
        return float(limits.from_value), float(limits.to_value)
    return None, None
