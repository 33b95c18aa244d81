# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What of ``drive_can demo`` talks to ROS itself: somebody who commands the drives."""
