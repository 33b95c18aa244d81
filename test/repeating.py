# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Something that goes on happening in the background while a test waits for its effect."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import waiting


@contextmanager
def again_and_again(action: Callable[[], object], period: float = 0.05, *,
                    after: float = 0.0) -> Iterator[None]:
    """Do it after some seconds and every ``period`` s, until the block ends."""
    clock = waiting.clock()
    ending = clock.wake_event()

    def run() -> None:
        pause = after
        while not ending.wait(clock.now() + pause):
            action()
            pause = period
    thread = clock.worker(run, 'again and again')
    thread.start()
    try:
        yield
    finally:
        ending.ring()
        thread.join()
