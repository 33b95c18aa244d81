# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What is wrong with a profile: one changed line each."""

import math
from pathlib import Path

from configuration_builders import (
    at, changed, FILE, line_of, load, problems, PROFILE, PROTOCOLS, warnings,
)
import pytest
from saying import says

from drive_can_bridge.core.parameters import AccessMode, Parameter, ParameterType, Storage
from drive_can_bridge.core.profile import ControlTable, StatusPattern

CASES = [
    ('number: 51', 'number: 0',
     [at('f.yaml:16: drives.conveyor.cyclic_request', 'number_zero', name='limit', most=65535)]),
    ('number: 51', 'number: 50',
     [at('f.yaml:16: drives.conveyor.cyclic_request', 'same_number', name='limit', other='speed',
         address='P50')]),
    ('number: 51', 'number: 123',
     [at('f.yaml:16: drives.conveyor.cyclic_request', 'mapping_parameter', name='limit',
         address='P123', base=122, last=125)]),
    ('limit:', 'Limit:',
     [at('f.yaml:16: drives.conveyor.cyclic_request', 'not_in_profile', name='limit',
         hint=says('did_you_mean', word='Limit')),
      at('table.yaml:5: parameters.Limit', 'wrong_name', value='Limit', name='limit',
         allowed='a name of a-z, 0-9 and _ that begins with a letter, at most 100 characters')]),
    ('minimum: -3000', 'minimum: 10',
     [at('f.yaml:16: drives.conveyor.cyclic_request', 'no_neutral', name='speed',
         allowed='10 to 3000 rpm'),
      at('f.yaml:24: drives.lift.cyclic_request', 'no_neutral', name='speed',
         allowed='10 to 3000 rpm')]),
    ('type: bool', 'type: bool, scale: 2, minimum: 0, neutral: 1',
     [at('table.yaml:7: parameters.flag.scale', 'bool_has_no', entry='scale'),
      at('table.yaml:7: parameters.flag.minimum', 'bool_has_no', entry='minimum'),
      at('table.yaml:7: parameters.flag.neutral', 'no_bool', value=1)]),
    ('protocols: [datamodel_extended]', 'protocols: [cannord]',
     [at('f.yaml:14: drives.conveyor.profile', 'profile_for_others', name='table',
         protocols='cannord', family='datamodel_extended'),
      at('f.yaml:23: drives.lift.profile', 'profile_for_others', name='table', protocols='cannord',
         family='datamodel_extended')]),
    ('protocols: [datamodel_extended]\nparameters:\n  speed: {number: 50,',
     'protocols: [cannord]\nparameters:\n  torque: {type: int32}\n  speeds: {',
     [at('f.yaml:14: drives.conveyor.profile', 'profile_for_others', name='table',
         protocols='cannord', family='datamodel_extended'),     # nothing of it fits
      at('f.yaml:23: drives.lift.profile', 'profile_for_others', name='table', protocols='cannord',
         family='datamodel_extended')]),
    ('protocols: [datamodel_extended]', 'protocols: [datamodel]',
     ["table.yaml:2: protocols: 'datamodel' is unknown (did you mean 'datamodel_extended'?), "
      f'allowed is {PROTOCOLS}']),
    ('protocols: [datamodel_extended]', 'protocols: []',
     [at('table.yaml:2: protocols', 'number_of_values', count=0, allowed='at least 1')]),
    ('protocols: [datamodel_extended]', 'protocols: datamodel_extended',
     ["table.yaml:2: protocols: 'datamodel_extended' is a string, allowed is a list of "
      f'{PROTOCOLS}: write [datamodel_extended]']),
    ('protocols: [datamodel_extended]\n', '',
     [f'table.yaml:1: protocols: missing, allowed is a list of {PROTOCOLS}']),
    ('parameter: word', 'parameter: actual',
     [at('table.yaml:17: control.parameter', 'read_only_one', name='actual')]),
    ('enable: 1', 'enable: 0',
     [at('table.yaml:18: control.words.enable', 'word_twice', word=0, entry='disable')]),
    ('quick_stop: 2', 'quick_stop: 1',
     [at('table.yaml:18: control.words.enable', 'word_twice', word=1, entry='quick_stop')]),
    ('reset_fault: 128', 'reset_fault: 1',
     [at('table.yaml:18: control.words.enable', 'word_twice', word=1, entry='reset_fault')]),
    ('enable: 1', 'enable: 65536',
     [at('table.yaml:18: control.words.enable', 'word_too_large', word=65536, name='word',
         largest=65535, type='uint16')]),
    ('enable: 1', 'enabel: 1',
     [at('table.yaml:18: control.words.enabel', 'unknown_key',
         hint=says('did_you_mean', word='enable')),
      at('table.yaml:18: control.words.enable', 'missing',
         allowed='an integer of 0 to 4294967295')]),
    ('ready: [1, 1]', 'ready: [1, 2]',
     [at('table.yaml:19: control.status.ready', 'outside_mask', value=2, mask=1)]),
    ('ready: [1, 1]', 'ready: [0, 0]',
     [at('table.yaml:19: control.status.ready', 'mask_of_nothing')]),
    ('ready: [1, 1]', 'ready: [1]',
     [at('table.yaml:19: control.status.ready', 'number_of_values', count=1, allowed='2')]),
    ('ready: [1, 1]', 'ready: [65536, 0]',
     [at('table.yaml:19: control.status.ready', 'mask_too_large', mask=65536, name='status',
         largest=65535, type='uint16')]),
    ('ready: [1, 1]', 'ready: 1',
     [at('table.yaml:19: control.status.ready', 'wrong_type', value=1, kind='an integer',
         allowed='a list of 2 integers of 0 to 4294967295')]),
    ('parameter: status', 'parameter: statsu',
     [at('table.yaml:19: control.status.parameter', 'unknown', name='statsu',
         hint=says('did_you_mean', word='status'))]),
    ('parameter: status', 'parameter: order',
     [at('table.yaml:19: control.status.parameter', 'write_only_one', name='order')]),
    ('fault: [8, 8]', 'falt: [8, 8]',
     [at('table.yaml:19: control.status.falt', 'unknown_key',
         hint=says('did_you_mean', word='fault'))]),
    ('description: for tests', 'description: *x',
     [at('table.yaml:1: description', 'alias', why='')]),
    ('description: for tests', 'description:',
     [at('table.yaml:1: description', 'no_value', why='')]),
    ('description: for tests', 'control: 1',
     [at('table.yaml:1: control', 'wrong_type', value=1, kind='an integer', allowed='a mapping'),
      at('table.yaml:16: control', 'duplicate_key', first=1)]),
    ('description: for tests\n', 'just text\n---\n',
     [at('table.yaml:1: yaml', 'no_profile')]),
    ('description: for tests\n', '--- {}\n--- \n',
     [f'table.yaml:1: protocols: missing, allowed is a list of {PROTOCOLS}',
      at('table.yaml:1: parameters', 'missing', allowed='a mapping'),
      at('table.yaml:2: yaml', 'second_document')]),
    ('storage: ram}', 'storage: ram, limit: true, neutral: 0}', []),
    ('storage: ram}', 'storage: ram, values: {0: off, 1: on}}',
     [at('table.yaml:6: parameters.word.values.0', 'word_is_bool', word='false, off or no'),
      at('table.yaml:6: parameters.word.values.1', 'word_is_bool', word='true, on or yes')]),
    ('storage: ram}', 'storage: ram, values: {0: a, 1: a, 0x0: b, 2: 5}}',
     [at('table.yaml:6: parameters.word.values.1', 'name_of_other', name='a', other='0'),
      at('table.yaml:6: parameters.word.values.0x0', 'number_twice', entry='0x0', other='0'),
      at('table.yaml:6: parameters.word.values.2', 'is_number', name=5)]),
    ('control:\n', 'fault: {parameter: statsu, codes: {7: hot}}\ncontrol:\n',
     [at('table.yaml:16: fault.parameter', 'unknown', name='statsu',
         hint=says('did_you_mean', word='status'))]),
    ('control:\n', 'fault: {parameter: order, codes: {7: hot, 9: hot}, bit: status.ready}\n'
     'control:\n',
     [at('table.yaml:16: fault.parameter', 'write_only_one', name='order'),
      at('table.yaml:16: fault.codes.9', 'name_of_other', name='hot', other='7')]),
    ('control:\n', 'fault: {parameter: current, codes: {7: hot}}\ncontrol:\n', []),
    ('control:\n', 'fault: {parameter: current, codes: {7: "24 V missing", 8: "+1"}}\n'
     'control:\n',
     [at('table.yaml:16: fault.codes.8', 'no_name', name='+1', longest=60)]),
    ('control:\n', 'fault: {parameter: current, codes: {}}\ncontrol:\n',
     [at('table.yaml:16: fault.codes', 'empty_mapping')]),
    ('control:\n', 'fault: {parameter: current, bit: status.redy}\ncontrol:\n',
     [at('table.yaml:16: fault.bit', 'no_bit', bit='redy', name='status',
         hint=says('did_you_mean', word='ready'))]),
    ('control:\n', 'fault: {parameter: current, bit: actual.fault}\ncontrol:\n',
     [at('table.yaml:16: fault.bit', 'no_named_bits', name='actual')]),
    ('control:\n', 'restore: {before: {order: {a: true}}}\ncontrol:\n',
     [at('table.yaml:16: restore.before.order.a', 'no_bit', bit='a', name='order',
         hint=says('nothing_allowed')),
      at('table.yaml:16: restore.before.order', 'write_only_bits', name='order')]),
    ('parameters:', 'parametrs:',
     [at('table.yaml:1: parameters', 'missing', allowed='a mapping'),
      at('table.yaml:3: parametrs', 'unknown_key', hint=says('did_you_mean', word='parameters'))]),
    ('control:\n', 'restore: {before: {limit: 70000}}\ncontrol:\n',
     [at('table.yaml:16: restore.before.limit', 'cannot_be_written', value=70000,
         allowed='0 to 65535')]),
]

#: what is wrong where the change was made, below ``parameters``
ENTRIES = [
    ('number: 51, type: uint16', 'number: 51, type: uint32', 'limit.type',
     says('no_such_type', type='uint32', family='datamodel_extended',
          allowed='bool, int16, uint16')),
    ('number: 51', 'number: 70000', 'limit.number',
     says('out_of_range', value=70000, allowed='an integer of 0 to 65535')),
    ('number: 51, ', '', 'limit.number',
     says('number_missing', family='datamodel_extended', most=65535)),
    ('number: 51', 'number: 65535', 'limit.access',
     says('access_impossible', access='rw', name=65535)),
    ('type: uint16', 'type: unit16', 'limit.type',
     says('unknown_word', value='unit16', near=says('near', word='uint16'),
          allowed='bool, int8, uint8, int16, uint16, int32 or uint32')),
    ('type: uint16', 'scale: 0', 'limit.scale', says('useless', value=0)),
    ('type: uint16', 'subindex: 4', 'limit.subindex',
     says('no_subindex', family='datamodel_extended')),
    ('type: uint16', 'word_order: high_first', 'limit.word_order',
     says('one_word', type='uint16')),
    ('ramp:', 'actual:', 'actual', says('duplicate_key', first=10)),
    ('ready: 0', 'command: 0', 'status.bits.command', says('name_taken', name='command')),
    ('ready: 0', 'ready: 16', 'status.bits.ready',
     says('no_such_bit', position=16, type='uint16', highest=15)),
    ('ready: 0', 'Ready: 1', 'status.bits.Ready',
     says('wrong_name', value='Ready', name='ready',
          allowed='a name of a-z, 0-9 and _ that begins with a letter, at most 100 characters')),
    ('ready: 0', 'p1: 0', 'status.bits.p1', says('raw_name', name='p1')),
    ('minimum: -3000', 'minimum: 3001', 'speed.minimum',
     says('above_maximum', minimum=3001, maximum=3000)),
    ('minimum: -3000, maximum: 3000', 'minimum: 4000, maximum: 5000', 'speed.minimum',
     says('no_value_between', type='int16', scale='', limits='4000 to 5000 rpm',
          nearest='3276.7 rpm')),
    ('minimum: -3000, maximum: 3000', 'maximum: -4000', 'speed.maximum',
     says('no_value_between', type='int16', scale='', limits='at most -4000 rpm',
          nearest='-3276.8 rpm')),
    ('minimum: -3000, maximum: 3000', 'minimum: 0.01, maximum: 0.09', 'speed.minimum',
     says('no_value_between', type='int16', scale=' with scale 0.1', limits='0.01 to 0.09 rpm',
          nearest='0.0 rpm')),
    ('type: uint16}', 'type: uint16, maximum: -1}', 'limit.maximum',
     says('no_value_between', type='uint16', scale='', limits='at most -1', nearest='0')),
    ('maximum: 3000', 'maximum: 3000, neutral: 5000', 'speed.neutral',
     says('cannot_be_sent', name=5000, kind='', allowed='-3000 to 3000 rpm')),
    ('maximum: 3000', 'maximum: 3000, neutral: true', 'speed.neutral', says('is_bool', name=True)),
    ('type: uint16}', 'type: uint16, maximum: 0.5}', 'limit.maximum',
     says('no_integer', limit=0.5)),
    ('neutral: 100,', 'neutral: 0.5,', 'limit.neutral',
     says('cannot_be_sent', name=0.5, kind='an integer, ', allowed='0 to 65535')),
    ('neutral: 100,', 'neutral: 70000,', 'limit.neutral',
     says('cannot_be_sent', name=70000, kind='an integer, ', allowed='0 to 65535')),
    ('type: uint16}', 'type: uint16, minimum: .inf}', 'limit.minimum',
     says('not_finite', value=math.inf, allowed='a number')),
    ('type: bool', 'type: bool, bits: {a: 1}', 'flag.bits.a',
     says('no_such_bit', position=1, type='bool', highest=0)),
    ('storage: ram', 'acces: ro', 'word.acces',
     says('unknown_key', hint=says('did_you_mean', word='access'))),
    ('unit: rev', 'unit: ""', 'position.unit', says('empty_string')),
    ('limit: {neutral: 100, limit', 'limit: {limit', 'limit.limit', says('no_neutral_of_limit')),
    ('limit: true, number: 51', 'limit: 1, number: 51', 'limit.limit',
     says('wrong_type', value=1, kind='an integer', allowed='true or false')),
    ('access: ro, bits', 'access: ro, neutral: 0, limit: true, bits', 'status.limit',
     says('read_only_in', name='status')),
    ('maximum: 3000}', 'maximum: 3000, limit: true, neutral_from: actual, arming_tolerance: 1}',
     'speed.limit', says('beside_neutral_from')),
    ('storage: ram}', 'storage: ram, values: {0: terminals, 3: bus, 0x10: "on", -1: other}}',
     'word.values.-1', says('does_not_fit', entry='-1', low=0, high=65535)),
    ('storage: ram}', 'storage: ram, values: {%s}}' % ', '.join(
        f'{number}: name {number}' for number in range(1001)), 'word.values',
     says('too_many_entries', count=1001, allowed=1000)),
    ('type: bool}', 'type: bool, values: {0: a}}', 'flag.values',
     says('no_value_names', name='flag', kind='a bool')),
]


@pytest.mark.parametrize(('old', 'new', 'expected'), CASES)
def test_problem_of_a_profile(tmp_path: Path, old: str, new: str, expected: list[str]) -> None:
    assert problems(tmp_path, profile=changed(PROFILE, old, new)) == expected


@pytest.mark.parametrize(('old', 'new', 'key', 'found'), ENTRIES)
def test_problem_of_an_entry(tmp_path: Path, old: str, new: str, key: str, found: says) -> None:
    place = f'table.yaml:{line_of(PROFILE, old)}: parameters.{key}'
    assert problems(tmp_path, profile=changed(PROFILE, old, new)) == [
        at(place, found.code, **found.fields)]


@pytest.mark.parametrize(('name', 'code'), [
    ('online', 'name_taken'), ('request', 'name_taken'), ('joint_command', 'name_taken'),
    ('set_parameters_atomically', 'name_taken'), ('quick_stop', 'name_taken'),
    ('p12', 'raw_name'), ('xbeef', 'raw_name')])
def test_name_that_is_taken(tmp_path: Path, name: str, code: str) -> None:
    assert problems(tmp_path, profile=changed(PROFILE, 'ramp:', f'{name}:')) == [
        at(f'table.yaml:15: parameters.{name}', code, name=name)]


def test_good_profile(tmp_path: Path) -> None:
    profile = load(tmp_path).drives['conveyor'].profile
    assert (profile.description, profile.protocols) == ('for tests', ('datamodel_extended',))
    assert list(profile.parameters) == [
        'speed', 'limit', 'word', 'flag', 'angle', 'order', 'actual', 'current', 'status',
        'position', 'frequency', 'ramp']
    assert profile.parameters['ramp'] == Parameter(
        'ramp', number=30, scale=0.01, unit='s', storage=Storage.EEPROM, minimum=0.01,
        maximum=60.0, scaled=True)
    assert profile.parameters['status'] == Parameter(
        'status', number=211, access=AccessMode.READ_ONLY, bits=(('ready', 0), ('fault', 3)))
    assert profile.parameters['angle'] == Parameter(
        'angle', ParameterType.INT16, number=54, unit='deg', scaled=True)
    assert profile.control == ControlTable(
        'word', disable=0, enable=1, quick_stop=2, reset_fault=128, status_parameter='status',
        ready=StatusPattern(1, 1), enabled=StatusPattern(2, 2), fault=StatusPattern(8, 8))
    # what a control word says stands beside it wherever it is shown
    assert profile.parameters['word'].values == (
        (0, 'disable'), (1, 'enable'), (2, 'stop'), (128, 'reset'))


@pytest.mark.parametrize(('old', 'new'), [
    ('minimum: -3000', 'minimum: -3276.8'),
    ('maximum: 3000', 'maximum: 3276.7'),
    ('maximum: 3000', 'maximum: 3000, neutral: 3000'),
    ('minimum: -3000', 'minimum: 10, neutral: 10'),
    # scales by its offset alone; raw 0 is 5
    ('type: uint16}', 'offset: 5, minimum: 5}'),
    ('scale: 0.01, unit: A', 'scale: -0.01, unit: A, minimum: -300, maximum: 300'),
    ('type: bool', 'type: bool, neutral: true, bits: {a: 0}'),
    ('ready: 0', 'ready: 15, again: 15'),
    # two names of one parameter
    ('number: 54', 'number: 50'),
    ('type: uint16}', 'type: uint16, bits: {}}'),
    ('words: {disable: 0, enable: 1, quick_stop: 2, reset_fault: 128}',
     'words: {disable: 0x00, enable: 0xFFFF}'),
    ('fault: [8, 8]', 'fault: [8, 0]'),
    ('description: for tests\n', ''),
    ('protocols: [datamodel_extended]', 'protocols: [cannord, datamodel_extended]'),
    # a subindex is of the other protocol
    ('protocols: [datamodel_extended]\nparameters:\n',
     'protocols: [datamodel_extended, cannord]\nparameters:\n'
     '  part: {number: 51, subindex: 4}\n'),
    ('limit:', 'px: {number: 1}\n  xyz: {number: 2}\n  enabled: {number: 3}\n  limit:'),
])
def test_all_right(tmp_path: Path, old: str, new: str) -> None:
    assert problems(tmp_path, profile=changed(PROFILE, old, new)) == []


@pytest.mark.parametrize(('old', 'new', 'name', 'limits', 'expected'), [
    ('minimum: -3000', 'minimum: -4000', 'speed', (-3276.8, 3000.0),
     [at('table.yaml:4: parameters.speed.minimum', 'narrowed', limit=-4000, type='int16',
         end='-3276.8 rpm')]),
    ('minimum: -3000, maximum: 3000', 'minimum: -9e9, maximum: 9e9', 'speed', (-3276.8, 3276.7),
     [at('table.yaml:4: parameters.speed.minimum', 'narrowed', limit=-9000000000.0, type='int16',
         end='-3276.8 rpm'),
      at('table.yaml:4: parameters.speed.maximum', 'narrowed', limit=9000000000.0, type='int16',
         end='3276.7 rpm')]),
    ('type: uint16}', 'type: uint16, minimum: -5, maximum: 70000}', 'limit', (0, 65535),
     [at('table.yaml:5: parameters.limit.minimum', 'narrowed', limit=-5, type='uint16', end='0'),
      at('table.yaml:5: parameters.limit.maximum', 'narrowed', limit=70000, type='uint16',
         end='65535')]),
    # as far as the type goes, apart from noise in the last digits
    ('maximum: 3000', 'maximum: 3276.7', 'speed', (-3000.0, 3276.7), []),
    # scale -0.01: the smallest raw integer is the largest value
    ('type: int16, scale: 0.01, unit: A',
     'type: int16, scale: -0.01, unit: A, minimum: -327.67, maximum: 327.69', 'current',
     (-327.67, 327.68),
     [at('table.yaml:11: parameters.current.maximum', 'narrowed', limit=327.69, type='int16',
         end='327.68 A')]),
])
def test_limits_that_the_type_cannot_hold_are_narrowed(
        tmp_path: Path, old: str, new: str, name: str, limits: tuple[float, float],
        expected: list[str]) -> None:
    profile = changed(PROFILE, old, new)
    assert warnings(tmp_path, profile=profile) == expected
    parameter = load(tmp_path, profile=profile).drives['lift'].profile.parameters[name]
    assert (parameter.minimum, parameter.maximum) == pytest.approx(limits, abs=1e-9)


def test_nothing_says_when_there_is_a_fault(tmp_path: Path) -> None:
    profile = PROFILE.partition('control:\n')[0] + 'fault: {parameter: current}\n'
    assert warnings(tmp_path, profile=profile) == [at('table.yaml:16: fault', 'fault_without_bit')]
    with_bit = changed(profile, 'current}', 'current, bit: status.fault}')
    assert warnings(tmp_path, profile=with_bit) == []


def test_profile_by_its_path(tmp_path: Path) -> None:
    folder = tmp_path / 'elsewhere'
    folder.mkdir()
    (folder / 'other.yml').write_text(PROFILE)
    text = changed(FILE, 'profile: table', f'profile: {folder}/other.yml')
    drive = load(tmp_path, text).drives['conveyor']
    assert (drive.profile.name, drive.profile.path) == ('other', f'{folder}/other.yml')
    assert drive.profile_key == f'{folder}/other.yml'


def test_profile_of_two_drives_is_named_once(tmp_path: Path) -> None:
    assert len(problems(tmp_path, profile=changed(PROFILE, 'access: wo', 'acess: wo'))) == 1


def test_profile_that_cannot_be_read(tmp_path: Path) -> None:
    text = changed(FILE, 'profile: table', f'profile: {tmp_path}')
    assert problems(tmp_path, text) == [
        at('f.yaml:14: drives.conveyor.profile', 'no_file', name=str(tmp_path))]


def test_profile_that_is_too_large(tmp_path: Path) -> None:
    large = tmp_path / 'large.yaml'
    with large.open('wb') as file:
        file.truncate(5 << 20)
    assert problems(tmp_path, changed(FILE, 'profile: table', 'profile: large')) == [
        at('f.yaml:14: drives.conveyor.profile', 'cannot_be_read', path=large,
           why='too large, allowed are 4 MiB')]
