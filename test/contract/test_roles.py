# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What users may not write goes by what a name addresses on the drive, not by the name."""

from dataclasses import replace
from typing import Any

from builders import (
    ACTUAL, CONTROL, drive, EEPROM, GAIN, INT32, parameter, RAM, RO, SPEED, TABLE, WORD,
)
from partners import PARTNERS
import pytest
from saying import says

from drive_can_bridge.core.directory import ParameterDirectory
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.core.roles import Role
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.families import FAMILIES, make_sessions

CYCLIC = 'sent cyclically: publish ~/command/speed_setpoint'
ALIAS = parameter('jog', 50, storage=EEPROM)                # of the speed setpoint
WORD_ALIAS = parameter('start', 52, type=ParameterType.BOOL, storage=RAM)
STATUS_ALIAS = parameter('speed', 209, access=RO)           # of the actual speed
WIDE_WORD = parameter('wide_word', 52, type=ParameterType.UINT32)
WIDE_BEFORE = parameter('wide_before', 51, type=INT32)      # 51 and 52
WIDE_SPEED = parameter('wide_speed', 49, type=INT32)        # 49 and 50
#: keys that a family cannot do without
MORE = {'cia402': {'mode': 'vl'}}
DATAMODEL = ('datamodel_extended', 'datamodel_standard')


def session(family: str, *more: Parameter, control: bool = True, **options: Any) -> Session:
    """Return the session of a drive that commands SPEED and has more in its table."""
    made, = make_sessions([drive(
        family, table=(*TABLE, *more), control=CONTROL if control else None,
        request=(SPEED,), response=(ACTUAL,), **options)])
    return made


def raw(of: Session, name: str) -> Parameter:
    """Resolve a name as the parameter services do."""
    configuration = of.configuration
    found = ParameterDirectory(
        configuration.profile.parameters,
        lambda text: FAMILIES[configuration.protocol].raw_parameter(configuration, text),
    ).find(name)
    assert found is not None
    return found


@pytest.mark.parametrize('family', sorted(FAMILIES))
def test_another_name_of_a_setpoint(family: str) -> None:
    partner = PARTNERS[family]
    table = [partner.own(each) for each in (*TABLE, ALIAS, STATUS_ALIAS)]
    one, = make_sessions([drive(family, table=table, request=table[:2],
                                response=(partner.own(ACTUAL),), **MORE.get(family, {}))])
    for name in ('speed_setpoint', 'jog', partner.raw_name(50)):
        assert one.services.write_refusal(raw(one, name)) == CYCLIC, name
        assert one.roles.role(raw(one, name)) is Role.CYCLIC, name
    for name in ('torque_limit', partner.raw_name(51)):
        assert one.services.write_refusal(raw(one, name)) == (
            says('sent_cyclically', name='torque_limit')), name
    for name in ('gain', partner.raw_name(40)):
        assert one.services.write_refusal(raw(one, name)) == '', name
        assert one.roles.role(raw(one, name)) is None, name
    # what is received is nobody's business, unless it cannot be written anyway
    assert one.roles.role(raw(one, 'speed')) is Role.CYCLIC
    assert one.services.write_refusal(raw(one, 'speed')) == ''


@pytest.mark.parametrize('family', [*DATAMODEL, 'canopen_pkw'])
def test_another_name_of_the_control_word(family: str) -> None:
    one = session(family, WORD_ALIAS)
    for name in ('control_word', 'start', 'p52'):
        assert one.services.write_refusal(raw(one, name)) == 'use ~/enable', name
        assert one.roles.role(raw(one, name)) is Role.CONTROL, name


def test_a_double_word_that_covers_one_of_ours() -> None:
    one = session('canopen_pkw', WIDE_WORD, WIDE_BEFORE, WIDE_SPEED)
    assert one.services.write_refusal(raw(one, 'wide_word')) == 'use ~/enable'
    assert one.services.write_refusal(raw(one, 'wide_before')) == 'use ~/enable'
    assert one.services.write_refusal(raw(one, 'wide_speed')) == CYCLIC


def test_a_word_inside_one_of_ours() -> None:
    wide = parameter('position', 60, type=INT32, storage=RAM)
    low = parameter('position_low', 61, storage=RAM)
    one, = make_sessions([drive('canopen_pkw', table=(*TABLE, wide, low), request=(wide,),
                                response=(ACTUAL,))])
    for name in ('position', 'position_low', 'p60', 'p61'):
        assert one.services.write_refusal(raw(one, name)) == (
            says('sent_cyclically', name='position')), name


def test_a_register_and_its_object() -> None:
    # 704 is 2008h.05h (register overview of the LTMR CANopen guide)
    word = parameter('control_register_1', 704, storage=RAM)
    by_object = Parameter('by_object', index=0x2008, subindex=4, type=ParameterType.UINT32)
    table = replace(CONTROL, parameter='control_register_1')
    one, = make_sessions([drive('canopen_pkw', table=(*TABLE, word, by_object), control=table,
                                request=(SPEED,), response=(ACTUAL,))])
    for name in ('p704', 'x2008.5', 'by_object'):
        assert one.services.write_refusal(raw(one, name)) == 'use ~/enable', name


def test_the_first_element_of_an_array_is_the_parameter_itself() -> None:
    one = session('cannord', control=False)
    for name in ('p50', 'p50.0'):
        assert one.services.write_refusal(raw(one, name)) == CYCLIC, name
    assert one.services.write_refusal(raw(one, 'p50.1')) == ''
    assert not raw(one, 'p209.0').writable
    assert raw(one, 'p209.1').writable


@pytest.mark.parametrize('family', DATAMODEL)
def test_maps(family: str) -> None:
    copy = parameter('map_of_slot_2', 123)
    one = session(family, copy, control=False)
    for name in ('p122', 'map_of_slot_2', 'p129'):
        assert one.roles.role(raw(one, name)) is Role.MAP
        assert one.services.write_refusal(raw(one, name)) == ''
        one.active = True
        assert one.services.write_refusal(raw(one, name)) == (
            says('mapping_parameter'))
        one.active = False
    assert one.roles.role(raw(one, 'p121')) is one.roles.role(raw(one, 'p130')) is None


def test_what_a_servo_is_controlled_and_mapped_by() -> None:
    word = Parameter('word', index=0x6040, subindex=0)
    timer = Parameter('timer', index=0x1800, subindex=5)
    one = session('cia402', word, timer, mode='vl')
    for name, refusal in (('word', 'use_enable'), ('x6040.0', 'use_enable'),
                          ('x6060.00', 'bridge_sets_mode')):
        assert one.services.write_refusal(raw(one, name)).code == refusal, name
        assert one.roles.role(raw(one, name)) is Role.CONTROL, name
    maps = ('timer', 'x1400.1', 'x1bff.2', 'x1005.0', 'x1006.0', 'x1016.1', 'x1017.0', 'x60c2.2')
    for name in maps:
        assert one.roles.role(raw(one, name)) is Role.MAP, name
        assert one.services.write_refusal(raw(one, name)) == '', name
    one.active = True
    for name in maps:
        assert one.services.write_refusal(raw(one, name)) == says('mapping_parameter'), name
    assert one.services.write_refusal(raw(one, 'x13ff.1')) == ''
    assert one.services.write_refusal(raw(one, 'x1c00.1')) == ''


def test_process_data_without_a_number() -> None:
    frequency = parameter('frequency', None, storage=None)
    one, = make_sessions([drive('cannord', table=(*TABLE, frequency), request=(frequency,),
                                response=(ACTUAL,))])
    assert one.services.write_refusal(frequency) == says('sent_cyclically', name='frequency')
    assert one.roles.role(frequency) is Role.CYCLIC
    assert one.roles.role(WORD) is one.roles.role(GAIN) is None
