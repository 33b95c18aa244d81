# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Whatever was told to run is told to stop: by cycles, by SDO, at the end and after losses."""

from collections.abc import Callable

from builders import parameter, read, RO
from conversation import Conversation
import pytest
from saying import says
from servo_builders import Axis, servo, TABLE
from stops import UNANSWERED_CYCLES

from drive_can_bridge.core.events import DriveState, Noted, StationLost
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import ParameterType
from drive_can_bridge.protocols.canopen.sdo import describe

WATCH_OFF = '605#2316100100000000'
DISABLE_BY_SDO = '605#2B40600007000000'
NAME = parameter('device_name', None, index=0x1008, type=ParameterType.UINT32, access=RO)


def running(**options: object) -> Axis:
    axis = Axis(**options).enabled()    # type: ignore[arg-type]
    axis.commands(0.0, 100.0)
    axis.live(0.05)
    assert axis.drive.objects[0x60FF, 0] == (1000).to_bytes(4, 'little')
    axis.take()
    axis.talk.events()
    return axis


def drive_without(axis: Axis, identifier: int) -> Callable[[Frame], list[Frame]]:
    """Return a drive that takes no notice of some frames."""
    takes = axis.drive.takes
    return lambda sent: [] if sent.identifier == identifier else takes(sent)


def end(axis: Axis) -> list[str]:
    """End the activation; return the frames from then on."""
    axis.take()
    axis.ends(5.0)
    return axis.take()


def by_sdo(axis: Axis) -> list[str]:
    return [text for text in axis.take() if text.startswith('605#')]


def doubts(axis: Axis) -> list[str]:
    return [note.text for note in axis.talk.events(Noted) if note.danger]


class TestTheEnd:

    def test_a_drive_that_ramps_down_is_waited_for(self) -> None:
        axis = running()
        axis.drive.ramp = 50
        sent = end(axis)
        cycles = [text for text in sent if text.startswith('205#')]
        assert cycles.count('205#070000000000') in (50, 51)
        assert cycles[-1] == '205#060000000000'
        assert axis.drive.state == axis.drive.READY
        assert sent[-1] == WATCH_OFF
        assert doubts(axis) == []

    def test_but_not_for_ever(self) -> None:
        axis = running(control_timeout=0.5)
        axis.drive.ramp = 1000
        began = axis.now
        sent = end(axis)
        assert WATCH_OFF not in sent        # so that it stops by itself
        assert 45 <= sent.count('205#070000000000') <= 55
        assert doubts(axis)
        assert axis.now - began < 6

    def test_at_least_three_cycles_of_one_that_is_disabled(self) -> None:
        axis = Axis().online()
        sent = end(axis)
        assert sent.count('205#060000000000') == 3
        assert sent[-1] == WATCH_OFF
        assert doubts(axis) == []

    def test_of_one_that_has_fallen_silent(self) -> None:
        axis = running()
        axis.mute = True
        sent = end(axis)
        assert sent.count('205#070000000000') == UNANSWERED_CYCLES
        assert WATCH_OFF not in sent
        assert doubts(axis)

    def test_heartbeats_of_the_bridge_go_on_until_the_drive_does_not_watch_it(self) -> None:
        axis = running(control_timeout=2.0)
        axis.drive.ramp = 100
        sent = end(axis)
        assert sent.count('77F#05') >= 4
        assert '77F#05' not in sent[sent.index(WATCH_OFF):]

    def test_it_watches_nobody_also_where_the_end_comes_before_it_has_said_so(self) -> None:
        axis = Axis()
        drive, takes = axis.drive, axis.drive.takes

        def unanswered(sent: Frame) -> list[Frame]:
            answers = takes(sent)
            return [] if drive.number(0x1016, 1) else answers
        drive.takes = unanswered    # type: ignore[method-assign]
        axis.activate()
        assert axis.take()[-1] == '605#2316100158027F00'
        drive.takes = takes         # type: ignore[method-assign]
        assert WATCH_OFF in end(axis)
        assert drive.number(0x1016, 1) == 0

    @staticmethod
    def back(**options: object) -> Axis:
        """Be enabled, silent for a while, and not set up again."""
        axis = running(control_timeout=1.0, **options)
        axis.drive.ramp = 1000
        axis.mute = True
        axis.live(0.5)
        axis.mute = False
        assert axis.session.stop_pending
        assert axis.drive.state == axis.drive.ENABLED
        doubts(axis)
        return axis

    def test_by_sdo_it_is_waited_for_as_well(self) -> None:
        axis = self.back()
        axis.take()
        axis.deliver(axis.talk.deactivate(axis.now))
        axis.live(0.5)
        assert not axis.session.stopped
        assert WATCH_OFF not in axis.take()
        axis.drive.becomes(axis.drive.ON)
        axis.live(0.1)
        assert axis.session.stopped
        assert axis.take()[-1] == WATCH_OFF
        assert doubts(axis) == []

    @pytest.mark.parametrize(('fixed', 'why'), [
        ({}, says('still_in_state', state='operation enabled')),
        ({(0x6040, 0): 0x08000022}, None)])
    def test_one_that_does_not_stop_by_sdo_watches_the_bridge(
            self, fixed: dict[tuple[int, int], int], why: str | None) -> None:
        axis = self.back()
        axis.drive.fixed = fixed
        sent = end(axis)
        assert DISABLE_BY_SDO in sent
        assert WATCH_OFF not in sent        # so that it stops by itself
        told, = doubts(axis)
        assert why is None or told == says('may_still_be_running', why=says(
            'stop_failed', what=[why]))

    def test_one_that_brakes_for_longer_has_answered(self) -> None:
        axis = running(control_timeout=0.5)
        axis.drive.ramp = 1000
        end(axis)
        assert doubts(axis) == [says('may_still_be_running', why=says('stop_failed', what=[
            says('still_in_state', state='operation enabled')]))]

    def test_in_the_middle_of_the_set_up(self) -> None:
        axis = Axis()
        axis.deaf = True
        axis.start()
        axis.live(0.7)
        sent = end(axis)
        assert not any(text.startswith('205#') for text in sent)
        assert doubts(axis) == []


class TestFoundEnabled:

    @staticmethod
    def meet(**options: object) -> Axis:
        axis = Axis(**options)  # type: ignore[arg-type]
        axis.drive.operational = True
        for word in (0x06, 0x07, 0x0F):
            axis.drive._control(word)
        axis.drive.told.clear()
        assert axis.drive.state == axis.drive.ENABLED
        return axis

    @pytest.mark.parametrize(('option', 'word'), [
        ('disable_operation', '0700'), ('shutdown', '0600'), ('disable_voltage', '0000')])
    def test_it_is_disabled_by_sdo_before_anything_else(self, option: str, word: str) -> None:
        axis = self.meet(disable_word=option).start()
        sent = [text for text in axis.take() if text.startswith(('605#', '000#', '205#'))]
        assert sent[:3] == ['605#4041600000000000', f'605#2B406000{word}0000',
                            '605#4041600000000000']
        assert axis.session.online

    def test_one_that_takes_its_time_is_waited_for(self) -> None:
        axis = self.meet()
        axis.drive.ramp = 1000
        axis.start()
        axis.live(0.7)
        assert not any(text.startswith(('000#', '205#', '605#2F6060')) for text in axis.take())
        axis.drive.becomes(axis.drive.ON)
        axis.live(0.3)
        assert axis.session.online

    def test_one_that_does_not_leave_is_not_cycled_and_named(self) -> None:
        axis = self.meet(control_timeout=0.5)
        axis.drive.ramp = 1000
        axis.start()
        axis.live(3.7)
        assert not any(text.startswith(('000#', '205#')) for text in axis.take())
        assert axis.session.state is DriveState.OFFLINE
        assert doubts(axis) == [says('may_still_be_running', why=says(
            'found_running', state='operation enabled'))]

    @pytest.mark.parametrize('stops', [False, True])
    def test_one_that_is_still_enabled_at_the_end_is_stopped_or_named(self, stops: bool) -> None:
        """The end of the bridge comes while it is waited for."""
        axis = self.meet(control_timeout=0.5)
        axis.drive.ramp = 1000
        axis.start()
        axis.live(0.2)
        assert doubts(axis) == []
        axis.take()
        axis.deliver(axis.talk.deactivate(axis.now))
        axis.live(0.1)
        assert DISABLE_BY_SDO in axis.take()
        if stops:
            axis.drive.becomes(axis.drive.ON)
        axis.live(1.5)
        assert axis.session.stopped
        assert not any(text.startswith(('000#', '205#')) for text in axis.take())
        assert doubts(axis) == [] if stops else doubts(axis) == [says(
            'may_still_be_running', why=says('stop_failed', what=[
                says('still_in_state', state='operation enabled')]))]

    def test_one_that_was_stopped_at_the_end_is_not_named_at_the_next(self) -> None:
        """It is switched off meanwhile: nothing says that it runs."""
        axis = self.meet(control_timeout=0.5)
        axis.drive.ramp = 1000
        axis.start()
        axis.live(0.2)
        axis.deliver(axis.talk.deactivate(axis.now))
        axis.live(0.1)
        axis.drive.becomes(axis.drive.ON)
        axis.live(1.5)
        assert axis.session.stopped
        assert doubts(axis) == []
        axis.mute = axis.deaf = True
        axis.deliver(axis.talk.activate(axis.now))
        axis.live(3.0)
        axis.take()
        assert by_sdo(axis) == []
        began = axis.now
        axis.deliver(axis.talk.deactivate(axis.now))
        axis.live(0.05)
        assert axis.session.stopped, axis.now - began
        assert doubts(axis) == []

    def test_one_that_is_found_braking_is_named_and_not_touched_at_the_end(self) -> None:
        axis = self.meet()
        axis.drive.becomes(axis.drive.QUICK_STOP)
        axis.start()
        axis.live(0.2)
        axis.take()
        axis.deliver(axis.talk.deactivate(axis.now))
        axis.live(1.0)
        assert not any(text.startswith(('605#2', '000#', '205#')) for text in axis.take())
        assert doubts(axis) == [says('may_still_be_running', why=says(
            'still_in_state', state='quick stop active'))]

    @pytest.mark.parametrize('delay', [0.0002, 0.08])
    def test_it_is_named_at_the_time_out_however_slowly_it_answers(self, delay: float) -> None:
        axis = self.meet(control_timeout=1.0)
        axis.DELAY = delay      # type: ignore[misc]
        axis.drive.ramp = 10000
        axis.deliver(axis.talk.bus_up(axis.now))
        began = axis.now
        axis.deliver(axis.talk.activate(axis.now))
        axis.live(began + 0.9 - axis.now)
        assert doubts(axis) == []
        axis.live(began + 1.3 - axis.now)
        assert len(doubts(axis)) == 1

    def test_nor_one_that_refuses_the_word_until_it_takes_it(self) -> None:
        axis = self.meet(control_timeout=0.5)
        axis.drive.fixed = {(0x6040, 0): 0x08000022}
        axis.start()
        axis.live(5.0)
        sent = axis.take()
        assert not any(text.startswith(('000#', '205#')) for text in sent)
        assert sent.count(DISABLE_BY_SDO) > 10
        assert axis.session.state is DriveState.OFFLINE
        assert axis.session.offline_advice.fields['parts'] == [
            says('found_running', state='operation enabled'),
            says('object_refused', what='6040h.00h', why=describe(0x08000022))]
        found = says('found_enabled', state='operation enabled')
        notes = axis.talk.events(Noted)
        assert [note.text.code for note in notes if note.danger] == ['may_still_be_running']
        assert [note.text for note in notes].count(found) == 1
        axis.drive.fixed.clear()
        axis.live(2.0)
        assert axis.session.online
        for each in axis.drive.restarts():
            axis.drive.becomes(axis.drive.ENABLED)
            axis.says(str(each))
        axis.live(0.5)
        assert [note.text for note in axis.talk.events(Noted)].count(found) == 1


class TestLosses:

    def test_a_drive_that_falls_silent_gets_neutral_cycles_then_sdo(self) -> None:
        axis = running()
        axis.mute = True
        axis.live(0.2)
        sent = [text for text in axis.take() if text.startswith(('205#', '605#'))]
        quiet = sent.index('605#2B40600007000000')
        assert set(sent[quiet - 3:quiet]) == {'205#070000000000'}
        assert not any(text.startswith('205#') for text in sent[quiet:])
        assert axis.talk.events(StationLost)
        axis.mute = False
        axis.live(1.0)
        assert axis.session.online
        assert axis.session.state is DriveState.DISABLED

    @pytest.mark.parametrize('timeout', [0.31, 0.35, 0.45, 0.5])
    def test_so_does_one_whose_heartbeats_are_missed_meanwhile(self, timeout: float) -> None:
        axis = Axis('pv', period=0.1, heartbeat_timeout=timeout).enabled().commands(0.0, 100.0)
        axis.live(0.35)
        axis.take()
        axis.talk.events()
        axis.mute = True
        axis.live(2.5)
        sent = [text for text in axis.take() if text.startswith(('205#', '605#'))]
        quiet = sent.index('605#2B40600007000000')
        assert sent[quiet - 3:quiet] == ['205#070000000000'] * 3
        assert [event.text.code for event in axis.talk.events(Noted) if event.danger] == [
            'may_still_be_running']

    def test_what_cycles_carry_is_what_was_sent_last_when_it_is_back(self) -> None:
        axis = Axis(objects={(0x605A, 0): b'\6\0'}, disable_word='shutdown').online()
        axis.mute = True
        axis.live(0.2)
        axis.drive.becomes(axis.drive.QUICK_STOP)       # by somebody else
        axis.mute = False
        axis.live(1.0)
        sent = axis.take()
        assert '605#2B40600000000000' in sent
        assert [text for text in sent if text.startswith('205#')][-1] == '205#060000000000'
        assert axis.session.sent.raws == (0x0006, 0)

    def test_a_node_that_restarts_is_set_up_anew(self) -> None:
        axis = running()
        for each in axis.drive.restarts():
            axis.says(str(each))
        axis.live(0.5)
        lost, = axis.talk.events(StationLost)
        assert lost.reason == says('device_restarted')
        assert axis.session.online
        assert axis.session.state is DriveState.DISABLED
        sent = axis.take()
        assert '605#2F60600009000000' in sent
        assert not any(text.startswith('205#') and text[4:] not in ('060000000000',)
                       for text in sent[sent.index('605#2F60600009000000'):])

    def test_it_stays_offline_until_there_are_heartbeats_again(self) -> None:
        axis = Axis(objects={(0x1017, 0): b'\x64\0'}, heartbeat_producer=0.0).enabled()
        for again in (True, False):
            axis.drive.objects[0x1017, 0] = b'\0\0'
            axis.live(5.0)
            lost, = axis.talk.events(StationLost)
            assert lost.reason == says('no_heartbeat', timeout=0.35)
            assert axis.session.state is DriveState.OFFLINE
            assert axis.session.offline_advice == says('no_heartbeat', timeout=0.35)
            axis.drive.objects[0x1017, 0] = b'\x64\0'
            axis.live(0.5)
            assert axis.session.state is DriveState.DISABLED, again

    def test_one_that_never_had_any_is_online_and_says_so(self) -> None:
        axis = Axis(heartbeat_producer=0.0).start()
        assert axis.session.warning == says('heartbeat_missing')
        axis.says('705#00')
        axis.live(1.5)
        assert axis.session.online
        assert axis.session.warning == says('heartbeat_missing')

    def test_a_node_that_is_not_operational_any_more(self) -> None:
        axis = running()
        axis.live(0.2)
        axis.drive.operational = False
        axis.says('705#7F')
        axis.live(0.3)
        lost, = axis.talk.events(StationLost)
        assert lost.reason == says('node_state', state='pre-operational')
        assert axis.session.online


    @pytest.mark.parametrize('period', [0.01, 0.1, 0.5])
    def test_one_that_does_not_become_operational_has_control_timeout_to(
            self, period: float) -> None:
        axis = Axis('pv', period=period)
        takes = axis.drive.takes

        def never(sent: Frame) -> list[Frame]:
            answers = takes(sent)
            axis.drive.operational = False
            return answers
        axis.drive.takes = never    # type: ignore[method-assign]
        axis.start()
        axis.live(5.0)
        started = [at for at, text in axis.log if text == '000#0105']
        assert len(started) == 3
        assert min(later - at for at, later in zip(started, started[1:])) >= 2.0
        assert axis.session.state is DriveState.OFFLINE
        assert axis.session.offline_advice == says('node_state', state='pre-operational')

    def test_one_whose_heartbeats_cease_while_it_is_asked_where_it_is(self) -> None:
        axis = Axis('csp', {(0x1017, 0): b'\x64\0'}, heartbeat_producer=0.0,
                    parameter_timeout=0.2)
        takes, asked = axis.drive.takes, []

        def slow(sent: Frame) -> list[Frame]:
            if str(sent).startswith('605#40646000') and len(asked) < 2:
                asked.append(sent)
                axis.drive.objects[0x1017, 0] = b'\0\0'
                return []
            return takes(sent)
        axis.drive.takes = slow     # type: ignore[method-assign]
        axis.live(0.3)
        axis.start()
        axis.live(3.0)
        assert len(asked) == 2
        assert axis.session.state is DriveState.OFFLINE
        assert axis.session.offline_advice == says('no_heartbeat', timeout=0.35)
        axis.drive.objects[0x1017, 0] = b'\x64\0'
        axis.live(0.3)
        assert axis.session.state is DriveState.DISABLED


def test_nothing_is_sent_where_there_is_nothing_to_be_stopped() -> None:
    talk = Conversation(servo())
    talk.bus_up(10.0)
    talk.deactivate(10.0)
    assert talk.session.stopped
    assert talk.session.next_timer() == float('inf')


class TestTheAnswerBeforeIsToCome:
    """The bus is back, the drive is told to stop, and does not answer yet."""

    TIMEOUT = 0.3

    @classmethod
    def told(cls) -> Axis:
        axis = running(parameter_timeout=cls.TIMEOUT)
        axis.deliver(axis.talk.bus_down(axis.now))
        axis.talk.events()
        axis.deaf = True
        axis.deliver(axis.talk.bus_up(axis.now))
        assert by_sdo(axis) == [DISABLE_BY_SDO]
        axis.live(0.01)
        return axis

    def test_the_end_waits_for_nothing_and_believes_the_second_answer(self) -> None:
        axis = self.told()
        axis.deliver(axis.talk.deactivate(axis.now))
        assert by_sdo(axis) == [DISABLE_BY_SDO]
        axis.says('585#6040600000000000')
        assert by_sdo(axis) == [DISABLE_BY_SDO]
        axis.says('585#6040600000000000')
        assert by_sdo(axis) == ['605#23FF600000000000']
        axis.says('585#60FF600000000000')
        axis.says('585#4B41600050020000')       # switch on disabled
        axis.says('585#6016100100000000')
        assert axis.session.stopped
        assert doubts(axis) == []

    def test_the_late_one_proves_nothing(self) -> None:
        axis = self.told()
        axis.deliver(axis.talk.deactivate(axis.now))
        axis.says('585#6040600000000000')
        axis.live(1.0)
        assert axis.session.stopped
        assert by_sdo(axis)[:7] == [*[DISABLE_BY_SDO] * 4, *['605#23FF600000000000'] * 3]
        assert len(doubts(axis)) == 1

    def test_a_drive_that_restarts_is_told_at_once(self) -> None:
        axis = self.told()
        axis.says('705#00')
        assert by_sdo(axis) == [DISABLE_BY_SDO]


class TestSegments:
    """A user reads the device name, 1008h, in segments; the drive says 24 bytes, then seven."""

    BEGUN, SEGMENT = '585#4108100018000000', '585#0053657276696365'
    #: abort of 1008h by the client, 08000000h
    BROKEN_OFF = '605#8008100000000008'

    @staticmethod
    def amidst() -> Axis:
        """Be in the middle of it."""
        axis = running(table=(*TABLE, NAME))
        axis.drive.takes = drive_without(axis, 0x605)  # type: ignore[method-assign]
        axis.deliver(axis.talk.submits(read(NAME), axis.now))
        axis.says(TestSegments.BEGUN)
        assert by_sdo(axis) == [
            '605#4008100000000000', '605#6000000000000000']
        return axis

    def test_a_stop_waits_for_the_segment_under_way_and_breaks_off(self) -> None:
        axis = self.amidst()
        axis.deliver(axis.talk.handle_stall(axis.now))
        axis.live(0.02)
        assert not any(text.startswith('605#') for text in axis.take())
        axis.says(self.SEGMENT)
        assert by_sdo(axis) == [
            self.BROKEN_OFF, DISABLE_BY_SDO]

    def test_but_for_a_moment_only(self) -> None:
        axis = self.amidst()
        axis.deliver(axis.talk.handle_stall(axis.now))
        axis.live(0.051)
        assert by_sdo(axis) == [
            '605#8008100000000405', DISABLE_BY_SDO]

    @staticmethod
    def unanswered() -> Axis:
        """Have it asked for, and stop before its answer."""
        axis = running(table=(*TABLE, NAME))
        axis.drive.takes = drive_without(axis, 0x605)  # type: ignore[method-assign]
        axis.deliver(axis.talk.submits(read(NAME), axis.now))
        axis.deliver(axis.talk.handle_stall(axis.now))
        axis.live(0.051)
        assert by_sdo(axis) == ['605#4008100000000000', DISABLE_BY_SDO]
        return axis

    def test_what_turns_out_to_take_segments_later_is_broken_off(self) -> None:
        axis = self.unanswered()
        axis.says(self.BEGUN)
        assert by_sdo(axis) == [self.BROKEN_OFF]
        axis.says(self.BEGUN)
        assert by_sdo(axis) == []

    def test_an_abort_of_no_object_is_that_of_the_upload_before(self) -> None:
        axis = self.unanswered()
        axis.says('585#8000000001000405')
        axis.live(0.2)
        assert by_sdo(axis)[0] == DISABLE_BY_SDO, 'told again'
        axis.says('585#8000000001000405')
        assert by_sdo(axis)[:1] != [DISABLE_BY_SDO], 'refused'

    def test_at_the_end_it_does_not_wait_at_all(self) -> None:
        axis = self.amidst()
        axis.deliver(axis.talk.handle_stall(axis.now))
        axis.deliver(axis.talk.deactivate(axis.now))
        assert by_sdo(axis) == [
            self.BROKEN_OFF, DISABLE_BY_SDO]


class TestNmt:

    def test_at_most_once_a_second_to_a_drive_that_is_offline(self) -> None:
        axis = Axis(parameter_timeout=0.05)
        axis.deaf = True
        axis.start()
        axis.live(5.0)
        sent = [at for at, text in axis.log if text == '000#8005']
        assert 4 <= len(sent) <= 6
        assert min(later - at for at, later in zip(sent, sent[1:])) >= 0.999

    def test_nor_to_one_that_answers_sdo_and_sends_no_pdos(self) -> None:
        axis = Axis()
        responses = axis.drive.responses
        axis.drive.responses = lambda *kinds: []    # type: ignore[method-assign]
        axis.start()
        axis.live(5.0)
        sent = [at for at, text in axis.log if text == '000#0105']
        assert 4 <= len(sent) <= 6
        axis.drive.responses = responses            # type: ignore[method-assign]
        axis.live(1.5)
        assert axis.session.online

    def test_nor_ten_times_a_second_to_one_that_starts_all_the_time(self) -> None:
        axis = Axis().online()
        for _ in range(200):
            axis.says('705#00')
            axis.live(0.01)
        sent = axis.take()
        assert sent.count('000#0105') <= sent.count('000#8005') <= 21

    def test_none_without_nmt_start(self) -> None:
        axis = Axis(nmt_start=False)
        axis.deaf = True
        axis.start()
        axis.live(3.0)
        assert not any(text.startswith('000#') for text in axis.take())
