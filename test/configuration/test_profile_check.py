# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What is wrong with a profile: one changed line each."""

from pathlib import Path

from configuration_builders import (
    changed, FILE, load, problems, PROFILE, PROTOCOLS, warnings,
)
import pytest

from drive_can_bridge.core.parameters import Access, Parameter, ParameterType, Storage
from drive_can_bridge.core.profile import ControlTable, StatusPattern

CASES = [
    ('number: 51, type: uint16', 'number: 51, type: uint32',
     ['table.yaml:5: parameters.limit.type: uint32 does not exist in datamodel_extended, '
      'allowed are bool, int16, uint16']),
    ('number: 51, type: uint16', 'number: 51, type: int32',
     ['table.yaml:5: parameters.limit.type: int32 does not exist in datamodel_extended, '
      'allowed are bool, int16, uint16']),
    ('number: 51', 'number: 70000',
     ['table.yaml:5: parameters.limit.number: 70000 is out of range, allowed is an integer of '
      '0 to 65535']),
    ('number: 51', 'number: -1',
     ['table.yaml:5: parameters.limit.number: -1 is out of range, allowed is an integer of 0 '
      'to 65535']),
    ('number: 51, ', '',
     ['table.yaml:5: parameters.limit.number: missing, allowed in datamodel_extended is 0 to '
      '65535']),
    ('number: 51', 'number: 0',
     ["f.yaml:16: drives.conveyor.cyclic_request: 'limit' has number 0 on the wire, which ends "
      'a map; allowed is 1 to 65535']),
    ('number: 51', 'number: 50',
     ["f.yaml:16: drives.conveyor.cyclic_request: 'limit' and 'speed' are both P50, allowed is "
      'one of them']),
    ('number: 51', 'number: 123',
     ["f.yaml:16: drives.conveyor.cyclic_request: 'limit' (P123) is a mapping parameter, "
      'allowed are others than 122 to 125']),
    ('number: 51', 'number: 65535',
     ['table.yaml:5: parameters.limit.access: rw is impossible, 65535 is never written; '
      'allowed is ro']),
    ('type: uint16', 'type: unit16',
     ["table.yaml:5: parameters.limit.type: 'unit16' is unknown (did you mean 'uint16'?), "
      'allowed is bool, int16, uint16, int32 or uint32']),
    ('type: uint16', 'scale: 0',
     ['table.yaml:5: parameters.limit.scale: 0 is useless, allowed is any other number']),
    ('type: uint16', 'scale: .nan',
     ['table.yaml:5: parameters.limit.scale: nan is not a finite number, allowed is a number '
      'of -1e+12 to 1e+12']),
    ('type: uint16', 'subindex: 4',
     ['table.yaml:5: parameters.limit.subindex: datamodel_extended knows no sub-index, allowed '
      'is number alone']),
    ('type: uint16', 'word_order: high_first',
     ['table.yaml:5: parameters.limit.word_order: uint16 has one word, allowed in int32 and '
      'uint32']),
    ('limit:', 'Limit:',
     ["f.yaml:16: drives.conveyor.cyclic_request: 'limit' is not in the profile, did you mean "
      "'Limit'?",
      "table.yaml:5: parameters.Limit: 'Limit' is wrong, allowed is a name of a-z, 0-9 and _ "
      'that begins with a letter, at most 100 characters']),
    ('ramp:', 'online:',
     ["table.yaml:15: parameters.online: 'online' is taken by the node of the drive, allowed "
      'is any other name']),
    ('ramp:', 'request:',
     ["table.yaml:15: parameters.request: 'request' is taken by the node of the drive, allowed "
      'is any other name']),
    ('ramp:', 'joint_command:',
     ["table.yaml:15: parameters.joint_command: 'joint_command' is taken by the node of the "
      'drive, allowed is any other name']),
    ('ramp:', 'set_parameters_atomically:',
     ["table.yaml:15: parameters.set_parameters_atomically: 'set_parameters_atomically' is "
      'taken by the node of the drive, allowed is any other name']),
    ('ramp:', 'p12:',
     ["table.yaml:15: parameters.p12: 'p12' reads as a raw parameter, allowed are names other "
      'than p<digits> and x<hexadecimal digits>']),
    ('ramp:', 'xbeef:',
     ["table.yaml:15: parameters.xbeef: 'xbeef' reads as a raw parameter, allowed are names "
      'other than p<digits> and x<hexadecimal digits>']),
    ('ramp:', 'quick_stop:',
     ["table.yaml:15: parameters.quick_stop: 'quick_stop' is taken by the node of the drive, "
      'allowed is any other name']),
    ('ramp:', 'actual:',
     ['table.yaml:15: parameters.actual: duplicate key, allowed is one (the first is in line '
      '10)']),
    ('ready: 0', 'command: 0',
     ["table.yaml:12: parameters.status.bits.command: 'command' is taken by the node of the "
      'drive, allowed is any other name']),
    ('ready: 0', 'ready: 16',
     ['table.yaml:12: parameters.status.bits.ready: bit 16 does not exist in uint16, allowed '
      'is 0 to 15']),
    ('ready: 0', 'Ready: 1',
     ["table.yaml:12: parameters.status.bits.Ready: 'Ready' is wrong, allowed is a name of "
      'a-z, 0-9 and _ that begins with a letter, at most 100 characters']),
    ('ready: 0', 'ready: x',
     ["table.yaml:12: parameters.status.bits.ready: 'x' is a string, allowed is an integer of "
      '0 to 31']),
    ('ready: 0', 'p1: 0',
     ["table.yaml:12: parameters.status.bits.p1: 'p1' reads as a raw parameter, allowed are "
      'names other than p<digits> and x<hexadecimal digits>']),
    ('minimum: -3000', 'minimum: 3001',
     ['table.yaml:4: parameters.speed.minimum: 3001 is above the maximum, allowed is at most '
      '3000']),
    ('minimum: -3000, maximum: 3000', 'minimum: 4000, maximum: 5000',
     ['table.yaml:4: parameters.speed.minimum: int16 has no value in 4000 to 5000 rpm, allowed '
      'are limits around one (the nearest is 3276.7 rpm)']),
    ('minimum: -3000, maximum: 3000', 'maximum: -4000',
     ['table.yaml:4: parameters.speed.maximum: int16 has no value in at most -4000 rpm, allowed '
      'are limits around one (the nearest is -3276.8 rpm)']),
    ('minimum: -3000, maximum: 3000', 'minimum: 0.01, maximum: 0.09',
     ['table.yaml:4: parameters.speed.minimum: int16 with scale 0.1 has no value in 0.01 to '
      '0.09 rpm, allowed are limits around one (the nearest is 0.0 rpm)']),
    ('type: uint16}', 'type: uint16, maximum: -1}',
     ['table.yaml:5: parameters.limit.maximum: uint16 has no value in at most -1, allowed are '
      'limits around one (the nearest is 0)']),
    ('maximum: 3000', 'maximum: 3000, neutral: 5000',
     ['table.yaml:4: parameters.speed.neutral: 5000 cannot be sent, allowed is -3000 to 3000 '
      'rpm']),
    ('maximum: 3000', 'maximum: 3000, neutral: true',
     ['table.yaml:4: parameters.speed.neutral: true is a bool, allowed is a number']),
    ('minimum: -3000', 'minimum: 10',
     ["f.yaml:16: drives.conveyor.cyclic_request: 'speed' has no neutral value and raw 0 is "
      'out of its range, allowed is a neutral of 10 to 3000 rpm',
      "f.yaml:24: drives.lift.cyclic_request: 'speed' has no neutral value and raw 0 is out of "
      'its range, allowed is a neutral of 10 to 3000 rpm']),
    ('type: uint16}', 'type: uint16, maximum: 0.5}',
     ['table.yaml:5: parameters.limit.maximum: 0.5 is no integer, allowed without scale, '
      'offset and unit are integers']),
    ('neutral: 100,', 'neutral: 0.5,',
     ['table.yaml:5: parameters.limit.neutral: 0.5 cannot be sent, allowed is an integer, 0 to '
      '65535']),
    ('neutral: 100,', 'neutral: 70000,',
     ['table.yaml:5: parameters.limit.neutral: 70000 cannot be sent, allowed is an integer, 0 '
      'to 65535']),
    ('type: uint16}', 'type: uint16, minimum: .inf}',
     ['table.yaml:5: parameters.limit.minimum: inf is not a finite number, allowed is a number']),
    ('type: bool', 'type: bool, scale: 2, minimum: 0, neutral: 1',
     ['table.yaml:7: parameters.flag.scale: a bool has no scale, allowed is to leave it out',
      'table.yaml:7: parameters.flag.minimum: a bool has no minimum, allowed is to leave it out',
      'table.yaml:7: parameters.flag.neutral: 1 is no bool, allowed is true or false']),
    ('type: bool', 'type: bool, bits: {a: 1}',
     ['table.yaml:7: parameters.flag.bits.a: bit 1 does not exist in bool, allowed is 0 to 0']),
    ('access: wo', 'access: w',
     ["table.yaml:9: parameters.order.access: 'w' is unknown (did you mean 'wo'?), allowed is "
      'ro, rw or wo']),
    ('storage: ram', 'storage: flash',
     ["table.yaml:6: parameters.word.storage: 'flash' is unknown, allowed is ram or eeprom"]),
    ('storage: ram', 'acces: ro',
     ["table.yaml:6: parameters.word.acces: unknown key, did you mean 'access'?"]),
    ('unit: rev', 'unit: ""',
     ['table.yaml:13: parameters.position.unit: an empty string, allowed is text']),
    ('unit: rev', 'unit: 5',
     ['table.yaml:13: parameters.position.unit: 5 is an integer, allowed is a string']),
    ('protocols: [datamodel_extended]', 'protocols: [cannord]',
     ["f.yaml:14: drives.conveyor.profile: 'table' is for cannord, allowed is a profile for "
      'datamodel_extended',
      "f.yaml:23: drives.lift.profile: 'table' is for cannord, allowed is a profile for "
      'datamodel_extended']),
    ('protocols: [datamodel_extended]\nparameters:\n  speed: {number: 50,',
     'protocols: [cannord]\nparameters:\n  torque: {type: int32}\n  speeds: {',
     ["f.yaml:14: drives.conveyor.profile: 'table' is for cannord, allowed is a profile for "
      'datamodel_extended',     # nothing of it fits
      "f.yaml:23: drives.lift.profile: 'table' is for cannord, allowed is a profile for "
      'datamodel_extended']),
    ('protocols: [datamodel_extended]', 'protocols: [datamodel]',
     ["table.yaml:2: protocols: 'datamodel' is unknown (did you mean 'datamodel_standard'?), "
      f'allowed is {PROTOCOLS}']),
    ('protocols: [datamodel_extended]', 'protocols: []',
     ['table.yaml:2: protocols: a list of 0 values, allowed are at least 1']),
    ('protocols: [datamodel_extended]', 'protocols: datamodel_extended',
     ["table.yaml:2: protocols: 'datamodel_extended' is a string, allowed is a list of "
      f'{PROTOCOLS}']),
    ('protocols: [datamodel_extended]\n', '',
     [f'table.yaml:1: protocols: missing, allowed is a list of {PROTOCOLS}']),
    ('parameter: word', 'parameter: wrod',
     ["table.yaml:17: control.parameter: 'wrod' is unknown, did you mean 'word'?"]),
    ('parameter: word', 'parameter: actual',
     ["table.yaml:17: control.parameter: 'actual' is read-only, allowed is one with access rw "
      'or wo']),
    ('enable: 1', 'enable: 0',
     ['table.yaml:18: control.words.enable: 0 is the word for disable too, allowed is another '
      'one']),
    ('quick_stop: 2', 'quick_stop: 1',
     ['table.yaml:18: control.words.enable: 1 is the word for quick_stop too, allowed is another '
      'one']),
    ('reset_fault: 128', 'reset_fault: 1',
     ['table.yaml:18: control.words.enable: 1 is the word for reset_fault too, allowed is another '
      'one']),
    ('enable: 1', 'enable: 65536',
     ['table.yaml:18: control.words.enable: 65536 does not fit word, allowed is 0 to 65535 '
      '(uint16)']),
    ('enable: 1', 'enabel: 1',
     ["table.yaml:18: control.words.enabel: unknown key, did you mean 'enable'?",
      'table.yaml:18: control.words.enable: missing, allowed is an integer of 0 to 4294967295']),
    ('ready: [1, 1]', 'ready: [1, 2]',
     ['table.yaml:19: control.status.ready: value 2 has bits outside of mask 1 and never '
      'matches, allowed are bits of the mask']),
    ('ready: [1, 1]', 'ready: [0, 0]',
     ['table.yaml:19: control.status.ready: mask 0 looks at no bit, allowed is a mask with at '
      'least one']),
    ('ready: [1, 1]', 'ready: [1]',
     ['table.yaml:19: control.status.ready: a list of 1 values, allowed are 2']),
    ('ready: [1, 1]', 'ready: [65536, 0]',
     ['table.yaml:19: control.status.ready: mask 65536 does not fit status, allowed is 1 to '
      '65535 (uint16)']),
    ('ready: [1, 1]', 'ready: 1',
     ['table.yaml:19: control.status.ready: 1 is an integer, allowed is a list of 2 integers '
      'of 0 to 4294967295']),
    ('parameter: status', 'parameter: statsu',
     ["table.yaml:19: control.status.parameter: 'statsu' is unknown, did you mean 'status'?"]),
    ('parameter: status', 'parameter: order',
     ["table.yaml:19: control.status.parameter: 'order' is write-only, allowed is one with "
      'access ro or rw']),
    ('fault: [8, 8]', 'falt: [8, 8]',
     ["table.yaml:19: control.status.falt: unknown key, did you mean 'fault'?"]),
    ('description: for tests', 'description: *x',
     ['table.yaml:1: description: an alias, allowed is the value itself']),
    ('description: for tests', 'description:',
     ['table.yaml:1: description: no value, allowed is a value, or [] for an empty list']),
    ('description: for tests', 'description: "',
     ['table.yaml:1: yaml: not valid YAML: found unexpected end of stream']),
    ('description: for tests', 'control: 1',
     ['table.yaml:1: control: 1 is an integer, allowed is a mapping',
      'table.yaml:16: control: duplicate key, allowed is one (the first is in line 1)']),
    ('description: for tests\n', 'just text\n---\n',
     ['table.yaml:1: yaml: no mapping, allowed are protocols, parameters, control, description']),
    ('description: for tests\n', '--- {}\n--- \n',
     [f'table.yaml:1: protocols: missing, allowed is a list of {PROTOCOLS}',
      'table.yaml:1: parameters: missing, allowed is a mapping',
      'table.yaml:2: yaml: a second document, allowed is one']),
    ('limit: {neutral: 100, limit: true, number: 51, type: uint16}', 'limit: 5',
     ['table.yaml:5: parameters.limit: 5 is an integer, allowed is a mapping']),
    ('limit: {neutral: 100, limit', 'limit: {limit',
     ['table.yaml:5: parameters.limit.limit: needs neutral: what is sent until the first command, '
      'allowed is to give it too']),
    ('limit: true, number: 51', 'limit: 1, number: 51',
     ['table.yaml:5: parameters.limit.limit: 1 is an integer, allowed is true or false']),
    ('access: ro, bits', 'access: ro, neutral: 0, limit: true, bits',
     ["table.yaml:12: parameters.status.limit: 'status' is read-only, allowed in parameters with "
      'access rw or wo']),
    ('maximum: 3000}', 'maximum: 3000, limit: true, neutral_from: actual, arming_tolerance: 1}',
     ['table.yaml:4: parameters.speed.limit: stands beside neutral_from, allowed is one of '
      'them']),
    ('storage: ram}', 'storage: ram, limit: true, neutral: 0}', []),
    ('storage: ram}', 'storage: ram, values: {0: terminals, 3: bus, 0x10: "on", -1: other}}',
     ['table.yaml:6: parameters.word.values.-1: -1 does not fit, allowed is 0 to 65535']),
    ('storage: ram}', 'storage: ram, values: {%s}}' % ', '.join(
        f'{number}: name {number}' for number in range(1001)),
     ['table.yaml:6: parameters.word.values: a mapping of 1001 entries, allowed are at most '
      '1000']),
    ('storage: ram}', 'storage: ram, values: {0: off, 1: on}}',
     ['table.yaml:6: parameters.word.values.0: false, off or no without quotes is a bool, allowed '
      'is text: write it in quotes',
      'table.yaml:6: parameters.word.values.1: true, on or yes without quotes is a bool, allowed '
      'is text: write it in quotes']),
    ('storage: ram}', 'storage: ram, values: {0: a, 1: a, 0x0: b, 2: 5}}',
     ["table.yaml:6: parameters.word.values.1: 'a' is the name of 0 too, allowed is another one",
      'table.yaml:6: parameters.word.values.0x0: 0x0 stands twice (as 0), allowed is once',
      'table.yaml:6: parameters.word.values.2: 5 is a number, allowed is text']),
    ('type: bool}', 'type: bool, values: {0: a}}',
     ["table.yaml:7: parameters.flag.values: 'flag' is a bool, allowed in integers without scale, "
      'offset and unit']),
    ('control:\n', 'fault: {parameter: statsu, codes: {7: hot}}\ncontrol:\n',
     ["table.yaml:16: fault.parameter: 'statsu' is unknown, did you mean 'status'?"]),
    ('control:\n', 'fault: {parameter: order, codes: {7: hot, 9: hot}, bit: status.ready}\n'
     'control:\n',
     ["table.yaml:16: fault.parameter: 'order' is write-only, allowed is one with access ro or rw",
      "table.yaml:16: fault.codes.9: 'hot' is the name of 7 too, allowed is another one"]),
    ('control:\n', 'fault: {parameter: current, codes: {7: hot}}\ncontrol:\n', []),
    ('parameters:', 'parametrs:',
     ['table.yaml:1: parameters: missing, allowed is a mapping',
      "table.yaml:3: parametrs: unknown key, did you mean 'parameters'?"]),
]


@pytest.mark.parametrize(('old', 'new', 'expected'), CASES)
def test_problem_of_a_profile(tmp_path: Path, old: str, new: str, expected: list[str]) -> None:
    assert problems(tmp_path, profile=changed(PROFILE, old, new)) == expected


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
        'status', number=211, access=Access.READ_ONLY, bits=(('ready', 0), ('fault', 3)))
    assert profile.parameters['angle'] == Parameter(
        'angle', ParameterType.INT16, number=54, unit='deg', scaled=True)
    assert profile.control == ControlTable(
        'word', disable=0, enable=1, quick_stop=2, reset_fault=128, status_parameter='status',
        ready=StatusPattern(1, 1), enabled=StatusPattern(2, 2), fault=StatusPattern(8, 8))


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
    ('limit:', 'px: {number: 1}\n  xyz: {number: 2}\n  enabled: {number: 3}\n  limit:'),
])
def test_all_right(tmp_path: Path, old: str, new: str) -> None:
    assert problems(tmp_path, profile=changed(PROFILE, old, new)) == []


@pytest.mark.parametrize(('old', 'new', 'name', 'limits', 'expected'), [
    ('minimum: -3000', 'minimum: -4000', 'speed', (-3276.8, 3000.0),
     ['table.yaml:4: parameters.speed.minimum: -4000 is not representable in int16, narrowed to '
      '-3276.8 rpm']),
    ('minimum: -3000, maximum: 3000', 'minimum: -9e9, maximum: 9e9', 'speed', (-3276.8, 3276.7),
     ['table.yaml:4: parameters.speed.minimum: -9000000000.0 is not representable in int16, '
      'narrowed to -3276.8 rpm',
      'table.yaml:4: parameters.speed.maximum: 9000000000.0 is not representable in int16, '
      'narrowed to 3276.7 rpm']),
    ('type: uint16}', 'type: uint16, minimum: -5, maximum: 70000}', 'limit', (0, 65535),
     ['table.yaml:5: parameters.limit.minimum: -5 is not representable in uint16, narrowed to 0',
      'table.yaml:5: parameters.limit.maximum: 70000 is not representable in uint16, narrowed to '
      '65535']),
    # as far as the type goes, apart from noise in the last digits
    ('maximum: 3000', 'maximum: 3276.7', 'speed', (-3000.0, 3276.7), []),
    # scale -0.01: the smallest raw integer is the largest value
    ('type: int16, scale: 0.01, unit: A',
     'type: int16, scale: -0.01, unit: A, minimum: -327.67, maximum: 327.69', 'current',
     (-327.67, 327.68),
     ['table.yaml:11: parameters.current.maximum: 327.69 is not representable in int16, narrowed '
      'to 327.68 A']),
])
def test_limits_that_the_type_cannot_hold_are_narrowed(
        tmp_path: Path, old: str, new: str, name: str, limits: tuple[float, float],
        expected: list[str]) -> None:
    profile = changed(PROFILE, old, new)
    assert warnings(tmp_path, profile=profile) == expected
    parameter = load(tmp_path, profile=profile).drives['lift'].profile.parameters[name]
    assert (parameter.minimum, parameter.maximum) == pytest.approx(limits, abs=1e-9)


def test_subindex_of_another_protocol(tmp_path: Path) -> None:
    profile = changed(PROFILE, '[datamodel_extended]', '[datamodel_extended, cannord]')
    profile = changed(profile, 'number: 51', 'number: 51, subindex: 4')
    assert problems(tmp_path, profile=profile) == []


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
        f'f.yaml:14: drives.conveyor.profile: no file {tmp_path}, allowed is an existing one']
