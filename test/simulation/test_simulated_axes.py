# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Positions of the simulated drives: finite speed, load, brake, encoder noise, loss of power."""

from hypothesis import given, strategies as st
import pytest
from simulation_builders import (
    ask, CONTROL, CONTROL_WORD, INT16, motor, parameter, RO, STATUS_WORD,
)

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import ParameterType
from drive_can_bridge.simulation.datamodel import SimulatedDataModelDrive
from drive_can_bridge.simulation.motor import Travel
from drive_can_bridge.simulation.registers import Mechanics

# 0.1 degrees a step; at most 1000 degrees a second, reached in a second
SETPOINT = parameter('position_setpoint', 53, type=INT16, scale=0.1, unit='deg', minimum=-1000.0,
                     maximum=1000.0)
ACTUAL = parameter('actual_position', 214, type=INT16, scale=0.1, unit='deg', access=RO)
TABLE = (SETPOINT, ACTUAL, CONTROL_WORD, STATUS_WORD)
ENABLE, DISABLE, QUICK_STOP = 1, 0, 2


def axis(**mechanics: float) -> SimulatedDataModelDrive:
    """Make a drive with a control word, a position setpoint and its actual value."""
    return motor(TABLE, CONTROL, (CONTROL_WORD, SETPOINT), (ACTUAL, STATUS_WORD), **mechanics)


def exchange(made: SimulatedDataModelDrive, word: int, target: float, now: float) -> float:
    """Send control word and setpoint; return the position that is answered."""
    target_raw = round(target * 10) & 0xFFFF
    answer, = ask(made, f'003FFFF0#{word:04X}{target_raw:04X}00000000', now)
    return int.from_bytes(bytes.fromhex(answer[9:13]), 'big', signed=True) / 10


class TestTravel:

    def test_short_way_is_a_triangle(self) -> None:
        # 2 s to the middle with 10 per s squared, 2 s to the end
        travel = Travel()
        travel.go(2.0, 40.0, 100.0, 10.0)
        assert (travel.position, travel.speed) == (20.0, 20.0)
        travel.go(1.0, 40.0, 100.0, 10.0)
        assert (travel.position, travel.speed, travel.slope) == (35.0, 10.0, -10.0)
        travel.go(1.0, 40.0, 100.0, 10.0)
        assert (travel.position, travel.speed) == (40.0, 0.0)

    def test_long_way_cruises(self) -> None:
        # 1 s up to 10, 9 s at 10, 1 s down
        travel = Travel()
        travel.go(5.0, 100.0, 10.0, 10.0)
        assert (travel.position, travel.speed, travel.slope) == (45.0, 10.0, 0.0)
        travel.go(6.0, 100.0, 10.0, 10.0)
        assert (travel.position, travel.speed) == (100.0, 0.0)

    def test_turns_round_without_a_jump_of_its_speed(self) -> None:
        travel = Travel()
        travel.go(1.0, 100.0, 10.0, 10.0)
        # stands at 10 after another second, then goes back
        travel.go(1.0, -100.0, 10.0, 10.0)
        assert (travel.position, travel.speed) == (10.0, 0.0)

    def test_a_target_within_its_braking_distance_is_passed_and_reached_from_behind(self) -> None:
        travel = Travel()
        travel.go(1.0, 100.0, 10.0, 10.0)
        assert (travel.position, travel.speed) == (5.0, 10.0)
        # 7 lies ahead, but it cannot stand before 10
        travel.go(1.0, 7.0, 10.0, 10.0)
        assert (travel.position, travel.speed) == (10.0, 0.0)
        travel.go(10.0, 7.0, 10.0, 10.0)
        assert (travel.position, travel.speed) == (7.0, 0.0)

    @given(st.lists(st.tuples(st.floats(0.0, 3.0), st.floats(-50.0, 50.0)), max_size=20))
    def test_it_does_not_matter_how_often_time_passes(
            self, steps: list[tuple[float, float]]) -> None:
        coarse, fine = Travel(), Travel()
        for duration, target in steps:
            coarse.go(duration, target, 10.0, 20.0)
            for _ in range(4):
                fine.go(duration / 4.0, target, 10.0, 20.0)
            assert fine.position == pytest.approx(coarse.position, abs=1e-5)
            assert abs(coarse.speed) <= 10.0 + 1e-9

    @given(st.lists(st.floats(-50.0, 50.0), min_size=1, max_size=50))
    def test_neither_position_nor_speed_ever_jumps(self, targets: list[float]) -> None:
        travel = Travel()
        for target in targets:
            before, speed = travel.position, travel.speed
            travel.go(0.05, target, 10.0, 20.0)
            assert abs(travel.position - before) <= 10.0 * 0.05 + 1e-9
            assert abs(travel.speed - speed) <= 20.0 * 0.05 + 1e-6
        travel.go(20.0, targets[-1], 10.0, 20.0)
        assert (travel.position, travel.speed) == (targets[-1], 0.0)


class TestAxis:

    def test_follows_with_finite_acceleration_and_speed(self) -> None:
        made = axis()
        exchange(made, DISABLE, 0.0, 0.0)
        exchange(made, ENABLE, 0.0, 0.0)
        exchange(made, ENABLE, 900.0, 1.0)
        # 1000 degrees per second squared
        assert exchange(made, ENABLE, 900.0, 1.1) == 5.0
        assert exchange(made, ENABLE, 900.0, 1.2) == 20.0
        assert exchange(made, ENABLE, 900.0, 4.0) == 900.0

    def test_stays_where_it_is_without_a_load(self) -> None:
        made = axis()
        exchange(made, ENABLE, 500.0, 0.0)
        assert exchange(made, DISABLE, 500.0, 5.0) == 500.0
        assert exchange(made, DISABLE, 0.0, 60.0) == 500.0

    def test_sinks_under_its_load_unless_it_is_enabled(self) -> None:
        made = axis(load=0.5)
        exchange(made, ENABLE, 500.0, 0.0)
        assert exchange(made, ENABLE, 500.0, 5.0) == 500.0
        assert exchange(made, DISABLE, 500.0, 60.0) == 500.0
        # half the load: 50 degrees a second, reached in 0.2 s
        assert exchange(made, DISABLE, 500.0, 60.2) == 495.0
        assert exchange(made, DISABLE, 500.0, 61.2) == 445.0
        assert exchange(made, ENABLE, 445.0, 61.2) == 445.0
        # it is caught again, and goes back to where it is wanted
        assert exchange(made, ENABLE, 445.0, 70.0) == 445.0

    def test_brake(self) -> None:
        made = axis(load=1.0, brake=1)
        exchange(made, ENABLE, 500.0, 0.0)
        exchange(made, DISABLE, 500.0, 5.0)
        assert exchange(made, DISABLE, 500.0, 60.0) == 500.0

    def test_quick_stop_brakes_and_then_lets_go(self) -> None:
        made = axis()
        exchange(made, ENABLE, 1000.0, 0.0)
        # 500 degrees a second, at 5000 degrees per second squared
        assert exchange(made, QUICK_STOP, 1000.0, 0.5) == 125.0
        assert exchange(made, QUICK_STOP, 1000.0, 0.6) == 150.0
        assert exchange(made, ENABLE, 1000.0, 5.0) == 150.0

    @pytest.mark.parametrize(('fault', 'back'), [
        ('power_cut=2', 12.0), ('restart=2', 12.0), ('power_cut', 15.0)])
    def test_sinks_without_power_and_does_not_jump_when_it_is_back(self, fault: str,
                                                                   back: float) -> None:
        made = motor((SETPOINT, ACTUAL), None, (SETPOINT,), (ACTUAL,), load=0.1)
        made.set_value('position_setpoint', 700.0, 0.0)
        made.handle_timer(10.0)
        assert made.value('actual_position') == 700.0
        made.fault(fault, 10.0)
        assert ask(made, '003FFFF0#0000000000000000', back - 0.01) == []
        sunk = float(made.value('actual_position', back))
        # 10 degrees a second
        assert sunk == pytest.approx(700.0 - 10.0 * (back - 10.0), abs=0.5)
        # a drive without a control word holds the place where it finds itself
        assert made.value('position_setpoint') == sunk
        assert made.value('actual_position', back + 100.0) == sunk

    def test_encoder_noise_is_one_step_either_way(self) -> None:
        made = axis(noise=1)
        exchange(made, ENABLE, 500.0, 0.0)
        seen = {exchange(made, ENABLE, 500.0, 10.0 + 0.01 * step) for step in range(100)}
        assert seen == {499.9, 500.0, 500.1}
        # one measurement is one value, however often it is asked for
        assert made.value('actual_position') == made.value('actual_position')

    def test_two_drives_make_the_same_noise_each_time(self) -> None:
        def measured() -> list[float]:
            made = axis(noise=3)
            return [exchange(made, DISABLE, 0.0, 0.01 * step) for step in range(50)]
        assert measured() == measured()

    def test_noise_of_a_shaft_that_a_speed_moves(self) -> None:
        speed = parameter('speed_setpoint', 50, type=INT16, unit='rpm', minimum=-60.0,
                          maximum=60.0)
        made = motor((speed, ACTUAL), None, (speed,), (ACTUAL,), noise=1)
        assert {made.value('actual_position', 0.01 * step) for step in range(100)} == {
            -0.1, 0.0, 0.1}

    def test_a_speed_moves_a_load_too(self) -> None:
        speed = parameter('speed_setpoint', 50, type=INT16, unit='rpm', minimum=-600.0,
                          maximum=600.0)
        made = motor((speed, ACTUAL, CONTROL_WORD), CONTROL, (CONTROL_WORD, speed), (ACTUAL,),
                     load=1.0)
        made.handle_timer(0.0)
        # 60 rpm are 360 degrees a second, reached in 0.4 s
        assert made.value('actual_position', 1.4) == pytest.approx(-360.0 - 72.0, abs=0.1)

    def test_names_without_a_meaning_are_understood_by_their_units(self) -> None:
        wanted = parameter('height_wanted', 53, type=ParameterType.INT16, scale=0.1, unit='mm',
                           minimum=0.0, maximum=500.0)
        measured = parameter('height', 214, type=ParameterType.INT16, scale=0.1, unit='mm',
                             access=RO)
        diameter = parameter('diameter', 215, unit='mm', access=RO)
        made = motor((wanted, measured, diameter), None, (wanted,), (measured,))
        before = made.value('diameter')
        made.set_value('height_wanted', 300.0, 0.0)
        made.handle_timer(10.0)
        assert made.value('height') == 300.0
        # what is not exchanged cyclically is left alone
        assert made.value('diameter') == before


class TestOptions:

    @pytest.mark.parametrize(('text', 'expected'), [
        ('load=0.3', Mechanics(load=0.3)), ('noise=1,brake=1', Mechanics(noise=1, brake=1)),
        (' load=1, noise=0', Mechanics(load=1.0)),
    ])
    def test_read(self, text: str, expected: Mechanics) -> None:
        assert Mechanics.parse(text) == expected

    @pytest.mark.parametrize('text', ['', 'load', 'load=', 'load=2', 'load=nan', 'noise=0.5',
                                      'brake=2', 'weight=1', 'load=-0.1'])
    def test_refused(self, text: str) -> None:
        with pytest.raises(ValueRefused, match='is not possible; allowed: load=0…1, noise=0…100'):
            Mechanics.parse(text)
