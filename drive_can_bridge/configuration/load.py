# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
From a parameter file, or from the parameter overrides of a node, to a checked configuration.

Both ways run the same checks, and all of them: a user sees every problem at once.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path as FilePath
from typing import Any

from drive_can_bridge.configuration.bus_check import Adapters, BusChecker
from drive_can_bridge.configuration.declare import check_dynamic, declared_parameters
from drive_can_bridge.configuration.drive_check import DriveChecker
from drive_can_bridge.configuration.overrides import tree_from_overrides
from drive_can_bridge.configuration.parameter_file import read_parameter_file
from drive_can_bridge.configuration.problems import (
    hint, Path, Problem, report, show, suggestion, Tree,
)
from drive_can_bridge.configuration.profiles import ProfileStore
from drive_can_bridge.configuration.schema import defaults, definition, parameter_file_schema
from drive_can_bridge.configuration.schema_check import check_schema
from drive_can_bridge.configuration.traffic_check import collisions, misfits, overloads, too_fast
from drive_can_bridge.core.configuration import BridgeConfiguration, DriveConfiguration
from drive_can_bridge.core.errors import ConfigurationError
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
    return _configuration(tree, problems, adapters)


def configuration_from_overrides(overrides: Mapping[str, object], *,
                                 adapters: Adapters | None = None) -> BridgeConfiguration:
    """
    Check the parameter overrides of a node.

    :param overrides: values by dotted name, as rclpy gives them; None is rcl's empty list.
    :raises ConfigurationError: with one line per problem, ``key.path: message``; what is wrong
        inside a profile still has its file and line.
    """
    tree, problems = tree_from_overrides(overrides)
    return _configuration(tree, problems, adapters)


def _configuration(tree: Tree, problems: list[Problem], adapters: Adapters | None,
                   ) -> BridgeConfiguration:
    _forget_findings(tree)
    bus_names, drive_count = _names(tree, 'buses'), len(_names(tree, 'drives'))
    tree, found = check_schema(tree, parameter_file_schema(), 'bridge', override=_Override(tree))
    problems = [*problems, *found]

    bus_checker = BusChecker(tree, adapters)
    buses = bus_checker.check()
    problems.extend(bus_checker.problems)
    warnings = list(bus_checker.warnings)

    values = {**defaults('bridge'), **tree.data}
    directories = tuple(values['profile_directories'])
    warnings.extend(_missing_directories(tree, directories))
    store = ProfileStore(directories)
    drives: dict[str, DriveConfiguration] = {}
    placed: list[DriveConfiguration] = []
    paced: list[DriveConfiguration] = []
    for name in tree.data.get('drives', {}):
        checker = DriveChecker(tree, name, bus_names, store)
        drive = checker.check()
        problems.extend(checker.problems)
        warnings.extend(checker.warnings)
        if drive is None:
            continue
        drives[name] = drive
        if checker.usable(('bus', 'protocol', 'station')):
            placed.append(drive)
        if checker.usable(('bus', 'protocol', 'period', 'cyclic_request', 'cyclic_response')):
            paced.append(drive)
    problems.extend(store.problems)
    warnings.extend(store.warnings)
    problems.extend(collisions(tree, placed))
    for bus in buses.values():
        if ('buses', bus.name, 'bitrate') in tree.damaged:
            continue
        wrong, suspicious = overloads(tree, bus, [d for d in paced if d.bus == bus.name])
        problems.extend(wrong)
        warnings.extend(suspicious)
        problems.extend(too_fast(tree, bus, [d for d in paced if d.bus == bus.name]))
    for name in buses:
        problems.extend(misfits(tree, [drive for drive in placed if drive.bus == name
                                       and drive in paced]))
    for name in tree.data.get('drives', {}):
        if name not in drives and not problems:  # whatever it is: no drive gets lost in silence
            problems.append(tree.problem(('drives', name), 'cannot be used, nobody knows why'))
    if not drive_count and not tree.is_damaged(('drives',)):
        warnings.append(tree.problem(('drives',), 'no drive is configured'))
    if problems:
        raise ConfigurationError(report(problems))
    return BridgeConfiguration(
        autostart=values['autostart'],
        diagnostics_period=float(values['diagnostics_period']),
        buses=buses, drives=drives, profile_directories=directories,
        warnings=tuple(report(warnings)))


def _forget_findings(tree: Tree) -> None:
    """Leave out what the bridge finds out by itself: ``ros2 param dump`` writes that too."""
    drives = tree.data.get('drives')
    for drive in drives.values() if isinstance(drives, dict) else ():
        for key in ('identity', 'profile_sha256'):
            if isinstance(drive, dict) and isinstance(drive.get(key), str):
                del drive[key]


def _names(tree: Tree, key: str) -> list[str]:
    """Return all keys of a mapping, also of those entries that turn out to be wrong."""
    entries = tree.data.get(key)
    names = list(entries) if isinstance(entries, dict) else []
    names += [str(path[1]) for path in tree.damaged if len(path) == 2 and path[0] == key]
    return names


def _missing_directories(tree: Tree, directories: Iterable[str]) -> list[Problem]:
    path = ('profile_directories',)
    return [tree.problem(path, f'{show(entry)} is no directory', at=(*path, position))
            for position, entry in enumerate(directories)
            if entry and ('\0' in entry or not FilePath(entry).is_dir())]


class _Override:
    """Sentences that need to know more than the schema does."""

    def __init__(self, tree: Tree) -> None:
        self._tree = tree

    def __call__(self, path: Path, value: Any, keyword: str) -> str | None:
        if keyword == 'not' and path[:1] == ('buses',):
            return 'set by the bridge itself, allowed is to leave it out'
        if path[:1] != ('drives',) or len(path) != 3:
            return None
        if path[2] == 'protocol' and keyword != 'required':
            return _unknown_protocol(value) if keyword == 'enum' else ''
        protocol = self._tree.data['drives'][path[1]].get('protocol')
        if keyword == 'not':
            owners = [family.name for family in FAMILIES.values()
                      if path[2] in family.options_schema]
            return f'a key of {", ".join(owners)}, allowed with {protocol} is to leave it out'
        if keyword == 'additionalProperties':
            return self._unknown_key(str(path[2]), protocol)
        return None

    def _unknown_key(self, key: str, protocol: Any) -> str | None:
        family = FAMILIES.get(protocol) if isinstance(protocol, str) else None
        common = [name for name in definition('drive')['properties']
                  if not any(name in other.options_schema for other in FAMILIES.values())]
        if family is not None:
            return f'unknown key, {suggestion(key, [*common, *family.options_schema])}'
        options = {name for other in FAMILIES.values() for name in other.options_schema}
        if key in options:      # perhaps of the family that is meant
            return ''
        return f'unknown key, {suggestion(key, common)}'


def _unknown_protocol(value: Any) -> str:
    available = ', '.join(FAMILIES)
    if not isinstance(value, str):
        return f'{show(value)} is no protocol; available: {available}'
    return f'{show(value)} is unknown{hint(value, FAMILIES)}; available: {available}'
