# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Every example of every ``--help`` is run: here those that need no bridge."""

from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from client_builders import CONVEYOR, LIFT, parameter_file, World
import help_examples
import pytest

from drive_can_bridge.cli.main import main

EDS = """\
[DeviceInfo]
VendorName=Somebody
ProductName=Servo

[MandatoryObjects]
SupportedObjects=1
1=0x1000

[1000]
ParameterName=Device type
ObjectType=0x7
DataType=0x0007
AccessType=ro
DefaultValue=0x00020192

[OptionalObjects]
SupportedObjects=2
1=0x6040
2=0x6041

[6040]
ParameterName=Controlword
ObjectType=0x7
DataType=0x0006
AccessType=rw
PDOMapping=1

[6041]
ParameterName=Statusword
ObjectType=0x7
DataType=0x0006
AccessType=ro
PDOMapping=1
"""
#: example -> module that it needs
NEEDS = {'profile import drive.eds -o drive.yaml': 'canopen', 'completion bash': 'argcomplete',
         'completion zsh': 'argcomplete'}
#: what has something else than success to say: these files differ
CODES = {'compare monday.yaml tuesday.yaml': 1}


def test_somebody_runs_each_of_them() -> None:
    told = help_examples.shown()
    known = [each for table in help_examples.TABLES for each in table]
    assert len(told) > 40
    assert sorted(told) == sorted(known), 'an example that nobody runs, or a row of none'


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in a directory with the files that examples name."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'drive.eds').write_text(EDS, encoding='ascii')
    for name, ramp in (('monday', 1.0), ('tuesday', 2.5)):
        (tmp_path / f'{name}.yaml').write_text(
            f'/conveyor:\n  ros__parameters:\n    ramp_time: {ramp}\n', encoding='utf-8')
    return tmp_path


@pytest.mark.usefixtures('programs', 'threads')
@pytest.mark.parametrize('example', help_examples.ALONE)
def test_with_files_alone(place: Path, example: str, capsys: pytest.CaptureFixture[str]) -> None:
    needed = NEEDS.get(example, '')
    if needed and find_spec(needed) is None:
        pytest.skip(f'needs {needed}')
    parameter_file(place, {'conveyor': CONVEYOR, 'lift': LIFT}).rename(place / 'robot.yaml')
    assert main(help_examples.taken_apart(example)) == CODES.get(example, 0)
    told = capsys.readouterr()
    assert told.out or example.startswith('adapters') and 'none found' in told.err
    if 'security' in example:
        assert list(place.glob('security/*'))
    if 'import' in example:
        assert 'protocols: [' in (place / 'drive.yaml').read_text(encoding='utf-8')


#: where a bus is that an example names, in the place of can0
CHANNELS = {'scan --interface slcan': '/dev/ttyACM0'}


@pytest.fixture
def drives(request: pytest.FixtureRequest, place: Path, bench: object) -> Iterator[World]:
    """Play a drive for robot.yaml: one, because an example leaves its name away."""
    example = request.getfixturevalue('example')
    channel = next((channel for start, channel in CHANNELS.items() if example.startswith(start)),
                   'can0')
    drive = {**LIFT, 'protocol': 'datamodel_extended'}
    # its own side of the bus and robot.yaml differ in nothing but the names of adapters
    with World(parameter_file(place, {'lift': drive}, channel=channel)) as played:
        parameter_file(place, {'lift': drive}, channel='can0').rename(place / 'robot.yaml')
        yield played


@pytest.mark.parametrize('example', help_examples.DIRECT)
def test_with_drives_on_a_bus(drives: World, example: str,
                              capsys: pytest.CaptureFixture[str]) -> None:
    if example.startswith('decode'):
        Path('trace.log').write_text(
            '(1700000000.000000) can0 005FFFF0#0001138800000000 T\n', encoding='ascii')
    words = help_examples.taken_apart(example)
    assert main([*words, *(['--yes'] if words[0] == 'probe' else [])]) == 0
    told = capsys.readouterr()
    assert any(word in told.out for word in ('lift', 'datamodel_extended', 'written')), told
    if words[0] == 'write':
        assert drives.drives['lift'].value('ramp_time') == 2.5
    if '-o' in words:
        assert main(['validate', words[-1]]) == 0
