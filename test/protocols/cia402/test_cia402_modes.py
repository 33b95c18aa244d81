# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Targets that are handed over (pp), and homing."""

from dataclasses import replace
from typing import Any

from drives import ServoDrive
from extent import some
import pytest
from saying import says
from servo_builders import Axis, ERROR, OBJECTS, POSITION, TABLE, TARGET
from servos import ProfileServo

from drive_can_bridge.core import sentences
from drive_can_bridge.core.control import ControlAction, ControlRequest
from drive_can_bridge.core.events import DriveState, Noted
from drive_can_bridge.core.fault_watch import FaultWatch
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.profile import FaultTable
from drive_can_bridge.core.setpoints import CommandOutcome
from drive_can_bridge.protocols.cia402.states import ServoState

#: how far it is with homing while it moves
AWAY = 'on its way'
UNREAD = says('number_unread', reason=says('no_answer_briefly'))


class PositionDrive(ServoDrive):
    """
    Takes a target with the rising edge of bit 4, and homes in mode 6 with it.

    :ivar targets: those that it took.
    :ivar homing: SYNCs until it has found its reference; -1: never; -2: with an error.
    """

    def __init__(self, node: int, objects: dict[tuple[int, int], bytes] | None = None) -> None:
        super().__init__(node, objects)
        self.targets: list[int] = []
        self.homing = 5
        self.found = 0
        self._left = 0
        self._before = 0

    def _control(self, word: int) -> None:
        super()._control(word)
        edge, self._before = word & ~self._before, word
        if self.state == self.ENABLED and self.number(0x6060) == 1:
            if edge & 0x10 and not self.bits & 0x1000:
                self.targets.append(self.number(0x607A))
            self.bits = 0x1000 if word & 0x10 else 0
        elif self.number(0x6060) == 6:
            if edge & 0x10:
                self.bits, self._left = 0, self.homing
            elif not word & 0x10:
                self._left = 0
        else:
            self.bits = 0
        self.becomes(self.state)

    bits = 0

    def becomes(self, state: int) -> None:
        super().becomes(state)
        content = int.from_bytes(self.objects[0x6041, 0], 'little') | self.bits
        self.objects[0x6041, 0] = content.to_bytes(2, 'little')

    def runs_down(self) -> None:
        super().runs_down()
        if self._left == -2:
            self.bits = 0x2000
        elif self._left > 0:
            self._left -= 1
            if not self._left:
                self.found += 1
                self.bits = 0x1400
                self.objects[0x6064, 0] = (7).to_bytes(4, 'little')
        self.becomes(self.state)


def meet(mode: str = 'pp', **options: Any) -> tuple[Axis, PositionDrive]:
    axis = Axis(mode, **options)
    drive = axis.drive = PositionDrive(5, OBJECTS)
    axis.enabled()
    return axis, drive


def unacknowledged(axis: Axis) -> list[str]:
    return [note.text for note in axis.talk.events(Noted)
            if note.text.code == 'target_not_acknowledged']


class TestHandover:

    def test_one_after_the_other_and_the_newest_wins(self) -> None:
        axis, drive = meet()
        assert drive.targets == []
        axis.commands(1000.0, 2000.0)
        axis.live(0.03)
        assert drive.targets == [2000]
        axis.commands(3000.0, 4000.0, 5000.0)
        axis.live(0.06)
        assert drive.targets == [2000, 5000]
        assert axis.words() == ['0F00', '3F00', '0F00', '3F00', '0F00']

    def test_a_target_whose_edge_was_lost_is_handed_over_when_it_is_the_newest_again(self) -> None:
        axis, drive = meet()
        takes, lost = drive.takes, []

        def loses(sent: Frame) -> list[Frame]:
            if sent.identifier == 0x205 and sent.data[0] == 0x3F and not lost:
                lost.append(sent)
                return []
            return takes(sent)
        drive.takes = loses     # type: ignore[method-assign]
        axis.commands(1000.0, 2000.0)
        while not lost:
            axis.live(0.005)
        axis.commands(3000.0)
        while not drive.targets:
            axis.live(0.005)
        axis.commands(2000.0)
        axis.live(0.1)
        assert [text[8:] for text in axis.take() if text.startswith('205#3F')] == [
            'D0070000', 'B80B0000', 'D0070000']
        assert len(drive.targets) == 2, 'bit 4 fell between them'

    def test_a_drive_that_acknowledges_late(self) -> None:
        axis, drive = meet()
        seen = drive.becomes
        drive.becomes = lambda state: None      # type: ignore[method-assign]
        axis.commands(1000.0, 2000.0)
        axis.live(0.05)
        axis.commands(3000.0)
        axis.live(0.05)
        assert axis.words() == ['0F00', '3F00']
        drive.becomes = seen    # type: ignore[method-assign]
        drive.becomes(drive.state)
        axis.live(0.1)
        assert axis.words() == ['3F00', '0F00', '3F00', '0F00']
        assert drive.targets == [2000, 3000]

    @pytest.mark.parametrize('looks_each', [1, 2, 3])
    @pytest.mark.parametrize('late', [0, 1, 2, 3])
    def test_bits_that_are_late_acknowledge_no_later_target(
            self, late: int, looks_each: int) -> None:
        """Of an edge that a halt has cut off: the next target is not lost."""
        axis = Axis('pp', command_timeout=0.0)
        drive = axis.drive = ProfileServo(5, OBJECTS)
        drive.late_status = late
        axis.enabled()
        drive.looks_each = looks_each
        for place in range(5):
            axis.commands(1000.0, 2000.0)
            axis.live(0.011)
            axis.session.setpoints.disarm()
            axis.live(0.011)
            axis.commands(float(axis.session.setpoints.items[0].neutral), 3000.0 + place)
            axis.live(0.2)
            assert drive.targets[-1] == 3000 + place
            assert drive.number(0x607A) == 3000 + place
            falls = [word for word in axis.words() if word in ('3F00', '0F00')]
            assert falls[-2:] == ['3F00', '0F00']
            axis.session.setpoints.disarm()
            axis.live(0.1)
            drive.objects[0x6064, 0] = (1000).to_bytes(4, 'little')
            axis.live(0.1)

    def test_one_that_never_acknowledges_is_told_once(self) -> None:
        axis, drive = meet(control_timeout=0.5, command_timeout=0.0)
        drive.becomes = lambda state: None      # type: ignore[method-assign]
        axis.commands(1000.0, 2000.0)
        axis.live(0.4)
        assert unacknowledged(axis) == []
        axis.live(2.0)
        assert unacknowledged(axis) == [
            says('target_not_acknowledged', timeout=0.5, expected=1)]
        axis.commands(3000.0)
        axis.live(2.0)
        assert unacknowledged(axis) == []

    def test_one_that_stays_acknowledged_is_told(self) -> None:
        axis, drive = meet(control_timeout=0.5, command_timeout=0.0)
        axis.commands(1000.0, 2000.0)
        axis.live(0.02)
        drive.becomes = lambda state: None      # type: ignore[method-assign]
        axis.live(2.0)
        assert unacknowledged(axis) == []       # nothing waits for it
        axis.commands(3000.0)
        axis.live(0.6)
        assert unacknowledged(axis) == [
            says('target_not_acknowledged', timeout=0.5, expected=0)]
        assert drive.targets == [2000]

    def test_halted_when_commands_cease_until_it_is_armed_again(self) -> None:
        axis, drive = meet()
        axis.commands(1000.0, 2000.0)
        axis.live(0.4)
        axis.words()
        axis.live(0.2)
        assert axis.words() == ['0F00', '0F01']
        drive.objects[0x6064, 0] = (1500).to_bytes(4, 'little')     # it runs out
        axis.live(0.05)
        assert axis.take()[-2] == '205#0F01DC050000'
        assert axis.talk.commands(0, 2000.0, axis.now) is CommandOutcome.NOT_ARMED
        assert axis.talk.commands(0, 1505.0, axis.now) is CommandOutcome.ARMED
        axis.live(0.02)
        assert axis.words()[0] in ('0F01', '3F00')
        axis.live(0.03)
        assert drive.targets == [2000, 1505]
        assert axis.drive.told[-3:] == [0x010F, 0x3F, 0x0F]

    @pytest.mark.parametrize('back', [False, True])
    def test_halted_when_commands_cease_however_long_the_period_is(self, back: bool) -> None:
        """Also one on its way back to where it was latched: its setpoint does not change."""
        axis = Axis('pp', period=0.5, command_timeout=0.7)
        drive = axis.drive = PositionDrive(5, OBJECTS)
        axis.start()
        axis.live(3.0)
        assert axis.asks(ControlAction.ENABLE, 3.0) == [('enable', True, 'operation enabled')]
        axis.commands(1000.0)
        for target in [2000.0] * 9 + [1000.0] * 9 * back:
            axis.commands(target)
            axis.live(0.25)
        last = axis.now - 0.25
        assert drive.targets == [2000, 1000] if back else [2000]
        axis.live(2.0)
        halted = next(at for at, text in axis.log if text.startswith('205#0F01'))
        assert 0.7 <= halted - last <= 0.76

    def test_nothing_is_handed_over_that_nobody_commanded(self) -> None:
        axis, drive = meet()
        axis.live(1.0)
        assert drive.targets == []
        axis.asks(ControlAction.DISABLE)
        axis.asks(ControlAction.ENABLE)
        axis.live(1.0)
        assert drive.targets == []

    def test_disabled_on_its_way(self) -> None:
        axis, drive = meet()
        axis.commands(1000.0, 2000.0)
        axis.live(0.02)
        axis.asks(ControlAction.DISABLE)
        assert axis.words()[-2:] == ['0700', '0600']
        axis.asks(ControlAction.ENABLE)
        axis.live(0.5)
        assert drive.targets == [2000]


def home(axis: Axis, wait: float = 0.6) -> list[tuple[str, bool, str]]:
    axis.talk.now = axis.now
    axis.session.services.submit(ControlRequest(ControlAction.HOME), axis.now)
    axis.deliver(axis.talk.sent())
    axis.live(wait)
    return axis.talk.control_outcomes()


@pytest.mark.parametrize(('mode', 'number'), [('csp', 8), ('pp', 1), ('csv', 9), ('ip', 7)])
class TestHoming:

    def test_there_and_back(self, mode: str, number: int) -> None:
        axis, drive = meet(mode, homing=True)
        axis.take()
        assert home(axis) == [('home', True, 'homed')]
        assert drive.found == 1
        sent = axis.take()
        there, back = '605#2F60600006000000', f'605#2F606000{number:02X}000000'
        start = next(place for place, text in enumerate(sent) if text.startswith('205#1F00')
                     and place > sent.index(there))
        assert any(text.startswith('205#0F00') for text in sent[:sent.index(there)])
        assert sent.index('605#4061600000000000') < start
        end = max(place for place, text in enumerate(sent[:sent.index(back)])
                  if text.startswith('205#1F00'))
        assert [text[:8] for text in sent[end:sent.index(back)] if text.startswith('205#')][1:]
        assert drive.state == drive.ENABLED
        assert drive.number(0x6060) == number
        assert axis.session.state is DriveState.NOT_ARMED
        if mode != 'csv':       # latched where it is now
            assert sent[sent.index(back) - 2].endswith('07000000')

    def test_nothing_arms_meanwhile(self, mode: str, number: int) -> None:
        axis, drive = meet(mode, homing=True)
        drive.homing = -1
        home(axis, 0.2)
        assert axis.session.busy == says('homing')
        neutral = axis.session.setpoints.items[0].neutral
        axis.commands(float(neutral))
        assert axis.session.state is DriveState.NOT_ARMED

    def test_what_ends_it(self, mode: str, number: int) -> None:
        axis, drive = meet(mode, homing=True, homing_timeout=1.0)
        drive.homing = -2
        assert home(axis, 1.3) == [('home', False, says('homing_failed'))]
        assert drive.number(0x6060) == number
        drive.homing = -1
        assert home(axis, 1.7) == [('home', False, says(
            'homing_timed_out', timeout=1.0, step=AWAY))]
        assert drive.number(0x6060) == number
        assert drive.state == drive.ENABLED

    def test_a_stop_stops_it(self, mode: str, number: int) -> None:
        axis, drive = meet(mode, homing=True)
        drive.homing = -1
        home(axis, 0.2)
        outcomes = axis.asks(ControlAction.DISABLE, 0.5)
        assert ('home', False, says('homing_stopped', step=AWAY)) in outcomes
        assert ('disable', True, ServoState.READY_TO_SWITCH_ON.value) in outcomes
        assert drive.number(0x6060) == number
        assert axis.session.busy == ''
        assert axis.asks(ControlAction.ENABLE) == [('enable', True, 'operation enabled')]

    @pytest.mark.parametrize('told', ['7305h encoder', UNREAD, ''])
    def test_a_fault_that_stops_it_is_named(self, told: Any, mode: str, number: int) -> None:
        axis, drive = meet(mode, homing=True, table=(*TABLE, ERROR))
        if told:
            axis.session.fault_watch = FaultWatch(
                axis.session, FaultTable('error', ((0x7305, 'encoder'),), None))
        drive.objects[0x603F, 0] = b'\x05\x73'
        takes = drive.takes
        if told is UNREAD:
            drive.takes = lambda sent: [] if str(sent).startswith(  # type: ignore[method-assign]
                '605#403F60') else takes(sent)
        drive.homing = -1
        home(axis, 0.2)
        drive.becomes(drive.FAULT)
        axis.live(2.0)
        (_, success, message), = axis.talk.control_outcomes()
        assert (success, message) == (False, says('fault_while_homing', step=AWAY))
        assert message.fields.get('fault', '') == told     # type: ignore[attr-defined]
        assert drive.number(0x6060) == number

    @pytest.mark.parametrize('phase', some(range(0, 40, 5), 4))
    @pytest.mark.parametrize('step', ['changing to mode 6', 'going back to the mode'])
    def test_so_it_does_while_the_mode_changes(
            self, step: str, phase: int, mode: str, number: int) -> None:
        """6061h goes on to show the mode before."""
        axis, drive = meet(mode, homing=True, control_timeout=1.0)
        back = step == 'going back to the mode'
        shown = {'40616000': f'4F616000{6 if back else number:02X}000000'}
        if not back:
            drive.instead = shown
        home(axis, 0.03)
        if back:
            while drive.number(0x6060) != 6 or not drive.found:
                axis.live(0.001)
            drive.instead = shown
            axis.live(0.05)
        axis.live(0.1 + phase / 1000)
        outcomes = axis.asks(ControlAction.DISABLE, 0.6)
        assert [done for done in outcomes if done[0] == 'home'] == [
            ('home', False, says('homing_stopped', step=step))]

    def test_when_it_cannot_begin(self, mode: str, number: int) -> None:
        axis, _ = meet(mode, homing=True)
        setpoint = axis.session.setpoints.items[0]
        axis.commands(float(setpoint.neutral))
        assert home(axis, 0.01) == [('home', False, says('homing_needs_disarmed'))]
        axis.asks(ControlAction.DISABLE)
        assert home(axis, 0.01) == [('home', False, says('homing_needs_enabled'))]

    def test_attained_bits_of_before_do_not_count(self, mode: str, number: int) -> None:
        axis, drive = meet(mode, homing=True)
        drive.homing = 30
        control = drive._control

        def keeps(word: int) -> None:
            control(word)
            if drive.number(0x6060) == 6 and drive._left == 0:
                drive.bits = 0x1400
                drive.becomes(drive.state)
        drive._control = keeps      # type: ignore[method-assign]
        assert home(axis, 0.2) == []
        axis.live(0.5)
        assert axis.talk.control_outcomes() == [('home', True, 'homed')]
        assert drive.found == 1

    def test_nor_do_they_where_the_start_is_ignored(self, mode: str, number: int) -> None:
        axis, drive = meet(mode, homing=True, homing_timeout=0.5)
        drive.homing, runs_down = -1, drive.runs_down

        def keeps() -> None:
            runs_down()
            drive.bits = 0x1400 if drive.number(0x6060) == 6 else drive.bits
            drive.becomes(drive.state)
        drive.runs_down = keeps     # type: ignore[method-assign]
        assert home(axis, 1.3) == [('home', False, says('homing_timed_out', step=AWAY))]
        assert (drive.state, drive.number(0x6060)) == (drive.ENABLED, number)

    def test_one_that_is_there_at_once_is_so_again(self, mode: str, number: int) -> None:
        """By methods 35 and 37: within the cycle in which bit 4 rose."""
        axis, drive = meet(mode, homing=True)
        drive.homing, control = -1, drive._control

        def at_once(word: int) -> None:
            control(word)
            if drive.number(0x6060) == 6 and word & 0x10:
                drive.bits = 0x1400
                drive.becomes(drive.state)
        drive._control = at_once    # type: ignore[method-assign]
        assert [*home(axis, 0.8), *home(axis, 0.8)] == [('home', True, 'homed')] * 2

    def test_nor_do_they_where_bit_12_falls_late(self, mode: str, number: int) -> None:
        axis, drive = meet(mode, homing=True)
        drive.homing = 30
        runs_down = drive.runs_down

        def keeps() -> None:
            runs_down()
            if drive.number(0x6060) == 6 and (drive._left > 25 or not drive._left):
                drive.bits = 0x1400
            elif drive.number(0x6060) == 6:
                drive.bits = 0
            drive.becomes(drive.state)
        drive.runs_down = keeps     # type: ignore[method-assign]
        assert home(axis, 0.2) == []
        axis.live(0.5)
        assert axis.talk.control_outcomes() == [('home', True, 'homed')]
        assert drive.found == 1


@pytest.mark.parametrize(('mode', 'number'), [('ip', 7), ('vl', 2), ('csp', 8)])
class TestAModeThatIsNotTakenBack:
    """In mode 6 bit 4 of an enable word would start homing, and nobody has asked for that."""

    @staticmethod
    def interrupted(mode: str) -> tuple[Axis, PositionDrive, list[int]]:
        axis, drive = meet(mode, homing=True, control_timeout=0.5, homing_timeout=1.0)
        drive.homing = -1
        home(axis, 0.2)
        drive.fixed[0x6060, 0] = 0x08000022
        axis.talk.events()
        axis.asks(ControlAction.DISABLE, 0.3)
        control, heard = drive._control, list[int]()

        def listens(word: int) -> None:
            if drive.number(0x6060) == 6:
                heard.append(word)
            control(word)
        drive._control = listens    # type: ignore[method-assign]
        return axis, drive, heard

    def test_a_drive_is_not_enabled_before(self, mode: str, number: int) -> None:
        axis, drive, heard = self.interrupted(mode)
        refused = says('mode_refused', mode=number)
        axis.live(2.0)
        assert [note.text for note in axis.talk.events(Noted) if note.warning] == [refused]
        axis.take()
        (_, success, text), = axis.asks(ControlAction.ENABLE, 1.0)
        assert not success
        assert sentences.mode_refused(number) in text
        assert axis.take().count(f'605#2F606000{number:02X}000000') == 1
        drive.fixed.clear()
        axis.live(1.1)
        assert drive.number(0x6060) == number
        assert set(heard) == {0x06, 0x07}
        assert axis.asks(ControlAction.ENABLE) == [('enable', True, 'operation enabled')]
        assert axis.session.busy == ''

    def test_one_that_takes_it_in_time_is_enabled_then(self, mode: str, number: int) -> None:
        axis, drive, heard = self.interrupted(mode)
        axis.live(0.5)
        axis.deliver(axis.talk.asks(ControlAction.ENABLE, axis.now))
        axis.live(0.1)
        drive.fixed.clear()
        axis.live(0.4)
        assert axis.talk.control_outcomes() == [('enable', True, 'operation enabled')]
        assert set(heard) == {0x06, 0x07}

    def test_nor_is_it_when_it_could_not_go_back_by_itself(self, mode: str, number: int) -> None:
        axis, drive = meet(mode, homing=True, control_timeout=0.5)
        drive.fixed[0x6060, 0] = 0

        class Once(dict[tuple[int, int], int]):
            def get(self, place: Any, default: Any = None) -> Any:
                return 0x08000022 if place == (0x6060, 0) and drive.number(
                    0x6060) == 6 and drive.state == drive.ENABLED else 0
        drive.fixed = Once()
        assert home(axis, 1.0) == [('home', False, says('mode_refused', mode=number))]
        assert drive.state == drive.READY
        assert drive.number(0x6060) == number
        assert axis.session.busy == ''
        assert axis.asks(ControlAction.ENABLE) == [('enable', True, 'operation enabled')]

    def test_one_that_does_not_say_its_mode_keeps_nobody_waiting(
            self, mode: str, number: int) -> None:
        axis, drive = meet(mode, homing=True, control_timeout=0.5, homing_timeout=1.0)
        takes = drive.takes
        drive.takes = lambda sent: [] if str(sent).startswith(  # type: ignore[method-assign]
            '605#406160') else takes(sent)
        (_, success, _), = home(axis, 2.5)
        assert not success
        assert drive.number(0x6060) == number


class Moves(PositionDrive):
    """
    Turns while it looks for its reference, and brakes behind that.

    :ivar brakes: SYNCs that it takes; each with two increments.
    """

    brakes = 15

    def runs_down(self) -> None:
        super().runs_down()
        if self.number(0x6060) != 6 or self.state != self.ENABLED:
            return
        if not self._left:
            self.brakes -= 1
        if self.brakes > 0:
            self.objects[0x6064, 0] = (self.number(0x6064) + 2).to_bytes(4, 'little')


@pytest.mark.parametrize('homing', [-1, -2])
class TestHomingThatEndsOnTheWay:

    def meet(self, mode: str, homing: int, **options: Any) -> tuple[Axis, Moves]:
        axis = Axis(mode, homing=True, homing_timeout=0.4, control_timeout=0.5, **options)
        drive = axis.drive = Moves(5, OBJECTS)
        axis.enabled()
        drive.homing = homing
        return axis, drive

    @pytest.mark.parametrize(('mode', 'number'), [('csp', 8), ('ip', 7), ('pp', 1)])
    def test_it_is_latched_where_it_has_come_to_stand(
            self, homing: int, mode: str, number: int) -> None:
        axis, drive = self.meet(mode, homing)
        (_, success, _), = home(axis, 1.5)
        assert not success
        sent, stands = axis.take(), drive.objects[0x6064, 0].hex().upper()
        there = sent.index('605#2F60600006000000')
        back = sent.index(f'605#2F606000{number:02X}000000')
        held = [text[8:16] for text in sent[there:] if text.startswith('205#')]
        assert len(set(held)) > 10, 'it turned'
        assert {text[8:16] for text in sent[back:] if text.startswith('205#')} == {stands}
        assert [text[8:16] for text in sent[:back] if text.startswith('205#')][-1] == stands
        assert drive.state == drive.ENABLED

    def test_a_sample_that_was_cut_short_says_nothing(self, homing: int) -> None:
        axis, drive = self.meet('csp', homing)
        takes, cut = drive.takes, []

        def cuts(sent: Frame) -> list[Frame]:
            answers = takes(sent)
            if drive.number(0x6060) == 6 and not drive._left:
                cut.append(answers)
                return [each._replace(data=each.data[:2]) if each.identifier == 0x185 and len(
                    cut) % 3 else each for each in answers]
            return answers
        drive.takes = cuts      # type: ignore[method-assign]
        (_, success, text), = home(axis, 1.5)
        assert not success
        assert says('homing_moves_on') not in text.fields.get('parts', ())  # type: ignore
        assert len(cut) > 5
        assert drive.state == drive.ENABLED

    @pytest.mark.parametrize(('mode', 'number'), [('csp', 8), ('ip', 7)])
    def test_it_is_disabled_if_it_does_not_stand(
            self, homing: int, mode: str, number: int) -> None:
        axis, drive = self.meet(mode, homing)
        drive.brakes = 1000
        (_, success, text), = home(axis, 3.5)
        assert not success
        assert text.fields['parts'][1] == says('homing_moves_on')  # type: ignore[attr-defined]
        assert drive.state == drive.READY
        assert drive.told[-3:] == [0x0F, 0x07, 0x06]
        sent = axis.take()
        back = sent.index(f'605#2F606000{number:02X}000000')
        assert [text[4:8] for text in sent[:back] if text.startswith('205#')][-1] == '0700'
        assert axis.asks(ControlAction.ENABLE) == [('enable', True, 'operation enabled')]


@pytest.mark.parametrize('period', [0.6, 1.0])
def test_an_axis_is_given_samples_enough_to_be_seen_standing(period: float) -> None:
    axis = Axis('pp', homing=True, period=period, heartbeat_timeout=0.0)
    drive = axis.drive = PositionDrive(5, OBJECTS)
    axis.start()
    axis.live(6 * period)
    assert axis.asks(ControlAction.ENABLE, 7 * period) == [('enable', True, 'operation enabled')]
    drive.homing = -2
    assert home(axis, 16 * period) == [('home', False, says('homing_failed'))]
    assert drive.state == drive.ENABLED
    assert drive.number(0x6060) == 1


class Creeps(PositionDrive):
    """
    Of few steps: it goes one each four SYNCs behind an error in homing, and 606Ch says so.

    :ivar steps: that it goes.
    :ivar noise: increments by which its encoder is off, one way and the other, for ever.
    """

    steps, noise = 12, 0
    syncs = gone = 0

    def runs_down(self) -> None:
        super().runs_down()
        if self.number(0x6060) != 6:
            return
        self.syncs += 1
        self.gone += self.gone < self.steps and not self.syncs % 4
        noise = self.noise if self.syncs % 2 else -self.noise
        self.objects[0x6064, 0] = (1000 + self.gone + noise).to_bytes(4, 'little')
        if (0x606C, 0) in self.objects:
            self.objects[0x606C, 0] = (25 * (self.gone < self.steps) + abs(noise)).to_bytes(
                4, 'little')


class TestWhetherItStands:
    """Behind a homing that failed."""

    def meet(self, tolerance: float, timeout: float = 1.0) -> tuple[Axis, Creeps]:
        target = replace(TARGET, arming_tolerance=tolerance)
        axis = Axis('csp', homing=True, control_timeout=timeout, request=(target,),
                    table=(target, POSITION))
        drive = axis.drive = Creeps(5, OBJECTS)
        axis.enabled()
        drive.homing = -2
        return axis, drive

    @pytest.mark.parametrize(('tolerance', 'told'), [(0.0, True), (0.0, False), (10.0, True)])
    def test_few_steps_are_no_standing(self, tolerance: float, told: bool) -> None:
        axis, drive = self.meet(tolerance)
        if not told:
            del drive.objects[0x606C, 0]
        assert home(axis, 1.5) == [('home', False, says('homing_failed'))]
        assert (drive.gone, drive.number(0x607A)) == (12, 1012)
        assert drive.number(0x6060) == 8

    def test_noise_is_no_motion(self) -> None:
        axis, drive = self.meet(10.0)
        drive.steps, drive.noise = 0, 3
        assert home(axis, 3.0) == [('home', False, says('homing_failed'))]
        assert (drive.state, drive.number(0x6060)) == (drive.ENABLED, 8)

    def test_one_that_never_stands_is_disabled(self) -> None:
        axis, drive = self.meet(0.0)
        drive.steps = 1000
        assert home(axis, 4.0) != []
        assert drive.state == drive.READY

    @pytest.mark.parametrize('found', [5, -2])
    def test_one_that_does_not_tell_where_it_is_is_disabled(self, found: int) -> None:
        axis, drive = self.meet(0.0)
        drive.homing, takes = found, drive.takes

        def cuts(sent: Frame) -> list[Frame]:
            return [each._replace(data=each.data[:2]) if each.identifier == 0x185 and (
                drive.bits or drive.number(0x6060) != 6) else each for each in takes(sent)]
        drive.takes = cuts      # type: ignore[method-assign]
        axis.take()
        (_, success, text), = home(axis, 4.0)
        assert not success
        assert 'would_jump' in (text.code, *(    # type: ignore[attr-defined]
            part.code for part in text.fields.get('parts', ())))    # type: ignore[attr-defined]
        assert drive.state == drive.READY
