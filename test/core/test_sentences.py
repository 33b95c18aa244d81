# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""All sentences, word for word (sentences.yaml), and how they carry their codes."""

from pathlib import Path

import pytest
from saying import says
import yaml

from drive_can_bridge.core import sentences
from drive_can_bridge.core.sentences import CODES, NOTHING, together

ROWS = yaml.safe_load(Path(__file__).with_name('sentences.yaml').read_text(encoding='utf-8'))
#: what is said in another's words has no sentence of its own
WITHOUT = {'uncoded'}


def test_every_sentence_has_a_row_and_every_row_a_sentence() -> None:
    assert set(CODES) - WITHOUT == set(ROWS)


@pytest.mark.parametrize('code', ROWS)
def test_words(code: str) -> None:
    row = ROWS[code]
    fields = row.get('fields', {})
    said = CODES[code](**fields)
    assert said == row['says']
    assert (said.code, dict(said.fields)) == (code, fields)
    assert row['do']


def test_a_reason_keeps_its_code_within_another_sentence() -> None:
    why = sentences.stop_not_answered()
    said = sentences.may_still_be_running(why)
    assert said == says('may_still_be_running', why=says('stop_not_answered'))
    assert said != says('may_still_be_running', why=says('stop_not_possible'))
    assert 'stop_not_answered' not in said


def test_several_things_in_one_line() -> None:
    first, second = sentences.heartbeat_missing(), sentences.booted()
    both = together([NOTHING, first, second])
    assert both == f'{first}; {second}' and both.code == first.code
    assert both.fields == {'parts': [first, second]}
    assert together([second, NOTHING]) is second and together([]) is NOTHING
