# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""One SYNC for all drives of a bus, and the pace that a drive has of its own (event)."""

from functools import partial
from typing import Any

from coming import Coming
from drives import ServoDrive
import pytest
from servo_builders import Axis, OBJECTS, servo
from stops import STOP_CYCLES, UNANSWERED_CYCLES

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction, ControlRequest
from drive_can_bridge.core.events import ProcessDataReceived
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.protocols.families import make_sessions

DELAY = 0.0002


class Bus:
    """Sessions of one bus, served as the exchange serves them: each when it wanted to be."""

    def __init__(self, *drives: DriveConfiguration) -> None:
        self.sessions = make_sessions(drives)
        self.drives = {drive.station: ServoDrive(drive.station, OBJECTS) for drive in drives}
        self.due = [float('inf')] * len(drives)
        self.now = 10.0
        self.delay = DELAY
        self.log: list[tuple[float, str]] = []
        self.coming = Coming()
        self.events: dict[str, list[Any]] = {drive.name: [] for drive in drives}

    def pump(self, place: int) -> None:
        session = self.sessions[place]
        while frames := session.take_frames():
            session.frames_left(self.now)
            for sent in frames:
                self.log.append((round(self.now, 6), str(sent)))
                for drive in self.drives.values():
                    for answer in drive.takes(sent):
                        self.coming.plan(self.now + self.delay, partial(self.arrives, answer))
        self.events[session.configuration.name] += session.take_events()
        self.due[place] = session.next_timer()

    def start(self, *places: int) -> 'Bus':
        for place in places or range(len(self.sessions)):
            self.sessions[place].bus_up(self.now)
            self.sessions[place].activate(self.now)
            self.pump(place)
        return self

    def live(self, duration: float) -> 'Bus':
        end = self.now + duration
        self.coming.live(self, end, due=lambda: min(self.due), timers=self.timers)
        self.now = end
        return self

    def arrives(self, answer: Frame) -> None:
        for place, session in enumerate(self.sessions):
            if session.configuration.station == answer.identifier & 0x7F:
                session.receive_frame(answer, self.now)
                self.pump(place)

    def timers(self) -> None:
        for place, session in enumerate(self.sessions):
            if self.due[place] <= self.now:
                session.handle_timer(self.now)
                self.pump(place)

    def asks(self, place: int, action: ControlAction) -> None:
        self.sessions[place].services.submit(ControlRequest(action), self.now)
        self.pump(place)

    def rounds(self) -> list[list[str]]:
        """Return the identifiers of RPDOs and SYNC sent since the last call, round by round."""
        log, self.log = self.log, []
        found: list[list[str]] = [[]]
        for _, text in log:
            if text.startswith(('20', '080')):
                found[-1].append(text[:3])
                if text.startswith('080'):
                    found.append([])
        return [entry for entry in found if entry]


def bus(count: int = 3, mode: str = 'pv', **options: Any) -> Bus:
    return Bus(*(servo(mode, name=f'axis_{station}', station=station, **options)
                 for station in range(1, count + 1)))


def online(of: Bus) -> list[bool]:
    return [session.online for session in of.sessions]


class TestRounds:

    def test_all_rpdos_then_sync_once_a_period(self) -> None:
        one = bus().start().live(0.5)
        assert online(one) == [True] * 3
        one.rounds()
        before = one.now
        one.live(1.0)
        syncs = [at for at, text in one.log if text == '080#' and at > before]
        assert one.rounds() == [['201', '202', '203', '080']] * 100
        assert {round(later - at, 5) for at, later in zip(syncs, syncs[1:])} == {0.01}

    def test_one_that_comes_later_joins(self) -> None:
        one = bus().start(0, 2).live(0.5)
        one.rounds()
        one.start(1)
        one.live(0.5)
        rounds = one.rounds()
        assert online(one) == [True] * 3
        assert rounds[-10:] == [['201', '202', '203', '080']] * 10
        assert all(each[-1] == '080' and each.count('080') == 1 for each in rounds)
        assert {each[0] for each in rounds} == {'201'}

    def test_one_that_is_lost_leaves_the_others_in_peace(self) -> None:
        one = bus().start().live(0.5)
        takes, one.drives[3].takes = one.drives[3].takes, lambda sent: []  # type: ignore
        one.rounds()
        one.live(1.0)
        assert online(one) == [True, True, False]
        assert one.rounds()[-50:] == [['201', '202', '080']] * 50
        for session in one.sessions[:2]:
            assert session.statistics.missed == 0
        one.drives[3].takes = takes     # type: ignore[method-assign]
        one.live(2.0)
        assert online(one) == [True] * 3

    def test_a_stop_waits_for_the_next_sync_in_time(self) -> None:
        one = bus(period=0.02).start().live(0.5)
        one.asks(1, ControlAction.ENABLE)
        one.live(0.5)
        one.live(0.012)
        one.rounds()
        one.asks(1, ControlAction.DISABLE)
        assert one.rounds() == []
        one.live(0.02)
        assert one.rounds() == [['201', '202', '203', '080']]

    # s; the longest wait is 0.02 s
    @pytest.mark.parametrize(('period', 'since_the_last'), [(0.2, 0.1), (0.05, 0.01)])
    def test_or_brings_a_whole_round_forward(self, period: float, since_the_last: float) -> None:
        one = bus(period=period).start().live(2.0)
        for place in (0, 1, 2):
            one.asks(place, ControlAction.ENABLE)
        one.live(2.0)
        one.rounds()
        while one.rounds() == []:
            one.live(0.005)
        one.live(since_the_last)
        at = one.now
        one.rounds()
        one.asks(1, ControlAction.DISABLE)
        one.live(0.006)
        first, *more = one.rounds()
        assert sorted(first[:3]) == ['201', '202', '203']   # whoever stops, begins
        assert first[3:] == ['080']
        assert len(more) < 2
        assert one.drives[2].state in (ServoDrive.ON, ServoDrive.READY)
        assert one.drives[1].state == one.drives[3].state == ServoDrive.ENABLED
        assert one.now - at < 0.05
        one.live(2.0)
        assert all(session.statistics.missed == 0 for session in one.sessions)

    @pytest.mark.parametrize('period', [0.5, 2.0])
    def test_cycles_of_a_stop_are_close_together_however_long_the_period_is(
            self, period: float) -> None:
        one = bus(2, period=period, control_timeout=0.5).start().live(3 * period)
        assert online(one) == [True] * 2
        one.log.clear()
        for place, session in enumerate(one.sessions):
            session.deactivate(one.now)
            one.pump(place)
        one.live(1.0)
        assert all(session.stopped for session in one.sessions)
        syncs = [at for at, text in one.log if text == '080#']
        assert len(syncs) == STOP_CYCLES
        assert max(later - at for at, later in zip(syncs, syncs[1:])) <= 0.1 + 1e-6
        assert one.rounds() == [['201', '202', '080']] * STOP_CYCLES

    @pytest.mark.parametrize('period', [0.01, 0.5, 2.0])
    def test_drives_that_fall_silent_together_get_theirs_as_soon(self, period: float) -> None:
        one = bus(2, period=period, control_timeout=0.5).start().live(3 * period + 0.5)
        for place in (0, 1):
            one.asks(place, ControlAction.ENABLE)
        one.live(2.0)
        for station in (1, 2):
            assert one.drives[station].state == ServoDrive.ENABLED
            one.drives[station].takes = lambda sent: []     # type: ignore[method-assign]
        one.live(period / 2)
        one.log.clear()
        for place, session in enumerate(one.sessions):
            left = session.frames_left      # which takes its time
            session.frames_left = (         # type: ignore[method-assign]
                lambda now, left=left: left(now + 0.0003))
            session.deactivate(one.now)
            one.pump(place)
        one.live(0.9)
        assert [each for each in one.rounds() if each != ['080']] == [
            ['201', '202', '080']] * UNANSWERED_CYCLES
        one.live(1.5)       # NMT may have stopped them: they are told pre-operational, and again
        assert all(session.stopped for session in one.sessions)
        assert [sum(getattr(event, 'danger', False) for event in events)
                for events in one.events.values()] == [1, 1]

    @pytest.mark.parametrize('place', [0, 1])
    def test_one_that_is_lost_when_another_one_stops(self, place: int) -> None:
        one = bus(period=0.5).start().live(2.2)
        one.drives[3].takes = lambda sent: []   # type: ignore[method-assign]
        one.live(0.6)
        one.log.clear()
        one.sessions[place].deactivate(one.now)
        one.pump(place)
        one.live(3.0)
        assert online(one) == [place == 1, place == 0, False]
        self.rpdos_and_sync_are_together(one)

    def test_one_that_restarts_in_the_middle_of_a_round_that_it_has_brought_forward(self) -> None:
        one = bus(2, period=0.2).start().live(1.3)
        one.asks(1, ControlAction.ENABLE)
        one.live(1.02)
        one.log.clear()
        for each in one.drives[2].restarts():
            one.sessions[1].receive_frame(each, one.now)
        one.pump(1)
        one.live(1.0)
        assert online(one) == [True] * 2
        self.rpdos_and_sync_are_together(one)

    @staticmethod
    def rpdos_and_sync_are_together(one: Bus) -> None:
        sent: dict[str, float] = {}
        for at, text in one.log:
            if text == '080#':
                assert set(sent.values()) == {at}
                sent.clear()
            elif text.startswith('20'):
                assert text[:3] not in sent
                sent[text[:3]] = at
        assert not sent

    @pytest.mark.parametrize('place', [0, 1, 2])
    def test_so_are_those_of_one_drive_and_all_others_come_along(self, place: int) -> None:
        one = bus(period=0.5).start().live(2.2)
        one.asks(place, ControlAction.ENABLE)
        one.live(3.0)
        assert one.drives[place + 1].state == ServoDrive.ENABLED
        one.log.clear()
        one.sessions[place].fail(sentences.bridge_inactive(), one.now)
        one.pump(place)
        one.live(0.4)
        assert one.sessions[place].stopped
        assert one.drives[place + 1].state == ServoDrive.READY
        syncs = [at for at, text in one.log if text == '080#']
        assert max(later - at for at, later in zip(
            syncs[:STOP_CYCLES], syncs[1:STOP_CYCLES])) <= 0.1 + 1e-6
        rounds = one.rounds()
        assert [sorted(each) for each in rounds[:STOP_CYCLES]] == [
            ['080', '201', '202', '203']] * STOP_CYCLES
        rest = [each for number, each in enumerate(('201', '202', '203')) if number != place]
        one.live(3.0)
        assert [*rounds[STOP_CYCLES:], *one.rounds()] == [[*rest, '080']] * 7
        assert all(session.statistics.missed == 0 for session in one.sessions)
        assert all(session.statistics.period_error.maximum < 0.001 for session in one.sessions)

    def test_nor_does_one_that_is_lost_bring_a_round_of_its_own(self) -> None:
        """The last of a round."""
        one = bus(2, period=0.5).start().live(2.0)
        one.drives[2].takes = lambda sent: []   # type: ignore[method-assign]
        one.log.clear()
        one.live(4.0)
        assert online(one) == [True, False]
        syncs = [at for at, text in one.log if text == '080#']
        assert min(later - at for at, later in zip(syncs, syncs[1:])) > 0.09

    def test_a_round_brought_forward_costs_no_axis_its_answer(self) -> None:
        """TPDOs come 8 ms behind SYNC, as on a slow bus, and a quick stop 2 ms behind it."""
        one = bus(period=0.1, missed_limit=1).start().live(2.0)
        for place in (0, 1, 2):
            one.asks(place, ControlAction.ENABLE)
        one.live(2.0)
        one.delay = 0.008
        one.rounds()
        while one.rounds() == []:
            one.live(0.001)
        one.live(0.001)
        one.asks(1, ControlAction.QUICK_STOP)
        one.live(0.02)
        assert len(one.rounds()) == 1
        assert online(one) == [True] * 3
        assert one.drives[1].state == one.drives[3].state == ServoDrive.ENABLED
        one.live(1.0)
        assert [session.statistics.missed for session in one.sessions] == [0] * 3

    def test_a_process_that_is_late_between_two_drives(self) -> None:
        """One leaves a cycle out, the other does not: they stay in step all the same."""
        one = bus().start().live(0.5)
        one.rounds()
        act, delays = one.sessions[0].handle_timer, [0.0149, 0.0151, 0.0049, 0.0051]

        def slowly(now: float) -> None:
            act(now)
            if delays and round(one.now, 3) % 0.05 < 0.01:
                one.now += delays.pop()
        one.sessions[0].handle_timer = slowly       # type: ignore[method-assign]
        one.live(1.0)
        assert delays == []
        assert {tuple(sorted(each)) for each in one.rounds()[-10:]} == {
            ('080', '201', '202', '203')}
        assert all(session.statistics.rejected == 0 for session in one.sessions)
        assert len({session.next_timer() for session in one.sessions}) == 1

    def test_sync_that_the_bus_refuses_is_no_stop(self) -> None:
        axis = Axis().enabled()
        axis.talk.refusing = lambda text: text == '080#'
        axis.asks(ControlAction.DISABLE, 0.02)
        assert axis.session.control is not None
        assert axis.session.control.word_due

    def test_a_tpdo_that_is_too_short_brings_what_is_in_it(self) -> None:
        axis = Axis().online()
        axis.drive.responses = lambda *kinds: [     # type: ignore[method-assign]
            Frame(0x185, bytes.fromhex('3102E803'), False)]
        axis.live(0.1)
        assert {event.raws for event in axis.talk.events(ProcessDataReceived)} == {(0x231,)}
        assert axis.session.statistics.rejected == 10
        axis.drive.responses = lambda *kinds: [     # type: ignore[method-assign]
            Frame(0x185, b'\x31', False)]
        axis.live(0.2)
        assert not axis.session.online

    def test_one_heartbeat_for_all_the_smallest(self) -> None:
        one = Bus(*(servo('pv', name=f'axis_{station}', station=station, bridge_heartbeat=beat)
                    for station, beat in ((1, 0.5), (2, 0.1), (3, 0.3)))).start().live(2.0)
        beats = [at for at, text in one.log if text == '77F#05']
        assert {round(later - at, 3) for at, later in zip(beats, beats[1:])} == {0.1}
        for station, limit in ((1, 1500), (2, 300), (3, 900)):
            assert one.drives[station].number(0x1016, 1) == 127 << 16 | limit

    def test_it_beats_as_the_node_that_those_know_who_are_to_hear_it(self) -> None:
        one = Bus(*(servo('pv', name=f'axis_{station}', station=station, bridge_heartbeat=beat,
                          bridge_node=node)
                    for station, beat, node in ((1, 0.0, 100), (2, 0.1, 126)))).start().live(1.0)
        assert {text for _, text in one.log if text.endswith('#05')} == {'77E#05'}
        assert one.drives[2].number(0x1016, 1) == 126 << 16 | 300


class TestTheFirst:
    """SYNC begins when it can start no drive of the bus; NMT start waits for it."""

    @staticmethod
    def began(one: Bus, seconds: float = 2.5) -> tuple[float, float]:
        """Start; return when there was SYNC, and NMT start of drive 1."""
        at = one.now
        one.start()
        one.live(seconds)
        return tuple(next(when for when, text in one.log if text == wanted) - at
                     for wanted in ('080#', '000#0101'))    # type: ignore[return-value]

    @pytest.mark.parametrize('silent', [1, 2, 3])
    def test_a_drive_that_is_silent_is_so_for_a_second(self, silent: int) -> None:
        one = bus()
        one.drives[silent].takes = lambda sent: []      # type: ignore[method-assign]
        at = one.now
        one.start()
        one.live(2.5)
        assert next(when for when, text in one.log if text == '080#') - at == pytest.approx(1.0)
        assert online(one) == [place != silent for place in (1, 2, 3)]

    def test_a_drive_that_does_not_stop_has_half_a_second(self) -> None:
        one = bus(control_timeout=5.0)
        one.drives[2].becomes(ServoDrive.ENABLED)
        one.drives[2].ramp = 10_000
        sync, start = self.began(one)
        assert sync == pytest.approx(0.5, abs=0.01)
        assert start >= sync
        assert online(one) == [True, False, True]

    def test_it_does_not_pause_when_all_are_lost_and_found(self) -> None:
        one = bus().start().live(0.5)
        for drive in one.drives.values():
            drive.operational = False
        one.live(3.0)
        assert online(one) == [True] * 3
        syncs = [at for at, text in one.log if text == '080#']
        assert max(later - at for at, later in zip(syncs, syncs[1:])) < 0.015
        assert min(later - at for at, later in zip(syncs, syncs[1:])) > 0.005

    def test_they_end_together(self) -> None:
        one = bus().start().live(0.5)
        one.log.clear()
        for place, session in enumerate(one.sessions):
            session.deactivate(one.now)
            one.pump(place)
        one.live(1.0)
        assert one.rounds() == [['201', '202', '203', '080']] * STOP_CYCLES


class TestEvent:

    @staticmethod
    def meet(mode: str = 'pv', **options: Any) -> Axis:
        axis = Axis(mode, transmission='event', objects={
            (0x1800, 3): bytes(2), (0x1800, 5): bytes(2)}, **options)
        takes = axis.drive.takes
        axis.drive.takes = lambda sent: [   # type: ignore[method-assign]
            *takes(sent), *(axis.drive.responses(255) if sent.identifier == 0x205 and (
                axis.drive.operational) else ())]
        axis.start()
        return axis

    def test_it_is_set_up_and_cycled_without_sync(self) -> None:
        axis = self.meet()
        sent = axis.take()
        for text in ('605#2F001402FF000000', '605#2F001802FF000000', '605#2B00180332000000',
                     '605#2B0018050A000000'):
            assert text in sent, text
        assert '080#' not in sent
        assert axis.session.online

    @pytest.mark.parametrize('word', ['shutdown', 'disable_voltage', 'disable_operation'])
    def test_what_was_on_its_way_is_no_status_behind_a_quick_stop(self, word: str) -> None:
        axis = self.meet(disable_word=word)
        axis.asks(ControlAction.ENABLE)
        axis.drive.braking = 20
        axis.mute = True
        axis.asks(ControlAction.QUICK_STOP, 0.0105)
        assert axis.words()[-1] == '0200'
        assert axis.drive.state == axis.drive.QUICK_STOP
        axis.mute = False
        axis.says('185#3702E8030000')       # sampled before
        axis.asks(ControlAction.DISABLE, 0.1)
        assert axis.words() == ['0200']

    def test_a_drive_that_takes_no_notice_of_a_quick_stop_is_disabled(self) -> None:
        axis = self.meet()
        axis.asks(ControlAction.ENABLE)
        control = axis.drive._control
        axis.drive._control = lambda word: (    # type: ignore[method-assign]
            control(word) if word != 0x02 else None)
        axis.asks(ControlAction.QUICK_STOP, 0.05)
        assert axis.words()[-1] == '0200'
        axis.asks(ControlAction.DISABLE, 0.1)
        assert axis.words() == ['0700', '0600']

    def test_what_comes_by_itself_is_a_sample_and_never_unasked(self) -> None:
        axis = self.meet()
        axis.talk.events()
        for _ in range(5):
            axis.says('185#3102E8030000')
        axis.live(0.5)
        assert len(axis.talk.events(ProcessDataReceived)) > 50
        assert axis.session.statistics.rejected == axis.session.statistics.late == 0
        assert axis.session.statistics.missed == 0

    @pytest.mark.parametrize('mode', ['csp', 'pv'])
    def test_a_stop_goes_out_at_once(self, mode: str) -> None:
        axis = self.meet(mode, period=0.02)
        axis.asks(ControlAction.ENABLE)
        for _ in range(40):
            axis.live(0.001)
            if axis.words():
                break
        axis.live(0.006)
        axis.take()
        axis.deliver(axis.talk.asks(ControlAction.QUICK_STOP, axis.now))
        axis.live(0.0)
        assert axis.words() == ['0200']

    def test_missed_is_a_period_and_a_half_without_a_set(self) -> None:
        axis = self.meet()
        before = axis.session.statistics.missed
        axis.mute = True
        axis.live(0.044)
        assert axis.session.statistics.missed - before in (2, 3)
        axis.live(0.1)
        assert not axis.session.online
        axis.mute = False
        axis.live(1.0)
        assert axis.session.online

    def test_enabled_and_stopped(self) -> None:
        axis = self.meet()
        assert axis.asks(ControlAction.ENABLE) == [('enable', True, 'operation enabled')]
        axis.commands(0.0, 100.0)
        axis.live(0.1)
        assert axis.drive.number(0x60FF) == 1000
        axis.ends(3.0)
        assert axis.drive.state == axis.drive.READY
        assert axis.drive.number(0x60FF) == 0


