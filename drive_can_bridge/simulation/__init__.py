# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Simulated drives: for trying the bridge without hardware, and for testing it.

The simulated drives use the codecs of :mod:`drive_can_bridge.protocols`, never a session, and are
sans-IO like everything below them: time is an argument. Threads, clocks and end points are in
:mod:`.simulation` and :mod:`.terminal` only.
"""
