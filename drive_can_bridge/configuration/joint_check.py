# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The ``joint`` section of a drive: its parameters are exchanged, and their units convert."""

from collections.abc import Iterable
from typing import Any

from drive_can_bridge.configuration.problems import Path, Tree
from drive_can_bridge.configuration.schema import complete
from drive_can_bridge.core.configuration import DriveConfiguration, JointConfiguration
from drive_can_bridge.core.parameters import Parameter, ValueKind
from drive_can_bridge.core.units import (
    convertible_units, ELECTRICAL_FREQUENCY, Quantity, si_factor,
)
from drive_can_bridge.core.words import nearest, show, suggestion

_COMMAND = '_command'
_KEYS = tuple(quantity.value + suffix for suffix in ('', _COMMAND) for quantity in Quantity)


def check_joint(tree: Tree, drive: DriveConfiguration) -> JointConfiguration | None:
    """Return the joint of a drive; None where it has none, or a wrong one."""
    entry = tree.data['drives'][drive.name].get('joint')
    return None if entry is None else _JointChecker(tree, drive).check(entry)


def check_joint_names(tree: Tree, drives: Iterable[DriveConfiguration]) -> None:
    """Check that no two drives have joints of one name: they share messages."""
    owners: dict[str, str] = {}
    for drive in drives:
        if drive.joint is not None and owners.setdefault(
                drive.joint.name, drive.name) != drive.name:
            tree.wrong(('drives', drive.name, 'joint', 'name'),
                       f'{show(drive.joint.name)} is the joint of drives.'
                       f'{owners[drive.joint.name]} already, allowed is a name of its own')


class _JointChecker:
    """
    Check one ``joint`` section.

    :param drive: the drive as far as it is known; unlisted parameters in its lists stand for
        those that have a problem of their own.
    """

    def __init__(self, tree: Tree, drive: DriveConfiguration) -> None:
        self._tree = tree
        self._drive = drive
        self._path: Path = ('drives', drive.name, 'joint')

    def check(self, entry: dict[str, Any]) -> JointConfiguration | None:
        """Return the joint, or None after noting what is wrong."""
        values = complete('joint', entry)
        named = {key: entry[key] for key in _KEYS if key in entry}
        if not named and not any((*self._path, key) in self._tree.damaged for key in _KEYS):
            self._tree.wrong(self._path, 'names no quantity, allowed is at least one of '
                                         f'{", ".join(_KEYS)}')
        factors: dict[str, float] = {}
        used: dict[str, str] = {}
        units = set()
        for key, name in named.items():
            parameter = self._find(key, name)
            if parameter is None:
                continue
            quantity = key.removesuffix(_COMMAND)
            if used.setdefault(name, quantity) != quantity:
                self._wrong(key, f'{show(name)} is the {used[name]} already, allowed is another '
                                 'parameter')
                continue
            factor = self._factor(key, parameter, values)
            if factor is not None:
                factors[name] = factor
                units.add(parameter.unit)
            if key == 'position_command' and not parameter.neutral_from:
                self._tree.suspicious(
                    (*self._path, key), f'{show(name)} has no neutral_from: without a command '
                    f'the axis goes to {show(parameter.value_from_raw(parameter.neutral_raw))} '
                    f'{parameter.unit}, wherever it stands')
        if not self._tree.is_sound(self._path):
            return None
        if values['pole_pairs'] != 1 and ELECTRICAL_FREQUENCY not in units:
            self._tree.suspicious(
                (*self._path, 'pole_pairs'),
                f'has no effect: no parameter of the joint has the unit {ELECTRICAL_FREQUENCY}')
        return JointConfiguration(factors=factors, **values)

    def _wrong(self, key: str, message: str) -> None:
        self._tree.wrong((*self._path, key), message)

    def _find(self, key: str, name: str) -> Parameter | None:
        """Return the parameter that a key names, if it is good for a joint."""
        listed_in = 'cyclic_request' if key.endswith(_COMMAND) else 'cyclic_response'
        if self._tree.is_damaged((*self._path[:-1], listed_in)):
            return None
        exchanged: dict[str, Parameter] = {
            parameter.name: parameter for parameter in getattr(self._drive, listed_in)}
        parameter = exchanged.get(name)
        if parameter is None:
            misspelt = [other.name for other in exchanged.values() if not other.listed]
            if nearest(name, misspelt, cutoff=0.8):
                return None
            hint = suggestion(name, exchanged) if exchanged else f'{listed_in} is empty'
            self._wrong(key, f'{show(name)} is not in {listed_in}, {hint}')
            return None
        if not parameter.listed:
            return None
        control = self._drive.profile.control
        if control is not None and name == control.parameter and key.endswith(_COMMAND):
            self._wrong(key, f'{show(name)} is the control word, allowed is a setpoint')
            return None
        if parameter.kind is ValueKind.BOOL:
            self._wrong(key, f'{show(name)} is a bool, allowed is a number')
            return None
        return parameter

    def _factor(self, key: str, parameter: Parameter, values: dict[str, Any]) -> float | None:
        quantity = Quantity(key.removesuffix(_COMMAND))
        factor = si_factor(quantity, parameter.unit, gear_ratio=values['gear_ratio'],
                           pole_pairs=values['pole_pairs'])
        if factor is None:
            unit = f'the unit {show(parameter.unit)}' if parameter.unit else 'no unit'
            self._wrong(key, f'{show(parameter.name)} has {unit}, which does not convert; '
                             f'allowed is one of {", ".join(convertible_units(quantity))}')
        return factor
