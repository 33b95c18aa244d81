# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The node's parameters: what to declare, and what may change while it runs."""

from collections.abc import Iterator
from typing import Any, NamedTuple

from drive_can_bridge.configuration.schema import definition
from drive_can_bridge.configuration.schema_check import check_value
from drive_can_bridge.core.configuration import (
    BridgeConfiguration, BusConfiguration, DriveConfiguration, JointConfiguration,
)
from drive_can_bridge.protocols.families import FAMILIES

#: keys of a drive that may change while the bridge runs
DYNAMIC_DRIVE_KEYS = ('command_timeout', 'rearm', 'parameter_timeout')
DYNAMIC_KEYS = ('diagnostics_period',)


def identity_name(drive: str) -> str:
    """Return the name of the parameter that says who a drive is; the bridge itself sets it."""
    return f'drives.{drive}.identity'


class DeclaredParameter(NamedTuple):
    """
    A parameter of the bridge's node.

    :param value: effective value; an empty list stays one.
    :param dynamic: may be set while the node runs, see :func:`check_dynamic`.
    """

    name: str
    value: Any
    description: str
    dynamic: bool


def declared_parameters(configuration: BridgeConfiguration) -> list[DeclaredParameter]:
    """Return all parameters of the node with their effective values, defaults included."""
    return list(_bridge(configuration))


def check_dynamic(name: str, value: object) -> str | None:
    """
    Say why a parameter cannot be set to a value while the node runs; None: it can.

    An integer is accepted for a number.
    """
    parts = name.split('.')
    if len(parts) == 1 and name in DYNAMIC_KEYS:
        schema = definition('bridge')['properties'][name]
    elif len(parts) == 3 and parts[0] == 'drives' and parts[2] in DYNAMIC_DRIVE_KEYS:
        schema = definition('drive')['properties'][parts[2]]
    else:
        return f'{name} cannot change while the node runs; change the parameter file and restart'
    return check_value(value, schema)


def _bridge(configuration: BridgeConfiguration) -> Iterator[DeclaredParameter]:
    for key, value in (
            ('autostart', configuration.autostart),
            ('diagnostics_period', configuration.diagnostics_period),
            ('profile_directories', list(configuration.profile_directories))):
        yield DeclaredParameter(key, value, _description('bridge', key), key in DYNAMIC_KEYS)
    for bus in configuration.buses.values():
        yield from _bus(bus)
    for drive in configuration.drives.values():
        yield from _drive(drive)


def _bus(bus: BusConfiguration) -> Iterator[DeclaredParameter]:
    prefix = f'buses.{bus.name}.'
    for key in ('interface', 'channel', 'bitrate', 'reconnect_period', 'trace_seconds',
                'trace_directory', 'trace_files'):
        yield DeclaredParameter(prefix + key, getattr(bus, key), _description('bus', key), False)
    for key, value in bus.options.items():
        yield DeclaredParameter(prefix + key, value, 'Handed to the adapter.', False)


def _drive(drive: DriveConfiguration) -> Iterator[DeclaredParameter]:
    prefix = f'drives.{drive.name}.'
    values = {
        'bus': drive.bus,
        'protocol': drive.protocol,
        'station': drive.station,
        'profile': drive.profile_key,
        'period': drive.period,
        'cyclic_request': [parameter.name for parameter in drive.cyclic_request],
        'cyclic_response': [parameter.name for parameter in drive.cyclic_response],
        'missed_limit': drive.missed_limit,
        'command_timeout': drive.command_timeout,
        'rearm': 'immediate' if drive.rearm_immediate else 'neutral',
        'parameter_timeout': drive.parameter_timeout,
        'control_timeout': drive.control_timeout,
        'parameter_retries': drive.parameter_retries,
        'verify_writes': drive.verify_writes,
    }
    for key, value in values.items():
        yield DeclaredParameter(prefix + key, value, _description('drive', key),
                                key in DYNAMIC_DRIVE_KEYS)
    yield DeclaredParameter(
        identity_name(drive.name), '', 'Found out by the bridge when the drive comes online: the '
        'section identity of its profile. Empty while not known.', False)
    options = FAMILIES[drive.protocol].options_schema
    for key, value in drive.family_options.items():
        yield DeclaredParameter(prefix + key, value, options[key].get('description', ''), False)
    if drive.joint is not None:
        yield from _joint(prefix + 'joint.', drive.joint)


def _joint(prefix: str, joint: JointConfiguration) -> Iterator[DeclaredParameter]:
    for key in definition('joint')['properties']:
        value = getattr(joint, key)
        if value is not None:
            yield DeclaredParameter(prefix + key, value, _description('joint', key), False)


def _description(name: str, key: str) -> str:
    return str(definition(name)['properties'][key].get('description', ''))
