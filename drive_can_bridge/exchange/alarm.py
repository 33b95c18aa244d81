# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Sleep until a time or a ring, for half of what ``threading.Event`` costs."""

import threading


class Alarm:
    """
    Wakes one sleeper. A ring while nobody sleeps is kept for the next sleep; several count once.

    ``threading.Event`` makes a new lock for every wait and takes three of them; that is more CPU
    time than the exchange needs to send a frame. Here it is one lock, which is free while the
    alarm rings.
    """

    def __init__(self) -> None:
        self._silence = threading.Lock()
        self._silence.acquire()

    def sleep(self, timeout: float) -> bool:
        """Sleep for ``timeout`` s, or until somebody rings; tell whether somebody did."""
        return self._silence.acquire(timeout=timeout if timeout > 0.0 else 0.0)

    def ring(self) -> None:
        """Wake the sleeper, or the next one at once. From any thread."""
        try:
            self._silence.release()
        except RuntimeError:  # it rings already
            pass
