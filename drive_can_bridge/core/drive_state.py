# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""How a drive is, in one word."""

from enum import Enum


class DriveState(Enum):
    """The state of a drive in one word, as diagnostics shows it."""

    OFFLINE = 'offline'
    MAPPING_DIFFERS = 'mapping differs'
    DISABLED = 'disabled'
    NOT_ARMED = 'not armed'
    ONLINE = 'online'
    FAULT = 'fault'
