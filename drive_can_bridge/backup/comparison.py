# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What differs between two backups, a backup and a drive, or two drives: settings only."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
import math

from drive_can_bridge.backup.document import (
    Backup, in_order, is_setting, mode_bits, modes_of, raw_in_file, settings_of,
)
from drive_can_bridge.client.drive import Drive, ReadOutcome
from drive_can_bridge.core.errors import ConfigurationError, ValueRefused
from drive_can_bridge.core.parameters import Parameter, Value

#: of values of which no profile says how fine they are
_RELATIVE_TOLERANCE = 1e-9


@dataclass(frozen=True, slots=True)
class Setting:
    """
    A setting on one side of a comparison.

    :param value: in the parameter's unit.
    :param raw: None where nobody knows the parameter.
    """

    value: Value
    raw: int | None = None


@dataclass(frozen=True, slots=True)
class Difference:
    """
    A setting that is not the same on both sides.

    :param first: None: that side has no such setting.
    """

    name: str
    parameter: Parameter | None
    first: Setting | None
    second: Setting | None

    @property
    def unit(self) -> str:
        """Unit of the values, '' where there is none or nobody knows it."""
        return self.parameter.unit if self.parameter else ''


@dataclass(frozen=True, slots=True)
class Side:
    """
    One side of a comparison.

    :param settings: by name, in order.
    :param parameters: what is known of them.
    :param left_out: names in a file that are no settings.
    """

    settings: Mapping[str, Setting]
    parameters: Mapping[str, Parameter]
    left_out: tuple[str, ...] = ()


def side_of_drive(drive: Drive, outcomes: Mapping[str, ReadOutcome]) -> Side:
    """Take the settings of a drive that were read, and a mode that it was left in."""
    bits = mode_bits(drive.facts.restore)
    found = {name: outcome for name, outcome in outcomes.items() if outcome.ok and (
        is_setting(drive, name) or not bits[name].is_over(outcome.raw or 0))}
    return Side({name: Setting(outcome.value, outcome.raw) for name, outcome in found.items()
                 if outcome.value is not None},
                {name: outcome.parameter for name, outcome in found.items()
                 if outcome.parameter is not None})


def side_of_file(backup: Backup, *, find: Callable[[str], Parameter | None],
                 counts: Callable[[str], bool]) -> Side:
    """
    Take the settings of a file.

    :param find: gives what is known of a parameter.
    :param counts: tells whether a parameter that is known is a setting.
    :raises ConfigurationError: a value of the wrong type.
    """
    settings: dict[str, Setting] = {}
    parameters: dict[str, Parameter] = {}
    left_out, problems = [], []
    for name, value in backup.values.items():
        parameter = find(name)
        if parameter is None:
            settings[name] = Setting(value)     # type: ignore[arg-type]  # the reader saw to it
        elif not counts(name):
            left_out.append(name)
        else:
            try:
                settings[name] = Setting(value, raw_in_file(    # type: ignore[arg-type]
                    parameter, value))
                parameters[name] = parameter
            except ValueRefused as error:
                problems.append(backup.problem(name, str(error)))
    if problems:
        raise ConfigurationError(problems)
    return Side(settings, parameters, tuple(left_out))


def side_of_file_and_drive(backup: Backup, drive: Drive) -> Side:
    """Take the settings of a file, as the profile of a drive knows them."""
    return side_of_file(backup, find=drive.find, counts=lambda name: is_setting(drive, name))


def names_to_read(drive: Drive, *others: Backup) -> tuple[str, ...]:
    """Return what to read of a drive: settings, its mode, and what else a file has of them."""
    names = [*settings_of(drive), *modes_of(drive)]
    names += [name for backup in others for name in backup.values
              if name not in names and is_setting(drive, name)]
    return in_order(drive, list(dict.fromkeys(names)))


def differences(first: Side, second: Side) -> list[Difference]:
    """Compare two sides."""
    names = dict.fromkeys([*first.settings, *second.settings])
    found = []
    for name in names:
        one, other = first.settings.get(name), second.settings.get(name)
        parameter = first.parameters.get(name) or second.parameters.get(name)
        if one is None or other is None or not _same(one, other, parameter):
            found.append(Difference(name, parameter, one, other))
    return found


def _same(one: Setting, other: Setting, parameter: Parameter | None) -> bool:
    if one.raw is None or other.raw is None or parameter is None:
        return type(one.value) is type(other.value) and math.isclose(
            one.value, other.value, rel_tol=_RELATIVE_TOLERANCE)
    return one.raw == other.raw
