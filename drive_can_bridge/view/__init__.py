# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The live view in a terminal, with rich: pages made of snapshots, and a screen (:mod:`.live`).

A page is a function of the snapshot, of what the user has chosen, and of the size.
"""
