# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The error for what cannot be done past rclpy."""


class Unfit(Exception):
    """This way does not work in this version of rclpy. Nothing was done."""
