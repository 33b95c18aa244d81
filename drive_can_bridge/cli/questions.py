# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Questions to whoever sits at the terminal; ``--yes`` answers all of them."""

from contextlib import suppress
import sys
import termios

from drive_can_bridge.cli.command import complain, WrongUsage
from drive_can_bridge.core.text import printable


def must_be_answerable(*, yes: bool, otherwise: str, yes_means: str) -> None:
    """
    Make sure, before anything is sent, that a question can be asked later.

    :param otherwise: what was not done.
    :param yes_means: what ``--yes`` does.
    :raises WrongUsage: it cannot.
    """
    if not (yes or sys.stdin.isatty()):
        raise WrongUsage(f'{otherwise}: nobody can be asked here; --yes {yes_means}')


def agreed(question: str, *, yes: bool, otherwise: str, yes_means: str) -> bool:
    """
    Ask.

    :raises WrongUsage: nobody is there.
    """
    must_be_answerable(yes=yes, otherwise=f'{question} {otherwise}', yes_means=yes_means)
    if yes or answered(question):
        return True
    complain(f'{otherwise}.')
    return False


def agree_to_hazard(hazard: str, question: str, *, yes: bool, who: str) -> None:
    """
    Say what may happen, and have it confirmed that it shall be done all the same.

    :param who: needs ``--yes`` where nobody can be asked.
    :raises WrongUsage: nobody can be asked, or somebody says no.
    """
    complain(hazard)
    if yes:
        return
    if not sys.stdin.isatty():
        raise WrongUsage(f'{who} needs --yes where nobody can be asked')
    if not answered(question):
        raise WrongUsage('nothing was sent')


def answered(question: str) -> bool:
    """Tell whether the answer to a question is yes; what was typed before it is none."""
    if sys.stdin.isatty():
        with suppress(OSError, termios.error):
            termios.tcflush(sys.stdin.fileno(), termios.TCIFLUSH)
    print(printable(f'{question} [y/N] ', None), end='', file=sys.stderr, flush=True)
    return sys.stdin.readline().strip().lower() in ('y', 'yes')
