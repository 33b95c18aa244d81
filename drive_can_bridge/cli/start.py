# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
# PYTHON_ARGCOMPLETE_OK
"""
The executable ``drive_can``: signals are blocked until :mod:`.main` handles them.

A stop is sent before that: only what the local way needs is imported earlier.
"""

import sys

from drive_can_bridge import __version__
from drive_can_bridge.process.beginning import begin, leave


def main() -> int:
    """Run the command; return the exit code."""
    begin()
    if sys.argv[1:] == ['--version']:
        from drive_can_bridge.compiled import build
        print(f'drive_can {__version__} ({build()})')
        return 0
    if sys.argv[1:2] == ['stop']:
        from drive_can_bridge.process.local_stop import begin as begin_stop
        early = begin_stop(sys.argv[2:])
        if early is not None:
            from drive_can_bridge.cli.stopping import finished
            code = finished(early)
            if code is not None:
                leave(code)     # signals still wait, and all is done
    from drive_can_bridge.cli import main as command
    code = command.main()
    # buses that were opened here have more to do
    if command.subcommand_in(sys.argv[1:]) in command.OF_DRIVES and 'can' not in sys.modules:
        leave(code)
    return code


if __name__ == '__main__':
    sys.exit(main())
