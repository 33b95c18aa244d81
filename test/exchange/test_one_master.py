# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Who has a drive, in the words that a second one gets."""

from collections.abc import Iterator
import os
from pathlib import Path
import re

from builders import drive
import pytest

from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.exchange.one_master import InUse, Ownership
from drive_can_bridge.process.presence import BRIDGE, bridges

ADVICE = 'leave --params-file away to go through it'
CAN = BusConfiguration('main', 'socketcan', f'nowhere{os.getpid()}')
CONVEYOR, LIFT = drive(name='conveyor', station=1), drive(name='lift', station=2)


@pytest.fixture
def port(tmp_path: Path) -> Iterator[tuple[BusConfiguration, BusConfiguration]]:
    """Return a serial bus under both of its names."""
    near, far = os.openpty()
    (tmp_path / 'link').symlink_to(os.ttyname(far))
    yield (BusConfiguration('main', 'slcan', os.ttyname(far)),
           BusConfiguration('other', 'slcan', str(tmp_path / 'link')))
    os.close(near)
    os.close(far)


def test_drive_and_process_are_named() -> None:
    with Ownership([(CAN, [CONVEYOR, LIFT])], BRIDGE, ADVICE):
        with pytest.raises(InUse, match=f'^bus main: drive lift is used by process {os.getpid()}; '
                                        f'{re.escape(ADVICE)}$'):
            Ownership([(CAN, [LIFT, CONVEYOR])], 'drive_can read', ADVICE)
    Ownership([(CAN, [LIFT])], 'drive_can read', ADVICE).release()


def test_what_is_no_bridge_cannot_be_gone_through() -> None:
    with Ownership([(CAN, [LIFT])], 'drive_can backup', ADVICE):
        with pytest.raises(InUse, match=(
                f'^bus main: drive lift is used by process {os.getpid()} '
                r'\(drive_can backup\); wait until it is done, or end it$')):
            Ownership([(CAN, [LIFT])], 'drive_can read', ADVICE)


def test_drives_of_others_on_the_same_bus_are_free() -> None:
    with Ownership([(CAN, [CONVEYOR])], BRIDGE, ADVICE):
        Ownership([(CAN, [LIFT])], BRIDGE, ADVICE).release()
        elsewhere = BusConfiguration('main', 'socketcan', 'nowhere_else')
        Ownership([(elsewhere, [CONVEYOR])], BRIDGE, ADVICE).release()
        same_station = drive('canopen_pkw', station=1, request=(), period=0.1)
        Ownership([(CAN, [same_station])], BRIDGE, ADVICE).release()
        Ownership([(CAN, [])], 'drive_can scan', ADVICE).release()


@pytest.mark.parametrize('serial', [False, True])
def test_others_see_how_many_drives_a_bridge_has(
        port: tuple[BusConfiguration, BusConfiguration], serial: bool) -> None:
    """A port has locks of its own, and as many names as people and udev give it."""
    with Ownership([(port[1] if serial else CAN, [CONVEYOR, LIFT])], BRIDGE, ADVICE):
        assert [each.drives for each in bridges() if each.process == os.getpid()] == [2]
    with Ownership([(port[1], [])], BRIDGE, ADVICE):
        assert [each.drives for each in bridges() if each.process == os.getpid()] == [0]
    assert not [each for each in bridges() if each.process == os.getpid()]


def test_a_serial_port_is_used_by_one(port: tuple[BusConfiguration, BusConfiguration]) -> None:
    by_device, by_link = port
    with Ownership([(by_device, [CONVEYOR])], BRIDGE, ADVICE):
        with pytest.raises(InUse, match='^bus other: drive conveyor is used by process'):
            Ownership([(by_link, [CONVEYOR])], BRIDGE, ADVICE)
        with pytest.raises(InUse, match=f'^bus other: the serial port {by_link.channel} is used '):
            Ownership([(by_link, [LIFT])], BRIDGE, ADVICE)
        with pytest.raises(InUse, match='^bus other: the serial port'):
            Ownership([(by_link, [])], 'drive_can record', ADVICE)
    Ownership([(by_link, [LIFT])], BRIDGE, ADVICE).release()
