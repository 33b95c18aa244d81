# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
CiA 402 against a CANopen node that nobody here wrote: the package ``durand`` (0.5.0).

NMT, SDO server, PDOs, SYNC, heartbeats and emergencies are its own; what of profile 402 is not
among them, a drive of velocities, stands here. It has no 1006h, 1016h, 1019h, 60C2h, 6007h and
no event timers.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from bus import End
from durand_bench import Wiring
from interop_bridge import Bridge
from interop_servo import (
    bridge_on, bus_of, command, NODE, obeyed, parameters_go_both_ways,
    PERIOD, SERVO, servo_configuration,
)
import pytest
from saying import says
from waiting import clock, pause, wait_for
from world import World

from drive_can_bridge.cli.probe import Asker
from drive_can_bridge.cli.profile import columns_from_option, import_file
from drive_can_bridge.cli.scan import BusScan
from drive_can_bridge.configuration.profiles import read_profile
from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import MappingDiffered
from drive_can_bridge.protocols.families import FAMILIES

durand = pytest.importorskip('durand')

U8, I8, U16, I16, U32, I32 = (
    durand.DatatypeEnum.UNSIGNED8, durand.DatatypeEnum.INTEGER8, durand.DatatypeEnum.UNSIGNED16,
    durand.DatatypeEnum.INTEGER16, durand.DatatypeEnum.UNSIGNED32, durand.DatatypeEnum.INTEGER32)
#: index -> (name, type, access, value)
OBJECTS = {
    0x603F: ('Error code', U16, 'ro', 0), 0x6040: ('Controlword', U16, 'rw', 0),
    0x6041: ('Statusword', U16, 'ro', 0x0240), 0x605A: ('Quick stop option code', I16, 'rw', 2),
    0x6060: ('Modes of operation', I8, 'rw', 0),
    0x6061: ('Modes of operation display', I8, 'ro', 0),
    0x6064: ('Position actual value', I32, 'ro', 0),
    0x606C: ('Velocity actual value', I32, 'ro', 0), 0x607C: ('Home offset', I32, 'rw', 0),
    0x6081: ('Profile velocity', U32, 'rw', 0), 0x60FF: ('Target velocity', I32, 'rw', 0),
    0x6502: ('Supported drive modes', U32, 'ro', 0x3EF)}


class Device:
    """
    A drive of velocities, at once, on a node of durand.

    :ivar moved: (when, increments/s) each time that its speed changed.
    """

    def __init__(self, wiring: Wiring) -> None:
        self.node = durand.MinimalNode(wiring, NODE)
        self.od = self.node.object_dictionary
        for index, (name, kind, access, value) in OBJECTS.items():
            self.od[index] = durand.Variable(kind, access, value, name=name)
        self.od.write(0x1000, 0, 0x20192)
        self.od.write(0x1008, 0, b'durand')
        self.moved: list[tuple[float, int]] = []
        self.od.update_callbacks[0x6040, 0].add(self._obey)
        self.od.update_callbacks[0x60FF, 0].add(lambda _: self._move())
        self.od.update_callbacks[0x6060, 0].add(lambda mode: self.od.write(0x6061, 0, mode))

    @property
    def state(self) -> int:
        return int(self.od.read(0x6041, 0)) & 0x6F

    @state.setter
    def state(self, state: int) -> None:
        if state != self.state:
            self.od.write(0x6041, 0, 0x0200 | state)
        self._move()

    @property
    def speed(self) -> int:
        return int(self.od.read(0x606C, 0))

    def restart(self) -> None:
        """Begin again as a device does that has lost its power."""
        self.od._data.clear()
        self.od.write(0x1000, 0, 0x20192)
        self.od.write(0x1017, 0, 0)
        self.node.nmt.reset()

    def _move(self) -> None:
        speed = self.od.read(0x60FF, 0) if self.state == 0x27 else 0
        if speed != self.speed:
            self.moved.append((clock().now(), speed))
            self.od.write(0x606C, 0, speed)

    def _obey(self, word: int) -> None:
        self.state = obeyed(self.state, word)


@pytest.fixture
def device(channel: str, world: World) -> Iterator[Device]:
    """Return the device on the bus."""
    wiring = Wiring(world, channel)
    before = durand.get_scheduler()
    durand.set_scheduler(wiring)
    yield Device(wiring)
    durand.set_scheduler(before)


def run(bridge: Bridge, device: Device) -> None:
    """Have the drive run."""
    bridge.online()
    assert bridge.control(ControlAction.ENABLE)
    command(bridge, 0.0)
    command(bridge, 60.0)
    wait_for(lambda: device.speed == 10_000, 'the speed')
    wait_for(lambda: bridge.samples[-1][1] == 10_000, 'the speed in a sample')


def test_it_is_set_up_runs_and_is_stopped(channel: str, device: Device) -> None:
    with bridge_on(bus_of(channel)) as bridge:
        run(bridge, device)
        entries = [device.od.read(0x1600, n) for n in range(3)]
        assert entries == [2, 0x60400010, 0x60FF0020]
        assert [device.od.read(0x1A00, n) for n in range(3)] == [2, 0x60410010, 0x606C0020]
        parameters_go_both_ways(bridge)
        device.state = 0x08
        wait_for(lambda: bridge.samples[-1][0] == 0x0208, 'the fault')
        assert not bridge.control(ControlAction.ENABLE)
        assert bridge.control(ControlAction.RESET_FAULT)
        run(bridge, device)
    assert (device.state, device.speed) == (0x21, 0)


def test_stopped_by_nmt_in_motion_it_is_braked_at_once(
        channel: str, device: Device, network: Any) -> None:
    with bridge_on(bus_of(channel)) as bridge:
        run(bridge, device)
        at = clock().now()
        network.send_message(0, [0x02, NODE])
        wait_for(lambda: not device.speed, 'standstill')
        # its heartbeat of 0.1 s is all that says so
        assert device.moved[-1][0] - at < 0.1 + PERIOD
        bridge.online()
        assert device.speed == 0
        run(bridge, device)


@pytest.mark.parametrize('command_of_nmt', [0x80, 0x81, 0x82])
def test_out_of_operational_in_motion(
        channel: str, device: Device, network: Any, command_of_nmt: int) -> None:
    with bridge_on(bus_of(channel)) as bridge:
        run(bridge, device)
        at = clock().now()
        network.send_message(0, [command_of_nmt, NODE])
        wait_for(lambda: not device.speed, 'standstill')
        assert device.moved[-1][0] - at < 0.1 + PERIOD
        bridge.online()
        pause(0.2)
        assert device.speed == 0
        run(bridge, device)


def test_that_has_lost_its_power_it_is_set_up_again(channel: str, device: Device) -> None:
    with bridge_on(bus_of(channel)) as bridge:
        run(bridge, device)
        device.restart()
        bridge.online(False)
        bridge.online()
        assert device.od.read(0x1600, 1) == 0x60400010
        pause(0.2)
        assert device.state != 0x27
        run(bridge, device)


def test_what_it_lacks_is_said(channel: str, device: Device) -> None:
    with bridge_on(bus_of(channel)) as bridge:
        bridge.online()
        assert says('nothing_stops') in [getattr(event, 'text', None) for event in bridge.events]
        assert bridge.facts('stops_by').endswith('bridge lost: nothing')
    # without an event timer nothing would come while nothing changes
    with bridge_on(bus_of(channel), mode='pv', transmission='event', period=0.05) as bridge:
        differs = wait_for(lambda: next((event for event in bridge.events if isinstance(
            event, MappingDiffered)), None), 'what differs')
        assert '1800h.05h' in str(differs.text)
        assert '06090011h' in str(differs.text)
        assert not bridge.session.online


def test_it_is_found_and_asked(channel: str, device: Device, world: World) -> None:
    bus = bus_of(channel)
    end = world.wires.of(channel)
    scan = BusScan(bus, End(end), clock().now)
    scan.ask('cia402')
    found, = scan.sightings
    assert (found.protocol, found.station) == ('cia402', NODE)
    drive = servo_configuration()
    findings = {each.key: each.value for each in Asker(bus, End(end), [drive], clock().now).probe(
        FAMILIES['cia402'].make_prober(drive))}
    # neither 605Ch nor 605Bh; 1016h is refused, and not only silent
    assert findings == {
        'mode': 'csv', 'mapping': 'configure', 'disable_word': None, 'bridge_heartbeat': 0.0}
    # what asks changes nothing
    assert not device.moved and device.node.nmt.state == 0x7F


def test_the_file_that_it_has_in_1021h_is_imported(tmp_path: Path, device: Device) -> None:
    source, made = tmp_path / 'durand.eds', tmp_path / 'durand.yaml'
    source.write_text(device.node.eds.content, encoding='utf-8')
    made.write_text(import_file(source, columns=columns_from_option(''), sign='', protocols=())
                    .text, encoding='utf-8')
    profile = read_profile(made).profile
    assert profile.protocols == ('cia402',)
    for name in ('target_velocity', 'actual_velocity', 'home_offset', 'supported_modes'):
        ours, theirs = SERVO.parameters[name], profile.parameters[name]
        assert (theirs.address, theirs.type, theirs.access) == (
            ours.address, ours.type, ours.access)
