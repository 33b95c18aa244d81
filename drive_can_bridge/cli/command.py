# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What all subcommands have in common: exit codes, wrong usage, and lines for whoever reads them.

A subcommand is a module of its name with ``define(parser)`` and ``run(args) -> exit code``.
Whatever it raises, :mod:`.main` says in one line.
"""

import argparse
import sys
from typing import NoReturn

from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.text import printable

FAILED = 1
WRONG_USAGE = 2
#: characters of a line of complaint: some name all that there is
LINE_MAX = 4000
_NO_ROS = ('{command}: needs ROS 2 (Python module {module}): source your installation '
           "(/opt/ros/jazzy/setup.bash), or get it as wheels with the extra 'ros' of this package "
           "(pip install '.[ros]')")


class WrongUsage(DriveCanError):
    """The command line cannot be obeyed, nothing was sent or written: exit code 2."""


class Parser(argparse.ArgumentParser):
    """Says what is wrong with a command line as everything is said: in one line."""

    def error(self, message: str) -> NoReturn:
        """
        End the process.

        :raises SystemExit: always.
        """
        complain(printable(f'{self.prog}: {message}; see {self.prog} --help', None))
        raise SystemExit(WRONG_USAGE)


def say(text: str) -> None:
    """Write a line to standard output."""
    print(printable(text, None))


def complain(text: str) -> None:
    """Write to standard error, a line or more."""
    print('\n'.join(printable(line, LINE_MAX) for line in text.split('\n')), file=sys.stderr,
          flush=True)


def what_is_missing(command: str, error: ImportError) -> str:
    """Say what to install where a module cannot be imported."""
    module = error.name or str(error)
    if module.startswith('drive_can_bridge'):
        return f'{command}: {error}'
    if module.partition('.')[0] in ('can', 'yaml', 'jsonschema'):
        return f'{command}: the Python module {module} is not installed'
    return _NO_ROS.format(command=command, module=module)
