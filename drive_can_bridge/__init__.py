# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Bridge motor drives on CAN buses to ROS 2."""

__version__ = '0.1.0'
