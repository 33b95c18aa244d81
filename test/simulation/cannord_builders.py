# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Configurations of inverters for the tests of the simulated CANnord drive."""

from collections.abc import Iterable
from typing import Any

import builders
from builders import EEPROM, frame, INT16, parameter, RAM, RO, WO

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.simulation.cannord import SimulatedCannordInverter
from drive_can_bridge.simulation.drive import SimulatedDrive


def word(name: str, **options: Any) -> Parameter:
    """Make a process data word: 4000h is 100 %."""
    options.setdefault('unit', '%')
    options.setdefault('scale', 100.0 / 16384.0)
    return Parameter(name, INT16, scaled=True, **options)


FREQUENCY = word('frequency_setpoint', unit='Hz', scale=50.0 / 16384.0, minimum=-50.0,
                 maximum=50.0, neutral=0.0)
PERCENT = word('relative_frequency_setpoint', minimum=-100.0, maximum=100.0, neutral=0.0)
SETPOINTS = [word(f'setpoint_{number}') for number in (2, 3, 4, 5)]
ACTUAL = word('actual_frequency', unit='Hz', scale=50.0 / 16384.0, access=RO)
ACTUAL_PERCENT = word('actual_relative_frequency', access=RO)
VALUES = [word(f'actual_value_{number}', access=RO) for number in (2, 3, 4, 5)]

UP = parameter('acceleration_time', 102, scale=0.01, unit='s', minimum=0.0, maximum=320.0)
UP_2 = parameter('acceleration_time_set_2', 102, subindex=1, scale=0.01, unit='s')
UP_4 = parameter('acceleration_time_set_4', 102, subindex=3, scale=0.01, unit='s')
SIGNED = parameter('offset', 411, type=INT16, minimum=-100, maximum=100)
WIDE = parameter('distance', 600, type=ParameterType.INT32)
POSITIONS = [parameter(f'position_{element}', 613, subindex=element, type=ParameterType.INT32)
             for element in (0, 1, 4)]
TIMEOUT = parameter('telegram_timeout', 513, type=INT16, scale=0.1, unit='s', storage=EEPROM)
ADDRESS = parameter('can_address', 515, storage=EEPROM)
FAULT_CODE = parameter('fault_code', 700, subindex=0, scale=0.1, access=RO)
KEY = parameter('key', 3, access=WO)
FLAG = parameter('flag', 4, type=ParameterType.BOOL, storage=RAM)
TABLE = (FREQUENCY, PERCENT, *SETPOINTS, ACTUAL, ACTUAL_PERCENT, *VALUES, UP, UP_2, UP_4, SIGNED,
         WIDE, *POSITIONS, TIMEOUT, ADDRESS, FAULT_CODE, KEY, FLAG)


def configuration(*, table: Iterable[Parameter] = TABLE,
                  request: Iterable[Parameter] = (FREQUENCY,),
                  response: Iterable[Parameter] = (ACTUAL,), station: int = 100,
                  name: str = 'conveyor', **options: Any) -> DriveConfiguration:
    """Make the configuration of an inverter; further keywords are keys of the family."""
    return builders.drive('cannord', name=name, station=station, table=table, request=request,
                          response=response, **options)


def inverter(**options: Any) -> SimulatedCannordInverter:
    """Make an inverter; arguments as for a configuration."""
    return SimulatedCannordInverter(configuration(**options))


def says(made: SimulatedDrive, text: str, now: float = 0.0) -> list[str]:
    """Send a frame, ``0C8#7E040000``; return the answers as candump writes them."""
    made.receive_frame(frame(text), now)
    return [str(answer) for answer in made.take_frames()]


def tells(made: SimulatedCannordInverter, data: str, now: float = 0.0) -> str:
    """Send process data to address 100; return the data of the answer."""
    answer, = says(made, f'0C8#{data}', now)
    assert answer.startswith('0C9#')
    return answer[4:]


def asks(made: SimulatedCannordInverter, data: str, now: float = 0.0) -> str:
    """Send a parameter task to address 100; return the data of the answer."""
    answer, = says(made, f'2C8#{data}', now)
    assert answer.startswith('2C9#')
    return answer[4:]


def run(made: SimulatedCannordInverter, now: float = 0.0) -> None:
    """Bring an inverter to operation enabled, with setpoint 0."""
    for data in ('7E040000', '7F040000'):
        tells(made, data, now)
