# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The node's parameters: what to declare, and what may change while it runs.

The parameter overrides of a node (flat, dotted names) as a tree.
"""

from array import array
from collections.abc import Container, Iterator, Mapping
from dataclasses import is_dataclass
import json
from types import MappingProxyType
from typing import Any, NamedTuple

from drive_can_bridge.configuration.problems import Path, Tree
from drive_can_bridge.configuration.schema import ALL_OPTIONS, check_value, definition
from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.core.profile import RestoreTable
from drive_can_bridge.protocols.families import FAMILIES


def tree_from_overrides(overrides: Mapping[str, object]) -> Tree:
    """
    Nest dotted names.

    rcl turns ``[]`` into a parameter without type, which rclpy shows as None; hence None is the
    empty list. A name that is a value and holds others is noted as a problem.
    """
    tree = Tree({})
    holders: dict[Path, str | int] = {}
    # In the order of the file, but a value is met before what it would hold.
    for name in sorted(overrides, key=lambda name: name.count('.')):
        parts = name.split('.')
        # Topic names in QoS overrides may have dots; they are not ours to take apart.
        path: Path = (name,) if parts[0] == 'qos_overrides' else tuple(parts)
        target: Any = tree.data
        for depth, part in enumerate(path[:-1]):
            target = target.setdefault(part, {})
            if not isinstance(target, dict):
                holders.setdefault(path[:depth + 1], path[depth + 1])
                break
        else:
            target[path[-1]] = _plain(overrides[name])
    for path, below in holders.items():
        tree.wrong(path, f"has a value, and '{below}' below it; allowed is one of them")
    return tree


def _plain(value: object) -> object:
    if value is None:
        return []
    if isinstance(value, (tuple, array)):
        return list(value)
    return value


#: keys of a drive that may change while the bridge runs
DYNAMIC_DRIVE_KEYS = ('command_timeout', 'rearm', 'parameter_timeout')
DYNAMIC_KEYS = ('diagnostics_period',)


def identity_name(drive: str) -> str:
    """Return the name of the parameter that says who a drive is; the bridge itself sets it."""
    return f'drives.{drive}.identity'


def restore_text(table: RestoreTable) -> str:
    """Write the ``restore`` section of a profile for clients of the node."""
    return json.dumps({phase: [[step.parameter, step.bits, step.mask] for step in steps]
                       for phase, steps in (('before', table.before), ('after', table.after))})


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
    yield from _section('', 'bridge', configuration, DYNAMIC_KEYS, {
        'profile_directories': list(configuration.profile_directories)})
    for bus in configuration.buses.values():
        prefix = f'buses.{bus.name}.'
        yield from _section(prefix, 'bus', bus)
        for key, value in bus.options.items():
            yield DeclaredParameter(prefix + key, value, 'Handed to the adapter.', False)
    for drive in configuration.drives.values():
        prefix = f'drives.{drive.name}.'
        yield from _section(prefix, 'drive', drive, DYNAMIC_DRIVE_KEYS, {
            'profile': drive.profile_key,
            'cyclic_request': [parameter.name for parameter in drive.cyclic_request],
            'cyclic_response': [parameter.name for parameter in drive.cyclic_response],
            'rearm': 'immediate' if drive.rearm_immediate else 'neutral'})
        yield DeclaredParameter(
            identity_name(drive.name), '', 'Found out by the bridge when the drive comes online: '
            'the section identity of its profile. Empty while not known.', False)
        yield DeclaredParameter(f'{prefix}profile_sha256', drive.profile.sha256,
                                'SHA-256 of the file of the profile, as it was read.', False)
        yield DeclaredParameter(f'{prefix}restore', restore_text(drive.profile.restore),
                                'JSON of what is written around a restored backup: lists before '
                                'and after of [name, bits, mask].', False)
        for key, option in FAMILIES[drive.protocol].options_schema.items():
            value = getattr(drive.options, key)
            yield DeclaredParameter(prefix + key, list(value) if isinstance(value, tuple) else
                                    value, option['description'], False)
        if drive.joint is not None:
            yield from _section(f'{prefix}joint.', 'joint', drive.joint)


def _section(prefix: str, name: str, section: object, dynamic: Container[str] = (),
             special: Mapping[str, object] = MappingProxyType({}),
             ) -> Iterator[DeclaredParameter]:
    """
    Declare the keys that a definition names.

    :param special: values that the section does not have under the name of their key.
    """
    for key, option in definition(name)['properties'].items():
        value = special.get(key, getattr(section, key, None))
        if key in ALL_OPTIONS or value is None or is_dataclass(value) or isinstance(value, dict):
            continue
        yield DeclaredParameter(prefix + key, value, option.get('description', ''),
                                key in dynamic)
