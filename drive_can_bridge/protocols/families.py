# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The table of protocol families. A new family adds one row."""

from drive_can_bridge.protocols.datamodel.extended_family import DataModelExtended
from drive_can_bridge.protocols.family import Family

FAMILIES: dict[str, Family] = {family.name: family for family in (
    DataModelExtended(),
)}
