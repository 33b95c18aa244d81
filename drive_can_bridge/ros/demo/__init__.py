# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The ROS side of ``drive_can demo``: a node that commands the drives."""
