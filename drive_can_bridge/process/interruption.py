# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Steps that a signal does not break off in the middle."""

from collections.abc import Iterator
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
