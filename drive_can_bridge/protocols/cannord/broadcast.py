# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Which drives of a bus form a broadcast group, by their configuration."""

from collections.abc import Sequence

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.protocols.cannord.identifiers import all_identifier, group_identifier


def broadcast_identifier(drive: DriveConfiguration) -> int | None:
    """Return the broadcast identifier that a drive listens to; None: it has none."""
    kind = drive.options.broadcast
    extended = drive.options.extended_identifiers
    if kind == 'all':
        return all_identifier(extended=extended)
    if kind == 'group':
        return group_identifier(drive.station, extended=extended)
    return None


def groups(drives: Sequence[DriveConfiguration]) -> list[list[DriveConfiguration]]:
    """Return the broadcast groups among the drives of a bus, the leader of each first."""
    found: dict[tuple[int, bool], list[DriveConfiguration]] = {}
    for drive in drives:
        shared = broadcast_identifier(drive)
        if shared is not None:
            key = shared, drive.options.extended_identifiers
            found.setdefault(key, []).append(drive)
    return [sorted(together, key=lambda drive: drive.station) for together in found.values()]
