# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Configurations, drives and frames for the tests of the simulation."""

from collections.abc import Iterable
from typing import Any

import builders

from drive_can_bridge.core.configuration import (
    BridgeConfiguration, BusConfiguration, DriveConfiguration,
)
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Access, Parameter, ParameterType, Storage
from drive_can_bridge.core.profile import ControlTable, StatusPattern
from drive_can_bridge.simulation.datamodel import SimulatedDataModelDrive
from drive_can_bridge.simulation.registers import Mechanics

RO, RW, WO = Access.READ_ONLY, Access.READ_WRITE, Access.WRITE_ONLY
RAM, EEPROM = Storage.RAM, Storage.EEPROM
INT16 = ParameterType.INT16
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


def parameter(name: str, number: int, **options: Any) -> Parameter:
    """Make a parameter; a unit or scale makes it a double, as in a profile."""
    options.setdefault('scaled', bool({'scale', 'offset', 'unit'} & set(options)))
    return Parameter(name=name, number=number, **options)


# the example of the contract's section on profiles, with what its text adds
SPEED_SETPOINT = parameter('speed_setpoint', 50, type=INT16, scale=0.1, unit='rpm',
                           minimum=-3000.0, maximum=3000.0, neutral=0.0)
TORQUE_LIMIT = parameter('torque_limit', 51, scale=0.1, unit='%', minimum=0.0, maximum=300.0)
ACTUAL_SPEED = parameter('actual_speed', 209, type=INT16, scale=0.1, unit='rpm', access=RO)
MOTOR_CURRENT = parameter('motor_current', 210, type=INT16, scale=0.01, unit='A', access=RO)
STATUS_WORD = parameter('status_word', 211, access=RO,
                        bits=(('ready', 0), ('enabled', 1), ('fault', 3)))
RAMP_TIME = parameter('ramp_time', 30, scale=0.01, unit='s', storage=EEPROM)
CONTROL_WORD = parameter('control_word', 52, storage=RAM)
EXAMPLE = (SPEED_SETPOINT, TORQUE_LIMIT, ACTUAL_SPEED, MOTOR_CURRENT, STATUS_WORD, RAMP_TIME)

CONTROL = ControlTable(
    parameter='control_word', disable=0x0000, enable=0x0001, quick_stop=0x0002,
    reset_fault=0x0080, status_parameter='status_word', ready=StatusPattern(1, 1),
    enabled=StatusPattern(2, 2), fault=StatusPattern(8, 8))


def configuration(parameters: Iterable[Parameter] = EXAMPLE, *, name: str = 'conveyor',
                  station: int = 1, control: ControlTable | None = None,
                  request: Iterable[Parameter] = (SPEED_SETPOINT, TORQUE_LIMIT),
                  response: Iterable[Parameter] = (ACTUAL_SPEED, MOTOR_CURRENT, STATUS_WORD),
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


def frame(text: str) -> Frame:
    """Read a frame as candump writes it."""
    identifier, _, data = text.partition('#')
    return Frame(int(identifier, 16), bytes.fromhex(data), len(identifier) == 8)


def ask(simulated: SimulatedDataModelDrive, text: str, now: float) -> list[str]:
    """Send a frame to a drive; return its answers as candump writes them."""
    simulated.receive_frame(frame(text), now)
    return [str(answer) for answer in simulated.take_frames()]
