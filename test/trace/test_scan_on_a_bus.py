# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
From a scan to a running bridge, over a serial adapter and over SocketCAN.

The drives are played here; the bridge is a process of its own, as its user starts it.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
import json
import os
from pathlib import Path
import re
import signal

from clocks import REAL
import pytest
from running import Running
from test_trace_agrees import running
from waiting import DEADLINE, SLOWNESS, wait_for

from drive_can_bridge.cli import main as front_end
from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.resources import config_file
from drive_can_bridge.simulation.simulation import Simulation
from drive_can_bridge.simulation.terminal import SlcanTerminal

VCAN = os.environ.get('DRIVE_CAN_SOCKETCAN', 'vcan0')
BITRATE = 500_000
SHIPPED = configuration_from_file(config_file('all_families.yaml')).drives.values()
ALL = {(drive.protocol, drive.station) for drive in SHIPPED}
#: CANopen nodes, by name
NODES = {drive.name: (drive.protocol, drive.station) for drive in SHIPPED
         if any(claim.shared == 'NMT' for claim in FAMILIES[drive.protocol].claims(drive))}
UNMISTAKABLE = {(protocol, station) for protocol, station in ALL
                if FAMILIES[protocol].make_scanner().unmistakable}

#: against the wall clock (test/real.py)
pytestmark = [pytest.mark.real, pytest.mark.timeout(5 * DEADLINE)]
on_socketcan = (
    pytest.mark.socketcan,
    pytest.mark.skipif(not Path('/sys/class/net', VCAN).exists(),
                       reason=f'no SocketCAN interface {VCAN}; name one by DRIVE_CAN_SOCKETCAN'))


@dataclass
class Place:
    """
    A bus that others may open, too.

    :ivar heard: what came from outside to the drives.
    """

    interface: str
    channel: str
    terminal: SlcanTerminal | None
    heard: list[Frame]

    def configuration(self, *left_out: str) -> BridgeConfiguration:
        """Return ``config/all_families.yaml`` on this bus, at a pace that this machine keeps."""
        shipped = configuration_from_file(config_file('all_families.yaml'))
        bus = replace(shipped.buses['main'], interface=self.interface, channel=self.channel)
        return replace(shipped, buses={'main': bus}, drives={
            name: replace(drive, period=drive.period * SLOWNESS)
            for name, drive in shipped.drives.items() if name not in left_out})

    @contextmanager
    def drives(self, *left_out: str) -> Iterator[Simulation]:
        """Play the drives."""
        self.heard.clear()
        with Simulation(self.configuration(*left_out), REAL,
                        open_bus=(lambda _: self.terminal) if self.terminal else None,
                        show_frame=lambda _, frame, sent: sent or self.heard.append(frame),
                        ) as simulation:
            yield simulation

    def scan(self, *arguments: object) -> int:
        """Scan."""
        return front_end.main(['scan', '--interface', self.interface, '--channel', self.channel,
                               '--bitrate', str(BITRATE), *map(str, arguments)])


@pytest.fixture(params=['serial', pytest.param('socketcan', marks=on_socketcan)])
def place(request: pytest.FixtureRequest) -> Iterator[Place]:
    if request.param == 'socketcan':
        yield Place('socketcan', VCAN, None, [])
        return
    terminal = SlcanTerminal(REAL.now, BITRATE)
    yield Place('slcan', terminal.path, terminal, [])
    terminal.close()


@contextmanager
def bridge(directory: Path, file: Path, simulation: Simulation) -> Iterator[Running]:
    """Run a bridge with a file, all of whose drives come online and answer."""
    pytest.importorskip('rclpy')
    # what is written is for machines that keep it
    text = re.sub(
        'period: ([0-9.]+)', lambda match: f'period: {float(match[1]) * SLOWNESS:g}\n'
        f'        parameter_timeout: {0.3 * SLOWNESS:g}', file.read_text(encoding='utf-8'))
    heartbeats = ''.join(f'        {key}: {seconds * SLOWNESS:g}\n' for key, seconds in (
        ('heartbeat_producer', 0.1), ('heartbeat_timeout', 0.35), ('bridge_heartbeat', 0.2)))
    file.write_text(text.replace('        mode: pv\n', f'        mode: pv\n{heartbeats}'),
                    encoding='utf-8')
    process = Running(directory / 'bridge', 'drive_can_bridge', '--ros-args', '--params-file',
                      str(file))
    try:
        names = configuration_from_file(file).drives
        wait_for(lambda: all(f': {name}: online' in process.errors for name in names)
                 or process.process.poll() is not None, 'all drives online')
        answers = {drive.name: drive.answers for drive in simulation.drives.values()}
        wait_for(lambda: sum(drive.answers > answers[drive.name]
                             for drive in simulation.drives.values()) >= len(names)
                 or process.process.poll() is not None, 'answers')
        yield process
        assert process.end(signal.SIGINT, DEADLINE) == 0
    except AssertionError as error:
        raise AssertionError(f'{error}\n{process.errors}') from error
    finally:
        process.close()


def found(text: str) -> set[tuple[str, int]]:
    return {(each['protocol'], each['station']) for each in map(json.loads, text.splitlines())}


def written(file: Path) -> set[tuple[str, int]]:
    """Return the drives of a file that ``validate`` accepts."""
    assert front_end.main(['validate', str(file)]) == 0
    return {(drive.protocol, drive.station)
            for drive in configuration_from_file(file).drives.values()}


def test_what_answers_is_found_and_runs(place: Place, tmp_path: Path,
                                        capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / 'found.yaml'
    with place.drives() as simulation:
        assert place.scan('--json', '-o', file, '--protocols', 'cannord,datamodel_standard',
                          '--yes') == 0
        out, err = capsys.readouterr()
        assert found(out) == written(file) == UNMISTAKABLE
        # nothing that is a command to somebody: one of them is a CANopen node
        assert 'cannord is not asked: there is a CANopen node (5' in err
        assert not [frame for frame in place.heard
                    if not frame.extended and 0x200 <= frame.identifier < 0x400]
        assert not [drive.name for drive in simulation.drives.values() if drive.wear]
        if place.terminal:      # on SocketCAN below, with all of them
            with bridge(tmp_path, file, simulation):
                pass


def test_families_with_short_identifiers_are_found_when_named(
        place: Place, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / 'found.yaml'
    with place.drives(*NODES) as simulation:
        assert place.scan('--json', '-o', file, '--listen', 0.2, '--protocols',
                          'datamodel_standard,cannord', '--yes') == 0
        assert found(capsys.readouterr().out) == written(file) == ALL - set(NODES.values())
        assert not [drive.name for drive in simulation.drives.values() if drive.wear]


@pytest.mark.parametrize('place', [pytest.param('socketcan', marks=on_socketcan)], indirect=True)
def test_beside_a_bridge_it_only_listens(place: Place, tmp_path: Path,
                                         capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / 'found.yaml'
    listen = '--listen', 2.0 * SLOWNESS
    with running(place.configuration(), REAL) as bus:
        for name in bus.sessions:
            bus.wait_exchanges(name, 3)
        assert place.scan('--json', '-o', file, *listen) == 0
    out, err = capsys.readouterr()
    assert found(out) == written(file) == ALL
    assert 'there is another master' in err and 'only listening' in err

    with place.drives() as simulation, bridge(tmp_path, file, simulation):
        broken = [drive.violations for drive in simulation.drives.values()]
        capsys.readouterr()
        assert place.scan('--json', *listen) == 0
        out, err = capsys.readouterr()
        assert found(out) == ALL
        assert 'only listening' in err
        assert [drive.violations for drive in simulation.drives.values()] == broken
        # by SDO a scan asks all nodes, and the bridge its axis
        assert {frame.identifier for frame in place.heard
                if frame.identifier & 0x780 == 0x600} <= {0x606}
