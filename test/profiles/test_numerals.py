# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Numbers as manuals write them."""

import pytest

from drive_can_bridge.profiles.numbers import (
    decimal_sign, factor, integer, interval, measure, Unusable)
from drive_can_bridge.profiles.units import unit

POINT, COMMA, UNKNOWN = '.', ',', ''


@pytest.mark.parametrize(('text', 'sign', 'number', 'behind'), [
    ('12', UNKNOWN, 12, ''), ('-5', UNKNOWN, -5, ''), ('−5', UNKNOWN, -5, ''),
    ('+0.5', UNKNOWN, 0.5, ''), ('0,5', UNKNOWN, 0.5, ''), ('.5', UNKNOWN, 0.5, ''),
    ('0,01 s', UNKNOWN, 0.01, 's'), ('100%', UNKNOWN, 100, '%'), ('50 Hz', UNKNOWN, 50, 'Hz'),
    ('1.000', POINT, 1, ''), ('1.000', COMMA, 1000, ''), ('1,000', POINT, 1000, ''),
    ('1,000', COMMA, 1, ''), ('1.234,5', UNKNOWN, 1234.5, ''), ('1,234.5', UNKNOWN, 1234.5, ''),
    ('1.234.567', UNKNOWN, 1234567, ''), ('1 000,5', UNKNOWN, 1000.5, ''),
    ("1'000", UNKNOWN, 1000, ''), ('10\N{NO-BREAK SPACE}000', UNKNOWN, 10000, ''),
    ('0.001', COMMA, 0.001, ''), ('0.0010', UNKNOWN, 0.001, ''), ('1e-3', UNKNOWN, 0.001, ''),
    ('0x3FF', UNKNOWN, 1023, ''), ('3FFh', UNKNOWN, 1023, ''), ('16#3FF', UNKNOWN, 1023, ''),
    ('-0x10', UNKNOWN, -16, ''), ('320.00', COMMA, 320, ''),
])
def test_measure(text: str, sign: str, number: float, behind: str) -> None:
    assert measure(text, sign) == (number, behind)


@pytest.mark.parametrize(('text', 'reason'), [
    ('1,000', "'1,000' may be 1 or 1000: say which with --decimal"),
    ('1.500', "'1.500' may be 1.5 or 1500: say which with --decimal"),
    ('P105', "'P105' is no number"), ('', "'' is no number"), ('1.2.3', "'1.2.3' is no number"),
    ('1,2,3', "'1,2,3' is no number"), ('1.234,567,8', "'1.234,567,8' is no number"),
    ('1e99', '1e+99 is too large'), ('²', "'²' is no number"),
    ('\uff11', "'\uff11' is no number"),
])
def test_no_measure(text: str, reason: str) -> None:
    with pytest.raises(Unusable) as caught:
        measure(text, UNKNOWN)
    assert str(caught.value) == reason


@pytest.mark.parametrize(('texts', 'sign'), [
    (['0,5', '1.000', ''], COMMA), (['0.5', '1,000'], POINT), (['1.000'], UNKNOWN), ([], UNKNOWN),
    (['0,5', '0.5'], UNKNOWN), (['1,234,567'], POINT), (['0,1 ... 99,9'], COMMA),
    (['1.234,5'], COMMA), (['0..100', '1…10'], UNKNOWN), (['Hz', '0,01 s'], COMMA),
])
def test_decimal_sign(texts: list[str], sign: str) -> None:
    assert decimal_sign(texts) == sign


@pytest.mark.parametrize(('text', 'ends'), [
    ('0 … 100', (0, 100)), ('0...100', (0, 100)), ('0..100', (0, 100)), ('-10 bis +10', (-10, 10)),
    ('0 to 3.5', (0, 3.5)), ('da 0 a 100', (0, 100)), ('0-50', (0, 50)), ('0 – 50', (0, 50)),
    ('-100--50', (-100, -50)), ('-50 - 50', (-50, 50)), ('0,1 ÷ 99,9', (0.1, 99.9)),
])
def test_interval(text: str, ends: tuple[float, float]) -> None:
    low, high = interval(text, UNKNOWN)
    assert (low.number, high.number) == ends


def test_interval_with_unit() -> None:
    text = '0,00 ... 320,00 s'
    assert interval(text, UNKNOWN)[1] == (320, 's')


@pytest.mark.parametrize('text', ['', '5', 'a to b', '1 to 2 to 3', 'to', '-'])
def test_no_interval(text: str) -> None:
    with pytest.raises(Unusable):
        interval(text, UNKNOWN)


@pytest.mark.parametrize(('text', 'number', 'behind'), [
    ('0,01', 0.01, ''), ('0.1 Hz', 0.1, 'Hz'), ('1/10', 0.1, ''), ('1/100 s', 0.01, 's'),
    ('x 0.1', 0.1, ''), ('×10', 10, ''), ('10^-2', 0.01, ''), ('10-2', 0.01, ''),
    ('10^2', 100, ''), ('1:10', 0.1, ''), ('1/min', 1, '1/min'), ('0,1 1/min', 0.1, '1/min'),
])
def test_factor(text: str, number: float, behind: str) -> None:
    found = factor(text, UNKNOWN)
    assert found.number == pytest.approx(number) and found.unit == behind


@pytest.mark.parametrize('text', ['', '0', '1/0', 'linear', '0,0'])
def test_no_factor(text: str) -> None:
    with pytest.raises(Unusable):
        factor(text, UNKNOWN)


@pytest.mark.parametrize(('text', 'number'), [
    ('102', 102), ('0x66', 102), ('66h', 102), ('66 hex', 102), ('$66', 102), ('102.0', 102),
    ("H'66'", 102), ('0102', 102)])
def test_integer(text: str, number: int) -> None:
    assert integer(text) == number


def test_hexadecimal_digits_without_a_mark() -> None:
    assert integer('1F', hexadecimal=True) == 31
    assert integer('10', hexadecimal=True) == 16
    with pytest.raises(Unusable):
        integer('1F')


@pytest.mark.parametrize(('text', 'expected'), [
    ('1/min', 'rpm'), ('U/min', 'rpm'), ('min-1', 'rpm'), ('giri/min', 'rpm'), ('RPM', 'rpm'),
    ('°C', 'degC'), ('°', 'deg'), ('Nm', 'N m'), ('Ω', 'ohm'), ('µs', 'us'), ('[s]', 's'),
    ('%', '%'), ('-', ''), ('', ''), ('1', ''), ('Imp/U', 'Imp/U'), ('% FLC', '% FLC'),
])
def test_unit(text: str, expected: str) -> None:
    assert unit(text) == expected
