# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Access to rcl past rclpy, by members that are not part of its public interface."""
