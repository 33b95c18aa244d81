# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Parameter tables as files: which exist, how far they are verified, and making new ones."""
