# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Find the owner of a frame by identifier *and* frame format, in a dictionary look-up or two."""

from collections.abc import Iterable, Sequence
from typing import Generic, TypeVar

from drive_can_bridge.core.frame import Frame, Route

Owner = TypeVar('Owner')


class Router(Generic[Owner]):
    """
    Routes with masks, grouped by mask.

    A bus has a handful of distinct masks at most, so that a frame costs one masked look-up per
    mask however many drives there are.
    """

    def __init__(self) -> None:
        self._tables: list[tuple[bool, int, dict[int, Owner]]] = []
        self._hearers: dict[tuple[int, bool], list[Owner]] = {}

    def add(self, routes: Iterable[Route], owner: Owner, overheard: Iterable[Route] = ()) -> None:
        """
        Send the frames of these routes to ``owner``.

        :param overheard: what it is to hear of, too, as others may; of one identifier each.
        """
        for route in routes:
            self._table(route.extended, route.mask)[route.identifier & route.mask] = owner
        for route in overheard:
            self._hearers.setdefault((route.identifier, route.extended), []).append(owner)

    def hearers(self, frame: Frame) -> Sequence[Owner]:
        """Return who is to hear of a frame that has no owner; it may be nobody."""
        return self._hearers.get((frame[0], frame[2]), ())

    def find(self, frame: Frame) -> Owner | None:
        """Return the owner of a frame, or None."""
        identifier, _, frame_extended = frame
        for extended, mask, table in self._tables:
            if extended == frame_extended:
                owner = table.get(identifier & mask)
                if owner is not None:
                    return owner
        return None

    def _table(self, extended: bool, mask: int) -> dict[int, Owner]:
        for known_extended, known_mask, table in self._tables:
            if (known_extended, known_mask) == (extended, mask):
                return table
        table = {}
        self._tables.append((extended, mask, table))
        return table
