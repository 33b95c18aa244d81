# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Scalars as rcl reads them. ``test_rcl_agrees.py`` asks rcl itself about the same table."""

import math

from configuration_builders import SCALARS
import pytest

from drive_can_bridge.configuration.scalars import read_scalar, STRING_TAG


@pytest.mark.parametrize(('text', 'value'), SCALARS)
def test_plain_scalar(text: str, value: object) -> None:
    found = read_scalar(text)
    assert repr(found) == repr(value)


@pytest.mark.parametrize('text', ['5', 'yes', '1.5', '.inf', '', 'x'])
def test_quotes_and_string_tag_make_strings(text: str) -> None:
    assert read_scalar(text, quoted=True) == text
    assert read_scalar(text, tag=STRING_TAG) == text


def test_other_tags_are_ignored() -> None:
    assert read_scalar('5', tag='tag:yaml.org,2002:float') == 5
    assert read_scalar('5', quoted=True, tag='tag:yaml.org,2002:int') == '5'


@pytest.mark.parametrize('text', ['.nan', '.NaN', '.NAN', 'nan', 'NaN', 'nan(12)', '-nan'])
def test_not_a_number(text: str) -> None:
    found = read_scalar(text)
    assert isinstance(found, float)
    assert math.isnan(found)


def test_long_digits_take_no_time() -> None:
    assert read_scalar('1' * 200_000) == '1' * 200_000
    assert read_scalar('0x' + 'f' * 200_000) == '0x' + 'f' * 200_000
