# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Drives played by threads: on python-can's virtual bus, on lost buses, by the console."""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
import os
from typing import Any

from builders import frame, INT16, parameter, RO
from clocks import REAL
from jumping import JumpingClock
import pytest
from simulation_builders import bridge, configuration, RULES
from transcripts import replayed, shown, stories
from waiting import wait_for
from world import World

from drive_can_bridge.cli.simulate import Console, LineReader
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import (
    BusMisconfigured, BusUnavailable, ConfigurationError, TransportError, ValueRefused,
)
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.simulation.motor import MotorPlant
from drive_can_bridge.simulation.registers import WriteRefusal
from drive_can_bridge.simulation.simulation import make_drives, Simulation
from drive_can_bridge.simulation.terminal import SlcanTerminal
from drive_can_bridge.transport.end_point import EndPoint

STORIES = stories(__file__, 'console.yaml')
#: what the simulation says of its bus
OPEN = 'bus main: open'
LOST = 'bus main: lost: {}; trying again every 0.05 s'
ABSENT = 'bus main: virtual x: absent; trying again every 0.05 s'
FULL = 'bus main: send: transmit queue full'
DEFECT = 'bus main: RuntimeError: a mistake of ours'

POLL = frame('003FFFF0#0000000000000000')
ANSWER = frame('103FFFF0#000000C80003A5A5')


class ScriptedPort(EndPoint):
    """An end point whose frames and failures come from the test."""

    def __init__(self, clock: JumpingClock) -> None:
        super().__init__()
        self._clock = clock
        self.incoming: deque[Frame | Exception] = deque()
        self.sent: list[Frame] = []
        self.send_failure: Exception | None = None
        self.closed = False
        self._wake = clock.wake_event()

    def put(self, item: Frame | Exception) -> None:
        self.incoming.append(item)
        self._wake.ring()

    def receive(self, timeout: float) -> Frame | None:
        if not self.incoming:
            self._wake.wait(self._clock.now() + timeout)
        if not self.incoming:
            return None
        item = self.incoming.popleft()
        if isinstance(item, Exception):
            raise item
        return item

    def send(self, frame: Frame, timeout: float) -> None:
        if self.send_failure is not None:
            failure, self.send_failure = self.send_failure, None
            raise failure
        self.sent.append(frame)

    def close(self) -> None:
        self.closed = True


class Scripted:
    """A simulation on scripted ports, with all that it says."""

    def __init__(self, clock: JumpingClock, *drives: Any,
                 failures: list[Exception] | None = None) -> None:
        self.clock = clock
        self.ports: list[ScriptedPort] = []
        self.failures = failures or []
        self.said: list[str] = []
        self.complaints: list[str] = []
        self.shown: list[tuple[str, str, bool]] = []
        self.simulation = Simulation(
            bridge(*drives), clock, open_bus=self.open, say=self.said.append,
            complain=self.complaints.append, show_frame=self.show)

    def open(self, bus: BusConfiguration) -> ScriptedPort:
        if self.failures:
            raise self.failures.pop(0)
        self.ports.append(ScriptedPort(self.clock))
        return self.ports[-1]

    def show(self, bus: str, shown: Frame, sent: bool) -> None:
        self.shown.append((bus, str(shown), sent))


@pytest.fixture
def scripted(bench: World) -> Iterator[Scripted]:
    made = Scripted(bench.clock, configuration(), configuration(name='lift', station=2))
    with made.simulation:
        yield made


def test_request_and_answer(scripted: Scripted) -> None:
    port = scripted.ports[0]
    port.put(POLL)
    port.put(frame('005FFFF0#0000000000000000'))
    wait_for(lambda: len(port.sent) == 2, 'answers')
    assert port.sent == [ANSWER, frame('105FFFF0#000000C80003A5A5')]
    assert scripted.shown == [
        ('main', '003FFFF0#0000000000000000', False), ('main', '103FFFF0#000000C80003A5A5', True),
        ('main', '005FFFF0#0000000000000000', False), ('main', '105FFFF0#000000C80003A5A5', True)]
    assert scripted.simulation.drives['lift'].requests == 1


def test_late_answers_come_by_themselves(scripted: Scripted) -> None:
    port = scripted.ports[0]
    scripted.simulation.drives['conveyor'].fault('late=0.2')
    begin = scripted.clock.now()
    port.put(POLL)
    wait_for(lambda: port.sent, 'answer')
    assert 0.2 <= scripted.clock.now() - begin < 0.21


def test_what_a_fault_makes_a_drive_send_is_sent_at_once(bench: World) -> None:
    made = Scripted(bench.clock, configuration((), protocol='cannord', station=100, request=(),
                                           response=()))
    with made.simulation:
        made.simulation.drives['conveyor'].fault('trip')
        wait_for(lambda: made.ports[0].sent == [frame('0C9#380B0000')], 'telegram')


def test_values_by_name(scripted: Scripted) -> None:
    conveyor = scripted.simulation.drives['conveyor']
    conveyor.set_value('speed_setpoint', 30.0)
    wait_for(lambda: conveyor.value('actual_speed') == 30.0, 'speed')
    conveyor.set_value('actual_speed', 5.0)
    assert conveyor.value('actual_speed') == 5.0
    conveyor.release('actual_speed')
    assert conveyor.value('actual_speed') == 30.0
    with pytest.raises(ValueRefused):
        conveyor.value('nonsense')


def test_faults_and_violations_are_said_once(scripted: Scripted) -> None:
    conveyor = scripted.simulation.drives['conveyor']
    conveyor.fault('silent')
    for _ in range(3):
        scripted.ports[0].put(frame('003001E0#0000000000000000'))
    rule = RULES['undefined']
    wait_for(lambda: conveyor.violations == {rule: 3}, 'violations')
    wait_for(lambda: len(scripted.said) == 2, 'lines')
    assert scripted.said == [
        f'conveyor: {text}' for text in ('fault silent', f'violation: {rule}')]
    assert conveyor.faults_text == 'silent'


def test_lost_bus_is_opened_again(scripted: Scripted) -> None:
    scripted.failures += [BusUnavailable('no such device'), BusMisconfigured('no driver')]
    scripted.ports[0].put(BusUnavailable('receive: unplugged'))
    wait_for(lambda: len(scripted.ports) == 2, 'second port')
    assert scripted.ports[0].closed
    scripted.ports[1].put(POLL)
    wait_for(lambda: scripted.ports[1].sent == [ANSWER], 'answer')
    assert scripted.complaints == [LOST.format('receive: unplugged'), OPEN]
    scripted.ports[1].send_failure = BusUnavailable('send: unplugged')
    scripted.ports[1].put(POLL)
    wait_for(lambda: len(scripted.ports) == 3, 'third port')
    assert scripted.complaints[2:3] == [LOST.format('send: unplugged')]


def test_answer_that_cannot_be_sent_is_lost(scripted: Scripted) -> None:
    port = scripted.ports[0]
    port.send_failure = TransportError('send: transmit queue full')
    port.put(POLL)
    port.put(POLL)
    wait_for(lambda: port.sent == [ANSWER], 'second answer')
    assert scripted.complaints == [FULL]


def test_bus_that_is_not_there_yet(bench: World) -> None:
    made = Scripted(bench.clock, failures=[BusUnavailable('virtual x: absent')] * 2)
    with made.simulation:
        wait_for(lambda: made.ports, 'port')
        wait_for(lambda: len(made.complaints) == 2, 'lines')
    assert made.complaints == [ABSENT, OPEN]
    assert made.ports[0].closed


def test_bus_that_will_never_open(bench: World) -> None:
    made = Scripted(bench.clock, failures=[BusMisconfigured('unknown interface')])
    with pytest.raises(BusMisconfigured):
        made.simulation.start()


def test_thread_that_fails_says_so(bench: World) -> None:
    made = Scripted(bench.clock)
    with made.simulation:
        made.ports[0].put(RuntimeError('a mistake of ours'))
        wait_for(lambda: made.simulation.failure, 'failure')
    assert made.complaints == [DEFECT]
    assert made.ports[0].closed


def test_age_of_a_frame_counts(bench: World) -> None:
    made = Scripted(bench.clock)
    with made.simulation:
        port = made.ports[0]
        # two writes to EEPROM, noticed at once but 30 ms apart on the wire
        port.age = 0.03
        port.put(frame('003001E1#00C8000000000000'))
        wait_for(lambda: made.simulation.drives['conveyor'].eeprom_writes == 1, 'write')
        port.age = 0.0
        port.put(frame('003001E1#012C000000000000'))
        wait_for(lambda: made.simulation.drives['conveyor'].eeprom_writes == 2, 'write')
        assert not made.simulation.drives['conveyor'].violations


class Clock(MotorPlant):
    """A plant that shows the time instead of a speed."""

    def source(self, parameter: Parameter) -> Callable[[], int] | None:
        if parameter.name == 'actual_speed':
            return lambda: round(self.operation.now) % 1000
        return super().source(parameter)


def test_a_plant_of_ones_own() -> None:
    made = make_drives(bridge(configuration(), configuration(name='lift', station=2)),
                       plants={'lift': Clock})
    for name in ('conveyor', 'lift'):
        made[name].handle_timer(123.0)
    assert made['lift'].value('actual_speed') == pytest.approx(12.3)
    assert made['conveyor'].value('actual_speed') == 0.0
    with pytest.raises(ConfigurationError, match='mixer: an inverter needs an InverterPlant'):
        make_drives(bridge(configuration(name='mixer', protocol='cannord', request=(),
                                         response=())), plants={'mixer': MotorPlant})


@pytest.mark.parametrize('protocol', [name for name, family in FAMILIES.items()
                                      if family.mode_key is None])  # a mode needs its setpoint
def test_any_profile_is_plain_memory_at_least(protocol: str) -> None:
    table = [parameter('blue', 10, type=INT16, minimum=-5, maximum=50), parameter('green', 11),
             parameter('red', 12, access=RO, unit='furlong')]
    made = make_drives(bridge(configuration(table, protocol=protocol, request=(), response=(
        replace(table[2], number=None if FAMILIES[protocol].control_built_in else 12),),
        )))['conveyor']
    before = made.value('red')
    made.registers.write('blue', -3)
    assert (made.value('blue'), made.value('red')) == (-3, before)
    assert made.registers.refusal({'blue': 51}) is WriteRefusal.OUT_OF_RANGE
    assert made.registers.refusal({'red': 1}) is WriteRefusal.READ_ONLY
    made.fault('restart=0', 1.0)
    assert made.value('blue') == -3


class TestConsole:

    @pytest.fixture
    def lines(self, scripted: Scripted) -> Any:
        said: list[str] = []
        complaints: list[str] = []
        console = Console(scripted.simulation, say=said.append, complain=complaints.append)

        def obey(line: str) -> tuple[list[str], list[str]]:
            said.clear()
            complaints.clear()
            console.obey(line)
            return list(said), list(complaints)
        return obey

    @pytest.mark.parametrize('story', STORIES)
    def test_lines(self, story: str, lines: Any) -> None:
        def step(step: str) -> list[str]:
            return shown(*lines(step))
        assert replayed(STORIES[story], step) == STORIES[story]

    def test_spaces_and_line_ends_do_not_count(self, lines: Any, scripted: Scripted) -> None:
        assert lines('conveyor silent') == ([], [])
        assert scripted.simulation.drives['conveyor'].faults_text == 'silent'
        assert lines('  conveyor   ok \r') == ([], [])
        assert scripted.simulation.drives['conveyor'].faults_text == 'ok'

    def test_help_and_nothing(self, lines: Any) -> None:
        assert '  drop=N                 every Nth answer is lost (1: all)' in lines('help')[0]
        assert lines('') == ([], [])

    def test_status_shows_wear(self, lines: Any, scripted: Scripted) -> None:
        conveyor = scripted.simulation.drives['conveyor']
        scripted.ports[0].put(frame('003001E1#00C8000000000000'))
        wait_for(lambda: conveyor.eeprom_writes == 1, 'write')
        assert conveyor.wear == {'ramp_time': 1}
        wear = 'conveyor: EEPROM writes: ramp_time 1'
        assert lines('status')[0][1:] == [wear, lines('lift')[0][0]]
        assert lines('conveyor')[0][1:] == [wear]
        assert lines('list')[0][1:] == [lines('lift')[0][0]]

    def test_standard_input(self, monkeypatch: pytest.MonkeyPatch) -> None:
        reading, writing = os.pipe()
        with os.fdopen(reading) as stream:
            monkeypatch.setattr('sys.stdin', stream)
            reader = LineReader()
            assert reader.fileno == reading
            os.write(writing, b'list\nhe')
            assert reader.read_lines() == ['list']
            os.write(writing, b'lp \xff')
            assert reader.read_lines() == []
            os.close(writing)
            assert reader.read_lines() == ['help \N{REPLACEMENT CHARACTER}']
            assert (reader.fileno, reader.read_lines()) == (None, [])

    def test_terminal_of_others_is_left_alone(self, monkeypatch: pytest.MonkeyPatch) -> None:
        # reading from it would stop a process in the background
        terminal = SlcanTerminal(REAL.now)
        with open(terminal.path, encoding='ascii') as stream:
            monkeypatch.setattr('sys.stdin', stream)
            assert LineReader().fileno is None
        terminal.close()

    def test_no_standard_input(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr('sys.stdin', None)
        assert LineReader().fileno is None

    def test_a_line_counts_as_a_whole(self, lines: Any, scripted: Scripted) -> None:
        faults = 'silent nonsense'
        assert len(lines(f'lift {faults}')[1]) == 1
        assert scripted.simulation.drives['lift'].faults_text == 'ok'
