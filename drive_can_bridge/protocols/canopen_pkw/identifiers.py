# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The identifiers of a mailbox on its bus; those of its node have all nodes."""

from typing import NamedTuple

from drive_can_bridge.core.configuration import DriveConfiguration


class Identifiers(NamedTuple):
    """PKW request, to the device, and response; 11 bits each."""

    request: int
    response: int

    @classmethod
    def of(cls, drive: DriveConfiguration) -> 'Identifiers':
        """Return those of a configured drive."""
        return cls(drive.options.request_cob_id, drive.options.response_cob_id)
