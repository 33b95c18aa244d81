# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What the bridge counts, and what a witness counts of the same conversation, agree.

Sessions and simulated drives of all families on the bench; drives fall silent and come back. What
was on the wire is the trace, which afterwards is read from a file.
"""

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
from statistics import median

from jumping import EPOCH
import pytest
from waiting import wait_for
from world import world

from drive_can_bridge.clock import Clock
from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.core.events import Event, RequestCompleted
from drive_can_bridge.core.frame import Record
from drive_can_bridge.core.requests import ReadRequest
from drive_can_bridge.exchange.exchange import BusExchange
from drive_can_bridge.protocols.families import FAMILIES, make_sessions
from drive_can_bridge.resources import config_file
from drive_can_bridge.simulation.simulation import Simulation
from drive_can_bridge.trace.files import read_records
from drive_can_bridge.trace.sinks import LineWriter, Selection
from drive_can_bridge.trace.tracer import Tracer
from drive_can_bridge.trace.writers import TraceWriter


class Listener:
    """Listens to drives and bus, and keeps the answers to requests."""

    def __init__(self) -> None:
        self.answers: list[RequestCompleted] = []

    def handle_event(self, event: Event) -> None:
        if isinstance(event, RequestCompleted):
            self.answers.append(event)

    def nothing(self, *_: object, **__: object) -> None:
        """Take no notice."""

    take_commands = discard_commands = process_data = nothing
    bus_opened = bus_lost = fatal = nothing
    request_sent = nothing


class Bus:
    """Bridge and drives on the bus of a file."""

    def __init__(self, configuration: BridgeConfiguration, clock: Clock) -> None:
        self.configuration = configuration
        self.clock = clock
        bus, = configuration.buses.values()
        drives = list(configuration.drives.values())
        self.simulation = Simulation(configuration, clock)
        self.sessions = {drive.name: session for drive, session in zip(
            drives, make_sessions(drives))}
        self.listener = Listener()
        self.exchange = BusExchange(
            bus, list(self.sessions.values()),
            [[claim.route for claim in FAMILIES[drive.protocol].claims(drive)]
             for drive in drives], self.listener, clock)
        for session in self.sessions.values():
            self.exchange.attach(session, self.listener)

    def look(self) -> None:
        """Keep what the bridge has counted by now: afterwards it waits for no answers."""
        with self.exchange.lock:
            self.looked_at = 1e-9 * self.clock.stamp()
            self.looked = {name: (*self.counted(name), session.statistics.rejected)
                           for name, session in self.sessions.items()}

    def counted(self, name: str) -> tuple[int, int]:
        """Return exchanges and misses as the bridge counts them."""
        statistics = self.sessions[name].statistics
        return statistics.exchanges, statistics.missed

    def wait_exchanges(self, name: str, more: int) -> None:
        """Wait for so many exchanges more."""
        begun = self.counted(name)[0]
        wait_for(lambda: self.counted(name)[0] >= begun + more, f'{more} exchanges of {name}')


@contextmanager
def running(configuration: BridgeConfiguration, clock: Clock) -> Iterator[Bus]:
    bus = Bus(configuration, clock)
    with bus.simulation:
        bus.exchange.open()
        bus.exchange.activate()
        try:
            yield bus
        finally:
            bus.exchange.deactivate()
            bus.exchange.close()


@pytest.fixture(scope='module')
def conversation() -> tuple[Bus, list[Record]]:
    configuration = configuration_from_file(config_file('all_families.yaml'))
    with world(int(os.environ['DRIVE_CAN_TEST_SEED'])) as bench:
        with running(configuration, bench.clock) as bus:
            for name in bus.sessions:
                bus.wait_exchanges(name, 3)
            for name, played in bus.simulation.drives.items():
                missed = bus.counted(name)[1]
                played.fault('silent')
                wait_for(lambda name=name, missed=missed: bus.counted(name)[1] >= missed + 3,
                         f'misses of {name}')
                played.fault('ok')
                bus.wait_exchanges(name, 3)
            drive = bus.configuration.drives['conveyor']
            bus.exchange.submit(bus.sessions['conveyor'], ReadRequest(
                (drive.profile.parameters['ramp_time'],)))
            wait_for(lambda: bus.listener.answers, 'an answer')
            bus.look()
        wire = bench.wires.of(str(configuration.buses['main'].channel))
    return bus, [Record(1e-9 * EPOCH + at, 'main', frame.identifier, frame.data, frame.extended)
                 for at, frame in wire.frames]


def traced(bus: Bus, records: list[Record]) -> tuple[Tracer, list[str]]:
    lines: list[str] = []
    tracer = Tracer(bus.configuration, LineWriter(lines.append, Selection([], set())))
    for record in records:
        tracer.take(record)
    tracer.finish()
    return tracer, lines


def test_exchanges_and_misses_agree(conversation: tuple[Bus, list[Record]]) -> None:
    bus, records = conversation
    tracer, _ = traced(bus, [each for each in records if each.time <= bus.looked_at])
    for name, observed in tracer.observed().items():
        exchanges, missed, rejected = bus.looked[name]
        # answers that came when the bridge waited for them no more, it has rejected
        assert exchanges - 1 <= observed.exchanges, name
        # what was on the bus in time, and was read too late because all stood still, it has missed
        assert 0 < observed.missed <= missed + 1, name
        more = observed.exchanges + observed.missed - exchanges - missed
        assert -1 <= more <= 1 + rejected, name
        assert observed.malformed == 0, name
        # the median: what stands still for a moment is late for one of them only
        ours = median(bus.sessions[name].statistics.latency.samples())
        assert abs(median(observed.latency.samples()) - ours) < max(0.5 * ours, 0.003), name


def test_everything_is_understood(conversation: tuple[Bus, list[Record]]) -> None:
    bus, records = conversation
    tracer, lines = traced(bus, records)
    trace, = tracer.buses.values()
    assert trace.strays == trace.error_frames == 0
    assert trace.frames == len(records)
    for told in ('conveyor < read: ramp_time', 'pump > NMT: start node 5'):
        assert any(told in line for line in lines), told
    for name in bus.sessions:
        assert any(f' {name} < ' in line and 'LOST' in line for line in lines), name


@pytest.mark.parametrize('suffix', ['.log', '.asc', '.blf', '.trc', '.csv'])
def test_a_file_says_the_same(conversation: tuple[Bus, list[Record]], suffix: str,
                              tmp_path: Path) -> None:
    bus, records = conversation
    _, lines = traced(bus, records)
    writer = TraceWriter(tmp_path / f'trace{suffix}', ['main'])
    for record in records:
        writer.write(record)
    writer.close()
    tracer, read = traced(bus, list(read_records(tmp_path / f'trace{suffix}', pytest.fail)))

    def content(lines: list[str]) -> list[str]:    # stamps are kept to 0.1 or 1 ms
        return [line.split(' ', 2)[2].split(' [')[0].split(' in ')[0] for line in lines]

    if suffix in ('.log', '.csv', '.blf'):
        assert content(read) == content(lines)
    assert sorted(content(read)) == sorted(content(lines))


def test_time_passes_without_frames(conversation: tuple[Bus, list[Record]]) -> None:
    """The lines of a bus of this moment are those of a file, whenever the clock is looked at."""
    bus, records = conversation
    _, lines = traced(bus, records)
    told: list[str] = []
    tracer = Tracer(bus.configuration, LineWriter(told.append, Selection([], set())))
    last = records[0].time
    for record in records:
        tracer.advance(last + 0.5 * (record.time - last))
        tracer.take(record)
        last = record.time
    assert told == lines
