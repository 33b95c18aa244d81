# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Drives with 11-bit DataModel identifiers in a parameter file, alone and beside others."""

from dataclasses import asdict, replace
from pathlib import Path

from configuration_builders import at, changed, FILE, load, problems, PROFILE, warnings
import pytest
from saying import says

from drive_can_bridge.configuration.checks import bus_shares
from drive_can_bridge.core.configuration import BridgeConfiguration, DriveConfiguration
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.protocols.datamodel.family import DataModelStandard

FAMILY = DataModelStandard()
TABLE = changed(PROFILE, 'protocols: [datamodel_extended]',
                'protocols: [datamodel_extended, datamodel_standard]')
#: conveyor and lift, both with 11-bit identifiers
BOTH = FILE.replace('protocol: datamodel_extended', 'protocol: datamodel_standard')
#: conveyor with 11 bits, lift with 29
MIXED = changed(FILE, 'protocol: datamodel_extended', 'protocol: datamodel_standard')
STATION = 'f.yaml:13: drives.conveyor.station'


def with_keys(*lines: str, text: str = MIXED) -> str:
    """Add keys to the conveyor; the first of them stands in line 18."""
    added = ''.join(f'        {line}\n' for line in lines)
    return changed(text, '        rearm: neutral\n', added)


def loaded(folder: Path, text: str = MIXED) -> BridgeConfiguration:
    return load(folder, text, TABLE)


def found(folder: Path, text: str) -> list[str]:
    return problems(folder, text, TABLE)


@pytest.fixture
def drive(tmp_path: Path) -> DriveConfiguration:
    return loaded(tmp_path).drives['conveyor']


# -- keys -----------------------------------------------------------------------------------------


def test_all_keys(tmp_path: Path) -> None:
    drive = loaded(tmp_path, with_keys(
        'request_id_base: 0x300', 'response_id_base: 896', 'quarantine: 1',
        'refresh_interval: 0', 'length_policy: strict', 'eeprom_write_gap: 0.05',
        'parameter_offset: -1', 'request_map_base: 200', 'response_map_base: 300',
        'allow_fast_cycle: true')).drives['conveyor']
    assert asdict(drive.options) == {
        'request_map_base': 200, 'response_map_base': 300, 'parameter_offset': -1,
        'request_id_base': 0x300, 'response_id_base': 0x380, 'eeprom_write_gap': 0.05,
        'quarantine': 1.0, 'length_policy': 'strict', 'refresh_interval': 0.0,
        'allow_fast_cycle': True}
    assert isinstance(drive.options.quarantine, float)
    assert isinstance(drive.options.refresh_interval, float)


@pytest.mark.parametrize(('key', 'allowed'), [
    ('quarantine: -0.1', '-0.1 is out of range, allowed is a number of 0 to 60'),
    ('quarantine: long', "'long' is a string, allowed is a number of 0 to 60"),
    ('refresh_interval: -1', '-1 is out of range, allowed is a number of 0 to 3600'),
    ('eeprom_write_gap: 0.019', '0.019 is out of range, allowed is a number of 0.02 to 60'),
    ('request_id_base: 0x7FF', '2047 is out of range, allowed is an integer of 0 to 2046'),
    ('response_id_base: -1', '-1 is out of range, allowed is an integer of 0 to 2046'),
    ('response_id_base: 7F0h', "'7F0h' is a string, allowed is an integer of 0 to 2046"),
    ('length_policy: lax', "'lax' is unknown, allowed is lenient or strict"),
])
def test_values_out_of_range(tmp_path: Path, key: str, allowed: str) -> None:
    assert found(tmp_path, with_keys(key)) == [
        f'f.yaml:18: drives.conveyor.{key.split(":")[0]}: {allowed}']


def test_a_profile_of_the_other_protocol_is_refused(tmp_path: Path) -> None:
    assert problems(tmp_path, MIXED) == [
        at('f.yaml:14: drives.conveyor.profile', 'profile_for_others', name='table',
           protocols='datamodel_extended', family='datamodel_standard')]


# -- stations and identifiers ---------------------------------------------------------------------


@pytest.mark.parametrize(('station', 'keys', 'expected'), [
    (0, [], at(STATION, 'station_out_of_range', station=0, most=15, family='datamodel_standard')),
    *((station, [], at(STATION, 'identifier_too_long', station=station, direction='response',
                       base=0x7F0, identifier=total, most=15))
      for station, total in ((16, 0x800), (17, 0x801), (127, 0x86F))),
    (8, ['request_id_base: 0x7F8', 'response_id_base: 0x100'],
     at(STATION, 'identifier_too_long', station=8, direction='request', base=0x7F8,
        identifier=0x800, most=7)),
    (1, ['response_id_base: 0x3F0'],
     at('f.yaml:18: drives.conveyor.response_id_base', 'same_base', base=1008)),
])
def test_identifiers_that_are_refused(tmp_path: Path, station: int, keys: list[str],
                                      expected: says) -> None:
    text = changed(with_keys(*keys), 'station: 1', f'station: {station}')
    assert found(tmp_path, text) == [expected]


def test_custom_bases(tmp_path: Path) -> None:
    text = changed(with_keys('request_id_base: 0x300', 'response_id_base: 0x380'),
                   'station: 1', 'station: 20')
    request, response = FAMILY.claims(loaded(tmp_path, text).drives['conveyor'])
    assert request.route == (0x314, 0x7FF, False)
    assert response.route == (0x394, 0x7FF, False)


def test_claims(drive: DriveConfiguration) -> None:
    request, response = FAMILY.claims(drive)
    assert request.route.matches(Frame(0x3F1, b'', False))
    assert response.route.matches(Frame(0x7F1, b'', False))
    for claim in (request, response):
        # the same numbers in the other frame format, and the neighbours
        for identifier in (0x3F1, 0x7F1):
            assert not claim.route.matches(Frame(identifier, b'', True))
        for identifier in (0x3F0, 0x3F2, 0x7F0, 0x7F2, 0x7FF, 0):
            assert not claim.route.matches(Frame(identifier, b'', False))


# -- collisions -----------------------------------------------------------------------------------


def collision(station: int, other: int, identifier: str) -> says:
    return at('f.yaml:22: drives.lift.station', 'collides', station=station, other='conveyor',
              other_station=other, bus='main', purpose=f'11-bit identifier {identifier}')


def test_the_same_station_twice(tmp_path: Path) -> None:
    assert found(tmp_path, changed(BOTH, 'station: 2', 'station: 1')) == [collision(1, 1, '3F1h')]


def test_the_request_of_one_is_the_response_of_another(tmp_path: Path) -> None:
    # answers of station 1 on 3F8h + 1 = 3F9h, requests to station 9 on 3F0h + 9 = 3F9h
    text = changed(with_keys('response_id_base: 0x3F8', text=BOTH), 'station: 2', 'station: 9')
    assert found(tmp_path, text) == [collision(9, 1, '3F9h')]
    # and the other way round: the later drive answers where the earlier one is asked
    text = changed(changed(BOTH, 'station: 1', 'station: 9'), 'station: 2',
                   'station: 1\n        response_id_base: 0x3F8')
    assert found(tmp_path, text) == [collision(1, 9, '3F9h')]


def test_the_same_station_with_other_bases_is_another_drive(tmp_path: Path) -> None:
    text = changed(with_keys('request_id_base: 0x300', 'response_id_base: 0x380', text=BOTH),
                   'station: 2', 'station: 1')
    assert found(tmp_path, text) == []


@pytest.mark.parametrize(('first', 'second'), [(1, 1), (15, 15), (1, 127)])
def test_equal_numbers_with_29_and_11_bits_do_not_collide(tmp_path: Path, first: int,
                                                          second: int) -> None:
    text = changed(changed(MIXED, 'station: 1', f'station: {first}'), 'station: 2',
                   f'station: {second}')
    assert warnings(tmp_path, text, TABLE) == []


def test_a_station_that_does_not_fit_is_not_somebody_elses(tmp_path: Path,
                                                           drive: DriveConfiguration) -> None:
    # masked to 11 bits, 800h would be 000h
    claim, = FAMILY.claims(replace(drive, station=16))
    assert claim.route == (0x400, 0x7FF, False)
    text = changed(BOTH, 'station: 1', 'station: 16')
    text = changed(text, 'station: 2', 'station: 1\n        request_id_base: 0x010\n'
                                       '        response_id_base: 0x020')
    assert len(found(tmp_path, text)) == 1


# -- period ---------------------------------------------------------------------------------------

# one read and two writes; and the status, which enable is repeated behind, every period: 6 frames
@pytest.mark.parametrize(('request_', 'response', 'refresh', 'shortest'), [
    ('[speed, word]', '[actual]', 0.005, 0.01048), ('[speed, word]', '[actual]', 0.5, 0.00732),
    ('[speed, word]', '[actual]', 0.0, 0.00732), ('[speed, word]', '[status]', 0.005, 0.00732),
    ('[speed, limit]', '[actual]', 0.005, 0.00732)])
def test_a_status_that_is_read_in_every_period_counts(
        tmp_path: Path, request_: str, response: str, refresh: float, shortest: float) -> None:
    text = with_keys(f'refresh_interval: {refresh}')
    text = changed(text, '[speed, limit]', request_)
    text = changed(text, '[actual, current, status]', response)
    too_short = changed(text, 'period: 0.02', 'period: 0.006')
    assert found(tmp_path, too_short) == [
        at('f.yaml:15: drives.conveyor.period', 'period_too_short', period=0.006, bitrate=125000,
           least=shortest)]
    assert found(tmp_path, changed(text, 'period: 0.02', f'period: {shortest}')) == []


# reads of 1 ms and two frames of 135 bits each
@pytest.mark.parametrize(('reads', 'bitrate', 'least'), [
    ('[actual]', 500_000, 0.00154), ('[actual]', 250_000, 0.00208), ('[actual]', 800_000, 0.00134),
    ('[status, position]', 500_000, 0.00308),
    ('[ramp, speed, status, position]', 500_000, 0.00616),
    ('[ramp, speed, status, position]', 800_000, 0.00535),
])
def test_the_shortest_period_that_is_named_is_allowed(tmp_path: Path, reads: str, bitrate: int,
                                                      least: float) -> None:
    text = changed(MIXED, 'bitrate: 125000', f'bitrate: {bitrate}')
    text = changed(text, '        cyclic_request: [speed, limit]\n', '')
    text = changed(with_keys('allow_fast_cycle: true', text=text),
                   '[actual, current, status]', reads)
    too_short = changed(text, 'period: 0.02', f'period: {least - 1e-5:.5f}')
    assert found(tmp_path, too_short) == [
        at('f.yaml:15: drives.conveyor.period', 'period_too_short', least=least)]
    assert found(tmp_path, changed(text, 'period: 0.02', f'period: {least}')) == []


def test_the_manual_s_5_ms(tmp_path: Path) -> None:
    text = changed(changed(MIXED, 'period: 0.02', 'period: 0.004'), 'bitrate: 125000',
                   'bitrate: 1000000')
    assert found(tmp_path, text) == [
        at('f.yaml:15: drives.conveyor.period', 'period_too_fast', period=0.004, least=0.005)]
    text = changed(text, 'rearm: neutral', 'allow_fast_cycle: true')
    assert found(tmp_path, text) == []


@pytest.mark.parametrize(('response', 'frames'), [
    ('[actual, current, status]', 4),          # 209 to 211: one read
    ('[status, actual, current]', 4),          # the order does not matter
    ('[actual, current, status, position]', 6),   # 209 to 211; 214 is out of reach
    ('[position, frequency]', 4),              # 214 and 215
    ('[speed, limit, word, flag]', 4),         # 50 to 53
    ('[speed, limit, word, flag, angle]', 6),  # 50 to 54: two
    ('[speed, flag]', 4),                      # 50 and 53, over 51 and 52
    ('[angle, actual]', 6),
])
def test_reads_of_a_round(tmp_path: Path, response: str, frames: int) -> None:
    drive = loaded(tmp_path, changed(MIXED, '[actual, current, status]', response)
                   ).drives['conveyor']
    assert FAMILY.bits_per_second(drive) == pytest.approx(135 * frames / 0.02)


# -- lists ----------------------------------------------------------------------------------------


def test_there_has_to_be_something_to_poll(tmp_path: Path) -> None:
    line = '        cyclic_response: [actual, current, status]\n'
    empty = changed(MIXED, line, '        cyclic_response: []\n')
    assert found(tmp_path, empty) == [
        at('f.yaml:17: drives.conveyor.cyclic_response', 'empty_list',
           family='datamodel_standard')]
    assert found(tmp_path, changed(MIXED, line, '')) == [
        at('f.yaml:10: drives.conveyor.cyclic_response', 'empty_list',
           family='datamodel_standard')]


def test_no_setpoints_or_more_than_four_of_each(tmp_path: Path) -> None:
    text = changed(MIXED, '[actual, current, status]',
                   '[actual, current, status, position, frequency, ramp]')
    for request in ('[]', '[speed, limit, flag, angle, order]'):
        drive = loaded(tmp_path, changed(text, '[speed, limit]', request)).drives['conveyor']
        assert len(drive.cyclic_response) == 6


def test_32_bits_do_not_exist(tmp_path: Path) -> None:
    table = changed(TABLE, 'position: {number: 214, type: int16', 'position: {number: 214, '
                                                                  'type: int32')
    lines = problems(tmp_path, BOTH, table)
    assert lines
    assert all(line == says('no_such_type', file='table.yaml', type='int32',
                            family='datamodel_standard') for line in lines)


# -- load -----------------------------------------------------------------------------------------


def test_load_of_mixed_drives(tmp_path: Path) -> None:
    both = loaded(tmp_path)
    assert bus_shares(both.buses['main'], both.drives.values()) == pytest.approx({
        'conveyor': 4 * 135 / 0.02 / 125_000,           # 21.6 %
        'lift': (2 * 160 / 0.02 + 640) / 125_000})      # 13.3 %
