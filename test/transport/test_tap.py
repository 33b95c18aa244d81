# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""When entries of a trace came: what the adapter says, unless that cannot be."""

import queue
import time
from types import SimpleNamespace

import can
import pytest

from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.record import Record
from drive_can_bridge.transport import tap as module
from drive_can_bridge.transport.tap import Tap


@pytest.mark.parametrize(('late', 'believed'), [(0.0, True), (2.5, True), (3600.0, False)])
def test_a_stamp_is_believed_although_it_was_read_late(
        late: float, believed: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, 'time', SimpleNamespace(time=lambda: time.time() + late))
    records: queue.Queue[Record] = queue.Queue()
    channel = f'tap {late}'
    tap = Tap(BusConfiguration('main', 'virtual', channel), 'main', records, print)
    try:
        with can.Bus(channel, interface='virtual') as bus:
            sent_at = time.time()
            bus.send(can.Message(arbitration_id=0x123, is_extended_id=False, data=b'\x01'))
            record = records.get(timeout=10.0)
    finally:
        tap.close()
    assert (abs(record.time - sent_at) < 0.5 * late + 0.5) is believed
