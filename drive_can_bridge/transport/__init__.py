# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""CAN buses through python-can: the only package that imports ``can``."""
