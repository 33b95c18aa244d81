# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
From a parameter file, or from the parameter overrides of a node, to a checked configuration.

Both ways run the same checks, and all of them: a user sees every problem at once.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path as FilePath
from typing import Any

import yaml

from drive_can_bridge.configuration.bus_check import (
    Adapters, check_buses, check_identifiers, check_load, check_neighbours, check_rounds,
)
from drive_can_bridge.configuration.declare import (
    check_dynamic, declared_parameters, tree_from_overrides,
)
from drive_can_bridge.configuration.drive_check import check_joint_names, DriveChecker, LISTS
from drive_can_bridge.configuration.parameter_file import read_parameter_file
from drive_can_bridge.configuration.problems import Path, report, Tree
from drive_can_bridge.configuration.profiles import ProfileStore
from drive_can_bridge.configuration.schema import (
    ALL_OPTIONS, check_schema, complete, definition, parameter_file_schema,
)
from drive_can_bridge.core.configuration import (
    BridgeConfiguration, BusConfiguration, DriveConfiguration,
)
from drive_can_bridge.core.errors import ConfigurationError
from drive_can_bridge.core.words import hint, show, suggestion
from drive_can_bridge.protocols.families import FAMILIES

__all__ = ['check_dynamic', 'configuration_from_file', 'configuration_from_overrides',
           'declared_parameters']


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
    return _configuration(tree, adapters)


def configuration_from_overrides(overrides: Mapping[str, object], *,
                                 adapters: Adapters | None = None) -> BridgeConfiguration:
    """
    Check the parameter overrides of a node.

    :param overrides: values by dotted name, as rclpy gives them; None is rcl's empty list.
    :raises ConfigurationError: with one line per problem, ``key.path: message``; what is wrong
        inside a profile still has its file and line.
    """
    return _configuration(tree_from_overrides(overrides), adapters)


def _configuration(tree: Tree, adapters: Adapters | None) -> BridgeConfiguration:
    _forget_findings(tree)
    check_schema(tree, parameter_file_schema(), 'bridge', override=partial(_sentence, tree))
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
    _check_together(tree, buses, drives, checkers)
    if not _names(tree, 'drives') and not tree.is_damaged(('drives',)):
        tree.suspicious(('drives',), 'no drive is configured')
    found = [tree, *store.trees]
    problems = [problem for part in found for problem in part.problems]
    for name in checkers:
        if name not in drives and not problems:  # whatever it is: no drive gets lost in silence
            problems.append(tree.problem(('drives', name), 'cannot be used, nobody knows why'))
    if problems:
        raise ConfigurationError(report(problems))
    values.update(buses=buses, drives=drives,
                  profile_directories=tuple(values['profile_directories']))
    return BridgeConfiguration(
        warnings=tuple(report(warning for part in found for warning in part.warnings)),
        **{key: value for key, value in values.items()
           if key in BridgeConfiguration.__dataclass_fields__})


def _check_together(tree: Tree, buses: Mapping[str, BusConfiguration],
                    drives: Mapping[str, DriveConfiguration],
                    checkers: Mapping[str, DriveChecker]) -> None:
    """Check what drives do to each other, as far as enough is known of them."""
    placed = {name: drive for name, drive in drives.items()
              if checkers[name].is_sound('bus', 'protocol', 'station')}
    paced = [drive for name, drive in drives.items()
             if checkers[name].is_sound('bus', 'protocol', 'period', *LISTS)]
    check_identifiers(tree, placed.values())
    check_joint_names(tree, drives.values())
    for bus in buses.values():
        here = [drive for drive in paced if drive.bus == bus.name]
        if ('buses', bus.name, 'bitrate') not in tree.damaged:
            check_load(tree, bus, here)
            check_rounds(tree, bus, here)
        check_neighbours(tree, [drive for drive in here if drive.name in placed])


def _forget_findings(tree: Tree) -> None:
    """Leave out what the bridge finds out by itself: ``ros2 param dump`` writes that too."""
    drives = tree.data.get('drives')
    for drive in drives.values() if isinstance(drives, dict) else ():
        for key in ('identity', 'profile_sha256', 'restore'):
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
        if entry and ('\0' in entry or not FilePath(entry).is_dir()):
            tree.suspicious(path, f'{show(entry)} is no directory', at=(*path, position))


def _sentence(tree: Tree, path: Path, value: Any, keyword: str) -> str | None:
    """Say what needs to know more than the schema does, see :data:`.schema.Override`."""
    if path[:1] != ('drives',) or len(path) != 3 or keyword not in (
            'enum', 'type', 'additionalProperties'):
        return None
    if path[2] == 'protocol' and keyword != 'additionalProperties':
        if keyword == 'type':  # is told as a value that is unknown
            return ''
        what = f'unknown{hint(value, FAMILIES)}' if isinstance(value, str) else 'no protocol'
        return f'{show(value)} is {what}; available: {", ".join(FAMILIES)}'
    if keyword != 'additionalProperties':
        return None
    protocol = tree.data['drives'][path[1]].get('protocol')
    family = FAMILIES.get(protocol) if isinstance(protocol, str) else None
    if family is None and path[2] in ALL_OPTIONS:  # perhaps of the family that is meant
        return ''
    known = [name for name in definition('drive')['properties'] if name not in ALL_OPTIONS]
    return 'unknown key, ' + suggestion(
        str(path[2]), [*known, *(family.options_schema if family else ())])


def of_one_bus(configuration: BridgeConfiguration, name: str) -> BridgeConfiguration:
    """Return what is left of a configuration with one of its buses."""
    return replace(
        configuration, buses={name: configuration.buses[name]},
        drives={drive.name: drive for drive in configuration.drives.values()
                if drive.bus == name})


def write_parameter_file(configuration: BridgeConfiguration, path: FilePath,
                         node: str = 'drive_can_bridge') -> None:
    """
    Write a configuration as a parameter file of a bridge.

    :param node: the bridge's name, in whatever namespace.
    :raises OSError: it cannot be written.
    """
    tree: dict[str, Any] = {}
    for name, value, *_ in declared_parameters(configuration):
        *above, key = name.split('.')
        place = tree
        for part in above:
            place = place.setdefault(part, {})
        place[key] = value
    path.write_text(yaml.safe_dump(
        {f'/**/{node}': {'ros__parameters': tree}}, sort_keys=False), encoding='utf-8')
