# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Whether an axis stands, and what follows: quick stops in which drives stay, found and asked."""

from builders import parameter
import pytest
from saying import says
from servo_builders import Axis, OBJECTS, POSITION, TARGET
from servos import CanopenNodeServo, LelyServo, TurningServo

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import Noted
from drive_can_bridge.protocols.cia402.standstill import Band, Standstill
from drive_can_bridge.protocols.cia402.states import ServoState

ENABLE, DISABLE, QUICK_STOP = (
    ControlAction.ENABLE, ControlAction.DISABLE, ControlAction.QUICK_STOP)
HOLDS = ('quick_stop', True, says('quick_stop_holds', state=ServoState.QUICK_STOP_ACTIVE.value))
STAYING = [LelyServo, CanopenNodeServo]


def meet(kind: type[TurningServo], mode: str = 'csv', **options: object) -> tuple[
        Axis, TurningServo]:
    axis = Axis(mode, **options)    # type: ignore[arg-type]
    drive = axis.drive = kind(5, OBJECTS)
    axis.enabled()
    return axis, drive


class TestDrivesThatStayInQuickStopWhatever605AhSays:

    @pytest.mark.parametrize('kind', STAYING)
    def test_the_answer_is_that_it_holds(self, kind: type[TurningServo]) -> None:
        axis, drive = meet(kind, control_timeout=4.0)
        assert axis.asks(QUICK_STOP, 1.9) == []         # half of control_timeout
        assert axis.asks(QUICK_STOP, 0.6) == [HOLDS, HOLDS]
        axis.live(5.0)
        assert axis.words() == ['0200']
        assert 'brake sinks' in axis.session.control.holds
        assert axis.asks(ENABLE) == [('enable', True, 'operation enabled')]
        assert axis.words() == ['0000', '0600', '0700', '0F00']
        assert drive.cut_short == 0
        assert not [note for note in axis.talk.events(Noted) if note.text.code == 'disregards']

    @pytest.mark.parametrize('action', [ENABLE, DISABLE])
    @pytest.mark.parametrize('kind', STAYING)
    def test_one_that_is_asked_too_early_says_that_it_still_brakes(
            self, kind: type[TurningServo], action: ControlAction) -> None:
        axis, drive = meet(kind, control_timeout=1.0)
        drive.brakes = 300
        axis.asks(QUICK_STOP, 0.3)
        outcomes = axis.asks(action, 1.1)
        (_, success, text), = [each for each in outcomes if each[0] == action.value]
        assert not success
        assert 'still braking' in text
        assert axis.words() == ['0200']
        axis.live(4.0)
        assert axis.asks(action)[-1][1]
        assert drive.cut_short == 0

    @pytest.mark.parametrize('kind', STAYING)
    def test_the_end_goes_on_with_0000h_once_it_stands(self, kind: type[TurningServo]) -> None:
        axis, drive = meet(kind, control_timeout=4.0)
        drive.brakes = 30
        axis.asks(QUICK_STOP, 0.1)
        axis.ends(5.0)
        assert axis.words() == ['0200', '0000', '0600']
        assert drive.cut_short == 0
        assert not [note for note in axis.talk.events(Noted) if note.danger]

    @pytest.mark.parametrize('kind', STAYING)
    def test_so_does_the_next_set_up(self, kind: type[TurningServo]) -> None:
        axis = Axis(control_timeout=1.0)
        drive = axis.drive = kind(5, OBJECTS)
        drive._tell(0x606C, 100)
        drive.becomes(drive.QUICK_STOP)
        drive.braking = 0
        axis.start()
        axis.live(0.15)
        assert '605#2B40600000000000' not in axis.take()
        axis.live(4.0)
        assert '605#2B40600000000000' in axis.take()
        assert axis.session.online
        assert axis.asks(ENABLE) == [('enable', True, 'operation enabled')]

    def test_one_that_is_found_braking_is_waited_for(self) -> None:
        axis = Axis(control_timeout=1.0)
        drive = axis.drive = LelyServo(5, OBJECTS)
        drive.becomes(drive.QUICK_STOP)
        drive.braking = 10_000
        takes = drive.takes

        def turns(sent: object) -> object:
            drive.runs_down()
            return takes(sent)  # type: ignore[arg-type]
        drive.takes = turns     # type: ignore[method-assign, assignment]
        axis.start()
        axis.live(5.0)
        assert '605#2B40600000000000' not in axis.take()
        assert not axis.session.online
        told = [note.text for note in axis.talk.events(Noted)]
        braking = says('found_braking', state=ServoState.QUICK_STOP_ACTIVE.value)
        assert told == [braking, says('may_still_be_running', why=braking)]
        drive.braking = 1
        axis.live(5.0)
        assert axis.session.online
        assert drive.cut_short == 0


def test_one_that_is_lost_right_behind_its_own_quick_stop_goes_on_braking() -> None:
    """It was seen, and 0002h had not left yet: the stop by SDO is no 0000h."""
    axis, drive = meet(TurningServo, disable_word='disable_voltage')
    drive.brakes = 10_000
    drive.becomes(drive.QUICK_STOP)
    axis.take()
    while axis.session.control.state != ServoState.QUICK_STOP_ACTIVE.value:
        axis.live(0.0005)
    axis.deliver(axis.talk.bus_down(axis.now))
    axis.deliver(axis.talk.bus_up(axis.now))
    axis.live(0.5)
    assert '605#2B40600002000000' in axis.take()
    assert drive.cut_short == 0


class TestWhatSaysThatItMoves:
    """605Ah = 6, so that nothing but the axis is waited for."""

    @staticmethod
    def stopped(wait: float, **what: object) -> tuple[Axis, TurningServo, list[object]]:
        axis = Axis('csp', request=(TARGET,), response=(POSITION,))
        drive = axis.drive = TurningServo(5, {**OBJECTS, (0x605A, 0): b'\6\0'})
        axis.enabled()
        for name, value in what.items():
            setattr(drive, name, value)
        return axis, drive, list(axis.asks(QUICK_STOP, wait))

    @pytest.mark.parametrize('dither', [(0, 1), (0, 3, -3, 5), (0, 9)])
    def test_an_encoder_that_dithers_stands(self, dither: tuple[int, ...]) -> None:
        """arming_tolerance is 10 steps."""
        assert self.stopped(0.8, dither=dither)[2] == [HOLDS]

    def test_one_that_dithers_by_more_does_not(self) -> None:
        _, _, (outcome,) = self.stopped(3.0, dither=(0, 12))
        assert outcome[1:] == (False, says('stuck'))    # type: ignore[index]

    @pytest.mark.parametrize('steps', [4, 20])
    def test_one_that_creeps_one_way_does_not(self, steps: int) -> None:
        axis, drive, outcomes = self.stopped(0.3)
        for number in range(120):
            drive.place += not number % steps
            axis.live(0.01)
        assert outcomes == axis.talk.control_outcomes() == []
        axis.live(0.6)
        assert axis.talk.control_outcomes() == [HOLDS]

    def test_a_velocity_that_is_frozen_counts_for_nothing_behind_2_s(self) -> None:
        axis, _, outcomes = self.stopped(1.9, frozen=True)
        assert outcomes == []
        axis.live(0.5)
        assert axis.talk.control_outcomes()[-1:] in ([HOLDS], [('quick_stop', False, says(
            'stuck'))])
        assert axis.asks(QUICK_STOP) == [HOLDS]

    def test_noise_counts_for_nothing_where_the_position_is_alive(self) -> None:
        axis, _, _ = self.stopped(2.8, noise=(3, -2, 5), dither=(0, 1))
        assert axis.asks(QUICK_STOP) == [HOLDS]

    def test_but_not_where_the_position_may_be_frozen_itself(self) -> None:
        axis, _, _ = self.stopped(6.0, noise=(3, -2, 5), speed=0)
        (_, success, _), = axis.asks(QUICK_STOP, 2.1)
        assert not success

    def test_what_606fh_says_is_no_velocity(self) -> None:
        axis = Axis()
        drive = axis.drive = TurningServo(5, {
            **OBJECTS, (0x605A, 0): b'\6\0', (0x606F, 0): b'\5\0'})
        axis.enabled()
        drive.noise = (3, -2, 5)
        assert axis.asks(QUICK_STOP, 0.9) == [HOLDS]

    def test_6044h_says_it_where_there_is_no_606ch(self) -> None:
        axis = Axis(response=())
        drive = axis.drive = TurningServo(5, {
            **OBJECTS, (0x605A, 0): b'\6\0', (0x6044, 0): b'\xFE\xFF'})
        axis.enabled()
        for place in (0x606C, 0), (0x6064, 0):
            del drive.objects[place]
        assert axis.asks(QUICK_STOP, 1.0) == []
        drive.objects[0x6044, 0] = b'\0\0'
        axis.live(0.6)
        assert axis.talk.control_outcomes() == [HOLDS]

    @pytest.mark.parametrize('answer', ['8000000000000008', ''])
    def test_one_that_refuses_or_does_not_answer_says_nothing(self, answer: str) -> None:
        """Nobody is caught in `still braking` by that; 6064h decides alone."""
        axis = Axis(parameter_timeout=0.05)
        drive = axis.drive = TurningServo(5, {**OBJECTS, (0x605A, 0): b'\6\0'})
        axis.enabled()
        drive.instead = {'406c6000': answer and answer[:2] + '6C6000' + answer[8:]}
        assert axis.asks(QUICK_STOP, 1.0) == [HOLDS]

    @pytest.mark.parametrize(('pdos', 'asked'), [([1, 2], False), ([1], True)])
    def test_a_velocity_that_travels_is_not_asked_for(self, pdos: list[int], asked: bool) -> None:
        velocity = parameter('velocity', None, index=0x606C, subindex=0, type=POSITION.type)
        axis = Axis(response=(POSITION, velocity), table=(POSITION, velocity), response_pdos=pdos)
        axis.drive = TurningServo(5, {**OBJECTS, (0x605A, 0): b'\6\0'})
        axis.enabled()
        assert axis.asks(QUICK_STOP, 0.9) == [HOLDS]
        sent = axis.take()
        assert any(text.startswith('605#406C6000') for text in sent) is asked
        assert not any(text.startswith('605#40646000') for text in sent)


class TestBit10:

    @staticmethod
    def braking(option: int, *, alone: bool) -> tuple[Axis, TurningServo]:
        axis = Axis(response=() if alone else (POSITION,), control_timeout=2.0)
        drive = axis.drive = TurningServo(5, {
            **OBJECTS, (0x605A, 0): option.to_bytes(2, 'little')})
        axis.enabled()
        if alone:
            for place in (0x606C, 0), (0x6064, 0):
                del drive.objects[place]
        drive.brakes = 10_000
        return axis, drive

    @staticmethod
    def sets(drive: TurningServo, reached: bool) -> None:
        status = drive.number(0x6041) & ~0x0400 | 0x0400 * reached
        drive.objects[0x6041, 0] = status.to_bytes(2, 'little')

    def test_seen_low_and_then_set_in_five_cycles_it_says_so(self) -> None:
        axis, drive = self.braking(6, alone=False)
        axis.asks(QUICK_STOP, 0.1)
        self.sets(drive, True)
        axis.live(0.035)
        assert axis.talk.control_outcomes() == []
        axis.live(0.03)
        assert axis.talk.control_outcomes() == [HOLDS]

    def test_one_that_was_set_from_the_beginning_does_not(self) -> None:
        axis, drive = self.braking(6, alone=False)
        becomes = drive.becomes

        def stays_set(state: int) -> None:
            becomes(state)
            self.sets(drive, True)
        drive.becomes = stays_set   # type: ignore[method-assign]
        axis.live(0.05)
        assert axis.asks(QUICK_STOP, 1.5) == []
        drive.braking = 1
        axis.live(0.6)
        assert (axis.talk.control_outcomes() + axis.asks(QUICK_STOP))[-1] == HOLDS

    def test_it_counts_for_any_drive_that_has_nothing_else(self) -> None:
        axis, drive = self.braking(2, alone=True)
        axis.asks(QUICK_STOP, 0.1)
        self.sets(drive, True)
        axis.live(0.7)
        assert axis.talk.control_outcomes() == []
        axis.live(0.4)      # half of control_timeout
        assert axis.talk.control_outcomes() == [HOLDS]


class TestBand:

    @staticmethod
    def of(width: float, *places: tuple[float, int]) -> Band:
        band = Band(width)
        for at, place in places:
            band.take(place, at)
        return band

    def test_a_place(self) -> None:
        band = self.of(1.0, (0.0, 5), (0.3, 5), (0.5, 5))
        assert band.stays(0.5)
        assert not band.changed
        assert not self.of(1.0, (0.0, 5), (0.3, 7), (0.5, 7)).stays(0.5)
        assert self.of(1.0, (0.0, 5), (0.3, 7), (0.8, 7)).left == 1

    def test_one_way_only(self) -> None:
        assert not self.of(9.0, (0.0, 5), (0.3, 6), (0.4, 7), (0.5, 7)).stays(0.5)
        assert self.of(9.0, (0.0, 5), (0.3, 6), (0.5, 6)).stays(0.5)
        assert self.of(9.0, (0.0, 5), (0.3, 7), (0.4, 6), (0.5, 7)).stays(0.5)
        assert self.of(9.0, (0.0, 5), (0.3, 7), (0.85, 7)).stays(0.5)

    def test_the_width_is_what_arms_or_a_raw_step(self) -> None:
        for tolerance, width in ((0.0, 1), (10.0, 10)):
            target = parameter(
                'target_position', None, index=0x607A, subindex=0, type=TARGET.type,
                neutral_from='position', arming_tolerance=tolerance)
            axis = Axis('csp', request=(target,), table=(target, POSITION))
            standstill = Standstill(axis.talk.session.configuration)
            for at, place in ((0.0, 0), (0.1, width), (0.2, 0), (0.6, width)):
                standstill.band.take(place, at)
            assert standstill.band.stays(0.5)
            standstill.band.take(width + 1, 0.7)
            assert not standstill.band.stays(0.5)
