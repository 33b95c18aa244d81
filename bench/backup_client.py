# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A process that reads what a backup reads, as ``drive_can backup`` does once it has the drives.

Started with a parameter file: directly on its bus; without: through the bridge that runs.
"""

import sys
import time
from typing import Any

from child import serve
import topics  # noqa: F401  sets the environment of rclpy
from unix_bus import register

from drive_can_bridge.client import open_drives


def main() -> None:
    """Obey."""
    register()
    drives = open_drives(*sys.argv[1:], only=['drive0'])
    drive = drives['drive0']
    settings = [name for name, parameter in drive.parameters.items()
                if parameter.writable and drive.role(name) is None]

    def backup() -> dict[str, Any]:
        """Read all settings; return how long that took, and of how many."""
        begun = time.monotonic()
        outcomes = drive.read(*settings)
        return {'elapsed': time.monotonic() - begun, 'settings': len(settings),
                'failed': sum(not outcome.ok for outcome in outcomes.values())}

    serve({'backup': backup}, close=drives.close)


if __name__ == '__main__':
    main()
