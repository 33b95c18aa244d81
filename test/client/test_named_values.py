# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Names of values: commands show them beside the number, and ``write`` takes them instead."""

from collections.abc import Iterator
import json
from pathlib import Path

from client_builders import a_world, CONVEYOR, World
import pytest

from drive_can_bridge.cli.main import main
from drive_can_bridge.core import command_sentences

pytestmark = pytest.mark.usefixtures('bench')

PROFILE = """\
protocols: [datamodel_extended]
parameters:
  speed_setpoint: {number: 50, type: int16, scale: 0.1, unit: rpm, neutral: 0}
  actual_speed: {number: 209, type: int16, scale: 0.1, unit: rpm, access: ro}
  source: {number: 70, storage: ram, values: {0: terminals, 3: bus, 4: panel of the drive}}
"""


@pytest.fixture
def world(tmp_path: Path, bench: object) -> Iterator[World]:
    (tmp_path / 'named.yaml').write_text(PROFILE, encoding='utf-8')
    with a_world(tmp_path, conveyor={
            **CONVEYOR, 'profile': str(tmp_path / 'named.yaml'),
            'cyclic_request': ['speed_setpoint'], 'cyclic_response': ['actual_speed']}) as made:
        yield made


def run(world: World, capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str]:
    code = main([*words, '--params-file', str(world.file)])
    return code, capsys.readouterr().out


@pytest.mark.parametrize(('word', 'value', 'shown'), [
    ('bus', 3, '3 bus'), ('panel of the drive', 4, '4 panel of the drive'),
    ('0', 0, '0 terminals'), ('5', 5, '5')])
def test_there_and_back(world: World, capsys: pytest.CaptureFixture[str], word: str, value: int,
                        shown: str) -> None:
    code, said = run(world, capsys, 'write', 'conveyor', f'source={word}')
    assert code == 0, said
    assert world.drives['conveyor'].value('source') == value
    assert f' {shown} ' in said.splitlines()[1]
    code, said = run(world, capsys, 'read', 'conveyor', 'source')
    assert code == 0
    assert f' {shown} ' in said.splitlines()[1]
    code, said = run(world, capsys, 'read', 'conveyor', 'source', '--json')
    document = json.loads(said)
    assert (document['value'], document['text']) == (value, shown.partition(' ')[2])


def test_a_value_without_a_name_is_written_with_a_warning(
        world: World, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (['source=99'], ['source=99', '--json'], ['p70=99']):
        assert main(['write', 'conveyor', *words, '--params-file', str(world.file)]) == 0
        assert world.drives['conveyor'].value('source') == 99
        assert capsys.readouterr().err.rstrip() == command_sentences.value_without_name(
            words[0].partition('=')[0], 99, ['0 terminals', '3 bus', '4 panel of the drive'],
            'conveyor')
    assert main(['write', 'conveyor', 'source=3', '--params-file', str(world.file)]) == 0
    assert not capsys.readouterr().err


def test_an_unknown_name_is_told_the_known_ones(
        world: World, capsys: pytest.CaptureFixture[str]) -> None:
    code, said = run(world, capsys, 'write', 'conveyor', 'source=buss')
    assert code == 1
    assert 'an integer or one of terminals, bus, panel of the drive' in said


def test_a_backup_is_compared_and_restored_with_names(
        world: World, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = str(tmp_path / 'backup.yaml')
    assert run(world, capsys, 'write', 'conveyor', 'source=bus')[0] == 0
    code, said = run(world, capsys, 'backup', 'conveyor', '-o', file)
    assert code == 0, said
    assert '    source: 3  # bus\n' in Path(file).read_text(encoding='utf-8')
    assert run(world, capsys, 'write', 'conveyor', 'source=panel of the drive')[0] == 0
    code, said = run(world, capsys, 'compare', file, 'conveyor')
    assert code == 1
    assert said.splitlines()[1].split(maxsplit=1)[1].strip() == '3 bus  4 panel of the drive'
    code, said = run(world, capsys, 'compare', file, 'conveyor', '--json')
    assert json.loads(said) == {'parameter': 'source', 'unit': '', 'a': 3, 'b': 4}
    code, said = run(world, capsys, 'restore', file, 'conveyor', '--yes')
    assert code == 0, said
    assert said.splitlines()[1].split(maxsplit=1)[1].strip() == '4 panel of the drive  3 bus'
    assert world.drives['conveyor'].value('source') == 3
