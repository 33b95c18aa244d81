# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
All that can be wrong with a configuration, word for word (complaints.yaml).

Each is said somewhere in the product, and a story somewhere among the tests gets it.
"""

import ast
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest
import yaml

from drive_can_bridge.core import complaints

TESTS = Path(__file__).parents[1]
ROWS = yaml.safe_load(Path(__file__).with_name('complaints.yaml').read_text(encoding='utf-8'))


#: modules of stories about configurations; elsewhere ``says`` is mostly a sentence of a drive
STORIES = [*(TESTS / 'configuration').glob('test_*.py'),
           TESTS / 'protocols' / 'cia402' / 'test_cia402_checks.py',
           TESTS / 'protocols' / 'cannord' / 'test_cannord_group.py',
           TESTS / 'ros' / 'test_ros_refusals.py']


def named(files: Iterable[Path], *functions: str) -> Iterator[str]:
    """Return the texts that these functions are called with."""
    for path in files:
        text = path.read_text(encoding='utf-8')
        if not any(f'{name}(' in text for name in functions):
            continue    # parsing is what takes long
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Call) and getattr(node.func, 'id', '') in functions:
                for argument in node.args:
                    for each in ast.walk(argument):
                        if isinstance(each, ast.Constant):
                            yield str(each.value)


def test_every_code_has_a_row_and_every_row_a_code() -> None:
    assert list(complaints.WORDS) == list(ROWS)


def test_every_code_is_said() -> None:
    product = Path(complaints.__file__).parents[1].rglob('*.py')
    assert complaints.WORDS.keys() - {*named(product, 'says')} == set()


def test_every_code_has_a_story() -> None:
    """A story that passes has got what it names: at(PLACE, CODE), or says(CODE)."""
    assert complaints.WORDS.keys() - {*named(STORIES, 'at', 'says')} == set()


@pytest.mark.parametrize('code', ROWS)
def test_words(code: str) -> None:
    row = ROWS[code]
    fields = row.get('fields', {})
    said = complaints.says(code, **fields)
    assert said == row['says']
    assert (said.code, said.fields) == (code, fields)
