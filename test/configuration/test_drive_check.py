# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What is wrong with a drive: one changed line each, and the lines that users see."""

from dataclasses import asdict
from pathlib import Path

from configuration_builders import changed, FILE, load, problems, PROFILE, PROTOCOLS, warnings
import pytest

from drive_can_bridge.protocols.families import FAMILIES

CASES = [
    ('station: 1', 'station: one',
     ["f.yaml:13: drives.conveyor.station: 'one' is a string, allowed is an integer"]),
    ('station: 1', 'station: 1.0',
     ['f.yaml:13: drives.conveyor.station: 1.0 is a number, allowed is an integer']),
    ('station: 1', 'station: true',
     ['f.yaml:13: drives.conveyor.station: true is a bool, allowed is an integer']),
    ('station: 1', 'station: 0',
     ['f.yaml:13: drives.conveyor.station: 0 is out of range, allowed is 1 to 127 '
      '(datamodel_extended)']),
    ('station: 1', 'station: 128',
     ['f.yaml:13: drives.conveyor.station: 128 is out of range, allowed is 1 to 127 '
      '(datamodel_extended)']),
    ('station: 1', 'station: 2',
     ['f.yaml:22: drives.lift.station: 2 collides with drive conveyor (station 2) on bus main: '
      'both use 29-bit frames of station 2; allowed is a station of its own']),
    ('station: 1', 'statoin: 1',
     ['f.yaml:10: drives.conveyor.station: missing, allowed is an integer',
      "f.yaml:13: drives.conveyor.statoin: unknown key, did you mean 'station'?"]),
    ('        station: 1\n', '',
     ['f.yaml:10: drives.conveyor.station: missing, allowed is an integer']),
    ('bus: main', 'bus: mian',
     ["f.yaml:11: drives.conveyor.bus: 'mian' is unknown, did you mean 'main'?"]),
    ('bus: main', 'bus: other',
     ["f.yaml:11: drives.conveyor.bus: 'other' is unknown, allowed: main"]),
    ('        bus: main\n', '',
     ['f.yaml:10: drives.conveyor.bus: missing, allowed is a string']),
    ('        protocol: datamodel_extended\n', '',
     [f'f.yaml:10: drives.conveyor.protocol: missing, allowed is {PROTOCOLS}']),
    ('        protocol: datamodel_extended\n', '        xyz: 1\n',
     [f'f.yaml:10: drives.conveyor.protocol: missing, allowed is {PROTOCOLS}',
      'f.yaml:12: drives.conveyor.xyz: unknown key, allowed: bus, protocol, station, profile, '
      'period, cyclic_request, cyclic_response, missed_limit, command_timeout, rearm, '
      'parameter_timeout, control_timeout, parameter_retries, verify_writes, joint']),
    ('        protocol: datamodel_extended\n', '        mapping: verify\n',  # of some family
     [f'f.yaml:10: drives.conveyor.protocol: missing, allowed is {PROTOCOLS}']),
    ('period: 0.02', 'period: 0.004',
     ['f.yaml:15: drives.conveyor.period: 0.004 s is too fast, allowed is at least 0.005 s '
      'unless allow_fast_cycle is true']),
    ('period: 0.02', 'period: 0.0001',
     ['f.yaml:15: drives.conveyor.period: 0.0001 is out of range, allowed is a number of 0.001 '
      'to 60']),
    ('period: 0.02', 'period: 61',
     ['f.yaml:15: drives.conveyor.period: 61 is out of range, allowed is a number of 0.001 to '
      '60']),
    ('period: 0.02', 'period: .inf',
     ['f.yaml:15: drives.conveyor.period: inf is not a finite number, allowed is a number of '
      '0.001 to 60']),
    ('period: 0.02', 'period: .nan',
     ['f.yaml:15: drives.conveyor.period: nan is not a finite number, allowed is a number of '
      '0.001 to 60']),
    ('period: 0.02', 'period: fast',
     ["f.yaml:15: drives.conveyor.period: 'fast' is a string, allowed is a number of 0.001 to "
      '60']),
    ('rearm: neutral', 'rearm: neutrl',
     ["f.yaml:18: drives.conveyor.rearm: 'neutrl' is unknown (did you mean 'neutral'?), "
      'allowed is neutral or immediate']),
    ('rearm: neutral', 'rearm: 5',
     ['f.yaml:18: drives.conveyor.rearm: 5 is unknown, allowed is neutral or immediate']),
    ('rearm: neutral', 'missed_limit: 0',
     ['f.yaml:18: drives.conveyor.missed_limit: 0 is out of range, allowed is an integer of 1 '
      'to 1000000']),
    ('rearm: neutral', 'missed_limit: 2.5',
     ['f.yaml:18: drives.conveyor.missed_limit: 2.5 is a number, allowed is an integer of 1 to '
      '1000000']),
    ('rearm: neutral', 'command_timeout: -1',
     ['f.yaml:18: drives.conveyor.command_timeout: -1 is out of range, allowed is a number of '
      '0 to 3600']),
    ('rearm: neutral', 'parameter_timeout: 0',
     ['f.yaml:18: drives.conveyor.parameter_timeout: 0 is out of range, allowed is a number of '
      '0.001 to 60']),
    ('rearm: neutral', 'control_timeout: x',
     ["f.yaml:18: drives.conveyor.control_timeout: 'x' is a string, allowed is a number of "
      '0.01 to 600']),
    ('rearm: neutral', 'parameter_retries: -1',
     ['f.yaml:18: drives.conveyor.parameter_retries: -1 is out of range, allowed is an integer '
      'of 0 to 100']),
    ('rearm: neutral', 'verify_writes: 1',
     ['f.yaml:18: drives.conveyor.verify_writes: 1 is an integer, allowed is true or false']),
    ('rearm: neutral', 'mapping: verfy',
     ["f.yaml:18: drives.conveyor.mapping: 'verfy' is unknown (did you mean 'verify'?), "
      'allowed is verify, configure or assume']),
    ('rearm: neutral', 'mapping: on',
     ['f.yaml:18: drives.conveyor.mapping: true is unknown, allowed is verify, configure or '
      'assume']),
    ('rearm: neutral', 'length_policy: no',
     ['f.yaml:18: drives.conveyor.length_policy: false is unknown, allowed is lenient or strict']),
    ('rearm: neutral', 'eeprom_write_gap: 0.01',
     ['f.yaml:18: drives.conveyor.eeprom_write_gap: 0.01 is out of range, allowed is a number '
      'of 0.02 to 60']),
    ('rearm: neutral', 'allow_fast_cycle: 1',
     ['f.yaml:18: drives.conveyor.allow_fast_cycle: 1 is an integer, allowed is true or false']),
    ('rearm: neutral', 'request_map_base: 0',
     ['f.yaml:18: drives.conveyor.request_map_base: 0 is out of range, allowed is an integer '
      'of 1 to 65531']),
    ('rearm: neutral', 'request_map_base: 124',
     ['f.yaml:18: drives.conveyor.request_map_base: 124 and 126 overlap, allowed is a distance '
      'of 4 or more']),
    ('rearm: neutral', 'response_map_base: 124',
     ['f.yaml:18: drives.conveyor.response_map_base: 122 and 124 overlap, allowed is a '
      'distance of 4 or more']),
    ('rearm: neutral', 'response_map_base: 65532',
     ['f.yaml:18: drives.conveyor.response_map_base: 65532 is out of range, allowed is an '
      'integer of 1 to 65531']),
    ('rearm: neutral', 'response_map_base: 48',
     ["f.yaml:16: drives.conveyor.cyclic_request: 'speed' (P50) is a mapping parameter, "
      'allowed are others than 48 to 51',
      "f.yaml:16: drives.conveyor.cyclic_request: 'limit' (P51) is a mapping parameter, "
      'allowed are others than 48 to 51']),
    ('rearm: neutral', 'request_map_base: 48',
     ["f.yaml:16: drives.conveyor.cyclic_request: 'speed' (P50) is a mapping parameter, "
      'allowed are others than 48 to 51',
      "f.yaml:16: drives.conveyor.cyclic_request: 'limit' (P51) is a mapping parameter, "
      'allowed are others than 48 to 51']),
    ('rearm: neutral', 'parameter_offset: -31',
     ["f.yaml:18: drives.conveyor.parameter_offset: -31 moves 'ramp' (P30) out of the allowed "
      '0 to 65535']),
    ('rearm: neutral', 'parameter_offset: 65400',
     ["f.yaml:18: drives.conveyor.parameter_offset: 65400 moves 'actual' (P209) out of the "
      'allowed 0 to 65535',
      "f.yaml:18: drives.conveyor.parameter_offset: 65400 moves 'current' (P210) out of the "
      'allowed 0 to 65535',
      "f.yaml:18: drives.conveyor.parameter_offset: 65400 moves 'status' (P211) out of the "
      'allowed 0 to 65535',
      "f.yaml:18: drives.conveyor.parameter_offset: 65400 moves 'position' (P214) out of the "
      'allowed 0 to 65535',
      "f.yaml:18: drives.conveyor.parameter_offset: 65400 moves 'frequency' (P215) out of the "
      'allowed 0 to 65535']),
    ('rearm: neutral', 'parameter_offset: 70000',
     ['f.yaml:18: drives.conveyor.parameter_offset: 70000 is out of range, allowed is an '
      'integer of -65535 to 65535']),
    ('rearm: neutral', 'zzz: 1',
     ['f.yaml:18: drives.conveyor.zzz: unknown key, allowed: bus, protocol, station, profile, '
      'period, cyclic_request, cyclic_response, missed_limit, command_timeout, rearm, '
      'parameter_timeout, control_timeout, parameter_retries, verify_writes, joint, mapping, '
      'request_map_base, response_map_base, parameter_offset, eeprom_write_gap, length_policy, '
      'allow_fast_cycle']),
    ('[speed, limit]', '[speed, limt]',
     ["f.yaml:16: drives.conveyor.cyclic_request: 'limt' is not in the profile, did you mean "
      "'limit'?"]),
    ('[speed, limit]', '[speed, speed]',
     ["f.yaml:16: drives.conveyor.cyclic_request: 'speed' stands twice, allowed is once"]),
    ('[speed, limit]', '[speed, limit, word, flag, angle]',
     ['f.yaml:16: drives.conveyor.cyclic_request: 5 parameters are too many, allowed are at '
      'most 4']),
    ('[speed, limit]', '[actual]',
     ["f.yaml:16: drives.conveyor.cyclic_request: 'actual' is read-only, allowed are "
      'parameters with access rw or wo']),
    ('[speed, limit]', '[ramp]',
     ["f.yaml:16: drives.conveyor.cyclic_request: 'ramp' is kept in EEPROM, which cyclic "
      'writing would wear out; allowed are parameters with storage ram']),
    ('[speed, limit]', '[p50]',
     ["f.yaml:16: drives.conveyor.cyclic_request: 'p50' is not in the profile, allowed: speed, "
      'limit, word, flag, angle, order, actual, current, status, position, frequency, ramp']),
    ('[speed, limit]', 'speed',
     ["f.yaml:16: drives.conveyor.cyclic_request: 'speed' is a string, allowed is a list of "
      'strings']),
    ('[speed, limit]', '[1, 2]',
     ['f.yaml:16: drives.conveyor.cyclic_request: 1 is an integer, allowed is a string',
      'f.yaml:16: drives.conveyor.cyclic_request: 2 is an integer, allowed is a string']),
    ('[speed, limit]', '[y, n]',
     ['f.yaml:16: drives.conveyor.cyclic_request: true is a bool, allowed is a string',
      'f.yaml:16: drives.conveyor.cyclic_request: false is a bool, allowed is a string']),
    ('[speed, limit]', '\n          - speed\n          - limt\n          - speed',
     ["f.yaml:18: drives.conveyor.cyclic_request: 'limt' is not in the profile, did you mean "
      "'limit'?",
      "f.yaml:19: drives.conveyor.cyclic_request: 'speed' stands twice, allowed is once"]),
    ('[actual, current, status]', '[order]',
     ["f.yaml:17: drives.conveyor.cyclic_response: 'order' is write-only, allowed are "
      'parameters with access ro or rw']),
    ('[actual, current, status]', '[actual, current, status, position, frequency]',
     ['f.yaml:17: drives.conveyor.cyclic_response: 5 parameters are too many, allowed are at '
      'most 4']),
    ('[actual, current, status]', '[actual, actual]',
     ["f.yaml:17: drives.conveyor.cyclic_response: 'actual' stands twice, allowed is once"]),
    ('[actual, current, status]', '[actual, actul]',
     ["f.yaml:17: drives.conveyor.cyclic_response: 'actul' is not in the profile, did you mean "
      "'actual'?"]),
    ('conveyor:', 'Conveyor:',
     ["f.yaml:10: drives.Conveyor: 'Conveyor' is wrong, allowed is a name of a-z, 0-9 and _ "
      'that begins with a letter and has no __, at most 100 characters']),
    ('conveyor:', 'conv__eyor:',  # rcl cannot parse a remap rule for such a node
     ["f.yaml:10: drives.conv__eyor: 'conv__eyor' is wrong, allowed is a name of a-z, 0-9 and "
      '_ that begins with a letter and has no __, at most 100 characters']),
    ('conveyor:', '"1a":',
     ["f.yaml:10: drives.1a: '1a' is wrong, allowed is a name of a-z, 0-9 and _ that begins "
      'with a letter and has no __, at most 100 characters']),
    ('conveyor:', '"a\\n":',
     ["f.yaml:10: drives.a\\n: 'a\\n' is wrong, allowed is a name of a-z, 0-9 and _ that begins "
      'with a letter and has no __, at most 100 characters']),
    ('conveyor:', 'drive_can_bridge:',
     ["f.yaml:10: drives.drive_can_bridge: 'drive_can_bridge' is the name of the bridge "
      'itself, allowed is any other']),
    ('conveyor:', 'lift:',
     ['f.yaml:19: drives.lift: duplicate key, allowed is one (the first is in line 10)']),
    ('profile: table', 'profile: a/b',
     ["f.yaml:14: drives.conveyor.profile: 'a/b' is neither a name nor an absolute path, "
      'allowed is one of them']),
    ('profile: table', 'profile: /nowhere/table.yaml',
     ['f.yaml:14: drives.conveyor.profile: no file /nowhere/table.yaml, allowed is an existing '
      'one']),
    ('profile: table', 'profile: table.yaml',
     ["f.yaml:14: drives.conveyor.profile: 'table.yaml' is unknown, allowed is a name without "
      '.yaml']),
    ('profile: table', 'profile: ""',
     ['f.yaml:14: drives.conveyor.profile: an empty string, allowed is text']),
    ('profile: table', 'profile: 7',
     ['f.yaml:14: drives.conveyor.profile: 7 is an integer, allowed is a string']),
]


@pytest.mark.parametrize(('old', 'new', 'expected'), CASES)
def test_problem_of_a_drive(tmp_path: Path, old: str, new: str, expected: list[str]) -> None:
    assert problems(tmp_path, changed(FILE, old, new)) == expected


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
    assert asdict(lift.options) == {
        'mapping': 'verify', 'request_map_base': 122, 'response_map_base': 126,
        'parameter_offset': 0, 'eeprom_write_gap': 0.02, 'length_policy': 'lenient',
        'allow_fast_cycle': False}
    assert (lift.missed_limit, lift.command_timeout, lift.rearm_immediate) == (3, 0.5, False)
    assert (lift.parameter_timeout, lift.parameter_retries, lift.verify_writes) == (0.1, 2, True)
    assert lift.control_timeout == 2.0


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


def test_integer_where_a_number_is_meant(tmp_path: Path) -> None:
    text = changed(FILE, 'period: 0.02', 'period: 1\n        eeprom_write_gap: 1')
    drive = load(tmp_path, text).drives['conveyor']
    assert repr((drive.period, drive.options.eeprom_write_gap)) == '(1.0, 1.0)'


def test_name_too_long(tmp_path: Path) -> None:
    assert problems(tmp_path, changed(FILE, 'conveyor', 'c' * 100)) == []
    found = problems(tmp_path, changed(FILE, 'conveyor', 'c' * 101))
    assert len(found) == 1
    assert found[0].startswith(f'f.yaml:10: drives.{"c" * 101}: ')


@pytest.mark.parametrize(('given', 'message'), [
    ('datamodel_extende', "'datamodel_extende' is unknown (did you mean 'datamodel_extended'?)"),
    ('xyz', "'xyz' is unknown"),
    ('5', '5 is no protocol'),
    ('[a]', 'a list is no protocol'),
])
def test_unknown_protocol(tmp_path: Path, given: str, message: str) -> None:
    text = changed(FILE, 'protocol: datamodel_extended', f'protocol: {given}\n        perod: 1')
    assert problems(tmp_path, text) == [
        f'f.yaml:12: drives.conveyor.protocol: {message}; available: {", ".join(FAMILIES)}',
        "f.yaml:13: drives.conveyor.perod: unknown key, did you mean 'period'?"]


def test_unknown_profile_names_the_places(tmp_path: Path) -> None:
    found = problems(tmp_path, changed(FILE, 'profile: table', 'profile: tabel'))
    assert len(found) == 1
    assert found[0].startswith("f.yaml:14: drives.conveyor.profile: 'tabel' is unknown, did you "
                               f"mean 'table'? (searched: {tmp_path}, ")
    assert found[0].endswith('config/profiles)')


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
        'f.yaml:5: buses.main.channel: missing, allowed is a string or an integer',
        "f.yaml:7: buses.main.chanel: unknown key, did you mean 'channel'?",
        "f.yaml:11: drives.conveyor.bus: 'mian' is unknown, did you mean 'main'?",
        'f.yaml:13: drives.conveyor.station: 128 is out of range, allowed is 1 to 127 '
        '(datamodel_extended)',
        'f.yaml:15: drives.conveyor.period: 0.001 s is too fast, allowed is at least 0.005 s '
        'unless allow_fast_cycle is true',
        "f.yaml:16: drives.conveyor.cyclic_request: 'limt' is not in the profile, did you mean "
        "'limit'?",
        'f.yaml:18: drives.conveyor.rearm: an alias (rcl refuses the file), allowed is the value '
        'itself',
        "f.yaml:22: drives.lift.station: 'two' is a string, allowed is an integer",
        'f.yaml:25: drives.lift.joint: an empty mapping (rcl garbles what follows), allowed is to '
        'leave the key out',
        "table.yaml:5: parameters.limit.number: 'x' is a string, allowed is an integer of 0 to "
        '65535',
        "table.yaml:17: control.parameter: 'wrod' is unknown, did you mean 'word'?",
    ]


def test_every_later_drive_of_a_station_collides(tmp_path: Path) -> None:
    text = changed(FILE, 'station: 2', 'station: 1')
    text += text[text.index('      lift:'):].replace('lift', 'third')
    assert [line.split(':')[1:3] for line in problems(tmp_path, text)] == [
        ['22', ' drives.lift.station'], ['29', ' drives.third.station']]


def test_equal_stations_on_different_buses(tmp_path: Path) -> None:
    text = changed(FILE, 'station: 2', 'station: 1').replace('bus: main', 'bus: other', 1)
    text = changed(text, '    drives:\n',
                   '      other: {interface: virtual, channel: second}\n    drives:\n')
    assert problems(tmp_path, text) == []


def test_control_without_its_status_word(tmp_path: Path) -> None:
    assert warnings(tmp_path, changed(FILE, '[actual, status]', '[actual]')) == [
        "f.yaml:25: drives.lift.cyclic_response: 'status' is missing: without the status word the "
        'bridge cannot tell whether the drive is enabled']


@pytest.mark.parametrize('entry', [
    'limit: {number: 51}',
    'limit: {number: 51, neutral: 300, scale: 0.1}',
    'limit: {number: 51, limit: false}'])
def test_what_looks_like_a_limit_and_is_none(tmp_path: Path, entry: str) -> None:
    """Until somebody arms it, the drive has none of it."""
    old = 'limit: {neutral: 100, limit: true, number: 51, type: uint16}'
    found, = warnings(tmp_path, profile=changed(PROFILE, old, entry))
    assert found.startswith('f.yaml:16: drives.conveyor.cyclic_request: ')
    assert 'looks like a limit' in found


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
    assert found.startswith('f.yaml:16: drives.conveyor.cyclic_request: ')


def test_control_word_may_be_sent_cyclically(tmp_path: Path) -> None:
    assert problems(tmp_path, changed(FILE, '[speed, limit]', '[word, speed]')) == []


def test_fast_cycle_that_was_allowed(tmp_path: Path) -> None:
    text = changed(FILE, 'period: 0.02', 'period: 0.004\n        allow_fast_cycle: true')
    assert problems(tmp_path, text) == []
    assert problems(tmp_path, changed(FILE, 'period: 0.02', 'period: 0.005')) == []


@pytest.mark.parametrize(('period', 'told'), [('20', True), ('5.0', True), ('0.5', False)])
def test_a_period_that_was_meant_in_milliseconds(tmp_path: Path, period: str, told: bool) -> None:
    found = warnings(tmp_path, changed(FILE, 'period: 0.02', f'period: {period}'))
    assert [line for line in found if '.period: ' in line and 'it is in seconds' in line] == (
        found if told else [])
    assert bool(found) == told


def test_without_buses_their_absence_is_all_that_is_told(tmp_path: Path) -> None:
    begin, rest = FILE.split('    buses:\n')
    text = begin + rest[rest.index('    drives:\n'):]
    assert [line.split(': ')[1] for line in problems(tmp_path, text)] == ['buses']
