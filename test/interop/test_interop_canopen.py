# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Against a CANopen stack that nobody here wrote: the package ``canopen``.

It plays the master of a simulated LTMR, and the node that a bridge follows. It is no dependency
of the bridge: without it these tests skip.
"""

from collections.abc import Iterator
from typing import Any

from builders import drive, read, write
from interop_bridge import Bridge, DEADLINE, dictionary_of, objectdictionary
import pytest
from waiting import clock, wait_for

from drive_can_bridge.configuration.profiles import read_profile
from drive_can_bridge.core.configuration import (
    BridgeConfiguration, BusConfiguration, DriveConfiguration,
)
from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.resources import profiles_directory
from drive_can_bridge.simulation.simulation import PlayedDrive, Simulation

canopen = pytest.importorskip('canopen')

NODE = 5
U8, U16, U32 = (
    objectdictionary.UNSIGNED8, objectdictionary.UNSIGNED16, objectdictionary.UNSIGNED32)
LTMR = read_profile(profiles_directory() / 'tesys_t_ltmr.yaml').profile


def bus_of(channel: str) -> BusConfiguration:
    return BusConfiguration('main', 'virtual', channel, bitrate=250_000, reconnect_period=0.05)


# -- the other stack as master --------------------------------------------------------------------


#: what a master knows of an LTMR: PDO4, the mailbox, a few more
OBJECTS = {0x1017: ('heartbeat', U16), 0x1008: ('name', objectdictionary.VISIBLE_STRING)}
RECORDS = {
    0x1403: {1: U32, 2: U8}, 0x1803: {1: U32, 2: U8}, 0x1603: {0: U8, 1: U32, 2: U32},
    0x1A03: {0: U8, 1: U32, 2: U32}, 0x3000: {1: U32, 2: U32, 3: U32, 4: U32},
    0x2004: {6: U16, 7: U16}, 0x2007: {3: U16}, 0x2008: {5: U16}}


@pytest.fixture
def node(network: Any) -> Any:
    """Return the LTMR as the other stack's master sees it."""
    remote = canopen.RemoteNode(NODE, dictionary_of(OBJECTS, RECORDS))
    # a busy machine is no reason to give up
    remote.sdo.RESPONSE_TIMEOUT = DEADLINE
    network.add_node(remote)
    return remote


@pytest.fixture
def states(node: Any) -> list[int]:
    """Return the states that the node reports, as they come."""
    heard: list[int] = []
    node.nmt.add_heartbeat_callback(heard.append)
    return heard


def ltmr_configuration(**options: Any) -> DriveConfiguration:
    return drive('canopen_pkw', name='pump', station=NODE, table=LTMR.parameters.values(),
                 control=LTMR.control, request=(),
                 response=(LTMR.parameters['system_status_1'],), **options)


@pytest.fixture
def ltmr(channel: str, states: list[int]) -> Iterator[PlayedDrive]:
    """Return a simulated LTMR on the bus, switched on after somebody listened."""
    configuration = BridgeConfiguration(
        buses={'main': bus_of(channel)}, drives={'pump': ltmr_configuration()})
    with Simulation(configuration, clock()) as simulation:
        yield simulation.drives['pump']
    assert not simulation.failure


def heartbeat(states: list[int], state: int) -> None:
    """Wait until the node says that it is in a state."""
    wait_for(lambda: states[-1:] == [state], f'a heartbeat that says {state}')


def start(node: Any, states: list[int]) -> None:
    """Bring the node to operational, and see that it says so."""
    wait_for(lambda: states, 'the boot-up frame')
    node.sdo[0x1017].raw = 50
    node.nmt.state = 'OPERATIONAL'
    heartbeat(states, 5)


def test_master_sees_boot_up_states_and_resets(node: Any, states: list[int],
                                               ltmr: PlayedDrive) -> None:
    wait_for(lambda: states, 'the boot-up frame')
    assert states[0] == 0
    node.sdo[0x1017].raw = 50
    assert node.sdo[0x1017].raw == 50
    for name, state in (('OPERATIONAL', 5), ('STOPPED', 4), ('PRE-OPERATIONAL', 127)):
        node.nmt.state = name
        heartbeat(states, state)
        assert node.nmt.state == name
    for name in ('RESET', 'RESET COMMUNICATION'):
        states.clear()
        node.nmt.state = name
        wait_for(lambda: 0 in states, 'the boot-up frame')
        wait_for(lambda: node.nmt.state == 'PRE-OPERATIONAL', 'the state after it')
    assert not ltmr.violations


def test_master_reads_and_writes_objects(node: Any, ltmr: PlayedDrive,
                                         states: list[int]) -> None:
    wait_for(lambda: states, 'the boot-up frame')
    assert node.sdo.upload(0x1008, 0) == b'simulated LTMR'
    assert node.sdo['name'].raw == 'simulated LTMR'
    assert node.sdo[0x2004][6].raw == 0x0041
    node.sdo[0x2007][3].raw = 50
    assert node.sdo[0x2007][3].raw == 50
    assert ltmr.value('flc1_ratio') == 50.0
    for index, subindex, code in ((0x5000, 0, 0x06020000), (0x2004, 0xFF, 0x06090011)):
        with pytest.raises(canopen.SdoAbortedError) as refused:
            node.sdo.upload(index, subindex)
        assert refused.value.code == code
    for index, subindex, data, code in (
            (0x2007, 3, b'\xFF\xFF', 0x06090030), (0x2004, 6, b'\x34\x12', 0x06010002),
            (0x2007, 3, b'\x01\x00\x00\x00', 0x06070012)):
        with pytest.raises(canopen.SdoAbortedError) as refused:
            node.sdo.download(index, subindex, data)
        assert refused.value.code == code
    assert ltmr.value('flc1_ratio') == 50.0
    # the stack segments what it is told to; nothing here is that long
    with pytest.raises(canopen.SdoAbortedError) as refused:
        node.sdo.download(0x2007, 3, b'\x28\x00', force_segment=True)
    assert refused.value.code == 0x05040001
    assert not ltmr.violations


def test_master_uses_the_mailbox_by_its_own_pdos(node: Any, ltmr: PlayedDrive,
                                                 states: list[int]) -> None:
    start(node, states)
    # where PDO4 is and what it carries, the stack reads from the device
    out, into = node.rpdo[4], node.tpdo[4]
    out.read()
    into.read()
    assert (out.cob_id, into.cob_id) == (0x505, 0x485)
    assert [(entry.index, entry.subindex) for entry in out] == [(0x3000, 1), (0x3000, 2)]
    assert [(entry.index, entry.subindex) for entry in into] == [(0x3000, 3), (0x3000, 4)]

    def ask(word_1: int, word_2: int, word_3: int = 0, word_4: int = 0) -> tuple[int, ...]:
        out[0].raw = word_2 << 16 | word_1
        out[1].raw = word_4 << 16 | word_3
        heard.clear()
        out.transmit()
        wait_for(lambda: heard, f'the answer to {word_2:04X}h')
        first, second = heard[0]
        return first & 0xFFFF, first >> 16, second & 0xFFFF, second >> 16

    heard: list[tuple[int, int]] = []
    into.add_callback(lambda pdo: heard.append((pdo[0].raw, pdo[1].raw)))
    ltmr.set_value('average_current', 9.0)
    assert ask(455, 0x2500) == (455, 0x2500, 0x0041, 0)
    assert ask(500, 0xA600) == (500, 0xA600, 0, 900)
    assert ask(652, 0x2A00, 60) == (652, 0x2A00, 0, 0)
    assert ask(0x2007, 0xB503) == (0x2007, 0xB503, 60, 0)
    assert ask(0x2007, 0x3A03, 61)[:2] == (0x2007, 0x3A03)
    assert node.sdo[0x2007][3].raw == 61
    assert ask(652, 0xAA00, 0xFFFF) == (652, 0xCE00, 0x0030, 0x0609)
    assert ask(9999, 0x2500) == (9999, 0x4E00, 0, 0x0602)
    assert node.sdo[0x2007][3].raw == 61
    # what the mailbox holds can be read as objects, too
    assert node.sdo[0x3000][3].raw == 0x4E00 << 16 | 9999
    assert node.sdo[0x3000][4].raw == 0x06020000
    assert not ltmr.violations


def test_master_hears_emergencies(node: Any, ltmr: PlayedDrive, states: list[int]) -> None:
    start(node, states)
    ltmr.fault('trip')
    wait_for(lambda: node.emcy.active, 'an emergency')
    emergency, = node.emcy.active
    assert (emergency.code, emergency.register) == (0xFF00, 0x81)
    assert emergency.data == b'\x0A\0\0\0\0'
    assert emergency.get_desc() == 'Device Specific'
    assert node.sdo.upload(0x1001, 0) == b'\x81'
    node.sdo[0x2008][5].raw = 8
    wait_for(lambda: not node.emcy.active, 'the end of the emergency')
    assert node.sdo.upload(0x1001, 0) == b'\0'


# -- the other stack as node ----------------------------------------------------------------------


class Registers:
    """The mailbox of a node played by the other stack: literal bytes, nothing of ours."""

    def __init__(self, network: Any, node: Any) -> None:
        self._network = network
        self._node = node
        self._function = 0
        self.words = {455: 0x0041, 652: 33, 704: 0}
        self.silent = False
        self.heard_while_not_operational = 0
        network.subscribe(0x500 + NODE, self._heard)

    def _heard(self, _: int, data: bytearray, __: float) -> None:
        if self._node.nmt.state != 'OPERATIONAL':
            self.heard_while_not_operational += 1
            return
        if data[3] == self._function:
            return
        self._function = data[3]
        register, code = data[0] + 256 * data[1], data[3] & 0x7F
        answer = bytes(data[:4]) + bytes(4)
        if code == 0x25:
            word = self.words[register]
            answer = bytes(data[:4]) + bytes((word % 256, word // 256, 0, 0))
        elif code == 0x2A and register in self.words:
            self.words[register] = data[4] + 256 * data[5]
            # run forward: ready, on, running
            self.words[455] = 0x00C3 if self.words[704] & 1 else 0x0041
        elif code:
            answer = bytes((*data[:3], data[3] & 0x80 | 0x4E)) + b'\x00\x00\x02\x06'
        if not self.silent:
            self._network.send_message(0x480 + NODE, answer)

    def restart(self) -> None:
        """Begin anew as a device does that has lost its power."""
        self._function = 0
        self.words.update({455: 0x0041, 704: 0})


def bridge_on(channel: str, **options: Any) -> Bridge:
    return Bridge(bus_of(channel), ltmr_configuration(
        period=0.05, parameter_timeout=0.5, control_timeout=DEADLINE, missed_limit=5, **options))


@pytest.fixture
def local(network: Any) -> Any:
    """Return a node of the other stack, with heartbeats every 50 ms; not started yet."""
    od = dictionary_of({0x1017: ('heartbeat', U16)}, {})
    od[0x1017].default = 50
    return network.create_node(NODE, od)


def boot(local: Any) -> None:
    """Let the node send its boot-up frame, and heartbeats from then on."""
    local.nmt.state = 'INITIALISING'
    local.nmt.state = 'PRE-OPERATIONAL'


@pytest.fixture
def registers(network: Any, local: Any) -> Registers:
    return Registers(network, local)


def test_bridge_starts_a_node_and_follows_its_state(channel: str, local: Any,
                                                    registers: Registers) -> None:
    with bridge_on(channel) as bridge:
        assert not bridge.session.online
        boot(local)
        bridge.online()
        assert local.nmt.state == 'OPERATIONAL'
        wait_for(lambda: bridge.facts('nmt_state') == 'operational', 'the state')
        wait_for(lambda: (0x0041,) in bridge.samples, 'a sample')
        # somebody stops it: the bridge starts it again
        for name in ('STOPPED', 'PRE-OPERATIONAL'):
            local.nmt.state = name
            wait_for(lambda: local.nmt.state == 'OPERATIONAL', f'a start after {name}')
        bridge.online()
        wait_for(lambda: bridge.facts('nmt_state') == 'operational', 'the state')


def test_bridge_that_does_not_start_anybody(channel: str, local: Any, registers: Registers,
                                            network: Any) -> None:
    commands: list[bytes] = []
    network.subscribe(0, lambda _, data, __: commands.append(bytes(data)))
    with bridge_on(channel, nmt_start=False) as bridge:
        boot(local)
        wait_for(lambda: bridge.facts('nmt_state') == 'pre-operational', 'the state')
        assert not bridge.session.online
        local.nmt.state = 'OPERATIONAL'
        bridge.online()
        local.nmt.state = 'STOPPED'
        wait_for(lambda: bridge.facts('nmt_state') == 'stopped', 'the state')
        bridge.online(False)
    assert commands == []


def test_bridge_uses_the_mailbox_of_a_node(channel: str, local: Any,
                                           registers: Registers) -> None:
    with bridge_on(channel) as bridge:
        boot(local)
        bridge.online()
        ratio = LTMR.parameters['flc1_ratio']
        assert bridge.outcome(read(ratio)) == [33]
        assert bridge.outcome(write((ratio, 60))) == ['written']
        assert registers.words[652] == 60
        trip_class = LTMR.parameters['motor_trip_class']
        (refusal,) = bridge.outcome(write((trip_class, 10)))
        assert '06020000h' in str(refusal)
        assert bridge.control(ControlAction.ENABLE)
        assert registers.words[704] == 1
        assert bridge.control(ControlAction.DISABLE)
        assert registers.words[704] == 0


def test_bridge_sees_a_restart(channel: str, local: Any, registers: Registers) -> None:
    with bridge_on(channel) as bridge:
        boot(local)
        bridge.online()
        assert bridge.control(ControlAction.ENABLE)
        lost = len(bridge.events)
        registers.restart()
        boot(local)
        wait_for(lambda: any(type(event).__name__ == 'StationLost'
                             for event in bridge.events[lost:]), 'the drive to be lost')
        bridge.online()
        # nothing but a new enable starts it
        seen = len(bridge.samples)
        wait_for(lambda: len(bridge.samples) > seen + 3, 'samples')
        assert registers.words[704] == 0
        assert bridge.control(ControlAction.ENABLE)


def test_bridge_misses_heartbeats(channel: str, local: Any, registers: Registers) -> None:
    with bridge_on(channel, heartbeat_timeout=1.0) as bridge:
        boot(local)
        bridge.online()
        local.nmt.stop_heartbeat()
        bridge.online(False)
        local.nmt.start_heartbeat(50)
        bridge.online()


def test_bridge_shows_emergencies(channel: str, local: Any, registers: Registers) -> None:
    with bridge_on(channel) as bridge:
        boot(local)
        bridge.online()
        before = bridge.facts('emergency')
        local.emcy.send(0x2310, 0x03, b'\x01\x02\0\0\0')
        wait_for(lambda: '2310h' in bridge.facts('emergency'), 'the emergency')
        assert 'current' in bridge.facts('emergency')
        assert bridge.session.warning
        local.emcy.reset()
        wait_for(lambda: bridge.facts('emergency') == before, 'the end of the emergency')
        assert not bridge.session.warning
        assert bridge.session.online
