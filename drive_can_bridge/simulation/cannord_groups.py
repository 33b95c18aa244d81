# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What kind of parameter a number of a NORD inverter is follows from the entries that have it.

============================================ ======================================================
entries                                      kind
============================================ ======================================================
one without ``subindex``                     simple
all with ``subindex``                        array; element = sub-index
one without, others with ``subindex``        one value per parameter set; the one without is set 1,
                                             sub-index 1 to 3 are the sets 2 to 4
============================================ ======================================================
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.cannord.parameter_frame import NUMBER_MAX


@dataclass
class Group:
    """All entries with one number, by sub-index; one without a sub-index counts as 0."""

    members: dict[int, Parameter] = field(default_factory=dict)
    plain: bool = False

    @property
    def array(self) -> bool:
        """Array tasks are possible."""
        return not self.plain or len(self.members) > 1

    @property
    def sets(self) -> bool:
        """Each parameter set has a value of its own."""
        return self.plain and len(self.members) > 1


def groups_of(parameters: Mapping[str, Parameter]) -> dict[int, Group]:
    """Collect the entries of a profile by number."""
    groups: dict[int, Group] = {}
    for parameter in parameters.values():
        if parameter.number is None or parameter.number > NUMBER_MAX:
            continue
        group = groups.setdefault(parameter.number, Group())
        group.members[parameter.subindex or 0] = parameter
        group.plain = group.plain or parameter.subindex is None
    return groups
