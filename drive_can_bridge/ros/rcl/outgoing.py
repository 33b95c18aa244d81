# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Messages that are bytes already."""

from collections.abc import Callable

from rclpy.publisher import Publisher

from drive_can_bridge.ros.rcl.extension import look_for
from drive_can_bridge.ros.rcl.unfit import Unfit


def publish_bytes(publisher: Publisher) -> Callable[[bytes], None]:
    """
    Return what publishes the bytes of a message. A destroyed publisher raises RCLError.

    The promised way, ``Publisher.publish``, costs more than the handing over.
    """
    straight: Callable[[bytes], None] = (
        publisher.publish if why_not_straight() else publisher.handle.publish_raw)
    return straight


def why_not_straight() -> str:
    """Say why that is not to be had; '': it is."""
    try:
        look_for(['Publisher.publish_raw'])
    except Unfit as error:
        return str(error)
    return ''
