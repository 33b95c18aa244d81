# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The exchange on one bus: sessions, one lock, two threads."""
