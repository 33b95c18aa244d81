# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
When the machine itself stood still, measured by somebody who has nothing to do with the tests.

A process of its own sleeps, and looks how late it wakes. It needs next to no processor, so any
scheduler wakes it in time beside however many others that compute; when it was late, everybody
was: a hypervisor, a disk, a suspended machine. What a hypervisor took (*steal* in ``/proc/stat``)
counts as well, for a machine can crawl without ever standing still.
"""

from collections.abc import Iterable
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import time
from typing import NamedTuple

#: s between two looks, and that one has to be late: shorter than anything that a story waits for
PERIOD, LATE = 0.02, 0.1
#: s over which stolen time is summed up, and the share of all processors that is too much
WINDOW, STOLEN = 1.0, 0.25


class Stall(NamedTuple):
    """The machine stood still, in s of CLOCK_MONOTONIC."""

    begin: float
    end: float
    how: str

    def __str__(self) -> str:
        return f'{self.how} for {self.end - self.begin:.2f} s'


class Witness:
    """Looks on until it is closed."""

    def __init__(self) -> None:
        descriptor, name = tempfile.mkstemp(prefix='drive_can_bridge_stalls_')
        os.close(descriptor)
        self._file = Path(name)
        self._process = subprocess.Popen(
            [sys.executable, '-S', '-E', __file__, name, str(os.getpid())],
            stdin=subprocess.DEVNULL)

    def between(self, begin: float, end: float) -> list[Stall]:
        """Return when the machine stood still in that time (``time.monotonic``)."""
        # what is going on while we look is written as soon as that one wakes
        time.sleep(3 * PERIOD)
        stalls = (Stall(float(words[0]), float(words[1]), ' '.join(words[2:]))
                  for line in self._file.read_text().splitlines() if (words := line.split()))
        return [stall for stall in stalls if stall.end > begin and stall.begin < end]

    def close(self) -> None:
        """Look on no more."""
        self._process.kill()
        self._process.wait()
        self._file.unlink(missing_ok=True)


def stalls_of(looks: Iterable[tuple[float, float]]) -> Iterable[Stall]:
    """
    Return when the machine stood still.

    :param looks: (time in s, share of all processors' time that was stolen since the last look),
        :data:`PERIOD` s after each other if nothing happens.
    """
    last = window = None
    stolen = 0.0
    for now, share in looks:
        if last is None or window is None:
            last = window = now
            continue
        if now - last > PERIOD + LATE:
            yield Stall(last, now, 'it stood still')
        stolen += share * (now - last)
        last = now
        if now - window >= WINDOW:
            if stolen > STOLEN * (now - window):
                yield Stall(window, now, f'{100 * stolen / (now - window):.0f} % were stolen')
            window, stolen = now, 0.0


def _stolen_ticks() -> tuple[int, int]:
    """Return ticks that were stolen, and all, of all processors; (0, 1): nobody tells."""
    try:
        with open('/proc/stat', encoding='ascii') as file:
            ticks = [int(word) for word in file.readline().split()[1:9]]
    except OSError:
        return 0, 1
    return ticks[7], sum(ticks)


def _looks(parent: int) -> Iterable[tuple[float, float]]:
    before = _stolen_ticks()
    while os.getppid() == parent:
        time.sleep(PERIOD)
        now = time.monotonic()
        ticks = _stolen_ticks()
        stolen, all_of_them = (after - former for after, former in zip(ticks, before))
        # ticks are of 10 ms: none may have gone by
        if all_of_them:
            before = ticks
        yield now, stolen / all_of_them if all_of_them else 0.0


def _main() -> None:
    with open(sys.argv[1], 'a', encoding='ascii', buffering=1) as file:
        for stall in stalls_of(_looks(int(sys.argv[2]))):
            file.write(f'{stall.begin} {stall.end} {stall.how}\n')


if __name__ == '__main__':
    _main()
