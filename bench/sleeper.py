# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A thread that only sleeps to absolute deadlines: how regular this machine lets anybody be."""

import sys
import threading
import time

from child import serve, sleep_until


class Sleeper:
    """Notes the errors of its period."""

    def __init__(self, period: float) -> None:
        self._period = period
        self._errors: list[float] = []

    def run(self) -> None:
        """Sleep for ever."""
        deadline = last = time.monotonic()
        while True:
            deadline += self._period
            sleep_until(deadline)
            now = time.monotonic()
            self._errors.append(abs(now - last - self._period))
            last = now
            deadline = max(deadline, now - self._period)

    def clear(self) -> bool:
        """Begin to note anew."""
        self._errors = []
        return True

    def errors(self) -> list[float]:
        """Return the errors in s."""
        return list(self._errors)


def main() -> None:
    """Sleep with the period given."""
    sleeper = Sleeper(float(sys.argv[1]))
    threading.Thread(target=sleeper.run, daemon=True).start()
    serve({'clear': sleeper.clear, 'errors': sleeper.errors})


if __name__ == '__main__':
    main()
