# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Nothing starts by itself, whatever happens to a drive: looked at from its motor.

The motors here are the worst that the manuals leave room for: whatever tells them to run starts
them, at once and however often it was said before, with whatever setpoint they hold; and after a
power failure they hold somebody else's preset. What happens is trips that somebody acknowledges at
the drive, hands that stop it, power failures, lost frames, and users who enable and disable.

A motor may start only after an ``~/enable`` that has not failed, and that nothing has ended since,
but for a moment after it was stopped at the drive: that is what nobody can know yet.
"""

from collections.abc import Callable
import math
from typing import Any

from any_order import PATIENCE
from builders import (
    ACTUAL, CONTROL, CURRENT, drive, frame, INT16, INT32, LIMIT, parameter, RAM, RO, SPEED, STATUS,
    WORD,
)
from conversation import Conversation
from drives import ExtendedDrive, PkwNode, Registers, ServoDrive, StandardDrive
from hypothesis import example, given, strategies as st
import pytest
from timeline import Timeline

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction, ControlRequest
from drive_can_bridge.core.events import StationFound, StationLost
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import ControlTable, StatusPattern

PERIOD = 0.02
#: s until a frame is answered
DELAY = 0.002
#: s without power that a drive may lose its setpoint in between two frames
SHORTEST_FAILURE = 0.005
#: raw value of the setpoint after a power failure
PRESET = 500
TESYS_STATUS = parameter('system_status_1', 455, access=RO)
TESYS_WORD = parameter('control_register_1', 704, storage=RAM)
TESYS_SPEED = parameter('speed', 710, storage=RAM, scale=0.1, unit='Hz')
TESYS_CONTROL = ControlTable(
    parameter='control_register_1', disable=0, enable=1, reset_fault=8,
    status_parameter='system_status_1', ready=StatusPattern(1, 1),
    enabled=StatusPattern(0x80, 0x80), fault=StatusPattern(4, 4))
FREQUENCY = parameter('frequency_setpoint', None, type=INT16)
TARGET = parameter('target_velocity', None, index=0x60FF, subindex=0, type=INT32, scale=0.1,
                   unit='rpm')


class Motor:
    """
    What turns: runs when told to, unless it is without power or at fault.

    :ivar started: called whenever it begins to run.
    """

    def __init__(self, started: Callable[[], None]) -> None:
        self.powered, self.faulty, self.runs, self.setpoint = True, False, False, PRESET
        self.started = started

    def told(self, run: bool) -> None:
        begins = run and not self.runs and not self.faulty
        self.runs = run and not self.faulty
        if begins:
            self.started()

    def trips(self) -> None:
        self.runs, self.faulty = False, True

    def loses_power(self) -> None:
        self.powered = self.runs = self.faulty = False
        self.setpoint = PRESET


class MotorRegisters(Registers):
    """Those of a drive with a motor: the word that runs it, its setpoint, its status."""

    def __init__(self, motor: Motor, rest: dict[int, int], *, word: int, setpoint: int,
                 status: int, bits: tuple[int, int, int]) -> None:
        super().__init__({**rest, word: 0, setpoint: 0, status: 0})
        self.motor, self.word, self.place, self.status, self.bits = (
            motor, word, setpoint, status, bits)

    def __setitem__(self, number: int, raw: int) -> None:
        super().__setitem__(number, raw)
        if number == self.place:
            self.motor.setpoint = raw
        elif number == self.word:
            self.motor.told(raw == 1)

    def update(self, entries: Any = (), **_: int) -> None:
        # a frame is taken as a whole, and what it says of the setpoint counts when it starts
        super().update(sorted(entries, key=lambda entry: bool(entry[0] == self.word)))

    def __getitem__(self, number: int) -> int:
        if number == self.status:
            ready, enabled, fault = self.bits
            motor = self.motor
            return fault if motor.faulty else ready | enabled * motor.runs
        return super().__getitem__(number)


class Inverter:
    """CANnord, station 1, one setpoint: 7F04 runs it, FE04 acknowledges."""

    def __init__(self, motor: Motor) -> None:
        self.motor = motor

    def takes(self, sent: Frame) -> list[Frame]:
        word = int.from_bytes(sent.data[:2], 'little')
        if sent.identifier != 2:
            return []
        self.motor.setpoint = int.from_bytes(sent.data[2:4], 'little')
        if word & 0x80:
            self.motor.faulty = False
        self.motor.told(word == 0x047F)
        state = '38' if self.motor.faulty else '37' if self.motor.runs else '31'
        return [frame(f'003#{state}0B0000')]


class Servo(ServoDrive):
    """CiA 402, node 1: its motor runs while its operation is enabled."""

    def __init__(self, motor: Motor) -> None:
        self.motor = motor
        super().__init__(1, {(0x60FF, 0): bytes(4), (0x6064, 0): bytes(4)})

    def takes(self, sent: Frame) -> list[Frame]:
        motor = self.motor
        if motor.faulty is not (self.state == self.FAULT):
            self.becomes(self.FAULT if motor.faulty else self.OFF)
        elif self.state == self.ENABLED and not motor.runs:
            self.becomes(self.OFF)      # by hand
        answers = super().takes(sent)
        motor.setpoint = self.number(0x60FF)
        motor.faulty = self.state == self.FAULT
        motor.told(self.state == self.ENABLED)
        return answers

    def restarts(self) -> list[Frame]:
        self.objects[0x60FF, 0] = PRESET.to_bytes(4, 'little')
        return super().restarts()


def datamodel(motor: Motor, slot: int = 0) -> MotorRegisters:
    """Return what has its control word in the third request slot, or by number only."""
    table = {51: 0, 209: 0, 210: 0, 122: 50, 123: 51, 124: slot, 125: 0, 126: 209, 127: 210,
             128: 211, 129: 0}
    return MotorRegisters(motor, table, word=52, setpoint=50, status=211, bits=(1, 2, 8))


def tesys(motor: Motor) -> PkwNode:
    node = PkwNode(5, MotorRegisters(motor, {}, word=704, setpoint=710, status=455,
                                     bits=(0x01, 0x80, 0x04)))
    node.operational = True
    return node


def drive_of(protocol: str, *more: Parameter, **options: Any) -> DriveConfiguration:
    """Configure a drive; ``more`` is sent with its setpoints."""
    return drive(protocol, control=CONTROL, period=PERIOD, request=(SPEED, LIMIT, *more),
                 response=(ACTUAL, CURRENT, STATUS), **options)


def tesys_of(*more: Parameter) -> DriveConfiguration:
    return drive('canopen_pkw', station=5, table=(TESYS_STATUS, TESYS_WORD, TESYS_SPEED),
                 control=TESYS_CONTROL, period=0.1, request=(TESYS_SPEED, *more),
                 response=(TESYS_STATUS,), parameter_timeout=0.5, refresh_interval=0.15)


#: how a drive is set up, and how long (s) what happened in it may be unknown
KINDS: dict[str, tuple[Callable[[Motor], Any], Callable[[], DriveConfiguration], float]] = {
    '29 bit, by number': (lambda motor: ExtendedDrive(datamodel(motor)),
                          lambda: drive_of('datamodel_extended'), 0.0),
    '29 bit, in its slot': (lambda motor: ExtendedDrive(datamodel(motor, slot=52)),
                            lambda: drive_of('datamodel_extended', WORD), 4 * PERIOD),
    '11 bit, by number': (lambda motor: StandardDrive(datamodel(motor)),
                          lambda: drive_of('datamodel_standard'), 0.0),
    '11 bit, with its setpoints': (
        lambda motor: StandardDrive(datamodel(motor)),
        lambda: drive_of('datamodel_standard', WORD, refresh_interval=0.05), 0.005),
    'PKW, by number': (tesys, tesys_of, 0.0),
    'PKW, with its setpoints': (tesys, lambda: tesys_of(TESYS_WORD), 0.11),
    'CiA 402': (Servo, lambda: drive(
        'cia402', mode='pv', table=(TARGET,), request=(TARGET,), response=(), period=PERIOD,
        parameter_timeout=0.1, heartbeat_producer=0.0, heartbeat_timeout=0.0), 0.0),
    'CANnord': (Inverter, lambda: drive(
        'cannord', table=(FREQUENCY,), request=(FREQUENCY,), response=(), period=PERIOD),
        4 * PERIOD),
}


class Story:
    """
    A session, a drive, and what happens to both.

    :ivar allowed: whether the motor may start now.
    :ivar enabling: an ``~/enable`` waits for its answer.
    """

    def __init__(self, kind: str) -> None:
        make, configure, self.unknown = KINDS[kind]
        self.motor = Motor(self.starts)
        self.device = make(self.motor)
        self.talk = Conversation(configure())
        self.line = Timeline(self.talk, self.answer)
        self.kind = kind
        self.allowed = self.enabling = False
        self.stopped_at = -math.inf     # by something else than the bridge
        self.deaf_until = self.mute_until = -math.inf
        self.lost_any = False
        self.online = False
        self.talk.bus_up(9.0)
        self.line.took(self.talk.activate(10.0))
        self.passes(0.5)
        assert self.online, 'a drive that is there is found'

    def starts(self) -> None:
        now = self.talk.now
        self.look()
        known = now - self.stopped_at > self.unknown + 1e-6
        assert self.allowed or not known, f'started by itself at {now}: {self.line.log[-20:]}'
        # where nobody acknowledges a setpoint, nobody knows that it got lost, or forgotten at once
        unheard = '11 bit' in self.kind and (
            self.lost_any or now - self.stopped_at < SHORTEST_FAILURE)
        assert self.motor.setpoint == 0 or unheard or not known, (
            f'started with {self.motor.setpoint} at {now}: {self.line.log[-20:]}')

    def answer(self, text: str) -> tuple[float, str] | None:
        now = self.talk.now
        if not self.motor.powered:
            return None
        if now < self.deaf_until:
            self.lost_any = True
            return None
        answers = self.device.takes(frame(text))
        if not answers or now < self.mute_until:
            return None
        return DELAY, str(answers[0])

    def look(self) -> None:
        """Record what ends an enable."""
        for event in self.talk.events():
            if isinstance(event, StationLost):
                self.allowed = self.online = False
            elif isinstance(event, StationFound):
                self.online = True
        for action, success, _ in self.talk.control_outcomes():
            if action == 'enable':
                self.enabling = False
                self.allowed = self.allowed and success

    # -- what happens -----------------------------------------------------------------------------

    def passes(self, seconds: float) -> None:
        end = self.talk.now + seconds
        self.line.live(end)
        self.talk.now = end
        self.look()

    def asks(self, action: ControlAction) -> None:
        if self.talk.session.services.control_refusal(action):
            return
        if action is ControlAction.ENABLE:
            self.allowed = self.enabling = True
        elif action is ControlAction.DISABLE or action is ControlAction.QUICK_STOP and (
                'PKW' not in self.kind):    # whose profile here has none
            self.allowed = False
        self.talk.session.services.submit(ControlRequest(action), self.talk.now)
        self.line.took(self.talk.sent())
        self.look()

    def runs(self) -> None:
        """Have it run, as a user does."""
        self.asks(ControlAction.ENABLE)
        self.passes(0.4)
        self.talk.commands(0, 0.0, self.talk.now)
        self.talk.commands(0, 5.0, self.talk.now)
        self.passes(0.2)

    def stops_there(self, how: str) -> None:
        """Stop the motor at the drive: a trip, a hand, power."""
        self.stopped_at = self.talk.now
        # a call that nobody has answered yet goes on, unless the session sees what happened
        self.allowed = self.allowed and self.enabling
        if how == 'trip':
            self.motor.trips()
        elif how == 'hand':
            self.motor.runs = False
        else:
            self.motor.loses_power()
            if isinstance(self.device, (PkwNode, ServoDrive)):
                self.device.restarts()

    def comes_back(self) -> None:
        """Somebody acknowledges, or power is there again."""
        self.motor.faulty = False
        if not self.motor.powered:
            self.motor.powered = True
            self.stopped_at = self.talk.now     # another drive, as it were
            if isinstance(self.device, (PkwNode, ServoDrive)):
                self.line.took(self.talk.hears(f'70{self.device.node}#00', self.talk.now))

    def happens(self, what: str, seconds: float) -> None:
        if what in ('trip', 'hand', 'power'):
            self.stops_there(what)
        elif what == 'back':
            self.comes_back()
        elif what == 'deaf':
            self.deaf_until = self.talk.now + seconds
        elif what == 'mute':
            self.mute_until = self.talk.now + seconds
        elif what == 'run':
            self.runs()
        elif what in ('0', '5'):
            self.talk.commands(0, float(what), self.talk.now)
        else:
            self.asks(ControlAction(what))
        self.passes(seconds)


THINGS = st.lists(st.tuples(
    st.sampled_from(['run', 'run', 'enable', 'enable', 'disable', 'quick_stop', 'reset_fault',
                     '0', '5', 'trip', 'hand', 'power', 'power', 'back', 'back', 'deaf', 'mute']),
    st.sampled_from([0.0, 0.001, 0.003, 0.011, 0.03, 0.07, 0.15, 0.4, 1.3])), max_size=12)


@pytest.mark.timeout(PATIENCE)     # to find the shortest story
@pytest.mark.parametrize('kind', KINDS)
@given(things=THINGS)
@example(things=[('run', 0.0), ('power', 0.03), ('back', 1.3)])
@example(things=[('run', 0.0), ('trip', 0.03), ('back', 1.3)])
@example(things=[('run', 0.0), ('hand', 1.3)])
@example(things=[('run', 0.0), ('power', 1.3), ('back', 0.4), ('run', 0.1)])
# told to run as soon as it is there again, before anybody could notice
@example(things=[('power', 0.011), ('back', 0.0), ('run', 0.0)])
@example(things=[('run', 0.014), ('disable', 0.03), ('power', 0.0), ('back', 0.0), ('run', 0.0)])
# told to run while it is without power, unseen, and when it is there
@example(things=[('power', 0.4), ('enable', 0.001), ('back', 0.0)])
@example(things=[('power', 0.011), ('enable', 0.07), ('enable', 0.15), ('enable', 0.15),
                 ('back', 0.0)])
def test_nothing_starts_by_itself(kind: str, things: list[tuple[str, float]]) -> None:
    story = Story(kind)
    for what, seconds in things:
        story.happens(what, seconds)
    story.passes(3.0)


@pytest.mark.parametrize('kind', KINDS)
def test_users_start_it(kind: str) -> None:
    story = Story(kind)
    story.runs()
    assert story.motor.runs
    assert story.motor.setpoint not in (0, PRESET)
    story.stops_there('trip')
    story.passes(0.5)
    story.comes_back()
    story.passes(3.0)
    assert not story.motor.runs
    story.runs()
    assert story.motor.runs
