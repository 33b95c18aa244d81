# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a file offers for a profile, entry by entry, before anything is checked."""

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class Place:
    """
    Where something stands in the file that is imported.

    :param line: counted from 1.
    :param section: of an EDS file, in brackets; '' in a table.
    """

    line: int
    section: str = ''

    def __str__(self) -> str:
        """Write it as it follows the name of the file: ``12`` or ``345: [2004sub6]``."""
        return f'{self.line}: {self.section}' if self.section else str(self.line)


@dataclass(slots=True)
class Draft:
    """
    One entry.

    :param title: what its name is made from.
    :param entry: keys and values as the schema of profiles knows them.
    :param remarks: what was not said and had to be decided, or could not be taken over.
    """

    place: Place
    title: str
    entry: dict[str, Any]
    remarks: list[str] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class LeftOut:
    """Something in the file that is not in the profile or is odd, and why."""

    place: Place
    what: str
    reason: str

    def __str__(self) -> str:
        """Write what follows the name of the file."""
        return f'{self.place}: {self.what}: {self.reason}' if self.what \
            else f'{self.place}: {self.reason}'


@dataclass(slots=True)
class Found:
    """
    Everything that a file offers.

    :param description: of the drive type, where the file has one.
    :param left_out: entries that are not in the profile.
    :param oddities: what else is wrong in the file, and costs no entry.
    :param notes: about the file as a whole: what the columns were taken for.
    """

    description: str = ''
    drafts: list[Draft] = field(default_factory=list)
    left_out: list[LeftOut] = field(default_factory=list)
    oddities: list[LeftOut] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def complaints(self) -> list[LeftOut]:
        """Everything that is wrong, in the order of the file."""
        return sorted((*self.left_out, *self.oddities), key=lambda each: each.place.line)
