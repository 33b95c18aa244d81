# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Setpoints that stay where the axis is: what a profile and a drive have to say about them."""

from pathlib import Path

from configuration_builders import changed, FILE, load, problems, PROFILE
import pytest

HELD = changed(PROFILE, 'type: int16, unit: deg}', 'type: int16, unit: rev, minimum: 10, '
               'neutral_from: position, arming_tolerance: 2}')
AXIS = changed(changed(FILE, '[speed, limit]', '[angle]'), '[actual, current, status]',
               '[position, status]')

PROFILES = [
    ('arming_tolerance: 2', 'arming_tolerance: -1',
     ['table.yaml:8: parameters.angle.arming_tolerance: -1 is out of range, allowed is a number '
      'of at least 0']),
    (', arming_tolerance: 2', '',
     ['table.yaml:8: parameters.angle.neutral_from: needs arming_tolerance: how far a command may '
      'be from where the axis is and still arm, allowed is to give it too']),
    ('minimum: 10', 'neutral: 0',
     ['table.yaml:8: parameters.angle.neutral: stands beside neutral_from, allowed is one of '
      'them']),
    ('neutral_from: position', 'neutral_from: positon',
     ["table.yaml:8: parameters.angle.neutral_from: 'positon' is not in the profile, did you mean "
      "'position'?"]),
    ('neutral_from: position', 'neutral_from: actual',
     ["table.yaml:8: parameters.angle.neutral_from: 'actual' has the unit 'rpm', allowed is an "
      "actual value with the unit 'rev', that of 'angle'"]),
    ('neutral_from: position', 'neutral_from: order',
     ["table.yaml:8: parameters.angle.neutral_from: 'order' is no actual value, allowed is one "
      'that can be read']),
    ('neutral_from: position', 'neutral_from: flag',
     ["table.yaml:8: parameters.angle.neutral_from: 'flag' is a bool, allowed is a number"]),
    ('neutral_from: position', 'neutral_from: angle',
     ["table.yaml:8: parameters.angle.neutral_from: 'angle' is no actual value, allowed is one "
      'that can be read']),
    ('neutral_from: position', 'access: ro, neutral_from: position',
     ["table.yaml:8: parameters.angle.neutral_from: 'angle' is read-only, allowed in parameters "
      'with access rw or wo']),
    ('flag: {number: 53, type: bool}',
     'flag: {number: 53, type: bool, neutral_from: status, arming_tolerance: 1}',
     ['table.yaml:7: parameters.flag.neutral_from: a bool has no neutral_from, allowed is to '
      'leave it out',
      'table.yaml:7: parameters.flag.arming_tolerance: a bool has no arming_tolerance, allowed is '
      'to leave it out']),
]


@pytest.mark.parametrize(('old', 'new', 'expected'), PROFILES)
def test_problem_of_a_profile(tmp_path: Path, old: str, new: str, expected: list[str]) -> None:
    assert [line for line in problems(tmp_path, AXIS, changed(HELD, old, new))
            if line.startswith('table')] == expected


def test_limits_do_not_bound_it(tmp_path: Path) -> None:
    """Raw 0 is out of its limits, and yet it needs no neutral."""
    angle = load(tmp_path, AXIS, HELD).drives['conveyor'].cyclic_request[0]
    assert (angle.neutral_from, angle.arming_tolerance, angle.minimum) == ('position', 2.0, 10.0)


DRIVES = [
    ('[position, status]', '[actual, status]',
     ["f.yaml:16: drives.conveyor.cyclic_request: 'angle' is neutral at 'position', which is not "
      'in cyclic_response, allowed is to add it there']),
    ('rearm: neutral', 'rearm: immediate',
     ["f.yaml:18: drives.conveyor.rearm: 'immediate' would let 'angle' jump from 'position', "
      "allowed with neutral_from is 'neutral'"]),
]


@pytest.mark.parametrize(('old', 'new', 'expected'), DRIVES)
def test_problem_of_a_drive(tmp_path: Path, old: str, new: str, expected: list[str]) -> None:
    assert problems(tmp_path, changed(AXIS, old, new), HELD) == expected


def test_no_broadcast_group(tmp_path: Path) -> None:
    text = AXIS.replace('datamodel_extended', 'cannord').replace('period: 0.02',
                                                                 'broadcast: group')
    profile = HELD.replace('datamodel_extended', 'cannord, datamodel_extended')
    assert problems(tmp_path, text, profile)[0] == (
        "f.yaml:15: drives.conveyor.broadcast: 'group' sends the same 'angle' to several axes, "
        'allowed with neutral_from is none')
