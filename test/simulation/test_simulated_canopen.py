# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What a further CANopen family needs in the simulation: rules of its control word, and a PDO.

The drive here is one of CiA 402: control word 6040h, status word 6041h, both and a speed in PDO1.
"""

from collections.abc import Iterable, Sequence

import builders
from ltmr_builders import frame
import pytest

from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.protocols.canopen.network import NmtState
from drive_can_bridge.simulation.canopen.node import CanopenNode, Contents
from drive_can_bridge.simulation.canopen.sdo import ObjectDictionary
from drive_can_bridge.simulation.control import FAULTS, Machine, Operation, Rule, State
from drive_can_bridge.simulation.drive import SimulatedDrive
from drive_can_bridge.simulation.motor import MotorPlant
from drive_can_bridge.simulation.registers import PlantFactory

OFF, READY, ON, ENABLED, STOPPING = (
    State.SWITCH_ON_DISABLED, State.READY_TO_SWITCH_ON, State.SWITCHED_ON,
    State.OPERATION_ENABLED, State.QUICK_STOP)
MACHINE = Machine((
    Rule(FAULTS, 0, 0, None),
    Rule(None, 0x02, 0, OFF),
    Rule((ENABLED, STOPPING), 0x04, 0, STOPPING),
    Rule(None, 0x04, 0, OFF),
    Rule((STOPPING,), 0, 0, None),
    Rule(None, 0x01, 0, READY),
    Rule((OFF,), 0, 0, None),
    Rule((READY,), 0, 0, ON),           # one state at a time
    Rule(None, 0x08, 0, ON),
    Rule(None, 0, 0, ENABLED),
), reset=(0x80, 0x80))
STATUS = {OFF: 0x0250, READY: 0x0231, ON: 0x0233, ENABLED: 0x0237, STOPPING: 0x0217,
          State.FAULT: 0x0218}

SPEED, ACTUAL, LIMIT = (
    Parameter(name, ParameterType.INT16, index=index, subindex=0, unit='rpm', scaled=True, **more)
    for name, index, more in (
        ('target_speed', 0x6042, {'minimum': -3000.0, 'maximum': 3000.0, 'neutral': 0.0}),
        ('actual_speed', 0x6044, {'access': builders.RO}), ('speed_limit', 0x6080, {})))


class Cia402Drive(SimulatedDrive):
    """Answers each RPDO1 with its TPDO1."""

    table: ObjectDictionary

    def set_up(self) -> None:
        self.table = ObjectDictionary(self.registers)
        self.node = self.companion = CanopenNode(
            self, self.table, constants=self.constants, trip_code=0)

    def choose_plant(self) -> PlantFactory:
        return lambda *made: MotorPlant(*made, operation=Operation(MACHINE))

    def find_routes(self) -> list[Route]:
        station = self.configuration.station
        return CanopenNode.routes(station, 0x200 + station, 0x180 + station)

    def receive(self, frame: Frame, now: float) -> bool:
        identifier, data, extended = frame
        if identifier != 0x200 + self.node.number or extended:
            return False
        if self.node.state is NmtState.OPERATIONAL:
            self.requests += 1
            speed = SPEED.raw_from_word(int.from_bytes(data[2:4], 'little'))
            self.registers.write('target_speed', self.registers.clamped('target_speed', speed))
            self.plant.operation.word_written(int.from_bytes(data[:2], 'little'))
            self.plant.advance(now)
            self.answer(Frame(0x180 + self.node.number, self.status() + self.table.read_object(
                0x6044, 0), False), now)
        return True

    def status(self) -> bytes:
        return STATUS[self.plant.operation.state].to_bytes(2, 'little')

    def constants(self) -> Contents:
        return {(0x1000, 0): b'\x92\x01\x01\0', (0x6041, 0): self.status()}

    def foreign_frames(self, answer: Frame) -> Sequence[Iterable[Frame]]:
        return ((answer._replace(extended=True),),)


class Line:
    """A drive at node 5, operational, in candump's notation and literal times."""

    def __init__(self) -> None:
        self.drive = Cia402Drive(builders.drive(
            'canopen_pkw', station=5, table=(SPEED, ACTUAL, LIMIT), request=(SPEED,),
            response=(ACTUAL,), heartbeat_timeout=3.0))
        self.drive.handle_timer(0.0)
        assert self.sent() == ['705#00']
        assert self.ask('000#0105', 0.0) == []

    def sent(self) -> list[str]:
        return [str(answer) for answer in self.drive.take_frames()]

    def ask(self, text: str, now: float) -> list[str]:
        self.drive.receive_frame(frame(text), now)
        return self.sent()


def test_runs_to_its_setpoint_and_stops_quickly() -> None:
    line = Line()
    assert line.ask('205#0600E803', 0.0) == ['185#31020000']
    assert line.ask('205#0F00E803', 0.0) == ['185#33020000']
    assert line.ask('205#0F00E803', 0.0) == ['185#37020000']
    # 3000 rpm in a second: 1000 rpm
    assert line.ask('205#0F00E803', 1.0) == ['185#3702E803']
    # without the quick stop bit it goes to 0 in 0.2 s / 3, and only a new start helps then
    assert line.ask('205#0B00E803', 1.0) == ['185#1702E803']
    assert line.ask('205#0B00E803', 1.1) == ['185#50020000']
    assert line.ask('205#0F00E803', 1.2) == ['185#50020000']
    assert line.ask('205#0600E803', 1.2) == ['185#31020000']


def test_objects_and_those_of_every_node() -> None:
    line = Line()
    assert line.ask('605#4000100000000000', 0.0) == ['585#4300100092010100']
    assert line.ask('605#4041600000000000', 0.0) == ['585#4B41600050020000']
    assert line.ask('605#2B426000F4010000', 0.0) == ['585#6042600000000000']
    assert line.drive.value('target_speed') == 500.0
    assert line.ask('605#2B44600001000000', 0.0) == ['585#8044600002000106']
    assert line.ask('605#2F42600001000000', 0.0) == ['585#8042600013000706']
    assert line.ask('605#4045600000000000', 0.0) == ['585#8045600000000206']


def test_trip_tells_at_once_and_is_reset_by_a_rising_edge() -> None:
    line = Line()
    for word in ('0600', '0F00', '0F00'):
        line.ask(f'205#{word}0000', 0.0)
    line.drive.fault('trip=1', 0.5)
    assert line.sent() == ['085#00FF810000000000']
    assert line.ask('205#80000000', 0.6) == ['185#18020000']
    assert line.ask('205#00000000', 1.6) == ['185#18020000']
    assert line.ask('205#80000000', 1.7) == ['185#50020000', '085#0000000000000000']


def test_pdos_count_in_operational_only_and_a_reset_boots_anew() -> None:
    line = Line()
    line.ask('000#8005', 0.1)
    assert line.ask('205#06000000', 0.1) == []
    assert line.ask('000#8105', 0.2) == []
    assert line.drive.next_timer() == pytest.approx(0.25)
    line.drive.handle_timer(0.25)
    assert line.sent() == ['705#00']
    # a third of the time after which the bridge misses it
    line.drive.handle_timer(1.25)
    assert line.sent() == ['705#7F']


def test_who_answers_has_sent_its_boot_up_frame() -> None:
    line = Line()
    line.ask('000#8105', 0.2)
    # its timer was not served yet
    assert line.ask('605#4041600000000000', 0.26) == ['705#00', '585#4B41600050020000']


def test_faults_of_its_answers() -> None:
    line = Line()
    line.drive.fault('foreign', 0.0)
    assert line.ask('205#06000000', 0.0) == ['00000185#31020000', '185#31020000']
    line.drive.fault('silent', 0.0)
    assert line.ask('605#4000100000000000', 0.0) == []
    assert line.ask('185#31020000', 0.0) == []
    assert line.drive.violations == {'frame that only this drive may send': 1}
