# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The rule by which names are made from free text."""

import re

from hypothesis import given, strategies as st
import pytest

from drive_can_bridge.configuration.profile_check import RESERVED
from drive_can_bridge.profiles.names import LENGTH_MAX, name_of, unique
from drive_can_bridge.profiles.units import split_unit

NAME = re.compile(r'[a-z][a-z0-9_]*')
RAW = re.compile(r'p[0-9]+|x[0-9a-f]+')


@pytest.mark.parametrize(('text', 'name'), [
    ('Ramp time', 'ramp_time'),
    ('Ramp time [s]', 'ramp_time'),
    ('Drehzahl in 1/min', 'drehzahl'),
    ('Drehmomentgrenze, %', 'drehmomentgrenze'),
    ('Temperatur Kühlkörper °C', 'temperatur_kuehlkoerper'),
    ('Vel. massima (giri/min)', 'vel_massima'),
    ('Position (set 2)', 'position_set_2'),
    ('Größe Überstrom', 'groesse_ueberstrom'),
    ('Velocità', 'velocita'),
    ('cos φ', 'cos_phi'),
    ("Motor's rated current", 'motors_rated_current'),
    ('Motor-FLC/ratio', 'motor_flc_ratio'),
    ('RampTime', 'ramp_time'),
    ('DCLinkVoltage', 'dc_link_voltage'),
    ('INTEGER16 value', 'integer16_value'),
    ('24V supply', 'parameter_24v_supply'),
    ('online', 'online_value'),
    ('Request', 'request_value'),
    ('P12', 'p12_value'),
    ('xbeef', 'xbeef_value'),
    ('On', 'on_value'),
    ('电机', 'parameter_102'),
    ('', 'parameter_102'),
    ('[s]', 's'),
    ('status word', 'status_word'),
])
def test_name(text: str, name: str) -> None:
    assert name_of(text, '102') == name


def test_further_names_that_are_taken() -> None:
    assert name_of('Status word', '1', frozenset(('status_word',))) == 'status_word_value'


def test_long_texts_are_cut_between_words() -> None:
    name = name_of('word ' * 30)
    assert name == '_'.join(['word'] * 12) and len(name) <= LENGTH_MAX
    assert name_of('a' * 100) == 'a' * LENGTH_MAX


@pytest.mark.parametrize(('text', 'expected'), [
    ('Ramp time [s]', ('Ramp time', 's')), ('Drehzahl in U/min', ('Drehzahl', 'rpm')),
    ('Torque (Nm)', ('Torque', 'N m')), ('Function (see page 3)', ('Function (see page 3)', '')),
    ('Mode, on', ('Mode, on', '')), ('[s]', ('[s]', '')), ('Angle °', ('Angle', 'deg')),
])
def test_unit_at_the_end(text: str, expected: tuple[str, str]) -> None:
    assert split_unit(text) == expected


def test_equal_names_get_their_number() -> None:
    assert unique([('a', '1'), ('a', '2'), ('b', '3'), ('a', '2_1'), ('a_2', '9')]) == [
        'a', 'a_2', 'b', 'a_2_1', 'a_2_9']


@given(st.text(max_size=80), st.integers(0, 65535))
def test_any_text_gives_a_name_that_a_profile_takes(text: str, number: int) -> None:
    name = name_of(text, str(number))
    assert NAME.fullmatch(name) and len(name) <= 100 and '__' not in name
    assert name not in RESERVED and not RAW.fullmatch(name)


@given(st.lists(st.sampled_from(['a', 'a_1', 'a_2', 'b', 'b_2'])))
def test_any_names_become_unique(names: list[str]) -> None:
    made = unique((name, str(place)) for place, name in enumerate(names))
    assert len(set(made)) == len(names)
    assert all(new.startswith(old) for old, new in zip(names, made))
