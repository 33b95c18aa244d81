# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The executable ``drive_can_bridge``: signals are blocked until :mod:`.main` handles them."""

import sys

from drive_can_bridge.process.beginning import begin


def main() -> int:
    """Run the bridge until a signal; return the exit code."""
    begin()
    from drive_can_bridge.ros.main import main as run
    return run()


if __name__ == '__main__':
    sys.exit(main())
