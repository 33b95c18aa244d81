# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The identifiers of one device on its bus."""

from typing import NamedTuple

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.protocols.canopen import network


class Identifiers(NamedTuple):
    """
    All identifiers of a node that the bridge sends or wants to see; 11 bits each.

    :param request: PKW request, to the device.
    :param response: PKW response.
    :param emergency: emergency messages.
    :param heartbeat: boot-up frame and heartbeat.
    """

    request: int
    response: int
    emergency: int
    heartbeat: int

    @classmethod
    def of(cls, drive: DriveConfiguration) -> 'Identifiers':
        """Return those of a configured drive."""
        node, options = drive.station, drive.options
        return cls(
            request=options.request_cob_id, response=options.response_cob_id,
            emergency=network.EMERGENCY_BASE + node,
            heartbeat=network.HEARTBEAT_BASE + node)
