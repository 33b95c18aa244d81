# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The one ROS client of bridges: services and topics that any node can use."""
