# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Which protocol families can carry a table, and what they cannot do with it."""

from collections.abc import Iterator
from dataclasses import replace

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.profile import Profile
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.family import Complaint, Family

_OURS = 'profile.'
#: a key of a family that changes what it needs of an entry: any value will do
_CHOICES = {'canopen_pkw': ('addressing', ('register', 'canopen'))}


def family_complaints(profile: Profile, protocol: str) -> list[Complaint]:
    """
    Return what a family cannot do with a table.

    :param protocol: one of the families; what the table is for beside it is as the profile says.
    :return: keys are paths in the profile, ``parameters.speed.type``.
    """
    family = FAMILIES[protocol]
    found = [list(_complaints(profile, family, options)) for options in _options(family)]
    return min(found, key=len)


def _options(family: Family) -> Iterator[object]:
    key, values = _CHOICES.get(family.name, ('', ()))
    for given in [{key: value} for value in values] or [{}]:
        yield family.make_options(1, given)


def _complaints(profile: Profile, family: Family, options: object) -> Iterator[Complaint]:
    if family.control_built_in:
        profile = replace(profile, control=None)
    drive = DriveConfiguration(name='drive', bus='bus', protocol=family.name, station=1,
                               profile=profile, options=options)
    for complaint in (*family.check_widths(drive), *family.check(drive)):
        if complaint.key.startswith(_OURS):
            yield complaint._replace(key=complaint.key.removeprefix(_OURS))
