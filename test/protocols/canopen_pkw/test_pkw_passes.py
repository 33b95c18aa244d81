# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Setpoints that change while others are being written, by devices that take one at a time."""

from functools import partial

from builders import frame
from conversation import Conversation
from drives import PkwNode
from pkw_builders import commanding, configuration, CONTROL, SPEED, TORQUE
import pytest
from timeline import Timeline

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import StationLost

WRITTEN = ('C602', 'C802')


class Device:
    """
    A device that runs when it is told to, and does one request after the other.

    :ivar latency: s that each takes.
    """

    def __init__(self, **options: float) -> None:
        self.talk = Conversation(configuration(
            control=CONTROL, request=(SPEED, TORQUE), refresh_interval=0.0, **options))
        self.node = PkwNode(5, dict.fromkeys((456, 465, 466, 500, 501, 704, 710, 712), 0)
                            | {455: 1})
        self.node.operational = True
        self.free, self.latency = 0.0, 0.001
        self.line = Timeline(self.talk, self.answer)
        self.talk.begins()
        self.asks(15.5, ControlAction.ENABLE)
        self.line.live(20.0)
        assert self.talk.session.control is not None
        assert self.talk.session.control.operating

    def answer(self, text: str) -> tuple[float, str] | None:
        answers = self.node.takes(frame(text))
        self.node.registers[455] = 1 | (0x80 if self.node.registers[704] == 1 else 0)
        if not answers:
            return None
        self.free = max(self.talk.now, self.free) + self.latency
        return self.free - self.talk.now, str(answers[0])

    def asks(self, at: float, action: ControlAction) -> None:
        self.line.plan(at, partial(self.talk.asks, action))

    def commands(self, at: float, *, speed: float | None = None, torque: int | None = None,
                 ) -> None:
        for index, value in enumerate((speed, torque)):
            if value is not None:
                self.line.plan(at, commanding(self.talk, index, value))

    def told(self, what: str, value: str, since: float) -> list[float]:
        """Return when a register was given a value."""
        return [at for at, text in self.line.log
                if at > since and text[4:8] == what and text[12:16] == value]


def test_two_setpoints_that_expire_one_after_the_other() -> None:
    """The second while the neutral value of the first is being written; one round a second."""
    device = Device(period=1.0, command_timeout=1.0)
    begin = [at for at, text in device.line.log if text.startswith('505#C701')][-1] + 0.5
    device.commands(begin, speed=0.0, torque=0)
    for at in (begin + 0.01, begin + 0.9, begin + 1.65):
        device.commands(at, torque=5)
        device.commands(at + 0.0005, speed=10.0)
    device.line.live(begin + 5.0)
    expired = begin + 2.6505
    told = device.told('C602', '6400', begin)[-1]
    assert told < expired
    assert device.told('C602', '0000', told)[0] < expired + 0.1


@pytest.mark.parametrize('after', [0.003, 0.008, 0.013, 0.018, 0.03])
def test_neutral_follows_disable_whatever_is_being_written(after: float) -> None:
    device = Device(period=1.0, command_timeout=0.0)
    device.commands(20.0, speed=0.0, torque=0)
    device.commands(20.001, speed=10.0, torque=5)
    device.line.live(20.5)
    assert device.node.registers[710] == 100
    device.latency = 0.01
    device.commands(20.6, speed=20.0)       # due at 21.05
    device.asks(21.05 + after, ControlAction.DISABLE)
    device.line.live(21.9)
    for what in WRITTEN:
        assert device.told(what, '0000', 21.05)[0] < 21.05 + after + 0.15


@pytest.mark.parametrize(('latency', 'timeout'), [
    (0.06, 0.5), (0.1, 0.2), (0.12, 0.2), (0.12, 0.3), (0.2, 0.5)])
@pytest.mark.parametrize('every', [0.02, 0.07, 0.1])
def test_a_slow_device_is_not_lost(latency: float, timeout: float, every: float) -> None:
    """Two setpoints are commanded to and fro."""
    device = Device(period=0.1, command_timeout=0.0, parameter_timeout=timeout)
    device.latency = latency
    device.commands(20.0, speed=0.0, torque=0)
    for turn in range(int(14.0 / every)):
        device.commands(20.05 + every * turn, speed=10.0 * (turn % 2), torque=5 * (turn % 2))
    device.line.live(34.0)
    assert device.talk.events(StationLost) == []
