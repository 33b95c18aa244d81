# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
An SLCAN adapter with a drive behind it, in literal text: an independent witness.

It shares nothing with the package. It knows lines, and what to answer to which; what a line means
stands in the manual, not here.
"""

from collections.abc import Callable
import os
from pathlib import Path
import select
import threading
import time
import tty
from typing import NamedTuple

from waiting import wait_for


ZEROS = '0' * 16
#: request data of the conveyor that stands: speed 0, torque limit 100 % (1000 = 03E8h)
NEUTRAL_WORDS = '000003E8' + '0' * 8


#: line, or its first 10 or 5 characters -> lines
Answers = dict[str, str | Callable[[str], list[str]]]


def answer_to(answers: Answers, text: str) -> list[str]:
    """Return the lines that answer one."""
    answer = next((answers[key] for key in (text, text[:10], text[:5]) if key in answers), [])
    if callable(answer):
        return answer(text)
    return [answer] if isinstance(answer, str) else answer


class Line(NamedTuple):
    """
    A line from the bridge, without its end.

    :param text: as it came.
    :param after: a time at which it had not been sent yet.
    :param at: a time at which it had been received.
    """

    text: str
    after: float
    at: float


class Peer:
    """
    The far end of a pseudo-terminal.

    :param answers: line, or its first 10 or 5 characters -> lines; a value may also be called with
        the line.
    """

    def __init__(self, link: Path, answers: Answers) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        link.parent.mkdir(parents=True, exist_ok=True)
        link.symlink_to(os.ttyname(self._slave))
        self.link = link
        self.answers = answers
        self.received: list[Line] = []
        self.lock = threading.Lock()
        self._rest = b''
        self._reading = threading.Event()
        self._reading.set()
        self._resting = threading.Event()
        self._closing = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    # -- for tests --------------------------------------------------------------------------------

    @property
    def lines(self) -> list[str]:
        """Everything received, commands of the adapter included."""
        with self.lock:
            return [line.text for line in self.received]

    def wait_for(self, start: str, since: int = 0, count: int = 1) -> list[str]:
        """Wait for ``count`` lines that begin with ``start``; return all of them."""
        def find() -> list[str] | None:
            found = [line for line in self.lines[since:] if line.startswith(start)]
            return found if len(found) >= count else None
        found: list[str] = wait_for(find, f'{count} lines {start}')
        return found

    def send(self, data: bytes) -> None:
        """Send raw bytes; nobody has to be listening."""
        try:
            os.write(self._master, data)
        except BlockingIOError:
            pass

    def stop_reading(self) -> None:
        """Take nothing from the bridge any more."""
        self._reading.clear()
        self._resting.wait()

    def read_again(self) -> int:
        """Go on; return how many lines had come before."""
        count = len(self.received)
        self._resting.clear()
        self._reading.set()
        return count

    def close(self) -> None:
        """Hang up."""
        self._closing = True
        self._reading.set()
        self._thread.join()
        self.link.unlink(missing_ok=True)
        os.close(self._master)
        os.close(self._slave)

    # -- thread -----------------------------------------------------------------------------------

    def _run(self) -> None:
        empty_at = time.monotonic()
        while not self._closing:
            if not self._reading.is_set():
                self._resting.set()
                self._reading.wait()
            looked_at = time.monotonic()
            if not select.select([self._master], [], [], 0.0)[0]:
                empty_at = looked_at
                select.select([self._master], [], [], 0.002)
                continue
            try:
                data = os.read(self._master, 4096)
            except OSError:
                continue
            *lines, self._rest = (self._rest + data).split(b'\r')
            now = time.monotonic()
            for line in lines:
                text = line.decode('latin-1')
                with self.lock:
                    self.received.append(Line(text, empty_at, now))
                self._answer(text)

    def _answer(self, text: str) -> None:
        lines = answer_to(self.answers, text)
        if not lines and text[:1] not in 'tT':
            lines = ['']
        for line in lines:
            self.send(line.encode('latin-1') + b'\r')
