# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Text from the graph: anybody can put anything there."""

import re

from drive_can_bridge.core.text import TEXT_MAX

#: characters kept of a line of the log, which may tell of several drives
LOG_LIMIT = 2000
_ROS_NAME = re.compile(r'(/[A-Za-z_][A-Za-z0-9_]*)+')


def is_ros_name(name: str) -> bool:
    """Tell whether a full name may stand in front of a topic."""
    return len(name) <= TEXT_MAX and _ROS_NAME.fullmatch(name) is not None
