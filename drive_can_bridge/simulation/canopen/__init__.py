# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What simulated drives have of CANopen, whatever they exchange by it (CiA 301)."""
