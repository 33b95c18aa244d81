# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can explain``, and the page that is made of the same rows."""

import json
from pathlib import Path
import re
import runpy

import pytest

from drive_can_bridge.cli import explain, explained_words
from drive_can_bridge.cli.main import main
from drive_can_bridge.core import complaints, sentences
from drive_can_bridge.core.codes import code_of, CODES
from drive_can_bridge.protocols.cannord.states import InverterState
from drive_can_bridge.protocols.cia402.states import ServoState

SCRIPT = runpy.run_path(str(Path(__file__).parents[2] / 'docs' / 'messages.py'))


def test_the_page_is_current() -> None:
    """Written again by ``docs/messages.py``."""
    assert SCRIPT['PAGE'].read_text(encoding='utf-8') == SCRIPT['page']()


def test_the_page_has_every_code() -> None:
    text = SCRIPT['page']()
    missing = [code for about, rows in CODES.items() for code in rows
               if f'<a id="{"file-" * (about == "files")}{code}"></a>`{code}` |' not in text]
    assert missing == ['uncoded'], 'which stands for the text of something else'
    anchors = re.findall('<a id="(.*?)">', text)
    assert len(anchors) == len(set(anchors)) == sum(map(len, CODES.values())) - 1


def test_the_contents_lead_to_headings() -> None:
    text = SCRIPT['page']()
    slugs = [re.sub(r'[^\w -]', '', title.lower()).replace(' ', '-')
             for title in re.findall('^## (.*)$', text, re.MULTILINE)]
    assert re.findall(r'^\* \[.*\]\(#(.*)\)$', text, re.MULTILINE) == slugs
    assert slugs[0].startswith('diagnostics') and len(slugs) == len(set(slugs))


def test_a_code_of_diagnostics(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['explain', 'no_answer']) == 0
    assert capsys.readouterr().out == (
        'no_answer (said about a drive or a bus)\n'
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


def codes(*words: str, capsys: pytest.CaptureFixture[str]) -> list[tuple[str, str]]:
    assert main(['explain', '--json', *words]) == 0
    documents = map(json.loads, capsys.readouterr().out.splitlines())
    return [(each['code'], each['about']) for each in documents]


DRIVES, FILES = 'drives and buses', 'files'


@pytest.mark.parametrize(('words', 'found'), [
    (['not_armed', 'bus_up'], [('not_armed', DRIVES), ('bus_up', DRIVES)]),
    (['bus_up not_armed', 'bus_up'], [('bus_up', DRIVES), ('not_armed', DRIVES)]),
    (['read_only', 'not_armed'],
     [('read_only', DRIVES), ('read_only', FILES), ('not_armed', DRIVES)]),
    ([*'not_armed bus_up online disabled bus_load_high no_answer'.split()],
     [(each, DRIVES) for each in
      'not_armed bus_up online disabled bus_load_high no_answer'.split()])])
def test_several_codes_are_explained_one_after_the_other(
        words: list[str], found: list[tuple[str, str]],
        capsys: pytest.CaptureFixture[str]) -> None:
    assert codes(*words, capsys=capsys) == found


def test_lines_and_codes_are_explained_one_after_the_other(
        capsys: pytest.CaptureFixture[str]) -> None:
    line = 'lift: enable: bridge inactive'
    told = [codes(*words, capsys=capsys) for words in (
        (line,), ('not_armed', 'bus_up'), ('no', 'answer', 'in'))]
    assert codes(line, 'not_armed', 'bus_up', line, capsys=capsys) == [
        *told[0], *told[1], *told[0]]
    assert codes('no', 'answer', 'in', line, capsys=capsys) == told[2] + told[0]
    assert main(['explain', line, 'nonsense_of_mine']) == 1
    assert 'nonsense_of_mine: no such code' in capsys.readouterr().err


@pytest.mark.parametrize(('word', 'found'), [
    ('file-does_not_fit', [('does_not_fit', FILES)]),
    ('file-read_only', [('read_only', FILES)]),
    ('#not_armed', [('not_armed', DRIVES)]),
    ('docs/messages.md#file-does_not_fit', [('does_not_fit', FILES)]),
    ('`not_armed`', [('not_armed', DRIVES)])])
def test_a_code_as_anchors_and_pages_write_it(
        word: str, found: list[tuple[str, str]], capsys: pytest.CaptureFixture[str]) -> None:
    assert codes(word, capsys=capsys) == found


def test_each_anchor_of_the_page_leads_to_its_row() -> None:
    for anchor in re.findall('<a id="(.*?)">', SCRIPT['page']()):
        assert [row.code for _, row in explain.rows_of(anchor)][:1] == [
            anchor.removeprefix('file-')], anchor


@pytest.mark.parametrize('state', [
    each for each in (*ServoState, *InverterState) if each.name != 'FAULT'])
def test_a_state_that_services_answer_with(
        state: ServoState | InverterState, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['explain', '--json', state.value]) == 0
    first = json.loads(capsys.readouterr().out.splitlines()[0])
    assert first['about'] == 'states' and state.value in first['texts']
    assert 'motor' in first['do'] and code_of(state.value) == ''


@pytest.mark.parametrize(('word', 'about', 'wanted'), [
    ('2220h', 'numbers', 'manual'), ('0x0250', 'numbers', 'manual'),
    ('command_age_s', 'keys', 'nan: none'), ('missed_exchanges', 'keys', 'not answer')])
def test_words_of_messages_and_diagnostics(word: str, about: str, wanted: str,
                                           capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['explain', '--json', word]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said['code'], said['about']) == (word, about) and wanted in said['do']
    assert main(['explain', word]) == 0
    assert '  it is:      ' in capsys.readouterr().out


def test_every_key_of_diagnostics_is_explained() -> None:
    """Those that docs/ros_interface.md lists."""
    page = (Path(__file__).parents[2] / 'docs/ros_interface.md').read_text(encoding='utf-8')
    table = page.partition('## Diagnostics')[2].partition('\n## ')[0]
    keys = {key for line in table.splitlines() if line.startswith('| `')
            for key in re.findall('`(.*?)`', line.split(' | ')[0])}
    assert keys == set(explained_words.KEYS)


def test_whom_a_text_is_about(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['explain', 'file-read_only']) == 0
    assert capsys.readouterr().out.startswith(
        'read_only (said about a parameter file or a profile)\n')
    assert main(['explain', 'no_adapters']) == 0
    assert capsys.readouterr().out.startswith('no_adapters (said by a command)\n')


def test_one_with_several_forms(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['explain', 'fault_came']) == 0
    assert capsys.readouterr().out.splitlines()[1:3] == [
        '  it says:    fault (<status>); only ~/enable starts the drive again',
        '  it says:    fault (<status>)']


@pytest.mark.parametrize(('line', 'wanted'), [
    ('conveyor: read ramp_time (P30): no answer in 0.1 s, 3 attempts', ['no_answer']),
    ('lift: told to stop, but it does not answer: it may still be running',
     ['stop_not_answered', 'may_still_be_running']),
    ('axis: offline: no complete set of PDOs for 3 cycles',
     ['drive_went_offline', 'silent_for_cycles']),
    ('hoist, turn offline', ['members_offline']),
    ('no answer in 0.1 s', ['no_answer_to_stop', 'no_answer']),
    ('drives missing: 12 of 15 drives online; not seen: a, b', ['drives_missing']),
    ('lift: fault (status word 0008h)', ['fault_came', 'status_word']),
    ('fault (status word 0008h)', ['fault_came', 'status_word']),
    ('lift: NOT STOPPED: drive offline', ['not_stopped', 'drive_offline']),
    ('a.yaml:9: drives.a.period: 0.001 s is too fast, allowed is at least 0.01 s unless '
     'allow_fast_cycle is true', ['period_too_fast'])])
def test_a_line_of_a_log(line: str, wanted: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['explain', '--json', line]) == 0
    assert [json.loads(each)['code'] for each in capsys.readouterr().out.splitlines()] == wanted


@pytest.mark.parametrize('name', ['', 'axis: '])
def test_what_stands_before_a_reason(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    found = codes(f'{name}offline: no answer to process data for 3 cycles', capsys=capsys)
    assert found[:2] == [('drive_went_offline', 'verdicts'), ('silent_for_cycles', DRIVES)]


def test_words_of_a_text(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['explain', 'Still', 'braking']) == 0
    assert capsys.readouterr().out.startswith('still_braking (said about a drive or a bus)\n')
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


@pytest.mark.parametrize(('words', 'found', 'unknown'), [
    (['not_armed', 'bus_upp'], ['not_armed'], ['bus_upp: no such code, did you mean bus_up']),
    (['bus_upp not_armed'], ['not_armed'], ['bus_upp: no such code, did you mean bus_up']),
    (['#bus_up', 'x9', '`not_armed`', 'no_answr'], ['bus_up', 'not_armed'],
     ['x9: no such code', 'no_answr: no such code, did you mean no_answer'])])
def test_those_that_are_known_are_explained_beside_one_that_is_not(
        words: list[str], found: list[str], unknown: list[str],
        capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['explain', '--json', *words]) == 1
    shown = capsys.readouterr()
    assert [json.loads(line)['code'] for line in shown.out.splitlines()] == found
    lines = shown.err.splitlines()
    assert len(lines) == len(unknown)
    assert all(text in line for text, line in zip(unknown, lines))
