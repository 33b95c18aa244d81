# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Words that texts for people do not use: those of docs/architecture.md stand for them."""

import ast
from pathlib import Path
import re

import pytest

from drive_can_bridge.cli import main as front_end
from drive_can_bridge.core.codes import CODES

ROOT = Path(__file__).resolve().parents[1]
#: what is not said: what is said for it
BANNED = {r'\banew\b': 'again, restart', r'\bwhoever\b': 'each … that',
          r'\bfor who\b': 'for those who'}
#: words that no docstring begins with: those that do
HEADS = {'Tell': 'Return (whether), Report', 'Take': 'Handle, Record', 'Say': 'Return, Report',
         'Have': 'Make, Run, Start', 'Let': 'Allow, Make', 'Somebody': 'a user, another node'}
PAGES = sorted({ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', ROOT / 'CHANGELOG.rst',
                *(ROOT / 'docs').glob('*.md')} - {ROOT / 'docs' / 'messages.md'})


def wrong_in(text: str) -> list[str]:
    """Return what stands there that should not, outside of code and quotes of other words."""
    text = re.sub(r'`[^`]*`|\(\*[^)]*\*\)', '', text)
    return [f'{found[0]!r}: {instead}' for banned, instead in BANNED.items()
            for found in re.finditer(banned, text, re.IGNORECASE)]


@pytest.mark.parametrize('page', PAGES, ids=lambda page: str(page.name))
def test_docs(page: Path) -> None:
    assert wrong_in(page.read_text(encoding='utf-8')) == []


def test_the_catalogue() -> None:
    wrong = {row.code: found for rows in CODES.values()
             for row in rows.values() if (found := wrong_in(' '.join((*row.texts, row.do))))}
    assert wrong == {}


@pytest.mark.parametrize('command', sorted(front_end.SUBCOMMANDS))
def test_help(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match='0'):
        front_end.main([command, '--help'])
    assert wrong_in(capsys.readouterr().out) == []


def test_docstrings() -> None:
    wrong = []
    for source in sorted((ROOT / 'drive_can_bridge').rglob('*.py')):
        for node in ast.walk(ast.parse(source.read_text(encoding='utf-8'))):
            if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
                text = ast.get_docstring(node) or ''
                found = [*wrong_in(text), *HEADS.get(text.split(' ', 1)[0], '').splitlines()]
                wrong += [f'{source}:{getattr(node, "lineno", 1)}: {each}' for each in found]
    assert wrong == []


def test_what_is_found() -> None:
    assert wrong_in('Begin anew.\nFor who wants it, `anew` (*begin anew*)') == [
        "'anew': again, restart", "'For who': for those who"]
