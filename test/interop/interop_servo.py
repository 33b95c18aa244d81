# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What tests of CiA 402 beside another stack share: our bridge of a servo in csv."""

from typing import Any

from builders import drive, read, write
from interop_bridge import Bridge, DEADLINE
from waiting import clock

from drive_can_bridge.configuration.profiles import read_profile
from drive_can_bridge.core.configuration import BusConfiguration, DriveConfiguration
from drive_can_bridge.resources import profiles_directory

NODE = 5
PERIOD = 0.02
SERVO = read_profile(profiles_directory() / 'cia402_servo.yaml').profile


def bus_of(channel: str) -> BusConfiguration:
    return BusConfiguration('main', 'virtual', channel, bitrate=1_000_000, reconnect_period=0.05)


def names(*wanted: str) -> tuple[Any, ...]:
    return tuple(SERVO.parameters[name] for name in wanted)


def servo_configuration(**options: Any) -> DriveConfiguration:
    return drive(
        'cia402', table=SERVO.parameters.values(), request=names('target_velocity'),
        response=names('actual_velocity'),
        **{'name': 'axis', 'station': NODE, 'mode': 'csv', 'period': PERIOD, **options})


def bridge_on(bus: BusConfiguration, **options: Any) -> Bridge:
    return Bridge(bus, servo_configuration(**{
        'parameter_timeout': 0.5, 'control_timeout': DEADLINE, 'missed_limit': 10,
        'command_timeout': DEADLINE, 'heartbeat_timeout': 5.0, **options}))


def command(bridge: Bridge, value: float) -> None:
    with bridge.exchange.lock:
        bridge.session.services.command(0, value, clock().now())


def obeyed(state: int, word: int) -> int:
    """Return the state in which a control word leaves a drive: the bits of its status word."""
    if state == 0x08:
        return 0x40 if word & 0x80 else state
    if word & 0x06 != 0x06:
        return 0x40
    if not word & 0x01:
        return 0x21
    if state in (0x21, 0x27) and not word & 0x08:
        return 0x23
    return 0x27 if word & 0x08 and state == 0x23 else state


def parameters_go_both_ways(bridge: Bridge) -> None:
    velocity, offset, missing = names('profile_velocity', 'home_offset', 'torque_slope')
    assert bridge.outcome(write((velocity, 1234), (offset, -5))) == ['written', 'written']
    assert bridge.outcome(read(velocity, offset)) == [1234, -5]
    refused, = bridge.outcome(read(missing))
    assert '06020000h' in str(refused)
