# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can explain``, and the page that is made of the same rows."""

import json
from pathlib import Path
import re

import pytest

from drive_can_bridge.cli import explain
from drive_can_bridge.cli.main import main
from drive_can_bridge.core import complaints, sentences
from drive_can_bridge.core.codes import CODES


def test_the_page_is_current() -> None:
    """Written again by ``python -m drive_can_bridge.cli.explain``."""
    page = Path(__file__).parents[2] / explain.PAGE
    assert page.read_text(encoding='utf-8') == explain.page()


def test_the_page_has_every_code() -> None:
    text = explain.page()
    missing = [code for about, rows in CODES.items() for code in rows
               if f'<a id="{"file-" * (about == "files")}{code}"></a>`{code}` |' not in text]
    assert missing == ['uncoded'], 'which stands for the text of something else'
    anchors = re.findall('<a id="(.*?)">', text)
    assert len(anchors) == len(set(anchors)) == sum(map(len, CODES.values())) - 1


def test_the_contents_lead_to_headings() -> None:
    text = explain.page()
    slugs = [re.sub(r'[^\w -]', '', title.lower()).replace(' ', '-')
             for title in re.findall('^## (.*)$', text, re.MULTILINE)]
    assert re.findall(r'^\* \[.*\]\(#(.*)\)$', text, re.MULTILINE) == slugs
    assert slugs[0].startswith('diagnostics') and len(slugs) == len(set(slugs))


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


@pytest.mark.parametrize(('line', 'codes'), [
    ('conveyor: read ramp_time (P30): no answer in 0.1 s, 3 attempts', ['no_answer']),
    ('lift: told to stop, but it does not answer: it may still be running',
     ['stop_not_answered', 'may_still_be_running']),
    ('drives missing: 12 of 15 drives online; not seen: a, b', ['drives_missing']),
    ('a.yaml:9: drives.a.period: 0.001 s is too fast, allowed is at least 0.01 s unless '
     'allow_fast_cycle is true', ['period_too_fast'])])
def test_a_line_of_a_log(line: str, codes: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['explain', '--json', line]) == 0
    assert [json.loads(each)['code'] for each in capsys.readouterr().out.splitlines()] == codes


def test_words_of_a_text(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['explain', 'Still', 'braking']) == 0
    assert capsys.readouterr().out.startswith('still_braking (of drives and buses)\n')
    assert main(['explain', 'allowed is']) == 0
    shown = capsys.readouterr()
    assert shown.out.count('what to do') == 5 and 'more: give more words' in shown.err


@pytest.mark.parametrize('about', list(CODES))
def test_each_text_leads_to_its_row(about: str) -> None:
    """Whatever stands for what changes, and before it."""
    for row in CODES[about].values():
        changing = re.compile(f'<({"|".join(row.fields)})>')
        for form in explain.forms(row):
            if sum(map(str.isalpha, changing.sub('', form))) >= 6:
                line = f'lift: {changing.sub("3", form)}.'
                assert (about, row) in explain.rows_of(line), line


@pytest.mark.parametrize(('word', 'told'), [
    ('not_armd', 'no such code, did you mean not_armed or '),
    ('\x1b[2J', r'\x1b[2J: no such code; docs/messages.md has them all')])
def test_an_unknown_one(word: str, told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['explain', word]) == 1
    shown = capsys.readouterr()
    assert shown.out == '' and told in shown.err and shown.err.count('\n') == 1
