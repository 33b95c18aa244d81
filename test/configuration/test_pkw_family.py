# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The family table's row of CANopen PKW, and what it makes of parameter files."""

from dataclasses import replace
from pathlib import Path

from configuration_builders import at, changed, HEAD, load, problems, warnings
import pytest

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import ParameterType
from drive_can_bridge.protocols.canopen_pkw.family import CanopenPkw

FAMILY = CanopenPkw()
#: how two uses of an identifier are told
ONE = 'one identifier'

FILE = HEAD.replace('125000', '250000') + """\
      pump:
        bus: main
        protocol: canopen_pkw
        station: 5
        profile: table
        period: 0.1
        cyclic_request: [speed]
        cyclic_response: [status, status_2, current]
"""
PROFILE = """\
protocols: [canopen_pkw]
parameters:
  status: {number: 455, index: 0x2004, subindex: 6, access: ro}
  status_2: {number: 456, index: 0x2004, subindex: 7, access: ro}
  current: {number: 500, index: 0x2004, subindex: 0x33, type: uint32, scale: 0.01, access: ro}
  word: {number: 704, index: 0x2008, subindex: 5}
  speed: {number: 710, index: 0x2008, subindex: 11}
  position: {number: 720, index: 0x2008, subindex: 21, type: int32}
  position_high: {number: 721, index: 0x2008, subindex: 22}
control:
  parameter: word
  words: {disable: 0, enable: 1, reset_fault: 8}
  status: {parameter: status, ready: [1, 1], enabled: [0x80, 0x80], fault: [4, 4]}
"""


@pytest.fixture
def drive(tmp_path: Path) -> DriveConfiguration:
    return load(tmp_path, FILE, PROFILE).drives['pump']


def with_options(drive: DriveConfiguration, **options: object) -> DriveConfiguration:
    return replace(drive, options=replace(drive.options, **options))


def test_answers_may_take_longer_than_those_of_other_families(drive: DriveConfiguration) -> None:
    assert drive.parameter_timeout == 0.5


def test_claims(drive: DriveConfiguration) -> None:
    assert [(claim.route, claim.purpose) for claim in FAMILY.claims(drive)] == [
        ((0x505, 0x7FF, False), '505h (PKW requests to node 5)'),
        ((0x485, 0x7FF, False), '485h (PKW responses of node 5)'),
        ((0x085, 0x7FF, False), '085h (emergency messages of node 5)'),
        ((0x705, 0x7FF, False), '705h (heartbeats of node 5)'),
        ((0x000, 0x7FF, False), '000h (NMT)')]
    moved = with_options(drive, request_cob_id=0x201, response_cob_id=0x181)
    assert [claim.route.identifier for claim in FAMILY.claims(moved)] == [
        0x201, 0x181, 0x085, 0x705, 0x000]


def test_predefined_set_is_reserved(drive: DriveConfiguration) -> None:
    claims = FAMILY.reserved(drive)
    assert sorted(claim.route.identifier for claim in claims) == [
        0x080, 0x185, 0x205, 0x285, 0x305, 0x385, 0x405, 0x485, 0x505, 0x585, 0x605]
    assert {claim.route.mask for claim in claims} == {0x7FF}
    assert [claim.route.identifier for claim in claims if claim.shared] == [0x080]
    moved = with_options(drive, request_cob_id=0x201, response_cob_id=0x181)
    assert FAMILY.reserved(moved) == claims
    assert FAMILY.reserved(with_options(drive, predefined_set=False)) == []


#: an 11-bit drive that uses identifiers of node 5: what for, and what they would be to the node
STRANGERS = [
    ('datamodel_standard', 1, 'request_id_base: 0x204', '11-bit identifier 205h',
     '205h (receive PDO1 of node 5'),
    ('datamodel_standard', 1, 'request_id_base: 0x604', '11-bit identifier 605h',
     '605h (SDO requests to node 5'),
    ('datamodel_standard', 1, 'response_id_base: 0x584', '11-bit identifier 585h',
     '585h (SDO responses of node 5'),
    ('datamodel_standard', 1, 'request_id_base: 0x7F', '11-bit identifier 080h', '080h (SYNC'),
    ('datamodel_standard', 1, 'request_id_base: 0x384', '11-bit identifier 385h',
     '385h (transmit PDO3 of node 5'),
    # requests on 080h, answers on 081h
    ('cannord', 64, 'broadcast: none', 'process data to station 64', '080h (SYNC'),
]


@pytest.mark.parametrize(('protocol', 'station', 'key', 'own', 'purpose'), STRANGERS)
def test_other_families_keep_off_the_predefined_set(
        tmp_path: Path, protocol: str, station: int, key: str, own: str, purpose: str) -> None:
    text = FILE + f"""\
      fan:
        bus: main
        protocol: {protocol}
        station: {station}
        profile: {tmp_path}/other.yaml
        period: 0.1
        cyclic_response: [status]
        {key}
"""
    (tmp_path / 'other.yaml').write_text(
        f'protocols: [{protocol}]\nparameters: {{status: {{number: 1, access: ro}}}}\n')
    both = f'{ONE}, {own} here and {purpose}; predefined_set) there'
    assert problems(tmp_path, text, PROFILE) == [
        at('f.yaml:21: drives.fan.station', 'collides', station=station, other='pump',
           other_station=5, bus='main', purpose=both)]
    without = changed(text, 'station: 5', 'station: 5\n        predefined_set: false')
    assert problems(tmp_path, without, PROFILE) == []


def test_claims_collide_with_the_same_node_only(drive: DriveConfiguration) -> None:
    own = [*FAMILY.claims(drive), *FAMILY.reserved(drive)]
    for station in range(1, 128):
        node = replace(drive, station=station, options=FAMILY.make_options(station, {}))
        others = [*FAMILY.claims(node), *FAMILY.reserved(node)]
        assert any(mine.overlaps(other) for mine in own for other in others) == (station == 5)


def test_shortest_period(drive: DriveConfiguration) -> None:
    # 455 with 456, 500 with 501, and the write of 710: six frames of 135 bits
    for bitrate in (250_000, 10_000):
        assert FAMILY.shortest_period(drive, bitrate) == pytest.approx(6 * 135 / bitrate + 0.003)
    assert FAMILY.bits_per_second(drive) == pytest.approx(8100.0)
    # the status is no response: it is read all the same
    alone = replace(drive, cyclic_response=drive.cyclic_response[2:], cyclic_request=())
    assert FAMILY.shortest_period(alone, 250_000) == pytest.approx(4 * 135 / 250_000 + 0.002)


# two reads: 4 frames of 135 bits and 2 ms; most of them are no binary fractions
@pytest.mark.parametrize(('bitrate', 'least'), [
    (500_000, 0.00308), (250_000, 0.00416), (125_000, 0.00632), (800_000, 0.00268),
    (1_000_000, 0.00254), (33_333, 0.01821), (47_543, 0.01336), (10_000, 0.056)])
def test_the_shortest_period_that_is_named_is_allowed(tmp_path: Path, bitrate: int,
                                                      least: float) -> None:
    text = changed(changed(FILE, 'bitrate: 250000', f'bitrate: {bitrate}'),
                   '        cyclic_request: [speed]\n', '')
    too_short = changed(text, 'period: 0.1', f'period: {least - 1e-5:.5f}')
    problem, = problems(tmp_path, too_short, PROFILE)
    assert problem == at('f.yaml:15: drives.pump.period', 'period_too_short', least=least,
                         bitrate=bitrate)
    assert problem.endswith(f' {least} s')
    assert problems(tmp_path, changed(text, 'period: 0.1', f'period: {least}'), PROFILE) == []


@pytest.mark.parametrize(('old', 'new', 'problem'), [
    ('station: 5', 'station: 0',
     at('f.yaml:13: drives.pump.station', 'value_out_of_range', value=0, least=1, most=127,
        remark=' (canopen_pkw)')),
    ('[status, status_2, current]', '[]',
     at('f.yaml:17: drives.pump.cyclic_response', 'empty_list', family='canopen_pkw')),
    ('period: 0.1', 'period: 0.1\n        request_cob_id: 0x485',
     at('f.yaml:16: drives.pump.request_cob_id', 'identifier_of_node', identifier=0x485,
        purpose='response')),
    ('period: 0.1', 'period: 0.1\n        response_cob_id: 0x705',
     at('f.yaml:16: drives.pump.response_cob_id', 'identifier_of_node', identifier=0x705,
        purpose='heartbeat')),
])
def test_drive_keys(tmp_path: Path, old: str, new: str, problem: object) -> None:
    assert problem in problems(tmp_path, changed(FILE, old, new), PROFILE)


@pytest.mark.parametrize('line', [
    'request_cob_id: 0', 'request_cob_id: 0x800', 'response_cob_id: 0', 'response_cob_id: -1',
    'layout: big', 'word_order: high',
    'abort_code_order: none', 'addressing: sdo', 'heartbeat_timeout: -1', 'nmt_start: 1',
    'refresh_interval: -0.1', 'mapping: verify'])
def test_values_out_of_range(tmp_path: Path, line: str) -> None:
    text = changed(FILE, 'period: 0.1', f'period: 0.1\n        {line}')
    found, = problems(tmp_path, text, PROFILE)
    assert found.startswith(f'f.yaml:16: drives.pump.{line.split(":")[0]}: ')


@pytest.mark.parametrize(('addressing', 'old', 'new', 'problem'), [
    ('register', 'number: 455, ', '',
     at('table.yaml:3: parameters.status.number', 'address_missing', family='canopen_pkw',
        addressing='register', what='a number')),
    ('canopen', 'index: 0x2004, subindex: 6, ', '',
     at('table.yaml:3: parameters.status.index', 'address_missing', family='canopen_pkw',
        addressing='canopen', what='an index with a subindex')),
    ('canopen', 'index: 0x2004, subindex: 6, ', 'index: 0x2004, ',
     at('table.yaml:3: parameters.status.subindex', 'subindex_missing', most=255)),
    ('register', 'index: 0x2004, subindex: 6, ', 'index: 0x2004, ',
     at('table.yaml:3: parameters.status.subindex', 'subindex_missing', most=255)),
    ('register', 'number: 500', 'number: 65535',
     at('table.yaml:5: parameters.current.type', 'last_register', type='uint32',
        address='register 65535')),
    ('canopen', 'subindex: 0x33', 'subindex: 0xFF',
     at('table.yaml:5: parameters.current.type', 'last_register', type='uint32',
        address='2004h.FFh')),
])
def test_addresses(tmp_path: Path, addressing: str, old: str, new: str, problem: str) -> None:
    text = changed(FILE, 'period: 0.1', f'period: 0.1\n        addressing: {addressing}')
    assert problem in problems(tmp_path, text, changed(PROFILE, old, new))


def test_address_that_is_not_needed_may_be_missing(tmp_path: Path) -> None:
    bare = PROFILE.replace('number: 455, ', '')
    text = changed(FILE, 'period: 0.1', 'period: 0.1\n        addressing: canopen')
    assert problems(tmp_path, text, bare) == []
    bare = PROFILE.replace('index: 0x2004, subindex: 6, ', '')
    assert problems(tmp_path, FILE, bare) == []


@pytest.mark.parametrize(('request_', 'problem'), [
    ('[position, position_high]',
     "cyclic_request: 'position_high' and 'position' share a register, allowed is one of them"),
    ('[position_high, position]',
     "cyclic_request: 'position' and 'position_high' share a register, allowed is one of them"),
    ('[word, position]', ''), ('[speed, position]', ''),
])
def test_setpoints_that_overwrite_each_other(tmp_path: Path, request_: str, problem: str) -> None:
    text = changed(FILE, '[speed]', request_)
    expected = [f'f.yaml:16: drives.pump.{problem}'] if problem else []
    assert problems(tmp_path, text, PROFILE) == expected


def test_setpoint_that_overwrites_the_control_word(tmp_path: Path) -> None:
    profile = changed(PROFILE, 'number: 710, index: 0x2008, subindex: 11', 'number: 704')
    assert problems(tmp_path, FILE, profile) == [
        at('f.yaml:16: drives.pump.cyclic_request', 'shared_register', name='speed', other='word')]


# -- raw names ------------------------------------------------------------------------------------


@pytest.mark.parametrize(('name', 'address'), [
    ('p0', (0, None, None)), ('p9999', (9999, None, None)), ('p65535', (65535, None, None)),
    ('x3000.1', (None, 0x3000, 1)), ('x0.0', (None, 0, 0)), ('xffff.FF', (None, 0xFFFF, 255)),
    # the register of a listed parameter has that one's numbers
    ('p455', (455, 0x2004, 6)), ('x2004.06', (455, 0x2004, 6)),
    # 32 bits are no register
    ('p500', (500, None, None)), ('p720', (720, None, None)),
    *((name, None) for name in (
        '', 'p', 'p65536', 'p-1', 'P30', 'p30.1', 'x', 'x2004', 'x2004.', 'x.1', 'x20040.1',
        'x2004.100', 'x2004.1.1', 'xg.1', 'speed', 'p1 ', 'p٣'))])
def test_raw_names(drive: DriveConfiguration, name: str,
                   address: tuple[int | None, int | None, int | None] | None) -> None:
    found = FAMILY.raw_parameter(drive, name)
    assert (found and (found.number, found.index, found.subindex)) == address
    assert found is None or (found.name, found.type, found.scaled, found.listed) == (
        name, ParameterType.UINT16, False, False)


@pytest.mark.parametrize('keys, taken', [
    # receive PDO1: of a TeSys T the command register, as delivered
    ('request_cob_id: 0x205', 'receive PDO1 of node 5'),
    ('request_cob_id: 0x605', 'SDO requests to node 5'),
    ('request_cob_id: 0x80', 'SYNC'),
    ('response_cob_id: 0x185', 'transmit PDO1 of node 5'),
])
def test_mailbox_where_a_device_has_something_else_as_delivered(keys: str, taken: str,
                                                                tmp_path: Path) -> None:
    file = changed(FILE, 'period: 0.1', f'period: 0.1\n        {keys}')
    assert warnings(tmp_path, file, PROFILE) == [
        at(f'f.yaml:16: drives.pump.{keys.split(":")[0]}', 'predefined_identifier',
           identifier=int(keys.split(':')[1], 0), taken=taken)]
    without = changed(file, 'period: 0.1', 'period: 0.1\n        predefined_set: false')
    assert not warnings(tmp_path, without, PROFILE)


def test_mailbox_in_its_place_is_no_worry(tmp_path: Path) -> None:
    file = changed(FILE, 'period: 0.1', 'period: 0.1\n        request_cob_id: 0x505\n'
                                        '        response_cob_id: 0x485')
    assert warnings(tmp_path, file, PROFILE) == []
    assert warnings(tmp_path, FILE, PROFILE) == []
