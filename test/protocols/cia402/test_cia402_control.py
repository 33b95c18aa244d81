# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Which control words a drive of CiA 402 is sent, in which state, and what is said of it."""

from typing import Any

from builders import INT16, parameter, write
import pytest
from saying import says
from servo_builders import Axis, ERROR, OBJECTS, TABLE
from servos import LateServo

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import DriveState, Noted
from drive_can_bridge.core.fault_watch import FaultWatch
from drive_can_bridge.core.profile import FaultTable
from drive_can_bridge.protocols.cia402.states import ServoState

ENABLE, DISABLE, QUICK_STOP = (
    ControlAction.ENABLE, ControlAction.DISABLE, ControlAction.QUICK_STOP)


def warnings(axis: Axis) -> list[str]:
    return [note.text for note in axis.talk.events(Noted) if note.warning]


class TestTheWay:

    def test_up_each_step_is_seen_before_the_next_word(self) -> None:
        axis = Axis().online()
        assert axis.session.state is DriveState.DISABLED
        assert axis.asks(ENABLE) == [('enable', True, 'operation enabled')]
        assert axis.words() == ['0700', '0F00']
        assert axis.drive.told[-3:] == [0x06, 0x07, 0x0F]

    def test_a_drive_that_needs_its_time_for_each_step(self) -> None:
        axis = Axis().online()
        control, late = axis.drive._control, list[int]()

        def sluggish(word: int) -> None:
            late.append(word)
            control(late[max(0, len(late) - 4)])
        axis.drive._control = sluggish      # type: ignore[method-assign]
        assert axis.asks(ENABLE, 0.5) == [('enable', True, 'operation enabled')]
        assert axis.words() == ['0700', '0F00']

    @pytest.mark.parametrize(('option', 'words'), [
        ('disable_operation', ['0700', '0600']), ('shutdown', ['0600']),
        ('disable_voltage', ['0000'])])
    def test_down(self, option: str, words: list[str]) -> None:
        axis = Axis(disable_word=option).enabled()
        (_, success, _), = axis.asks(DISABLE)
        assert success
        assert axis.words() == words
        assert axis.drive.state in (axis.drive.READY, axis.drive.OFF)

    def test_up_with_disable_voltage_goes_by_shutdown_too(self) -> None:
        axis = Axis(disable_word='disable_voltage').online()
        assert axis.asks(ENABLE) == [('enable', True, 'operation enabled')]
        assert axis.words() == ['0600', '0700', '0F00']

    def test_vl_with_its_ramp_bits_and_without(self) -> None:
        axis = Axis('vl').online()
        axis.asks(ENABLE)
        assert axis.words() == ['0700', '7F00']
        axis = Axis('vl', ramp_bits=False).online()
        axis.asks(ENABLE)
        assert axis.words() == ['0700', '0F00']

    def test_ip_interpolates_once_it_is_enabled(self) -> None:
        axis = Axis('ip').online()
        axis.asks(ENABLE)
        log = [text for text in axis.take() if text.startswith('205#')]
        first = next(text for text in log if text.startswith('205#1F00'))
        assert first == '205#1F00E8030000'      # with the latched position
        assert log.index(first) > log.index('205#0F00E8030000')
        axis.asks(DISABLE)
        assert axis.words() == ['0700', '0600']

    def test_disabled_right_behind_the_first_enable_word(self) -> None:
        """It counts as enabled, whatever the status on its way says."""
        axis = Axis().online()
        axis.deliver(axis.talk.asks(ENABLE, axis.now))
        while '205#0F0000000000' not in axis.take():
            axis.live(0.001)
        axis.mute = True
        axis.asks(DISABLE, 0.015)
        assert axis.words() == ['0700']


class TestWhatKeepsItFromEnabling:

    def test_safe_torque_off_at_boot_is_online_and_says_why(self) -> None:
        axis = Axis()
        axis.drive.powered = False
        axis.drive.becomes(axis.drive.OFF)
        axis.drive.objects[0x603F, 0] = b'\x10\x33'
        axis.online()
        assert axis.session.state is DriveState.DISABLED
        axis.says('085#1033010000000000')
        (_, success, why), = axis.asks(ENABLE, 3.0)
        assert not success
        for part in ('stuck in state switch on disabled', '0240h', '3310h', 'voltage is disabled',
                     'emergency'):
            assert part in why, part
        axis.drive.powered = True
        assert axis.asks(ENABLE) == [('enable', True, 'operation enabled')]

    def test_a_mode_that_6061h_does_not_show_is_no_enable(self) -> None:
        axis = Axis()
        axis.online()
        axis.drive.objects[0x6061, 0] = b'\1'
        assert axis.asks(ENABLE, 0.5) == []
        axis.commands(0.0, 100.0)
        axis.live(0.1)
        assert not any(text.startswith('205#0F00') and text != '205#0F0000000000'
                       for text in axis.take())
        axis.live(2.0)
        (_, success, why), = axis.talk.control_outcomes()
        assert not success
        told = says('word_sent_last', parts=[
            says('word_sent_last', word=0x000F),
            says('mode_differs', mode='csv', number=9, shown=1)])
        assert why == says('stuck', remarks=[says('word_not_followed', word=0x000F), told])
        assert axis.drive.state == axis.drive.READY

    def test_a_mode_that_shows_only_when_enabled(self) -> None:
        axis = Axis()
        axis.online()
        axis.drive.objects[0x6061, 0] = b'\0'
        assert axis.asks(ENABLE, 0.2) == []
        axis.drive.objects[0x6061, 0] = b'\x09'
        axis.live(0.1)
        assert axis.talk.control_outcomes() == [('enable', True, 'operation enabled')]

    def test_no_6061h_is_told_once(self) -> None:
        axis = Axis()
        del axis.drive.objects[0x6061, 0]
        axis.online()
        for _ in range(2):
            assert axis.asks(ENABLE) == [('enable', True, 'operation enabled')]
            axis.asks(DISABLE)
        assert warnings(axis).count(says('mode_not_shown')) == 1

    def test_a_fault_by_the_missed_bridge(self) -> None:
        axis = Axis().online()
        axis.drive.becomes(axis.drive.FAULT)
        axis.says('085#3081110000000000')
        axis.live(0.1)
        assert axis.session.services.control_refusal(ENABLE) == says('bridge_missed')
        assert axis.asks(ControlAction.RESET_FAULT) == [
            ('reset_fault', True, ServoState.READY_TO_SWITCH_ON.value)]
        assert axis.asks(ENABLE) == [('enable', True, 'operation enabled')]


    def test_a_reset_is_a_rising_edge_of_three_cycles(self) -> None:
        """Also of a drive that has lost its fault by the first of them."""
        axis = Axis().online()
        axis.drive.becomes(axis.drive.FAULT)
        axis.live(0.1)
        assert '8000' not in axis.words()
        axis.asks(ControlAction.RESET_FAULT)
        words = [text[4:8] for text in axis.take() if text.startswith('205#')]
        assert words[:3] == ['8000'] * 3
        assert set(words[3:]) == {'0600'}

    def test_one_that_faulted_while_there_was_no_bridge(self) -> None:
        axis = Axis(objects={(0x603F, 0): b'\x30\x81'}, table=(*TABLE, ERROR))
        axis.session.fault_watch = FaultWatch(axis.session, FaultTable('error', (), None))
        axis.drive.becomes(axis.drive.FAULT)
        axis.online()
        assert axis.session.services.control_refusal(ENABLE) == says('bridge_missed')


class TestQuickStop:

    def test_one_that_ends_by_itself_keeps_its_word_until_it_has(self) -> None:
        axis = Axis().enabled()
        axis.drive.braking = 20
        assert axis.asks(QUICK_STOP, 0.15) == []
        assert axis.words() == ['0200']
        axis.live(0.1)
        assert axis.words() == ['0200', '0600']
        assert [(success, message) for _, success, message in axis.talk.control_outcomes()] == [
            (True, ServoState.SWITCH_ON_DISABLED.value)]

    def test_one_that_takes_longer_than_people_wait(self) -> None:
        axis = Axis(control_timeout=0.5).enabled()
        axis.drive.braking = 100
        (_, success, why), = axis.asks(QUICK_STOP, 0.7)
        assert not success
        assert 'still braking' in why
        axis.live(0.4)
        assert axis.words() == ['0200', '0600']

    def test_one_that_does_not_obey_it_is_disabled_and_not_said_to_brake(self) -> None:
        axis = Axis(control_timeout=0.5).enabled()
        control = axis.drive._control
        axis.drive._control = (     # type: ignore[method-assign]
            lambda word: control(0x0F if word == 0x02 else word))
        (_, success, why), = axis.asks(QUICK_STOP, 0.6)
        assert (success, why) == (False, says('stuck', remarks=[
            says('word_not_followed', word=0x02), says('now_disable')]))
        assert axis.words() == ['0200', '0700', '0600']

    @pytest.mark.parametrize('by_bit', [True, False])
    def test_one_that_holds(self, by_bit: bool) -> None:
        axis = Axis(objects={(0x605A, 0): b'\x06\0', (0x606C, 0): b'\x10\0\0\0'}).enabled()
        axis.drive.braking = 20
        assert axis.asks(QUICK_STOP, 0.15) == []
        assert axis.session.control.holds == ''
        if by_bit:
            axis.drive.objects[0x6041, 0] = b'\x07\x06'
        else:
            axis.drive.objects[0x606C, 0] = bytes(4)
            axis.live(0.45)
            assert axis.talk.control_outcomes() == []
        axis.live(0.1)
        assert axis.talk.control_outcomes() == [
            ('quick_stop', True,
             says('quick_stop_holds', state=ServoState.QUICK_STOP_ACTIVE.value))]
        axis.live(5.0)
        assert axis.words() == ['0200']
        assert axis.session.control.holds == says(
            'quick_stop_holds', state=ServoState.QUICK_STOP_ACTIVE.value)
        assert axis.asks(ENABLE) == [('enable', True, 'operation enabled')]
        assert axis.words() == ['0000', '0600', '0700', '0F00']

    def test_one_that_holds_and_is_disabled(self) -> None:
        axis = Axis(objects={(0x605A, 0): b'\x06\0'}).enabled()
        assert [success for _, success, _ in axis.asks(QUICK_STOP, 0.6)] == [True]
        assert [success for _, success, _ in axis.asks(DISABLE)] == [True]
        assert axis.words() == ['0200', '0000', '0600']

    @pytest.mark.parametrize('heard', [True, False])
    def test_one_that_users_have_made_hold(self, heard: bool) -> None:
        option = parameter('quick_stop_option', None, index=0x605A, type=INT16)
        axis = Axis(table=(*TABLE, option), control_timeout=0.7, parameter_timeout=0.05).enabled()
        axis.mute = not heard
        axis.deliver(axis.talk.submits(write((option, 6)), axis.now))
        axis.mute = False
        axis.live(0.2)
        assert 'then holds' in axis.session.facts()['stops_by']
        assert axis.asks(QUICK_STOP, 0.6) == [
            ('quick_stop', True,
             says('quick_stop_holds', state=ServoState.QUICK_STOP_ACTIVE.value))]
        axis.take()
        assert axis.asks(ENABLE) == [('enable', True, 'operation enabled')]
        assert axis.words() == ['0000', '0600', '0700', '0F00']

    def test_one_that_is_silent_before_it_has_told_everything_again(self) -> None:
        option = parameter('quick_stop_option', None, index=0x605A, type=INT16)
        axis = Axis(table=(*TABLE, option), control_timeout=0.7, parameter_timeout=0.05).enabled()
        axis.drive.instead = {'405b6000': ''}
        axis.deliver(axis.talk.submits(write((option, 6)), axis.now))
        axis.live(0.5)
        assert axis.asks(QUICK_STOP, 0.6) == [
            ('quick_stop', True,
             says('quick_stop_holds', state=ServoState.QUICK_STOP_ACTIVE.value))]

    def test_an_old_status_is_none_behind_a_quick_stop(self) -> None:
        """The mode shows in 6061h when 0002h has left, and no status behind that has come."""
        axis = Axis(disable_word='disable_voltage', missed_limit=100).online()
        axis.drive.objects[0x6061, 0] = b'\0'
        assert axis.asks(ENABLE) == []
        axis.drive.responses = lambda *kinds: []    # type: ignore[method-assign]
        axis.asks(QUICK_STOP, 0.015)
        assert axis.words()[-1] == '0200'
        axis.drive.objects[0x6061, 0] = b'\x09'
        while '605#4061600000000000' not in axis.take():
            axis.live(0.001)
        axis.asks(DISABLE, 0.05)
        assert axis.words() == ['0200']

    def test_a_disable_meanwhile_goes_on_with_the_quick_stop(self) -> None:
        axis = Axis().enabled()
        axis.drive.braking = 30
        axis.asks(QUICK_STOP, 0.02)
        axis.asks(DISABLE, 0.15)
        assert axis.words() == ['0200']
        axis.live(0.3)
        assert axis.words() == ['0200', '0600']

    def test_nothing_else_goes_out_until_a_status_behind_it_was_seen(self) -> None:
        axis = Axis().enabled()
        axis.mute = True
        axis.asks(QUICK_STOP, 0.0105)
        assert axis.words()[-1] == '0200'
        axis.deliver(axis.talk.asks(DISABLE, axis.now))
        axis.live(0.025)
        assert axis.words() == ['0200']

    def test_of_a_drive_that_is_not_enabled(self) -> None:
        axis = Axis().online()
        assert axis.asks(QUICK_STOP) == [('quick_stop', True, ServoState.READY_TO_SWITCH_ON.value)]
        assert axis.words() == ['0600']

    def test_one_that_the_drive_began_by_itself(self) -> None:
        axis = Axis().enabled()
        axis.drive.braking = 20
        axis.drive.becomes(axis.drive.QUICK_STOP)
        axis.live(0.15)
        assert axis.words() == ['0F00', '0200']
        axis.live(0.3)
        assert axis.words() == ['0200', '0600']
        assert axis.session.state is DriveState.DISABLED

    def test_one_that_holds_at_the_end_of_the_bridge(self) -> None:
        axis = Axis(objects={(0x605A, 0): b'\x06\0', (0x606C, 0): b'\x10\0\0\0'}).enabled()
        axis.drive.braking = 20
        axis.asks(QUICK_STOP, 0.05)
        axis.deliver(axis.talk.deactivate(axis.now))
        axis.live(0.3)
        assert axis.words() == ['0F00', '0200'][1:]
        axis.drive.objects[0x606C, 0] = bytes(4)
        axis.live(0.8)
        assert axis.words()[:3] == ['0200', '0000', '0600']
        assert axis.session.stopped

    def test_one_that_holds_and_says_nothing_of_its_speed_is_not_asked_for_ever(self) -> None:
        axis = Axis(objects={(0x605A, 0): b'\x06\0'}).enabled()
        del axis.drive.objects[0x606C, 0]
        axis.drive.braking = 20
        axis.asks(QUICK_STOP, 0.5)
        assert axis.take().count('605#406C600000000000') == 1


#: what is answered where nothing says that it stands
UNTOLD = says('state_reached', parts=[says('state_reached'), says('nothing_says_standing')])


class TestOneThatHoldsAndDoesNotTellWhetherItStands:
    """No 606Ch, 6044h, 6064h, bit 10 never: for users a time stands for it, and nobody else."""

    @staticmethod
    def braking(since: float) -> Axis:
        axis = Axis(objects={(0x605A, 0): b'\x06\0'}, control_timeout=0.5, response=()).enabled()
        for place in (0x606C, 0), (0x6064, 0):
            del axis.drive.objects[place]
        axis.drive.becomes(axis.drive.QUICK_STOP)
        axis.live(since)
        assert axis.words()[-1] == '0200'
        return axis

    @pytest.mark.parametrize('since', [0.6, 5.0])
    def test_it_is_disabled_and_enabled_behind_control_timeout(self, since: float) -> None:
        axis = self.braking(since)
        assert axis.asks(DISABLE) == [('disable', True, UNTOLD)]
        assert axis.words() == ['0000', '0600']
        assert axis.asks(DISABLE) == [('disable', True, ServoState.READY_TO_SWITCH_ON.value)]
        axis = self.braking(since)
        assert axis.asks(ENABLE) == [('enable', True, UNTOLD)]
        assert axis.words() == ['0000', '0600', '0700', '0F00']

    def test_not_before(self) -> None:
        axis = self.braking(0.2)
        assert axis.asks(DISABLE, 0.25) == []
        assert axis.words() == ['0200']
        axis.live(0.2)
        assert [success for _, success, _ in axis.talk.control_outcomes()] == [True]
        assert axis.words() == ['0200', '0000', '0600']

    def test_the_time_counts_from_each_quick_stop(self) -> None:
        axis = self.braking(5.0)
        axis.asks(ENABLE)
        for _ in range(2):
            axis.asks(QUICK_STOP, 0.3)
            axis.take()
            axis.asks(DISABLE, 0.15)
            assert axis.words() == ['0200']
            axis.live(0.2)
            assert axis.words() == ['0200', '0000', '0600']
            assert axis.talk.control_outcomes()[-1] == ('disable', True, UNTOLD)
            assert axis.asks(ENABLE) == [('enable', True, ServoState.OPERATION_ENABLED.value)]

    def test_a_quick_stop_is_answered_as_holding_when_it_is_asked_for_again(self) -> None:
        axis = self.braking(0.6)
        axis.asks(ENABLE)
        axis.take()
        (_, success, why), = axis.asks(QUICK_STOP, 0.6)
        assert not success
        assert 'still braking' in why
        assert axis.asks(QUICK_STOP) == [('quick_stop', True, says('quick_stop_holds', parts=[
            says('quick_stop_holds'), says('nothing_says_standing')]))]
        axis.live(5.0)
        assert axis.words() == ['0200']
        assert axis.asks(DISABLE) == [('disable', True, UNTOLD)]

    def test_the_end_of_the_bridge_waits_for_no_time(self) -> None:
        axis = self.braking(5.0)
        axis.ends(5.0)
        assert axis.words() == ['0200']
        assert any(note.danger for note in axis.talk.events(Noted))


@pytest.mark.parametrize('late', [1, 2, 3])
class TestAStatusThatIsLate:
    """By so many cycles: a state machine that is slower than the period, or a filter."""

    @staticmethod
    def meet(late: int, **options: Any) -> tuple[Axis, LateServo]:
        axis = Axis(**options)
        drive = axis.drive = LateServo(5, OBJECTS)
        drive.late_status = late
        axis.online()
        axis.drive.told.clear()
        return axis, drive

    @staticmethod
    def first_enable_word(axis: Axis) -> None:
        axis.deliver(axis.talk.asks(ENABLE, axis.now))
        while not any(text.startswith('205#0F00') for text in axis.take()):
            axis.live(0.001)

    def test_a_disable_right_behind_the_enable_word(self, late: int) -> None:
        """
        The drive is enabled when it comes: it is disabled by 0007h, and 0006h may let it coast.

        It is not called disabled by a status of before, either.
        """
        axis, drive = self.meet(late)
        self.first_enable_word(axis)
        axis.deliver(axis.talk.asks(DISABLE, axis.now))
        while ('disable', True) not in [each[:2] for each in axis.talk.control_outcomes()]:
            axis.live(0.001)
        assert drive.state in (drive.ON, drive.READY)
        axis.live(0.1)
        assert drive.told[-3:] == [0x0F, 0x07, 0x06]

    def test_a_quick_stop_and_a_disable_right_behind_the_enable_word(self, late: int) -> None:
        axis, drive = self.meet(late, disable_word='disable_voltage')
        drive.braking = 40
        self.first_enable_word(axis)
        axis.deliver(axis.talk.asks(QUICK_STOP, axis.now))
        axis.live(0.02)
        axis.asks(DISABLE, 0.2)
        assert drive.told[-1] == 0x02
        assert drive.state == drive.QUICK_STOP
        axis.live(0.5)
        assert drive.told[-1] == 0x00
        assert drive.cut_short == 0

    def test_a_disable_while_the_status_says_enabled_behind_a_quick_stop(self, late: int) -> None:
        axis, drive = self.meet(late, disable_word='disable_voltage')
        drive.braking = 40
        assert axis.asks(ENABLE) == [('enable', True, 'operation enabled')]
        axis.deliver(axis.talk.asks(QUICK_STOP, axis.now))
        axis.live(0.025)
        axis.asks(DISABLE, 0.2)
        assert drive.told[-1] == 0x02
        assert drive.cut_short == 0

    def test_a_fault_that_is_reset_is_gone_before_anything_is_said(self, late: int) -> None:
        axis, drive = self.meet(late)
        drive.becomes(drive.FAULT)
        axis.live(0.1)
        (_, success, _), = axis.asks(ControlAction.RESET_FAULT)
        assert success and drive.state != drive.FAULT
        assert axis.asks(ENABLE) == [('enable', True, 'operation enabled')]

    def test_the_end_right_behind_the_enable_word(self, late: int) -> None:
        axis, drive = self.meet(late)
        self.first_enable_word(axis)
        axis.ends(2.0)
        assert drive.told[-3:] == [0x0F, 0x07, 0x06]


class TestOneThatFallsOutBeforeItsEnableIsConfirmed:
    """Nothing but a new request starts it: section 4 of the contract, "by itself"."""

    @staticmethod
    def fails(axis: Axis, status: int) -> None:
        (_, success, why), = axis.talk.control_outcomes()
        assert not success
        assert why == says('dropped_out', status=says('status_word', raw=status))
        assert axis.session.state is DriveState.DISABLED

    @pytest.mark.parametrize(('state', 'status', 'words'), [
        (0x07, 0x0217, ['0F00', '0200', '0600']), (0x40, 0x0250, ['0F00', '0700', '0600'])])
    def test_one_that_was_seen_enabled(self, state: int, status: int, words: list[str]) -> None:
        axis = Axis().online()
        axis.drive.objects[0x6061, 0] = b'\0'      # so that it is enabled, and not confirmed
        axis.drive.braking = 20
        axis.deliver(axis.talk.asks(ENABLE, axis.now))
        axis.live(0.2)
        assert axis.talk.control_outcomes() == []
        assert axis.words()[-1] == '0F00'
        axis.drive.becomes(state)
        axis.live(0.1)
        self.fails(axis, status)
        axis.drive.objects[0x6061, 0] = b'\x09'
        axis.live(0.5)
        assert axis.words() == words

    def test_one_that_was_enabled_between_two_looks(self) -> None:
        """A limit switch begins the quick stop at once."""
        axis = Axis().online()
        control = axis.drive._control

        def limited(word: int) -> None:
            control(word)
            if word == 0x0F and axis.drive.state == axis.drive.ENABLED:
                axis.drive.braking = 20
                axis.drive.becomes(axis.drive.QUICK_STOP)
        axis.drive._control = limited       # type: ignore[method-assign]
        axis.deliver(axis.talk.asks(ENABLE, axis.now))
        axis.live(0.6)
        assert axis.words() == ['0700', '0F00', '0200', '0600']
        self.fails(axis, 0x0217)

    def test_one_that_interpolates_and_was_seen_enabled_once(self) -> None:
        """The sample that shows it enabled changes the word, too."""
        axis = Axis('ip').online()
        axis.drive.objects[0x6061, 0] = b'\0'
        control = axis.drive._control

        def cut_off(word: int) -> None:
            if word == 0x1F:
                axis.drive.becomes(axis.drive.OFF)
            else:
                control(word)
        axis.drive._control = cut_off       # type: ignore[method-assign]
        axis.deliver(axis.talk.asks(ENABLE, axis.now))
        axis.live(0.3)
        assert axis.words() == ['0700', '0F00', '1F00', '0700', '0600']
        self.fails(axis, 0x0250)


def test_that_the_word_stays_is_said_once() -> None:
    axis = Axis(control_timeout=0.5).enabled()
    axis.drive.braking = 10_000
    axis.drive.objects[0x606C, 0] = b'\1\0\0\0'
    (_, success, why), = axis.asks(ControlAction.QUICK_STOP, 0.8)
    assert not success and why.count('the word stays') == 1
