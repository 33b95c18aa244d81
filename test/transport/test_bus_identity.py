# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Which buses are the same one."""

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
from typing import Any

import pytest
from waiting import wait_for

from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.transport.bus_identity import identity_of


def bus(interface: str, channel: str | int, **options: Any) -> BusConfiguration:
    return BusConfiguration('main', interface, channel, options=options)


def same(first: BusConfiguration, second: BusConfiguration) -> bool:
    return bool(set(identity_of(first).names) & set(identity_of(second).names))


@contextmanager
def opened() -> Iterator[tuple[int, str]]:
    """Open a pseudo-terminal: its far end, and the name that a bus has."""
    near, far = os.openpty()
    try:
        yield near, os.ttyname(far)
    finally:
        os.close(near)
        os.close(far)


@pytest.fixture
def terminal() -> Iterator[str]:
    with opened() as (_, name):
        yield name


def test_a_port_by_another_name_is_the_same(terminal: str, tmp_path: Path) -> None:
    link, further = tmp_path / 'adapter', tmp_path / 'further'
    link.symlink_to(terminal)
    further.symlink_to(link)
    for name in (terminal, str(link), str(further), f'{terminal}@115200',
                 f'/dev/../{terminal.removeprefix("/")}'):
        assert same(bus('slcan', terminal), bus('slcan', name)), name
    assert same(bus('slcan', str(link)), bus('robotell', str(further)))
    assert identity_of(bus('slcan', str(link))).port == str(link)


def test_other_ports_are_others(terminal: str, tmp_path: Path) -> None:
    with opened() as (_, other):
        assert not same(bus('slcan', terminal), bus('slcan', other))
    assert not same(bus('slcan', str(tmp_path / 'a')), bus('slcan', str(tmp_path / 'b')))


def test_a_port_that_is_not_plugged_in_goes_by_its_name(terminal: str, tmp_path: Path) -> None:
    missing = tmp_path / 'ttyACM7'
    before = set(identity_of(bus('slcan', str(missing))).names)
    assert before
    missing.symlink_to(terminal)
    assert before & set(identity_of(bus('slcan', str(missing))).names)


def test_the_number_of_a_terminal_that_has_gone_belongs_to_another() -> None:
    with opened() as (near, name):
        before = identity_of(bus('slcan', name)).names
        os.write(near, b'x')
        assert identity_of(bus('slcan', name)).names == before

    def is_another() -> bool:
        with opened() as (_, other):    # the clock of the kernel has to have ticked
            return other == name and set(
                identity_of(bus('slcan', name)).names).isdisjoint(before)
    wait_for(is_another, 'another terminal of that number')


def test_buses_that_are_not_serial() -> None:
    assert same(bus('socketcan', 'can0'), bus('socketcan', 'can0', fd=False))
    assert not same(bus('socketcan', 'can0'), bus('socketcan', 'can1'))
    assert not same(bus('socketcan', 'can0'), bus('virtual', 'can0'))
    assert same(bus('kvaser', 0), bus('kvaser', '0'))
    assert not same(bus('udp_multicast', '239.0.0.1', port=1), bus('udp_multicast', '239.0.0.1'))
    assert not identity_of(bus('socketcan', 'can0')).port


def test_a_virtual_bus_is_of_one_process() -> None:
    assert same(bus('virtual', 'x'), bus('virtual', 'x'))
    assert str(os.getpid()) in identity_of(bus('virtual', 'x')).names[0]
