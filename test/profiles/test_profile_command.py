# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can profile`` as a user calls it."""

import io
import json
import os
from pathlib import Path
import pty
import resource
import subprocess
import sys
from typing import Any

import pytest
from transcripts import replayed, shown, stories
import yaml

from drive_can_bridge.cli.main import main
from drive_can_bridge.resources import profiles_directory

CSV = 'Nr;Name;Einheit;Auflösung\n30;Rampe;s;0,01\n31;Höchstdrehzahl;1/min;0,1\nx;Kaputt;;\n'
STORIES = stories(__file__, 'commands.yaml')
GOOD = 'protocols: [cannord]\nparameters: {a: {number: 1, verified: true}}\n'
BROKEN = """\
protocols: [datamodel_extended, cannord]
parameters:
  speed: {number: 50, tpye: int16}
  wide: {number: 51, type: uint32}
  far: {number: 3000}
"""


SHIPPED = sorted(path.stem for path in profiles_directory().glob('*.yaml'))


def shipped(name: str) -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load(
        (profiles_directory() / f'{name}.yaml').read_text(encoding='utf-8'))
    return found


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / 'antrieb.csv'
    path.write_bytes(CSV.encode('cp1252'))
    return path


def documents(capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


@pytest.mark.parametrize('story', STORIES)
def test_lines(story: str, table: Path, capsys: pytest.CaptureFixture[str],
               monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(table.parent)
    monkeypatch.setattr(sys, 'stdin', io.StringIO())     # nobody can be asked
    Path('good.yaml').write_text(GOOD)
    Path('bad.yaml').write_text(BROKEN)

    def step(step: str) -> list[str]:
        first, *words = step.split()
        if first == 'files':
            return [' '.join(sorted(os.listdir()))]
        if first == 'head':
            return Path(words[0]).read_text().splitlines()[:1]
        if first == 'edit':
            Path(words[0]).write_text('edited by hand')
            return []
        code = main([first, *words])
        out, err = capsys.readouterr()
        errors = err.replace(str(profiles_directory()), '…').splitlines()
        return shown(out.splitlines(), errors, code)
    assert replayed(STORIES[story], step) == STORIES[story]


class TestList:

    def test_shipped_ones(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(['profile', 'list']) == 0
        out, err = capsys.readouterr()
        lines = out.splitlines()
        assert lines[0].split() == ['name', 'parameters', 'verified', 'protocols', 'description']
        assert [line.split()[0] for line in lines[1:]] == SHIPPED
        for name, line in zip(SHIPPED, lines[1:]):
            assert line.endswith(shipped(name)['description'])
        assert err == ''

    def test_those_of_a_directory_come_first(self, tmp_path: Path,
                                             capsys: pytest.CaptureFixture[str]) -> None:
        mine = tmp_path / 'nord_sk500e.yaml'
        mine.write_text('description: mine\nprotocols: [cannord]\nparameters: {a: {number: 1}}\n')
        (tmp_path / 'broken.yaml').write_text(BROKEN)
        assert main(['profile', '--json', 'list', '--directory', str(tmp_path)]) == 0
        found = {each['name']: each for each in documents(capsys)}
        assert found['nord_sk500e'] == {
            'name': 'nord_sk500e', 'path': str(mine), 'description': 'mine',
            'protocols': ['cannord'], 'parameters': 1, 'verified': 0, 'unverified': 0,
            'problems': 0}
        assert found['broken']['problems'] == 3
        assert set(found) == {'broken', *SHIPPED}



class TestShow:

    def test_table(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(['profile', 'show', 'nord_sk500e']) == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines[0] == f'{shipped("nord_sk500e")["description"]} (cannord)'
        row = next(line for line in lines if line.startswith('telegram_timeout '))
        assert row.split()[1:13] == ['P513', 'int16', '0.1', 's', 'rw', 'eeprom', '-0.1', 'to',
                                     '100', 's', 'no', 'Time']

    def test_json(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(['profile', 'show', 'tesys_t_ltmr', '--json']) == 0
        found = {each['name']: each for each in documents(capsys)}
        assert len(found) == 94
        assert found['flc1_ratio'] == {
            'name': 'flc1_ratio', 'address': 'P652', 'number': 652, 'index': 0x2007,
            'subindex': 3, 'type': 'uint16', 'scale': 1.0, 'offset': 0.0, 'unit': '%',
            'access': 'rw', 'storage': 'eeprom', 'minimum': 5.0, 'maximum': 100.0,
            'neutral': None, 'neutral_from': None, 'limit': False, 'arming_tolerance': 0.0,
            'bits': {}, 'values': {}, 'word_order': None, 'protected': False,
            'description': 'Full load current in percent of the largest one of the controller; a '
                           'small contactor rating raises the minimum',
            'source': 'installation_guide (unit, step, limits)',
            'verified': False, 'open': 'number'}


class TestImport:

    def test_standard_output(self, table: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(['profile', 'import', str(table)]) == 0
        out = capsys.readouterr().out
        target = table.with_suffix('.yaml')
        assert main(['profile', 'import', str(table), '-o', str(target)]) == 0
        assert out == target.read_text()

    def test_columns_with_commas(self, tmp_path: Path,
                                 capsys: pytest.CaptureFixture[str]) -> None:
        path = tmp_path / 'a.csv'
        path.write_text('Nr;Text, kurz;Faktor\n1;Speed;2\n')
        assert main(['profile', 'import', str(path), '--columns',
                     'number=Nr,name="Text, kurz",scale=']) == 0
        [(name, entry)] = yaml.safe_load(capsys.readouterr().out)['parameters'].items()
        assert (name, entry['number'], entry['type']) == ('speed', 1, 'uint16')




def in_terminal(*arguments: str, **environment: str) -> str:
    """Run the command in a terminal of 60 columns and return what it shows."""
    master, slave = pty.openpty()
    child = subprocess.Popen(
        [sys.executable, '-m', 'drive_can_bridge.cli.main', *arguments], stdout=slave,
        stderr=slave, stdin=slave,
        env={'PATH': '/usr/bin:/bin', 'TERM': 'xterm-256color', 'COLUMNS': '60', **environment})
    os.close(slave)
    shown = b''
    while True:
        try:
            part = os.read(master, 65536)
        except OSError:  # how a pseudo-terminal says that the other side is closed
            break
        if not part:
            break
        shown += part
    assert child.wait(20) == 0
    os.close(master)
    return shown.decode()


@pytest.mark.usefixtures('programs')
def test_fits_a_terminal_and_obeys_no_color() -> None:
    shown = in_terminal('profile', 'list')
    assert '\x1b[1m' in shown
    plain = in_terminal('profile', 'list', NO_COLOR='1')
    assert '\x1b[3' not in plain
    assert all(len(line) <= 60 for line in plain.replace('\x1b[1m', '').replace(
        '\x1b[0m', '').splitlines())
    assert 'tesys_t_ltmr' in plain


@pytest.mark.usefixtures('programs')
def test_what_goes_to_a_pipe_is_neither_cut_nor_wrapped() -> None:
    shown = subprocess.run(
        [sys.executable, '-m', 'drive_can_bridge.cli.main', 'profile', 'show', 'tesys_t_ltmr'],
        capture_output=True, text=True, check=True, env={'COLUMNS': '40', 'PATH': '/usr/bin'})
    rows = shown.stdout.split('\n\n')[1].splitlines()
    assert len(rows) == 95
    assert max(map(len, rows)) > 150 and '\x1b' not in shown.stdout



def test_nothing_upsets_a_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / 'p.yaml'
    file.write_text('description: "all\\e[2J"\nprotocols: [cannord]\nparameters:\n'
                    '  speed: {number: 1, type: int16, description: "one\\e[2J"}\n')
    assert main(['profile', 'show', str(file)]) == 0
    assert main(['profile', 'check', 'no\x1b[2J.yaml']) == 1
    out, err = capsys.readouterr()
    assert out.count('\\x1b[2J') == 2 and err == 'no\\x1b[2J.yaml: No such file or directory\n'
    assert '\x1b' not in out


@pytest.mark.usefixtures('programs')
@pytest.mark.parametrize('name', ['/dev/zero', 'pipe', 'large.csv'])
def test_what_has_no_end_is_not_read(name: str, tmp_path: Path) -> None:
    file = tmp_path / name
    reason = 'not a regular file, allowed is one'
    if name == 'pipe':
        os.mkfifo(file)
    elif name == 'large.csv':
        with file.open('wb') as content:
            content.truncate((32 << 20) + 1)
        reason = 'too large, allowed are 32 MiB'
    limit = 1 << 30     # of memory
    done = subprocess.run(
        [sys.executable, '-m', 'drive_can_bridge.cli.main', 'profile', 'import', str(file)],
        capture_output=True, text=True, check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)))
    assert (done.returncode, done.stdout, done.stderr) == (
        1, '', f'drive_can profile: {file}: {reason}\n')
