# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Listening to a bus without taking part: everything that its adapter reports, error frames included.

Each tap has a thread of its own that opens the bus, reads it, and opens it again when it is lost.
Nothing is ever sent.
"""

from collections.abc import Callable
from functools import partial

import can

from drive_can_bridge.clock import Clock, Mailbox
from drive_can_bridge.core import bus_sentences
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import BusMisconfigured, BusUnavailable
from drive_can_bridge.core.frame import Record, RecordKind
from drive_can_bridge.transport.bus_identity import is_absent
from drive_can_bridge.transport.failures import in_words, with_outlook
from drive_can_bridge.transport.port import open_port, Port
from drive_can_bridge.transport.whereabouts import Whereabouts

#: entries that may wait to be taken; beyond, they are lost and counted
QUEUE_MAX = 200_000
#: s that a receive may block
_PATIENCE = 0.05
#: s by which a stamp may differ from now to be believed: machines stand still for some of them
_STAMP_AGE_MAX = 10.0


def record_of(message: can.Message, channel: str | int) -> Record:
    """Return a message as an entry of a trace."""
    kind = RecordKind.DATA
    if message.is_error_frame:
        kind = RecordKind.ERROR
    elif message.is_remote_frame:
        kind = RecordKind.REMOTE
    elif message.is_fd:
        kind = RecordKind.FD
    return Record(message.timestamp, channel, message.arbitration_id, bytes(message.data),
                  message.is_extended_id, kind, not message.is_rx)


def message_of(record: Record, channel: int) -> can.Message:
    """Return an entry as a message; formats number the buses."""
    kind = record.kind
    return can.Message(
        timestamp=record.time, arbitration_id=record.identifier, data=record.data,
        is_extended_id=record.extended, is_error_frame=kind is RecordKind.ERROR,
        is_remote_frame=kind is RecordKind.REMOTE, is_fd=kind is RecordKind.FD,
        is_rx=not record.sent, channel=channel)


class Tap:
    """
    A bus that is recorded without taking part.

    :param label: the channel of its entries.
    :param records: the queue for the entries.
    :param complain: called with a line when the bus is lost, and when it is back.
    :ivar was_down: the bus was lost at least once, and what was on it then.
    :ivar lost: entries that were not taken in time.
    :ivar heard_until: until when everything that was on the bus is among the entries, s by the
        clock of this machine. A time without entries is no proof that there were no frames.
    :raises BusUnavailable: the bus cannot be opened now.
    :raises BusMisconfigured: it never can.
    """

    def __init__(self, bus: BusConfiguration, label: str, records: Mailbox[Record],
                 complain: Callable[[str], None], clock: Clock) -> None:
        self.bus = bus
        self._whereabouts = Whereabouts(bus)
        self._clock = clock
        self.label = label
        self.lost = 0
        self.was_down = False
        self.heard_until = self._today()
        self._heard = False
        self._records = records
        self._complain = complain
        self._closing = False
        self._end = clock.wake_event()
        self._port: Port | None = self._open()
        self._thread = clock.worker(self._run, f'tap {bus.name}')
        self._thread.start()

    def close(self) -> None:
        """Stop listening."""
        self._closing = True
        self._end.ring()
        self._thread.join(2.0)

    def _today(self) -> float:
        return 1e-9 * self._clock.stamp()

    def _open(self) -> Port:
        port = open_port(self.bus, self._clock)
        self._whereabouts.opened()
        port.witness = partial(self._take, port)
        return port

    def _take(self, port: Port, message: can.Message) -> None:
        self._heard = True
        now = self._today()
        record = record_of(message, self.label)
        # stamps are the host's; those of its kernel as they are, unless its clock was set
        if not (port.host_stamps and abs(now - record.time) <= _STAMP_AGE_MAX):
            record = record._replace(time=now - port.age)
        if not self._records.put(record):
            self.lost += 1

    def _run(self) -> None:
        while not self._closing:
            try:
                if self._port is None:
                    self._port = self._open()
                    self._complain(bus_sentences.bus_open_again(bus=self.bus.name))
                while not self._closing:
                    self._listen(self._port)
            except BusMisconfigured as error:   # the adapter is another one now
                self._complain(f'bus {self.bus.name}: {in_words(error)}')
                self._closing = True
            except BusUnavailable as error:
                self.was_down = True
                if self._port is not None:
                    reason = self._whereabouts.reason(error, absent=is_absent(self.bus))
                    self._complain(f'bus {self.bus.name}: '
                                   f'{with_outlook(reason, self.bus.reconnect_period)}')
                self._close_port()
                self.heard_until = self._today()  # nothing will be
                self._end.wait(self._clock.now() + self.bus.reconnect_period)
        self._close_port()

    def _listen(self, port: Port) -> None:
        began = self._today()
        self._heard = False
        port.receive(_PATIENCE)
        if not self._heard:
            self.heard_until = began

    def _close_port(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            port.close()
