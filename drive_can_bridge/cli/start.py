# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
# PYTHON_ARGCOMPLETE_OK
"""
The executable ``drive_can``: signals wait until :mod:`.main` is there to take them.

A stop does not: what it needs to be sent by the local way is all that is imported before.
"""

import sys

from drive_can_bridge import __version__
from drive_can_bridge.process.beginning import begin


def main() -> int:
    """Run the command; return the exit code."""
    begin()
    if sys.argv[1:] == ['--version']:
        print(f'drive_can {__version__}')
        return 0
    if sys.argv[1:2] == ['stop']:
        from drive_can_bridge.process.local_stop import begin as begin_stop
        begin_stop(sys.argv[2:])    # and go on: there may be bridges elsewhere
    from drive_can_bridge.cli.main import main as run
    return run()


if __name__ == '__main__':
    sys.exit(main())
