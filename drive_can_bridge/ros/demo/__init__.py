# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The ROS side of ``drive_can demo``: a bridge, simulated drives, and a view of both in one process.

What needs rclpy are :mod:`.application`, :mod:`.commander` and :mod:`.observer`; the rest
works on snapshots, and can be tried without a bridge.
"""
