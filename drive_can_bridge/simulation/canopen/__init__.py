# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The CANopen part of simulated drives, whatever they exchange by it (CiA 301)."""
