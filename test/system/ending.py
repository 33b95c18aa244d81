# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""How the scripts end that the tests in this directory start: by a signal, without a traceback."""

from collections.abc import Iterator
from contextlib import contextmanager

import rclpy
from rclpy.executors import ExternalShutdownException

from drive_can_bridge.ros.rcl.extension import GONE


@contextmanager
def until_told_to_end() -> Iterator[None]:
    """Take a signal for the end, also amid a call of rclpy; whatever else happens is raised."""
    try:
        yield
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except GONE:
        if rclpy.ok():
            raise
    finally:
        rclpy.try_shutdown()
