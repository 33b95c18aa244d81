# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Parameter tables as files: which there are, how far to trust them, and making new ones."""
