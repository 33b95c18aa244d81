# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What can go wrong while a profile is made."""

from drive_can_bridge.core.errors import DriveCanError


class ImportFailed(DriveCanError):
    """The file as a whole cannot be imported; the text continues its name."""


class Unusable(ValueError):
    """A cell or key has no usable value; the text says why."""
