# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Messages that are published as bytes."""

from collections.abc import Callable

from rclpy.publisher import Publisher

from drive_can_bridge.ros.rcl.extension import lacking


def publish_bytes(publisher: Publisher) -> Callable[[bytes], None]:
    """
    Return the function that publishes bytes. A destroyed publisher raises RCLError.

    The public way, ``Publisher.publish``, costs more than the publishing itself.
    """
    return publisher.publish if why_not_straight() else publisher.handle.publish_raw


def why_not_straight() -> str:
    """Return why bytes cannot be published; '': they can."""
    return lacking(['Publisher.publish_raw'])
