# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The table of protocol families: a row each, and another one in simulation/simulation.py."""

from collections.abc import Sequence

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.cannord.family import Cannord
from drive_can_bridge.protocols.canopen_pkw.family import CanopenPkw
from drive_can_bridge.protocols.cia402.family import Cia402
from drive_can_bridge.protocols.datamodel.family import DataModelExtended, DataModelStandard
from drive_can_bridge.protocols.family import Family

FAMILIES: dict[str, Family] = {family.name: family for family in (
    DataModelExtended(),
    DataModelStandard(),
    Cannord(),
    CanopenPkw(),
    Cia402(),
)}


def make_sessions(drives: Sequence[DriveConfiguration]) -> list[Session]:
    """Make the sessions of all drives of one bus, in the same order."""
    made: dict[str, Session] = {}
    for name in dict.fromkeys(drive.protocol for drive in drives):
        together = [drive for drive in drives if drive.protocol == name]
        made.update(zip((drive.name for drive in together),
                        FAMILIES[name].make_sessions(together)))
    return [made[drive.name] for drive in drives]
