# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Serial ports below python-can's text protocols: written to in a limited time, from the first byte.

pyserial's ``write`` looks at the clock even after everything was written, and so takes a busy
machine for a dead adapter; its ``flush`` waits without a limit for an adapter that has stopped to
read. Both are replaced as soon as the port is there, because python-can's constructors write, too.
"""

from collections.abc import Callable
import errno
import math
import os
import select
from typing import Any

REFUSED = '\a'
#: of lines that are data frames: where their length stands, one digit in front of the data
_LENGTH_AT = {'t': 4, 'T': 9, 'x': 9}
#: characters of the time stamp that may follow: none, ms, µs
_STAMPS = (0, 4, 8)
#: frames refused in a row, and s that this has to last, until nothing leaves any more
REFUSED_MAX = 4
REFUSED_TIME = 0.05
#: s that each command to a serial adapter may take while it is opened
OPEN_TIMEOUT = 0.5


class AdapterAnswers:
    """
    The answers of one adapter since it was opened.

    It refuses one by a BEL, when its queue is full or it is off the bus; that comes later than
    the frame was written. Some adapters confirm what they take by CR, ``z`` CR or ``Z`` CR,
    others do not.

    :ivar refused: frames that it did not take.
    """

    __slots__ = ('_in_row', '_since', '_unanswered', 'refused')

    def __init__(self) -> None:
        self.refused = 0
        self._unanswered = 0    # frames that a BEL may be about: it also refuses other commands
        self._in_row = 0
        self._since = math.inf

    def sent(self) -> None:
        """Record a frame that was written."""
        self._unanswered += 1

    def take(self, line: str, now: float) -> None:
        """Take a line of the adapter, with its end."""
        if not line.endswith(REFUSED):
            self._in_row = 0    # it took one, or hears somebody
        elif self._unanswered:
            self._unanswered -= 1
            self.refused += 1
            self._since = self._since if self._in_row else now
            self._in_row += 1

    def takes_nothing(self, now: float) -> bool:
        """Tell whether it refuses whatever it is handed."""
        return self._in_row >= REFUSED_MAX and now - self._since >= REFUSED_TIME


class SerialWriter:
    """
    Writes to a serial port in a limited time: everything, or it raises.

    Nothing old piles up: a terminal with more than 256 bytes waiting does not count as writable.

    :param port: of pyserial.
    :param now: the steady time.
    :ivar timeout: s.
    """

    def __init__(self, port: Any, now: Callable[[], float], timeout: float = 0.0) -> None:
        self._port = port
        self._now = now
        self.timeout = timeout

    @classmethod
    def take_over(cls, port: Any, now: Callable[[], float]) -> 'SerialWriter | None':
        """Write for this port from now on; None: it is not one of a POSIX system."""
        if not isinstance(getattr(port, 'fd', None), int):
            return None
        writer = cls(port, now, OPEN_TIMEOUT)
        port.write = writer.write
        port.flush = writer.flush
        return writer

    def write(self, data: bytes) -> int:
        """
        Write everything.

        :raises TimeoutError: there is no room for it.
        :raises OSError: the port was closed meanwhile, or its device has gone.
        """
        rest = memoryview(data)
        deadline = self._now() + self.timeout
        while rest:
            left = max(deadline - self._now(), 0.0)
            if not select.select([], [self._descriptor], [], left)[1]:
                raise TimeoutError('the adapter takes no more data')
            try:
                rest = rest[os.write(self._descriptor, rest):]
            except BlockingIOError:
                pass
        return len(data)

    def flush(self) -> None:
        """Do not wait for the adapter."""

    @property
    def _descriptor(self) -> int:
        # asked for each time: when the port is closed, the next thing opened gets the number
        descriptor: int | None = self._port.fd
        if descriptor is None:
            raise OSError(errno.EBADF, 'the port was closed')
        return descriptor


class _WatchedPort:
    """
    Mix-in for python-can's serial adapters: takes the port over the moment that it is opened.

    ``serialPortOrig`` is the attribute into which they put it.
    """

    #: the steady time
    drive_can_now: Callable[[], float]
    _serial_port: Any = None
    drive_can_writer: SerialWriter | None = None

    @property
    def serialPortOrig(self) -> Any:  # noqa: N802  python-can's name
        return self._serial_port

    @serialPortOrig.setter
    def serialPortOrig(self, port: Any) -> None:  # noqa: N802  python-can's name
        self._serial_port = port
        self.drive_can_writer = SerialWriter.take_over(port, self.drive_can_now)
        if self.drive_can_writer is not None:
            # what the process before has left may not even leave room for a command
            port.reset_output_buffer()
            # of text protocols: what was cut off is no beginning of the first command
            port.write(getattr(self, 'LINE_TERMINATOR', b''))


def check_line(line: str) -> None:
    """
    Look whether a line of an SLCAN adapter is whole, as far as its length tells.

    python-can takes as many data as the line says, wherever they begin. Where a serial port has
    lost bytes, other digits stand there: a frame that nobody has sent.

    :raises ValueError: it lacks something, or has too much.
    """
    place = _LENGTH_AT.get(line[0])
    if place is not None:
        rest = len(line.rstrip('\r')) - place - 1
        if rest - 2 * int(line[place:place + 1]) not in _STAMPS:
            raise ValueError(f'{line!r}: bytes are missing')


class _WatchedSlcan(_WatchedPort):
    """The same for SLCAN, whose lines python-can throws away where they are no frame."""

    def __init__(self, *args: Any, **options: Any) -> None:
        self.drive_can_answers = AdapterAnswers()
        super().__init__(*args, **options)

    def _read(self, timeout: float | None) -> str | None:
        line: str | None = super()._read(timeout)  # type: ignore[misc]
        if line:
            self.drive_can_answers.take(line, self.drive_can_now())
            check_line(line)
        return line


#: the class of an interface with the mix-in, by that class and the clock
_WATCHED: dict[tuple[type, Callable[[], float]], type] = {}


def announcing(adapter: type[Any], attribute: str, opened: Callable[[], object]) -> type[Any]:
    """Return a serial adapter's class that tells when it has a port, before it writes to it."""
    def set_attribute(self: Any, name: str, value: Any) -> None:
        if name == attribute and value is not None:
            opened()
        object.__setattr__(self, name, value)
    return type(adapter.__name__, (adapter,), {'__setattr__': set_attribute})


def watched(adapter: type[Any], now: Callable[[], float], *, slcan: bool) -> type[Any]:
    """
    Return a serial adapter's class, made so that opening it cannot hang.

    :param now: the steady time.
    :param slcan: what it says to frames is listened to.
    """
    if (adapter, now) not in _WATCHED:
        mix_in = _WatchedSlcan if slcan else _WatchedPort
        _WATCHED[adapter, now] = type(adapter.__name__, (mix_in, adapter),
                                      {'drive_can_now': staticmethod(now)})
    return _WATCHED[adapter, now]
