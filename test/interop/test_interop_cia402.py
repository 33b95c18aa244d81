# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
CiA 402 against a CANopen stack that nobody here wrote: the package ``canopen``.

Its node of profile 402 drives our simulated drive: it maps PDOs, walks states, sets modes, homes.
And a device made of its SDO server and its PDOs is driven by our bridge. It is no dependency of
the bridge: without it these tests skip.
"""

from collections.abc import Iterator
from functools import partial
import os
from pathlib import Path
from typing import Any

import can
from interop_bridge import DEADLINE, dictionary_of, objectdictionary
from interop_servo import (
    bridge_on, bus_of, command, NODE, obeyed, parameters_go_both_ways,
    PERIOD, servo_configuration,
)
import pytest
from waiting import clock, wait_for
from world import World

from drive_can_bridge.core.configuration import BridgeConfiguration, BusConfiguration
from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.simulation.simulation import PlayedDrive, Simulation
from drive_can_bridge.simulation.terminal import SlcanTerminal

canopen = pytest.importorskip('canopen')
p402 = pytest.importorskip('canopen.profiles.p402')

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
    records = {0x1016: {0: _U8, 1: _U32}, 0x1018: {0: _U8, 1: _U32, 2: _U32, 3: _U32, 4: _U32},
               0x60C2: {0: _U8, 1: _U8, 2: _I8}}
    for number in range(4):
        for base, kind in ((0x1400, 'communication'), (0x1600, 'mapping'),
                           (0x1800, 'communication'), (0x1A00, 'mapping')):
            records[base + number] = ENTRIES[kind]
    return dictionary_of(VARIABLES, records)


# -- the other stack as master --------------------------------------------------------------------


@pytest.fixture
def servo(channel: str) -> Iterator[PlayedDrive]:
    """Return a simulated drive on the bus, as it leaves the factory."""
    with Simulation(BridgeConfiguration(
            buses={'main': bus_of(channel)}, drives={'axis': servo_configuration()}),
            clock()) as simulation:
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
    wait_for(lambda: remote.statusword, 'a status word')
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


# -- the other stack as device --------------------------------------------------------------------

VCAN = os.environ.get('DRIVE_CAN_SOCKETCAN', 'vcan0')
on_socketcan = (
    pytest.mark.socketcan,
    pytest.mark.skipif(not Path('/sys/class/net', VCAN).exists(),
                       reason=f'no SocketCAN interface {VCAN}; name one by DRIVE_CAN_SOCKETCAN'))


class TerminalBus(can.BusABC):
    """The far side of a serial adapter, for the other stack: what a client sends to it."""

    def __init__(self, terminal: SlcanTerminal) -> None:
        super().__init__(channel=terminal.path)
        self.channel_info = terminal.path
        self._terminal = terminal

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self._terminal.send(Frame(msg.arbitration_id, bytes(msg.data), msg.is_extended_id), 1.0)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        frame = self._terminal.receive(timeout or 0.0)
        return None if frame is None else can.Message(
            arbitration_id=frame.identifier, data=frame.data,
            is_extended_id=frame.extended), False


@pytest.fixture(params=[
    'virtual', pytest.param('serial', marks=pytest.mark.real),
    pytest.param('socketcan', marks=on_socketcan)])
def place(request: pytest.FixtureRequest, channel: str, world: World | None,
          ) -> Iterator[tuple[BusConfiguration, Any]]:
    """Return a bus as the bridge opens it, and a network of the other stack on it."""
    connected = canopen.Network()
    connected.NOTIFIER_CYCLE = 0.05
    terminal = None
    bus = bus_of(channel)
    if request.param == 'serial':
        terminal = SlcanTerminal(clock().now, 1_000_000)
        bus = BusConfiguration('main', 'slcan', terminal.path, bitrate=1_000_000,
                               reconnect_period=0.05)
        connected.bus = TerminalBus(terminal)
    elif request.param == 'socketcan':
        bus = BusConfiguration('main', 'socketcan', VCAN, bitrate=1_000_000, reconnect_period=0.05)
    if world is not None:
        from canopen_bench import connect
        connect(connected, world, channel)
    else:
        connected.connect(interface=bus.interface, channel=bus.channel)
    if request.param == 'socketcan':    # heartbeats from a thread: this kernel may have no can-bcm
        connected.bus._send_periodic_internal = partial(
            can.BusABC._send_periodic_internal, connected.bus)
    yield bus, connected
    connected.disconnect()
    if terminal is not None:
        terminal.close()


class Device:
    """
    A drive of velocities, at once: SDO server, NMT and PDOs are the other stack's.

    :ivar words: control words that it was sent, each once in a row.
    """

    def __init__(self, network: Any) -> None:
        od = dictionary()
        for entries in od.values():
            for entry in getattr(entries, 'values', lambda each=entries: [each])():
                entry.default = 0
        for number in range(4):
            for base, cob_id in ((0x1400, 0x200), (0x1800, 0x40000180)):
                od[base + number][1].default = cob_id + 0x100 * number + NODE | 1 << 31
        for index, value in ((0x1000, 0x20192), (0x605A, 2), (0x6502, 0x3EF), (0x1017, 50)):
            od[index].default = value
        od[0x1018][1].default = 0x555
        od[0x1016][0].default = 1
        self.node = network.create_node(NODE, od)
        self.state, self.target, self.words = 0x40, 0, [0]
        self.node.add_write_callback(self._written)
        network.subscribe(0x080, self._synchronise)

    def boot(self) -> None:
        """Send the boot-up frame, and heartbeats from then on."""
        self.state = 0x40
        self.node.data_store.clear()
        self.node.nmt.state = 'INITIALISING'
        self.node.nmt.state = 'PRE-OPERATIONAL'

    def _written(self, index: int, od: Any, data: bytes, **_: Any) -> None:
        if index == 0x6040:
            self._obey(int.from_bytes(data, 'little'))
        elif index == 0x6060:
            self.node.set_data(0x6061, 0, data)

    def _synchronise(self, *_: Any) -> None:
        if self.node.nmt.state != 'OPERATIONAL':
            return
        into, out = self.node.rpdo[1], self.node.tpdo[1]
        if not into.enabled or not len(into) or not len(out):
            self.node.rpdo.read()
            self.node.tpdo.read()
            return
        self.target = into['Target velocity'].raw
        self._obey(into['Controlword'].raw)
        out['Statusword'].raw = 0x0210 | self.state
        out['Velocity actual value'].raw = self.target if self.state == 0x27 else 0
        out.transmit()

    def _obey(self, word: int) -> None:
        if word != self.words[-1]:
            self.words.append(word)
        self.state = obeyed(self.state, word)


def test_bridge_drives_a_device_of_the_other_stack(place: tuple[BusConfiguration, Any]) -> None:
    bus, network = place
    device = Device(network)
    device.boot()
    with bridge_on(bus) as bridge:
        bridge.online()
        # what it had written there
        sdo = device.node.sdo
        assert [sdo[0x1600][n].raw for n in range(3)] == [2, 0x60400010, 0x60FF0020]
        assert [sdo[0x1A00][n].raw for n in range(3)] == [2, 0x60410010, 0x606C0020]
        assert (sdo[0x1800][1].raw, sdo[0x1800][2].raw) == (0x40000185, 1)
        assert sdo[0x6060].raw == 9
        assert sdo[0x1016][1].raw == 0x7F << 16 | 600
        assert sdo[0x60C2][1].raw * 10.0 ** sdo[0x60C2][2].raw == pytest.approx(PERIOD)
        assert set(device.words) <= {0, 6, 7}
        assert bridge.control(ControlAction.ENABLE)
        assert device.state == 0x27
        command(bridge, 0.0)
        command(bridge, 60.0)
        wait_for(lambda: bridge.samples[-1] == (0x0237, 10_000), 'the speed')
        parameters_go_both_ways(bridge)
        device.state = 0x08
        wait_for(lambda: bridge.samples[-1][0] == 0x0218, 'the fault')
        assert not bridge.control(ControlAction.ENABLE)
        assert bridge.control(ControlAction.RESET_FAULT)
        assert bridge.control(ControlAction.ENABLE)
    # the end: disabled, and nobody watches
    assert device.state != 0x27
    assert device.words[-1] in (6, 7)
    assert device.node.sdo[0x1016][1].raw == 0


def test_bridge_sets_a_device_up_again_that_has_started_anew(
        place: tuple[BusConfiguration, Any]) -> None:
    bus, network = place
    device = Device(network)
    device.boot()
    with bridge_on(bus) as bridge:
        bridge.online()
        assert bridge.control(ControlAction.ENABLE)
        device.boot()
        bridge.online(False)
        bridge.online()
        assert device.node.sdo[0x1600][1].raw == 0x60400010
        assert device.state != 0x27
        assert bridge.control(ControlAction.ENABLE)
