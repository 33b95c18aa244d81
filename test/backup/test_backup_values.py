# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Values of a backup: whichever parser reads them, the raw integer comes out again."""

from hypothesis import given, strategies as st
import pytest
import yaml

from drive_can_bridge.backup.document import raw_in_file, value_in_file
from drive_can_bridge.configuration.scalars import read_scalar
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import Parameter, ParameterType

SCALES = st.sampled_from((1.0, 0.1, 0.01, 0.001, -0.5, 1 / 3, 1e9, 1e-9, 0.006103515625))
OFFSETS = st.sampled_from((0.0, -50.0, 0.05, 1e6))
TYPES = st.sampled_from(tuple(each for each in ParameterType if each is not ParameterType.BOOL))


@given(TYPES, SCALES, OFFSETS, st.integers(0, (1 << 32) - 1))
def test_any_raw_integer_comes_back(kind: ParameterType, scale: float, offset: float,
                                    word: int) -> None:
    parameter = Parameter('a', type=kind, number=1, scale=scale, offset=offset, scaled=True)
    raw = parameter.raw_from_word(word & (1 << kind.bits) - 1)
    text = value_in_file(parameter, raw)
    for value in (yaml.safe_load(text), read_scalar(text)):
        assert type(value) is float, text
        assert raw_in_file(parameter, value) == raw


@pytest.mark.parametrize(('options', 'raw', 'text'), [
    ({'scale': 0.01, 'scaled': True, 'unit': 's'}, 250, '2.5'),
    ({'scale': 0.1, 'scaled': True}, 30000, '3000.0'),      # no 3000.0000000000005
    ({'scale': 1e9, 'scaled': True}, 4000, '4.0e+12'),      # a string without the point
    ({'type': ParameterType.INT16}, -5, '-5'),
    ({'type': ParameterType.BOOL}, 1, 'true'),
    ({'unit': 'A', 'scaled': True}, 7, '7.0'),
])
def test_written(options: dict[str, object], raw: int, text: str) -> None:
    parameter = Parameter('a', number=1, **options)     # type: ignore[arg-type]
    assert value_in_file(parameter, raw) == text
    assert raw_in_file(parameter, yaml.safe_load(text)) == raw


@pytest.mark.parametrize(('options', 'value', 'message'), [
    ({'scaled': True}, True, 'wrong type: true is a bool, allowed is a number'),
    ({}, 1.0, 'wrong type: 1.0 is a number, allowed is an integer'),
    ({}, 'ten', "wrong type: 'ten' is a string, allowed is an integer"),
    ({'type': ParameterType.BOOL}, 1, 'wrong type: 1 is an integer, allowed is true or false'),
    ({'scaled': True}, float('nan'), 'nan is not a finite number'),
])
def test_wrong_types(options: dict[str, object], value: object, message: str) -> None:
    with pytest.raises(ValueRefused, match=message):
        raw_in_file(Parameter('a', number=1, **options), value)     # type: ignore[arg-type]


def test_values_beyond_the_limits_are_no_other_values() -> None:
    parameter = Parameter('a', number=1, scale=0.1, scaled=True, maximum=10.0)
    assert raw_in_file(parameter, 10.0) == 100
    assert raw_in_file(parameter, 7000.0) == 70000      # whatever 16 bits would make of it
    assert raw_in_file(parameter, -1e308) < -1e17       # so far away that no step counts
    raw_name = Parameter('p1', number=1, listed=False)
    assert (raw_in_file(raw_name, -1), raw_in_file(raw_name, 70000)) == (0xFFFF, 70000)
