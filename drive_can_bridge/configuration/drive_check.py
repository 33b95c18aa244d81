# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The drives of a configuration, one by one.

A drive is built even when parts of it are wrong, with defaults in place of the wrong parts, so
that everything else about it can be checked in the same run.
"""

from collections.abc import Container, Iterator
from dataclasses import replace
from typing import Any

from drive_can_bridge.configuration.joint_check import JointChecker
from drive_can_bridge.configuration.problems import Path, Problem, show, suggestion, Tree
from drive_can_bridge.configuration.profile_check import LoadedProfile
from drive_can_bridge.configuration.profiles import ProfileStore
from drive_can_bridge.configuration.schema import defaults, family_defaults
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import Access, Parameter, Storage
from drive_can_bridge.core.profile import Profile
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.family import Complaint, Family

BRIDGE_NAME = 'drive_can_bridge'
_NO_PROFILE = Profile('', '', '', ())
_LISTS = ('cyclic_request', 'cyclic_response')


class DriveChecker:
    """
    Check one drive of a tree that has passed its schema.

    :param buses: names of all buses, wrong ones included.
    """

    def __init__(self, tree: Tree, name: str, buses: list[str], store: ProfileStore) -> None:
        self.problems: list[Problem] = []
        self.warnings: list[Problem] = []
        self._tree = tree
        self._name = name
        self._path: Path = ('drives', name)
        self._entry: dict[str, Any] = tree.data['drives'][name]
        self._buses = buses
        self._store = store
        self._loaded: LoadedProfile | None = None

    def check(self) -> DriveConfiguration | None:
        """Return the drive as far as it is known; None where not even the protocol is."""
        if self._name == BRIDGE_NAME:
            self._note((), f'{show(self._name)} is the name of the bridge itself, allowed is any '
                           'other')
        bus = self._entry.get('bus')
        if bus is not None and bus not in self._buses:
            self._note(('bus',), f'{show(bus)} is unknown, {suggestion(bus, self._buses)}')
        family = FAMILIES.get(self._entry.get('protocol', ''))
        self._load_profile(family)
        lists = {key: self._list(key) for key in _LISTS}
        if family is None:
            return None
        drive = self._build(family, lists)
        self._check_control(family)
        self._check_setpoints(drive)
        self._check_status(drive)
        if not family.cyclic and not drive.cyclic_response and not self._is_damaged(_LISTS[1]):
            self._note((_LISTS[1],), f'empty, allowed in {family.name} is at least one parameter')
        self.problems.extend(self._placed(family.check(drive)))
        self.warnings.extend(self._placed(family.warnings(drive)))
        if 'joint' not in self._entry:
            return drive
        checker = JointChecker(self._tree, self._path, drive)
        joint = checker.check(self._entry['joint'])
        self.problems.extend(checker.problems)
        self.warnings.extend(checker.warnings)
        return DriveConfiguration(**{**vars(drive), 'joint': joint})

    def usable(self, keys: Container[str]) -> bool:
        """Tell whether none of these keys has a problem."""
        own = [place[2] for place in self._tree.damaged if place[:2] == self._path
               and len(place) > 2]
        noted = [problem.key.split('.')[2] for problem in self.problems
                 if problem.file == self._tree.file and problem.key.count('.') > 1]
        return not any(str(key) in keys for key in [*own, *noted])

    # -- parts ------------------------------------------------------------------------------------

    def _note(self, keys: tuple[str, ...], message: str, *, at: Path | None = None) -> None:
        self.problems.append(self._tree.problem((*self._path, *keys), message, at=at))

    def _is_damaged(self, key: str) -> bool:
        return self._tree.is_damaged((*self._path, key))

    def _load_profile(self, family: Family | None) -> None:
        name = self._entry.get('profile')
        if name is None:
            return
        loaded = self._store.load(name)
        if isinstance(loaded, str):
            self._note(('profile',), loaded)
            return
        if loaded.tree.is_damaged(('parameters',)):
            return
        self._loaded = loaded
        protocols = loaded.profile.protocols
        if family is not None and protocols and family.name not in protocols:
            self._note(('profile',), f'{show(name)} is for {", ".join(protocols)}, allowed is a '
                                     f'profile for {family.name}')

    def _list(self, key: str) -> tuple[Parameter, ...]:
        """Resolve a list of parameter names; what has a problem is a stand-in, not listed."""
        found: list[Parameter] = []
        path = (*self._path, key)
        for position, name in enumerate(self._entry.get(key, [])):
            at = (*path, position)
            if any(parameter.name == name for parameter in found):
                self._note((key,), f'{show(name)} stands twice, allowed is once', at=at)
                continue
            parameter = Parameter(name=name, listed=False)
            if self._loaded is not None:
                if name not in self._loaded.names:
                    self._note((key,), f'{show(name)} is not in the profile, '
                                       f'{suggestion(name, self._loaded.names)}', at=at)
                parameter = self._loaded.profile.parameters.get(name, parameter)
            message = _direction_problem(key, parameter)
            if message:
                self._note((key,), message, at=at)
            found.append(parameter)
        return tuple(found)

    def _build(self, family: Family, lists: dict[str, tuple[Parameter, ...]],
               ) -> DriveConfiguration:
        values = {**defaults('drive'), **family.drive_defaults, **self._entry}
        options = {**family_defaults(family),
                   **family.station_defaults(values.get('station', 1))}
        options.update({key: self._entry[key] for key in family.options_schema
                        if key in self._entry})
        for key, option in family.options_schema.items():
            if option.get('type') == 'number' and key in options:
                options[key] = float(options[key])
        profile = _NO_PROFILE if self._loaded is None else self._loaded.profile
        if family.control_built_in:  # a section for the other protocols of the profile
            profile = replace(profile, control=None)
        return DriveConfiguration(
            name=self._name, bus=values.get('bus', ''), protocol=family.name,
            station=values.get('station', 1), profile=profile,
            period=float(values['period']),
            cyclic_request=lists['cyclic_request'], cyclic_response=lists['cyclic_response'],
            missed_limit=values['missed_limit'],
            command_timeout=float(values['command_timeout']),
            rearm_immediate=values['rearm'] == 'immediate',
            parameter_timeout=float(values['parameter_timeout']),
            parameter_retries=values['parameter_retries'],
            verify_writes=values['verify_writes'],
            control_timeout=float(values['control_timeout']),
            family_options=options, profile_key=values.get('profile', ''))

    def _check_control(self, family: Family) -> None:
        """Check that a control section is not for a family that has its control built in."""
        if not family.control_built_in or self._loaded is None:
            return
        others = [name for name in self._loaded.profile.protocols if name != family.name]
        if self._loaded.profile.control is not None and not others:
            self.problems.append(self._loaded.tree.problem(
                ('control',), f'control is built in for {family.name}, allowed is to leave it '
                              'out'))

    def _check_setpoints(self, drive: DriveConfiguration) -> None:
        """Check that what is sent without a command lies in the limits."""
        control = drive.profile.control
        for position, parameter in enumerate(drive.cyclic_request):
            is_word = control is not None and control.parameter == parameter.name
            if is_word or not parameter.listed or parameter.neutral is not None:
                continue
            if _direction_problem('cyclic_request', parameter):
                continue
            try:
                parameter.check_limits(float(parameter.value_from_raw(0)))
            except ValueRefused:
                self._note(('cyclic_request',), f'{show(parameter.name)} has no neutral value and '
                           f'raw 0 is out of its range, allowed is a neutral of '
                           f'{parameter.range_text}',
                           at=(*self._path, 'cyclic_request', position))

    def _check_status(self, drive: DriveConfiguration) -> None:
        control = drive.profile.control
        if control is None or control.status_parameter is None \
                or self._is_damaged('cyclic_response'):
            return
        if all(parameter.name != control.status_parameter for parameter in drive.cyclic_response):
            self.warnings.append(self._tree.problem(
                (*self._path, 'cyclic_response'),
                f'{show(control.status_parameter)} is missing: without the status word the bridge '
                'cannot tell whether the drive is enabled'))

    def _placed(self, complaints: Iterator[Complaint]) -> Iterator[Problem]:
        """Put what a family complains about where it belongs."""
        for key, message in complaints:
            parts = tuple(key.split('.')) if key else ()
            if parts[:1] == ('profile',) and len(parts) > 1 and self._loaded is not None:
                yield self._loaded.tree.problem(parts[1:], message)
            elif not self._tree.is_damaged((*self._path, *parts)):
                yield self._tree.problem((*self._path, *parts), message)


def _direction_problem(key: str, parameter: Parameter) -> str:
    """Say why a parameter cannot travel in this direction; '' if it can."""
    if not parameter.listed:
        return ''
    name = show(parameter.name)
    if key == 'cyclic_response':
        return f'{name} is write-only, allowed are parameters with access ro or rw' \
            if parameter.access is Access.WRITE_ONLY else ''
    if parameter.access is Access.READ_ONLY:
        return f'{name} is read-only, allowed are parameters with access rw or wo'
    if parameter.storage is Storage.EEPROM:
        return f'{name} is kept in EEPROM, which cyclic writing would wear out; allowed are ' \
               'parameters with storage ram'
    return ''
