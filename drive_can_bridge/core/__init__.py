# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What every protocol family shares: values, setpoints, requests, events.

Nothing in this package (nor in :mod:`drive_can_bridge.protocols`) reads a clock, starts a thread,
writes a log, or imports ``can`` or ``rclpy``. Time is an argument called ``now``: seconds of a
steady clock as a float.
"""
