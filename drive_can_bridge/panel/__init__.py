# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The drives in a browser: pages on the model of :mod:`drive_can_bridge.monitor`.

:mod:`.access` checks every request and every WebSocket. What reaches a drive
is a POST to one of :mod:`.actions`, where the role counts; pages and their WebSocket only show.
"""

import sys

# The web framework would load it for a client of Socket.IO, of which there is none: 9 MB.
sys.modules.setdefault('aiohttp', None)  # type: ignore[arg-type]
