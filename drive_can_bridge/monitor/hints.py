# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""How to talk to a drive from another terminal: command lines that work as they stand."""

from drive_can_bridge.core.parameters import ValueKind
from drive_can_bridge.core.words import seems_limit
from drive_can_bridge.monitor.snapshot import DriveSnapshot
from drive_can_bridge.monitor.values import ParameterInfo

_TOPIC_TYPES = {ValueKind.DOUBLE: 'std_msgs/msg/Float64', ValueKind.INTEGER: 'std_msgs/msg/Int64',
                ValueKind.BOOL: 'std_msgs/msg/Bool'}
#: a good example
_TELLING = 'ramp'


def hints(drive: DriveSnapshot | None, environment: str) -> list[tuple[str, str]]:
    """
    Return commands with what they do.

    :param environment: command that prepares the other terminal; may be ''.
    """
    found = [(environment, 'once, so that they meet')] if environment else []
    if drive is not None:
        name = drive.name
        found += [(f'ros2 topic echo {name}/response', 'every sample'),
                  *_commands(drive),
                  (f'ros2 param list {name}', "the drive's own parameters")]
        setting = _setting(drive)
        if setting is not None:
            found.append((f'ros2 param get {name} {setting.name}', 'read it over the bus'))
    return [*found, ('ros2 topic echo /diagnostics', 'buses and drives in words')]


def _commands(drive: DriveSnapshot) -> list[tuple[str, str]]:
    found = []
    if drive.control:
        found.append((f'drive_can enable {drive.name}', 'by its control word; or stop, disable'))
    commanded = [info for info in drive.parameters if info.facts.get('role') == 'cyclic'
                 and not info.read_only]
    setpoint = min(commanded, key=lambda info: seems_limit(info.name), default=None)
    if setpoint is not None:
        kind = setpoint.kind
        zero = 'false' if kind is ValueKind.BOOL else '0.0' if kind is ValueKind.DOUBLE else '0'
        found.append((f'ros2 topic pub -r 10 {drive.name}/command/{setpoint.name} '
                      f"{_TOPIC_TYPES[kind]} '{{data: {zero}}}'",
                      'a setpoint, until Ctrl-C: neutral first, then what is wanted'))
    return found


def _setting(drive: DriveSnapshot) -> ParameterInfo | None:
    """Choose a parameter that may be read by service."""
    candidates = [info for info in drive.parameters if info.readable
                  and info.facts.get('role') is None and not info.read_only]
    return min(candidates, key=lambda info: _TELLING not in info.name, default=None)
