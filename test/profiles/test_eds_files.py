# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
EDS and DCF files as makers have them: limits, heads, names, axes, units, and what is no drive.

What is written here was found in 173 public files of 45 makers; names and numbers are our own.
"""

import codecs
from pathlib import Path
from typing import Any

from import_builders import bring_in, Outcome
import pytest

from drive_can_bridge.cli.main import main
from drive_can_bridge.profiles.catalogue import ImportFailed

DRIVE = ('6040', 'Controlword', 6, 'rww', ''), ('6041', 'Statusword', 6, 'ro', '')


def objects(*entries: tuple[str, str, int, str, str]) -> str:
    """Write a file: section, name, data type, access, further lines."""
    text = '[DeviceInfo]\nVendorName=Seilbahn AG\nProductName=Winde 3\n'
    return text + ''.join(
        f'[{section}]\nParameterName={name}\nDataType={code}\nAccessType={access}\n{keys}\n'
        for section, name, code, access, keys in entries)


def bring(folder: Path, *entries: tuple[str, str, int, str, str], **options: Any) -> Outcome:
    pytest.importorskip('canopen')
    return bring_in(folder, objects(*entries), 'winch.eds', **options)


# -- limits ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(('code', 'low', 'high', 'minimum', 'maximum'), [
    (2, '0x80', '0x7F', -128, 127), (2, '0x00', '0xFF', 0, 127), (2, '-128', '200', -128, 127),
    (2, '0x81', '-1', -127, -1), (3, '0x8AD0', '30000', -30000, 30000),
    (3, '-32768', '32768', -32768, 32767), (3, '-100', '65535', -100, 32767),
    (3, '0', '40000', 0, 32767), (3, '0', '0x12345', 0, 32767), (3, '0x0000', '0xFFFF', 0, 32767),
    (3, '-40000', '5', -32768, 5), (3, '40000', '50000', None, 32767),
    (3, '-50000', '-40000', -32768, None), (4, '-5000', '4294967295', -5000, 2147483647),
    (4, '0x80000000', '0x7FFFFFFF', -2147483648, 2147483647),
    (4, '0xFFFF', '0x7FFF', None, None), (6, '0', '70000', 0, 65535),
    (6, '-1', '0X10', 0, 16), (6, '0x10000', '0x1FFFF', None, 65535),
    (7, '7', '-1', 7, None), (7, '08', '09', 8, 9), (7, '007', '00100', 7, None),
    (7, '0.0', '100.0', 0, 100), (7, '1', '100 %', 1, None), (7, '-', '0x', None, None),
    (7, '9 ; least', '0x10 # most', 9, 16)])
def test_limits_are_those_that_the_file_says(
        tmp_path: Path, code: int, low: str, high: str, minimum: int | None,
        maximum: int | None) -> None:
    made = bring(tmp_path, *DRIVE, ('3301', 'Rope', code, 'rw',
                                    f'LowLimit={low}\nHighLimit={high}\n'))
    rope = made.parameters['rope']
    assert (rope.minimum, rope.maximum) == (minimum, maximum)
    assert made.left_out == []


def test_a_limit_beyond_the_type_is_said(tmp_path: Path) -> None:
    made = bring(tmp_path, *DRIVE, ('3301', 'Rope', 3, 'rw', 'LowLimit=40000\nHighLimit=65535\n'))
    assert '# LowLimit 40000 left out: int16 is -32768 to 32767' in made.built.text
    assert '# maximum: HighLimit 65535 is beyond int16, which ends at 32767' in made.built.text


def test_limits_count_in_the_unit_of_the_entry(tmp_path: Path) -> None:
    made = bring(tmp_path, *DRIVE, (
        '3301', 'Lowering', 3, 'rw', 'LowLimit=-10\nHighLimit=40000\nFactor=-0.5\nUnit=mm\n'))
    lowering = made.parameters['lowering']
    assert (lowering.scale, lowering.minimum, lowering.maximum) == (-0.5, -16383.5, 5.0)


def test_the_end_of_a_wide_type_is_no_limit_beyond_it(tmp_path: Path) -> None:
    """4294967295 steps of 1/256: 16777215.9961 with 12 digits is more than the type holds."""
    made = bring(tmp_path, *DRIVE, (
        '3301', 'Way', 7, 'rw', 'LowLimit=0\nHighLimit=0xFFFFFFFF\nFactor=0.00390625\nUnit=km\n'))
    assert made.parameters['way'].maximum == 16777215.99609375
    assert 'left out' not in made.built.text


# -- names ----------------------------------------------------------------------------------------


def test_names_with_dots_and_elements_of_equal_names(tmp_path: Path) -> None:
    made = bring(
        tmp_path, *DRIVE, ('3400', 'Winch', 6, 'rw', ''),
        ('3400sub1', 'Force while paying out.', 6, 'rw', ''),
        ('3400sub2', 'Max. rope speed', 6, 'rw', ''), ('3400sub3', 'Ramp 0.5 m/s', 6, 'rw', ''),
        ('3400sub4', 'Length', 6, 'rw', ''), ('3400sub5', '5', 6, 'rw', ''),
        ('3401', 'Drum', 6, 'rw', ''), ('3401sub1', 'Length', 6, 'rw', ''),
        ('3402', 'Max. lift, alone', 6, 'rw', ''))
    assert list(made.parameters) == [
        'force_while_paying_out', 'max_rope_speed', 'ramp_0_5_m_s', 'winch_length', 'winch_5',
        'drum_length', 'max_lift_alone']
    assert made.parameters['max_rope_speed'].description == 'Winch Max. rope speed'


# -- heads ----------------------------------------------------------------------------------------


@pytest.mark.parametrize('head', [
    'ObjectType=7\nDataType=6\nAccessType=rw', 'ObjectType=7', 'DataType=6', '', 'ObjectType=2',
    'ObjectType=0x9', 'ObjectType=record', 'SubNumber=many\nObjectType=8\nCompactSubObj=0'])
def test_what_has_sub_indices_is_a_record(tmp_path: Path, head: str) -> None:
    pytest.importorskip('canopen')
    made = bring_in(tmp_path, objects(*DRIVE) + (
        f'[3500]\nParameterName=Hoist\n{head}\n'
        '[3500sub0]\nParameterName=Highest\nDataType=5\nAccessType=ro\n'
        '[3500sub1]\nParameterName=Lift\nDataType=6\nAccessType=rw\n'), 'hoist.eds')
    assert [(each.name, each.index, each.subindex) for each in made.parameters.values()] == [
        ('lift', 0x3500, 1)]
    assert made.left_out == []


@pytest.mark.parametrize('kind', ['7', '8', '9', '', '2'])
def test_compact_objects_whatever_their_heads_say(tmp_path: Path, kind: str) -> None:
    made = bring(tmp_path, *DRIVE, ('3600', 'Drum', 6, 'rw', (
        f'ObjectType={kind}\n' if kind else '') + 'CompactSubObj=3\n[3600Name]\n2=Left drum'))
    assert [(each.name, each.subindex) for each in made.parameters.values()] == [
        ('drum', 1), ('left_drum', 2), ('drum_3', 3)]


# -- what is written passes the checks ------------------------------------------------------------


STORE = ('1010', 'Keep', 7, 'rw', ''), ('603F', 'Fault number', 6, 'ro', '')


@pytest.mark.parametrize(('store', 'access', 'keys', 'kept'), [
    (7, 'rw', '', True), (7, 'rw', 'LowLimit=0\nHighLimit=1', True), (6, 'rw', '', False),
    (6, 'rw', 'LowLimit=0x65766173\nHighLimit=0x65766173', False), (7, 'ro', '', False)])
def test_the_restore_section_names_what_can_be_written(
        tmp_path: Path, store: int, access: str, keys: str, kept: bool) -> None:
    made = bring(tmp_path, *DRIVE, *STORE, ('1010sub1', 'Keep all', store, access, keys))
    assert bool(made.profile.restore.after) is kept
    assert any('section restore left out: ' in note for note in made.notes) is not kept
    assert 'store_parameters' in made.parameters


@pytest.mark.parametrize(('code', 'access', 'kept'), [
    (6, 'ro', True), (6, 'wo', False), (5, 'ro', False)])
def test_the_fault_section_names_what_can_be_read(tmp_path: Path, code: int, access: str,
                                                  kept: bool) -> None:
    made = bring(tmp_path, *DRIVE, ('603F', 'Fault number', code, access, ''),
                 ('3301', 'Rope', 6, 'rw', ''))
    assert (made.profile.fault is not None) is kept
    assert any('section fault left out: ' in note for note in made.notes) is not kept


def test_identity_is_what_can_be_read(tmp_path: Path) -> None:
    made = bring(tmp_path, *DRIVE, ('1018sub1', 'Maker', 7, 'wo', ''),
                 ('1018sub2', 'Product', 7, 'ro', ''))
    assert made.profile.identity == ('product_code',)


def test_what_of_the_standard_does_not_fit_costs_no_object(tmp_path: Path) -> None:
    made = bring(tmp_path, *DRIVE, ('60FF', 'Speed', 4, 'rw', 'LowLimit=10\nHighLimit=20'),
                 ('6072', 'Most torque', 6, 'rw', 'HighLimit=500'),
                 ('6064', 'Place', 9, 'ro', ''), ('607A', 'Where to', 4, 'rw', ''))
    assert list(made.parameters) == ['torque_limit', 'target_position', 'target_velocity']
    assert '# neutral left out: ' in made.built.text
    assert '# neutral_from left out: ' in made.built.text
    assert not made.parameters['torque_limit'].limit


def test_what_validate_will_say_of_each_mode(tmp_path: Path) -> None:
    made = bring(tmp_path, *DRIVE, ('60FF', 'Speed', 7, 'rw', ''), ('6071', 'Force', 4, 'rw', ''),
                 ('607A', 'Where to', 4, 'rw', ''), ('6042', 'Slow', 3, 'rw', ''))
    said = '\n'.join(made.notes)
    assert 'validate takes it in the modes vl\n' in said
    assert 'no setpoint in the file for the modes ip\n' in said
    for mode, key in (('csv', 'target_velocity.type: uint32'),
                      ('tq', 'target_torque.type: int32'),
                      ('csp', 'target_position.neutral_from')):
        assert f'validate refuses it in the mode {mode}: parameters.{key}' in said.replace(
            'profile.', '')


# -- axes -----------------------------------------------------------------------------------------

TWO = (*DRIVE, ('3301', 'Rope', 6, 'rw', ''), ('607A', 'Where to', 4, 'rw', ''),
       ('6064', 'Place', 4, 'ro', ''), ('60A8', 'Unit', 7, 'rw', 'DefaultValue=0xFF410000'),
       ('6840', 'Controlword', 6, 'rw', ''), ('6841', 'Statusword', 6, 'ro', ''),
       ('687A', 'Where to', 4, 'rw', ''), ('6864', 'Place', 4, 'ro', ''),
       ('68A8', 'Unit', 7, 'rw', 'DefaultValue=0x00B40000'))


@pytest.mark.parametrize(('axis', 'shift', 'unit'), [
    (None, 0, 'deg'), (1, 0, 'deg'), (2, 0x800, 'rev')])
def test_one_of_several_axes(tmp_path: Path, axis: int | None, shift: int, unit: str) -> None:
    made = bring(tmp_path, *TWO, axis=axis)
    target = made.parameters['target_position']
    assert (target.index, target.unit, target.neutral_from) == (
        0x607A + shift, unit, 'actual_position')
    assert made.parameters['actual_position'].index == 0x6064 + shift
    assert made.parameters['rope'].index == 0x3301
    others = {0x6000 + 0x800 - shift + at for at in range(0x800)}
    assert not others & {each.index for each in made.parameters.values()}
    said = '\n'.join(made.notes)
    assert f'2 axes: 1, 2; taken is axis {axis or 1}, ' in said
    assert '5 sections of other axes left out' in said
    assert ('the control word of the first axis, 6040h' in said) is (axis == 2)


@pytest.mark.parametrize(('axis', 'protocols', 'protected'), [
    (1, (), {'left', 'right'}), (2, (), {'controlword', 'target_position'}),
    (1, ('canopen_pkw',), {'controlword', 'where_to', 'left', 'right'}),
    (2, ('canopen_pkw',), {'controlword', 'where_to'})])
def test_what_moves_an_axis_that_the_bridge_does_not_command_is_protected(
        tmp_path: Path, axis: int, protocols: Any, protected: set[str]) -> None:
    made = bring(tmp_path, *TWO, ('60FFsub1', 'Left', 4, 'rw', ''),
                 ('60FFsub2', 'Right', 4, 'rw', ''), axis=axis, protocols=protocols)
    assert {each.name for each in made.parameters.values() if each.protected} == protected


@pytest.mark.parametrize(('axis', 'entries', 'has'), [
    (9, TWO, 'has no axis 9, it has 1, 2'), (0, TWO, 'has no axis 0, it has 1, 2'),
    (2, (*DRIVE, TWO[2]), 'has no axis 2, it has 1'),
    (1, (TWO[2],), 'has no axis 1, it has none: there is no control word, 6040h')])
def test_an_axis_that_is_not_there(tmp_path: Path, axis: int, entries: Any, has: str) -> None:
    with pytest.raises(ImportFailed, match=f'winch.eds: {has}'):
        bring(tmp_path, *entries, axis=axis)


# -- what is no drive -----------------------------------------------------------------------------


@pytest.mark.parametrize(('kind', 'what'), [
    ('0x00030191', '00030191h, profile 401 (inputs and outputs), and it has no control word'),
    ('410', '0000019Ah, profile 410 (inclinometers)'), ('0x1C3', '000001C3h, profile 451, and')])
def test_what_is_no_drive_is_refused(tmp_path: Path, kind: str, what: str,
                                     capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip('canopen')
    source, target = tmp_path / 'sensor.eds', tmp_path / 'sensor.yaml'
    device = '1000', 'Kind', 7, 'ro', f'DefaultValue={kind}'
    source.write_text(objects(device, TWO[2]))
    assert main(['profile', 'import', str(source), '-o', str(target)]) == 1
    assert capsys.readouterr().err.count('\n') == 1 and not target.exists()
    with pytest.raises(ImportFailed) as refused:
        bring(tmp_path, device, TWO[2])
    assert what in str(refused.value) and '--force imports it' in str(refused.value)
    assert main(['profile', 'import', str(source), '-o', str(target), '--force']) == 0
    assert 'protocols: [canopen_pkw]' in target.read_text()


@pytest.mark.parametrize('kind', ['', 'DefaultValue=0', 'DefaultValue=0x40192',
                                  'DefaultValue=what'])
def test_what_may_be_a_drive_is_imported(tmp_path: Path, kind: str) -> None:
    made = bring(tmp_path, ('1000', 'Kind', 7, 'ro', kind), TWO[2])
    assert list(made.parameters) == ['kind', 'rope']


def test_a_control_word_makes_it_a_drive(tmp_path: Path) -> None:
    made = bring(tmp_path, *DRIVE, ('1000', 'Kind', 7, 'ro', 'DefaultValue=0x191'))
    assert made.profile.protocols == ('cia402',)


# -- units ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(('name', 'scale', 'unit'), [
    ('Winding [0.1 Hz]', 0.1, 'Hz'), ('Winding (ms)', 1.0, 'ms'),
    ('Winding [1/16 V]', 0.0625, 'V'), ('Winding [10 ms]', 10.0, 'ms'),
    ('Winding [%]', 1.0, '%'), ('Winding (0.1 A)', 0.1, 'A'),
    ('Winding (W)', 1.0, ''), ('Winding (min)', 1.0, ''), ('Winding (60 s)', 1.0, ''),
    ('Winding [5 s]', 1.0, ''), ('Winding [0..100 %]', 1.0, ''), ('Winding(s)', 1.0, ''),
    ('Winding [set 2]', 1.0, ''), ('Winding [1e-30 V]', 1.0, ''), ('Winding [1e9 Hz]', 1.0, '')])
def test_units_at_the_end_of_names(tmp_path: Path, name: str, scale: float, unit: str) -> None:
    made = bring(tmp_path, *DRIVE, ('3301', name, 7, 'rw', 'HighLimit=40'))
    [winding] = made.parameters.values()
    assert (winding.scale, winding.unit, winding.maximum) == (scale, unit, 40 * scale)
    assert ('at the end of the name' in made.built.text) is bool(unit)


@pytest.mark.parametrize(('name', 'keys', 'scale'), [
    ('Force [%]', '', 0.1), ('Force', 'Unit=%', 0.1), ('Force', 'Unit=%\nFactor=0.5', 0.5)])
def test_the_standard_knows_better_than_a_name(tmp_path: Path, name: str, keys: str,
                                               scale: float) -> None:
    """6071h counts in 0.1 %: "%" in its name is no scale of 1."""
    made = bring(tmp_path, *DRIVE, ('6071', name, 3, 'rw', keys))
    assert (made.parameters['target_torque'].scale, made.parameters['target_torque'].unit) == (
        scale, '%')


SEVCON = (
    '3701', 'Battery', 3, 'rw', 'LowLimit=0\nHighLimit=1600\n;SEVCONFIELD SCALING=0.0625\n'
    ';SEVCONFIELD UNITS=V\n;SEVCONFIELD ACCESS_LEVEL=4\n')


def test_scales_and_units_of_sevcon(tmp_path: Path) -> None:
    made = bring(
        tmp_path, *DRIVE, SEVCON,
        ('3702', 'Brake', 6, 'rw', ';SEVCONFIELD ACCESS_LEVEL=5\n;SEVCONFIELD 0=Open\n'
         ';SEVCONFIELD 0x1=Shut\n;SEVCONFIELD 2=Spare\n;SEVCONFIELD 3=Spare\n'
         ';SEVCONFIELD 70000=Beyond\n'),
        ('3703', 'Flags', 6, 'rw', ';SEVCONFIELD SPLIT=0\n;SEVCONFIELD 0=Cleared\n'
         ';SEVCONFIELD 1=Set\n;SEVCONFIELD SPLIT=1\n;SEVCONFIELD 0=Cleared\n'),
        ('3704', 'Switch', 1, 'ro', ';SEVCONFIELD 0=Inactive\n;SEVCONFIELD 1=Active\n'))
    battery, brake, flags, switch = made.parameters.values()
    assert (battery.scale, battery.unit, battery.maximum) == (0.0625, 'V', 100)
    assert (battery.protected, brake.protected) == (False, True)
    assert dict(brake.values) == {0: 'Open', 1: 'Shut'}
    assert flags.values == switch.values == ()
    for remark in ('# SCALING and UNITS: comments of the file', '# access level 4',
                   '# access level 5', '# values: comments of the file',
                   '# 0 = Inactive, 1 = Active'):
        assert remark in made.built.text


# -- bad input ------------------------------------------------------------------------------------


@pytest.mark.parametrize('encoding', ['utf-8-sig', 'utf-16', 'cp1252'])
def test_encodings(tmp_path: Path, encoding: str) -> None:
    pytest.importorskip('canopen')
    text = objects(*DRIVE, ('3301', 'Höhe', 6, 'rw', '')).replace('\n', '\r\n')
    made = bring_in(tmp_path, text.encode(encoding), 'winch.eds')
    assert list(made.parameters) == ['hoehe']


def test_utf_16_that_is_cut(tmp_path: Path) -> None:
    pytest.importorskip('canopen')
    data = codecs.BOM_UTF16_LE + objects(*DRIVE).encode('utf-16-le')[:-1]
    with pytest.raises(ImportFailed, match='begins like utf-16 text and is none'):
        bring_in(tmp_path, data, 'winch.eds')


@pytest.mark.parametrize('end', range(150, 400, 9))
def test_a_file_that_is_cut_anywhere(tmp_path: Path, end: int) -> None:
    """Whatever is whole is imported, and of the rest each section is named."""
    pytest.importorskip('canopen')
    text = ('[ManufacturerObjects]\nSupportedObjects=2\n1=0x3301\n2=0x3302\n' + objects(
        *DRIVE, ('3301', 'Rope', 6, 'rw', 'LowLimit=0'), ('3302', 'Drum', 6, 'rw', '')))
    cut = text[:end]
    try:
        made = bring_in(tmp_path, cut, 'winch.eds', protocols=('canopen_pkw',))
    except ImportFailed as error:
        assert 'no entry can be used' in str(error)
        return
    said = ' '.join([*made.left_out, *made.notes])
    for section, name in (('3301', 'rope'), ('3302', 'drum')):
        assert name in made.parameters or section in said


@pytest.mark.parametrize(('words', 'code', 'says'), [
    (['--axis', '9'], 1, 'has no axis 9, it has 1, 2'),
    (['--axis', '2', '--format', 'csv'], 2, '--axis is for EDS and DCF files'),
    (['--force', '--format', 'csv'], 2, '--force is for EDS and DCF files')])
def test_options_that_mean_nothing(tmp_path: Path, words: list[str], code: int, says: str,
                                   capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip('canopen')
    source = tmp_path / 'winch.eds'
    source.write_text(objects(*TWO))
    assert main(['profile', 'import', str(source), *words]) == code
    assert says in capsys.readouterr().err
