# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Between messages and the plain values of the model."""

from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log, ParameterDescriptor, ParameterEvent, ParameterType

from drive_can_bridge.core.parameters import Value, ValueKind
from drive_can_bridge.core.text import printable
from drive_can_bridge.monitor.reports import Status
from drive_can_bridge.monitor.values import ParameterInfo
from drive_can_bridge.ros.messages import drive_value, facts_of, limits_of

_KINDS = {ParameterType.PARAMETER_BOOL: ValueKind.BOOL,
          ParameterType.PARAMETER_INTEGER: ValueKind.INTEGER}
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


def values(message: ParameterEvent) -> list[tuple[str, Value]]:
    """Return names and values of a sample."""
    pairs = ((entry.name, drive_value(entry.value)) for entry in message.changed_parameters)
    return [(name, value) for name, value in pairs if value is not None]


def log_level(message: Log) -> str:
    """Return the level of a line of the log, as ROS names it."""
    return _LEVELS.get(message.level, str(message.level))


def parameter_info(message: ParameterDescriptor) -> ParameterInfo:
    """Return what a descriptor says."""
    return ParameterInfo(
        printable(message.name), _KINDS.get(message.type, ValueKind.DOUBLE), message.read_only,
        printable(message.description), *limits_of(message), facts_of(message))
