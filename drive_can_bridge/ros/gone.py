# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What rclpy raises when the thing that is used, or its context, is there no more."""

from rclpy.exceptions import InvalidHandle
from rclpy.impl.implementation_singleton import rclpy_implementation

RCLError = rclpy_implementation.RCLError
GONE = (InvalidHandle, RCLError)
