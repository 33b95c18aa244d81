# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The page on profiles shows what really happens."""

import json
from pathlib import Path
import re

import pytest

from drive_can_bridge.cli.main import main
from drive_can_bridge.profiles.csv_import import COLUMNS
from drive_can_bridge.profiles.names import name_of
from drive_can_bridge.resources import share_directory

PAGE = (share_directory() / 'docs' / 'profiles.md').read_text(encoding='utf-8')


def block(kind: str, containing: str) -> str:
    """Return the block of a kind that contains a text."""
    blocks = re.findall(rf'```{kind}\n(.*?)```', PAGE, re.DOTALL)
    [found] = [each for each in blocks if containing in each]
    return str(found)


def test_the_example_is_true(tmp_path: Path, capsys: pytest.CaptureFixture[str],
                             monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path('winder.csv').write_text(block('csv', 'WX 200'), encoding='utf-8')
    command, *answer = block('console', 'import winder.csv').splitlines()
    match = re.fullmatch(r"\$ drive_can (.*) --description '(.*)'", command)
    assert match is not None
    assert main([*match[1].split(), '--description', match[2]]) == 0
    out, err = capsys.readouterr()
    assert (err + out).splitlines() == answer
    assert block('yaml', 'ramp_time:') in Path('winder.yaml').read_text()


def test_keys_of_documents_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str],
                                     monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path('winder.csv').write_text(block('csv', 'WX 200'), encoding='utf-8')
    for words in ('list', 'show datamodel_example', 'import winder.csv -o winder.yaml',
                  'check winder.yaml'):
        assert main(['profile', *words.split(), '--json']) == 0
        line = next(line for line in PAGE.splitlines()
                    if line.startswith(f'* `{words.partition(" ")[0]}`'))
        keys = [key for key in json.loads(capsys.readouterr().out.splitlines()[0])
                if 'keys of a profile' not in line or key in ('name', 'address')]
        assert [key for key in re.findall('`([a-z_]+)`', line) if key in keys] == keys


def test_all_columns_are_named() -> None:
    for column in COLUMNS:
        assert f'`{column}`' in PAGE


def test_names_of_the_rule() -> None:
    table = PAGE[PAGE.index('| rule | text |'):PAGE.index('The text itself stays')]
    checked = 0
    for row in table.strip().splitlines()[2:]:
        texts, names = (re.findall('`([^`]+)`', cell) for cell in row.split('|')[2:4])
        if 'lowest address' in row:  # shown with two rows of a table
            continue
        for text, name in zip(texts, names, strict=True):
            assert name_of(text, '102') == name
            checked += 1
    assert checked == 11
