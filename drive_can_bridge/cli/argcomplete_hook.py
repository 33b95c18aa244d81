# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The shell's way in: where argcomplete is installed, Tab completes options, drives and parameters.

The shell starts the command with what has been typed so far in the environment.
"""

from argparse import ArgumentParser
import os

_MARK = '_ARGCOMPLETE'
_LINE = 'COMP_LINE'


def typed() -> list[str] | None:
    """Return the words after the program's name that are being completed; None: none are."""
    return os.environ.get(_LINE, '').split()[1:] if _MARK in os.environ else None


def complete(parser: ArgumentParser) -> None:
    """Answer the shell and end the process, if that is what it was started for."""
    if _MARK not in os.environ:
        return
    try:
        import argcomplete
    except ImportError:
        return
    argcomplete.autocomplete(parser)
