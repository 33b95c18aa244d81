# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
An open CAN bus, and the way to open one.

Whatever python-can's adapters raise becomes one of two errors here:
:class:`~drive_can_bridge.core.errors.BusMisconfigured` (never going to work) and
:class:`~drive_can_bridge.core.errors.BusUnavailable` (worth another attempt).
"""

from collections.abc import Callable, Sequence
import inspect
from pathlib import Path
import socket
from typing import Any

import can

from drive_can_bridge.clock import Clock
from drive_can_bridge.core import bus_sentences, complaints
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import BusMisconfigured, BusUnavailable, TransportError
from drive_can_bridge.core.frame import (
    EXTENDED_IDENTIFIER_MAX, Frame, Route, STANDARD_IDENTIFIER_MAX,
)
from drive_can_bridge.core.messages import around, together
from drive_can_bridge.transport.adapters import check_channel
from drive_can_bridge.transport.bus_identity import (
    adapter_of, device_of, DeviceLock, is_absent, SERIAL_INTERFACES,
)
from drive_can_bridge.transport.echo import Echo, EchoVerdict
from drive_can_bridge.transport.end_point import Counts, EndPoint
from drive_can_bridge.transport.error_frames import (
    ADVICE_ALONE, ADVICE_DISTURBED, BUS_OFF, BusError, decode_error_frame,
)
from drive_can_bridge.transport.failures import (
    in_words, is_absence, is_full_queue, is_malformed, is_misconfiguration, with_cause,
)
from drive_can_bridge.transport.foreign_clock import ForeignClock
from drive_can_bridge.transport.gateway import Gateway
from drive_can_bridge.transport.kernel_interfaces import why_lost
from drive_can_bridge.transport.known_adapters import what_helps
from drive_can_bridge.transport.raw_socket import ERROR, EXTENDED, NO_DATA, RawSocket
from drive_can_bridge.transport.serial_writer import Below, watched

# The kernel's time stamp of a frame is believed if it is that much older than now at most, or if
# the frame may have waited for so long: clocks that were set fall out.
_STAMP_AGE_MAX = 0.1
# So many returns without a frame in so many s, although it was to wait: the other end is gone.
_EARLY_MAX, _EARLY_TIME = 1000, 0.1
# Behind so many the kernel is asked, where it knows, whether it is gone: also on a busy machine.
_EARLY_LOOK = 100
# So many frames may be confirmed at once: what a terminal keeps.
_UNCONFIRMED_MAX = 4096
# s of silence until a serial adapter answers none of the commands that opened it, or no more; and
# until it answers no more although it has begun to; s for one look.
_SILENCE, _LONG_SILENCE, _ANSWER_LOOK = 0.16, 0.5, 0.02
# Data bytes of a classical CAN frame.
_LENGTH_MAX = 8
# s that the last command to a serial adapter may take.
_CLOSE_TIMEOUT = 0.1
# An adapter that sends malformed lines only, for that many lines, is opened again.
_MALFORMED_MAX = 1000
# Bytes of an unfinished line of a serial adapter that are kept; robotell has packets instead.
_LINE_MAX = 4096
_UNFINISHED = '_buffer', '_rxbuffer'
# Interfaces whose error frames are those of the Linux kernel; others have layouts of their own.
_KERNEL_ERRORS = ('socketcan', 'socketcand')
# Interfaces that return what they have sent, and mark it. Others may mark what another program
# sends by the same adapter, which is another master.
_MARKS_OWN = ('gs_usb', 'cantact')
# Where python-can keeps the serial port of an interface.
_PORTS = {'slcan': 'serialPortOrig', 'robotell': 'serialPortOrig', 'seeedstudio': 'ser',
          'serial': '_ser'}


class Port(EndPoint):
    """
    A bus that python-can has opened.

    It rejects what has other identifiers (where the adapter does not keep them away), remote and
    CAN FD frames, which no protocol here has, and a serial adapter's line with bytes lost.

    :param host_stamps: the kernel of this machine makes the stamps.
    :param marks_own: it marks returned frames that it has sent itself.
    :param lock: of its device, released when it is closed.
    :ivar witness: called with every message that arrives, of any kind; None: not called.
    """

    def __init__(self, bus: can.BusABC, clock: Clock, *, kernel_errors: bool = False,
                 host_stamps: bool = False, marks_own: bool = False,
                 lock: DeviceLock | None = None) -> None:
        super().__init__()
        self._now, self._stamp = clock.now, clock.stamp
        self.host_stamps = host_stamps
        self._foreign = None if host_stamps else ForeignClock()
        # there, an equal frame is another master's
        self._echo = None if host_stamps or marks_own else Echo(clock)
        self._marks_own = marks_own
        self._bus = bus
        self._lock = lock
        # what python-can documents for adapters to implement; the ``recv`` around it looks at the
        # system clock, and waits for hours when that is set back
        self._receive = bus._recv_internal
        if type(bus)._recv_internal is can.BusABC._recv_internal:
            # plugins for python-can replace ``recv`` itself
            self._receive = lambda timeout: (bus.recv(timeout), False)
        self._matches = bus._matches_filters
        self._kernel_errors = kernel_errors
        self._below: Below | None = getattr(bus, 'drive_can_below', None)
        self._writer = None if self._below is None else self._below.writer
        self._answers = None if self._below is None else self._below.answers
        self._socket = RawSocket.below(bus)
        # where the kernel filters as well: SocketCAN's frames need no message of python-can
        self._direct = self._socket if (
            host_stamps and getattr(bus, '_is_filtered', False)) else None
        # it waits by select(); other adapters poll, or set time-outs of a serial port
        self.punctual = isinstance(getattr(bus, 'socket', None), socket.socket)
        self._lost = False
        self._malformed_in_row = 0
        self._early = self._early_heard = self._unconfirmed = 0
        self._early_since = self._taken_at = 0.0
        self._earliest = self._now()   # the next frame cannot have come before
        self.witness: Callable[[can.Message], None] | None = None

    def receive(self, timeout: float) -> Frame | None:
        """Wait for a frame. See the base class."""
        if self._direct is not None and self.witness is None:
            return self._receive_directly(self._direct, timeout)
        began = self._now()
        try:
            message, filtered = self._receive(timeout)
        except Exception as error:  # whatever an adapter throws: the bus is lost
            if is_malformed(error):
                self._malformed()
                return None
            self._lost = True
            raise BusUnavailable(bus_sentences.receive_failed(with_cause(error))) from error
        if message is None:
            self._earliest = self._now()
            if self._earliest - began < timeout:
                self._returned_early(self._earliest)
            self._limit_line()
            if (self._answers is not None and self._answers.takes_nothing(self._earliest)
                    and self._below is not None and not self._below.unread):
                self._lost = True
                raise BusUnavailable(together(
                    [bus_sentences.adapter_refuses_frames(), ADVICE_ALONE]))
            return None
        self._early = 0
        now = self._now()
        self.age = self._age_of(message.timestamp, now)
        self._earliest = now - self.age     # they come in order
        self._taken_at = now
        if self.witness is not None:
            self.witness(message)
        if message.is_error_frame:
            self._error_frame(message.arbitration_id, bytes(message.data))
            return None
        if self._marks_own and not message.is_rx:
            return None
        if not (filtered or self._matches(message)):
            self.rejected_frames += 1
            return None
        if message.is_remote_frame or message.is_fd:
            self.rejected_frames += 1
            return None
        data = bytes(message.data)
        highest = EXTENDED_IDENTIFIER_MAX if message.is_extended_id else STANDARD_IDENTIFIER_MAX
        # the kernel reports the nine ways to write eight (ISO 11898-1); elsewhere a digit is wrong
        length = min(message.dlc, _LENGTH_MAX) if self.host_stamps else message.dlc
        if (len(data) != length or len(data) > _LENGTH_MAX
                or not 0 <= message.arbitration_id <= highest):
            self._malformed()
            return None
        self._malformed_in_row = 0
        frame = Frame(message.arbitration_id, data, bool(message.is_extended_id))
        return frame if self._echo is None or self._is_new(self._echo, frame) else None

    def _receive_directly(self, raw: RawSocket, timeout: float) -> Frame | None:
        """Wait for a frame of SocketCAN; handled like in ``receive``."""
        try:
            received = raw.receive(timeout)
        except (OSError, ValueError) as error:      # ValueError: it was closed
            self._lost = True
            raise BusUnavailable(bus_sentences.receive_failed(in_words(error))) from error
        now = self._now()
        if received is None:
            self._earliest = now
            return None
        identifier, data, stamp = received
        self.age = self._believed(1e-9 * (self._stamp() - stamp), now)
        self._earliest = now - self.age     # they come in order
        if identifier & NO_DATA:
            if identifier & ERROR:
                self._error_frame(identifier & EXTENDED_IDENTIFIER_MAX, data)
            else:
                self.rejected_frames += 1
            return None
        extended = identifier >= EXTENDED
        return Frame(identifier & (EXTENDED_IDENTIFIER_MAX if extended else
                                   STANDARD_IDENTIFIER_MAX), data, extended)

    def _is_new(self, echo: Echo, frame: Frame) -> bool:
        """Return whether a frame is no echo of a sent one."""
        before = echo.verdict
        if not echo.is_echo(frame):
            return True
        if echo.verdict is not EchoVerdict.ECHOES:      # perhaps an echo: without an owner
            self.rejected_frames += 1
        elif before is not echo.verdict and self.tell is not None:
            self.tell(bus_sentences.adapter_echoes())
        return False

    def _age_of(self, stamp: float, now: float) -> float:
        if self._foreign is not None:
            return self._foreign.age(stamp, now, waited=self._earliest > self._taken_at)
        return self._believed(1e-9 * self._stamp() - stamp, now)

    def _believed(self, age: float, now: float) -> float:
        """Return the age that the kernel's stamp makes; 0 where a clock was set."""
        return age if 0.0 < age < max(_STAMP_AGE_MAX, now - self._earliest) else 0.0

    def _returned_early(self, now: float) -> None:
        """
        Count early returns; raise when the other end is gone.

        python-can's socketcand returns early for ever when its gateway has closed the connection.
        """
        heard = 0 if self._below is None else self._below.heard
        if self._unconfirmed:       # a frame may have been confirmed
            self._unconfirmed -= 1
            return
        if not self._early or heard != self._early_heard:
            self._early, self._early_since, self._early_heard = 0, now, heard
        self._early += 1
        gone = (self._early % _EARLY_LOOK == 0 and self._below is not None
                and self._below.hung_up)
        if self._early < _EARLY_MAX and not gone:
            return
        if gone or now - self._early_since <= _EARLY_TIME:
            self._lost = True
            raise BusUnavailable(bus_sentences.other_end_closed())
        self._early = 0

    def await_answers(self, bitrate: int) -> None:
        """
        Read a serial adapter's answers to the commands that opened it.

        :raises BusUnavailable: it refuses what nothing works without.
        """
        if self._answers is None:
            return
        left = _SILENCE
        while left > 0.0:
            unanswered, began = self._answers.unanswered, self._now()
            self.receive(_ANSWER_LOOK)
            if 0 < self._answers.unanswered < unanswered:
                # the last one may be lacking for good: C
                left = _SILENCE if self._answers.unanswered == 1 else _LONG_SILENCE
            elif unanswered <= 0 and unanswered == self._answers.unanswered:
                break   # fewer: the first ones answered earlier commands
            # a process that did not run meanwhile has not looked for longer
            left -= min(self._now() - began, _ANSWER_LOOK)
        refusal = self._answers.refusal(bitrate)
        if refusal:
            raise BusUnavailable(refusal)

    def send(self, frame: Frame, timeout: float) -> None:
        """Pass a frame to the adapter. See the base class."""
        if self._direct is not None:
            self._send_directly(self._direct, frame, timeout)
            return
        message = can.Message(arbitration_id=frame.identifier, data=frame.data,
                              is_extended_id=frame.extended)
        if self._echo is not None:
            self._echo.sending(frame)
        try:
            self._send(message, timeout)
        except BaseException:
            if self._echo is not None:
                self._echo.not_sent()
            raise

    def _send(self, message: can.Message, timeout: float) -> None:
        try:
            if self._socket is not None and not self._socket.has_room(timeout):
                raise TransportError(bus_sentences.queue_full())
            if self._writer is None:
                self._bus.send(message, timeout)
            else:
                self._writer.timeout = timeout
                self._bus.send(message)
            self._unconfirmed = min(self._unconfirmed + 1, _UNCONFIRMED_MAX)
            if self._answers is not None:
                self._answers.sent()
        except TransportError:
            raise
        except can.CanTimeoutError as error:
            raise TransportError(bus_sentences.send_failed(in_words(error))) from error
        except Exception as error:  # whatever an adapter throws: the bus is lost
            if is_full_queue(error):
                raise TransportError(bus_sentences.queue_full()) from error
            self._lost = True
            raise BusUnavailable(bus_sentences.send_failed(with_cause(error))) from error

    def _send_directly(self, raw: RawSocket, frame: Frame, timeout: float) -> None:
        try:
            sent = raw.send(frame, timeout)
        except (OSError, ValueError) as error:
            if not is_full_queue(error):
                self._lost = True
                raise BusUnavailable(bus_sentences.send_failed(in_words(error))) from error
            sent = False
        if not sent:
            raise TransportError(bus_sentences.queue_full())

    def shorten_queue(self, frames: int) -> None:
        """Limit the kernel's transmit queue to about so many frames, where that can be set."""
        if self._socket is not None:
            self._socket.shorten_queue(frames)

    @property
    def has_room(self) -> bool | None:
        """Whether a frame could be sent now; None: this adapter does not report it."""
        return None if self._socket is None else self._socket.has_room(0.0)

    @property
    def counts(self) -> Counts:
        """The counts since it was opened."""
        return Counts(self.error_frames, self.bus_off_count,
                      0 if self._socket is None else self._socket.overflowed_frames,
                      0 if self._answers is None else self._answers.refused)

    def close(self) -> None:
        """
        Close the bus. Never raises.

        What a lost serial adapter has not read is discarded: when it goes on reading one day,
        it must not find setpoints of long ago.
        """
        steps: list[Callable[[], object]] = []
        if self._writer is not None:
            self._writer.timeout = _CLOSE_TIMEOUT
        if self._lost and self._below is not None:
            steps.append(self._below.clear)
        steps.append(self._bus.shutdown)
        if self._below is not None:
            # python-can's slcan leaves the port open when its last command cannot be written
            steps.append(self._below.port.close)
        if self._lock is not None:
            steps.append(self._lock.release)
        for step in steps:
            try:
                step()
            except Exception:  # noqa: BLE001  a dead adapter may fail in any way; no remedy
                pass
        # plugins for python-can forget it, which then warns when the bus is collected
        self._bus._is_shutdown = True

    def _malformed(self) -> None:
        self.rejected_frames += 1
        self._malformed_in_row += 1
        if self._malformed_in_row >= _MALFORMED_MAX:
            self._lost = True
            raise BusUnavailable(bus_sentences.malformed_in_row(count=_MALFORMED_MAX))
        self._forget_line()

    def _limit_line(self) -> None:
        """Keep a line that never ends from filling the memory."""
        for kept in _UNFINISHED:
            line = getattr(self._bus, kept, None)
            if isinstance(line, bytearray) and len(line) > _LINE_MAX:
                line.clear()
                self._malformed()

    def _forget_line(self) -> None:
        """Drop the line that python-can keeps when it cannot decode it."""
        line = getattr(self._bus, '_buffer', None)
        if isinstance(line, bytearray):
            line.clear()

    def _error_frame(self, classes: int, data: bytes) -> None:
        self.error_frames += 1
        if self.error_witness is not None:
            self.error_witness(classes, data)
        if not self._kernel_errors:
            self.last_error = BusError('error frame', None, ADVICE_DISTURBED)
            return
        error = decode_error_frame(classes, data)
        if error.advice:
            self.last_error = error
        if error.state is not None:
            self.controller = error.state
        if error.state == BUS_OFF:
            self.bus_off_count += 1
            raise BusUnavailable(around(error.advice, f'{error.text}; '))


def open_port(bus: BusConfiguration, clock: Clock, routes: Sequence[Route] = (), *,
              stations: int = 0) -> Port:
    """
    Open a bus. May block for as long as its adapter does: never call it with a lock held.

    :param routes: acceptance filters; none means all frames.
    :param stations: for so many drives there should be room in the transmit queue of the kernel,
        one frame for each; 0 leaves the queue as long as it is.
    :raises BusMisconfigured: unknown interface, missing driver, impossible bit rate or option.
    :raises BusUnavailable: device absent, busy, or refusing for now; or another process has it:
        nothing was written then.
    """
    where = bus.place
    reason = check_channel(bus.interface, bus.channel)
    if reason is not None:
        raise BusMisconfigured(around(reason, f'{where}: '))
    device = device_of(bus)
    try:
        lock = None if device is None else DeviceLock(device)
    except BusUnavailable as error:
        raise BusUnavailable(around(in_words(error), f'{where}: '), taken=error.taken) from None
    try:
        port = _open(bus, clock, routes, lock, where)
    except BaseException:
        if lock is not None:
            lock.release()
        raise
    if stations:
        port.shorten_queue(stations)
    return port


def _open(bus: BusConfiguration, clock: Clock, routes: Sequence[Route],
          lock: DeviceLock | None, where: str) -> Port:
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
        opened: can.BusABC
        if bus.interface in SERIAL_INTERFACES:
            adapter = watched(adapter, bus.interface, _PORTS[bus.interface], clock.now,
                              lock.keep_out if lock is not None else lambda: None)
            opened = adapter(bus.channel, **options)
        elif bus.interface == 'socketcand':
            opened = Gateway(str(bus.channel), now=clock.now, **options)
        else:
            opened = can.Bus(interface=bus.interface, channel=bus.channel, ignore_config=True,
                             **options)
        port = Port(opened, clock, kernel_errors=bus.interface in _KERNEL_ERRORS,
                    host_stamps=bus.interface == 'socketcan',
                    marks_own=bus.interface in _MARKS_OWN, lock=lock)
    except Exception as error:  # the one place where adapters may throw anything
        _abandon(error)
        reason = in_words(error)
        if type(error) is NameError:    # it uses a library that it has not found, and went on
            reason = complaints.driver_missing(
                interface=bus.interface, why=reason, helps=what_helps(bus.interface))
        text: str = around(reason, f'{where}: ')
        if is_misconfiguration(error):
            raise BusMisconfigured(text) from error
        if bus.interface == 'socketcan':
            text = why_lost(str(bus.channel), 0) or text
        elif is_absence(error) and is_absent(bus):
            text = bus_sentences.adapter_not_there(adapter=adapter_of(bus))
        raise BusUnavailable(text) from error
    try:
        # SocketCAN opens an interface that is down; the first read shows it
        port.receive(0.0)
        port.await_answers(bus.bitrate)
        if bus.interface == 'socketcan':
            _check_carrier(str(bus.channel))
    except BusUnavailable as error:
        port.close()
        why = why_lost(str(bus.channel), 0) if bus.interface == 'socketcan' else ''
        raise BusUnavailable(why or around(in_words(error), f'{where}: ')) from error
    return port


def _check_carrier(channel: str) -> None:
    """
    Check that a controller takes part in the bus.

    :raises BusUnavailable: it is bus-off. Its driver accepts frames all the same, and drops them.
    """
    try:
        carrier = Path('/sys/class/net', channel, 'carrier').read_text(encoding='ascii')
    except (OSError, ValueError):
        return  # not known: the interface is down, or has another name in this place
    if carrier.strip() == '0':
        raise BusUnavailable(bus_sentences.controller_bus_off(
            advice=ADVICE_DISTURBED, channel=channel))


def _abandon(error: BaseException) -> None:
    """
    Close the bus whose constructor failed; there is no other reference to it.

    Before 4.4 python-can tries to shut it down when it is collected, and shows a traceback.
    """
    traceback = error.__traceback__
    while traceback is not None:
        bus = traceback.tb_frame.f_locals.get('self')
        if isinstance(bus, can.BusABC):
            bus._is_shutdown = True
            below = getattr(bus, 'drive_can_below', None)
            if below is not None:
                below.port.close()
        traceback = traceback.tb_next


def _takes(adapter: type, keyword: str) -> bool:
    parameters = inspect.signature(adapter.__init__).parameters  # type: ignore[misc]
    return keyword in parameters or any(
        parameter.kind is inspect.Parameter.VAR_KEYWORD for parameter in parameters.values())
