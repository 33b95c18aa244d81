# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A process that makes backups, as ``drive_can backup`` does once it has got to the drives.

Started with a parameter file: directly on its bus; without: through the bridge that runs.
"""

from pathlib import Path
import sys
import time
from typing import Any

from child import serve
import topics  # noqa: F401  sets the environment of rclpy
from unix_bus import register

from drive_can_bridge.backup.document import head_of, written
from drive_can_bridge.backup.settings import settings_of
from drive_can_bridge.cli.whole_file import write_whole
from drive_can_bridge.client import open_drives


def main() -> None:
    """Obey."""
    register()
    file, *params_file = map(Path, sys.argv[1:])
    drives = open_drives(*params_file, only=['drive0'])
    drive = drives['drive0']

    def backup() -> dict[str, Any]:
        """Make a backup; return how long that took, and of how many settings."""
        begun = time.monotonic()
        outcomes = drive.read(*settings_of(drive))
        settings = [(each.parameter, each.raw) for each in outcomes.values()
                    if each.parameter is not None and each.raw is not None]
        head = head_of(drive.facts, time='', identity=drive.identity())
        write_whole(file, written(drive.facts, head, settings).encode())
        return {'elapsed': time.monotonic() - begun, 'settings': len(settings),
                'failed': len(outcomes) - len(settings)}

    serve({'backup': backup}, close=drives.close)


if __name__ == '__main__':
    main()
