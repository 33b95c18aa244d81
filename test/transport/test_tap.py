# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""When entries of a trace came: what the adapter says, unless that cannot be."""

from collections import deque
from collections.abc import Callable

import can
import pytest
from waiting import wait_for
from world import World

from drive_can_bridge.clock import Clock, Mailbox
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import BusUnavailable
from drive_can_bridge.core.frame import Record
from drive_can_bridge.transport import tap as module
from drive_can_bridge.transport.tap import Tap


class HeldPort:
    """A port whose thread gets to its frames when it is told to."""

    def __init__(self, clock: Clock) -> None:
        self.witness: Callable[[can.Message], None] | None = None
        self.host_stamps, self.age = True, 0.0
        self.steps: deque[list[can.Message] | Exception | None] = deque()
        self._wake = clock.wake_event()

    def put(self, *steps: list[can.Message] | Exception | None) -> None:
        """Give it something to do, and wait until it has begun with the last of it."""
        self.steps.extend(steps)
        self._wake.ring()
        wait_for(lambda: not self.steps, 'the tap')

    def receive(self, _timeout: float) -> None:
        """Take what comes next: messages, the end of the time, or of the bus."""
        while not self.steps:
            self._wake.wait()
        step = self.steps.popleft()
        if isinstance(step, Exception):
            raise step
        assert self.witness is not None
        for message in step or []:
            self.witness(message)

    def close(self) -> None:
        """There is nothing to close."""


@pytest.fixture
def port(bench: World, monkeypatch: pytest.MonkeyPatch) -> HeldPort:
    made = HeldPort(bench.clock)
    monkeypatch.setattr(module, 'open_port', lambda bus, clock: made)
    return made


def tap(bench: World, records: Mailbox[Record]) -> Tap:
    return Tap(BusConfiguration('main', 'virtual', 'held', reconnect_period=0.01), 'main', records,
               lambda text: None, bench.clock)


def today(bench: World) -> float:
    return 1e-9 * bench.clock.stamp()


@pytest.mark.parametrize(('late', 'believed'), [(0.0, True), (2.5, True), (3600.0, False)])
def test_a_stamp_is_believed_although_it_was_read_late(
        late: float, believed: bool, bench: World, port: HeldPort) -> None:
    records: Mailbox[Record] = Mailbox(bench.clock)
    tap(bench, records)
    now = today(bench)
    sent_at = now - late
    port.put([can.Message(arbitration_id=0x123, is_extended_id=False, data=b'\x01',
                          timestamp=sent_at)])
    assert records.get().time == pytest.approx(sent_at if believed else now, abs=0.01)


def test_a_stamp_of_another_clock_is_not_believed(bench: World, port: HeldPort) -> None:
    records: Mailbox[Record] = Mailbox(bench.clock)
    tap(bench, records)
    port.host_stamps, port.age = False, 0.02
    now = today(bench)
    port.put([can.Message(arbitration_id=0x123, is_extended_id=False, data=b'\x01',
                          timestamp=now - 0.094)])
    assert records.get().time == pytest.approx(now - 0.02, abs=0.001)


def test_until_when_everything_was_heard(bench: World, port: HeldPort) -> None:
    """Nobody may call an answer missing that waits in the socket of a busy machine."""
    records: Mailbox[Record] = Mailbox(bench.clock)
    listening = tap(bench, records)
    port.put(None)
    bench.clock.live(1.0)
    held = today(bench)
    # an error frame, too, says that there may be more
    for message in (can.Message(arbitration_id=0x123, data=b'\x01'),
                    can.Message(is_error_frame=True, dlc=8, data=bytes(8))):
        bench.clock.live(1.0)
        port.put([message])
        records.get()
    assert listening.heard_until <= held
    bench.clock.live(1.0)
    port.put(None)      # it began to wait for this before the second that went by
    port.put(None)
    assert listening.heard_until > held
    # and while the bus is lost: nothing will be heard
    bench.clock.live(1.0)
    lost = today(bench)
    port.put(BusUnavailable('pulled'))
    assert listening.heard_until >= lost
    port.put(None)
    listening.close()
