# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Types of values in words."""

from array import array
from typing import Any

import pytest

from drive_can_bridge.core.words import describe_type


@pytest.mark.parametrize(('value', 'words'), [
    (True, 'a bool'), (1, 'an integer'), (1.0, 'a number'), ('1', 'a string'),
    ([], 'an empty list'), ([1], 'a list'), ((1,), 'a list'), (array('q', [1]), 'a list'),
    (array('d'), 'an empty list'), ({}, 'a mapping'), (None, 'no value')])
def test_type(value: Any, words: str) -> None:
    assert describe_type(value) == words
