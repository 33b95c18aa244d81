# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Every example of every ``--help`` is run: here those that go through a bridge."""

from argparse import Namespace
from pathlib import Path
from typing import Any

from bridges import CONVEYOR, LIFT, parameters, StartBridge
from by_hand import Run
import help_examples
import pytest

from drive_can_bridge.cli.drives import complete_drives, complete_words

#: s, as long as jog allows
DRIVE = {**LIFT, 'command_timeout': 2.0}
DRIVES: dict[str, Any] = {
    'conveyor': {**DRIVE, 'station': 1}, 'lift': {**DRIVE, 'station': 2},
    'axis': {**CONVEYOR, 'station': 3, 'command_timeout': 2.0},
    'spare': {**DRIVE, 'station': 4}}
#: what an example needs to have been done before
BEFORE = {'jog conveyor speed_setpoint 300 --for 5': ['enable conveyor'],
          'compare conveyor.yaml conveyor': ['backup conveyor -o conveyor.yaml'],
          'restore conveyor.yaml': ['backup conveyor -o conveyor.yaml'],
          'restore conveyor.yaml spare --dry-run': ['backup conveyor -o conveyor.yaml']}
#: those that ask a person
ASKS = ('jog', 'restore')


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in a directory of one's own."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def typed(run: Run, example: str) -> tuple[list[str], str]:
    """Type an example; return what it shows and complains of."""
    words = help_examples.taken_apart(example)
    code, lines, errors = run(*words, *(['--yes'] if words[0] in ASKS else []))
    assert code == 0, (example, lines, errors)
    return lines, errors


def two_cells(bridge: StartBridge) -> None:
    for cell, drives in (('cell1', {'lift': DRIVE, 'hoist': {**DRIVE, 'station': 3}}),
                         ('cell2', {'lift': DRIVE})):
        bridge(parameters(**drives), arguments=('-r', f'__ns:=/{cell}')).online()


@pytest.mark.parametrize('example', help_examples.BRIDGE)
def test_through_a_bridge(bridge: StartBridge, run: Run, place: Path, example: str) -> None:
    one = bridge(parameters(**DRIVES)).online()
    for before in BEFORE.get(example, ()):
        typed(run, before)
    lines, errors = typed(run, example)
    assert lines and errors == ''
    if example.startswith('write'):
        assert one.played['conveyor'].value('ramp_time') == pytest.approx(2.5)
    if example.startswith('backup'):
        assert 'ramp_time' in (place / 'conveyor.yaml').read_text(encoding='utf-8')


@pytest.mark.parametrize('example', help_examples.CELL)
def test_through_a_bridge_in_a_namespace(bridge: StartBridge, run: Run, place: Path,
                                         example: str) -> None:
    bridge(parameters(lift=DRIVE), arguments=('-r', '__ns:=/cell1')).online()
    lines, errors = typed(run, example)
    assert errors == '' and (lines or list(place.glob('backups/*.yaml')))


def test_compare_takes_full_names_as_the_others_do(bridge: StartBridge, run: Run,
                                                   place: Path) -> None:
    two_cells(bridge)
    typed(run, 'backup /cell1/lift -o lift.yaml')
    for words in ('lift.yaml /cell1/lift', '/cell1/hoist /cell1/lift', './lift.yaml cell1/hoist',
                  f'{place}/lift.yaml /cell1/lift'):
        assert typed(run, f'compare {words}') == (['the same'], '')
    # a file is one, whatever it looks like
    (place / 'cell3').mkdir()
    (place / 'cell3' / 'lift').write_bytes((place / 'lift.yaml').read_bytes())
    assert typed(run, 'compare cell3/lift /cell1/lift') == (['the same'], '')
    code, lines, errors = run('compare', '/cell1/lift', '/cell2/lift')
    assert (code, lines) == (2, []) and 'one bridge is asked at a time' in errors
    code, lines, errors = run('compare', '/cell1/crane', 'lift.yaml')
    assert (code, lines) == (2, []) and "no drive 'crane'; there are: lift, hoist" in errors


def test_completion_behind_a_full_name(bridge: StartBridge, run: Run) -> None:
    two_cells(bridge)

    def after(*words: str, command: str = 'read') -> list[str]:
        return complete_words(words[-1], Namespace(words=list(words), subcommand=command))
    assert after('/cell1/l') == ['/cell1/lift', '/cell1/hoist']
    assert complete_drives('cell2/', Namespace(words=['cell2/'], subcommand='stop')) == [
        'cell2/lift']
    assert 'ramp_time' in after('/cell1/lift', 'ram')
    assert 'ramp_time=' in after('/cell1/lift', 'ram', command='write')
    assert after('/cell 1/') == []
