# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Names of parameters, listed and raw, and what users may set."""

from array import array

from builders import (
    ACTUAL, BOOL, drive, EEPROM, FLAG, GAIN, INT16, ORDER, parameter, RAM, RAMP, RO, RW, SPEED,
    TABLE, WO,
)
import pytest
from saying import says

from drive_can_bridge.core.directory import contradictions, ParameterDirectory
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import AccessMode, Parameter, ParameterType, Storage
from drive_can_bridge.protocols.families import FAMILIES


def directory(*table: Parameter, protocol: str = 'datamodel_extended') -> ParameterDirectory:
    family = FAMILIES[protocol]
    configuration = drive(table=table or TABLE)
    return ParameterDirectory(configuration.profile.parameters,
                              lambda name: family.raw_parameter(configuration, name))


def test_finds_listed_and_raw_names() -> None:
    names = directory()
    assert names.find('ramp_time') is RAMP
    raw = names.find('p600')
    assert raw == parameter('p600', 600, listed=False)
    assert names.find('no_such_thing') is None
    assert names.find('p65536') is None


def test_raw_name_of_a_listed_parameter_obeys_its_rules() -> None:
    names = directory()
    for name, twin in (('p209', ACTUAL), ('p30', RAMP), ('p43', ORDER), ('p40', GAIN)):
        raw = names.find(name)
        assert raw is not None
        assert (raw.access, raw.storage) == (twin.access, twin.storage)
        assert not raw.listed
        assert names.twins(raw) == [twin]
    assert names.twins(RAMP) == [RAMP]


@pytest.mark.parametrize('first, second, wanted', [
    ((RO, RAM), (RW, EEPROM), (RO, EEPROM)), ((RW, EEPROM), (RO, RAM), (RO, EEPROM)),
    ((RW, RAM), (WO, None), (WO, None)), ((WO, None), (RW, RAM), (WO, None)),
    ((RW, RAM), (RW, RAM), (RW, RAM)),
])
def test_two_listed_parameters_with_one_number(
        first: tuple[AccessMode, Storage | None], second: tuple[AccessMode, Storage | None],
        wanted: tuple[AccessMode, Storage | None]) -> None:
    raw = directory(*(
        parameter(name, 70, access=access, storage=storage)
        for name, (access, storage) in (('a', first), ('b', second)))).find('p70')
    assert raw is not None
    assert (raw.access, raw.storage) == wanted


def test_unknown_names_get_a_hint() -> None:
    names = directory()
    assert names.unknown('ramp_tme') == says(
        'unknown_parameter', name='ramp_tme', nearest='ramp_time')
    assert names.unknown('zzz') == says('unknown_parameter', name='zzz', nearest=None)
    assert names.unknown('') == says('unknown_parameter', name="''", nearest=None)


@pytest.mark.parametrize(('protocol', 'written', 'nearest'), [
    ('cia402', 'x6041', 'x6041.0'), ('cia402', 'X1018.1', 'x1018.1'),
    ('cia402', '6041h', 'x6041.0'), ('cia402', '0x60FF', 'x60ff.0'),
    ('cia402', '1018h.01h', 'x1018.01'), ('cia402', '1018:01', 'x1018.01'),
    ('cia402', '60411', None),
    ('cannord', 'P102', 'p102'), ('cannord', '102', 'p102'), ('cannord', 'p9999', None),
    ('datamodel_extended', '600', 'p600'), ('canopen_pkw', 'P455', 'p455')])
def test_numbers_as_manuals_write_them_get_a_hint(
        protocol: str, written: str, nearest: str | None) -> None:
    assert directory(protocol=protocol).unknown(written) == says(
        'unknown_parameter', name=written, nearest=nearest)


@pytest.mark.parametrize('entry, value, raw', [
    (RAMP, 1.5, 150), (RAMP, 2, 200), (GAIN, 7, 7), (FLAG, True, 1), (SPEED, -1, -10),
])
def test_values_of_users(entry: Parameter, value: object, raw: int) -> None:
    assert directory().raw_from_user(entry, value) == raw


@pytest.mark.parametrize('entry, value, text', [
    (ACTUAL, 1.0, 'read-only'),
    (RAMP, '1.5', 'wrong type: string, expected double'),
    (RAMP, True, 'wrong type: bool, expected double'),
    (GAIN, 7.0, 'wrong type: double, expected integer'),
    (GAIN, False, 'wrong type: bool, expected integer'),
    (FLAG, 1, 'wrong type: integer, expected bool'),
    (GAIN, None, 'wrong type: not set, expected integer'),
    (GAIN, [1], 'wrong type: array, expected integer'),
    (GAIN, array('q', [1]), 'wrong type: array, expected integer'),
    (GAIN, b'1', 'wrong type: bytes, expected integer'),
    (RAMP, 61.0, '61 is out of range: 0.01 to 60 s'),
    (RAMP, float('nan'), 'not a finite number'),
])
def test_refused_values(entry: Parameter, value: object, text: str) -> None:
    with pytest.raises(ValueRefused, match=text):
        directory().raw_from_user(entry, value)


@pytest.mark.parametrize('value, word', [(0, 0), (65535, 65535), (-1, 65535), (-32768, 32768)])
def test_raw_values_are_words(value: int, word: int) -> None:
    names = directory()
    raw = names.find('p600')
    assert raw is not None
    assert names.raw_from_user(raw, value) == word


@pytest.mark.parametrize('value', [65536, -32769, 2**63 - 1, -2**63])
def test_raw_values_that_do_not_fit(value: int) -> None:
    names = directory()
    raw = names.find('p600')
    assert raw is not None
    with pytest.raises(ValueRefused, match='not representable in 16 bits: -32768 to 65535'):
        names.raw_from_user(raw, value)


def test_raw_name_does_not_get_around_the_limits() -> None:
    names = directory()
    raw = names.find('p30')
    assert raw is not None
    assert names.raw_from_user(raw, 6000) == 6000
    with pytest.raises(ValueRefused, match='60.01 is out of range: 0.01 to 60 s'):
        names.raw_from_user(raw, 6001)
    with pytest.raises(ValueRefused, match='out of range'):
        names.raw_from_user(raw, 0)
    with pytest.raises(ValueRefused, match='wrong type: double, expected integer'):
        names.raw_from_user(raw, 1.5)


def test_raw_name_of_a_signed_parameter() -> None:
    signed = parameter('signed', 70, type=INT16, scale=0.1, minimum=-5.0, maximum=5.0)
    names = directory(signed, parameter('flag', 71, type=BOOL))
    raw, flag = names.find('p70'), names.find('p71')
    assert raw is not None
    assert flag is not None
    assert names.raw_from_user(raw, -50) == 0xFFCE
    assert names.raw_from_user(raw, 0xFFCE) == 0xFFCE
    assert names.raw_from_user(flag, 1) == 1
    with pytest.raises(ValueRefused, match='-5.1 is out of range'):
        names.raw_from_user(raw, -51)


def test_raw_names_whose_width_the_drive_tells() -> None:
    wide = parameter('wide', 80, type=ParameterType.INT32, access=RO)
    narrow = parameter('narrow', 81, type=INT16)
    names = ParameterDirectory({'wide': wide, 'narrow': narrow}, lambda name: Parameter(
        name, ParameterType.UINT32, int(name[1:]), listed=False, width_known=False))
    unknown, known, short = names.find('p82'), names.find('p80'), names.find('p81')
    assert unknown is not None
    assert known is not None
    assert short is not None
    # two's complement of as many bits as the drive will say
    assert names.raw_from_user(unknown, -5) == -5
    assert names.raw_from_user(unknown, 0xFFFFFFFF) == 0xFFFFFFFF
    with pytest.raises(ValueRefused, match='-2147483649 is not representable in 32 bits'):
        names.raw_from_user(unknown, -0x80000001)
    assert (known.type, known.width_known) == (ParameterType.UINT32, True)
    assert (short.type, short.width_known) == (ParameterType.UINT16, True)
    assert names.raw_from_user(short, -5) == 0xFFFB
    with pytest.raises(ValueRefused, match='not representable in 16 bits'):
        names.raw_from_user(short, 0x10000)


def test_two_values_for_one_parameter_contradict_each_other() -> None:
    names = directory()

    def contradicted(**raws: int) -> list[object]:
        return contradictions([
            (parameter, raw) for name, raw in raws.items()
            if (parameter := names.find(name)) is not None])
    assert contradicted(ramp_time=200, p31=200, p30=100) == [
        says('contradicted', other='p30'), '', says('contradicted', other='ramp_time')]
    assert contradicted(ramp_time=200, p30=200) == ['', '']
    # one word has it all, however its sign is said
    assert contradicted(speed_setpoint=-1, p50=0xFFFF) == ['', '']
    assert contradictions([(RAMP, 1), (RAMP, 1), (RAMP, 2)]) == [
        says('contradicted', other='ramp_time')] * 3
    assert contradictions([]) == []


def test_what_only_process_data_carry_is_one_parameter_each() -> None:
    first, second = (parameter(name, None) for name in ('first', 'second'))
    assert contradictions([(first, 1), (second, 2)]) == ['', '']
