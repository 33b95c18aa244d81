# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Messages that are published as bytes."""

from collections.abc import Callable

from rclpy.publisher import Publisher

from drive_can_bridge.ros.rcl.extension import look_for
from drive_can_bridge.ros.rcl.unfit import Unfit


def publish_bytes(publisher: Publisher) -> Callable[[bytes], None]:
    """
    Return the function that publishes bytes. A destroyed publisher raises RCLError.

    The public way, ``Publisher.publish``, costs more than the publishing itself.
    """
    straight: Callable[[bytes], None] = (
        publisher.publish if why_not_straight() else publisher.handle.publish_raw)
    return straight


def why_not_straight() -> str:
    """Return why bytes cannot be published; '': they can."""
    try:
        look_for(['Publisher.publish_raw'])
    except Unfit as error:
        return str(error)
    return ''
