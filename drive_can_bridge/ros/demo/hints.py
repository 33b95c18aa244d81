# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""How to talk to the demo from a second terminal: command lines that work as they stand."""

from collections.abc import Iterator
from dataclasses import dataclass

from drive_can_bridge.core.configuration import BridgeConfiguration, DriveConfiguration
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import Access, Parameter, Value, ValueKind
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.simulation.names import Quantity, quantity_of

#: values tried for a parameter; the first that it takes is shown
_EXAMPLES = (2.0, 1.0, 10.0, 100.0, 0.5)
_TOPIC_TYPES = {ValueKind.DOUBLE: 'std_msgs/msg/Float64', ValueKind.INTEGER: 'std_msgs/msg/Int64',
                ValueKind.BOOL: 'std_msgs/msg/Bool'}


@dataclass(frozen=True)
class Hint:
    """A command line, and what it does."""

    command: str
    meaning: str


def hints(configuration: BridgeConfiguration, *, bridge: str, namespace: str,
          environment: str, commanded: bool) -> list[Hint]:
    """
    Choose commands for the drives of a configuration, the most telling ones first.

    :param bridge: full name of the bridge's node.
    :param namespace: of bridge and drives.
    :param environment: command that prepares the other terminal; may be ''.
    :param commanded: the demo commands the drives itself: nobody else should.
    """
    drives = list(configuration.drives.values())
    found = [Hint(environment, 'once, so that they meet')] if environment else []
    if not drives:
        return found
    prefix = namespace.rstrip('/')
    first = drives[0]
    found.append(Hint(f'ros2 topic echo {prefix}/{first.name}/response', 'every sample'))
    if not commanded:
        found += _commands(drives, prefix, bridge)
    found += _parameters(first, f'{prefix}/{first.name}')
    found.append(Hint('ros2 topic echo /diagnostics', 'buses and drives in words'))
    return found


def _commands(drives: list[DriveConfiguration], prefix: str, bridge: str) -> Iterator[Hint]:
    controlled = next((drive for drive in drives if drive.profile.control is not None
                       or FAMILIES[drive.protocol].control_built_in), None)
    drive = next((drive for drive in drives if _setpoint(drive) is not None), None)
    setpoint = _setpoint(drive) if drive is not None else None
    if drive is not None and setpoint is not None:
        if not drive.rearm_immediate:
            yield Hint(f'ros2 param set {bridge} drives.{drive.name}.rearm immediate',
                       'any command arms')
        yield Hint(f'ros2 topic pub -r 10 {prefix}/{drive.name}/command/{setpoint.name} '
                   f"{_TOPIC_TYPES[setpoint.kind]} '{{data: {_some_way(setpoint)}}}'",
                   'until Ctrl-C')
    if controlled is not None:
        yield Hint(f'ros2 service call {prefix}/{controlled.name}/enable std_srvs/srv/SetBool '
                   "'{data: true}'", 'by its control word')


def _parameters(drive: DriveConfiguration, name: str) -> Iterator[Hint]:
    yield Hint(f'ros2 param list {name}', "the drive's own parameters")
    parameter = _setting(drive)
    if parameter is not None:
        yield Hint(f'ros2 param get {name} {parameter.name}', 'read over the bus')
        yield Hint(f'ros2 param set {name} {parameter.name} {_written(_example(parameter))}',
                   'write over the bus')


def _setpoint(drive: DriveConfiguration) -> Parameter | None:
    """Choose the setpoint that moves something: a speed, a position, or else the first one."""
    control = drive.profile.control
    parameters = [parameter for parameter in drive.cyclic_request
                  if control is None or parameter.name != control.parameter]
    for quantity in (Quantity.SPEED, Quantity.POSITION):
        for parameter in parameters:
            if quantity_of(parameter) is quantity:
                return parameter
    return parameters[0] if parameters else None


def _setting(drive: DriveConfiguration) -> Parameter | None:
    """Choose a parameter that may be read and written by service."""
    control = drive.profile.control
    taken = {parameter.name for parameter in drive.cyclic_request}
    taken.update([control.parameter] if control else [])
    candidates = [
        parameter for parameter in drive.profile.parameters.values()
        if parameter.access is Access.READ_WRITE and parameter.name not in taken
        and _example(parameter) is not None]
    return min(candidates, key=lambda parameter: 'ramp' not in parameter.name, default=None)


def _example(parameter: Parameter) -> Value | None:
    """Return a value that the parameter takes."""
    if parameter.kind is ValueKind.BOOL:
        return True
    low, high = parameter.minimum, parameter.maximum
    middle = [] if low is None or high is None else [(low + high) / 2]
    for number in (*_EXAMPLES, *middle, 0.0):
        value: Value = number if parameter.kind is ValueKind.DOUBLE else round(number)
        try:
            parameter.raw_from_value(value)
        except ValueRefused:
            continue
        return value
    return None


def _some_way(parameter: Parameter) -> str:
    """Return a command that is seen to have an effect: a tenth of the largest."""
    if parameter.kind is ValueKind.BOOL:
        return 'true'
    high = parameter.maximum
    if high is None:
        high = float(parameter.value_from_raw(parameter.type.raw_range[1]))
    number = float(f'{high / 10:.1g}')
    return _written(number if parameter.kind is ValueKind.DOUBLE else round(number))


def _written(value: Value | None) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return '' if value is None else f'{value:g}' if isinstance(value, int) else f'{value}'
