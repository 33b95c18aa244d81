# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Steps that a signal does not break off in the middle."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
import os
import signal
import threading
from typing import Any

from drive_can_bridge.process.beginning import SIGNALS

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def handled(numbers: Iterable[int], handler: Callable[[int, Any], object] | int) -> Iterator[None]:
    """Handle these signals so for the time of a step."""
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, former in before.items():
            signal.signal(number, former)


@contextmanager
def finish_first() -> Iterator[None]:
    """
    Postpone SIGINT and SIGTERM until the step in here is complete.

    Nested steps are one step. In other threads than the main one nothing has to be done: signals
    are not handled there.

    :raises KeyboardInterrupt: at the end of the step, as after any Ctrl-C.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    received: list[int] = []

    try:
        with handled(_SIGNALS, lambda number, _: received.append(number)):
            yield
    finally:
        if received:
            os.kill(os.getpid(), received[0])   # now by its other handler


@contextmanager
def signals_held() -> Iterator[None]:
    """
    Block signals in a process that is started in here, until it unblocks them.

    Else its interpreter answers one with a traceback, as soon as it is there.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class Interruption:
    """
    Whether a signal has asked for the end.

    :ivar number: of the signal; None: none has.
    """

    def __init__(self) -> None:
        self.number: int | None = None

    def __bool__(self) -> bool:
        """Return whether a signal came."""
        return self.number is not None

    @property
    def exit_code(self) -> int:
        """The exit code, as a shell shows it; as after Ctrl-C where the signal is unknown."""
        return 128 + (signal.SIGINT if self.number is None else self.number)


@contextmanager
def postponed(told: Callable[[], object]) -> Iterator[Interruption]:
    """
    Record SIGINT, SIGTERM and SIGHUP only; the work in here ends where it can.

    :param told: called once, when the first signal comes. The terminal to which it may write
        is perhaps gone: that is what SIGHUP means.
    """
    noted = Interruption()

    def note(number: int, _: Any) -> None:
        if not noted:
            noted.number = number
            with suppress(OSError):
                told()

    with handled((*_SIGNALS, signal.SIGHUP), note):
        yield noted
