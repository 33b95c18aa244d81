# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What belongs to the process rather than to ROS: its signals, its environment."""
