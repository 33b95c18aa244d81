# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The ROS client that fills the model of :mod:`drive_can_bridge.monitor`."""
