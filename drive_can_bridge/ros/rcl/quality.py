# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The quality of service that bridges and their clients have to agree on."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy


def latched_quality() -> QoSProfile:
    """Return what suits values that are published on change: late joiners get the last one."""
    return QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE,
                      durability=DurabilityPolicy.TRANSIENT_LOCAL)
