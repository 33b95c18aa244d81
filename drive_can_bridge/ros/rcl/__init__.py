# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What is done with rcl past rclpy, by members that nobody promises."""
