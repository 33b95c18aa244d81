# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The DataModel protocol of an Italian drive manual: 29-bit cyclic and acyclic frames."""
