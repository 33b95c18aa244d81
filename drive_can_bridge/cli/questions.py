# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Questions to whoever sits at the terminal; ``--yes`` answers all of them."""

import sys

from drive_can_bridge.cli.tables import printable
from drive_can_bridge.core.errors import DriveCanError


class NobodyToAsk(DriveCanError):
    """There is no terminal, and no ``--yes``: exit code 2."""


def must_be_answerable(*, yes: bool, otherwise: str, yes_means: str) -> None:
    """
    Make sure, before anything is sent, that a question can be asked later.

    :param otherwise: what was not done.
    :param yes_means: what ``--yes`` does.
    :raises NobodyToAsk: it cannot.
    """
    if not (yes or sys.stdin.isatty()):
        raise NobodyToAsk(f'{otherwise}: nobody can be asked here; --yes {yes_means}')


def agreed(question: str, *, yes: bool, otherwise: str, yes_means: str) -> bool:
    """
    Ask.

    :raises NobodyToAsk: nobody is there.
    """
    must_be_answerable(yes=yes, otherwise=f'{question} {otherwise}', yes_means=yes_means)
    if yes:
        return True
    print(printable(f'{question} [y/N] '), end='', file=sys.stderr, flush=True)
    if sys.stdin.readline().strip().lower() in ('y', 'yes'):
        return True
    print(printable(f'{otherwise}.'), file=sys.stderr)
    return False
