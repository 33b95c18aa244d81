# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Steps that a signal does not break off in the middle."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import os
import signal
import threading
from typing import Any

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def finish_first() -> Iterator[None]:
    """
    Let SIGINT and SIGTERM take effect only when the step in here is complete.

    Nested steps are one step. In other threads than the main one nothing has to be done: signals
    are not handled there.

    :raises KeyboardInterrupt: at the end of the step, as after any Ctrl-C.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    received: list[int] = []

    def note(number: int, _: Any) -> None:
        received.append(number)
    before = {number: signal.signal(number, note) for number in _SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if received:
            os.kill(os.getpid(), received[0])   # now by whoever looks after it otherwise


class Interruption:
    """
    Whether somebody wants something to end.

    :ivar number: of the signal; None: nobody does.
    """

    def __init__(self) -> None:
        self.number: int | None = None

    def __bool__(self) -> bool:
        """Tell whether a signal came."""
        return self.number is not None

    @property
    def exit_code(self) -> int:
        """What the process ends with, as a shell says it; as after Ctrl-C where nobody knows."""
        return 128 + (signal.SIGINT if self.number is None else self.number)


@contextmanager
def postponed(told: Callable[[], object]) -> Iterator[Interruption]:
    """
    Only take note of SIGINT, SIGTERM and SIGHUP; whoever works in here ends when it suits him.

    :param told: called once, when the first signal comes.
    """
    noted = Interruption()

    def note(number: int, _: Any) -> None:
        if not noted:
            noted.number = number
            told()

    before = {number: signal.signal(number, note) for number in (*_SIGNALS, signal.SIGHUP)}
    try:
        yield noted
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
