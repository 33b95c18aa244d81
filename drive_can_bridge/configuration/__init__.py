# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""From a ROS parameter file and profiles to a checked, frozen configuration."""
