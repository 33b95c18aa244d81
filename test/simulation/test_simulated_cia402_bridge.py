# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Sessions of a bridge and simulated drives of CiA 402: what becomes of the motor."""

from typing import Any

from cable import Cable
from cia402_builders import BEGINNING, configuration
from extent import times
from hypothesis import given, settings, strategies as st
import pytest
from saying import says

from drive_can_bridge.core.control import ControlAction, ControlRequest
from drive_can_bridge.simulation.canopen.pdos import Checks
from drive_can_bridge.simulation.cia402 import SimulatedServoDrive
from drive_can_bridge.simulation.cia402_plant import Habits

STANDS = BEGINNING / 10_000
CSP = {'mode': 'csp', 'request': ('target_position',), 'response': ('actual_position',)}
PV = {'mode': 'pv'}


def running(cable: Cable, speed: float = 600.0) -> Cable:
    """Enable the first drive and let it turn: 600 rpm are 10 revolutions per second."""
    cable.run(1.0)
    assert cable.sessions[0].online
    assert cable.control(ControlAction.ENABLE)[0]
    cable.command(0.0)
    cable.command(speed, 1.0)
    assert cable.speed == pytest.approx(speed / 60.0, rel=1e-3)
    return cable


def slow(drive: SimulatedServoDrive) -> None:
    """Have a slow-down ramp of 10 rev/s²: a second from 10 rev/s."""
    drive.set_value('profile_deceleration', 600.0)


# -- the way up -----------------------------------------------------------------------------------


@pytest.mark.parametrize('keys', [{}, CSP, PV, {**PV, 'transmission': 'event'}])
def test_comes_online_without_power_and_enables_once_it_is_there(keys: dict[str, Any]) -> None:
    cable = Cable(configuration(**keys), prepare=lambda drive: drive.fault('sto', 0.0)).run(1.0)
    assert cable.sessions[0].online, cable.told()
    assert cable.samples
    success, message = cable.control(ControlAction.ENABLE)
    assert not success
    assert 'switch on disabled' in message
    cable.drives[0].fault('ok', cable.now)
    cable.run(0.5)
    assert cable.control(ControlAction.ENABLE) == (True, 'operation enabled')
    assert cable.drives[0].plant.shaft.position == pytest.approx(STANDS, abs=1e-9)
    assert not cable.drives[0].violations


def test_an_axis_stays_where_it_is_whatever_happens() -> None:
    cable = Cable(configuration(**CSP)).run(1.0)
    drive = cable.drives[0]
    assert cable.control(ControlAction.ENABLE)[0]
    cable.run(1.0)
    drive.fault('trip', cable.now)
    cable.run(0.5)
    assert cable.control(ControlAction.RESET_FAULT)[0]
    assert cable.control(ControlAction.ENABLE)[0]
    drive.fault('silent', cable.now)
    cable.run(1.0)
    drive.fault('ok', cable.now)
    cable.run(2.0)
    assert cable.sessions[0].online
    drive.fault('restart', cable.now)
    cable.run(3.0)
    assert cable.sessions[0].online
    assert cable.control(ControlAction.ENABLE)[0]
    for session in cable.sessions:
        session.bus_down(cable.now, 'unplugged')
    cable._collect()
    cable.run(1.0)
    for session in cable.sessions:
        session.bus_up(cable.now)
    cable._collect()
    cable.run(3.0)
    assert cable.sessions[0].online
    # it missed the bridge for longer than it waits
    assert cable.control(ControlAction.ENABLE) == (False, says('bridge_missed'))
    assert cable.control(ControlAction.RESET_FAULT)[0]
    assert cable.control(ControlAction.ENABLE)[0]
    cable.run(1.0)
    # asserted on what it was told, and on where it stands
    assert drive.plant.shaft.position == pytest.approx(STANDS, abs=1e-9)
    targets = {text[8:16] for _, text in cable.sent if text.startswith('205#') and (
        text[4:6] in ('07', '0F'))}
    assert targets == {BEGINNING.to_bytes(4, 'little').hex().upper()}


@pytest.mark.parametrize(('habits', 'keys', 'online'), [
    (Habits(fixed_mapping=True), {}, False),
    (Habits(fixed_mapping=True), {'mapping': 'verify'}, True),
    (Habits(types={254, 255}), {}, False),
    (Habits(types={254}), {**PV, 'transmission': 'event'}, True),
    (Habits(types={1, 255}), {}, True),
    (Habits(no_remote=True), {}, True),
    (Habits(mapping=Checks.OPERATIONAL), {}, True),
    (Habits(mapping=Checks.UNCHECKED), {}, True),
    (Habits(start=0.5), {}, True),
    (Habits(mode_shown_early=False), {}, True)])
def test_makers_differ(habits: Habits, keys: dict[str, Any], online: bool) -> None:
    cable = Cable(configuration(**keys), habits=habits).run(2.0)
    assert cable.sessions[0].online is online, cable.told()
    if online:
        assert cable.control(ControlAction.ENABLE)[0]
        cable.command(0.0)
        cable.command(60.0, 1.0)
        assert cable.speed == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize(('taken', 'keys', 'online', 'told'), [
    ([(0x605A, None), (0x605B, None), (0x605C, None)], {}, True, ''),
    ([(0x6007, None), (0x6502, None), (0x1800, 5)], {}, True, 'is not known (no 6007h)'),
    ([(0x1016, None), (0x1006, None), (0x1019, None), (0x60C2, None)], {}, True,
     'nothing stops this drive when the bridge dies'),
    ([(0x1017, None)], {}, True, '1017h'),
    ([(0x606C, None)], {}, False, '')])
@pytest.mark.parametrize('habits', [Habits(), Habits(mapping=Checks.OPERATIONAL)])
def test_makers_leave_out_objects(taken: list[Any], keys: dict[str, Any], online: bool,
                                  told: str, habits: Habits) -> None:
    cable = Cable(configuration(**keys), habits=habits,
                  prepare=lambda drive: drive.take_away(taken)).run(2.0)
    assert cable.sessions[0].online is online, cable.told()
    assert told in str(cable.told())
    if online:
        assert cable.control(ControlAction.ENABLE)[0]
        cable.command(0.0)
        cable.command(60.0, 1.0)
        assert cable.speed == pytest.approx(1.0, rel=1e-3)
        assert cable.control(ControlAction.QUICK_STOP)[0]


# -- ways out, told by the motor ------------------------------------------------------------------


@pytest.mark.parametrize('keys', [{}, PV])
def test_the_end_at_speed_brakes_by_ramp_and_does_not_coast(keys: dict[str, Any]) -> None:
    cable = running(Cable(configuration(**keys), prepare=slow))
    cable.drives[0].set_value('profile_deceleration', 1200.0)
    began = cable.drives[0].plant.shaft.position
    cable.deactivate()
    # the setpoint goes neutral: csv stops at once, pv in 0.5 s by its ramp. Coasting takes 0.8 s
    assert cable.speed == 0.0
    assert cable.drives[0].plant.shaft.position - began < 10.0 * 0.5 / 2 + 0.5
    cable.run(2.0)
    assert not cable.drives[0].plant.operation.enabled
    assert not cable.drives[0].plant.operation.faulted
    assert cable.drives[0].read_object(0x1016, 1) == bytes(4)


def test_a_killed_bridge_is_missed_and_the_drive_stops() -> None:
    cable = running(Cable(configuration(**PV)))
    assert cable.drives[0].read_object(0x1016, 1) == (0x7F << 16 | 600).to_bytes(4, 'little')
    cable.dead = True
    cable.run(0.39)
    assert cable.speed == pytest.approx(10.0, rel=1e-3)
    cable.run(0.61)
    assert cable.speed == 0.0
    assert cable.drives[0].value('fault_code') == 0x8130


@pytest.mark.parametrize(('option', 'message', 'state'), [
    (2, '', 'switch on disabled'), (6, 'quick stop active, holds', 'quick stop active')])
def test_quick_stop(option: int, message: str, state: str) -> None:
    cable = Cable(configuration(**CSP), load=0.3,
                  prepare=lambda drive: drive.set_value('quick_stop_option', option)).run(1.0)
    assert cable.control(ControlAction.ENABLE)[0]
    cable.run(0.5)
    shaft = cable.drives[0].plant.shaft
    success, said = cable.control(ControlAction.QUICK_STOP)
    assert success
    assert message in said
    held = shaft.position
    cable.run(2.0)
    # a vertical axis: where power goes, it falls
    if option == 6:
        assert shaft.position == held
        assert cable.control(ControlAction.DISABLE)[0]
        cable.run(1.0)
    assert shaft.position < held - 1.0
    assert not cable.drives[0].plant.operation.enabled


def test_a_vertical_axis_is_lowered_by_nobody_but_the_loss_of_power() -> None:
    cable = Cable(configuration(**CSP), load=0.3)
    # not enabled it sinks, and whatever enables it holds it where it is then
    cable.run(1.0)
    shaft = cable.drives[0].plant.shaft
    assert shaft.position < STANDS
    assert cable.control(ControlAction.ENABLE)[0]
    held = shaft.position
    cable.run(2.0)
    assert shaft.position == pytest.approx(held, abs=0.05)


def test_disable_brakes_by_ramp_and_another_word_coasts() -> None:
    cable = running(Cable(configuration(**PV), prepare=slow))
    assert cable.control(ControlAction.DISABLE)[0]
    assert cable.speed == 0.0
    cable = running(Cable(configuration(**PV, disable_word='disable_voltage'), prepare=slow))
    assert cable.control(ControlAction.DISABLE)[0]
    assert cable.speed > 8.0


@pytest.mark.parametrize(('method', 'offset', 'shown', 'moved'), [
    (17, 0.0, 0, True), (17, -0.5, -5000, True), (37, 0.0, 0, False), (35, 2.0, 20_000, False)])
def test_homing_by_request_only(method: int, offset: float, shown: int, moved: bool) -> None:
    cable = Cable(configuration(**CSP, homing=True))
    drive = cable.drives[0]
    cable.run(1.0)
    drive.set_value('homing_method', method)
    drive.set_value('home_offset', offset)
    assert cable.control(ControlAction.ENABLE)[0]
    cable.run(2.0)
    assert drive.plant.shaft.position == pytest.approx(STANDS, abs=1e-9)
    assert cable.control(ControlAction.HOME)[0]
    # back in csp, where it is now, and still enabled
    where = drive.plant.shaft.position
    assert where == pytest.approx(0.0 if moved else STANDS, abs=1e-9)
    assert cable.samples[-1][1] == shown
    cable.run(1.0)
    assert drive.plant.shaft.position == pytest.approx(where, abs=1e-9)
    assert drive.value('mode_shown') == 8
    assert drive.plant.operation.enabled
    assert not drive.plant.operation.faulted


@pytest.mark.parametrize(('mode', 'setpoint', 'value', 'speed'), [
    ('vl', 'vl_target_velocity', 600.0, 10.0), ('tq', 'target_torque', 8.0, 5.0),
    ('cst', 'target_torque', 8.0, 5.0)])
def test_modes_of_speed_and_torque(mode: str, setpoint: str, value: float, speed: float) -> None:
    cable = Cable(configuration(mode=mode, request=(setpoint,))).run(1.0)
    assert cable.control(ControlAction.ENABLE)[0]
    cable.command(0.0)
    assert cable.speed == 0.0
    cable.command(value, 3.0)
    assert cable.speed == pytest.approx(speed, rel=0.01)


@pytest.mark.parametrize(('mode', 'setpoint'), [
    ('csp', 'target_position'), ('pp', 'target_position'), ('ip', 'interpolation_target')])
def test_modes_of_position_go_where_they_are_told(mode: str, setpoint: str) -> None:
    cable = Cable(configuration(mode=mode, request=(setpoint,), response=('actual_position',)))
    shaft = cable.drives[0].plant.shaft
    cable.run(1.0)
    assert cable.control(ControlAction.ENABLE)[0]
    cable.run(0.5)
    assert shaft.position == pytest.approx(STANDS, abs=1e-9)
    cable.command(STANDS)
    for step in range(1, 11):
        cable.command(STANDS + 0.1 * step, 0.1)
    cable.command(STANDS + 1.0, 1.0)
    assert shaft.position == pytest.approx(STANDS + 1.0, abs=2e-4)
    assert cable.speed == 0.0
    # the newest wins, and nobody follows any more once it is disabled
    cable.command(STANDS, 0.1)
    assert cable.control(ControlAction.DISABLE)[0]
    where = shaft.position
    cable.run(1.0)
    assert shaft.position == pytest.approx(where, abs=1e-9)
    assert not cable.drives[0].plant.operation.faulted


# -- anything -------------------------------------------------------------------------------------

ANYTHING = ('trip', 'silent', 'late=0.03', 'drop=3', 'length=3', 'foreign', 'duplicate', 'sto',
            'restart', 'power_cut=1', 'ok', 'refuse=mode', 'bus down', 'bus up', 'enable',
            'disable', 'quick stop', 'reset', 'home', 'stall')
ACTIONS = {'enable': ControlAction.ENABLE, 'disable': ControlAction.DISABLE,
           'quick stop': ControlAction.QUICK_STOP, 'reset': ControlAction.RESET_FAULT,
           'home': ControlAction.HOME}


def happens(cable: Cable, what: str) -> None:
    """Let something happen to the first drive, its bus or its users, who wait for nothing."""
    session = cable.sessions[0]
    if what in ACTIONS:
        if not session.services.control_refusal(ACTIONS[what]):
            session.services.submit(ControlRequest(ACTIONS[what]), cable.now)
    elif what == 'bus down':
        session.bus_down(cable.now, 'unplugged')
    elif what == 'bus up':
        session.bus_up(cable.now)
    elif what == 'stall':
        cable.now += 1.5
        session.handle_stall(cable.now)
    else:
        cable.drives[0].fault(what, cable.now)
    cable._collect()


@settings(max_examples=times(4, 25), deadline=None)
@given(st.lists(st.tuples(st.sampled_from(ANYTHING), st.sampled_from((0.0, 0.013, 0.1, 0.7, 3.0))),
                max_size=12), st.sampled_from(('csp', 'ip', 'pp')))
def test_whatever_happens_no_axis_moves_by_our_doing_and_none_is_left_enabled(
        story: list[tuple[str, float]], mode: str) -> None:
    request = 'interpolation_target' if mode == 'ip' else 'target_position'
    cable = Cable(configuration(mode=mode, request=(request,), response=('actual_position',),
                                homing=True),
                  prepare=lambda drive: drive.set_value('homing_method', 37))
    drive = cable.drives[0]
    cable.run(1.0)
    for what, seconds in story:
        happens(cable, what)
        cable.run(seconds)
    # on the spot is where homing takes place: nothing of this turns the shaft
    assert drive.plant.shaft.position == pytest.approx(STANDS, abs=1e-6)
    happens(cable, 'bus up')
    happens(cable, 'ok')
    cable.run(4.0)
    assert cable.sessions[0].online
    cable.deactivate()
    assert drive.plant.shaft.position == pytest.approx(STANDS, abs=1e-6)
    assert not drive.plant.operation.enabled
    cable.run(2.0)
    assert not drive.plant.operation.enabled


@settings(max_examples=times(4, 25), deadline=None)
@given(st.lists(st.tuples(st.sampled_from((*ANYTHING, 'neutral', 'fast', 'back')),
                          st.sampled_from((0.0, 0.013, 0.1, 0.4, 2.0))), max_size=12),
       st.sampled_from(('csv', 'pv', 'vl')), st.sampled_from(('end', 'kill')))
def test_whatever_happens_what_ran_has_stopped_in_the_end(
        story: list[tuple[str, float]], mode: str, end: str) -> None:
    request = 'vl_target_velocity' if mode == 'vl' else 'target_velocity'
    cable = Cable(configuration(mode=mode, request=(request,)))
    drive, speeds = cable.drives[0], {'neutral': 0.0, 'fast': 600.0, 'back': -300.0}
    cable.run(1.0)
    assert cable.control(ControlAction.ENABLE)[0]
    cable.command(0.0)
    cable.command(600.0)
    for what, seconds in story:
        if what in speeds:
            cable.sessions[0].services.command(0, speeds[what], cable.now)
        else:
            happens(cable, what)
        cable.run(seconds)
    if end == 'kill':
        cable.dead = True
    else:
        cable.deactivate()
    told = 'may still be running' in ' '.join(cable.told())
    cable.run(2.0)
    # who was not told to stop misses the bridge
    assert not drive.plant.operation.enabled, (told, cable.told())
    cable.run(5.0)
    assert cable.speed == 0.0
