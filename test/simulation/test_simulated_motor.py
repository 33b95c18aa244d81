# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The motor of the simulated drives, and how its quantities get into parameters by their names."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from hypothesis import given, strategies as st
import pytest
from simulation_builders import (
    ACTUAL_SPEED, CONTROL, CONTROL_WORD, EXAMPLE, INT16, motor, parameter, RAM, RO, SPEED_SETPOINT,
    STATUS_WORD, WO,
)

from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.core.profile import StatusPattern
from drive_can_bridge.simulation import quantities
from drive_can_bridge.simulation.datamodel import SimulatedDataModelDrive
from drive_can_bridge.simulation.motor import AMBIENT_TEMPERATURE, Motor, Rates, Travel
from drive_can_bridge.simulation.quantities import Quantity, RampUse

RATES = Rates(rising=10.0, falling=20.0)


class TestRamp:

    def test_rises_and_falls_at_different_rates(self) -> None:
        ramp = Travel()
        ramp.run(0.5, 100.0, RATES)
        assert (ramp.speed, ramp.slope) == (5.0, 10.0)
        ramp.run(0.1, 0.0, RATES)
        assert (ramp.speed, ramp.slope) == (3.0, -20.0)

    def test_reversal_falls_to_zero_and_rises_from_there(self) -> None:
        ramp = Travel(speed=10.0)
        ramp.run(1.0, -50.0, RATES)
        assert (ramp.speed, ramp.slope) == (-5.0, -10.0)

    def test_integral(self) -> None:
        # 1 s up to 10, 1 s at 10
        ramp = Travel()
        ramp.run(2.0, 10.0, RATES)
        assert ramp.position == 15.0

    def test_stays_at_its_target(self) -> None:
        ramp = Travel()
        ramp.run(100.0, 7.0, RATES)
        assert (ramp.speed, ramp.slope) == (7.0, 0.0)

    @given(st.lists(st.tuples(st.floats(0.0, 5.0), st.floats(-100.0, 100.0)), max_size=20))
    def test_it_does_not_matter_how_often_time_passes(
            self, steps: list[tuple[float, float]]) -> None:
        coarse, fine = Travel(), Travel()
        for duration, target in steps:
            coarse.position = fine.position = 0.0
            coarse.run(duration, target, RATES)
            for _ in range(4):
                fine.run(duration / 4.0, target, RATES)
            assert fine.speed == pytest.approx(coarse.speed, abs=1e-6)
            assert fine.position == pytest.approx(coarse.position, abs=1e-6)


def turn(motor: Motor, duration: float, target: float, rates: Rates, *,
         energised: bool = True) -> None:
    """Let a motor go towards a speed for some time."""
    motor.shaft.run(duration, target, rates)
    motor.advance(duration, energised=energised)


class TestMotor:

    def test_current_follows_acceleration_and_load(self) -> None:
        motor = Motor(3000.0, 1.0 / 60.0)
        rates = Rates(3000.0, 3000.0)
        turn(motor, 0.0, 0.0, rates)
        at_rest = motor.current
        turn(motor, 0.5, 3000.0, rates)
        accelerating = motor.current
        turn(motor, 5.0, 3000.0, rates)
        running = motor.current
        turn(motor, 0.5, 0.0, rates)
        assert at_rest < running < accelerating
        assert motor.torque < 0.0

    def test_position_integrates(self) -> None:
        motor = Motor(3000.0, 1.0 / 60.0)
        turn(motor, 2.0, 600.0, Rates(600.0, 600.0))
        assert motor.position == pytest.approx(15.0)

    def test_temperature_creeps(self) -> None:
        motor = Motor(3000.0, 1.0 / 60.0)
        rates = Rates(3000.0, 3000.0)
        turn(motor, 10.0, 3000.0, rates)
        turn(motor, 10.0, 3000.0, rates)
        warm = motor.temperature
        turn(motor, 600.0, 3000.0, rates)
        assert AMBIENT_TEMPERATURE < warm < motor.temperature < 60.0

    def test_without_torque(self) -> None:
        motor = Motor(3000.0, 1.0 / 60.0)
        turn(motor, 1.0, 3000.0, Rates(3000.0, 3000.0), energised=False)
        assert (motor.torque, motor.current) == (0.0, 0.0)


class TestNames:

    @pytest.mark.parametrize(('name', 'quantity'), [
        ('actual_speed', Quantity.SPEED), ('output_frequency', Quantity.SPEED),
        ('current_position', Quantity.POSITION), ('torque_current', Quantity.TORQUE),
        ('motor_current', Quantity.CURRENT), ('heatsink_temperature', Quantity.TEMPERATURE),
        ('dc_link_voltage', Quantity.VOLTAGE), ('output_power', Quantity.POWER),
        ('motor_load', Quantity.LOAD), ('fault_code', Quantity.FAULT_CODE),
        ('rated_current', None), ('speed_limit', None), ('firmware_version', None),
    ])
    def test_measured(self, name: str, quantity: Quantity | None) -> None:
        assert quantities.measured(parameter(name, 1, access=RO)) is quantity
        assert quantities.measured(parameter(name, 1)) is None

    @pytest.mark.parametrize(('setpoint', 'actual'), [
        ('speed_setpoint', 'actual_speed'), ('setpoint_speed', 'actual_speed'),
        ('target_position', 'actual_position'), ('frequency_reference', 'frequency_actual'),
        ('torque_command', 'torque_feedback'), ('setpoint_1', 'actual_value_1'),
        ('speed', 'actual_speed'), ('speed_setpoint', 'motor_speed'),
    ])
    def test_pairs(self, setpoint: str, actual: str) -> None:
        table = {p.name: p for p in (parameter(setpoint, 1), parameter(actual, 2, access=RO))}
        pair, = quantities.pairs(table)
        assert (pair.setpoint.name, pair.actual.name) == (setpoint, actual)
        assert quantities.pairs(table, without=setpoint) == []

    @pytest.mark.parametrize(('name', 'unit', 'is_time', 'use'), [
        ('ramp_time', 's', True, RampUse.BOTH),
        ('acceleration_time', 'ms', True, RampUse.RISING),
        ('ramp_down_time', 's', True, RampUse.FALLING),
        ('deceleration', 'rpm/s', False, RampUse.FALLING),
        ('acceleration', '', False, RampUse.RISING),
        ('quick_stop_ramp', 's', True, RampUse.QUICK_STOP),
    ])
    def test_ramps(self, name: str, unit: str, is_time: bool, use: RampUse) -> None:
        made = parameter(name, 1, unit=unit)
        assert quantities.ramp_parameters({name: made}) == [(made, is_time, use)]

    def test_what_is_no_ramp(self) -> None:
        for made in (parameter('ramp_time', 1, access=RO), parameter('ramp_limit', 1),
                     parameter('stop_mode', 1)):
            assert quantities.ramp_parameters({made.name: made}) == []


class TestPlant:

    def test_speed_in_another_unit(self) -> None:
        hertz = parameter('output_frequency', 3, scale=0.1, unit='Hz', access=RO)
        percent = parameter('output_speed', 4, scale=0.1, unit='%', access=RO)
        plant = running([*EXAMPLE, hertz, percent], 'speed_setpoint', 1500.0)
        assert plant.value('output_frequency') == 25.0
        assert plant.value('output_speed') == 50.0

    def test_setpoint_without_actual_value_moves_the_motor(self) -> None:
        position = parameter('position', 3, unit='rev', type=INT16, access=RO)
        plant = running([SPEED_SETPOINT, position], 'speed_setpoint', 600.0)
        assert plant.value('position') == pytest.approx(100.0, abs=2.0)

    def test_position_is_that_of_the_shaft_where_a_speed_is_commanded(self) -> None:
        plant = running(BOTH, 'speed_setpoint', 60.0, request=[SPEED_SETPOINT])
        assert plant.value('actual_speed') == 60.0
        before = plant.value('actual_position')
        plant.handle_timer(10.5)
        assert plant.value('actual_position') == pytest.approx(before + 180.0, abs=1.0)

    def test_position_is_followed_where_a_position_is_commanded(self) -> None:
        plant = running(BOTH, 'position_setpoint', 90.0, request=[POSITION_SETPOINT])
        assert plant.value('actual_position') == 90.0
        assert plant.value('actual_speed') == 0.0
        plant.registers.write('position_setpoint', 30000)
        # from rest with 3000 degrees per second squared, up to 3000 degrees per second: 500 rpm
        plant.handle_timer(10.1)
        assert plant.value('actual_position') == 105.0
        assert plant.value('actual_speed') == 50.0
        plant.handle_timer(10.5)
        assert plant.value('actual_position') == 465.0
        assert plant.value('actual_speed') == 250.0
        plant.handle_timer(13.0)
        assert plant.value('actual_position') == 3000.0
        assert plant.value('actual_speed') == 0.0

    def test_position_wraps_where_the_parameter_ends(self) -> None:
        wrapped = parameter('position', 1, type=INT16, access=RO)
        assert quantities.position_value(wrapped, 7.0) == 7 * 4096
        assert quantities.position_value(wrapped, 9.0) == 9 * 4096 - 65536
        limited = parameter('position', 1, type=INT16, unit='deg', minimum=0.0, maximum=359.0)
        assert quantities.position_value(limited, 1.25) == 90.0
        assert quantities.position_value(limited, -0.25) == 270.0

    def test_values_never_leave_their_type(self) -> None:
        small = parameter('actual_torque', 3, scale=0.0001, unit='Nm', type=INT16, access=RO)
        plant = running([*EXAMPLE, small], 'speed_setpoint', -3000.0)
        assert -3.2768 <= plant.value('actual_torque') < 0.0

    def test_limits_in_any_direction(self) -> None:
        upside_down = parameter('x', 1, type=INT16, scale=-0.5, minimum=-10.0, maximum=20.0)
        nothing_between = parameter('w', 4, minimum=0.4, maximum=0.6)
        registers = motor([upside_down, parameter('y', 2, maximum=15.0),
                           parameter('z', 3, type=ParameterType.BOOL), nothing_between]).registers
        assert [(registers.clamped(name, -50), registers.clamped(name, 50))
                for name in 'xyzw'] == [(-40, 20), (0, 15), (0, 1), (0, 0)]

    def test_rate_parameters(self) -> None:
        rate = parameter('acceleration', 3, unit='rpm/s', storage=RAM)
        plant = motor([*EXAMPLE[:-1], rate])
        assert plant.value('acceleration') == 3000.0
        plant.registers.write('acceleration', 600)
        plant.registers.write('speed_setpoint', 30000)
        plant.handle_timer(0.0)
        plant.handle_timer(1.0)
        assert plant.value('actual_speed') == 600.0

    def test_power_cycle_keeps_what_eeprom_keeps(self) -> None:
        gain = parameter('gain', 60, storage=RAM)
        unknown = parameter('offset_angle', 61)
        plant = motor([*EXAMPLE, gain, unknown])
        initial = plant.registers.raw('gain')
        for name, raw in (('gain', 999), ('offset_angle', 999), ('ramp_time', 500),
                          ('speed_setpoint', 5000)):
            plant.registers.write(name, raw)
        plant.fault('restart=0', 1.0)
        assert plant.registers.raw('gain') == initial
        assert plant.registers.raw('offset_angle') == 999
        assert plant.registers.raw('ramp_time') == 500
        assert plant.registers.raw('speed_setpoint') == 0

    def test_every_kind_of_parameter_has_an_initial_value(self) -> None:
        table: list[Parameter] = [
            parameter('switch', 1, type=ParameterType.BOOL),
            parameter('command_word', 2, access=WO),
            parameter('lower_limit', 3, minimum=5.0), parameter('current_limit', 4, unit='%'),
            parameter('minimum_speed', 5, minimum=10.0, maximum=90.0),
            parameter('gain', 6, scale=0.01, minimum=0.0, maximum=3.0),
            parameter('position_setpoint', 7, neutral=1e9),
            parameter('ramp_ms', 8, unit='ms'), parameter('warm_up', 9, minimum=200.0),
            parameter('tension', 10, scale=0.5, neutral=5.0),
        ]
        plant = motor(table)
        assert [plant.value(p.name) for p in table] == [
            False, 0, 100, 100.0, 10.0, 1.0, 0, 1000.0, 200, 5.0]


POSITION_SETPOINT = parameter('position_setpoint', 53, type=INT16, scale=0.1, unit='deg',
                              minimum=-3000.0, maximum=3000.0)
ACTUAL_POSITION = parameter('actual_position', 214, type=INT16, scale=0.1, unit='deg', access=RO)
BOTH = [SPEED_SETPOINT, POSITION_SETPOINT, ACTUAL_SPEED, ACTUAL_POSITION]


def running(table: list[Parameter], setpoint: str, value: float,
            request: Iterable[Parameter] = ()) -> SimulatedDataModelDrive:
    """Make a drive that has followed a setpoint for ten seconds."""
    plant = motor(table, request=request)
    plant.set_value(setpoint, value)
    plant.handle_timer(0.0)
    plant.handle_timer(10.0)
    return plant


@pytest.mark.parametrize(('name', 'options', 'value'), [
    ('dc_link_voltage', {'scale': 0.1, 'unit': 'V'}, 560.0 * 0.993),
    ('output_voltage', {'scale': 0.1, 'unit': 'V'}, 560.0 * 0.7 / 2),
    ('actual_torque', {'scale': 0.1, 'unit': '%'}, 20.0),
    ('output_power', {'unit': 'W'}, 300.0),
    ('motor_load', {'unit': '%'}, 20.0),
    ('motor_current', {'scale': 0.01, 'unit': 'A'}, 2.83),
    ('motor_temperature', {'scale': 0.1, 'unit': 'degC'}, 25.3),
    ('motor_temperature', {'scale': 0.1, 'unit': 'K'}, 298.5),
    ('motor_temperature', {'scale': 0.1, 'unit': 'degF'}, 77.6),
    ('fault_code', {}, 0),
    ('firmware_torque_limit', {'maximum': 40.0}, 40),
])
def test_quantities_at_half_speed(name: str, options: dict[str, Any], value: float) -> None:
    made = parameter(name, 3, access=RO, **options)
    plant = running([*EXAMPLE[:3], made], 'speed_setpoint', 1500.0)
    assert plant.value(name) == pytest.approx(value, abs=1.0 if name != 'fault_code' else 0.0)


def test_torque_setpoint_is_followed_and_ends_with_a_fault() -> None:
    setpoint = parameter('torque_setpoint', 3, unit='%', type=INT16)
    actual = parameter('actual_torque', 4, unit='%', type=INT16, access=RO)
    plant = running([*EXAMPLE, setpoint, actual], 'torque_setpoint', 50.0)
    assert plant.value('actual_torque') == 50.0
    plant.plant.operation.trip()
    plant.handle_timer(20.0)
    assert plant.value('actual_torque') == 0.0


def test_ramps_by_use() -> None:
    table = [SPEED_SETPOINT, ACTUAL_SPEED, parameter('ramp_up_time', 1, unit='s'),
             parameter('ramp_down_time', 2, unit='s'),
             parameter('quick_stop_ramp', 3, scale=0.1, unit='s')]
    plant = motor(table)
    assert plant.value('quick_stop_ramp') == pytest.approx(0.2)
    plant.registers.write('ramp_up_time', 2)
    plant.registers.write('ramp_down_time', 4)
    plant.set_value('speed_setpoint', 3000.0)
    plant.handle_timer(0.0)
    plant.handle_timer(1.0)
    assert plant.value('actual_speed') == 1500.0
    plant.set_value('speed_setpoint', 0.0)
    plant.handle_timer(2.0)
    assert plant.value('actual_speed') == 750.0


@pytest.mark.parametrize('mover', [SPEED_SETPOINT, POSITION_SETPOINT])
def test_a_brake_holds_at_once(mover: Parameter) -> None:
    plant = motor([*BOTH, CONTROL_WORD], CONTROL, [mover], brake=1)
    plant.handle_timer(0.0)
    plant.registers.write('control_word', 1)
    plant.set_value(mover.name, 3000.0)
    plant.handle_timer(0.5)
    assert plant.value('actual_speed') > 0.0
    plant.registers.write('control_word', 0)
    plant.handle_timer(0.5)
    assert plant.value('actual_speed') == 0.0


def test_no_current_as_soon_as_it_trips() -> None:
    plant = motor(EXAMPLE)
    plant.set_value('speed_setpoint', 3000.0)
    plant.handle_timer(0.0)
    plant.handle_timer(2.0)
    assert plant.value('motor_current') > 0.0
    plant.fault('trip', 2.0)
    assert plant.value('motor_current') == 0.0


def test_no_current_once_a_quick_stop_is_over() -> None:
    plant = motor([*EXAMPLE, CONTROL_WORD], CONTROL)
    plant.handle_timer(0.0)
    plant.registers.write('control_word', 1)
    plant.set_value('speed_setpoint', 3000.0)
    plant.handle_timer(2.0)
    plant.registers.write('control_word', 2)
    plant.handle_timer(2.1)
    assert plant.value('motor_current') > 0.0
    plant.handle_timer(3.0)
    assert (plant.value('actual_speed'), plant.value('motor_current')) == (0.0, 0.0)


def test_torque_of_an_acceleration_is_still_there_at_the_same_instant() -> None:
    plant = motor(EXAMPLE)
    plant.set_value('speed_setpoint', 3000.0)
    currents = []
    for now in (0.0, 0.5, 0.5):
        plant.handle_timer(now)
        currents.append(plant.value('motor_current'))
    assert currents[0] < currents[1] == currents[2]


def test_time_never_runs_backwards() -> None:
    # a frame may have waited, and be told with the time of its arrival
    plant = motor(EXAMPLE)
    plant.set_value('speed_setpoint', 3000.0)
    for now in (0.0, 0.5, 0.4, 0.5):
        plant.handle_timer(now)
    assert plant.value('actual_speed') == 1500.0


def test_overlapping_status_patterns() -> None:
    # states as numbers in the low bits: 0 is ready, 3 enabled, 4 a fault
    table = replace(CONTROL, ready=StatusPattern(7, 0), enabled=StatusPattern(7, 3),
                    fault=StatusPattern(7, 4))
    bare = replace(STATUS_WORD, bits=(('moving', 15),))
    plant = motor([SPEED_SETPOINT, ACTUAL_SPEED, bare, CONTROL_WORD], table)
    plant.handle_timer(0.0)
    assert plant.registers.raw('status_word') == 0
    plant.registers.write('control_word', 1)
    assert plant.registers.raw('status_word') == 3
    plant.plant.operation.trip()
    assert plant.registers.raw('status_word') == 4
