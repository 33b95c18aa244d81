# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Why something cannot be done past rclpy."""


class Unfit(Exception):
    """This way is none here: versions that nobody has tried. Nothing was done."""
