# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``drive_can demo``: simulated drives, bridge and live view, each a process of its own.

They are the ones that a user starts by hand, connected in the same way: bridge and drives on
pseudo-terminals, view and commander in the ROS graph.
"""
