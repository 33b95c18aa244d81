# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``drive_can completion``, and the shell's way in: with argcomplete Tab completes what is typed.

The shell starts the command with what has been typed so far in the environment.
"""

from argparse import ArgumentParser, Namespace
import os

from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.errors import DriveCanError

SHELLS = ('bash', 'zsh', 'fish', 'tcsh')


def define(parser: ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'Print what lets Tab complete subcommands, options, drives and names of parameters. '
        'In ~/.bashrc: eval "$(drive_can completion bash)"')
    parser.add_argument('shell', metavar='SHELL', choices=SHELLS, help=', '.join(SHELLS))


def run(args: Namespace) -> int:
    """
    Print it.

    :return: 0.
    :raises DriveCanError: argcomplete is not there.
    """
    try:
        import argcomplete
    except ImportError:
        raise DriveCanError(command_sentences.argcomplete_missing()) from None
    print(argcomplete.shellcode(['drive_can'], shell=args.shell))
    return 0


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
