# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The first steps of an executable; imports nothing that takes time.

Signals that come while a program is still being loaded wait until they are handled: without a
handler, Python answers SIGINT with a traceback. Standard streams that the starting process has
closed (``>&-``) go to /dev/null: else the next file or socket would become one of them.
"""

import io
import os
import signal
import sys

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)


def begin() -> None:
    """Block signals, and open missing standard streams."""
    hold_signals()
    open_streams()


def open_streams() -> None:
    """Redirect closed ones of the descriptors 0, 1 and 2, and Python's streams, to /dev/null."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)      # takes the lowest number, which is this one
    for descriptor, name, mode in ((0, 'stdin', 'r'), (1, 'stdout', 'w'), (2, 'stderr', 'w')):
        if getattr(sys, name) is None:
            setattr(sys, name, open(descriptor, mode, encoding='utf-8', closefd=False))


def keep_output() -> None:
    """
    Keep standard output for Python; redirect what libraries write to standard error.

    Fast DDS writes its complaints to descriptor 1, amid what other programs read.
    """
    former = sys.stdout
    unbuffered = bool(getattr(former, 'write_through', False))
    kept = io.TextIOWrapper(
        open(os.dup(1), 'wb', 0 if unbuffered else -1, closefd=False), former.encoding,
        former.errors, line_buffering=bool(former.line_buffering), write_through=unbuffered)
    os.dup2(2, 1)
    # a program that asks for the size of a terminal asks the other one
    for name in ('stdout', '__stdout__'):
        setattr(sys, name, kept)


def look_after_outputs() -> None:
    """Make unprintable characters harmless: an output may have no … or °."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors='backslashreplace')


def hold_signals() -> None:
    """Block signals until :func:`let_signals_in`, in this thread and in what it starts."""
    signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)


def let_signals_in() -> None:
    """
    Unblock signals; those that have waited take effect at once.

    :raises KeyboardInterrupt: SIGINT has come, and has no other handler.
    """
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)


def leave(code: int) -> None:
    """
    End the process now, without what Python does on its way out; does not return.

    That would take 0.2 s with rclpy, and its first step puts the default handlers back: a signal
    in that time would end the process with another exit code. Close everything before.
    """
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):  # its reader is gone
            pass
    os._exit(code)
