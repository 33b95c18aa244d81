# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
SIGINT, SIGTERM, SIGHUP, SIGQUIT: the first asks for a safe stop, a second ends the process.

SIGHUP is what a process gets whose terminal is closed, or whose ssh session breaks off: its drives
are to stop like after any other signal. ``nohup`` still means that it is ignored. SIGQUIT shows
in the exit code. SIGTSTP (Ctrl-Z) can be refused: a process that is suspended leaves motors
running that it would have to stop.

rclpy's own handlers shut the context down first, so that no neutral frame could follow. Python's
handlers only run between two bytecodes of the main thread. So the signal is taken from the wake-up
file descriptor, which the interpreter's C handler writes to, by a thread of its own: a second
signal works even while the main thread hangs in a library.
"""

from collections.abc import Callable
import math
import os
import signal
import socket
import threading
from types import TracebackType

from drive_can_bridge import host_texts
from drive_can_bridge.clock import Clock, Mailbox
from drive_can_bridge.process.beginning import let_signals_in, SIGNALS

#: s after the first signal that the drives have to come to a stop, whatever follows. A caller of a
#: process group, or a service with all its processes, reaches the bridge directly and once more
#: through the launch that started it: without this grace the second signal would end the process
#: before its first neutral frame.
GRACE = 0.3
#: s within which all signals are one: timeout(1), for one, sends it to its child and, in the next
#: breath, to its whole process group; a terminal and a launcher both signal
SAME_BREATH = 0.05
#: why what moves drives is not suspended
NOT_SUSPENDED = host_texts.not_suspended


class SignalWatcher:
    """
    Collects what ends the process: signals and fatal errors.

    Use as a context manager in the main thread, before other threads start.

    :param clock: tells two signals from one.
    :param keep: go on after the context: in the rest of the process's life, a first signal changes
        nothing any more, and a second still ends it.
    :param refuse: called in a thread of the watcher when the process is to be suspended
        (Ctrl-Z), to print why that is refused, without waiting; None: it is not.
    :ivar last_steps: what is done, in this order, when a second signal ends the process. Each is
        called with when (of the clock) it ends.
    """

    def __init__(self, clock: Clock, *, keep: bool = False,
                 refuse: Callable[[], object] | None = None) -> None:
        self.last_steps: list[Callable[[float], object]] = []
        self._clock = clock
        self._keep = keep
        self._refuse = refuse
        self._reasons: Mailbox[str] = Mailbox(clock)
        self._read, self._write = socket.socketpair()
        self._write.setblocking(False)
        self._first = self._second = 0
        self._came = 0.0    # the first

    def __enter__(self) -> 'SignalWatcher':
        self._old_fd = signal.set_wakeup_fd(self._write.fileno(), warn_on_full_buffer=False)
        self._old = [(number, signal.signal(number, _ignore)) for number in SIGNALS
                     if number != signal.SIGHUP
                     or signal.getsignal(number) is not signal.SIG_IGN]
        if self._refuse is not None:
            self._old.append((signal.SIGTSTP, signal.signal(signal.SIGTSTP, _ignore)))
        let_signals_in()
        threading.Thread(target=self._watch, name='signals', daemon=True).start()
        return self

    def __exit__(self, exception_type: type[BaseException] | None,
                 exception: BaseException | None, traceback: TracebackType | None) -> None:
        if self._keep:
            return
        signal.set_wakeup_fd(self._old_fd)
        for number, handler in self._old:
            signal.signal(number, handler)
        self._write.close()

    @property
    def signalled(self) -> bool:
        """Whether a signal has come."""
        return self._first != 0

    @property
    def interrupted(self) -> bool:
        """Whether the first signal came from a keyboard: all processes at the terminal got it."""
        return self._first in (signal.SIGINT, signal.SIGQUIT)

    def exit_code(self, code: int) -> int:
        """Return the exit code: ``code``, or 128 + n after SIGQUIT or a second signal."""
        if self._second:
            return 128 + self._second
        return code or (128 + signal.SIGQUIT if self._first == signal.SIGQUIT else 0)

    def fatal(self, reason: str) -> None:
        """End the process for a reason of its own. From any thread."""
        self._reasons.put(reason)

    def wait(self, timeout: float = math.inf) -> str | None:
        """
        Wait for the end.

        :param timeout: s.
        :return: '' after a signal, the reason after a fatal error, None after the time-out.
        """
        try:
            return self._reasons.get(self._clock.now() + timeout)
        except TimeoutError:
            return None

    def take(self, number: int) -> None:
        """Handle a signal that came now; does not return where it is a second one."""
        now = self._clock.now()
        if number == signal.SIGTSTP and self._refuse is not None:
            _attempt(self._refuse)
        if number not in SIGNALS:
            return
        if not self._first:
            self._came, self._first = now, number
            self._reasons.put('')
        elif now - self._came >= SAME_BREATH:
            self._second = number
            self._clock.wait(self._came + GRACE)
            for step in self.last_steps:
                _attempt(step, now + GRACE)
            os._exit(128 + number)

    def _watch(self) -> None:
        while received := self._read.recv(1):
            self.take(received[0])


def _attempt(step: Callable[..., object], *arguments: float) -> None:
    """Call a step that must not end the watcher."""
    try:
        step(*arguments)
    except Exception:  # noqa: BLE001  signals are looked after, whatever happens
        pass


def _ignore(*_: object) -> None:
    """Do nothing: the wake-up descriptor does the work."""
