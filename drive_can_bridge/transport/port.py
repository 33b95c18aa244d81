# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
An open CAN bus, and the way to open one.

python-can's adapters fail in many ways: NameError, NotImplementedError, OSError, ValueError,
CanError and its children, whatever a vendor's library throws. Here they become two errors:
:class:`~drive_can_bridge.core.errors.BusMisconfigured` (never going to work) and
:class:`~drive_can_bridge.core.errors.BusUnavailable` (worth another attempt).
"""

from collections.abc import Callable, Sequence
import inspect
import os
import select
import time
from typing import Any

import can

from drive_can_bridge.configuration.model import BusConfiguration
from drive_can_bridge.core.errors import BusMisconfigured, BusUnavailable, TransportError
from drive_can_bridge.core.frame import (
    EXTENDED_IDENTIFIER_MAX, Frame, Route, STANDARD_IDENTIFIER_MAX,
)

# A frame's own time stamp is believed only if it is that much older than now at most: adapters
# that count from power-up, and clocks that were set, fall out.
_STAMP_AGE_MAX = 0.1
# Data bytes of a classical CAN frame.
_LENGTH_MAX = 8
# s that the last command to a serial adapter may take.
_CLOSE_TIMEOUT = 0.1
# An adapter that sends rubbish and nothing else for that many lines is opened anew.
_MALFORMED_MAX = 1000
# Bytes of an unfinished line of a serial adapter that are kept.
_LINE_MAX = 4096

#: linux/can/error.h: error class bits of an error frame's identifier, in words
_ERROR_CLASSES = (
    (0x001, 'transmit time-out'), (0x002, 'lost arbitration'), (0x004, 'controller problem'),
    (0x008, 'protocol violation'), (0x010, 'transceiver fault'), (0x020, 'no acknowledgement'),
    (0x040, 'bus off'), (0x080, 'bus error'), (0x100, 'controller restarted'),
)


class Port:
    """
    One open bus.

    :ivar age: s between the reception of the last received frame and the return of ``receive``.
    :ivar error_frames: error frames seen.
    :ivar ignored_frames: remote and CAN FD frames seen; no protocol here has a use for them.
    :ivar malformed_frames: what arrived and was no frame: a serial adapter's line with bytes lost.
    """

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus
        # the serial port below python-can's text protocols
        self._serial = getattr(bus, 'serialPortOrig', None)
        self._writer = _SerialWriter.take_over(self._serial)
        self._lost = False
        self._malformed_in_row = 0
        self.age = 0.0
        self.error_frames = 0
        self.ignored_frames = 0
        self.malformed_frames = 0
        self.last_error = ''
        self.bus_off_count = 0

    def receive(self, timeout: float) -> Frame | None:
        """
        Wait for a frame.

        :param timeout: s.
        :return: a data frame, or None after the time-out or when something else came.
        :raises BusUnavailable: the bus is lost.
        """
        try:
            message = self._bus.recv(timeout)
        except Exception as error:  # whatever an adapter throws: the bus is lost
            if self._serial is not None and _is_malformed(error):
                self._malformed()
                return None
            self._lost = True
            raise BusUnavailable(f'receive: {_with_cause(error)}') from error
        if message is None:
            self._limit_line()
            return None
        if message.is_error_frame:
            self._error_frame(message)
            return None
        if message.is_remote_frame or message.is_fd:
            self.ignored_frames += 1
            return None
        data = bytes(message.data)
        highest = EXTENDED_IDENTIFIER_MAX if message.is_extended_id else STANDARD_IDENTIFIER_MAX
        if (len(data) != message.dlc or len(data) > _LENGTH_MAX
                or not 0 <= message.arbitration_id <= highest):
            self._malformed()
            return None
        self._malformed_in_row = 0
        age = time.time() - message.timestamp
        self.age = age if 0.0 < age < _STAMP_AGE_MAX else 0.0
        return Frame(message.arbitration_id, data, message.is_extended_id)

    def send(self, frame: Frame, timeout: float) -> None:
        """
        Hand a frame to the adapter.

        :param timeout: s to wait for room in the adapter's queue.
        :raises TransportError: this frame was not sent, but the bus is still there (queue full).
        :raises BusUnavailable: the bus is lost.
        """
        message = can.Message(arbitration_id=frame.identifier, data=frame.data,
                              is_extended_id=frame.extended)
        try:
            if self._writer is None:
                self._bus.send(message, timeout)
            else:
                self._writer.timeout = timeout
                self._bus.send(message)
        except can.CanTimeoutError as error:
            raise TransportError(f'send: {in_words(error)}') from error
        except Exception as error:  # whatever an adapter throws: the bus is lost
            if _is_full_queue(error):
                raise TransportError('send: transmit queue full') from error
            self._lost = True
            raise BusUnavailable(f'send: {_with_cause(error)}') from error

    def close(self) -> None:
        """
        Close the bus. Never raises.

        What a lost serial adapter has not taken is thrown away: when it goes on reading one day,
        it must not find setpoints of long ago.
        """
        steps: list[Callable[[], object]] = []
        if self._writer is not None:
            self._writer.timeout = _CLOSE_TIMEOUT
        if self._lost and self._serial is not None:
            steps.append(self._serial.reset_output_buffer)
            # ends a line that was cut off: the C of the next command is a hexadecimal digit, too
            steps.append(lambda: self._writer and self._writer.write(b'\r'))
        steps.append(self._bus.shutdown)
        if self._serial is not None:
            # python-can's slcan leaves the port open when its last command cannot be written
            steps.append(self._serial.close)
        for step in steps:
            try:
                step()
            except Exception:  # noqa: BLE001  a dead adapter may fail in any way; no remedy
                pass

    def _malformed(self) -> None:
        self.malformed_frames += 1
        self._malformed_in_row += 1
        if self._malformed_in_row >= _MALFORMED_MAX:
            self._lost = True
            raise BusUnavailable(f'receive: {_MALFORMED_MAX} malformed frames in a row, check the '
                                 f'settings of the adapter')
        self._forget_line()

    def _limit_line(self) -> None:
        """Keep a line that never ends from filling the memory."""
        line = getattr(self._bus, '_buffer', b'')
        if len(line) > _LINE_MAX:
            self._malformed()

    def _forget_line(self) -> None:
        """Drop the line that python-can keeps when it cannot decode it."""
        line = getattr(self._bus, '_buffer', None)
        if isinstance(line, bytearray):
            line.clear()

    def _error_frame(self, message: can.Message) -> None:
        self.error_frames += 1
        classes = [text for bit, text in _ERROR_CLASSES if message.arbitration_id & bit]
        self.last_error = ', '.join(classes) or 'unknown error'
        if message.arbitration_id & 0x040:
            self.bus_off_count += 1


class _SerialWriter:
    """
    Writes to a serial port in a limited time: everything, or it raises.

    Takes the place of pyserial's ``write`` and ``flush``. The one looks at the clock even after
    everything was written, and so takes a busy machine for a dead adapter; the other waits without
    a limit, with the bus lock held, for an adapter that has stopped to read. Nothing old piles up
    instead: a terminal with more than 256 bytes waiting does not count as writable.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self.timeout = 0.0

    @classmethod
    def take_over(cls, port: Any) -> '_SerialWriter | None':
        """Write for this port from now on; None: it is not one of a POSIX system."""
        descriptor = getattr(port, 'fd', None)
        if not isinstance(descriptor, int):
            return None
        writer = cls(descriptor)
        port.write = writer.write
        port.flush = writer.flush
        return writer

    def write(self, data: bytes) -> int:
        """
        Write everything.

        :raises TimeoutError: there is no room for it.
        """
        rest = memoryview(data)
        deadline = time.monotonic() + self.timeout
        while rest:
            left = max(deadline - time.monotonic(), 0.0)
            if not select.select([], [self._descriptor], [], left)[1]:
                raise TimeoutError('the adapter takes no more data')
            try:
                rest = rest[os.write(self._descriptor, rest):]
            except BlockingIOError:
                pass
        return len(data)

    def flush(self) -> None:
        """Do not wait for the adapter."""


def open_port(bus: BusConfiguration, routes: Sequence[Route] = ()) -> Port:
    """
    Open a bus. May block for as long as its adapter does: never call it with a lock held.

    :param routes: acceptance filters; none means all frames.
    :raises BusMisconfigured: unknown interface, missing driver, impossible bit rate or option.
    :raises BusUnavailable: device absent, busy, or refusing for now.
    """
    options: dict[str, Any] = dict(bus.options)
    if bus.interface == 'slcan':
        options.setdefault('sleep_after_open', 0.0)
    if routes:
        options['can_filters'] = [
            {'can_id': route.identifier, 'can_mask': route.mask, 'extended': route.extended}
            for route in routes]
    try:
        # the class first: what goes wrong here is the configuration, not the device
        adapter = can.interface._get_class_for_interface(bus.interface)
        if _takes(adapter, 'bitrate'):
            options['bitrate'] = bus.bitrate
        port = Port(can.Bus(interface=bus.interface, channel=bus.channel, ignore_config=True,
                            **options))
    except Exception as error:  # the one place where adapters may throw anything
        _abandon(error)
        text = f'{bus.interface} {bus.channel}: {in_words(error)}'
        if _is_misconfiguration(error):
            raise BusMisconfigured(text) from error
        raise BusUnavailable(text) from error
    try:
        # SocketCAN opens an interface that is down; the first look tells
        port.receive(0.0)
    except BusUnavailable as error:
        port.close()
        raise BusUnavailable(f'{bus.interface} {bus.channel}: {in_words(error)}') from error
    return port


def _abandon(error: BaseException) -> None:
    """
    Let go of the bus whose constructor failed; nobody else knows of it.

    Before 4.4 python-can tries to shut it down when it is collected, and shows a traceback.
    """
    traceback = error.__traceback__
    while traceback is not None:
        bus = traceback.tb_frame.f_locals.get('self')
        if isinstance(bus, can.BusABC):
            bus._is_shutdown = True
            serial_port = getattr(bus, 'serialPortOrig', None)
            if serial_port is not None:
                serial_port.close()
        traceback = traceback.tb_next


def in_words(error: BaseException) -> str:
    """Return one readable line for any exception."""
    text = ' '.join(str(error).split())
    return text or type(error).__name__


def _with_cause(error: BaseException) -> str:
    """Return what an adapter says, with the reason that it may keep to itself."""
    text, cause = in_words(error), error.__cause__
    reason = in_words(cause) if cause is not None else ''
    return text if reason in text else f'{text}: {reason}'


def _is_malformed(error: BaseException) -> bool:
    """Tell whether a line was no frame: python-can reads them without looking."""
    return isinstance(error, (ValueError, IndexError)) or isinstance(
        error.__cause__, UnicodeDecodeError)


def _takes(adapter: type, keyword: str) -> bool:
    parameters = inspect.signature(adapter.__init__).parameters  # type: ignore[misc]
    return keyword in parameters or any(
        parameter.kind is inspect.Parameter.VAR_KEYWORD for parameter in parameters.values())


def _is_misconfiguration(error: BaseException) -> bool:
    # python-can wraps errors; the reason is at the end of the chain
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, OSError):
            return False
        if isinstance(cause, (NotImplementedError, ImportError, NameError, ValueError,
                              TypeError)):
            return True
        cause = cause.__cause__
    return False


def _is_full_queue(error: BaseException) -> bool:
    # ENOBUFS of the socket: the kernel's transmit queue is full because nobody acknowledges
    return getattr(error, 'error_code', None) == 105 or getattr(error, 'errno', None) == 105
