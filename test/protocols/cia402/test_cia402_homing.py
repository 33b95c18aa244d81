# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The end of a homing, as drives show it that are late, done at once, or left off as they were."""

from builders import INT32, parameter, RAM
import pytest
from saying import says
from servo_builders import Axis, OBJECTS
from servos import HomingServo, LelyHomingServo, StepperServo

from drive_can_bridge.core.control import ControlAction, ControlRequest

#: arming_tolerance of a target: 10 steps
TARGET = parameter('target_position', None, index=0x607A, subindex=0, type=INT32, storage=RAM,
                   neutral_from='position', arming_tolerance=10.0)
HOMED = [('home', True, says('homed'))]
FAR = (31_000).to_bytes(4, 'little')


def meet(mode: str = 'csp', *, kind: type[HomingServo] = HomingServo, method: int | None = None,
         **options: object) -> tuple[Axis, HomingServo]:
    options.setdefault('homing_timeout', 5.0)
    axis = Axis(mode, homing=True, **options)   # type: ignore[arg-type]
    objects = {**OBJECTS, (0x6064, 0): FAR}
    if method is not None:
        objects[0x6098, 0] = bytes([method])
    drive = axis.drive = kind(5, objects)
    axis.enabled()
    return axis, drive


def home(axis: Axis, wait: float) -> list[tuple[str, bool, str]]:
    axis.talk.now = axis.now
    axis.session.services.submit(ControlRequest(ControlAction.HOME), axis.now)
    axis.deliver(axis.talk.sent())
    axis.live(wait)
    return axis.talk.control_outcomes()


def targets(axis: Axis, mode: int) -> list[int]:
    """Return the targets that were sent since the mode was written back."""
    sent = axis.take()
    back = sent.index(f'605#2F606000{mode:02X}000000')
    return [int.from_bytes(bytes.fromhex(text[8:16]), 'little', signed=True)
            for text in sent[back:] if text.startswith('205#')]


@pytest.mark.parametrize('late', [0, 1, 2, 3])
@pytest.mark.parametrize('before', [0x0000, 0x1400, 0x2000, 0x3400])
class TestBitsOfTheHomingBefore:

    @pytest.mark.parametrize('mode', ['csp', 'pp', 'csv'])
    def test_a_good_homing_is_not_broken_off(self, mode: str, before: int, late: int) -> None:
        axis, drive = meet(mode)
        drive.late_status, drive.before = late, before
        assert home(axis, 1.0) == HOMED
        assert (drive.found, drive.broken_off) == (1, 0)

    def test_an_error_is_seen(self, before: int, late: int) -> None:
        axis, drive = meet()
        drive.late_status, drive.before, drive.fails = late, before, True
        assert home(axis, 1.5) == [('home', False, says('homing_failed'))]

    def test_so_is_one_that_stands_at_once(self, before: int, late: int) -> None:
        axis, drive = meet()
        drive.late_status, drive.before, drive.fails = late, before, True
        drive.takes_syncs = 0
        assert home(axis, 1.5) == [('home', False, says('homing_failed'))]


@pytest.mark.parametrize('late', [0, 1, 2, 3])
class TestDoneAtOnce:

    @pytest.mark.parametrize('takes', [0, 1])
    def test_by_bits_that_stand_and_a_position_that_stays(self, takes: int, late: int) -> None:
        axis, drive = meet()
        drive.takes_syncs, drive.late_status, drive.before = takes, late, 0x1400
        assert home(axis, 0.5) == []
        axis.live(0.4)
        assert axis.talk.control_outcomes() == HOMED
        assert set(targets(axis, 8)) == {7}

    @pytest.mark.parametrize('method', [35, 37])
    def test_by_five_cycles_where_the_method_moves_nothing(self, method: int, late: int) -> None:
        axis, drive = meet(method=method)
        drive.takes_syncs, drive.late_status = 0, late
        assert home(axis, 0.35) == HOMED

    def test_it_takes_a_quarter_of_control_timeout(self, late: int) -> None:
        axis, drive = meet(control_timeout=4.0)
        drive.takes_syncs, drive.late_status = 0, late
        assert home(axis, 1.0) == []
        axis.live(0.4)
        assert axis.talk.control_outcomes() == HOMED

    def test_a_position_that_is_not_mapped_is_read(self, late: int) -> None:
        axis, drive = meet('csv', response=())
        drive.takes_syncs, drive.late_status = 0, late
        assert home(axis, 1.0) == HOMED
        assert '605#4064600000000000' in axis.take()


class TestNotDone:

    @pytest.mark.parametrize('step', [1, 3, 100])
    def test_a_drive_whose_bits_stand_while_it_is_on_its_way(self, step: int) -> None:
        """Bits 12 and 10 of the homing before do not fall at all."""
        axis, drive = meet(homing_timeout=3.0)
        runs_down = drive.runs_down

        def keeps() -> None:
            runs_down()
            if drive.number(0x6060) == 6:
                drive.bits = 0x1400
                place = drive.number(0x6064) + step
                drive.objects[0x6064, 0] = place.to_bytes(4, 'little')
            drive.becomes(drive.state)
        drive.runs_down = keeps     # type: ignore[method-assign]
        drive.takes_syncs = 100_000
        (_, success, text), = home(axis, 8.0)
        assert not success
        assert 'not ended' in text

    def test_one_that_has_still_to_release_its_brake_is_given_its_time(self) -> None:
        """Its bits stand for 0.8 s, then it goes to its switch; control_timeout says how long."""
        axis, drive = meet(control_timeout=4.0)
        runs_down, syncs = drive.runs_down, []

        def waits() -> None:
            if drive.left and len(syncs) < 80:
                syncs.append(0)
                drive.bits = 0x1400
                drive.becomes(drive.state)
            else:
                if drive.left:
                    drive.bits = 0
                runs_down()
        drive.runs_down = waits     # type: ignore[method-assign]
        assert home(axis, 1.0) == []
        axis.live(0.6)
        assert axis.talk.control_outcomes() == HOMED
        assert drive.broken_off == 0


@pytest.mark.parametrize(('mode', 'number'), [('csp', 8), ('pp', 1), ('ip', 7)])
@pytest.mark.parametrize('late', [0, 1, 2, 3])
def test_a_position_that_comes_late_is_not_gone_back_to(mode: str, number: int, late: int) -> None:
    """No jump by 30,000 increments when the mode is changed back."""
    axis, drive = meet(mode)
    drive.late_position = late
    assert home(axis, 1.0) == HOMED
    assert set(targets(axis, number)) == {7}


@pytest.mark.parametrize('dither', [1, 9])
def test_an_encoder_that_dithers_costs_no_homing(dither: int) -> None:
    axis, drive = meet()
    runs_down, syncs = drive.runs_down, [0]

    def dithers() -> None:
        runs_down()
        syncs[0] += 1
        if not drive.left:
            drive.objects[0x6064, 0] = (20 + dither * (syncs[0] % 2)).to_bytes(4, 'little')
    drive.runs_down = dithers   # type: ignore[method-assign]
    for fails in (False, True):
        drive.fails = fails
        (_, success, _), = home(axis, 2.0)
        assert success is not fails
        assert drive.state == drive.ENABLED
        assert set(targets(axis, 8)) <= {20, 20 + dither}


@pytest.mark.parametrize('mode', ['csp', 'pp'])
@pytest.mark.parametrize('late', [0, 1])
@pytest.mark.parametrize('phase', [0, 1, 2])
def test_a_stepper_with_a_state_machine_of_30_ms_at_a_period_of_20(
        mode: str, late: int, phase: int) -> None:
    """Also where TPDOs are built before the RPDO of the same SYNC acts, as Lely does."""
    axis, drive = meet(mode, kind=StepperServo, period=0.02)
    drive.late_status, drive.waits = late, phase    # type: ignore[attr-defined]
    for _ in range(2):
        drive.before = 0x2000
        assert home(axis, 1.5) == HOMED
    assert (drive.found, drive.broken_off) == (2, 0)
    assert axis.asks(ControlAction.DISABLE)[0][:2] == ('disable', True)
    assert axis.asks(ControlAction.ENABLE) == [('enable', True, 'operation enabled')]


def test_a_slave_of_lely_that_starts_on_bit_2_and_keeps_its_bits() -> None:
    axis, drive = meet(kind=LelyHomingServo)
    assert home(axis, 1.2) == HOMED
    drive.objects[0x6064, 0] = FAR
    assert home(axis, 1.2) == HOMED
    assert (drive.found, drive.broken_off) == (2, 0)
    assert set(targets(axis, 8)) == {7}
