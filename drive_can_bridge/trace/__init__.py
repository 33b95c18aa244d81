# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Traces: recording what happens on buses, and decoding it."""
