# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Adapters that hand back what they send, and other masters that send the same."""

from collections import deque

import can
from clocks import HandClock
import pytest
from saying import says

from drive_can_bridge.core.errors import TransportError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.transport.port import Port

ANSWER = Frame(0x103FFFF0, bytes(8), True)


class Wire(can.BusABC):
    """An adapter: what it says is put into ``coming``."""

    def __init__(self) -> None:
        super().__init__(channel='wire')
        self.coming: deque[Frame] = deque()
        self.refuses = False
        self.own: Frame | None = None   # marked

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        own, self.own = self.own, None
        if own is not None:
            return can.Message(arbitration_id=own.identifier, data=own.data,
                               is_extended_id=own.extended, is_rx=False), False
        if not self.coming:
            return None, False
        frame = self.coming.popleft()
        return can.Message(arbitration_id=frame.identifier, data=frame.data,
                           is_extended_id=frame.extended), False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.refuses:
            raise can.CanTimeoutError('no room')


class Bench:
    """A port of it, at times that are given."""

    def __init__(self, *, host_stamps: bool = False, marks_own: bool = False) -> None:
        self.now = 50.0
        self.wire = Wire()
        self.port = Port(self.wire, HandClock(lambda: self.now), host_stamps=host_stamps,
                         marks_own=marks_own)
        self.told: list[str] = []
        self.port.tell = self.told.append

    def cycle(self, number: int, *back: Frame, own: Frame | None = None,
              after: float = 0.001) -> list[Frame]:
        """Send a frame, have frames come, and return what is heard; 20 ms later."""
        self.port.send(sent(number), 0.01)
        if own is not None:
            self.wire.own = own
            assert self.port.receive(0.0) is None
        self.now += after
        heard = self.hear(*back)
        self.now += 0.02 - after
        return heard

    def hear(self, *frames: Frame) -> list[Frame]:
        self.wire.coming.extend(frames)
        return [frame for frame in (self.port.receive(0.0) for _ in range(len(frames)))
                if frame is not None]


def sent(number: int) -> Frame:
    """Return a cycle; two in a row are alike."""
    return Frame(0x003FFFF0, bytes([0, number // 2, 0, 0, 0, 0, 0, 0]), True)


def test_an_adapter_that_echoes() -> None:
    bench = Bench()
    for number in range(20):
        assert bench.cycle(number, sent(number), ANSWER) == [ANSWER]
        assert bench.told == ([says('adapter_echoes')] if number == 19 else [])
    rejected = bench.port.rejected_frames
    # one is dropped for each, and no more
    assert bench.cycle(20, sent(20), ANSWER, sent(20)) == [ANSWER, sent(20)]
    # one that comes late is one all the same; one that never comes spoils none of the others
    assert bench.cycle(30) == []
    assert bench.cycle(32, after=0.019) == []
    assert bench.hear(sent(32), sent(32)) == [sent(32)]
    assert bench.hear(sent(30)) == [sent(30)]
    assert bench.told == [says('adapter_echoes')]
    assert bench.port.rejected_frames == rejected


def test_an_adapter_that_does_not() -> None:
    bench = Bench()
    for number in range(23):
        assert bench.cycle(number, ANSWER) == [ANSWER]
    # from now on an equal frame is another master's
    assert bench.cycle(50, sent(50)) == [sent(50)]
    assert bench.told == []


def test_until_it_is_known_an_equal_frame_is_nobodys() -> None:
    bench = Bench()
    assert bench.cycle(0, sent(0)) == []
    assert bench.cycle(2, sent(2), sent(2)) == []
    assert bench.port.rejected_frames == 3
    # but no other one, and not after 50 ms
    assert bench.cycle(4, sent(9)) == [sent(9)]
    bench.now += 0.1
    assert bench.hear(sent(4)) == [sent(4)]


def test_what_decides_neither_is_another_master() -> None:
    bench = Bench()
    dropped = 0
    for number in range(0, 220, 2):
        heard = bench.cycle(number, *([sent(number)] if number % 6 else []))
        dropped += not heard and number % 6 > 0
    assert 60 < dropped < 70, 'as long as it was not known'
    assert bench.cycle(230, sent(230)) == [sent(230)]
    assert bench.told == []


def test_frames_out_of_order_are_no_echo() -> None:
    bench = Bench()
    for number in range(0, 400, 4):
        bench.port.send(sent(number), 0.01)
        bench.port.send(sent(number + 2), 0.01)
        bench.hear(sent(number + 2), sent(number))
        bench.now += 0.02
    assert bench.told == []


def test_a_frame_that_was_refused_has_no_echo() -> None:
    bench = Bench()
    for number in range(0, 40, 2):
        bench.cycle(number, sent(number))
    assert bench.told == [says('adapter_echoes')]
    bench.wire.refuses = True
    with pytest.raises(TransportError, match='no room'):
        bench.port.send(sent(99), 0.01)
    assert bench.hear(sent(99)) == [sent(99)]


def test_an_adapter_that_marks_them() -> None:
    """As gs_usb does: nothing has to be found out, and an equal frame is another master's."""
    bench = Bench(marks_own=True)
    for number in range(0, 60, 2):
        assert bench.cycle(number, ANSWER, own=sent(number)) == [ANSWER]
        assert bench.cycle(number, sent(number), own=sent(number)) == [sent(number)]
    assert bench.port.rejected_frames == 0
    assert bench.told == []


def test_on_socketcan_an_equal_frame_is_another_masters() -> None:
    bench = Bench(host_stamps=True)
    for number in range(0, 60, 2):
        assert bench.cycle(number, sent(number)) == [sent(number)]
    assert bench.told == []
