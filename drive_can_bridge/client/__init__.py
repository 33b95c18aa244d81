# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The parameters of drives for people and scripts: directly, or through a running bridge."""
