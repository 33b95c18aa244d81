# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""When entries of a trace came: what the adapter says, unless that cannot be."""

from collections.abc import Callable
import queue
import time

import can
from clocks import REAL
import pytest
from waiting import wait_for

from drive_can_bridge.clock import Mailbox, SteadyClock
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import BusUnavailable
from drive_can_bridge.core.record import Record
from drive_can_bridge.transport import tap as module
from drive_can_bridge.transport.tap import Tap

#: against the wall clock (test/real.py)
pytestmark = pytest.mark.real


@pytest.mark.parametrize(('late', 'believed'), [(0.0, True), (2.5, True), (3600.0, False)])
def test_a_stamp_is_believed_although_it_was_read_late(
        late: float, believed: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = SteadyClock()
    monkeypatch.setattr(clock, 'stamp', lambda: time.time_ns() + round(1e9 * late))
    records: Mailbox[Record] = Mailbox(REAL)
    channel = f'tap {late}'
    tap = Tap(BusConfiguration('main', 'virtual', channel), 'main', records, print, clock)
    try:
        with can.Bus(channel, interface='virtual') as bus:
            sent_at = time.time()
            bus.send(can.Message(arbitration_id=0x123, is_extended_id=False, data=b'\x01'))
            record = records.get(REAL.now() + 30.0)
    finally:
        tap.close()
    assert (abs(record.time - sent_at) < 0.5 * late + 0.5) is believed


class HeldPort:
    """A port whose thread gets to its frames when it is told to."""

    def __init__(self) -> None:
        self.witness: Callable[[can.Message], None] | None = None
        self.steps: queue.Queue[list[can.Message] | Exception | None] = queue.Queue()

    def receive(self, _timeout: float) -> None:
        """Take what comes next: messages, the end of the time, or of the bus."""
        step = self.steps.get()
        if isinstance(step, Exception):
            raise step
        assert self.witness is not None
        for message in step or []:
            self.witness(message)

    def close(self) -> None:
        """There is nothing to close."""


def test_until_when_everything_was_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody may call an answer missing that waits in the socket of a busy machine."""
    port = HeldPort()
    monkeypatch.setattr(module, 'open_port', lambda bus, clock: port)
    records: Mailbox[Record] = Mailbox(REAL)
    tap = Tap(BusConfiguration('main', 'virtual', 'held', reconnect_period=0.01), 'main', records,
              lambda text: None, REAL)
    try:
        port.steps.put(None)
        wait_for(port.steps.empty, 'the tap')
        held = time.time()
        # an error frame, too, says that there may be more
        for message in (can.Message(arbitration_id=0x123, data=b'\x01'),
                        can.Message(is_error_frame=True, dlc=8, data=bytes(8))):
            port.steps.put([message])
            records.get(REAL.now() + 30.0)
        assert tap.heard_until <= held
        port.steps.put(None)
        port.steps.put(None)
        wait_for(lambda: tap.heard_until > held, 'the time to go on')
        # and while the bus is lost: nothing will be heard
        lost = time.time()
        port.steps.put(BusUnavailable('pulled'))
        wait_for(lambda: tap.heard_until > lost, 'the time to go on')
    finally:
        port.steps.put(None)
        tap.close()
