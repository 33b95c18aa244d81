# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can explain``, and the page that is made of the same rows."""

import json
from pathlib import Path

import pytest

from drive_can_bridge.cli import explain
from drive_can_bridge.cli.main import main
from drive_can_bridge.core import complaints, sentences


def test_the_page_is_current() -> None:
    """Written again by ``python -m drive_can_bridge.cli.explain``."""
    page = Path(__file__).parents[2] / explain.PAGE
    assert page.read_text(encoding='utf-8') == explain.page()


def test_the_page_has_every_code() -> None:
    text = explain.page()
    missing = [code for code in {**sentences.CODES, **complaints.CODES}
               if f'| `{code}` |' not in text]
    assert missing == ['uncoded'], 'which stands for the text of something else'


def test_a_code_of_diagnostics(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['explain', 'no_answer']) == 0
    assert capsys.readouterr().out == (
        'no_answer (of drives and buses)\n'
        '  it says:    no answer in <timeout> s, <attempts> attempts\n'
        f'  what to do: {sentences.no_answer.do}\n')


def test_one_that_drives_and_files_have(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['explain', 'read_only', '--json']) == 0
    drive, file = map(json.loads, capsys.readouterr().out.splitlines())
    assert drive == {'code': 'read_only', 'about': 'drives and buses', 'texts': ['read-only'],
                     'do': sentences.read_only.do}
    assert file == {
        'code': 'read_only', 'about': 'files', 'do': complaints.read_only.do,
        'texts': ['<name> is read-only, allowed are parameters with access rw or wo']}


def test_one_with_several_forms(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['explain', 'fault_came']) == 0
    assert capsys.readouterr().out.splitlines()[1:3] == [
        '  it says:    fault (<status>); only ~/enable starts the drive again',
        '  it says:    fault (<status>)']


@pytest.mark.parametrize(('word', 'told'), [
    ('not_armd', 'no such code, did you mean not_armed or '),
    ('\x1b[2J', r'\x1b[2J: no such code; docs/messages.md has them all')])
def test_an_unknown_one(word: str, told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['explain', word]) == 1
    shown = capsys.readouterr()
    assert shown.out == '' and told in shown.err and shown.err.count('\n') == 1
