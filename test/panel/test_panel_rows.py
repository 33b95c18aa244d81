# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Rows of parameters: what they show, and what becomes of names that mean no good."""

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from drive_can_bridge.core.parameters import ValueKind
from drive_can_bridge.monitor.snapshot import DriveSnapshot, Level, ParameterReading
from drive_can_bridge.monitor.values import ParameterInfo

if TYPE_CHECKING:
    from panel_bench import House

pytest.importorskip('nicegui', reason="needs the extra 'panel'")

RAMP = ParameterInfo('ramp_time', ValueKind.DOUBLE, facts={'unit': 's', 'scale': '0.01'})


def drive(text: str, name: str = RAMP.name) -> DriveSnapshot:
    """Return a drive of which one parameter was read."""
    return DriveSnapshot('/lift', 'lift', '/drive_can_bridge', 'online', Level.OK, True, '',
                         readings={name: ParameterReading(text, 0.0)})


@pytest.mark.parametrize('name', [
    'x onclick="alert(1)"', "x :title='alert(1)'", 'x\n@click=alert(1)', '"', 'x innerHTML=<b>'])
def test_a_name_stays_one_attribute(page: object, name: str) -> None:
    from drive_can_bridge.panel.drive_page import _ParameterRow
    _ParameterRow('/lift', replace(RAMP, name=name), writes=True)
    marks = [element.props for element in page.elements.values()  # type: ignore[attr-defined]
             if 'data-parameter' in element.props]
    assert [dict(props) for props in marks] == [{'data-parameter': name}]


@pytest.mark.parametrize(('name', 'edited'), [
    ('target', False), ('target_position', False), ('vl_target_velocity', False),
    ('interpolation_target', False), ('speed_setpoint', False), ('control_word', False),
    ('setpoint_2', False), ('speed_setpoint_10', False), ('control_word2', False),
    ('controlword', False), ('controlword_2', False), ('control_words', True),
    ('setpoint_source', True), ('targets', True), ('retarget_time', True)])
def test_what_moves_a_drive_has_no_field(page: object, name: str, edited: bool) -> None:
    from drive_can_bridge.panel.drive_page import _ParameterRow
    row = _ParameterRow('/lift', replace(RAMP, name=name), writes=True)
    assert (row._field is not None) == edited


def test_what_says_the_meaning_of_a_setpoint_has_one() -> None:
    # P547 of a NORD inverter (BU0270, page 40)
    assert replace(RAMP, name='bus_setpoint_2', facts={'storage': 'eeprom'}).refusal == ''


def test_what_is_typed_is_left_alone_and_what_was_read_stands_beside_it(page: object) -> None:
    from drive_can_bridge.panel.drive_page import _ParameterRow
    row = _ParameterRow('/lift', RAMP, writes=True)
    row.show(drive('2.50'))
    assert (row._field.value, row._now.text) == ('2.50', '')
    row.show(drive('3.00'))
    assert (row._field.value, row._now.text) == ('3.00', '')
    # somebody types; somebody else writes
    row._field.value = '1'
    row.show(drive('4.00'))
    assert row._field.value == '1'
    assert '4.00' in row._now.text
    row.show(drive('5.00'))
    assert row._field.value == '1'
    assert '5.00' in row._now.text
    # what was typed has been written, and is read as the drive has it
    row._field.value = '1.5'
    row.show(drive('1.50'))
    assert (row._field.value, row._now.text) == ('1.50', '')


def test_what_cannot_be_read_is_said(page: object) -> None:
    from drive_can_bridge.panel.drive_page import _ParameterRow
    for writes in (False, True):
        row = _ParameterRow('/lift', RAMP, writes=writes)
        row.show(drive(''))
        assert (row._now if writes else row._label).text == 'could not be read'


@pytest.mark.parametrize(('name', 'typed', 'value'), [
    ('user_command', '7', 7), ('release', 'true', True)])
def test_what_cannot_be_read_is_written_in_its_type(
        house: 'House', name: str, typed: str, value: object) -> None:
    said = house.do('write', 'operator', {
        'drive': '/conveyor', 'name': name, 'value': typed}).said
    assert said['success'] is True, said['text']
    house.until(lambda: house.bridge.played['conveyor'].value(name) == value,
                'the write, which nobody confirms')
