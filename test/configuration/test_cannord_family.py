# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The family table's row of CANnord, and parameter files with such drives."""

from pathlib import Path

from configuration_builders import at, changed, HEAD, load, problems, warnings
import pytest

from drive_can_bridge.cli.main import main
from drive_can_bridge.core.frame import Frame, Route, worst_bits
from drive_can_bridge.core.parameters import ParameterType, ValueKind
from drive_can_bridge.protocols.cannord.family import Cannord
from drive_can_bridge.protocols.families import FAMILIES

FAMILY = Cannord()
LEADER = 'drive lift, which leads its broadcast group'
#: whoever has maps to compare
MAPPED = ', '.join(name for name, family in FAMILIES.items()
                   if 'mapping' in family.options_schema)

#: the line numbers in tests count from here
FILE = HEAD + """\
      lift:
        bus: main
        protocol: cannord
        station: 1
        profile: table
        period: 0.02
        cyclic_request: [speed]
        cyclic_response: [actual]
        broadcast: none
      hoist:
        bus: main
        protocol: cannord
        station: 2
        profile: table
        period: 0.02
        cyclic_request: [speed]
        cyclic_response: [actual]
        broadcast: none
"""

PROFILE = """\
description: for tests
protocols: [cannord]
parameters:
  speed: {type: int16, scale: 0.0030517578125, unit: Hz, minimum: -50, maximum: 50}
  second: {type: int16}
  third: {type: int16}
  fourth: {type: int16}
  fifth: {type: int16}
  sixth: {type: int16}
  actual: {type: int16, scale: 0.0030517578125, unit: Hz, access: ro}
  position: {number: 613, subindex: 21, type: int32}
  ramp: {number: 102, scale: 0.01, unit: s, storage: eeprom, minimum: 0.01, maximum: 60}
"""

CANOPEN = """\
  word: {index: 0x2000, subindex: 1}
control:
  parameter: word
  words: {disable: 0, enable: 1}
"""


def together(text: str = FILE) -> str:
    return text.replace('broadcast: none', 'broadcast: group')


def second(text: str, old: str, new: str) -> str:
    """Change the last place of a text where ``old`` stands."""
    before, found, after = text.rpartition(old)
    assert found
    return before + new + after


def test_a_good_file(tmp_path: Path) -> None:
    assert problems(tmp_path, FILE, PROFILE) == []
    assert warnings(tmp_path, FILE, PROFILE) == []
    assert problems(tmp_path, together(), PROFILE) == []
    # process data are volatile
    profile = f'{PROFILE}  passing: {{storage: ram}}\n'
    assert problems(tmp_path, FILE, profile) == []


@pytest.mark.parametrize(('old', 'new', 'found'), [
    ('station: 1', 'station: 256',
     at('f.yaml:13: drives.lift.station', 'value_out_of_range', value=256, least=0, most=255,
        remark=' (cannord)')),
    ('station: 1', 'station: 2',
     at('f.yaml:22: drives.hoist.station', 'collides', station=2, other='lift', other_station=2,
        bus='main', purpose='process data to station 2')),
    ('broadcast: none', 'parameter_set: 5',
     at('f.yaml:18: drives.lift.parameter_set', 'out_of_range', value=5,
        allowed='an integer of 1 to 4')),
    ('broadcast: none', 'value_order: middle',
     at('f.yaml:18: drives.lift.value_order', 'unknown_word', value='middle', near='',
        allowed='high_first or low_first')),
    ('[speed]', '[speed, second, third, fourth]',
     at('f.yaml:16: drives.lift.cyclic_request', 'too_many_parameters', count=4, most=3,
        more=' (5 with extra_setpoints: true)')),
    ('[speed]', '[speed, position]',
     at('f.yaml:16: drives.lift.cyclic_request', 'not_16_bits', name='position', type='int32')),
    ('[speed]', '[speed]\n        extra_setpoints: true\n'
                '        mapping: verify',
     at('f.yaml:18: drives.lift.mapping', 'key_of_others', owners=MAPPED, family='cannord')),
])
def test_problems(tmp_path: Path, old: str, new: str, found: object) -> None:
    assert problems(tmp_path, changed(FILE, old, new), PROFILE) == [found]


FIVE = '[speed, second, third, fourth, fifth]\n        extra_setpoints: true'


def test_five_entries_with_extra_setpoints(tmp_path: Path) -> None:
    assert problems(tmp_path, changed(FILE, '[speed]', FIVE), PROFILE) == []
    text = changed(FILE, '[speed]', FIVE.replace('fifth]', 'fifth, sixth]'))
    assert problems(tmp_path, text, PROFILE) == [
        at('f.yaml:16: drives.lift.cyclic_request', 'too_many_parameters', count=6, most=5,
           more='')]


def test_stations_at_the_ends(tmp_path: Path) -> None:
    text = changed(changed(FILE, 'station: 1', 'station: 0'), 'station: 2', 'station: 255')
    assert problems(tmp_path, text, PROFILE) == []


@pytest.mark.parametrize(('entry', 'found'), [
    ('far: {number: 2048}', at('table.yaml:13: parameters.far.number', 'value_out_of_range',
                               value=2048, least=0, most=2047, remark='')),
    ('far: {number: 5, subindex: 256}', at('table.yaml:13: parameters.far.subindex',
                                           'out_of_range', value=256,
                                           allowed='an integer of 0 to 255')),
    ('wide: {type: uint32}', at('table.yaml:13: parameters.wide.type', 'no_process_word',
                                type='uint32')),
    ('part: {subindex: 1}', at('table.yaml:13: parameters.part.subindex', 'subindex_alone')),
    ('kept: {storage: eeprom}', at('table.yaml:13: parameters.kept.storage',
                                   'process_data_stored')),
    ('status_word: {type: int16}', at('table.yaml:13: parameters.status_word', 'built_in',
                                      name='status_word', family='cannord')),
    ('flags: {number: 5, bits: {status_word: 1}}', at(
        'table.yaml:13: parameters.flags.bits.status_word', 'built_in', name='status_word',
        family='cannord')),
    (CANOPEN.strip().replace('index: 0x2000, subindex: 1', 'number: 5'),
     at('table.yaml:14: control', 'control_built_in', family='cannord')),
])
def test_problems_of_a_profile(tmp_path: Path, entry: str, found: object) -> None:
    assert problems(tmp_path, FILE, f'{PROFILE}  {entry}\n') == [found]


def test_a_profile_for_several_protocols(tmp_path: Path) -> None:
    profile = PROFILE.replace('[cannord]', '[cannord, canopen_pkw]') + CANOPEN
    configuration = load(tmp_path, FILE, profile)
    assert configuration.drives['lift'].profile.control is None
    assert configuration.warnings == ()


def test_short_periods_are_suspicious(tmp_path: Path) -> None:
    text = changed(changed(FILE, 'bitrate: 125000', 'bitrate: 1000000'), 'period: 0.02',
                   'period: 0.002')
    assert warnings(tmp_path, text, PROFILE) == [
        at('f.yaml:15: drives.lift.period', 'inverters_are_slow', period=0.002, answer=3.0,
           least=0.003)]


# -- identifiers ----------------------------------------------------------------------------------


def test_claims(tmp_path: Path) -> None:
    lift = load(tmp_path, changed(FILE, 'station: 1', 'station: 100'), PROFILE).drives['lift']
    assert [claim.route for claim in FAMILY.claims(lift)] == [
        Route(identifier, 0x7FF, False) for identifier in (0x0C8, 0x0C9, 0x2C8, 0x2C9)]
    assert not FAMILY.claims(lift)[0].route.matches(Frame(0x0C8, b'', True))


@pytest.mark.parametrize(('broadcast', 'extended', 'identifier'), [
    ('group', 'false', 0x400), ('all', 'false', 0x408), ('group', 'true', 0x10000000),
    ('all', 'true', 0x10200000)])
def test_broadcast_identifiers_are_shared(tmp_path: Path, broadcast: str, extended: str,
                                          identifier: int) -> None:
    text = FILE.replace('broadcast: none', f'broadcast: {broadcast}\n'
                                           f'        extended_identifiers: {extended}')
    drives = load(tmp_path, text, PROFILE).drives
    claims = [FAMILY.claims(drives[name])[-1] for name in ('lift', 'hoist')]
    assert [claim.route.identifier for claim in claims] == [identifier] * 2
    assert not claims[0].overlaps(claims[1])


@pytest.mark.parametrize(('first', 'second', 'refused'), [
    ('group', 'group', True), ('group', 'all', True), ('group', 'none', False)])
def test_broadcasts_of_two_buses_that_are_one(tmp_path: Path, first: str, second: str, *,
                                              refused: bool) -> None:
    """Each inverter would obey the control word of both."""
    text = FILE.replace('bitrate: 125000\n', """bitrate: 125000
      other: {interface: virtual, channel: demo, bitrate: 125000}
""")
    text = text.replace('broadcast: none', f'broadcast: {first}', 1).replace(
        'broadcast: none', f'broadcast: {second}', 1)
    head, hoist, tail = text.partition('      hoist:\n        bus: ')
    text = head + hoist + tail.replace('main', 'other', 1)
    assert problems(tmp_path, text, PROFILE) == [
        at('f.yaml:21: drives.hoist.bus', 'told_by_two_buses', bus='other', other='lift',
           other_bus='main', what='cannord broadcast')] * refused


def test_members_that_differ(tmp_path: Path) -> None:
    assert problems(tmp_path, second(together(), '[speed]', '[second]'), PROFILE) == [
        at('f.yaml:25: drives.hoist.cyclic_request', 'request_differs',
           leader=LEADER)]
    assert problems(tmp_path, second(together(), 'period: 0.02', 'period: 0.05'), PROFILE) == [
        at('f.yaml:24: drives.hoist.period', 'period_differs', period=0.05, other=0.02,
           leader=LEADER)]
    joint = ('broadcast: group\n        joint: {name: j, velocity: actual, '
             'velocity_command: speed}')
    assert problems(tmp_path, second(together(), 'broadcast: group', joint), PROFILE) == [
        at('f.yaml:28: drives.hoist.joint.velocity_command', 'led_by_other',
           leader=LEADER)]
    assert problems(tmp_path, changed(together(), 'broadcast: group', joint), PROFILE) == []


@pytest.mark.parametrize(('first', 'other'), [('group', 'all'), ('all', 'group')])
def test_group_and_all_on_one_bus(tmp_path: Path, first: str, other: str) -> None:
    text = second(together().replace('broadcast: group', f'broadcast: {first}'),
                  f'broadcast: {first}', f'broadcast: {other}')
    assert problems(tmp_path, text, PROFILE) == [
        at('f.yaml:27: drives.hoist.broadcast', 'both_broadcasts', mine=other, drive='lift',
           other=first)]
    apart = changed(second(text, 'bus: main', 'bus: other'), '    drives:\n',
                    '      other: {interface: virtual, channel: b}\n    drives:\n')
    assert problems(tmp_path, apart, PROFILE) == []
    assert problems(tmp_path, second(text, other, 'none'), PROFILE) == []


def test_a_wrong_station_makes_no_further_problems(tmp_path: Path) -> None:
    text = second(second(together(), 'station: 2', 'station: 300'), 'period: 0.02', 'period: 0.5')
    assert problems(tmp_path, text, PROFILE) == [
        at('f.yaml:22: drives.hoist.station', 'value_out_of_range', value=300, least=0, most=255,
           remark=' (cannord)')]


def test_members_on_another_bus_are_strangers(tmp_path: Path) -> None:
    text = changed(second(second(together(), 'bus: main', 'bus: other'), '[speed]', '[second]'),
                   '    drives:\n', '      other: {interface: virtual, channel: b}\n    drives:\n')
    assert problems(tmp_path, text, PROFILE) == []


# -- load -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(('length', 'extended', 'bits'), [
    (8, False, 135), (8, True, 160), (4, False, 95), (5, False, 105), (0, False, 55),
    (4, True, 120)])
def test_worst_bits(length: int, extended: bool, bits: int) -> None:
    assert worst_bits(length, extended=extended) == bits


def test_load(tmp_path: Path) -> None:
    lift = load(tmp_path, FILE, PROFILE).drives['lift']
    assert FAMILY.bits_per_second(lift) == pytest.approx(2 * 95 / 0.02)
    longer = load(tmp_path, changed(
        FILE, '[speed]', '[speed, second, third, fourth]\n        extra_setpoints: true'), PROFILE)
    assert FAMILY.bits_per_second(longer.drives['lift']) == pytest.approx(2 * (135 + 105) / 0.02)


def test_a_group_shares_its_load(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for text, load_ in (
            # one broadcast, one request and one answer a period: 285 bits in 20 ms are 11.4 %
            (together(), '5.7'),
            # all frames are as long as one member wants: 3 * 135 bits in 20 ms are 16.2 %
            (second(together(), '[actual]', '[actual, second]'), '8.1'),
            (FILE, '7.6')):
        load(tmp_path, text, PROFILE)
        assert main(['validate', str(tmp_path / 'f.yaml')]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert [line.split()[-3:] for line in lines] == [['load', load_, '%']] * 2


# -- raw names ------------------------------------------------------------------------------------


@pytest.mark.parametrize(('name', 'address'), [
    ('p0', (0, None)), ('p102', (102, None)), ('p0102', (102, None)), ('p2047', (2047, None)),
    ('p613.0', (613, 0)), ('p613.21', (613, 21)), ('p613.255', (613, 255)),
    *((name, None) for name in (
        'p', 'p2048', 'p99999', 'p1.256', 'p1.', 'p.1', 'p1.2.3', 'P1', 'x2000.1', 'p-1', 'p1 ',
        'ramp'))])
def test_raw_names(tmp_path: Path, name: str, address: tuple[int, int | None] | None) -> None:
    lift = load(tmp_path, FILE, PROFILE).drives['lift']
    found = FAMILY.raw_parameter(lift, name)
    assert (found and (found.number, found.subindex)) == address
    assert found is None or (found.type, found.width_known, found.kind, found.listed) == (
        ParameterType.UINT32, False, ValueKind.INTEGER, False)


def test_broadcasts_that_an_inverter_may_obey_are_claimed_by_nobody(tmp_path: Path) -> None:
    """Another drive may use 400h or 408h: what is only overheard collides with nothing."""
    lift = load(tmp_path, FILE, PROFILE).drives['lift']
    assert lift.options.broadcast == 'none'
    claimed = [claim.route.identifier for claim in FAMILIES['cannord'].claims(lift)]
    heard = [route.identifier for route in FAMILIES['cannord'].overheard(lift)]
    assert heard == [0x400, 0x408]
    assert not set(heard) & set(claimed)
