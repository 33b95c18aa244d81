# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Setpoints that stay where the axis is: what a profile and a drive have to say about them."""

from pathlib import Path

from configuration_builders import at, changed, FILE, load, problems, PROFILE
import pytest
from saying import says
import yaml

from drive_can_bridge.profiles.catalogue import check
from drive_can_bridge.resources import profiles_directory

HELD = changed(PROFILE, 'type: int16, unit: deg}', 'type: int16, unit: rev, minimum: 10, '
               'neutral_from: position, arming_tolerance: 2}')
AXIS = changed(changed(FILE, '[speed, limit]', '[angle]'), '[actual, current, status]',
               '[position, status]')

PROFILES = [
    ('arming_tolerance: 2', 'arming_tolerance: -1',
     [at('table.yaml:8: parameters.angle.arming_tolerance', 'out_of_range', value=-1,
         allowed='a number of at least 0')]),
    (', arming_tolerance: 2', '',
     [at('table.yaml:8: parameters.angle.neutral_from', 'no_arming_tolerance')]),
    ('minimum: 10', 'neutral: 0',
     [at('table.yaml:8: parameters.angle.neutral', 'beside_neutral_from')]),
    ('neutral_from: position', 'neutral_from: positon',
     [at('table.yaml:8: parameters.angle.neutral_from', 'not_in_profile', name='positon',
         hint=says('did_you_mean', word='position'))]),
    ('neutral_from: position', 'neutral_from: actual',
     [at('table.yaml:8: parameters.angle.neutral_from', 'other_unit', name='actual',
         unit="the unit 'rpm'", wanted="the unit 'rev'", parameter='angle')]),
    ('neutral_from: position', 'neutral_from: order',
     [at('table.yaml:8: parameters.angle.neutral_from', 'no_actual_value', name='order')]),
    ('neutral_from: position', 'neutral_from: flag',
     [at('table.yaml:8: parameters.angle.neutral_from', 'is_bool', name='flag')]),
    ('neutral_from: position', 'neutral_from: angle',
     [at('table.yaml:8: parameters.angle.neutral_from', 'no_actual_value', name='angle')]),
    ('neutral_from: position', 'access: ro, neutral_from: position',
     [at('table.yaml:8: parameters.angle.neutral_from', 'read_only_in', name='angle')]),
    ('flag: {number: 53, type: bool}',
     'flag: {number: 53, type: bool, neutral_from: status, arming_tolerance: 1}',
     [at('table.yaml:7: parameters.flag.neutral_from', 'bool_has_no', entry='neutral_from'),
      at('table.yaml:7: parameters.flag.arming_tolerance', 'bool_has_no',
         entry='arming_tolerance')]),
]


@pytest.mark.parametrize(('old', 'new', 'expected'), PROFILES)
def test_problem_of_a_profile(tmp_path: Path, old: str, new: str, expected: list[str]) -> None:
    assert [line for line in problems(tmp_path, AXIS, changed(HELD, old, new))
            if line.startswith('table')] == expected


def test_of_a_large_profile_only_what_fits_is_shown(tmp_path: Path) -> None:
    path = tmp_path / 'mine.yaml'
    servo = (profiles_directory() / 'cia402_servo.yaml').read_text(encoding='utf-8')
    path.write_text(servo.replace('neutral_from: actual_position', 'neutral_from: zz'))
    names = yaml.safe_load(servo)['parameters']
    hints = [problem.message.fields['hint'] for problem in check(path).problems]
    assert len(hints) == 2 and all(each == says('allowed') for each in hints)
    assert {name for each in hints for name in each.fields['words'].split(', ')} == {
        name for name, entry in names.items() if entry.get('unit') == 'rev'
        and entry.get('access') == 'ro'}
    path.write_text(servo.replace('parameter: fault_code', 'parameter: zz'))
    problem, = check(path).problems
    assert problem.message == says('unknown', hint=says('some_allowed_here'))
    assert len(problem.message.fields['hint'].fields['words'].split(', ')) < 8 < len(names)


def test_limits_do_not_bound_it(tmp_path: Path) -> None:
    """Raw 0 is out of its limits, and yet it needs no neutral."""
    angle = load(tmp_path, AXIS, HELD).drives['conveyor'].cyclic_request[0]
    assert (angle.neutral_from, angle.arming_tolerance, angle.minimum) == ('position', 2.0, 10.0)


DRIVES = [
    ('[position, status]', '[actual, status]',
     [at('f.yaml:16: drives.conveyor.cyclic_request', 'measured_not_listed', name='angle',
         measured='position')]),
    ('rearm: neutral', 'rearm: immediate',
     [at('f.yaml:18: drives.conveyor.rearm', 'immediate_jumps', name='angle',
         measured='position')]),
]


@pytest.mark.parametrize(('old', 'new', 'expected'), DRIVES)
def test_problem_of_a_drive(tmp_path: Path, old: str, new: str, expected: list[str]) -> None:
    assert problems(tmp_path, changed(AXIS, old, new), HELD) == expected


def test_a_control_word_moves_nothing(tmp_path: Path) -> None:
    text = changed(AXIS, '[angle]', '[word]')
    profile = changed(HELD, 'type: uint16, storage: ram', 'type: int16, storage: ram, unit: rev, '
                      'neutral_from: position, arming_tolerance: 1')
    assert problems(tmp_path, text, profile) == [
        at('f.yaml:16: drives.conveyor.cyclic_request', 'control_word_held', name='word')]


def test_no_broadcast_group(tmp_path: Path) -> None:
    text = AXIS.replace('datamodel_extended', 'cannord').replace('period: 0.02',
                                                                 'broadcast: group')
    profile = HELD.replace('datamodel_extended', 'cannord, datamodel_extended')
    assert problems(tmp_path, text, profile)[0] == (
        at('f.yaml:15: drives.conveyor.broadcast', 'broadcast_held', broadcast='group',
           name='angle'))
