# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""All that can be wrong with a configuration, word for word (complaints.yaml)."""

from pathlib import Path

import pytest
import yaml

from drive_can_bridge.core import complaints

ROWS = yaml.safe_load(Path(__file__).with_name('complaints.yaml').read_text(encoding='utf-8'))


def test_every_code_has_a_row_and_every_row_a_code() -> None:
    assert list(complaints.WORDS) == list(ROWS)


@pytest.mark.parametrize('code', ROWS)
def test_words(code: str) -> None:
    row = ROWS[code]
    fields = row.get('fields', {})
    said = complaints.says(code, **fields)
    assert said == row['says']
    assert (said.code, said.fields) == (code, fields)
