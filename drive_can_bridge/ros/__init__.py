# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The ROS side: parameters, one node per drive, topics, services. Thin: messages to values."""
