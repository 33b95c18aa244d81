# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The joint section: what is wrong with it, and the factors that it gives."""

import math
from pathlib import Path

from configuration_builders import at, changed, FILE, load, local, problems, warnings
import pytest
from saying import says


CASES = [
    ('joint: {velocity: actual}', 'joint.name', says('missing', allowed='a string')),
    ('joint: {name: a}', 'joint',
     says('no_quantity',
          allowed='position, velocity, effort, position_command, velocity_command, '
                  'effort_command')),
    ('joint: {name: a, velocity: actul}', 'joint.velocity',
     says('not_in_list', name='actul', listed='cyclic_response',
          hint=says('did_you_mean', word='actual'))),
    ('joint: {name: a, velocity: speed}', 'joint.velocity',
     says('not_in_list', name='speed', listed='cyclic_response',
          hint=says('allowed', words='actual, current, status'))),
    ('joint: {name: a, velocity: current}', 'joint.velocity',
     says('does_not_convert', name='current', unit="the unit 'A'",
          allowed='rad/s, deg/s, rpm, Hz')),
    ('joint: {name: a, position: actual}', 'joint.position',
     says('does_not_convert', name='actual', unit="the unit 'rpm'", allowed='rad, deg, rev')),
    ('joint: {name: a, velocity: status}', 'joint.velocity',
     says('does_not_convert', name='status', unit='no unit', allowed='rad/s, deg/s, rpm, Hz')),
    ('joint: {name: a, velocity_command: limit}', 'joint.velocity_command',
     says('joint_commands_limit', name='limit')),
    ('joint: {name: a, velocity: actual, gear_ratio: 0}', 'joint.gear_ratio',
     says('useless', value=0)),
    ('joint: {name: a, velocity: actual, pole_pairs: 0}', 'joint.pole_pairs',
     says('out_of_range', value=0, allowed='an integer of 1 to 1000')),
    ('joint: {name: a, velocity: actual, velocty: actual}', 'joint.velocty',
     says('unknown_key', hint=says('did_you_mean', word='velocity'))),
    ('joint: {name: a, velocity: actual, effort: actual}', 'joint.effort',
     says('quantity_already', name='actual', quantity='velocity')),
    ('joint: {name: "", velocity: actual}', 'joint.name', says('empty_string')),
    ('joint: x', 'joint', says('wrong_type', value='x', kind='a string', allowed='a mapping')),
]


@pytest.mark.parametrize(('joint', 'key', 'found'), CASES)
def test_problem_of_a_joint(tmp_path: Path, joint: str, key: str, found: says) -> None:
    assert problems(tmp_path, changed(FILE, 'rearm: neutral', joint)) == [
        at(f'f.yaml:18: drives.conveyor.{key}', found.code, **found.fields)]


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


TURNING = 'joint: {name: a, position: position, velocity_command: speed'


@pytest.mark.parametrize(('keys', 'key', 'found'), [
    # 2 of 4 revolutions in 40 ms; samples may be 4 periods of 20 ms apart
    (f'{TURNING}, continuous: 4}}', 'continuous', says(
        'continuous_too_fast', speed=3000.0, unit='rpm', steps=4, name='position',
        passed='0.04 s', gap='0.08 s')),
    (f'{TURNING}, continuous: 70000}}', 'continuous', says(
        'continuous_too_wide', steps=70000, bits=16, name='position', most=65536)),
    (f'{TURNING}, continuous: 1}}', 'continuous', says(
        'out_of_range', value=1, allowed='true or false or an integer of 2 to 4294967296')),
    ('joint: {name: a, velocity_command: speed, continuous: true}', 'continuous',
     says('continuous_without_position')),
    ('joint: {name: a, position: position, position_command: angle, continuous: true}',
     'continuous', says('continuous_commanded', name='angle')),
])
def test_problem_of_a_counter(tmp_path: Path, keys: str, key: str, found: says) -> None:
    text = changed(FILE, '[speed, limit]', '[speed, angle]')
    text = changed(text, '[actual, current, status]', '[actual, position, status]')
    assert problems(tmp_path, changed(text, 'rearm: neutral', keys)) == [
        at(f'f.yaml:18: drives.conveyor.joint.{key}', found.code, **found.fields)]


@pytest.mark.parametrize(('keys', 'wraps'), [
    (f'{TURNING}, gear_ratio: 20.0}}', True), (f'{TURNING}, continuous: true}}', False),
    (f'{TURNING}, continuous: 9}}', False),
    ('joint: {name: a, position: position}', False)])
def test_a_counter_that_wraps_within_a_day_is_a_warning(tmp_path: Path, keys: str,
                                                        wraps: bool) -> None:
    text = changed(FILE, '[actual, current, status]', '[actual, position, status]')
    text = changed(text, 'rearm: neutral', keys)
    # 32768 revolutions at 50 a second
    found = [at('f.yaml:18: drives.conveyor.joint.position', 'position_wraps', speed=3000.0,
                unit='rpm', name='position', after='11 min')]
    assert warnings(tmp_path, text) == (found if wraps else [])
