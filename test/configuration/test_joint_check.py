# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The joint section: what is wrong with it, and the factors that it gives."""

import math
from pathlib import Path

from configuration_builders import at, changed, FILE, load, local, problems, warnings
import pytest
from saying import says

from drive_can_bridge.core.configuration import convertible_units, Quantity, si_factor

CASES = [
    ('rearm: neutral', 'joint: {velocity: actual}',
     [at('f.yaml:18: drives.conveyor.joint.name', 'missing', allowed='a string')]),
    ('rearm: neutral', 'joint: {name: a}',
     [at('f.yaml:18: drives.conveyor.joint', 'no_quantity',
         allowed='position, velocity, effort, position_command, velocity_command, '
                 'effort_command')]),
    ('rearm: neutral', 'joint: {name: a, velocity: actul}',
     [at('f.yaml:18: drives.conveyor.joint.velocity', 'not_in_list', name='actul',
         listed='cyclic_response', hint=says('did_you_mean', word='actual'))]),
    ('rearm: neutral', 'joint: {name: a, velocity: speed}',
     [at('f.yaml:18: drives.conveyor.joint.velocity', 'not_in_list', name='speed',
         listed='cyclic_response', hint=says('allowed', words='actual, current, status'))]),
    ('rearm: neutral', 'joint: {name: a, velocity: current}',
     [at('f.yaml:18: drives.conveyor.joint.velocity', 'does_not_convert', name='current',
         unit="the unit 'A'", allowed='rad/s, deg/s, rpm, Hz')]),
    ('rearm: neutral', 'joint: {name: a, position: actual}',
     [at('f.yaml:18: drives.conveyor.joint.position', 'does_not_convert', name='actual',
         unit="the unit 'rpm'", allowed='rad, deg, rev')]),
    ('rearm: neutral', 'joint: {name: a, velocity: status}',
     [at('f.yaml:18: drives.conveyor.joint.velocity', 'does_not_convert', name='status',
         unit='no unit', allowed='rad/s, deg/s, rpm, Hz')]),
    ('rearm: neutral', 'joint: {name: a, velocity_command: limit}',
     [at('f.yaml:18: drives.conveyor.joint.velocity_command', 'joint_commands_limit',
         name='limit')]),
    ('rearm: neutral', 'joint: {name: a, velocity: actual, gear_ratio: 0}',
     [at('f.yaml:18: drives.conveyor.joint.gear_ratio', 'useless', value=0)]),
    ('rearm: neutral', 'joint: {name: a, velocity: actual, gear_ratio: .inf}',
     [at('f.yaml:18: drives.conveyor.joint.gear_ratio', 'not_finite', value=math.inf,
         allowed='a number')]),
    ('rearm: neutral', 'joint: {name: a, velocity: actual, pole_pairs: 0}',
     [at('f.yaml:18: drives.conveyor.joint.pole_pairs', 'out_of_range', value=0,
         allowed='an integer of 1 to 1000')]),
    ('rearm: neutral', 'joint: {name: a, velocity: actual, velocty: actual}',
     [at('f.yaml:18: drives.conveyor.joint.velocty', 'unknown_key',
         hint=says('did_you_mean', word='velocity'))]),
    ('rearm: neutral', 'joint: {name: a, velocity: actual, effort: actual}',
     [at('f.yaml:18: drives.conveyor.joint.effort', 'quantity_already', name='actual',
         quantity='velocity')]),
    ('rearm: neutral', 'joint: {name: 5, velocity: actual}',
     [at('f.yaml:18: drives.conveyor.joint.name', 'wrong_type', value=5, kind='an integer',
         allowed='a string')]),
    ('rearm: neutral', 'joint: {name: "", velocity: actual}',
     [at('f.yaml:18: drives.conveyor.joint.name', 'empty_string')]),
    ('rearm: neutral', 'joint: x',
     [at('f.yaml:18: drives.conveyor.joint', 'wrong_type', value='x', kind='a string',
         allowed='a mapping')]),
    ('rearm: neutral', 'joint: {}',
     [at('f.yaml:18: drives.conveyor.joint', 'garbling_mapping')]),
]


@pytest.mark.parametrize(('old', 'new', 'expected'), CASES)
def test_problem_of_a_joint(tmp_path: Path, old: str, new: str, expected: list[str]) -> None:
    assert problems(tmp_path, changed(FILE, old, new)) == expected


COMMAND = 'f.yaml:18: drives.conveyor.joint.effort_command'


@pytest.mark.parametrize(('new', 'found'), [
    ('word', at(COMMAND, 'control_word', name='word')),
    ('flag', at(COMMAND, 'is_bool', name='flag')),
    ('actual', at(COMMAND, 'not_in_list', name='actual', listed='cyclic_request',
                  hint=says('allowed', words='word, flag'))),
])
def test_command_that_is_no_setpoint(tmp_path: Path, new: str, found: object) -> None:
    text = changed(FILE, '[speed, limit]', '[word, flag]')
    joint = f'joint: {{name: a, effort_command: {new}}}'
    assert problems(tmp_path, changed(text, 'rearm: neutral', joint)) == [found]


def test_an_effort_that_is_a_limit_is_a_warning(tmp_path: Path) -> None:
    text = changed(FILE, 'rearm: neutral', 'joint: {name: a, effort_command: limit}')
    assert warnings(tmp_path, text) == [at(COMMAND, 'joint_bounds', name='limit')]


def test_empty_list(tmp_path: Path) -> None:
    text = changed(FILE, '[speed, limit]', '[]')
    text = changed(text, 'rearm: neutral', 'joint: {name: a, effort_command: limit}')
    assert problems(tmp_path, text) == [
        at('f.yaml:18: drives.conveyor.joint.effort_command', 'not_in_list', name='limit',
           listed='cyclic_request', hint=says('list_empty', listed='cyclic_request'))]


def test_no_complaint_about_what_follows_from_another(tmp_path: Path) -> None:
    text = changed(FILE, '[speed, limit]', '[1]')
    text = changed(text, 'rearm: neutral', 'joint: {name: a, velocity_command: speed}')
    assert problems(tmp_path, text) == [
        at('f.yaml:16: drives.conveyor.cyclic_request', 'wrong_type', value=1, kind='an integer',
           allowed='a string')]


def test_no_complaint_about_a_name_that_is_misspelt_in_the_list(tmp_path: Path) -> None:
    text = changed(FILE, '[speed, limit]', '[sped]')
    text = changed(text, 'rearm: neutral', 'joint: {name: a, velocity_command: speed}')
    assert problems(tmp_path, text) == [
        at('f.yaml:16: drives.conveyor.cyclic_request', 'not_in_profile', name='sped',
           hint=says('did_you_mean', word='speed'))]


def test_factors(tmp_path: Path) -> None:
    text = changed(FILE, '[actual, current, status]', '[position, frequency, current, status]')
    text = changed(text, '[speed, limit]', '[speed, angle, order]')
    text = changed(text, 'rearm: neutral', (
        'joint: {name: arm, position: position, velocity: frequency, effort: current, '
        'position_command: angle, velocity_command: speed, effort_command: order, '
        'gear_ratio: -4, pole_pairs: 3}'))
    configuration = load(tmp_path, text)
    joint = configuration.drives['conveyor'].joint
    assert local(tmp_path, configuration.warnings) == [
        at('f.yaml:18: drives.conveyor.joint.position_command', 'no_neutral_from', name='angle',
           neutral=0.0, unit='deg')]
    assert joint is not None
    assert (joint.name, joint.gear_ratio, joint.pole_pairs) == ('arm', -4.0, 3)
    assert (joint.position, joint.velocity_command) == ('position', 'speed')
    assert joint.factors == pytest.approx({
        'position': -2 * math.pi / 4,
        'frequency': -2 * math.pi / 3 / 4,
        'current': 1.0,
        'angle': -math.pi / 180 / 4,
        'speed': -2 * math.pi / 60 / 4,
        'order': 1.0,
    })


def test_two_joints_of_one_name(tmp_path: Path) -> None:
    text = changed(FILE, 'rearm: neutral', 'joint: {name: a, velocity: actual}')
    text += '        joint: {name: a, velocity: actual}\n'
    assert problems(tmp_path, text) == [
        at('f.yaml:26: drives.lift.joint.name', 'joint_of_other', name='a', owner='conveyor')]
    other = text.removesuffix('{name: a, velocity: actual}\n') + '{name: b, velocity: actual}\n'
    assert problems(tmp_path, other) == []


def test_pole_pairs_without_a_frequency(tmp_path: Path) -> None:
    text = changed(FILE, 'rearm: neutral', 'joint: {name: a, velocity: actual, pole_pairs: 2}')
    assert warnings(tmp_path, text) == [
        at('f.yaml:18: drives.conveyor.joint.pole_pairs', 'no_effect', unit='Hz')]


def test_no_joint(tmp_path: Path) -> None:
    assert load(tmp_path).drives['conveyor'].joint is None


@pytest.mark.parametrize(('quantity', 'unit', 'factor'), [
    (Quantity.POSITION, 'rad', 1.0),
    (Quantity.POSITION, 'deg', 0.0174532925199),
    (Quantity.POSITION, 'rev', 6.28318530718),
    (Quantity.VELOCITY, 'rad/s', 1.0),
    (Quantity.VELOCITY, 'deg/s', 0.0174532925199),
    (Quantity.VELOCITY, 'rpm', 0.10471975512),
    (Quantity.VELOCITY, 'Hz', 6.28318530718),
    (Quantity.EFFORT, 'A', 1.0),
])
def test_units(quantity: Quantity, unit: str, factor: float) -> None:
    assert si_factor(quantity, unit) == pytest.approx(factor)


def test_units_that_do_not_convert() -> None:
    assert si_factor(Quantity.POSITION, 'rpm') is None
    assert si_factor(Quantity.VELOCITY, '') is None
    assert si_factor(Quantity.EFFORT, 'A', gear_ratio=3.0, pole_pairs=2) == 1.0
    assert si_factor(Quantity.VELOCITY, 'rpm', gear_ratio=1.0, pole_pairs=2) == pytest.approx(
        0.10471975512)
    assert convertible_units(Quantity.EFFORT) == ()
