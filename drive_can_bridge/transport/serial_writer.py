# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Serial ports below python-can's adapters: written to in a limited time, from the first byte.

pyserial's ``write`` checks the clock even after everything was written, and so takes a busy
machine for a dead adapter; its ``flush`` waits without a limit for an adapter that has stopped to
read. Both are replaced as soon as the port is there, because python-can's constructors write, too.

Nothing is written that an adapter may take for "again". A CANable carries out the line before when
it gets an empty one, also that of a process which has died; and a command of ours behind the half
line of such a process would be taken for the rest of it. So the first that is written, and the
first behind a loss, is a filler (:data:`FILLERS`), and an empty line is never sent.
"""

from collections.abc import Callable
from dataclasses import dataclass
import errno
import math
import os
import select
import socket
from typing import Any

from drive_can_bridge.core import bus_sentences
from drive_can_bridge.core.adapter import S7_RATES
from drive_can_bridge.core.messages import NOTHING, Sentence

#: what ends a line or packet that was begun and never finished, whatever is lacking, so that
#: it is ignored. On an adapter in which nothing was begun it is a question, or noise.
#: On USBtin and LAWICEL a *whole* line that lacks only its end goes out all the same: they do not
#: look at what follows the data.
FILLERS = {
    # So many characters that each firmware begins a new line: CANable (canable-fw 8ca5d39) after
    # 30, ESP32-SLCAN after 32, CANable 2 (canable2-fw b158aa7) after 155. Fewer are dangerous
    # there: ``t2018`` and V would be a frame, with 0F in each byte. USBtin refuses V as a digit.
    'slcan': 160 * b'V' + b'\r',
    # more than the 17 bytes of a packet, and its end
    'robotell': bytes(18) + b'\x55\x55',
    # the longest packet has 20 bytes; 00 is no end of one, and no beginning
    'seeedstudio': bytes(20),
    # 19, likewise
    'serial': bytes(19),
}
#: s in which the first answer to the filler and to C comes, if any; s of silence behind it until
#: commands are sent, and s that it is waited for at most
_FIRST, _QUIET, _NOISE = 0.16, 0.05, 0.3
REFUSED, DONE = '\a', '\r'
#: of lines that are data frames: where their length is, one digit in front of the data
_LENGTH_AT = {'t': 4, 'T': 9, 'x': 9}
#: characters of the time stamp that may follow: none, ms, µs
_STAMPS = (0, 4, 8)
#: frames refused in a row, and s that this has to last, until nothing counts as sent any more
REFUSED_MAX = 4
REFUSED_TIME = 0.05
#: s that each command to a serial adapter may take while it is opened
OPEN_TIMEOUT = 0.5
#: bit rates that python-can's class lacks: it has S7 for that of CANable 1 and 2 only
MORE_RATES: dict[str, dict[int, str]] = {'slcan': {S7_RATES[1]: 'S7'}}


class AdapterAnswers:
    """
    The answers of one serial adapter since it was opened.

    It refuses one by a BEL, when its queue is full or it is off the bus; that comes later than
    the frame was written. Some adapters confirm what they take by CR, ``z`` CR or ``Z`` CR,
    others do not.

    :ivar refused: frames that it did not take.
    """

    __slots__ = ('_commands', '_in_row', '_said', '_since', '_unanswered', 'refused')

    def __init__(self) -> None:
        self.refused = 0
        # of the opening: what was commanded, and whether it was refused, in order
        self._commands: list[str] | None = []
        self._said: list[bool] = []
        self._unanswered = 0    # frames that a BEL may be about: it also refuses other commands
        self._in_row = 0
        self._since = math.inf

    def commanded(self, command: str) -> None:
        """Record a command of the opening."""
        if self._commands is not None:
            self._commands.append(command)

    @property
    def unanswered(self) -> int:
        """How many commands of the opening have no answer; below 0: others were answered, too."""
        return len(self._commands or ()) - len(self._said)

    def refusal(self, bitrate: int) -> Sentence:
        """
        End the opening; return what was refused, '' for nothing known.

        Healthy adapters refuse to close what is closed, and to open what is open.
        """
        commands, self._commands = self._commands or [], None
        if len(self._said) < len(commands):     # firmware 2.5 of CANable never answers C
            commands = [command for command in commands if command != 'C']
        if len(self._said) < len(commands):
            return NOTHING
        # the first ones may answer earlier commands
        said = list(zip(commands, self._said[-len(commands):]))
        if any(refused and command[0] in 'Ss' and before == 'C'
               for (command, refused), (before, _) in zip(said[1:], said)):
            return bus_sentences.adapter_refuses_bitrate(bitrate=bitrate)
        openings = [refused for command, refused in said if command in 'OL']
        return (bus_sentences.adapter_not_opening() if openings and all(openings)
                else NOTHING)

    def sent(self) -> None:
        """Record a frame that was written."""
        self._unanswered += 1

    def take(self, line: str, now: float) -> None:
        """Handle a line of the adapter, with its end."""
        if self._commands is not None:
            if line in (REFUSED, DONE):
                self._said.append(line == REFUSED)
            return
        if not line.endswith(REFUSED):
            self._in_row = 0    # it took one, or receives frames
        elif self._unanswered:
            self._unanswered -= 1
            self.refused += 1
            self._since = self._since if self._in_row else now
            self._in_row += 1

    def takes_nothing(self, now: float) -> bool:
        """Return whether the adapter refuses everything."""
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
        """Return a writer for this port; None: it is not one of a POSIX system."""
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
                raise TimeoutError(bus_sentences.adapter_takes_no_data())
            try:
                rest = rest[os.write(self._descriptor, rest):]
            except BlockingIOError:
                pass
        return len(data)

    def flush(self) -> None:
        """Do nothing: a frame does not wait for the adapter."""

    @property
    def _descriptor(self) -> int:
        # asked for each time: when the port is closed, the next thing opened gets the number
        descriptor: int | None = self._port.fd
        if descriptor is None:
            raise OSError(errno.EBADF, bus_sentences.port_was_closed())
        return descriptor


def check_line(line: str) -> None:
    """
    Check that a line of an SLCAN adapter is complete, as far as its length shows.

    python-can reads as many data as the line claims, wherever they begin. Where a serial port has
    lost bytes, other digits stand there: a frame that was never sent.

    :raises ValueError: it lacks something, or has too much.
    """
    place = _LENGTH_AT.get(line[0])
    if place is not None:
        rest = len(line.rstrip('\r')) - place - 1
        if rest - 2 * int(line[place:place + 1]) not in _STAMPS:
            raise ValueError(f'{line!r}: bytes are missing')


class _SlcanLines:
    """
    A mix-in for python-can's SLCAN: reads the answers, and sends no empty line.

    python-can sends one where no data bit rate is given.
    """

    #: the steady time
    drive_can_now: Callable[[], float]
    drive_can_below: 'Below'

    def _write(self, string: str) -> None:
        if string:
            if self.drive_can_below.answers is not None and string[0] not in _LENGTH_AT:
                self.drive_can_below.answers.commanded(string)
            super()._write(string)  # type: ignore[misc]

    def _read(self, timeout: float | None) -> str | None:
        line: str | None = super()._read(timeout)  # type: ignore[misc]
        if line:
            self.drive_can_below.heard += 1
            if self.drive_can_below.answers is not None:
                self.drive_can_below.answers.take(line, self.drive_can_now())
            check_line(line)
        return line


@dataclass(slots=True)
class Below:
    """
    The port and its writer below an opened adapter.

    :param port: of pyserial.
    :param writer: None: the port is not one of a POSIX system.
    :param filler: of :data:`FILLERS`.
    :param answers: None: its answers are not read.
    :param heard: counts what has arrived, whatever it is.
    """

    port: Any
    writer: SerialWriter | None
    filler: bytes
    answers: AdapterAnswers | None
    heard: int = 0

    @property
    def hung_up(self) -> bool:
        """Whether the other end is known to be gone: unplugged, or closed."""
        place = getattr(self.port, 'fd', None)
        if not isinstance(place, int) or place < 0:
            return False
        look = select.poll()
        look.register(place, 0)     # a hang-up is reported without being asked for
        return any(event & (select.POLLHUP | select.POLLERR | select.POLLNVAL)
                   for _, event in look.poll(0))

    @property
    def unread(self) -> bool:
        """Whether something has arrived that was not read yet."""
        try:
            return bool(self.port.in_waiting)
        except OSError:
            return False    # its device has gone

    def clear(self) -> None:
        """Discard what the adapter has not read, and end what it has read a part of."""
        self.port.reset_output_buffer()
        self.port.write(self.filler)


def watched(adapter: type[Any], interface: str, attribute: str, now: Callable[[], float],
            opened: Callable[[], object]) -> type[Any]:
    """
    Return a serial adapter's class that takes its port over the moment that it is opened.

    What is below is in its attribute ``drive_can_below``.

    :param interface: a key of :data:`FILLERS`.
    :param attribute: into which python-can puts the port.
    :param now: the steady time.
    :param opened: called when it has a port, before it writes to it.
    """
    def set_attribute(self: Any, name: str, value: Any) -> None:
        if name == attribute and value is not None:
            opened()
            below = Below(value, SerialWriter.take_over(value, now), FILLERS[interface],
                          AdapterAnswers() if slcan else None)
            object.__setattr__(self, 'drive_can_below', below)
            _hurry(value)
            if below.writer is None:
                value.write_timeout = OPEN_TIMEOUT
            # what the process before has left may not even leave room for a command
            below.clear()
            if slcan:
                _await_quiet(value, now)
            else:
                _count_bytes(below)
        object.__setattr__(self, name, value)

    slcan = interface == 'slcan'
    members: dict[str, Any] = {'__setattr__': set_attribute, 'drive_can_now': staticmethod(now)}
    if slcan:
        members['_BITRATES'] = {**adapter._BITRATES, **MORE_RATES[interface]}
    return type(adapter.__name__, (_SlcanLines, adapter) if slcan else (adapter,), members)


def _hurry(port: Any) -> None:
    """Send frames at once where the port is a connection: pyserial does not."""
    connection = getattr(port, '_socket', None)
    if isinstance(connection, socket.socket):
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


def _await_quiet(port: Any, now: Callable[[], float]) -> None:
    """Close the channel, and discard what the adapter sends: none of it answers a command."""
    port.write(b'C\r')
    patience, port.timeout = port.timeout, _FIRST
    until = now() + _NOISE
    while now() < until and port.read(1):
        port.timeout = _QUIET
        port.reset_input_buffer()
    port.timeout = patience


def _count_bytes(below: Below) -> None:
    """Count what is read."""
    read = below.port.read

    def counting(size: int = 1) -> bytes:
        data: bytes = read(size)
        below.heard += len(data)
        return data
    below.port.read = counting
