# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Setpoints that change while others are being written, by devices that take one at a time."""

from collections.abc import Callable, Sequence

from builders import Conversation, frame
from literal_drives import PkwNode
from pkw_builders import configuration, CONTROL, SPEED, TORQUE
import pytest

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import StationLost

#: what a user does at a time
Step = tuple[float, Callable[[float], object]]
WRITTEN = ('C602', 'C802')


class Device:
    """A device that runs when it is told to, and does one request after the other."""

    def __init__(self, **options: float) -> None:
        self.talk = Conversation(configuration(
            control=CONTROL, request=(SPEED, TORQUE), refresh_interval=0.0, **options))
        self.node = PkwNode(5, dict.fromkeys((456, 465, 466, 500, 501, 704, 710, 712), 0)
                            | {455: 1})
        self.node.operational = True
        self.talk.bus_up(9.0)
        self.talk.activate(10.0)
        self.log: list[tuple[float, str]] = []
        self.live(20.0, [self.asks(15.5, ControlAction.ENABLE)])
        assert self.talk.session.control is not None
        assert self.talk.session.control.operating

    def asks(self, at: float, action: ControlAction) -> Step:
        return at, lambda now: self.talk.asks(action, now)

    def commands(self, at: float, speed: float, torque: int) -> list[Step]:
        return [(at, lambda now: self.talk.commands(0, speed, now)),
                (at, lambda now: self.talk.commands(1, torque, now))]

    def live(self, end: float, plan: Sequence[Step] = (), latency: float = 0.001) -> None:
        """Let time pass, every timer in time."""
        talk, steps, free = self.talk, sorted(plan, key=lambda step: step[0]), 0.0
        coming: list[tuple[float, str]] = []
        while True:
            due = max(talk.now, min([talk.session.next_timer(), *(at for at, _ in coming),
                                     *(at for at, _ in steps[:1])]))
            if due > end:
                return
            if steps and steps[0][0] <= due:
                done = steps.pop(0)[1](due)
                sent = done if isinstance(done, list) else []
            elif coming and coming[0][0] <= due:
                sent = talk.hears(coming.pop(0)[1], due)
            else:
                sent = talk.at(due)
            for text in sent:
                self.log.append((due, text))
                for answer in self.node.takes(frame(text)):
                    free = max(due, free) + latency
                    coming.append((free, str(answer)))
                self.node.registers[455] = 1 | (0x80 if self.node.registers[704] == 1 else 0)

    def told(self, what: str, value: str, since: float) -> list[float]:
        """Return when a register was given a value."""
        return [at for at, text in self.log
                if at > since and text[4:8] == what and text[12:16] == value]


def test_two_setpoints_that_expire_one_after_the_other() -> None:
    """The second while the neutral value of the first is being written; one round a second."""
    device = Device(period=1.0, command_timeout=1.0)
    begin = [at for at, text in device.log if text.startswith('505#C701')][-1] + 0.5
    plan = device.commands(begin, 0.0, 0)
    for at in (begin + 0.01, begin + 0.9, begin + 1.65):
        plan += [device.commands(at, 10.0, 5)[1], device.commands(at + 0.0005, 10.0, 5)[0]]
    device.live(begin + 5.0, plan)
    expired = begin + 2.6505
    told = device.told('C602', '6400', begin)[-1]
    assert told < expired
    assert device.told('C602', '0000', told)[0] < expired + 0.1


@pytest.mark.parametrize('after', [0.003, 0.008, 0.013, 0.018, 0.03])
def test_neutral_follows_disable_whatever_is_being_written(after: float) -> None:
    device = Device(period=1.0, command_timeout=0.0)
    device.live(20.5, device.commands(20.0, 0.0, 0) + device.commands(20.001, 10.0, 5))
    assert device.node.registers[710] == 100
    device.live(21.9, [(20.6, lambda now: device.talk.commands(0, 20.0, now)),  # due at 21.05
                       device.asks(21.05 + after, ControlAction.DISABLE)], 0.01)
    for what in WRITTEN:
        assert device.told(what, '0000', 21.05)[0] < 21.05 + after + 0.15


@pytest.mark.parametrize(('latency', 'timeout'), [
    (0.06, 0.5), (0.1, 0.2), (0.12, 0.2), (0.12, 0.3), (0.2, 0.5)])
@pytest.mark.parametrize('every', [0.02, 0.07, 0.1])
def test_a_slow_device_is_not_lost(latency: float, timeout: float, every: float) -> None:
    """Two setpoints are commanded to and fro."""
    device = Device(period=0.1, command_timeout=0.0, parameter_timeout=timeout)
    plan = device.commands(20.0, 0.0, 0)
    for turn in range(int(14.0 / every)):
        plan += device.commands(20.05 + every * turn, 10.0 * (turn % 2), 5 * (turn % 2))
    device.live(34.0, plan, latency)
    assert device.talk.events(StationLost) == []
