# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Signals that come while a program is still being loaded: they wait for whoever takes them.

As long as nobody does, Python answers SIGINT with a traceback. So this is what an executable
imports first, and it imports nothing that takes time.
"""

import signal

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def hold_signals() -> None:
    """Let signals wait until :func:`let_signals_in`, in this thread and in what it starts."""
    signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)


def let_signals_in() -> None:
    """
    Let signals have their effect, those that have waited at once.

    :raises KeyboardInterrupt: SIGINT has come, and nobody handles it otherwise.
    """
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
