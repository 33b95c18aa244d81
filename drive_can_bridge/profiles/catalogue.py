# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Which profiles there are, what is in one, and whether it is right."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Any

from drive_can_bridge.configuration.problems import Problem
from drive_can_bridge.configuration.profile_check import LoadedProfile
from drive_can_bridge.configuration.profiles import ProfileStore, read_profile, SUFFIX
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import Profile
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.family import Complaint, Family
from drive_can_bridge.resources import profiles_directory

#: how an entry's key ``verified`` is shown
VERIFIED_WORDS: dict[bool | None, str] = {True: 'yes', False: 'no', None: ''}
_OURS = 'profile.'
#: of a parameter, in the order in which it is described
_DESCRIBED = (
    'address', 'number', 'index', 'subindex', 'type', 'scale', 'offset', 'unit', 'access',
    'storage', 'minimum', 'maximum', 'neutral', 'neutral_from', 'limit', 'arming_tolerance',
    'bits', 'values', 'word_order', 'protected', 'description', 'source', 'verified', 'open')
#: a key of a family that changes what it needs of an entry: any value will do
_CHOICES = {'canopen_pkw': ('addressing', ('register', 'canopen'))}


@dataclass(frozen=True, slots=True)
class Checked:
    """
    A profile with everything that a bridge would say about it.

    :param problems: in the order of the file.
    """

    path: Path
    loaded: LoadedProfile
    problems: tuple[Problem, ...]
    warnings: tuple[Problem, ...]

    @property
    def entries(self) -> dict[str, dict[str, Any]]:
        """The entries that are all right, as the file has them."""
        parameters = self.loaded.tree.data.get('parameters', {})
        return {name: parameters[name] for name in self.loaded.profile.parameters}

    @property
    def sources(self) -> dict[str, str]:
        """Where the statements come from, by key."""
        return dict(self.loaded.tree.data.get('sources', {}))

    def count(self, verified: bool | None) -> int:
        """Count the entries that say of themselves that they are verified, are not, or nothing."""
        return sum(each.verified is verified for each in self.loaded.profile.parameters.values())


def available(directories: Sequence[Path]) -> dict[str, Path]:
    """
    Return all profiles by name.

    :param directories: searched before the shipped ones; the first of a name counts, as for a
        bridge.
    :raises DriveCanError: one of the directories is not there.
    """
    found: dict[str, Path] = {}
    for directory in directories:
        if not directory.is_dir():
            raise DriveCanError(f'{directory} is no directory')
    for directory in (*directories, profiles_directory()):
        for path in sorted(directory.glob(f'*{SUFFIX}')):
            found.setdefault(path.stem, path)
    return dict(sorted(found.items()))


def find(name: str, directories: Sequence[Path]) -> Path:
    """
    Return the file of a profile, given by its name or as a file.

    :raises DriveCanError: there is none; the text names those that exist.
    """
    as_file = Path(name)
    if '/' in name or name.endswith((SUFFIX, '.yml')):
        if not as_file.is_file():
            raise DriveCanError(f'{name}: no such file')
        return as_file
    found = ProfileStore([str(directory) for directory in directories]).load(name)
    if isinstance(found, str):
        raise DriveCanError(found)
    return Path(found.profile.path)


def check(path: Path) -> Checked:
    """
    Check a profile file for all protocols that it names.

    :raises OSError: it cannot be read.
    """
    loaded = read_profile(path)
    problems = list(loaded.problems)
    tree = loaded.tree
    if not tree.is_damaged(()):
        for protocol in loaded.profile.protocols:
            if protocol in FAMILIES:
                problems += [tree.problem(tuple(complaint.key.split('.')), complaint.message)
                             for complaint in family_complaints(loaded.profile, protocol)]
    ordered = sorted(dict.fromkeys(problems), key=lambda problem: problem.line)
    return Checked(path, loaded, tuple(ordered), tuple(loaded.warnings))


def description(name: str, parameter: Parameter, entry: dict[str, Any]) -> dict[str, Any]:
    """Describe an entry with all its keys, given ones and defaults: one JSON document."""
    found = {key: getattr(parameter, key, None) for key in _DESCRIBED}
    return {'name': name,
            **{key: each.value if isinstance(each, Enum) else each for key, each in found.items()},
            'neutral_from': parameter.neutral_from or None,
            'bits': dict(parameter.bits),
            'values': {str(raw): name for raw, name in parameter.values},
            'source': entry.get('source'), 'open': entry.get('open')}


# -- what families can carry ----------------------------------------------------------------------


def family_complaints(profile: Profile, protocol: str) -> list[Complaint]:
    """
    Return what a family cannot do with a table.

    :param protocol: one of the families; what the table is for beside it does not matter.
    :return: keys are paths in the profile, ``parameters.speed.type``.
    """
    family = FAMILIES[protocol]
    key, values = _CHOICES.get(protocol, ('', ()))
    found = [list(_complaints(replace(profile, protocols=(protocol,)), family,
                              family.make_options(1, given)))
             for given in [{key: value} for value in values] or [{}]]
    return min(found, key=len)


def _complaints(profile: Profile, family: Family, options: object) -> Iterator[Complaint]:
    if family.control_built_in:
        profile = replace(profile, control=None)
    drive = DriveConfiguration(name='drive', bus='bus', protocol=family.name, station=1,
                               profile=profile, options=options)
    for complaint in (*family.check_widths(drive), *family.check(drive)):
        if complaint.key.startswith(_OURS):
            yield complaint._replace(key=complaint.key.removeprefix(_OURS))
