# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What is wrong with a drive: one changed line each, and the lines that users see."""

import json
import math
from pathlib import Path

from configuration_builders import (
    at, changed, FILE, line_of, load, local, problems, PROFILE, PROTOCOLS, warnings, write,
)
import pytest
from saying import says

from drive_can_bridge.configuration import profiles
from drive_can_bridge.configuration.checks import DriveChecker
from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import ConfigurationError
from drive_can_bridge.protocols.families import FAMILIES

CASES = [
    ('station: 1', 'station: 2',
     [at('f.yaml:22: drives.lift.station', 'collides', station=2, other='conveyor',
         other_station=2, bus='main', purpose='29-bit frames of station 2')]),
    ('        bus: main\n', '',
     [at('f.yaml:10: drives.conveyor.bus', 'missing', allowed='a string')]),
    ('        protocol: datamodel_extended\n', '        xyz: 1\n',
     [f'f.yaml:10: drives.conveyor.protocol: missing, allowed is {PROTOCOLS}',
      at('f.yaml:12: drives.conveyor.xyz', 'unknown_key',
         hint=says('allowed', words=(
             'bus, protocol, station, profile, period, cyclic_request, cyclic_response, '
             'missed_limit, command_timeout, rearm, parameter_timeout, control_timeout, '
             'parameter_retries, verify_writes, joint')))]),
    ('        protocol: datamodel_extended\n', '        mapping: verify\n',  # of some family
     [f'f.yaml:10: drives.conveyor.protocol: missing, allowed is {PROTOCOLS}']),
    ('rearm: neutral', 'response_map_base: 48',
     [at('f.yaml:16: drives.conveyor.cyclic_request', 'mapping_parameter', name='speed',
         address='P50', base=48, last=51),
      at('f.yaml:16: drives.conveyor.cyclic_request', 'mapping_parameter', name='limit',
         address='P51', base=48, last=51)]),
    ('rearm: neutral', 'parameter_offset: 65322',
     [at('f.yaml:18: drives.conveyor.parameter_offset', 'moved_out', offset=65322, name='position',
         address='P214', most=65535),
      at('f.yaml:18: drives.conveyor.parameter_offset', 'moved_out', offset=65322,
         name='frequency', address='P215', most=65535)]),
    ('[speed, limit]', '[y, n]',
     [at('f.yaml:16: drives.conveyor.cyclic_request', 'word_as_bool', value=True, kind='a bool',
         allowed='a string'),
      at('f.yaml:16: drives.conveyor.cyclic_request', 'word_as_bool', value=False, kind='a bool',
         allowed='a string')]),
    ('[speed, limit]', '\n          - speed\n          - limt\n          - speed',
     [at('f.yaml:18: drives.conveyor.cyclic_request', 'not_in_profile', name='limt',
         hint=says('did_you_mean', word='limit')),
      at('f.yaml:19: drives.conveyor.cyclic_request', 'twice', name='speed')]),
    ('conveyor:', 'drive_can_bridge:',
     [at('f.yaml:10: drives.drive_can_bridge', 'name_of_bridge', name='drive_can_bridge')]),
    ('conveyor:', 'lift:',
     [at('f.yaml:19: drives.lift', 'duplicate_key', first=10)]),
]

#: what is wrong where the change was made, below ``drives.conveyor``
KEYS = [
    ('station: 1', 'station: 1.0', 'station',
     says('wrong_type', value=1.0, kind='a number', allowed='an integer')),
    ('station: 1', 'station: 0', 'station',
     says('value_out_of_range', value=0, least=1, most=127, remark=' (datamodel_extended)')),
    ('bus: main', 'bus: other', 'bus',
     says('unknown', name='other', hint=says('allowed', words='main'))),
    ('period: 0.02', 'period: 0.004', 'period',
     says('period_too_fast', period=0.004, least=0.005)),
    ('period: 0.02', 'period: 0.0001', 'period',
     says('out_of_range', value=0.0001, allowed='a number of 0.001 to 65.535')),
    ('period: 0.02', 'period: .inf', 'period',
     says('not_finite', value=math.inf, allowed='a number of 0.001 to 65.535')),
    ('rearm: neutral', 'zzz: 1', 'zzz',
     says('unknown_key',
          hint=says('allowed', words=(
              'bus, protocol, station, profile, period, cyclic_request, cyclic_response, '
              'missed_limit, command_timeout, rearm, parameter_timeout, control_timeout, '
              'parameter_retries, verify_writes, joint, mapping, request_map_base, '
              'response_map_base, parameter_offset, eeprom_write_gap, length_policy, '
              'allow_fast_cycle')))),
    ('[speed, limit]', '[speed, limit, word, flag, angle]', 'cyclic_request',
     says('too_many_slots', count=5, most=4)),
    ('[speed, limit]', '[actual]', 'cyclic_request', says('read_only', name='actual')),
    ('[speed, limit]', '[ramp]', 'cyclic_request', says('kept_in_eeprom', name='ramp')),
    ('[speed, limit]', '[p50]', 'cyclic_request',
     says('not_in_profile', name='p50',
          hint=says('allowed', words='speed, limit, word, flag, angle, order'))),
    ('[speed, limit]', 'speed', 'cyclic_request',
     says('one_entry', value='speed', kind='a string', allowed='a list of strings')),
    ('[actual, current, status]', '[order]', 'cyclic_response', says('write_only', name='order')),
    ('[actual, current, status]', '[actual, current, status, position, frequency]',
     'cyclic_response', says('too_many_slots', count=5, most=4)),
    ('[actual, current, status]', '[actual, actual]', 'cyclic_response',
     says('twice', name='actual')),
    ('profile: table', 'profile: table.yaml', 'profile',
     says('name_with_suffix', name='table.yaml', suffix='.yaml')),
]


@pytest.mark.parametrize(('old', 'new', 'expected'), CASES)
def test_problem_of_a_drive(tmp_path: Path, old: str, new: str, expected: list[str]) -> None:
    assert problems(tmp_path, changed(FILE, old, new)) == expected


@pytest.mark.parametrize(('old', 'new', 'key', 'found'), KEYS)
def test_problem_of_a_key(tmp_path: Path, old: str, new: str, key: str, found: says) -> None:
    place = f'f.yaml:{line_of(FILE, old)}: drives.conveyor.{key}'
    assert problems(tmp_path, changed(FILE, old, new)) == [at(place, found.code, **found.fields)]


#: a line in place of ``rearm: neutral``, and what is wrong with its value
VALUES = [
    ('rearm: neutrl', says('unknown_word', value='neutrl', near=says('near', word='neutral'),
                           allowed='neutral or immediate')),
    ('missed_limit: 0', says('out_of_range', value=0, allowed='an integer of 1 to 1000000')),
    ('missed_limit: 0.5', says('wrong_type', value=0.5, kind='a number',
                               allowed='an integer of 1 to 1000000')),
    ('command_timeout: -1', says('out_of_range', value=-1, allowed='a number of 0 to 3600')),
    ('parameter_timeout: 0', says('out_of_range', value=0, allowed='a number of 0.001 to 60')),
    ('control_timeout: x', says('wrong_type', value='x', kind='a string',
                                allowed='a number of 0.01 to 600')),
    ('parameter_retries: -1', says('out_of_range', value=-1, allowed='an integer of 0 to 100')),
    ('verify_writes: 1', says('wrong_type', value=1, kind='an integer', allowed='true or false')),
    ('mapping: verfy', says('unknown_word', value='verfy', near=says('near', word='verify'),
                            allowed='verify, configure or assume')),
    ('mapping: on', says('unknown_word', value=True, near='',
                         allowed='verify, configure or assume')),
    ('length_policy: no', says('unknown_word', value=False, near='', allowed='lenient or strict')),
    ('eeprom_write_gap: 0.01', says('out_of_range', value=0.01, allowed='a number of 0.02 to 60')),
    ('allow_fast_cycle: 1', says('wrong_type', value=1, kind='an integer',
                                 allowed='true or false')),
    ('request_map_base: 0', says('out_of_range', value=0, allowed='an integer of 1 to 65531')),
    ('request_map_base: 124', says('maps_overlap', request=124, response=126, distance=4)),
    ('response_map_base: 124', says('maps_overlap', request=122, response=124, distance=4)),
    ('response_map_base: 65532', says('out_of_range', value=65532,
                                      allowed='an integer of 1 to 65531')),
    ('parameter_offset: -31', says('moved_out', offset=-31, name='ramp', address='P30',
                                   most=65535)),
    ('parameter_offset: 70000', says('out_of_range', value=70000,
                                     allowed='an integer of -65535 to 65535')),
]


@pytest.mark.parametrize(('line', 'found'), VALUES)
def test_value_of_a_key(tmp_path: Path, line: str, found: says) -> None:
    place = f'f.yaml:18: drives.conveyor.{line.partition(":")[0]}'
    assert problems(tmp_path, changed(FILE, 'rearm: neutral', line)) == [
        at(place, found.code, **found.fields)]


# rcl cannot parse a remap rule for a node with __ in its name
@pytest.mark.parametrize(('name', 'meant'), [
    ('Conveyor', 'conveyor'), ('conv__eyor', 'conv_eyor'), ('1a', ''), ('a\n', 'a'),
    ('c' * 101, '')])
def test_name_of_a_drive(tmp_path: Path, name: str, meant: str) -> None:
    text = changed(FILE, 'conveyor:', f'{json.dumps(name)}:')
    assert problems(tmp_path, text) == [
        at(f'f.yaml:10: drives.{name}', 'wrong_name' if meant else 'wrong', value=name,
           allowed='a name of a-z, 0-9 and _ that begins with a letter and has no __, at most 100 '
                   'characters', **({'name': meant} if meant else {}))]


def test_good_file(tmp_path: Path) -> None:
    configuration = load(tmp_path)
    conveyor, lift = configuration.drives.values()
    assert configuration.warnings == ()
    assert (conveyor.name, conveyor.bus, conveyor.station, conveyor.period) == (
        'conveyor', 'main', 1, 0.02)
    assert [parameter.name for parameter in conveyor.cyclic_request] == ['speed', 'limit']
    assert [parameter.number for parameter in conveyor.cyclic_response] == [209, 210, 211]
    assert conveyor.profile.name == conveyor.profile_key == 'table'
    assert conveyor.profile is lift.profile


@pytest.mark.parametrize(('new', 'attribute', 'value'), [
    ('rearm: immediate', 'rearm_immediate', True),
    ('missed_limit: 010', 'missed_limit', 8),
    ('command_timeout: 0', 'command_timeout', 0.0),
    ('command_timeout: 1', 'command_timeout', 1.0),
    ('verify_writes: n', 'verify_writes', False),
    ('parameter_retries: 0', 'parameter_retries', 0),
])
def test_given_value(tmp_path: Path, new: str, attribute: str, value: object) -> None:
    drive = load(tmp_path, changed(FILE, 'rearm: neutral', new)).drives['conveyor']
    found = getattr(drive, attribute)
    assert found == value
    assert type(found) is type(value)


def test_names_too_long_together(tmp_path: Path) -> None:
    """ROS has at most 247 characters for the topic of a bit: /DRIVE/PARAMETER/BIT."""
    drive, name = 'c' * 100, 's' * 100
    text = changed(changed(FILE, 'conveyor', drive), 'current, status', f'status, {name}')

    def profile(bit: str) -> str:
        return changed(PROFILE, '  position:', (
            f'  {name}: {{number: 212, access: ro, bits: {{{bit}: 1}}}}\n  position:'))
    assert problems(tmp_path, text, profile('b' * 44)) == []
    assert problems(tmp_path, text, profile('b' * 45)) == [
        at(f'f.yaml:10: drives.{drive}', 'topic_too_long', length=248, most=247,
           topic=f'~/{name}/{"b" * 45}')]


PROTOCOL = 'f.yaml:12: drives.conveyor.protocol'
AVAILABLE = ', '.join(FAMILIES)


@pytest.mark.parametrize(('given', 'found'), [
    ('datamodel_extende', at(PROTOCOL, 'unknown_protocol', value='datamodel_extende',
                             near=says('near', word='datamodel_extended'), allowed=AVAILABLE)),
    ('xyz', at(PROTOCOL, 'unknown_protocol', value='xyz', near='', allowed=AVAILABLE)),
    ('5', at(PROTOCOL, 'no_protocol', value=5, allowed=AVAILABLE)),
    ('[a]', at(PROTOCOL, 'no_protocol', value=['a'], allowed=AVAILABLE)),
])
def test_unknown_protocol(tmp_path: Path, given: str, found: object) -> None:
    text = changed(FILE, 'protocol: datamodel_extended', f'protocol: {given}\n        perod: 1')
    assert problems(tmp_path, text) == [
        found,
        at('f.yaml:13: drives.conveyor.perod', 'unknown_key',
           hint=says('did_you_mean', word='period'))]


def test_no_profile_anywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> Path:
        raise FileNotFoundError
    monkeypatch.setattr(profiles, 'profiles_directory', missing)     # an incomplete installation
    path = write(tmp_path)
    (tmp_path / 'empty').mkdir()
    path.write_text(changed(path.read_text(), f'[{tmp_path}]', f'[{tmp_path}/empty]'))
    with pytest.raises(ConfigurationError) as caught:
        configuration_from_file(path)
    assert local(tmp_path, caught.value.problems)[0] == at(
        'f.yaml:14: drives.conveyor.profile', 'unknown_profile', name='table',
        hint=says('no_profile_at_all'))


def test_no_drive_gets_lost_in_silence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check = DriveChecker.check

    def lost(self: DriveChecker) -> DriveConfiguration | None:
        drive = check(self)
        return None if drive is not None and drive.name == 'lift' else drive
    monkeypatch.setattr(DriveChecker, 'check', lost)
    assert problems(tmp_path) == [at('f.yaml:19: drives.lift', 'nobody_knows')]


def test_unknown_profile_names_the_places(tmp_path: Path) -> None:
    found = problems(tmp_path, changed(FILE, 'profile: table', 'profile: tabel'))
    assert found == [at('f.yaml:14: drives.conveyor.profile', 'unknown_profile', name='tabel',
                        hint=says('did_you_mean', word='table'))]
    places = found[0].fields['places']
    assert places.startswith(f'{tmp_path}, ') and places.endswith('config/profiles')


def test_all_problems_at_once(tmp_path: Path) -> None:
    text = FILE
    for old, new in (
            ('channel: demo', 'chanel: demo'), ('bus: main', 'bus: mian'),
            ('station: 1', 'station: 0x80'), ('period: 0.02', 'period: 0.001'),
            ('[speed, limit]', '[speed, limt]'), ('rearm: neutral', 'rearm: *x'),
            ('station: 2', 'station: two'), ('cyclic_response: [actual, status]', 'joint: {}')):
        text = changed(text, old, new)
    profile = changed(changed(PROFILE, 'parameter: word', 'parameter: wrod'),
                      'number: 51', 'number: x')
    assert problems(tmp_path, text, profile) == [
        at('f.yaml:5: buses.main.channel', 'missing', allowed='a string or an integer'),
        at('f.yaml:7: buses.main.chanel', 'unknown_key',
           hint=says('did_you_mean', word='channel')),
        at('f.yaml:11: drives.conveyor.bus', 'unknown', name='mian',
           hint=says('did_you_mean', word='main')),
        at('f.yaml:13: drives.conveyor.station', 'value_out_of_range', value=128, least=1,
           most=127, remark=' (datamodel_extended)'),
        at('f.yaml:15: drives.conveyor.period', 'period_too_fast', period=0.001, least=0.005),
        at('f.yaml:16: drives.conveyor.cyclic_request', 'not_in_profile', name='limt',
           hint=says('did_you_mean', word='limit')),
        at('f.yaml:18: drives.conveyor.rearm', 'alias', why=' (rcl refuses the file)'),
        at('f.yaml:22: drives.lift.station', 'wrong_type', value='two', kind='a string',
           allowed='an integer'),
        at('f.yaml:25: drives.lift.joint', 'garbling_mapping'),
        at('table.yaml:5: parameters.limit.number', 'wrong_type', value='x', kind='a string',
           allowed='an integer of 0 to 65535'),
        at('table.yaml:17: control.parameter', 'unknown', name='wrod',
           hint=says('did_you_mean', word='word')),
    ]


def test_every_later_drive_of_a_station_collides(tmp_path: Path) -> None:
    text = changed(FILE, 'station: 2', 'station: 1')
    text += text[text.index('      lift:'):].replace('lift', 'third')
    assert [line.split(':')[1:3] for line in problems(tmp_path, text)] == [
        ['22', ' drives.lift.station'], ['29', ' drives.third.station']]


OTHER_BUS = changed(FILE, '    drives:\n',
                    '      other: {interface: virtual, channel: second}\n    drives:\n')


@pytest.mark.parametrize(('text', 'changes'), [
    # equal stations on different buses
    (OTHER_BUS, [('station: 2', 'station: 1'), ('bus: main', 'bus: other')]),
    # the control word may be sent cyclically
    (FILE, [('[speed, limit]', '[word, speed]')]),
    (FILE, [('period: 0.02', 'period: 0.004\n        allow_fast_cycle: true')]),
    (FILE, [('period: 0.02', 'period: 0.005')]),
    (FILE, [('conveyor', 'c' * 100)]),
])
def test_all_right(tmp_path: Path, text: str, changes: list[tuple[str, str]]) -> None:
    for old, new in changes:
        text = changed(text, old, new)
    assert problems(tmp_path, text) == []


def test_control_without_its_status_word(tmp_path: Path) -> None:
    assert warnings(tmp_path, changed(FILE, '[actual, status]', '[actual]')) == [
        at('f.yaml:25: drives.lift.cyclic_response', 'status_missing', name='status')]


@pytest.mark.parametrize('entry', [
    'limit: {number: 51}',
    'limit: {number: 51, neutral: 300, scale: 0.1}',
    'limit: {number: 51, limit: false}'])
def test_what_looks_like_a_limit_and_is_none(tmp_path: Path, entry: str) -> None:
    """Until somebody arms it, the drive has none of it."""
    old = 'limit: {neutral: 100, limit: true, number: 51, type: uint16}'
    found, = warnings(tmp_path, profile=changed(PROFILE, old, entry))
    assert found == at('f.yaml:16: drives.conveyor.cyclic_request', 'looks_like_limit')


def test_what_may_look_like_a_limit(tmp_path: Path) -> None:
    """By its description, too; not what a joint is commanded by, nor the control word."""
    table = changed(PROFILE, 'maximum: 3000}', 'maximum: 3000, description: Of the Maximum speed}')
    found = warnings(tmp_path, profile=table)
    assert [line.split(':')[1] for line in found] == ['16', '24']
    joint = changed(FILE, '        rearm: neutral\n',
                    '        joint: {name: j, velocity_command: speed, velocity: actual}\n')
    assert [line.split(':')[1] for line in warnings(tmp_path, joint, table)] == ['24']
    word = changed(PROFILE, 'word: {number: 52', 'word: {description: Limits, number: 52')
    assert warnings(tmp_path, changed(FILE, '[speed, limit]', '[word, speed]'), word) == []


def test_control_word_is_no_limit(tmp_path: Path) -> None:
    table = changed(PROFILE, 'storage: ram}', 'storage: ram, limit: true, neutral: 0}')
    found, = problems(tmp_path, changed(FILE, '[speed, limit]', '[word, speed]'), table)
    assert found == at('f.yaml:16: drives.conveyor.cyclic_request', 'control_word_limit')


@pytest.mark.parametrize(('period', 'told'), [('20', True), ('5.0', True), ('0.5', False)])
def test_a_period_that_was_meant_in_milliseconds(tmp_path: Path, period: str, told: bool) -> None:
    found = warnings(tmp_path, changed(FILE, 'period: 0.02', f'period: {period}'))
    assert found == ([at('f.yaml:15: drives.conveyor.period', 'period_in_seconds',
                         period=float(period))] if told else [])


def test_without_buses_their_absence_is_all_that_is_told(tmp_path: Path) -> None:
    begin, rest = FILE.split('    buses:\n')
    text = begin + rest[rest.index('    drives:\n'):]
    assert [line.split(': ')[1] for line in problems(tmp_path, text)] == ['buses']
