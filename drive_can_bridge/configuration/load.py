# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
From a parameter file, or from the parameter overrides of a node, to a checked configuration.

Both ways run the same checks, and all of them: a user sees every problem at once. Also the
parameters that the node declares, and those that may change while it runs.
"""

from array import array
from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import is_dataclass, replace
from functools import partial
import json
import os
from pathlib import Path as FilePath
from types import MappingProxyType
from typing import Any, NamedTuple

import yaml

from drive_can_bridge.configuration.checks import (
    Adapters, check_adapter, check_buses, check_identifiers, check_joint_names, check_load,
    check_neighbours, check_rounds, check_topics, DriveChecker, LISTS,
)
from drive_can_bridge.configuration.parameter_file import read_parameter_file
from drive_can_bridge.configuration.problems import Path, report, Tree
from drive_can_bridge.configuration.profiles import place_profiles, ProfileStore, Setter
from drive_can_bridge.configuration.quality_check import check_qualities
from drive_can_bridge.configuration.scalars import read_scalar, STRING_TAG
from drive_can_bridge.configuration.schema import (
    ALL_OPTIONS, check_schema, check_value, checked_bridge, complete, definition,
)
from drive_can_bridge.core import complaints
from drive_can_bridge.core.complaints import hint, suggestion
from drive_can_bridge.core.configuration import (
    BridgeConfiguration, BusConfiguration, DriveConfiguration,
)
from drive_can_bridge.core.errors import ConfigurationError
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.profile import RestoreTable
from drive_can_bridge.protocols.families import FAMILIES

__all__ = ['check_dynamic', 'configuration_from_file', 'configuration_from_overrides',
           'declared_parameters']


def tree_from_overrides(overrides: Mapping[str, object]) -> Tree:
    """
    Return a tree of parameters with dotted names.

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
        tree.wrong(path, complaints.value_and_below(below=below))
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
    """Return the name of the parameter with a drive's identity, which the bridge itself sets."""
    return f'drives.{drive}.identity'


def restore_text(table: RestoreTable) -> str:
    """Return the ``restore`` section of a profile as text for clients of the node."""
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


def check_dynamic(name: str, value: object) -> Sentence | None:
    """
    Return why a parameter cannot be set to a value while the node runs; None: it can.

    An integer is accepted for a number.
    """
    parts = name.split('.')
    if len(parts) == 1 and name in DYNAMIC_KEYS:
        schema = definition('bridge')['properties'][name]
    elif len(parts) == 3 and parts[0] == 'drives' and parts[2] in DYNAMIC_DRIVE_KEYS:
        schema = definition('drive')['properties'][parts[2]]
    else:
        return complaints.not_while_running(name=name)
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
        for key, made, description in (
                ('identity', '', 'Found out by the bridge when the drive comes online: the '
                 'section identity of its profile. Empty while not known.'),
                ('setpoints', '', 'JSON, made when it is asked for: what may be commanded, its '
                 'neutral value, and whether it is armed.'),
                ('commanders', '', 'JSON, made when it is asked for: who publishes commands to '
                 'this drive, each as "node topic".'),
                ('profile_sha256', drive.profile.sha256,
                 'SHA-256 of the file of the profile, as it was read.'),
                ('restore', restore_text(drive.profile.restore), 'JSON of what is written around '
                 'a restored backup: lists before and after of [name, bits, mask].')):
            yield DeclaredParameter(prefix + key, made, description, False)
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


def configuration_from_file(path: str | FilePath, *, adapters: Adapters | None = None,
                            ) -> BridgeConfiguration:
    """
    Read and check a ROS parameter file.

    :param adapters: knowledge about CAN adapters; without it their keys are not checked.
    :raises ConfigurationError: with one line per problem, ``FILE:LINE: key.path: message``.
    :raises OSError: the file cannot be read.
    """
    tree, problems = read_parameter_file(FilePath(path))
    if tree is None:
        raise ConfigurationError(report(problems))
    place_profiles(tree, lambda drive, profile: FilePath(path).parent)
    return _configuration(tree, adapters)


def configuration_from_overrides(overrides: Mapping[str, object], *,
                                 adapters: Adapters | None = None, namespace: str = '',
                                 setter: Setter = lambda drive, profile: None,
                                 ) -> BridgeConfiguration:
    """
    Check the parameter overrides of a node.

    :param overrides: values by dotted name, as rclpy gives them; None is rcl's empty list.
    :param namespace: of the node, which is in no file; without a slash at its end.
    :param setter: which file sets the profile of a drive.
    :raises ConfigurationError: with one line per problem, ``key.path: message``; what is wrong
        inside a profile still has its file and line.
    """
    tree = tree_from_overrides(overrides)
    place_profiles(tree, setter)
    return _configuration(tree, adapters, namespace)


def _configuration(tree: Tree, adapters: Adapters | None,
                   namespace: str = '') -> BridgeConfiguration:
    _forget_findings(tree)
    check_schema(tree, checked_bridge(), override=partial(_sentence, tree))
    check_qualities(tree)
    values = complete('bridge', tree.data)
    _look_for_directories(tree, values['profile_directories'])
    store = ProfileStore(values['profile_directories'])
    buses = check_buses(tree, adapters)
    drives: dict[str, DriveConfiguration] = {}
    checkers = {name: DriveChecker(tree, name, _names(tree, 'buses'), store)
                for name in tree.data.get('drives', {})}
    for name, checker in checkers.items():
        drive = checker.check()
        if drive is not None:
            drives[name] = drive
    _check_together(tree, buses, drives, checkers, adapters)
    check_topics(tree, drives.values(), namespace)
    if not _names(tree, 'drives') and not tree.is_damaged(('drives',)):
        tree.suspicious(('drives',), complaints.no_drive())
    found = [tree, *store.trees]
    problems = [problem for part in found for problem in part.problems]
    for name in checkers:
        if name not in drives and not problems:  # whatever it is: no drive gets lost in silence
            problems.append(tree.problem(('drives', name), complaints.nobody_knows()))
    if problems:
        raise ConfigurationError(report(problems))
    values.update(buses=buses, drives=drives,
                  profile_directories=tuple(values['profile_directories']))
    return BridgeConfiguration(
        warnings=tuple(report(warning for part in found for warning in part.warnings)),
        standard={key: value for key, value in tree.data.items()
                  if key not in BridgeConfiguration.__dataclass_fields__},
        **{key: value for key, value in values.items()
           if key in BridgeConfiguration.__dataclass_fields__})


def _check_together(tree: Tree, buses: Mapping[str, BusConfiguration],
                    drives: Mapping[str, DriveConfiguration],
                    checkers: Mapping[str, DriveChecker], adapters: Adapters | None) -> None:
    """Check drives together, as far as enough is known of them."""
    placed = {name: drive for name, drive in drives.items()
              if checkers[name].is_sound('bus', 'protocol', 'station')}
    paced = [drive for name, drive in drives.items()
             if checkers[name].is_sound('bus', 'protocol', 'period', *LISTS)]
    check_identifiers(tree, placed.values(), buses)
    check_joint_names(tree, drives.values())
    for bus in buses.values():
        here = [drive for drive in paced if drive.bus == bus.name]
        if ('buses', bus.name, 'bitrate') not in tree.damaged:
            check_load(tree, bus, here)
            check_rounds(tree, bus, here)
            traits = None if adapters is None else adapters.traits_of(bus)
            if traits is not None:
                check_adapter(tree, bus, [each for each in here if each.name in placed], traits)
        check_neighbours(tree, [drive for drive in here if drive.name in placed])


def _forget_findings(tree: Tree) -> None:
    """Remove what the bridge sets by itself: ``ros2 param dump`` writes that too."""
    if isinstance(tree.data.get('bridges'), list):
        del tree.data['bridges']
    drives = tree.data.get('drives')
    for drive in drives.values() if isinstance(drives, dict) else ():
        for key in ('identity', 'profile_sha256', 'restore', 'setpoints', 'commanders'):
            if isinstance(drive, dict) and isinstance(drive.get(key), str):
                del drive[key]


def _names(tree: Tree, key: str) -> list[str]:
    """Return all keys of a mapping, also of those entries that turned out to be wrong."""
    names = list(tree.data.get(key, {}))
    wrong = [path for path in tree.damaged if len(path) == 2 and path[0] == key]
    return names + [str(path[1]) for path in sorted(wrong, key=tree.line)]


def _look_for_directories(tree: Tree, directories: list[str]) -> None:
    path = ('profile_directories',)
    for position, entry in enumerate(directories):
        if entry and not os.path.isdir(entry):
            tree.suspicious(path, complaints.no_directory(name=entry), at=(*path, position))


def _sentence(tree: Tree, path: Path, value: Any, keyword: str) -> Sentence | None:
    """Return the sentence that needs more than the schema, see :data:`.schema.Override`."""
    if path[:1] != ('drives',) or len(path) != 3 or keyword not in (
            'enum', 'type', 'additionalProperties'):
        return None
    if path[2] == 'protocol' and keyword != 'additionalProperties':
        if keyword == 'type':  # is told as a value that is unknown
            return NOTHING
        available = ', '.join(FAMILIES)
        if isinstance(value, str):
            near = complaints.two_protocols() if value.lower() == 'canopen' else \
                hint(value, FAMILIES)
            return complaints.unknown_protocol(value=value, near=near, allowed=available)
        return complaints.no_protocol(value=value, allowed=available)
    if keyword != 'additionalProperties':
        return None
    protocol = tree.data['drives'][path[1]].get('protocol')
    family = FAMILIES.get(protocol) if isinstance(protocol, str) else None
    if family is None and path[2] in ALL_OPTIONS:  # perhaps of the family that is meant
        return NOTHING
    known = [name for name in definition('drive')['properties'] if name not in ALL_OPTIONS]
    return complaints.unknown_key(hint=suggestion(
        str(path[2]), [*known, *(family.options_schema if family else ())]))


def of_one_bus(configuration: BridgeConfiguration, name: str) -> BridgeConfiguration:
    """Return the part of a configuration with one of its buses."""
    return replace(
        configuration, buses={name: configuration.buses[name]},
        drives={drive.name: drive for drive in configuration.drives.values()
                if drive.bus == name})


def bridge_names(buses: Iterable[str]) -> dict[str, str]:
    """Return a name for a bridge of each bus; a node, unlike a bus, has no ``-`` in its name."""
    names: dict[str, str] = {}
    for bus in sorted(buses, key=lambda bus: '-' in bus):   # the others are called as they are
        name = f'drive_can_bridge_{bus.replace("-", "_")}'
        while name in names.values():
            name += '_'
        names[bus] = name
    return names


class _Dumper(yaml.SafeDumper):     # type: ignore[misc]  # has no types
    """Quotes text that rcl would read as something else: ``y``, ``1e5``, ``08``."""


def _text(dumper: yaml.SafeDumper, text: str) -> yaml.Node:
    style = None if read_scalar(text) == text else "'"
    return dumper.represent_scalar(STRING_TAG, text, style=style)


_Dumper.add_representer(str, _text)


def write_parameter_file(configuration: BridgeConfiguration, path: FilePath,
                         node: str = 'drive_can_bridge') -> None:
    """
    Write a configuration as a parameter file of a bridge.

    :param node: the bridge's name, in whatever namespace.
    :raises OSError: it cannot be written.
    """
    tree: dict[str, Any] = {**configuration.standard}
    for name, value, *_ in declared_parameters(configuration):
        *above, key = name.split('.')
        place = tree
        for part in above:
            place = place.setdefault(part, {})
        place[key] = value
    path.write_text(yaml.dump(
        {f'/**/{node}': {'ros__parameters': tree}}, Dumper=_Dumper, sort_keys=False),
        encoding='utf-8')
