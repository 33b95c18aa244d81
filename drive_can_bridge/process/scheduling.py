# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""How the threads of the process share the interpreter."""

import sys

#: s for which a thread that computes may keep others waiting. Python's 5 ms are as long as the
#: shortest period: a service call that is being answered would hold up a cycle by all of it. With
#: 0.1 ms, 10,000 commands/s and as many service calls as can be answered leave the period alone,
#: and the calls answered are as many as before (docs/performance.md).
SWITCH_INTERVAL = 0.0001


def let_others_in() -> None:
    """Prefer punctual threads to busy ones, in this process."""
    sys.setswitchinterval(SWITCH_INTERVAL)
