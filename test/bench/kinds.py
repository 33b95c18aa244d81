# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Drives of all families that run, as they may be set up, with the motor that shows it: KINDS."""

from collections.abc import Callable
from dataclasses import dataclass
import math
from typing import Any

from builders import (
    ACTUAL, CONTROL, CURRENT, drive, INT16, parameter, SPEED, STATUS, TARGET_VELOCITY, TESYS,
    TESYS_CONTROL, TESYS_SPEED, TESYS_STATUS, TESYS_WORD, WORD,
)
from drives import CannordDrive, ExtendedDrive, Motor, MotorServo, PkwNode, StandardDrive

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Parameter

PERIOD = 0.05
FREQUENCY = parameter('frequency_setpoint', None, type=INT16, scale=0.1, unit='Hz')


class StayingServo(MotorServo):
    """
    CiA 402: stays in quick stop active, with 606Ch at its last value, until it is sent 0000h.

    So does the fake slave of ros2_canopen with Lely core 2.4.0, though its 605Ah is 2, and
    CANopenNode 4 without a 605Ah. It brakes for so many looks at it, SYNCs and reads of 6041h.
    """

    stays = True
    brakes = 40

    def __init__(self, node: int, motor: Motor) -> None:
        super().__init__(node, motor)
        self.objects.update({(0x606C, 0): b'\x64\0\0\0', (0x6064, 0): bytes(4)})

    def becomes(self, state: int) -> None:
        if state == self.QUICK_STOP != self.state:
            self.braking = self.brakes
        super().becomes(state)

    def runs_down(self) -> None:
        if self.state == self.QUICK_STOP and self.braking:
            place = self.number(0x6064) + 100
            self.objects[0x6064, 0] = place.to_bytes(4, 'little')
        super().runs_down()


class OptionlessServo(StayingServo):
    """The same without a 605Ah."""

    def __init__(self, node: int, motor: Motor) -> None:
        super().__init__(node, motor)
        del self.objects[0x605A, 0]


class WatchingServo(MotorServo):
    """CiA 402: trips when the node in 1016h has not been heard for as long as that says."""

    def __init__(self, node: int, motor: Motor) -> None:
        super().__init__(node, motor)
        self._heard_at = math.inf       # not yet

    def takes(self, sent: Frame) -> list[Frame]:
        watched = self.number(0x1016, 1)
        if sent.identifier == 0x700 + (watched >> 16):
            self._heard_at = self.now
        elif watched and self.now > self._heard_at + 0.001 * (watched & 0xFFFF):
            self._heard_at = math.inf
            self.registers.stops(faulty=True)
        return super().takes(sent)

    def restarts(self) -> list[Frame]:
        self._heard_at = math.inf
        return super().restarts()


@dataclass(frozen=True)
class Kind:
    """
    A kind of drive, or group of them.

    :ivar configure: sets it up; keywords are keys of each drive, instead of those here.
    :ivar make: makes the literal drive of one, by what is called when its motor moves and a place.
    :ivar maps: somebody may change them, and the bridge looks.
    :ivar unseen: s after a restart for which nobody can know of it: where its word, or a setpoint
        without one, is sent all the time. docs/safety.md names that.
    """

    configure: Callable[..., list[DriveConfiguration]]
    make: Callable[[Callable[[bool, bool], object], int], Any]
    unseen: float = 0.0
    maps: bool = False


def _extended(*, slot: bool = False, control: bool = True, **options: Any) -> Kind:
    more: tuple[Parameter, ...] = (WORD,) if slot else ()
    return Kind(
        lambda **keys: [drive(**{
            'protocol': 'datamodel_extended', 'control': CONTROL if control else None,
            'period': PERIOD, 'request': (SPEED, *more), 'response': (ACTUAL, CURRENT, STATUS),
            **options, **keys})],
        lambda moved, _: ExtendedDrive(Motor(
            {**dict(zip(range(122, 130), (50, 52 * slot, 0, 0, 209, 210, 211, 0))),
             52: 0, 209: 0, 210: 0}, word=52 if control else None, moved=moved)),
        unseen=4 * PERIOD if slot or not control else 0.0,
        maps=options.get('mapping') != 'assume')


def _standard(*, slot: bool = False, control: bool = True) -> Kind:
    more: tuple[Parameter, ...] = (WORD,) if slot else ()
    return Kind(
        lambda **keys: [drive(**{
            'protocol': 'datamodel_standard', 'control': CONTROL if control else None,
            'period': PERIOD, 'request': (SPEED, *more), 'response': (ACTUAL, CURRENT, STATUS),
            **keys})],
        lambda moved, _: StandardDrive(Motor(
            {52: 0, 209: 0, 210: 0}, word=52 if control else None, moved=moved)),
        unseen=0.005 if control else math.inf)


def _pkw(*, slot: bool = False, control: bool = True) -> Kind:
    more = (TESYS_WORD,) if slot else ()
    return Kind(
        lambda **keys: [drive(**{
            'protocol': 'canopen_pkw', 'station': 5, 'table': TESYS, 'period': 0.1,
            'control': TESYS_CONTROL if control else None, 'request': (TESYS_SPEED, *more),
            'response': (TESYS_STATUS,), 'parameter_timeout': 0.2, 'refresh_interval': 0.3,
            **keys})],
        lambda moved, _: PkwNode(5, Motor(
            {704: 0}, setpoint=710, word=704 if control else None, status=455,
            bits=(1, 0x80, 4), moved=moved)),
        unseen=0.11 if slot else 0.0)


def _cannord(members: int = 1) -> Kind:
    return Kind(
        lambda **keys: [drive(**{
            'protocol': 'cannord', 'name': f'drive_{station}', 'station': station,
            'table': (FREQUENCY,), 'request': (FREQUENCY,), 'response': (), 'period': PERIOD,
            'broadcast': 'group' if members > 1 else 'none', **keys})
            for station in range(1, members + 1)],
        lambda moved, index: CannordDrive(
            index + 1, Motor(moved=moved), *[0x400] * (members > 1)),
        unseen=4 * PERIOD * members)


def _servo(make: type[MotorServo] = MotorServo, **options: Any) -> Kind:
    return Kind(
        lambda **keys: [drive(**{
            'protocol': 'cia402', 'mode': 'pv', 'table': (TARGET_VELOCITY,),
            'request': (TARGET_VELOCITY,), 'response': (), 'period': PERIOD,
            'parameter_timeout': 0.1, 'heartbeat_producer': 0.0, 'heartbeat_timeout': 0.0,
            **options, **keys})],
        lambda moved, index: make(index + 1, Motor(moved=moved)))


KINDS: dict[str, Kind] = {
    '29 bit, word by number': _extended(),
    '29 bit, word in its slot': _extended(slot=True),
    '29 bit, no word': _extended(control=False),
    '29 bit, maps assumed': _extended(mapping='assume'),
    '29 bit, no word, maps assumed': _extended(control=False, mapping='assume'),
    '29 bit, maps assumed, word in its slot': _extended(slot=True, mapping='assume'),
    '29 bit, maps configured': _extended(mapping='configure'),
    '29 bit, maps configured, word in its slot': _extended(slot=True, mapping='configure'),
    '11 bit, word by number': _standard(),
    '11 bit, word with its setpoints': _standard(slot=True),
    '11 bit, no word': _standard(control=False),
    'PKW, word by number': _pkw(),
    'PKW, word with its setpoints': _pkw(slot=True),
    'PKW, no word': _pkw(control=False),
    'CiA 402': _servo(),
    'CiA 402, mapping assumed': _servo(mapping='assume'),
    'CiA 402, disabled by shutdown': _servo(disable_word='shutdown'),
    'CiA 402, by event': _servo(transmission='event'),
    'CiA 402, with heartbeats': _servo(
        WatchingServo, heartbeat_producer=0.1, heartbeat_timeout=0.35),
    'CiA 402, stays in quick stop': _servo(StayingServo),
    'CiA 402, stays in quick stop, no 605Ah': _servo(OptionlessServo),
    'CANnord': _cannord(),
    'CANnord, group of two': _cannord(2),
    'CANnord, group of three': _cannord(3),
    'CANnord, group of four': _cannord(4),
}
