# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""One more family needs its files and a row in two tables: everything else asks it."""

from pathlib import Path
import subprocess
import sys

from builders import ACTUAL, drive, GAIN, parameter, read, SPEED, text_of, write
from cable import Cable
import pytest
import sixth_family
from sixth_family import SimulatedToy, Toy

from drive_can_bridge.core.events import ForeignMasterSeen, StationFound, StationLost
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.setpoints import CommandOutcome
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.simulation.simulation import SIMULATED_DRIVES

FILE = """\
/**/drive_can_bridge:
  ros__parameters:
    buses:
      main: {interface: virtual, channel: x}
    drives:
      horse: {bus: main, protocol: toy, station: 5, profile: ./horse.yaml, volume: 7,
              cyclic_request: [speed], cyclic_response: [actual]}
"""
PROFILE = """\
description: A horse
protocols: [toy]
parameters:
  speed: {number: 50, type: int16, access: rw, storage: ram, neutral: 0}
  actual: {number: 60, type: int16, access: ro}
  gain: {number: 40, type: uint16, access: rw, storage: ram}
"""
TRACE = """\
(1.000) can0 015#0A00
(1.001) can0 025#0900
(1.010) can0 035#0128000000
(1.011) can0 045#0128000700
(1.020) can0 035#0129000000
(1.021) can0 045#0329000000
"""


@pytest.fixture
def place(tmp_path: Path, programs: None) -> Path:
    for name, text in (('file.yaml', FILE), ('horse.yaml', PROFILE), ('trace.log', TRACE)):
        (tmp_path / name).write_text(text)
    return tmp_path


def drive_can(place: Path, *words: str) -> tuple[int, str]:
    """Run a command that knows the family; return its exit code, and all that it says."""
    done = subprocess.run([sys.executable, sixth_family.__file__, *words], cwd=place, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    return done.returncode, done.stdout


# -- commands -------------------------------------------------------------------------------------


def test_its_keys_are_checked(place: Path) -> None:
    assert drive_can(place, 'validate', 'file.yaml')[0] == 0
    for right, wrong, said in (
            ('volume: 7', 'volume: 12', 'allowed is an integer of 0 to 11'),
            ('volume: 7', 'volumes: 7', "did you mean 'volume'"),
            ('station: 5', 'station: 16', 'drives.horse.station: '),
            ('volume: 7', 'homing: true', 'drives.horse.homing')):
        (place / 'wrong.yaml').write_text(FILE.replace(right, wrong))
        code, text = drive_can(place, 'validate', 'wrong.yaml')
        assert (code, said in text) == (1, True), text


def test_its_profiles_are_checked_and_made(place: Path) -> None:
    assert drive_can(place, 'profile', 'check', 'horse.yaml')[0] == 0
    (place / 'wide.yaml').write_text(PROFILE.replace('uint16', 'uint32'))
    code, text = drive_can(place, 'profile', 'check', 'wide.yaml')
    assert (code, 'toy' in text) == (1, True), text
    (place / 'table.csv').write_text(
        'Number,Name,Type,Unit\n50,Speed,int16,rpm\n40,Gain,uint16,\n41,Short,uint8,\n')
    code, text = drive_can(place, 'profile', 'import', 'table.csv', '-o', 'made.yaml',
                           '--protocols', 'toy')
    assert code == 0, text
    assert 'protocols: [toy]' in (place / 'made.yaml').read_text()
    assert drive_can(place, 'profile', 'check', 'made.yaml')[0] == 0


def test_its_frames_are_decoded(place: Path) -> None:
    code, text = drive_can(place, 'decode', 'trace.log', '-p', 'file.yaml')
    assert code == 0, text
    assert text.splitlines() == [
        '0.000000 +0.000 main horse > cyclic request: speed 10',
        '0.001000 +0.000 main horse < cyclic response: actual 9 [1.0 ms]',
        '0.010000 +0.000 main horse > read: gain',
        '0.011000 +0.000 main horse < read: gain 7 [1.0 ms]',
        '0.020000 +0.010 main horse > read: p41',
        '0.021000 +0.010 main horse < read: p41: REFUSED: not there [1.0 ms]']


def test_what_scan_writes_for_it(place: Path) -> None:
    code, text = drive_can(place, 'found', '.')
    assert code == 0, text
    assert 'found_drive_5.yaml' in text
    lines = (place / 'found.yaml').read_text().split()
    for said in ('drive_5:', 'toy', '[parameter_1]', 'volume:'):
        assert said in lines, lines


@pytest.mark.parametrize(('command', 'said'), [('scan', 'toy'), ('probe', 'toy: volume')])
def test_help_names_it(place: Path, command: str, said: str) -> None:
    assert said in ' '.join(drive_can(place, command, '--help')[1].split())


# -- its session against its drive ----------------------------------------------------------------

ONE = parameter('one', 1, storage=GAIN.storage)


@pytest.fixture
def cable(monkeypatch: pytest.MonkeyPatch) -> Cable:
    monkeypatch.setitem(FAMILIES, 'toy', Toy())
    monkeypatch.setitem(SIMULATED_DRIVES, 'toy', SimulatedToy)
    made = Cable(drive('toy', station=5, table=(SPEED, ACTUAL, GAIN, ONE), request=(SPEED,),
                       response=(ACTUAL,))).run(0.5)
    assert made.found(StationFound)
    return made


def test_commands_arrive_and_end(cable: Cable) -> None:
    session, = cable.sessions
    services, horse = session.services, cable.drives[0]
    assert services.command(0, 100.0, cable.now) is CommandOutcome.NOT_ARMED
    services.command(0, 0.0, cable.now)
    services.command(0, 100.0, cable.now)
    cable.run(0.1)
    assert horse.value('speed_setpoint') == 100.0
    cable.run(1.0)
    assert horse.value('speed_setpoint') == 0.0, 'no fresh command'
    services.command(0, 0.0, cable.now)
    services.command(0, 100.0, cable.now)
    cable.run(0.1)
    session.deactivate(cable.now)
    cable.run(1.0)
    assert session.stopped and not session.stop_pending
    assert horse.value('speed_setpoint') == 0.0


def test_parameters(cable: Cable) -> None:
    assert [text_of(each) for each in cable.outcome(write((GAIN, 7)))] == ['written']
    assert [text_of(each) for each in cable.outcome(read(GAIN))] == [7]
    absent, = cable.outcome(read(parameter('absent', 99)))
    assert 'not there' in str(text_of(absent))


def test_it_is_lost_and_found(cable: Cable) -> None:
    cable.drives[0].fault('power_cut=1', cable.now)
    cable.run(3.0)
    assert [len(cable.found(kind)) for kind in (StationLost, StationFound)] == [1, 2]
    session, = cable.sessions
    session.receive_frame(Frame(sixth_family.TASK + 5, bytes(5), False), cable.now)
    assert any(isinstance(each, ForeignMasterSeen) for each in session.take_events())
