# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What all CANopen nodes have in common, whatever is exchanged with them (CiA 301)."""
