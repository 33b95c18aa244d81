# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can completion``: what a shell has to be told so that Tab completes this command."""

from argparse import ArgumentParser, Namespace

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
        raise DriveCanError('the Python module argcomplete is not installed: python3-argcomplete, '
                            "or the extra 'completion' of this package") from None
    print(argcomplete.shellcode(['drive_can'], shell=args.shell))
    return 0
