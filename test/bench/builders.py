# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Configurations, frames and requests for the tests of sessions."""

from collections.abc import Iterable
from typing import Any

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import AccessMode, Parameter, ParameterType, Storage
from drive_can_bridge.core.profile import ControlTable, Profile, StatusPattern
from drive_can_bridge.core.requests import (
    Failure, Outcome, ReadRequest, ReadValue, WriteRequest, Written,
)
from drive_can_bridge.protocols.families import FAMILIES

RO, RW, WO = AccessMode.READ_ONLY, AccessMode.READ_WRITE, AccessMode.WRITE_ONLY
RAM, EEPROM = Storage.RAM, Storage.EEPROM
BOOL, INT16, UINT16 = ParameterType.BOOL, ParameterType.INT16, ParameterType.UINT16
INT32 = ParameterType.INT32


def parameter(name: str, number: int | None, **options: Any) -> Parameter:
    """Make a parameter; a scale, offset or unit makes it a double, as in a profile."""
    options.setdefault('scaled', bool({'scale', 'offset', 'unit'} & set(options)))
    return Parameter(name=name, number=number, **options)


SPEED = parameter('speed_setpoint', 50, type=INT16, scale=0.1, unit='rpm', minimum=-3000.0,
                  maximum=3000.0, neutral=0.0, storage=RAM)
LIMIT = parameter('torque_limit', 51, scale=0.1, unit='%', minimum=0.0, maximum=300.0,
                  storage=RAM)
WORD = parameter('control_word', 52, storage=RAM)
ACTUAL = parameter('actual_speed', 209, type=INT16, scale=0.1, unit='rpm', access=RO)
CURRENT = parameter('motor_current', 210, type=INT16, scale=0.01, unit='A', access=RO)
STATUS = parameter('status_word', 211, access=RO,
                   bits=(('ready', 0), ('enabled', 1), ('fault', 3)))
RAMP = parameter('ramp_time', 30, scale=0.01, unit='s', storage=EEPROM, minimum=0.01,
                 maximum=60.0)
MAXIMUM = parameter('maximum_speed', 31, scale=0.1, unit='rpm', storage=EEPROM)
GAIN = parameter('gain', 40, storage=RAM)
DAMPING = parameter('damping', 41, storage=RAM)
FLAG = parameter('flag', 42, type=BOOL, storage=RAM)
ORDER = parameter('order', 43, access=WO, storage=RAM)
KEY = parameter('key', 44, access=WO)
TABLE = (SPEED, LIMIT, WORD, ACTUAL, CURRENT, STATUS, RAMP, MAXIMUM, GAIN, DAMPING, FLAG, ORDER,
         KEY)

CONTROL = ControlTable(
    parameter='control_word', disable=0x0000, enable=0x0001, quick_stop=0x0002,
    reset_fault=0x0080, status_parameter='status_word', ready=StatusPattern(1, 1),
    enabled=StatusPattern(2, 2), fault=StatusPattern(8, 8))
#: the same for a drive that reports nothing
SILENT_CONTROL = ControlTable(
    parameter='control_word', disable=0x0000, enable=0x0001, quick_stop=0x0002,
    reset_fault=0x0080)

#: a TeSys T: its registers, and its control word
TESYS_STATUS = parameter('system_status_1', 455, access=RO)
TESYS_WORD = parameter('control_register_1', 704, storage=RAM)
TESYS_SPEED = parameter('speed', 710, storage=RAM, scale=0.1, unit='Hz')
TESYS = (TESYS_STATUS, TESYS_WORD, TESYS_SPEED)
TESYS_CONTROL = ControlTable(
    parameter='control_register_1', disable=0, enable=1, reset_fault=8,
    status_parameter='system_status_1', ready=StatusPattern(1, 1),
    enabled=StatusPattern(0x80, 0x80), fault=StatusPattern(4, 4))
#: 60FFh of CiA 402
TARGET_VELOCITY = parameter('target_velocity', None, index=0x60FF, subindex=0, type=INT32,
                            scale=0.1, unit='rpm')

#: drive keys that are not fields of a family
_DRIVE_KEYS = set(DriveConfiguration.__dataclass_fields__)


def drive(protocol: str = 'datamodel_extended', *, name: str = 'conveyor', station: int = 1,
          table: Iterable[Parameter] = TABLE, control: ControlTable | None = None,
          request: Iterable[Parameter] = (SPEED, LIMIT),
          response: Iterable[Parameter] = (ACTUAL, CURRENT, STATUS), **options: Any,
          ) -> DriveConfiguration:
    """Make a drive; further keywords are its keys, those of the family included."""
    keys = {key: value for key, value in options.items() if key in _DRIVE_KEYS}
    own = FAMILIES[protocol].make_options(station, {
        key: value for key, value in options.items() if key not in keys})
    profile = Profile('table', '/table.yaml', '', (protocol,), {p.name: p for p in table}, control)
    return DriveConfiguration(
        name=name, bus='main', protocol=protocol, station=station, profile=profile,
        cyclic_request=tuple(request), cyclic_response=tuple(response), options=own, **keys)


def frame(text: str) -> Frame:
    """Read a frame as candump writes it: eight digits are a 29-bit identifier."""
    identifier, _, data = text.partition('#')
    return Frame(int(identifier, 16), bytes.fromhex(data), len(identifier) == 8)


def read(*parameters: Parameter) -> ReadRequest:
    """Make a request to read parameters."""
    return ReadRequest(parameters)


def write(*items: tuple[Parameter, int], atomic: bool = False) -> WriteRequest:
    """Make a request to write raw integers."""
    return WriteRequest(items, atomic)


def text_of(outcome: Outcome) -> object:
    """Return what an outcome says: a raw integer, 'written', or the reason."""
    if isinstance(outcome, ReadValue):
        return outcome.raw
    if isinstance(outcome, Written):
        return outcome.note or 'written'
    return outcome.reason if isinstance(outcome, Failure) else outcome
