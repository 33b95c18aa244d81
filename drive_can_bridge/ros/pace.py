# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A share of the interpreter: whoever is asked without pause leaves the rest to the exchange.

One thread at a time has the interpreter. One that never waits, because callers ask as fast as they
are answered, makes the exchange late and stops wait, however high their priority is.
"""

from drive_can_bridge.clock import Clock


class Pace:
    """
    Have one thread pause when it has used more than its share. Made and used by that thread.

    :param share: of the processor's time, 0 to 1.
    :param in_hand: s that may be used at once, after a while of little work.
    """

    def __init__(self, share: float, clock: Clock, in_hand: float = 0.002) -> None:
        self._clock = clock
        self._share = share
        self._in_hand = in_hand
        self._left = in_hand
        self._seen = clock.now()
        self._used = clock.used()

    def keep(self) -> None:
        """Pause, if it is time to. After each piece of work."""
        now, used = self._clock.now(), self._clock.used()
        self._left = min(self._in_hand, self._left + self._share * (now - self._seen)) - (
            used - self._used)
        self._seen, self._used = now, used
        if self._left < 0.0:
            self._clock.wait(now - self._left / self._share)
