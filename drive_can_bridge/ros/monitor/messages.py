# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Between messages and the plain values of the model."""

from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log, Parameter, ParameterDescriptor, ParameterEvent, ParameterType
from rcl_interfaces.msg import ParameterValue

from drive_can_bridge.core.parameters import Value, ValueKind
from drive_can_bridge.monitor.reports import Status
from drive_can_bridge.monitor.text import printable
from drive_can_bridge.monitor.values import facts_from_constraints, ParameterInfo

_FIELDS = {ParameterType.PARAMETER_BOOL: 'bool_value',
           ParameterType.PARAMETER_INTEGER: 'integer_value',
           ParameterType.PARAMETER_DOUBLE: 'double_value',
           ParameterType.PARAMETER_STRING: 'string_value'}
_KINDS = {ParameterType.PARAMETER_BOOL: ValueKind.BOOL,
          ParameterType.PARAMETER_INTEGER: ValueKind.INTEGER}
_TYPES = {bool: ParameterType.PARAMETER_BOOL, int: ParameterType.PARAMETER_INTEGER,
          float: ParameterType.PARAMETER_DOUBLE}
_LEVELS = {getattr(Log, name): name
           for name in ('DEBUG', 'INFO', 'WARN', 'ERROR', 'FATAL')}


def stamp_of(message: Any) -> float:
    """Return the stamp of a message in s."""
    return float(message.sec + 1e-9 * message.nanosec)


def statuses(message: DiagnosticArray) -> list[Status]:
    """Return the entries of a diagnostic message."""
    return [Status(status.name, int.from_bytes(status.level, 'little'), status.message,
                   {pair.key: pair.value for pair in status.values})
            for status in message.status]


def plain_value(message: ParameterValue) -> Any:
    """Return the number, bool or text of a parameter value; None for anything else."""
    field = _FIELDS.get(message.type)
    return None if field is None else getattr(message, field)


def drive_value(message: ParameterValue) -> Value | None:
    """Return the value of a drive's parameter, which is no text; None where it has none."""
    value = plain_value(message)
    return None if isinstance(value, str) else value


def values(message: ParameterEvent) -> list[tuple[str, Value]]:
    """Return names and values of a sample."""
    pairs = ((entry.name, drive_value(entry.value)) for entry in message.changed_parameters)
    return [(name, value) for name, value in pairs if value is not None]


def parameter_message(name: str, value: Value) -> Parameter:
    """Make the message that sets a parameter."""
    kind = _TYPES[type(value)]
    return Parameter(name=name, value=ParameterValue(type=kind, **{_FIELDS[kind]: value}))


def log_level(message: Log) -> str:
    """Return the level of a line of the log, as ROS names it."""
    return _LEVELS.get(message.level, str(message.level))


def parameter_info(message: ParameterDescriptor) -> ParameterInfo:
    """Return what a descriptor says."""
    ranges = [*message.floating_point_range, *message.integer_range]
    return ParameterInfo(
        printable(message.name), _KINDS.get(message.type, ValueKind.DOUBLE), message.read_only,
        printable(message.description),
        float(ranges[0].from_value) if ranges else None,
        float(ranges[0].to_value) if ranges else None,
        facts_from_constraints(printable(message.additional_constraints, limit=1000)))
