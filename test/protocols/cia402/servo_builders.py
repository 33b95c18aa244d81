# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A servo drive, node 5, in csv or csp, with its bus; frames as candump writes them."""

from collections.abc import Callable
import math
from typing import Any

from builders import drive, frame, INT16, INT32, parameter, RAM, RO
from conversation import Conversation
from drives import ServoDrive
from timeline import Pair

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.parameters import ParameterType

VELOCITY_TARGET = parameter('target_velocity', None, index=0x60FF, subindex=0, type=INT32,
                            scale=0.1, unit='rpm', minimum=-3000.0, maximum=3000.0, storage=RAM)
POSITION = parameter('position', None, index=0x6064, subindex=0, type=INT32, access=RO)
TARGET = parameter('target_position', None, index=0x607A, subindex=0, type=INT32, storage=RAM,
                   neutral_from='position', arming_tolerance=10.0)
VELOCITY = parameter('velocity', None, index=0x606C, subindex=0, type=INT32, scale=0.1,
                     unit='rpm', access=RO)
TORQUE = parameter('torque', None, index=0x6077, subindex=0, type=INT16, access=RO)
TORQUE_TARGET = parameter('target_torque', None, index=0x6071, subindex=0, type=INT16)
SPEED_VL = parameter('target_speed', None, index=0x6042, subindex=0, type=INT16)
IP_TARGET = parameter('interpolation', None, index=0x60C1, subindex=1, type=INT32,
                      neutral_from='position', arming_tolerance=10.0)
MODES_OF = parameter('mode_shown', None, index=0x6061, subindex=0, type=ParameterType.INT8,
                     access=RO)
ERROR = parameter('error', None, index=0x603F, subindex=0, access=RO)
TORQUE_LIMIT = parameter('torque_limit', None, index=0x6072, subindex=0, scale=0.1, unit='%',
                         minimum=0.0, maximum=100.0, neutral=100.0, limit=True, storage=RAM)
RAMP = parameter('acceleration', None, index=0x6083, subindex=0, type=ParameterType.UINT32)
MODE_TARGETS = {'csv': VELOCITY_TARGET, 'pv': VELOCITY_TARGET, 'csp': TARGET, 'pp': TARGET,
                'tq': TORQUE_TARGET, 'cst': TORQUE_TARGET, 'vl': SPEED_VL, 'ip': IP_TARGET}
TABLE = (VELOCITY_TARGET, POSITION, TARGET, VELOCITY, TORQUE, TORQUE_TARGET, SPEED_VL, IP_TARGET,
         MODES_OF, RAMP, TORQUE_LIMIT)
PERIOD = 0.01
#: COB-ID, type and mapping as the bridge writes them for csv with the position
FITTING = {
    (0x1400, 1): '05020000', (0x1400, 2): '01', (0x1600, 0): '02', (0x1600, 1): '10004060',
    (0x1600, 2): '2000FF60', (0x1800, 1): '85010000', (0x1800, 2): '01', (0x1A00, 0): '02',
    (0x1A00, 1): '10004160', (0x1A00, 2): '20006460'}
FITS = {place: bytes.fromhex(text) for place, text in FITTING.items()}
OBJECTS = {(0x6064, 0): (1000).to_bytes(4, 'little'), (0x60FF, 0): bytes(4),
           (0x607A, 0): bytes(4), (0x6077, 0): bytes(2), (0x6071, 0): bytes(2),
           (0x6042, 0): bytes(2), (0x60C1, 1): bytes(4), (0x6083, 0): bytes(4)}


def servo(mode: str = 'csv', **options: Any) -> DriveConfiguration:
    """Configure a drive with the setpoint of its mode, and its position."""
    return drive('cia402', mode=mode, **{
        'request': (MODE_TARGETS[mode],), 'response': (POSITION,), 'table': TABLE,
        'station': 5, 'period': PERIOD, 'name': 'axis', **options})


class Axis(Pair):
    """
    A session and the drive at the other end of the bus, with a heartbeat each 0.1 s.

    :param make: makes the drive.
    """

    DELAY = 0.0002

    def __init__(self, mode: str = 'csv', objects: dict[tuple[int, int], bytes] | None = None, *,
                 make: Callable[[int, dict[tuple[int, int], bytes]], ServoDrive] = ServoDrive,
                 **options: Any) -> None:
        super().__init__(Conversation(servo(mode, **options)))
        self.drive = make(5, {**OBJECTS, **(objects or {})})
        self.beat_at = 10.05
        self.tick_at = 10.0 if self.drive.ticks else math.inf

    def answers(self, sent: str) -> list[str]:
        self.drive.now = self.now
        return [str(answer) for answer in self.drive.takes(frame(sent))]

    def says(self, text: str) -> None:
        """Have the drive say something by itself."""
        self.deliver(self.talk.hears(text, self.now))

    def due(self) -> float:
        return min(self.tick_at, self.beat_at, super().due())

    def timers(self) -> None:
        due = self.due()
        if self.tick_at == due:
            self.tick_at += 0.001
            for said in self.drive.passes(self.now):
                self.says(str(said))
        elif self.beat_at == due:
            self.beat_at += 0.1
            if self.drive.number(0x1017) and not self.mute:
                self.says(str(self.drive.beats()))
        else:
            super().timers()

    def start(self) -> 'Axis':
        """Activate, and let it come online."""
        self.activate()
        self.live(0.3)
        return self

    def online(self) -> 'Axis':
        """Be online, with nothing in the log."""
        self.start()
        assert self.session.online, self.session.offline_advice
        self.take()
        self.talk.events()
        return self

    def enabled(self) -> 'Axis':
        """Be enabled and not armed."""
        self.online()
        assert self.asks(ControlAction.ENABLE) == [('enable', True, 'operation enabled')]
        self.take()
        self.talk.events()
        return self

    def asks(self, action: ControlAction, wait: float = 0.3) -> list[tuple[str, bool, str]]:
        """Ask for something, wait, and return what was answered."""
        self.deliver(self.talk.asks(action, self.now))
        self.live(wait)
        return self.talk.control_outcomes()

    def take(self) -> list[str]:
        """Return the frames sent since the last call."""
        log, self.log = self.log, []
        return [text for _, text in log]

    def words(self) -> list[str]:
        """Return the control words of RPDO1 since the last call, repetitions left out."""
        found: list[str] = []
        for text in self.take():
            if text.startswith('205#') and text[4:8] not in found[-1:]:
                found.append(text[4:8])
        return found
