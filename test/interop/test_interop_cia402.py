# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
CiA 402 against a CANopen stack that nobody here wrote: the package ``canopen``.

Its node of profile 402 drives our simulated drive: it maps PDOs, walks states, sets modes, homes.
It is no dependency of the bridge: without it these tests skip.
"""

from collections.abc import Iterator
import itertools
from typing import Any

from builders import drive
from clocks import REAL
import pytest
from waiting import wait_for

from drive_can_bridge.configuration.profiles import read_profile
from drive_can_bridge.core.configuration import BridgeConfiguration, BusConfiguration
from drive_can_bridge.resources import profiles_directory
from drive_can_bridge.simulation.simulation import PlayedDrive, Simulation

canopen = pytest.importorskip('canopen')
objectdictionary = pytest.importorskip('canopen.objectdictionary')
p402 = pytest.importorskip('canopen.profiles.p402')

NODE = 5
#: s after which a thing that has not happened never will
DEADLINE = 30.0
PERIOD = 0.02
SERVO = read_profile(profiles_directory() / 'cia402_servo.yaml').profile
_CHANNELS = itertools.count(1)
_U8, _I8, _U16, _I16, _U32, _I32 = (
    objectdictionary.UNSIGNED8, objectdictionary.INTEGER8, objectdictionary.UNSIGNED16,
    objectdictionary.INTEGER16, objectdictionary.UNSIGNED32, objectdictionary.INTEGER32)
#: what a master of a CiA 402 drive knows of it, in the words of that standard
VARIABLES = {
    0x1000: ('Device type', _U32), 0x1017: ('Producer heartbeat time', _U16),
    0x603F: ('Error code', _U16), 0x6040: ('Controlword', _U16), 0x6041: ('Statusword', _U16),
    0x605A: ('Quick stop option code', _I16), 0x6060: ('Modes of operation', _I8),
    0x6061: ('Modes of operation display', _I8), 0x6064: ('Position actual value', _I32),
    0x606C: ('Velocity actual value', _I32), 0x6071: ('Target torque', _I16),
    0x607A: ('Target position', _I32), 0x607C: ('Home offset', _I32),
    0x6081: ('Profile velocity', _U32), 0x6098: ('Homing method', _I8),
    0x60FF: ('Target velocity', _I32), 0x6502: ('Supported drive modes', _U32)}
ENTRIES = {'communication': {0: _U8, 1: _U32, 2: _U8, 3: _U16, 5: _U16},
           'mapping': {0: _U8, **dict.fromkeys(range(1, 9), _U32)}}


def dictionary() -> Any:
    """Return an object dictionary with those, PDOs, and the list of watched nodes."""
    od = objectdictionary.ObjectDictionary()

    def variable(name: str, index: int, subindex: int, data_type: int) -> Any:
        made = objectdictionary.ODVariable(name, index, subindex)
        made.data_type = data_type
        return made

    for index, (name, data_type) in VARIABLES.items():
        od.add_object(variable(name, index, 0, data_type))
    records = {0x1016: {0: _U8, 1: _U32}, 0x1018: {0: _U8, 1: _U32, 2: _U32, 3: _U32, 4: _U32},
               0x60C2: {0: _U8, 1: _U8, 2: _I8}}
    for number in range(4):
        for base, kind in ((0x1400, 'communication'), (0x1600, 'mapping'),
                           (0x1800, 'communication'), (0x1A00, 'mapping')):
            records[base + number] = ENTRIES[kind]
    for index, entries in records.items():
        record = objectdictionary.ODRecord(f'object {index:X}', index)
        for subindex, data_type in entries.items():
            record.add_member(variable(f'entry {subindex}', index, subindex, data_type))
        od.add_object(record)
    return od


@pytest.fixture
def channel() -> str:
    """Return a channel of python-can's virtual bus that nobody else uses."""
    return f'interop 402 {next(_CHANNELS)}'


@pytest.fixture
def network(channel: str) -> Iterator[Any]:
    """Return a network of the other stack on the bus."""
    connected = canopen.Network()
    connected.NOTIFIER_CYCLE = 0.05
    connected.connect(interface='virtual', channel=channel)
    yield connected
    connected.sync.stop()
    connected.disconnect()


def bus_of(channel: str) -> BusConfiguration:
    return BusConfiguration('main', 'virtual', channel, bitrate=1_000_000, reconnect_period=0.05)


def names(*wanted: str) -> tuple[Any, ...]:
    return tuple(SERVO.parameters[name] for name in wanted)


# -- the other stack as master --------------------------------------------------------------------


@pytest.fixture
def servo(channel: str) -> Iterator[PlayedDrive]:
    """Return a simulated drive on the bus, as it leaves the factory."""
    configuration = drive(
        'cia402', name='axis', station=NODE, table=SERVO.parameters.values(), period=PERIOD,
        request=names('target_velocity'), response=names('actual_velocity'), mode='csv')
    with Simulation(BridgeConfiguration(
            buses={'main': bus_of(channel)}, drives={'axis': configuration}),
            REAL) as simulation:
        yield simulation.drives['axis']
    assert not simulation.failure


@pytest.fixture
def node(network: Any, servo: PlayedDrive) -> Any:
    """Return the drive as the other stack's master sees it, mapped by it and started."""
    remote = p402.BaseNode402(NODE, dictionary())
    remote.sdo.RESPONSE_TIMEOUT = DEADLINE
    for name in ('RESET_FAULT', 'SWITCH_OP_MODE', 'SWITCH_STATE_FINAL', 'SWITCH_STATE_SINGLE',
                 'CHECK_TPDO'):
        setattr(remote, f'TIMEOUT_{name}', DEADLINE)
    network.add_node(remote)
    remote.nmt.state = 'PRE-OPERATIONAL'
    remote.sdo[0x1017].raw = 100
    remote.nmt.wait_for_heartbeat(DEADLINE)
    remote.rpdo.read()
    remote.tpdo.read()
    for pdo, variables in ((remote.rpdo[1], (0x6040, 0x60FF)),
                           (remote.tpdo[1], (0x6041, 0x6061)),
                           (remote.tpdo[2], (0x6064, 0x606C))):
        pdo.clear()
        for index in variables:
            pdo.add_variable(index)
        pdo.trans_type = 1
        pdo.enabled = True
        pdo.save()
    remote.setup_402_state_machine()
    remote.nmt.state = 'OPERATIONAL'
    network.sync.start(PERIOD)
    remote.rpdo[1].start(PERIOD)
    return remote


def test_master_sees_a_drive_of_its_profile(node: Any, servo: PlayedDrive) -> None:
    assert node.sdo[0x1000].raw & 0xFFFF == 402
    assert node.sdo.upload(0x1008, 0) == b'simulated CiA 402 servo drive'
    for mode in ('PROFILED POSITION', 'VELOCITY', 'PROFILED VELOCITY', 'PROFILED TORQUE',
                 'HOMING', 'INTERPOLATED POSITION', 'CYCLIC SYNCHRONOUS POSITION',
                 'CYCLIC SYNCHRONOUS VELOCITY', 'CYCLIC SYNCHRONOUS TORQUE'):
        assert node.is_op_mode_supported(mode)
    with pytest.raises(canopen.SdoAbortedError) as refused:
        node.sdo[0x6060].raw = 5
    assert refused.value.code == 0x06090030
    assert not servo.violations


def test_master_walks_states_and_sets_modes(node: Any, servo: PlayedDrive) -> None:
    assert node.state == 'SWITCH ON DISABLED'
    for mode in ('PROFILED VELOCITY', 'CYCLIC SYNCHRONOUS VELOCITY'):
        node.op_mode = mode
        assert node.op_mode == mode
    for state in ('READY TO SWITCH ON', 'SWITCHED ON', 'OPERATION ENABLED', 'SWITCHED ON',
                  'READY TO SWITCH ON', 'SWITCH ON DISABLED', 'OPERATION ENABLED'):
        node.state = state
        wait_for(lambda state=state: node.state == state, state)
    node.rpdo[1]['Target velocity'].raw = 5000
    wait_for(lambda: node.tpdo[2]['Velocity actual value'].raw == 5000, 'the speed')
    wait_for(lambda: node.tpdo[2]['Position actual value'].raw > 14_000, 'the way')
    node.sdo[0x605A].raw = 6
    node.state = 'QUICK STOP ACTIVE'
    wait_for(lambda: node.tpdo[2]['Velocity actual value'].raw == 0, 'standstill')
    assert node.state == 'QUICK STOP ACTIVE'
    node.state = 'SWITCH ON DISABLED'
    assert not servo.violations


def test_master_hears_a_fault_and_resets_it(node: Any, servo: PlayedDrive) -> None:
    node.state = 'OPERATION ENABLED'
    servo.fault('trip')
    wait_for(node.is_faulted, 'the fault')
    wait_for(lambda: node.emcy.active, 'an emergency')
    assert node.emcy.active[0].code == node.sdo[0x603F].raw == 0x2310
    node.controlword = 0x80
    wait_for(lambda: node.state == 'SWITCH ON DISABLED', 'the reset')
    wait_for(lambda: not node.emcy.active, 'the end of the emergency')


def test_master_homes(node: Any, servo: PlayedDrive) -> None:
    node.sdo[0x6098].raw = 17
    assert node.sdo[0x6064].raw == 12_345
    assert node.homing(timeout=DEADLINE)
    assert node.sdo[0x6064].raw == 0


def test_master_is_missed(node: Any, network: Any, servo: PlayedDrive) -> None:
    node.op_mode = 'CYCLIC SYNCHRONOUS VELOCITY'
    node.state = 'OPERATION ENABLED'
    node.rpdo[1]['Target velocity'].raw = 5000
    node.sdo[0x1016][1].raw = 0x70 << 16 | 300
    network.send_message(0x770, b'\x05')
    # one heartbeat, and no second one: SYNC and PDOs go on
    wait_for(node.is_faulted, 'the fault')
    assert node.sdo[0x603F].raw == 0x8130
    wait_for(lambda: node.tpdo[2]['Velocity actual value'].raw == 0, 'standstill')
