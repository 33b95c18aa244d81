# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Settings of a drive as a file: its content, comparing it, and restoring it."""
