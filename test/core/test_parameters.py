# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Raw integers, words and values of a parameter."""

from dataclasses import replace
import math

from builders import (
    ACTUAL, BOOL, FLAG, GAIN, INT16, INT32, ORDER, parameter, RAMP, RO, SPEED, STATUS, UINT16,
)
from hypothesis import given, strategies as st
import pytest
from saying import says

from drive_can_bridge.core.errors import DriveCanError, ValueRefused
from drive_can_bridge.core.parameters import Parameter, ParameterType, ValueKind


@pytest.mark.parametrize('entry, word, raw, value', [
    (SPEED, 0xFA24, -1500, -150.0), (SPEED, 0x7FFF, 32767, 3276.7),
    (SPEED, 0x8000, -32768, -3276.8),
    (GAIN, 0xFFFF, 65535, 65535), (GAIN, 0, 0, 0), (FLAG, 1, 1, True), (FLAG, 0, 0, False),
    (FLAG, 2, 2, True),
    (parameter('wide', 1, type=INT32), 0xFFFFFFFF, -1, -1),
    (parameter('wide', 1, type=ParameterType.UINT32), 0xFFFFFFFF, 0xFFFFFFFF, 0xFFFFFFFF),
    (parameter('warm', 1, type=INT16, scale=0.5, offset=-40.0), 100, 100, 10.0),
])
def test_word_raw_value(entry: Parameter, word: int, raw: int, value: object) -> None:
    assert entry.raw_from_word(word) == raw
    assert entry.word_from_raw(raw) == word
    made = entry.value_from_raw(raw)
    assert made == pytest.approx(value)
    assert type(made) is type(value)


def test_a_device_type_is_written_in_hexadecimal() -> None:
    device_type = parameter('device_type', None, index=0x1000, type=ParameterType.UINT32)
    assert device_type.text(4026532422) == 'F0000246h'
    assert parameter('serial', None, index=0x1018, subindex=4).text(4711) == '4711'


@given(st.sampled_from([SPEED, RAMP, GAIN, parameter('o', 1, type=INT16, scale=-0.3, offset=7.0)]),
       st.integers(0, 0xFFFF))
def test_every_word_survives(entry: Parameter, word: int) -> None:
    raw = entry.raw_from_word(word)
    assert entry.word_from_raw(raw) == word
    try:
        assert entry.raw_from_value(entry.value_from_raw(raw)) == raw
    except ValueRefused as error:
        assert error.sentence == says('out_of_range')


@pytest.mark.parametrize('entry, kind', [
    (SPEED, ValueKind.DOUBLE), (STATUS, ValueKind.INTEGER), (FLAG, ValueKind.BOOL),
    (parameter('bare', 1, unit='V'), ValueKind.DOUBLE),
    (parameter('odd', 1, type=BOOL, scale=1.0), ValueKind.DOUBLE),
])
def test_one_rule_for_types(entry: Parameter, kind: ValueKind) -> None:
    assert entry.kind is kind


@pytest.mark.parametrize('entry, value, text', [
    (SPEED, math.nan, 'nan is not a finite number'),
    (SPEED, math.inf, 'inf is not a finite number'), (SPEED, True, 'True is a bool, not a number'),
    (SPEED, 3000.2, '3000.2 is out of range: -3000 to 3000 rpm'),
    (SPEED, -4000, '-4000 is out of range: -3000 to 3000 rpm'),
    (Parameter('energy', ParameterType.UINT32, 1), 4294967296,
     '4294967296 is not representable: uint32 carries 0 to 4294967295'),
    (GAIN, 70000, '70000 is not representable: uint16 carries 0 to 65535'),
    # the nearest that do not fit
    (GAIN, 65536, '65536 is not representable: uint16 carries 0 to 65535'),
    (GAIN, -1, '-1 is not representable: uint16 carries 0 to 65535'),
    (GAIN, 0.5, '0.5 is not an integer'),
    (parameter('free', 1, scale=0.1, unit='V'), -1.0,
     '-1 is not representable: uint16 carries 0 to 6553.5 V'),
    (parameter('turned', 1, scale=-0.1), 1.0, 'uint16 carries -6553.5 to 0'),
    (FLAG, 1, '1 is not a bool'), (FLAG, 1.0, '1.0 is not a bool'),
    (parameter('low', 1, minimum=5.0), 4, '4 is out of range: at least 5'),
    (parameter('high', 1, maximum=5.0), 6, '6 is out of range: at most 5'),
])
def test_refusals_say_why(entry: Parameter, value: float, text: str) -> None:
    with pytest.raises(ValueRefused, match=text):
        entry.raw_from_value(value)


def test_limits_forgive_rounding_errors_only() -> None:
    assert SPEED.raw_from_value(30000 * 0.1) == 30000
    assert SPEED.raw_from_value(3000.00000001) == 30000
    with pytest.raises(ValueRefused):
        SPEED.raw_from_value(3000.01)


@given(st.one_of(st.floats(), st.integers(-2**63, 2**63 - 1), st.booleans()),
       st.sampled_from([SPEED, RAMP, GAIN, FLAG, ACTUAL,
                        parameter('fine', 1, type=INT16, scale=0.001),
                        parameter('moved', 1, type=INT32, scale=1e-6, offset=1e9)]))
def test_any_value_is_converted_or_refused(value: float, entry: Parameter) -> None:
    try:
        raw = entry.raw_from_value(value)
    except ValueRefused as error:
        assert str(error)
        return
    low, high = entry.type.raw_range
    assert low <= raw <= high


@pytest.mark.parametrize('entry, text', [
    (SPEED, '-3000 to 3000 rpm'), (GAIN, '0 to 65535'), (parameter('n', 1, type=INT16, scale=0.1,
                                                                   unit='A'),
                                                         '-3276.8 to 3276.7 A'),
    (parameter('n', 1, minimum=1.0, unit='s'), 'at least 1 s'),
    (parameter('n', 1, maximum=9.0), 'at most 9'),
])
def test_range_in_words(entry: Parameter, text: str) -> None:
    assert entry.range_text == text


def test_addresses() -> None:
    assert RAMP.address == 'P30'
    assert parameter('n', 613, subindex=5).address == 'P613.5'
    assert parameter('n', None, index=0x2004, subindex=6).address == '2004h.06h'
    assert parameter('n', 455, index=0x2004, subindex=6).address == 'P455'
    assert parameter('n', None, index=0x2004).address == '2004h.00h'
    assert parameter('n', None).address == 'process data'


def test_access() -> None:
    assert (SPEED.readable, SPEED.writable) == (True, True)
    assert (ACTUAL.readable, ACTUAL.writable) == (True, False)
    assert (ORDER.readable, ORDER.writable) == (False, True)
    assert ACTUAL.access is RO


def test_neutral() -> None:
    assert SPEED.neutral_raw == 0
    assert GAIN.neutral_raw == 0
    assert parameter('n', 1, scale=0.5, offset=10.0, neutral=12.0).neutral_raw == 4
    assert parameter('n', 1, scale=0.5, offset=10.0).neutral_raw == 0


def test_widths() -> None:
    assert (UINT16.bits, UINT16.signed, UINT16.raw_range) == (16, False, (0, 65535))
    assert INT32.raw_range == (-2**31, 2**31 - 1)
    assert BOOL.raw_range == (0, 1)
    assert issubclass(ValueRefused, (DriveCanError, ValueError))


COARSE = parameter('coarse', 1, type=INT16, scale=10.0, minimum=-25.0, maximum=25.0, unit='rpm')


@pytest.mark.parametrize('entry, value, raw', [
    (COARSE, 25.0, 2), (COARSE, -25.0, -2), (COARSE, 24.9, 2), (COARSE, 15.0, 2),
    (COARSE, 14.9, 1), (COARSE, 4.9, 0), (COARSE, 20, 2),
    (replace(COARSE, scale=-10.0), 25.0, -2), (replace(COARSE, scale=-10.0), -25.0, 2),
    (replace(COARSE, offset=7.0), 25.0, 1), (replace(COARSE, offset=7.0), -25.0, -3),
    (replace(COARSE, minimum=None), 25.0, 2), (replace(COARSE, minimum=None), -25.0, -2),
    (replace(COARSE, maximum=None), -25.0, -2),
    # what the type cannot hold is no value either
    (replace(COARSE, minimum=-1e6, maximum=1e6), 327674.0, 32767),
    (replace(COARSE, type=UINT16), -4.0, 0),
    # 0.3 * 10 = 3.0000000000000004 is inside all the same
    (parameter('tenths', 1, scale=0.3, maximum=3.0), 3.0, 10),
])
def test_rounding_stays_within_the_limits(entry: Parameter, value: float, raw: int) -> None:
    assert entry.raw_from_value(value) == raw


@given(st.floats(-1e5, 1e5), st.floats(-1e5, 1e5), st.floats(-1e5, 1e5),
       st.sampled_from([0.1, 0.3, -0.3, 7.0, 1000.0, -1e4]), st.sampled_from([0.0, -40.0, 0.05]),
       st.sampled_from([INT16, UINT16, INT32]))
def test_what_is_sent_is_within_the_limits(
        one: float, other: float, value: float, scale: float, offset: float,
        kind: ParameterType) -> None:
    low, high = sorted((one, other))
    entry = parameter('any', 1, type=kind, scale=scale, offset=offset, minimum=low, maximum=high)
    try:
        sent = entry.value_from_raw(entry.raw_from_value(value))
    except ValueRefused:
        return
    tolerance = abs(scale) * 1e-5
    assert low - tolerance <= sent <= high + tolerance
    assert abs(sent - value) < abs(scale) + tolerance


class Slow(float):
    """A number that is not taken the short way."""


@given(st.one_of(st.floats(), st.floats(-1e5, 1e5)),
       st.one_of(st.none(), st.floats(-1e5, 0.0)), st.one_of(st.none(), st.floats(0.0, 1e5)),
       st.sampled_from([0.1, 0.3, -0.3, 7.0, -1e4, 1e-300]), st.sampled_from([0.0, -40.0, 1e9]),
       st.sampled_from([INT16, UINT16, INT32, ParameterType.BOOL]))
def test_the_short_way_says_the_same(
        value: float, low: float | None, high: float | None, scale: float, offset: float,
        kind: ParameterType) -> None:
    entry = parameter('any', 1, type=kind, scale=scale, offset=offset, minimum=low, maximum=high)

    def said(number: float) -> object:
        try:
            return entry.raw_from_value(number)
        except ValueRefused as error:
            return str(error)
    assert said(value) == said(Slow(value))


def test_limits_without_a_value_between_them() -> None:
    entry = parameter('gap', 1, scale=10.0, minimum=1.0, maximum=9.0, unit='V')
    assert entry.raw_limits == (1, 0)
    with pytest.raises(ValueRefused, match='5 is not representable: uint16 has no value in 1'):
        entry.raw_from_value(5.0)
