# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The motor of the simulated drives, and how its quantities get into parameters by their names."""

from dataclasses import replace
from typing import Any

from builders import ACTUAL, CONTROL, INT16, parameter, RAM, RO, STATUS, WORD
from hypothesis import given, strategies as st
import pytest
from simulation_builders import ask, EXAMPLE, motor, SPEED_SETPOINT, TORQUE_LIMIT

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import StatusPattern
from drive_can_bridge.simulation import quantities
from drive_can_bridge.simulation.datamodel import SimulatedDataModelDrive
from drive_can_bridge.simulation.motor import Rates, Travel
from drive_can_bridge.simulation.quantities import Quantity, RampUse
from drive_can_bridge.simulation.registers import Mechanics

# 0.1 degrees a step; at most 1000 degrees a second, reached in a second
WHERE = parameter('position_setpoint', 53, type=INT16, scale=0.1, unit='deg', minimum=-1000.0,
                  maximum=1000.0)
ANGLE = parameter('actual_position', 214, type=INT16, scale=0.1, unit='deg', access=RO)
ENABLE, DISABLE, QUICK_STOP = 1, 0, 2

# -- names ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(('name', 'quantity'), [
    ('actual_speed', Quantity.SPEED), ('output_frequency', Quantity.SPEED),
    ('current_position', Quantity.POSITION), ('torque_current', Quantity.TORQUE),
    ('motor_current', Quantity.CURRENT), ('heatsink_temperature', Quantity.TEMPERATURE),
    ('dc_link_voltage', Quantity.VOLTAGE), ('output_power', Quantity.POWER),
    ('motor_load', Quantity.LOAD), ('fault_code', Quantity.FAULT_CODE),
    ('rated_current', None), ('speed_limit', None), ('firmware_version', None),
])
def test_measured(name: str, quantity: Quantity | None) -> None:
    assert quantities.measured(parameter(name, 1, access=RO)) is quantity
    assert quantities.measured(parameter(name, 1)) is None


@pytest.mark.parametrize(('setpoint', 'actual'), [
    ('speed_setpoint', 'actual_speed'), ('setpoint_speed', 'actual_speed'),
    ('target_position', 'actual_position'), ('frequency_reference', 'frequency_actual'),
    ('torque_command', 'torque_feedback'), ('setpoint_1', 'actual_value_1'),
    ('speed', 'actual_speed'), ('speed_setpoint', 'motor_speed'),
])
def test_pairs(setpoint: str, actual: str) -> None:
    table = {p.name: p for p in (parameter(setpoint, 1), parameter(actual, 2, access=RO))}
    pair, = quantities.pairs(table)
    assert (pair.setpoint.name, pair.actual.name) == (setpoint, actual)
    assert quantities.pairs(table, without=setpoint) == []


@pytest.mark.parametrize(('name', 'options', 'expected'), [
    ('ramp_time', {'unit': 's'}, (True, RampUse.BOTH)),
    ('acceleration_time', {'unit': 'ms'}, (True, RampUse.RISING)),
    ('ramp_down_time', {'unit': 's'}, (True, RampUse.FALLING)),
    ('deceleration', {'unit': 'rpm/s'}, (False, RampUse.FALLING)),
    ('acceleration', {}, (False, RampUse.RISING)),
    ('quick_stop_ramp', {'unit': 's'}, (True, RampUse.QUICK_STOP)),
    ('ramp_time', {'access': RO}, None), ('ramp_limit', {}, None), ('stop_mode', {}, None),
])
def test_ramps(name: str, options: dict[str, Any], expected: object) -> None:
    made = parameter(name, 1, **options)
    assert [found[1:] for found in quantities.ramp_parameters({name: made})] == (
        [expected] if expected else [])


@pytest.mark.parametrize(('options', 'revolutions', 'value'), [
    ({}, 7.0, 7 * 4096), ({}, 9.0, 9 * 4096 - 65536),
    ({'unit': 'deg', 'minimum': 0.0, 'maximum': 359.0}, 1.25, 90.0),
    ({'unit': 'deg', 'minimum': 0.0, 'maximum': 359.0}, -0.25, 270.0)])
def test_position_wraps_where_the_parameter_ends(options: dict[str, Any], revolutions: float,
                                                 value: float) -> None:
    wrapped = parameter('position', 1, type=INT16, access=RO, **options)
    assert quantities.position_value(wrapped, revolutions) == value


# -- a speed --------------------------------------------------------------------------------------


def running(table: list[Parameter], setpoint: Parameter, value: float,
            **options: Any) -> SimulatedDataModelDrive:
    """Make a drive that has followed a setpoint for ten seconds."""
    made = motor(table, **options)
    made.set_value(setpoint.name, value)
    made.handle_timer(0.0)
    made.handle_timer(10.0)
    return made


@pytest.mark.parametrize(('name', 'options', 'value'), [
    ('output_frequency', {'scale': 0.1, 'unit': 'Hz'}, 25.0),
    ('output_speed', {'scale': 0.1, 'unit': '%'}, 50.0),
    ('dc_link_voltage', {'scale': 0.1, 'unit': 'V'}, 560.0 * 0.993),
    ('output_voltage', {'scale': 0.1, 'unit': 'V'}, 560.0 * 0.7 / 2),
    ('actual_torque', {'scale': 0.1, 'unit': '%'}, 20.0),
    ('output_power', {'unit': 'W'}, 300.0),
    ('motor_load', {'unit': '%'}, 20.0),
    ('motor_current', {'scale': 0.01, 'unit': 'A'}, 2.83),
    ('motor_temperature', {'scale': 0.1, 'unit': 'degC'}, 25.3),
    ('position', {'unit': 'rev', 'type': INT16}, 243.75),
    ('fault_code', {}, 0),
    ('firmware_torque_limit', {'maximum': 40.0}, 40),
])
def test_quantities_at_half_speed(name: str, options: dict[str, Any], value: float) -> None:
    made = parameter(name, 3, access=RO, **options)
    plant = running([*EXAMPLE[:3], made], SPEED_SETPOINT, 1500.0)
    assert plant.value(name) == pytest.approx(value, abs=1.0 if name != 'fault_code' else 0.0)


def test_values_never_leave_their_type() -> None:
    small = parameter('actual_torque', 3, scale=0.0001, unit='Nm', type=INT16, access=RO)
    plant = running([*EXAMPLE, small], SPEED_SETPOINT, -3000.0)
    assert -3.2768 <= plant.value('actual_torque') < 0.0


@pytest.mark.parametrize(('ramps', 'speeds'), [
    ({}, [3000.0, 0.0]),
    ({'acceleration': ('rpm/s', 600.0)}, [600.0, 0.0]),
    ({'ramp_up_time': ('s', 2.0), 'ramp_down_time': ('s', 4.0)}, [1500.0, 750.0])])
def test_ramps_by_use(ramps: dict[str, tuple[str, float]], speeds: list[float]) -> None:
    made = motor([SPEED_SETPOINT, ACTUAL, *(
        parameter(name, 3 + place, unit=unit) for place, (name, (unit, _)) in enumerate(
            ramps.items()))])
    for name, (_, value) in ramps.items():
        made.set_value(name, value)
    made.handle_timer(0.0)
    found = []
    for now, target in ((1.0, 3000.0), (2.0, 0.0)):
        made.set_value('speed_setpoint', target)
        found.append(made.value('actual_speed', now))
    assert found == speeds


def test_another_setpoint_is_followed_and_ends_with_a_fault() -> None:
    setpoint = parameter('torque_setpoint', 3, unit='%', type=INT16)
    actual = parameter('actual_torque', 4, unit='%', type=INT16, access=RO)
    plant = running([*EXAMPLE, setpoint, actual], setpoint, 50.0)
    assert plant.value('actual_torque') == 50.0
    plant.plant.operation.trip()
    plant.handle_timer(20.0)
    assert plant.value('actual_torque') == 0.0


AMPS = parameter('current_limit', 60, scale=0.1, unit='A')
FAST = parameter('maximum_speed', 61, scale=0.1, unit='rpm')


@pytest.mark.parametrize(('limit', 'value', 'target', 'load', 'speed'), [
    (TORQUE_LIMIT, 100.0, 1500.0, 0.0, 1500.0), (TORQUE_LIMIT, 0.0, 1500.0, 0.0, 0.0),
    (TORQUE_LIMIT, 20.0, 1500.0, 0.5, -150.0),          # it sinks
    (AMPS, 2.0, 1500.0, 0.0, 0.0),                      # all of it magnetises
    (AMPS, 10.0, 1500.0, 0.0, 1500.0),
    (FAST, 300.0, 1500.0, 0.0, 300.0), (FAST, 300.0, -1500.0, 0.0, -300.0),
    # what nobody can scale is a register; and a new drive is not limited
    (parameter('torque_limit', 62, unit='s', scaled=True), 0.0, 1500.0, 0.0, 1500.0),
    (parameter('torque_limit', 62, unit='%', scaled=True), None, 1500.0, 0.0, 1500.0),
    (FAST, None, 1500.0, 0.0, 1500.0), (AMPS, None, 1500.0, 0.0, 1500.0)])
def test_limits(limit: Parameter, value: float | None, target: float, load: float,
                speed: float) -> None:
    made = motor([SPEED_SETPOINT, ACTUAL, limit], load=load)
    if value is not None:
        made.set_value(limit.name, value)
    made.set_value('speed_setpoint', target)
    made.handle_timer(0.0)
    assert made.value('actual_speed', 3.0) == pytest.approx(speed)


def test_time_never_runs_backwards() -> None:
    # a frame may have waited, and be told with the time of its arrival
    made = motor(EXAMPLE)
    made.set_value('speed_setpoint', 3000.0)
    for now in (0.0, 0.5, 0.4, 0.5):
        made.handle_timer(now)
    assert made.value('actual_speed') == 1500.0


def test_overlapping_status_patterns() -> None:
    # states as numbers in the low bits: 0 is ready, 3 enabled, 4 a fault
    table = replace(CONTROL, ready=StatusPattern(7, 0), enabled=StatusPattern(7, 3),
                    fault=StatusPattern(7, 4))
    bare = replace(STATUS, bits=(('moving', 15),))
    plant = motor([SPEED_SETPOINT, ACTUAL, bare, WORD], table)
    plant.handle_timer(0.0)
    assert plant.registers.raw('status_word') == 0
    plant.registers.write('control_word', 1)
    assert plant.registers.raw('status_word') == 3
    plant.plant.operation.trip()
    assert plant.registers.raw('status_word') == 4


def test_power_cycle_keeps_what_eeprom_keeps() -> None:
    made = motor([*EXAMPLE, parameter('gain', 60, storage=RAM), parameter('offset_angle', 61)])
    initial = made.registers.raw('gain')
    for name in ('gain', 'offset_angle', 'ramp_time', 'speed_setpoint'):
        made.registers.write(name, 999)
    made.fault('restart=0', 1.0)
    assert [made.registers.raw(name) for name in (
        'gain', 'offset_angle', 'ramp_time', 'speed_setpoint')] == [initial, 999, 999, 0]


# -- a position -----------------------------------------------------------------------------------


def axis(**mechanics: float) -> SimulatedDataModelDrive:
    """Make a drive with a control word, a position setpoint and its actual value."""
    return motor((WHERE, ANGLE, WORD, STATUS), CONTROL, (WORD, WHERE),
                 (ANGLE, STATUS), **mechanics)


def exchange(made: SimulatedDataModelDrive, word: int, target: float, now: float) -> float:
    """Send control word and setpoint; return the position that is answered."""
    target_raw = round(target * 10) & 0xFFFF
    answer, = ask(made, f'003FFFF0#{word:04X}{target_raw:04X}00000000', now)
    return int.from_bytes(bytes.fromhex(answer[9:13]), 'big', signed=True) / 10


@pytest.mark.parametrize(('mechanics', 'steps'), [
    # 1000 degrees per second squared; and without a load it stays where it is
    ({}, [(DISABLE, 0.0, 0.0, 0.0), (ENABLE, 0.0, 0.0, 0.0), (ENABLE, 900.0, 1.0, 0.0),
          (ENABLE, 900.0, 1.1, 5.0), (ENABLE, 900.0, 1.2, 20.0), (ENABLE, 900.0, 4.0, 900.0),
          (DISABLE, 900.0, 5.0, 900.0), (DISABLE, 0.0, 60.0, 900.0)]),
    # half the load: 50 degrees a second, reached in 0.2 s; it is caught again
    ({'load': 0.5}, [(ENABLE, 500.0, 0.0, 0.0), (ENABLE, 500.0, 5.0, 500.0),
                     (DISABLE, 500.0, 60.0, 500.0), (DISABLE, 500.0, 60.2, 495.0),
                     (DISABLE, 500.0, 61.2, 445.0), (ENABLE, 445.0, 61.2, 445.0),
                     (ENABLE, 445.0, 70.0, 445.0)]),
    # a brake closes at once
    ({'load': 1.0, 'brake': 1}, [(ENABLE, 500.0, 0.0, 0.0), (DISABLE, 500.0, 5.0, 500.0),
                                 (DISABLE, 500.0, 60.0, 500.0)]),
    # 500 degrees a second, at 5000 degrees per second squared
    ({}, [(ENABLE, 1000.0, 0.0, 0.0), (QUICK_STOP, 1000.0, 0.5, 125.0),
          (QUICK_STOP, 1000.0, 0.6, 150.0), (ENABLE, 1000.0, 5.0, 150.0)])])
def test_axis(mechanics: dict[str, float],
              steps: list[tuple[int, float, float, float]]) -> None:
    made = axis(**mechanics)
    assert [exchange(made, *step[:3]) for step in steps] == [step[3] for step in steps]


@pytest.mark.parametrize(('fault', 'back'), [('power_cut=2', 12.0), ('power_cut', 15.0)])
def test_sinks_without_power_and_does_not_jump_when_it_is_back(fault: str, back: float) -> None:
    made = running([WHERE, ANGLE], WHERE, 700.0, request=(WHERE,), response=(ANGLE,), load=0.1)
    assert made.value('actual_position') == 700.0
    made.fault(fault, 10.0)
    assert ask(made, '003FFFF0#0000000000000000', back - 0.01) == []
    sunk = float(made.value('actual_position', back))
    # 10 degrees a second
    assert sunk == pytest.approx(700.0 - 10.0 * (back - 10.0), abs=0.5)
    # a drive without a control word holds the place where it finds itself
    assert made.value('position_setpoint') == sunk
    assert made.value('actual_position', back + 100.0) == sunk


def test_encoder_noise_is_the_same_each_time() -> None:
    made, other = axis(noise=1), axis(noise=1)
    for each in (made, other):
        exchange(each, ENABLE, 500.0, 0.0)
    seen = [exchange(made, ENABLE, 500.0, 10.0 + 0.01 * step) for step in range(100)]
    assert set(seen) == {499.9, 500.0, 500.1}
    assert seen == [exchange(other, ENABLE, 500.0, 10.0 + 0.01 * step) for step in range(100)]
    # one measurement is one value, however often it is asked for
    assert made.value('actual_position') == made.value('actual_position')


def test_names_without_a_meaning_are_understood_by_their_units() -> None:
    wanted = parameter('height_wanted', 53, type=INT16, scale=0.1, unit='mm', minimum=0.0,
                       maximum=500.0)
    measured = parameter('height', 214, type=INT16, scale=0.1, unit='mm', access=RO)
    diameter = parameter('diameter', 215, unit='mm', access=RO)
    made = motor((wanted, measured, diameter), None, (wanted,), (measured,))
    before = made.value('diameter')
    made.set_value('height_wanted', 300.0, 0.0)
    made.handle_timer(10.0)
    # what is not exchanged cyclically is left alone
    assert (made.value('height'), made.value('diameter')) == (300.0, before)


@given(st.lists(st.tuples(st.floats(0.0, 3.0), st.floats(-50.0, 50.0)), max_size=20),
       st.booleans())
def test_it_does_not_matter_how_often_time_passes(steps: list[tuple[float, float]],
                                                  by_position: bool) -> None:
    coarse, fine = Travel(), Travel()
    for duration, target in steps:
        for travel, times in ((coarse, 1), (fine, 4)):
            for _ in range(times):
                if by_position:
                    travel.go(duration / times, target, 10.0, 20.0)
                    assert abs(travel.speed) <= 10.0 + 1e-9
                else:
                    travel.run(duration / times, target, Rates(rising=10.0, falling=20.0))
        assert fine.position == pytest.approx(coarse.position, abs=1e-5)


@pytest.mark.parametrize(('text', 'expected'), [
    ('load=0.3', Mechanics(load=0.3)), ('noise=1,brake=1', Mechanics(noise=1, brake=1)),
    (' load=1, noise=0', Mechanics(load=1.0)), *((text, None) for text in (
        '', 'load', 'load=', 'load=2', 'load=nan', 'noise=0.5', 'brake=2', 'weight=1',
        'load=-0.1'))])
def test_options_of_an_axis(text: str, expected: Mechanics | None) -> None:
    if expected is not None:
        assert Mechanics.parse(text) == expected
    else:
        with pytest.raises(ValueRefused, match='load=0…1, noise=0…100, brake=0…1'):
            Mechanics.parse(text)
