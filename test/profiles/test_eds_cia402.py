# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""EDS files of drives of CiA 402: profiles that ``validate`` accepts as they are."""

from pathlib import Path

from import_builders import bring_in, Outcome, told
import pytest
from transcripts import stories

from drive_can_bridge.cli.main import main
from drive_can_bridge.core.parameters import AccessMode, Parameter, ParameterType, Storage

#: index with sub-index, name in the file, data type, access, further keys
OBJECTS = (
    ('1000', 'Device Type', 7, 'ro', ''),
    ('1001', 'Error Register', 5, 'ro', ''),
    ('1010sub1', 'save all parameters', 7, 'rw', ''),
    ('1018sub4', 'Serial Number', 7, 'ro', ''),
    ('2000', 'Actual Position', 3, 'ro', ''),
    ('2001', 'Brake delay', 6, 'rw', 'StorageLocation=PERSIST_COMM\nUnit=ms'),
    ('603F', 'Error Code', 6, 'ro', ''),
    ('6040', 'Controlword', 6, 'rww', ''),
    ('6041', 'Statusword', 6, 'ro', ''),
    ('6060', 'Modes of Operation', 2, 'rww', ''),
    ('6061', 'Modes of Operation Display', 2, 'ro', ''),
    ('6064', 'Position Actual Value', 4, 'ro', ''),
    ('606C', 'Velocity Actual Value', 4, 'ro', ''),
    ('6071', 'Target Torque', 3, 'rww', 'LowLimit=-2000\nHighLimit=2000'),
    ('6072', 'Max Torque', 6, 'rw', ''),
    ('6079', 'DC Link Circuit Voltage', 7, 'ro', ''),
    ('607A', 'Target Position', 4, 'rww', ''),
    ('6083', 'Profile Acceleration', 7, 'rw', ''),
    ('60FF', 'Target Velocity', 4, 'rww', 'LowLimit=-5000\nHighLimit=5000'),
)


def eds(*more: tuple[str, str, int, str, str], without: str = '') -> str:
    """Write a file with these objects."""
    parts = ['[DeviceInfo]\nVendorName=Antriebe AG\nProductName=Achse 7\n']
    for section, name, code, access, keys in (*OBJECTS, *more):
        if section == without:
            continue
        if 'sub' in section:
            parts.append(f'[{section[:4]}]\nParameterName=Object {section[:4]}\nObjectType=9\n'
                         'SubNumber=1\n')
        parts.append(f'[{section}]\nParameterName={name}\nDataType=0x{code:04X}\n'
                     f'AccessType={access}\n{keys}\n')
    return '\n'.join(parts)


def bring(folder: Path, text: str) -> Outcome:
    pytest.importorskip('canopen')
    return bring_in(folder, text, 'axis.eds')


def test_standard_objects_have_their_names(tmp_path: Path) -> None:
    made = bring(tmp_path, eds())
    assert made.profile.protocols == ('cia402',)
    assert list(made.parameters) == [
        'device_type', 'error_register', 'store_parameters', 'serial_number',
        'actual_position_2000', 'brake_delay', 'fault_code', 'mode', 'mode_shown',
        'actual_position', 'actual_velocity', 'target_torque', 'torque_limit', 'dc_link_voltage',
        'target_position', 'profile_acceleration', 'target_velocity']
    assert made.left_out == []
    assert made.profile.identity == ('serial_number',)
    assert made.profile.fault is not None and made.profile.fault.parameter == 'fault_code'
    assert dict(made.profile.fault.codes)[0x8611] == 'following error'
    # what stores is said nowhere in the file: 65766173h, "save"
    assert [(step.parameter, step.bits) for step in made.profile.restore.after] == [
        ('store_parameters', 0x65766173)]
    assert made.parameters['store_parameters'].access is AccessMode.WRITE_ONLY


def test_units_of_the_standard_and_of_the_file(tmp_path: Path) -> None:
    made = bring(tmp_path, eds())
    assert made.parameters['target_torque'] == Parameter(
        'target_torque', ParameterType.INT16, index=0x6071, subindex=0, scale=0.1, unit='%',
        scaled=True, storage=Storage.RAM, minimum=-200.0, maximum=200.0, neutral=0,
        description='Target Torque')
    limit = made.parameters['torque_limit']
    assert limit.limit and (limit.neutral, limit.scale, limit.unit) == (100, 0.1, '%')
    voltage = made.parameters['dc_link_voltage']
    assert (voltage.scale, voltage.unit) == (0.001, 'V')
    delay = made.parameters['brake_delay']      # in the RAM of the drive until 1010h stores it
    assert (delay.unit, delay.storage) == ('ms', Storage.RAM)
    assert made.parameters['mode_shown'].type is ParameterType.INT8
    assert dict(made.parameters['mode_shown'].values)[8] == 'csp'
    assert made.parameters['error_register'].type is ParameterType.UINT8


def test_what_is_the_makers_own_is_raw_and_said_to_be(tmp_path: Path) -> None:
    made = bring(tmp_path, eds())
    target = made.parameters['target_position']
    assert (target.scale, target.unit, target.scaled) == (1.0, '', False)
    assert (target.neutral_from, target.arming_tolerance) == ('actual_position', 0)
    assert '# arming_tolerance 0: only the latched value exactly' in made.built.text
    velocity = made.parameters['target_velocity']
    assert (velocity.unit, velocity.minimum, velocity.maximum) == ('', -5000, 5000)
    assert told(made) == stories(__file__, 'imports.yaml')['axis.eds']
    assert made.built.text.count("# raw: its unit is the maker's own") == 5


@pytest.mark.parametrize(('value', 'scale', 'unit'), [
    ('0x00B44700', 1.0, 'rpm'), ('0xFDB44700', 0.001, 'rpm'), ('0x00B40300', 60.0, 'rpm'),
    ('0x00B50300', 1.0, 'inc/s'), ('0x00000000', 1.0, ''), ('', 1.0, '')])
def test_units_that_the_file_names(tmp_path: Path, value: str, scale: float, unit: str) -> None:
    made = bring(tmp_path, eds(
        ('60A8', 'SI unit position', 7, 'rw', 'DefaultValue=0x00B50000'),
        ('60A9', 'SI unit velocity', 7, 'rw', f'DefaultValue={value}')))
    velocity = made.parameters['target_velocity']
    assert (velocity.scale, velocity.unit) == (scale, unit)
    assert velocity.maximum == 5000 * scale
    target = made.parameters['target_position']
    assert (target.unit, target.arming_tolerance) == ('inc', 0)     # of whatever size
    assert made.parameters['profile_acceleration'].unit == ''


@pytest.mark.parametrize(('value', 'scale', 'unit', 'tolerance'), [
    ('0x00B40000', 1.0, 'rev', 0.01), ('0xFF410000', 0.1, 'deg', 3.6),
    ('0xFDB40000', 0.001, 'rev', 0.01), ('0xFA100000', 0.000001, 'rad', 0.0628318531)])
def test_a_hundredth_of_a_revolution_arms_whatever_a_step_is(
        tmp_path: Path, value: str, scale: float, unit: str, tolerance: float) -> None:
    """Not 100 steps: 9 degrees with a file of Nanotec (FF410000h), 100 revolutions with others."""
    made = bring(tmp_path, eds(
        ('60A8', 'SI unit position', 7, 'rw', f'DefaultValue={value}')))
    target = made.parameters['target_position']
    assert (target.scale, target.unit) == (scale, unit)
    assert target.arming_tolerance == pytest.approx(tolerance)
    assert '# arming_tolerance: 0.01 rev of the motor' in made.built.text


@pytest.mark.parametrize(('motor', 'shaft', 'says'), [
    (50, 1, 'of the joint: 60A8h counts behind the gear, 6091h = 50:1'),
    (1, 1, 'of the motor')])
def test_whose_revolution_it_is(tmp_path: Path, motor: int, shaft: int, says: str) -> None:
    made = bring(tmp_path, eds(
        ('60A8', 'SI unit position', 7, 'rw', 'DefaultValue=0x00B40000'),
        ('6091sub1', 'Motor revolutions', 7, 'rw', f'DefaultValue={motor}'),
        ('6091sub2', 'Shaft revolutions', 7, 'rw', f'DefaultValue={shaft}'),
        ('6091', 'Gear ratio', 7, 'rw', '')))
    assert f'arming_tolerance: 0.01 rev {says}' in made.built.text


def test_a_unit_that_makes_no_sense_costs_nothing(tmp_path: Path) -> None:
    made = bring(tmp_path, eds(('60A9', 'SI unit velocity', 7, 'rw', 'DefaultValue=0x20B44700')))
    velocity = made.parameters['target_velocity']
    assert (velocity.unit, velocity.scaled, velocity.maximum) == ('', False, 5000)
    assert made.left_out == []


def test_without_an_actual_position_no_axis_is_told_to_stay(tmp_path: Path) -> None:
    made = bring(tmp_path, eds(without='6064'))
    assert made.parameters['target_position'].neutral_from == ''
    assert 'neutral_from left out: the file has no actual_position' in made.built.text


@pytest.mark.parametrize(('mode', 'setpoint'), [
    ('csp', 'target_position'), ('csv', 'target_velocity'), ('cst', 'target_torque'),
    ('pp', 'target_position'), ('pv', 'target_velocity'), ('tq', 'target_torque')])
def test_validate_takes_it_as_it_is(tmp_path: Path, mode: str, setpoint: str,
                                    capsys: pytest.CaptureFixture[str]) -> None:
    bring(tmp_path, eds())
    file = tmp_path / 'drives.yaml'
    file.write_text(f"""\
/**/drive_can_bridge:
  ros__parameters:
    buses: {{main: {{interface: virtual, channel: a, bitrate: 1000000}}}}
    drives:
      axis: {{bus: main, protocol: cia402, station: 1, profile: {tmp_path / 'made.yaml'},
             period: 0.01, mode: {mode}, cyclic_request: [{setpoint}, torque_limit],
             cyclic_response: [actual_position], command_timeout: {0.0 if mode == 'pp' else 0.5}}}
""")
    assert main(['validate', str(file)]) == 0
    assert capsys.readouterr().err == ''


def test_another_protocol_when_somebody_says_so(tmp_path: Path) -> None:
    pytest.importorskip('canopen')
    made = bring_in(tmp_path, eds(), 'axis.eds', protocols=('canopen_pkw',))
    assert 'controlword' in made.parameters and 'position_actual_value' in made.parameters
    assert any('UNSIGNED8' in line or 'uint8' in line for line in made.left_out)
