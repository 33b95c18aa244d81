# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Who may talk: the SROS2 policy of a bridge, and TLS between hosts.

Nothing here is needed by a bridge that runs.
"""
