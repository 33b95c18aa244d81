# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Something that goes on happening in the background while a test waits for its effect."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import threading


@contextmanager
def again_and_again(action: Callable[[], object], period: float = 0.05, *,
                    after: float = 0.0) -> Iterator[None]:
    """Do it after some seconds and every ``period`` s, until the block ends."""
    ending = threading.Event()

    def run() -> None:
        pause = after
        while not ending.wait(pause):
            action()
            pause = period
    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ending.set()
        thread.join()
