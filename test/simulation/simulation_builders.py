# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Configurations, drives and frames for the tests of the simulation."""

from collections.abc import Iterable
import json
from pathlib import Path
from typing import Any

import builders
from builders import ACTUAL, CURRENT, EEPROM, frame, INT16, parameter, STATUS
import pytest

from drive_can_bridge.core.configuration import (
    BridgeConfiguration, BusConfiguration, DriveConfiguration,
)
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import ControlTable
from drive_can_bridge.simulation.datamodel import SimulatedDataModelDrive
from drive_can_bridge.simulation.registers import Mechanics

#: rules of the protocols that somebody may break, as they are told
RULES = {
    'alone': 'frame that only this drive may send',
    'reserved bit': 'reserved bit 13 of the control word',
    'length': 'process data of a length that the manual does not define (ignored)',
    'task length': 'parameter task without eight data bytes (ignored)',
    'task': 'parameter task that the manual does not define (ignored)',
    'task identifier': 'task identifier that does not exist (refused)',
    'sub-index': 'byte of the sub-index that holds no information is not 0',
    'undefined': 'frame that the manual does not define (ignored)',
    'read data': 'read request with data other than 00h',
    'read bytes': 'read request with unused bytes other than 00h',
    'write bytes': 'write with unused bytes other than 00h',
    'map': 'map parameter in the request map (ignored)',
    'wear': 'EEPROM parameter ramp_time written cyclically',
    'function byte': 'request with the function byte of the one before (ignored)',
    'request length': 'request without eight data bytes (ignored)',
    'not operational': 'request while the node is not operational (ignored)',
}

# the example of the contract's section on profiles, with what its text adds
SPEED_SETPOINT = parameter('speed_setpoint', 50, type=INT16, scale=0.1, unit='rpm',
                           minimum=-3000.0, maximum=3000.0, neutral=0.0)
TORQUE_LIMIT = parameter('torque_limit', 51, scale=0.1, unit='%', minimum=0.0, maximum=300.0)
RAMP_TIME = parameter('ramp_time', 30, scale=0.01, unit='s', storage=EEPROM)
EXAMPLE = (SPEED_SETPOINT, TORQUE_LIMIT, ACTUAL, CURRENT, STATUS, RAMP_TIME)


def configuration(parameters: Iterable[Parameter] = EXAMPLE, *, name: str = 'conveyor',
                  station: int = 1, control: ControlTable | None = None,
                  request: Iterable[Parameter] = (SPEED_SETPOINT, TORQUE_LIMIT),
                  response: Iterable[Parameter] = (ACTUAL, CURRENT, STATUS),
                  protocol: str = 'datamodel_extended', **options: Any) -> DriveConfiguration:
    """Make the configuration of a drive; further keywords are its keys."""
    return builders.drive(protocol, name=name, station=station, table=parameters, control=control,
                          request=request, response=response, **options)


def motor(parameters: Iterable[Parameter], control: ControlTable | None = None,
          request: Iterable[Parameter] = (), response: Iterable[Parameter] = (),
          **mechanics: Any) -> SimulatedDataModelDrive:
    """Make a drive of which only registers and motor matter."""
    return SimulatedDataModelDrive(
        configuration(parameters, control=control, request=request, response=response),
        mechanics=Mechanics(**mechanics))


def drive(*args: Any, **options: Any) -> SimulatedDataModelDrive:
    """Make a drive; arguments as for a configuration."""
    return SimulatedDataModelDrive(configuration(*args, **options))


def bridge(*drives: DriveConfiguration, interface: str = 'virtual', channel: str = 'x',
           ) -> BridgeConfiguration:
    """Make the configuration of a bridge with one bus."""
    bus = BusConfiguration('main', interface, channel, reconnect_period=0.05)
    return BridgeConfiguration(buses={'main': bus},
                               drives={d.name: d for d in drives or (configuration(),)})


def ask(simulated: SimulatedDataModelDrive, text: str, now: float) -> list[str]:
    """Send a frame to a drive; return its answers as candump writes them."""
    simulated.receive_frame(frame(text), now)
    return [str(answer) for answer in simulated.take_frames()]


# -- golden vectors of DataModel ------------------------------------------------------------------

VECTORS = json.loads((Path(__file__).parents[1] / 'vectors' / 'datamodel.json').read_text(
    encoding='utf-8'))['vectors']
#: what a register holds that nobody has written
UNTOUCHED = 0x5151


def vectors(protocol: str, *kinds: str) -> list[Any]:
    """Return the vectors of some kinds: ``extended`` or ``standard``."""
    return [pytest.param(row, id=f'{row["id"]}-{row["name"]}') for row in VECTORS
            if row['protocol'] == protocol and row['kind'] in kinds
            and row['can_id_hex'] is not None]


def frame_of(row: dict[str, Any]) -> Frame:
    """Return the frame of a vector."""
    return Frame(int(row['can_id_hex'], 16), bytes.fromhex(row['data_hex']),
                 row['is_extended_id'])


def register_name(number: int) -> str:
    """Return the name of a register of a drive of vectors; map entries have raw names only."""
    return f'p{number}' if 122 <= number <= 129 else f'reg_{number}'
