# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a profile says about itself: identity, protected entries, steps around a restore, trust."""

from pathlib import Path

import pytest

from drive_can_bridge.configuration.profile_check import LoadedProfile
from drive_can_bridge.configuration.profiles import read_profile
from drive_can_bridge.core.profile import RestoreStep, RestoreTable

PROFILE = """\
protocols: [canopen_pkw]
identity: [firmware, serial]
restore:
  before: {mode: {configuration: true, lock: false}, ramp: 0.5}
  after: {flag: false, wide: 70000}
sources: {manual: 'The manual, page 3'}
parameters:
  firmware: {number: 76, access: ro, source: 'manual, row 2', verified: true}
  serial: {number: 70, access: ro, source: manual, verified: false, open: its unit}
  mode: {number: 601, bits: {configuration: 0, lock: 4}, protected: true}
  ramp: {number: 30, type: int16, scale: 0.01, unit: s, minimum: 0.01, maximum: 60}
  flag: {number: 31, type: bool}
  wide: {number: 40, type: uint32}
  order: {number: 55, access: wo, bits: {go: 0}}
"""


def loaded(folder: Path, old: str = '', new: str = '') -> LoadedProfile:
    path = folder / 't.yaml'
    if old not in PROFILE:
        raise ValueError(f'{old!r} is not in the profile')
    path.write_text(PROFILE.replace(old, new, 1) if old else PROFILE)
    return read_profile(path)


def test_good_sections(tmp_path: Path) -> None:
    found = loaded(tmp_path)
    assert found.problems == []
    profile = found.profile
    assert profile.identity == ('firmware', 'serial')
    assert profile.restore == RestoreTable(
        before=(RestoreStep('mode', bits=0x0001, mask=0x0011),
                RestoreStep('ramp', bits=50, mask=0xFFFF)),
        after=(RestoreStep('flag', bits=0, mask=0xFFFF),
               RestoreStep('wide', bits=70000, mask=0xFFFFFFFF)))
    assert [name for name, each in profile.parameters.items() if each.protected] == ['mode']
    assert {name: each.verified for name, each in profile.parameters.items()
            if each.verified is not None} == {'firmware': True, 'serial': False}


def test_without_the_sections(tmp_path: Path) -> None:
    text = PROFILE[:PROFILE.index('identity')] + PROFILE[PROFILE.index('sources'):]
    (tmp_path / 't.yaml').write_text(text)
    profile = read_profile(tmp_path / 't.yaml').profile
    assert (profile.identity, profile.restore) == ((), RestoreTable())


@pytest.mark.parametrize(('old', 'new', 'expected'), [
    ('[firmware, serial]', '[firmware, seral]',
     ["t.yaml:2: identity: 'seral' is unknown, did you mean 'serial'?"]),
    ('[firmware, serial]', '[firmware, order]',
     ["t.yaml:2: identity: 'order' is write-only, allowed are parameters with access ro or rw"]),
    ('[firmware, serial]', '[firmware, firmware]',
     ["t.yaml:2: identity: 'firmware' stands twice, allowed is once"]),
    ('[firmware, serial]', 'firmware',
     ["t.yaml:2: identity: 'firmware' is a string, allowed is a list of strings: write "
      '[firmware]']),
    ('before:', 'befor:',
     ["t.yaml:4: restore.befor: unknown key, did you mean 'before'?"]),
    ('ramp: 0.5', 'firmware: 1',
     ["t.yaml:4: restore.before.firmware: 'firmware' is read-only, allowed are parameters with "
      'access rw or wo']),
    ('ramp: 0.5', 'rampe: 1',
     ["t.yaml:4: restore.before.rampe: 'rampe' is unknown, did you mean 'ramp'?"]),
    ('ramp: 0.5', 'ramp: 61',
     ['t.yaml:4: restore.before.ramp: 61 cannot be written, allowed is 0.01 to 60 s']),
    ('flag: false', 'flag: 0',
     ['t.yaml:5: restore.after.flag: 0 cannot be written, allowed is true or false']),
    ('lock: false', 'lok: false',
     ["t.yaml:4: restore.before.mode.lok: 'lok' is no bit of mode, did you mean 'lock'?"]),
    ('lock: false', 'lock: 0',
     ['t.yaml:4: restore.before.mode.lock: 0 is an integer, allowed is true or false']),
    ('ramp: 0.5', 'order: {go: true}',
     ["t.yaml:4: restore.before.order: 'order' is write-only: its other bits cannot be kept, "
      'allowed is a value']),
    ('protected: true', 'protected: 1',
     ['t.yaml:10: parameters.mode.protected: 1 is an integer, allowed is true or false']),
    ('verified: true', 'verified: partly',
     ["t.yaml:8: parameters.firmware.verified: 'partly' is a string, allowed is true or false"]),
])
def test_problem(tmp_path: Path, old: str, new: str, expected: list[str]) -> None:
    found = loaded(tmp_path, old, new)
    assert [str(each).replace(f'{tmp_path}/', '') for each in found.problems] == expected
    if 'restore' in expected[0]:  # half of a sequence is worse than none
        assert found.profile.restore == RestoreTable()


def test_what_follows_from_a_wrong_entry_is_not_another_problem(tmp_path: Path) -> None:
    found = loaded(tmp_path, 'type: bool', 'type: boole')
    assert len(found.problems) == 1
    assert found.profile.restore == RestoreTable()
