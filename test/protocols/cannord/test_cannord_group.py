# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Broadcast groups: stations 1, 2 and 3 are led by station 1 and share identifier 400h (408h)."""

from collections.abc import Callable
from dataclasses import replace
import math
from typing import Any

from builders import drive, frame, read
from cannord_session_builders import (
    ACTUAL, CURRENT, FREQUENCY, inverter, OFFSET, PARAMETERS, SETPOINTS, STANDING, VALUES,
)
from coming import Coming
import pytest
from saying import says
from stops import STOP_CYCLES

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.core.events import (
    DriveState, Event, Noted, ProcessDataReceived, RequestCompleted, StationFound, StationLost,
)
from drive_can_bridge.core.session import Session
from drive_can_bridge.core.setpoints import CommandOutcome
from drive_can_bridge.protocols.cannord.control_words import make_control
from drive_can_bridge.protocols.families import FAMILIES, make_sessions

ENABLE, DISABLE = ControlAction.ENABLE, ControlAction.DISABLE
QUICK_STOP, RESET_FAULT = ControlAction.QUICK_STOP, ControlAction.RESET_FAULT
NAMES = ('lift', 'hoist', 'turn')
READY, RUNNING, FAULT, DISABLED = '310B0000', '370F0020', '380B0000', '700B0000'


class Bus:
    """The sessions of a bus, served as the exchange serves them; and inverters that answer."""

    def __init__(self, *drives: DriveConfiguration) -> None:
        self.sessions = make_sessions(drives)
        self.now = 10.0
        self.log: list[tuple[str, Event]] = []
        self.controlled: list[tuple[str, ControlCompleted]] = []
        #: tells of a frame whether the bus refuses it
        self.refusing: Callable[[str], bool] = lambda text: False
        #: station -> what it answers to its process frame; a missing one is silent
        self.answers: dict[int, str] = {drive.station: READY for drive in drives}
        for session in self.sessions:
            session.bus_up(9.0)
        for session in self.sessions:
            session.activate(10.0)

    def session(self, name: str) -> Session:
        return next(session for session in self.sessions if session.configuration.name == name)

    def pump(self) -> list[str]:
        """Fetch what all sessions give out, in the order of the exchange; return what left."""
        sent: list[str] = []
        for session in self.sessions:
            texts = [str(entry) for entry in session.take_frames()]
            while texts:
                refused = [place for place, text in enumerate(texts) if self.refusing(text)]
                sent += [text for place, text in enumerate(texts) if place not in refused]
                session.frames_left(self.now, refused)
                texts = [str(entry) for entry in session.take_frames()]
        for session in self.sessions:   # a partner's events may have come after its turn
            for event in session.take_events():
                if isinstance(event, ControlCompleted):
                    self.controlled.append((session.configuration.name, event))
                else:
                    self.log.append((session.configuration.name, event))
        return sent

    def hears(self, text: str) -> list[str]:
        heard = frame(text)
        for session in self.sessions:
            for claim in FAMILIES['cannord'].claims(session.configuration):
                if claim.route.matches(heard):
                    session.receive_frame(heard, self.now)
                    return self.pump()
        raise AssertionError(text)

    def live(self, duration: float) -> list[tuple[float, str]]:
        """Let time pass; return what was sent, and when."""
        end = self.now + duration
        found: list[tuple[float, str]] = []

        def timers() -> None:
            for session in self.sessions:
                if session.next_timer() <= self.now:
                    session.handle_timer(self.now)
            sent = self.pump()
            found.extend((round(self.now, 6), text) for text in sent)
            for text in sent:
                identifier = int(text.split('#')[0], 16)
                if identifier < 0x200 and identifier // 2 in self.answers:
                    self.now += 0.0005
                    self.hears(f'{identifier + 1:03X}#{self.answers[identifier // 2]}')
        Coming().live(self, end + 1e-6, timers=timers, due=lambda: min(
            session.next_timer() for session in self.sessions))
        self.now = end
        return found

    def events(self, *kinds: type) -> list[tuple[str, Event]]:
        found, self.log = self.log, []
        return [(name, event) for name, event in found if isinstance(event, kinds)]

    def asks(self, action: ControlAction, name: str = 'lift') -> None:
        assert not self.session(name).services.control_refusal(action)
        self.session(name).services.submit(ControlRequest(action), self.now)
        self.pump()

    def commands(self, value: float) -> CommandOutcome:
        """Command the first setpoint of the leader."""
        return self.session('lift').services.command(0, value, self.now)

    def ends(self, *order: int) -> None:
        """Deactivate all, in this order."""
        for place in order or range(len(self.sessions)):
            self.sessions[place].deactivate(self.now)

    def unplugged(self) -> list[str]:
        """Lose the bus; return what left."""
        for session in self.sessions:
            session.bus_down(self.now, 'unplugged')
        return self.pump()

    def outcomes(self, name: str = 'lift') -> list[tuple[str, bool, str]]:
        found = [done for of, done in self.controlled if of == name]
        self.controlled = [entry for entry in self.controlled if entry[0] != name]
        return [(done.request.action.value, done.success, done.message) for done in found]


def members(count: int = 3, **options: Any) -> list[DriveConfiguration]:
    options.setdefault('broadcast', 'group')
    return [inverter(name=name, station=place, **options)
            for place, name in enumerate(NAMES[:count], 1)]


def three(**options: Any) -> Bus:
    """Return a bus whose three inverters are online; the next cycle is due at 10.06 s."""
    bus = Bus(*members(**options))
    bus.live(0.05)
    assert all(session.online for session in bus.sessions)
    bus.events()
    return bus


def words(sent: list[tuple[float, str]]) -> list[str]:
    """Return the control words that were broadcast."""
    return [text[4:8] for _, text in sent if text.startswith('400#')]


def words_of(**raws: int) -> says:
    """Return what the field ``status`` of a sentence about the group equals."""
    return says('status_words', raws=raws)


# -- on the wire ----------------------------------------------------------------------------------


def test_a_broadcast_and_one_inverter_in_turn() -> None:
    bus = Bus(*members())
    assert bus.live(0.07) == [
        (10.0, '400#7E040000'), (10.0, '002#7E040000'),
        (10.02, '400#7E040000'), (10.02, '004#7E040000'),
        (10.04, '400#7E040000'), (10.04, '006#7E040000'),
        (10.06, '400#7E040000'), (10.06, '002#7E040000')]
    assert [name for name, _ in bus.events(StationFound)] == ['lift', 'hoist', 'turn']
    assert [session.statistics.exchanges for session in bus.sessions] == [2, 1, 1]
    assert [session.statistics.rejected for session in bus.sessions] == [0, 0, 0]


@pytest.mark.parametrize(('options', 'shared', 'own'), [
    ({'broadcast': 'all'}, '408', '002'),
    ({'extended_identifiers': True}, '10000000', '00080000'),
    ({'extended_identifiers': True, 'broadcast': 'all'}, '10200000', '00080000')])
def test_other_identifiers(options: dict[str, Any], shared: str, own: str) -> None:
    assert Bus(*members(2, **options)).live(0.01) == [
        (10.0, f'{shared}#7E040000'), (10.0, f'{own}#7E040000')]


def test_the_lowest_station_leads_whatever_the_order() -> None:
    lift, hoist, turn = members()
    bus = Bus(turn, lift, hoist)
    assert [session.configuration.name for session in bus.sessions] == ['turn', 'lift', 'hoist']
    assert [len(session.setpoints.items) for session in bus.sessions] == [0, 1, 0]
    bus.live(0.07)
    facts = {name: bus.session(name).facts()['broadcast'].split() for name in ('lift', 'turn')}
    assert facts == {'lift': ['leads', 'hoist,', 'turn'], 'turn': ['led', 'by', 'lift']}
    assert bus.session('lift').enabled_by == 'lift'
    assert bus.session('turn').enabled_by == 'lift'


def test_groups_of_32_are_apart_and_others_are_alone() -> None:
    bus = Bus(inverter(name='a', station=31, broadcast='group'),
              inverter(name='b', station=32, broadcast='group'),
              inverter(name='c', station=33))
    sent = {text for _, text in bus.live(0.01)}
    assert sent == {'400#7E040000', '03E#7E040000', '401#7E040000', '040#7E040000',
                    '042#7E040000'}
    assert all(session.setpoints.items for session in bus.sessions)


def test_setpoints_and_extra_values_of_all() -> None:
    bus = Bus(*members(2, request=SETPOINTS, response=VALUES, extra_setpoints=True))
    bus.answers = {}
    assert [text for _, text in bus.live(0.01)] == [
        '400#7E04000000000000', '400#0000000000', '002#7E04000000000000', '002#0000000000']
    bus.hears('003#310B000000000000')
    bus.hears('003#0100020000')
    assert bus.session('lift').online
    lift = bus.session('lift')
    assert [text for _, text in bus.live(0.015)][2:] == [
        '004#7E04000000000000', '004#0000000000']
    bus.hears('005#310B000100020003')
    bus.hears('005#0400FFFF00')
    assert bus.events(ProcessDataReceived)[-1][1].raws == (0x0B31, 256, 512, 768, 4, -1)
    bus.asks(ENABLE)
    for number in (3, 5):
        bus.live(0.02)
        bus.hears(f'{number:03X}#370B000000000000')
        bus.hears(f'{number:03X}#0000000000')
    assert bus.outcomes() == [('enable', True, 'operation enabled')]
    for index in range(5):
        lift.services.command(index, 0.0, bus.now)
    bus.commands(50.0)
    lift.services.command(4, -50.0, bus.now)
    assert [text for _, text in bus.live(0.02)] == [
        '400#7F04004000000000', '400#000000E000', '002#7F04004000000000', '002#000000E000']


def test_the_longest_lists_decide_for_all() -> None:
    lift = inverter(name='lift', station=1, broadcast='group')
    hoist = inverter(name='hoist', station=2, broadcast='group', response=(ACTUAL, CURRENT))
    bus = Bus(lift, hoist)
    assert [text for _, text in bus.live(0.03)] == [
        '400#7E04000000000000', '002#7E04000000000000',
        '400#7E04000000000000', '004#7E04000000000000']


# -- who is there ---------------------------------------------------------------------------------


def test_each_counts_its_own_answers() -> None:
    bus = three()
    del bus.answers[2]
    bus.live(0.13)       # asked at 10.08 and 10.14
    hoist = bus.session('hoist')
    assert hoist.statistics.missed == 2
    assert hoist.online
    bus.live(0.05)       # asked at 10.2: missed 20 ms later
    assert bus.events(StationLost) == [
        ('hoist', StationLost(says(
            'silent_for_cycles', cycles=3)))]
    assert [session.statistics.missed for session in bus.sessions] == [0, 3, 0]
    assert [session.state for session in bus.sessions] == [
        DriveState.DISABLED, DriveState.OFFLINE, DriveState.DISABLED]
    bus.answers[2] = READY
    bus.live(0.06)
    assert [name for name, _ in bus.events(StationFound)] == ['hoist']


def test_an_answer_to_nothing_is_rejected_by_its_owner() -> None:
    bus = three()
    bus.hears(f'005#{READY}')
    assert [session.statistics.rejected for session in bus.sessions] == [0, 1, 0]


# -- commands -------------------------------------------------------------------------------------


def test_the_leader_commands_all() -> None:
    bus = enabled()
    lift = bus.session('lift')
    assert lift.state is DriveState.NOT_ARMED
    assert bus.commands(0.0) is CommandOutcome.ARMED
    assert bus.commands(25.0) is CommandOutcome.ACCEPTED
    assert [session.state for session in bus.sessions] == [DriveState.ONLINE] * 3
    assert sorted(text for _, text in bus.live(0.06)) == [
        '002#7F040020', '004#7F040020', '006#7F040020', *['400#7F040020'] * 3]
    assert bus.session('hoist').services.write_refusal(FREQUENCY) == (
        says('sent_by_group', leader='lift', name='frequency_setpoint'))
    assert bus.session('hoist').services.write_refusal(OFFSET) == ''


def test_a_member_that_comes_back_disarms_all() -> None:
    bus = enabled()
    lift = bus.session('lift')
    bus.commands(0.0)
    bus.commands(25.0)
    del bus.answers[3]
    bus.live(0.2)
    assert not bus.session('turn').online
    assert bus.commands(0.0) is CommandOutcome.DISABLED
    assert bus.commands(25.0) is CommandOutcome.DISABLED
    bus.answers[3] = RUNNING
    bus.live(0.07)
    assert bus.session('turn').online
    assert lift.state is DriveState.DISABLED
    assert {text for _, text in bus.live(0.06)} == {
        '400#7E040000', '002#7E040000', '004#7E040000', '006#7E040000'}


def test_parameters_are_everybodys_own() -> None:
    bus = three()
    bus.session('hoist').services.submit(read(OFFSET), bus.now)
    assert bus.pump() == ['204#9B11000000000000']
    bus.hears('205#9B11000000000700')
    (name, event), = bus.events(RequestCompleted)
    assert (name, event.outcomes[0].raw) == ('hoist', 7)


# -- control --------------------------------------------------------------------------------------


def test_enable_waits_for_the_last_one_to_be_ready() -> None:
    bus = three(control_timeout=0.2)
    bus.answers[2] = DISABLED
    bus.live(0.06)
    bus.asks(ENABLE)
    assert set(words(bus.live(0.19))) == {'7E04'}
    control = bus.session('lift').control
    assert control is not None
    each = 'lift: ready to switch on, hoist: switch-on disabled, turn: ready to switch on'
    assert control.state == each
    bus.live(0.02)
    (action, success, message), = bus.outcomes()
    assert (action, success) == ('enable', False)
    assert message == says(
        'stuck', state=each, status=words_of(lift=0x0B31, hoist=0x0B70, turn=0x0B31))


def test_only_answers_since_the_last_word_count() -> None:
    bus = three()
    bus.asks(ENABLE)
    assert words(bus.live(0.02)) == ['7F04']
    bus.asks(DISABLE)
    assert bus.outcomes() == [('enable', False, says('replaced', action='disable'))]
    assert words(bus.live(0.04)) == ['7E04'] * 2      # two of three have answered that
    assert bus.outcomes() == []
    bus.live(0.02)
    assert bus.outcomes() == [('disable', True, STANDING)]


def test_enable_needs_all_of_them() -> None:
    bus = three()
    del bus.answers[3]
    bus.live(0.2)
    bus.asks(ENABLE)
    assert bus.outcomes() == [('enable', False, 'turn offline')]
    bus.asks(DISABLE)
    bus.live(0.06)
    assert bus.outcomes() == [('disable', True, STANDING)]


def enabled(**options: Any) -> Bus:
    bus = three(**options)
    bus.asks(ENABLE)
    bus.live(0.02)
    bus.answers = dict.fromkeys((1, 2, 3), RUNNING)
    bus.live(0.1)
    assert bus.outcomes() == [('enable', True, 'operation enabled')]
    bus.events()
    return bus


@pytest.mark.parametrize('station', [1, 2, 3])
def test_a_fault_of_one_stops_all(station: int) -> None:
    bus = enabled()
    bus.answers[station] = FAULT
    bus.hears(f'{2 * station + 1:03X}#{FAULT}')      # told unasked
    assert bus.session(NAMES[station - 1]).state is DriveState.FAULT
    assert bus.session('lift').state is DriveState.FAULT
    assert words(bus.live(0.04)) == ['7E04'] * 2
    samples = bus.events(ProcessDataReceived)
    assert samples[0] == (NAMES[station - 1], ProcessDataReceived((0x0B38, 0), samples[0][1][1]))
    bus.asks(ENABLE)
    assert bus.outcomes() == [('enable', False, says('reset_first'))]


def test_reset_waits_for_all_and_ends_with_the_last() -> None:
    bus = enabled()
    bus.answers = {1: READY, 2: '3F0B0010', 3: FAULT}
    bus.live(0.06)
    bus.asks(RESET_FAULT)
    assert set(words(bus.live(0.1))) == {'7E04'}, 'hoist still brakes because of its fault'
    bus.answers[2] = FAULT
    assert 'FE04' in words(bus.live(0.08))
    bus.answers[2] = DISABLED
    bus.live(0.06)
    assert bus.outcomes() == []
    assert bus.session('lift').state is DriveState.FAULT
    bus.answers[3] = DISABLED
    bus.live(0.06)
    (action, success, _), = bus.outcomes()
    assert (action, success) == ('reset_fault', True)
    assert words(bus.live(0.02)) == ['7E04']
    assert bus.session('lift').state is not DriveState.FAULT


def test_a_lost_leader_makes_old_answers_worthless() -> None:
    bus = three()
    del bus.answers[1]      # asked at 10.06, 10.12 and 10.18
    bus.live(0.15)
    assert not bus.session('lift').online
    bus.asks(DISABLE)       # hoist has answered since, turn has not
    assert bus.outcomes() == []
    bus.live(0.02)
    assert bus.outcomes() == [('disable', True, STANDING)]


def test_what_a_lost_member_said_explains_nothing() -> None:
    bus = three(control_timeout=0.2)
    bus.answers = {1: RUNNING, 2: '500B0000'}
    bus.live(0.06)
    del bus.answers[2]
    bus.live(0.3)
    bus.asks(DISABLE)
    bus.live(0.22)
    (_, success, message), = bus.outcomes()
    assert not success
    assert message.fields['remarks'] == [says('word_not_followed', word=0x047E)]


def test_a_fault_leaves_with_the_member_that_has_it() -> None:
    bus = three()
    bus.answers[2] = FAULT
    bus.live(0.06)
    assert bus.session('lift').state is DriveState.FAULT
    del bus.answers[2]
    bus.live(0.3)
    assert not bus.session('hoist').online
    assert bus.session('lift').state is DriveState.DISABLED
    assert [event.text for name, event in bus.events(Noted) if name == 'lift'] == [
        says(
            'fault_came', ran=False,
            status=words_of(lift=0x0B31, hoist=0x0B38, turn=0x0B31))], 'nobody said it is gone'
    bus.asks(RESET_FAULT)
    assert [success for _, success, _ in bus.outcomes()] == [True]


def test_a_fault_that_stays_is_not_laid_to_the_inputs_of_another_member() -> None:
    bus = three(control_timeout=0.4)
    bus.answers = {1: '500B0000', 2: FAULT, 3: READY}       # 1: bit 5 clear, a quick stop
    bus.live(0.06)
    bus.asks(RESET_FAULT)
    bus.live(0.42)
    assert bus.outcomes() == [('reset_fault', False, says(
        'fault_present', timeout=0.4,
        status=words_of(lift=0x0B50, hoist=0x0B38, turn=0x0B31)))]


def test_a_quick_stop_goes_on_as_long_as_one_of_them_brakes() -> None:
    """Whatever the others say that stand already: disable would end the braking."""
    bus = enabled(control_timeout=0.2)
    bus.asks(QUICK_STOP)
    bus.answers = {1: DISABLED, 2: '170B0010', 3: DISABLED}
    assert set(words(bus.live(0.5))) == {'7A04'}
    (_, success, message), = bus.outcomes()
    assert not success
    assert message.fields['remarks'] == [says('word_stays')]
    bus.answers[2] = DISABLED
    assert words(bus.live(0.1))[-1] == '7E04'


def test_a_fault_of_one_ends_no_quick_stop_of_those_that_brake() -> None:
    bus = enabled()
    bus.asks(QUICK_STOP)
    bus.answers = {1: FAULT, 2: '170B0010', 3: DISABLED}
    assert set(words(bus.live(0.2))) == {'7A04'}
    assert bus.session('lift').state is DriveState.FAULT
    bus.answers[2] = DISABLED
    assert words(bus.live(0.1))[-1] == '7E04'
    assert [success for _, success, _ in bus.outcomes()] == [True]


def test_quick_stop_of_those_that_run_down_because_of_a_fault_of_one() -> None:
    """Disable lets them take the time of their ramp."""
    bus = enabled()
    bus.answers = {1: FAULT, 2: RUNNING, 3: RUNNING}
    assert words(bus.live(0.1))[-1] == '7E04'
    bus.asks(QUICK_STOP, 'hoist')
    assert set(words(bus.live(0.2))) == {'7A04'}
    bus.answers = {1: FAULT, 2: DISABLED, 3: DISABLED}
    assert words(bus.live(0.1))[-1] == '7E04'
    assert [success for _, success, _ in bus.outcomes('hoist')] == [True]
    bus.asks(ENABLE)
    assert bus.outcomes() == [('enable', False, says('reset_first'))]


def test_a_member_that_drops_out_by_itself_stops_all() -> None:
    bus = enabled()
    bus.answers[2] = '170B0010'
    bus.live(0.06)
    assert words(bus.live(0.02)) == ['7E04']
    assert [name for name, event in bus.events(Noted)
            if 'by itself' in event.text] == ['lift']


@pytest.mark.parametrize('station', [1, 3])
def test_a_member_that_is_lost_stops_all(station: int) -> None:
    bus = enabled()
    lift = bus.session('lift')
    bus.commands(0.0)
    del bus.answers[station]
    bus.live(0.22)
    assert not bus.session(NAMES[station - 1]).online
    assert words(bus.live(0.02)) == ['7E04']
    if station == 1:        # who commands is not there: neutral, too
        assert not lift.setpoints.enabled
        bus.asks(ENABLE)
        (_, success, message), = bus.outcomes()
        assert (success, message) == (False, 'lift offline')
        bus.answers = {2: READY, 3: READY}
        bus.live(0.06)
        bus.asks(QUICK_STOP)
        bus.live(0.1)
        assert bus.outcomes() == [
            ('quick_stop', False, says('members_may_run', names=['lift']))]


@pytest.mark.parametrize('action', [DISABLE, QUICK_STOP])
def test_a_member_that_ran_and_is_lost_has_not_confirmed_a_stop(action: ControlAction) -> None:
    bus = driven()
    del bus.answers[3]
    bus.live(0.3)
    assert not bus.session('turn').online
    bus.answers = {1: READY, 2: READY}
    bus.live(0.1)
    bus.asks(action)
    bus.live(0.1)
    (_, success, message), = bus.outcomes()
    assert (success, message) == (False, says('members_may_run', names=['turn']))
    bus.answers[3] = READY
    bus.live(0.2)
    bus.asks(action)
    bus.live(0.1)
    assert bus.outcomes() == [(action.value, True, STANDING)]


def test_end_while_a_member_that_ran_is_lost() -> None:
    bus = driven()
    del bus.answers[3]
    bus.live(0.3)
    bus.answers = {1: READY, 2: READY}
    bus.live(1.0)
    unheard = [('turn', 'told to stop, but it does not answer: it may still be running')]
    assert worries(bus) == unheard, 'once'
    bus.ends()
    bus.live(1.0)
    assert worries(bus) == unheard


def test_last_status_of_each_is_known_after_the_end() -> None:
    """Those of drives that run on, too: nobody calls them stopped."""
    bus = driven()
    bus.answers = {1: READY, 2: '370B0000', 3: READY}
    bus.ends()
    bus.live(1.0)
    assert all(session.stopped for session in bus.sessions)
    controls = {session.configuration.name: session.control for session in bus.sessions}
    assert {name: control and control.off for name, control in controls.items()} == {
        'lift': False, 'hoist': False, 'turn': True}, 'the first leads'
    assert controls['hoist'] is not None
    assert controls['hoist'].state == 'operation enabled'


@pytest.mark.parametrize('station, name', [(1, 'lift'), (2, 'hoist'), (3, 'turn')])
@pytest.mark.parametrize('order', [(0, 1, 2), (2, 1, 0)])
def test_member_that_falls_silent_together_with_the_stop(
        station: int, name: str, order: tuple[int, ...]) -> None:
    bus = driven()
    del bus.answers[station]
    bus.ends(*order)
    sent = bus.live(0.1)
    assert [text for _, text in sent if text.startswith('400')] == ['400#7E040000'] * STOP_CYCLES
    bus.live(1.0)
    assert all(session.stopped for session in bus.sessions)
    assert worries(bus) == [
        (name, says('may_still_be_running', why=says('stop_not_answered')))]


def test_a_late_answer_of_one_member_does_not_end_the_wait_for_another() -> None:
    bus = driven()
    bus.answers = {}
    bus.ends()
    alone = [text for _, text in bus.live(0.06) if not text.startswith('400')]
    assert sorted(text[:3] for text in alone) == ['002', '002', '004', '004', '006', '006']
    last = int(alone[-1][:3], 16)
    bus.hears(f'{last + 1:03X}#{READY}')
    assert not bus.sessions[0].stopped
    bus.live(0.4)
    assert all(session.stopped for session in bus.sessions)
    assert [name for name, _ in worries(bus)] == [
        name for station, name in enumerate(NAMES, 1) if station != last // 2]


def test_whoever_of_them_ends_first_takes_the_enable_back() -> None:
    bus = driven()
    bus.sessions[2].deactivate(bus.now)
    assert set(words(bus.live(0.05))) == {'7E04'}


def test_member_that_has_ended_misses_nothing() -> None:
    bus = Bus(*members(2))
    bus.live(0.1)
    session = bus.sessions[1]
    session.deactivate(bus.now)
    session.give_up(bus.now)
    missed, rejected = session.statistics.missed, session.statistics.rejected
    bus.live(0.2)
    bus.answers = {1: READY}
    bus.live(0.5)
    assert session.offline_advice == 'deactivated'
    assert (session.statistics.missed, session.statistics.rejected) == (missed, rejected)


@pytest.mark.parametrize('order', [(0, 1, 2), (2, 1, 0)])
def test_the_end_of_the_bridge_is_the_reason_whoever_is_told_first(order: tuple[int, ...]) -> None:
    bus = driven()
    bus.ends(*order)
    bus.live(1.0)
    noted = bus.events(Noted)
    # as a drive alone says it, and for whoever reads the log: nothing is wrong
    assert noted == [('lift', Noted(says('enable_withdrawn', whom='the drive')))]


@pytest.mark.parametrize(('action', 'word'), [(DISABLE, '7E04'), (QUICK_STOP, '7A04')])
@pytest.mark.parametrize('name', ['hoist', 'turn'])
def test_whoever_stops_a_member_stops_all(name: str, action: ControlAction, word: str) -> None:
    bus = driven()
    bus.asks(action, name)
    assert words(bus.live(0.02))[0] == word
    bus.answers = dict.fromkeys((1, 2, 3), READY)
    bus.live(0.3)
    assert bus.outcomes() == []
    assert bus.outcomes(name) == [(action.value, True, STANDING)]
    assert set(words(bus.live(0.1))) == {'7E04'}


def test_members_that_are_lost_do_not_keep_the_others_from_being_stopped() -> None:
    bus = driven()
    del bus.answers[3]
    bus.live(0.05)
    bus.asks(QUICK_STOP, 'turn')
    assert words(bus.live(0.02))[0] == '7A04'
    bus.answers = {1: READY, 2: READY}
    bus.live(3.0)
    assert bus.outcomes() == []
    (_, success, message), = bus.outcomes('turn')
    assert not success
    assert 'turn' in message


def test_stop_of_a_member_while_the_bridge_ends() -> None:
    bus = driven()
    bus.asks(QUICK_STOP, 'hoist')
    bus.ends()
    bus.live(0.3)
    assert bus.outcomes() == []
    (_, success, message), = bus.outcomes('hoist')
    assert (success, message) == (False, 'bridge inactive')


def test_members_name_their_leader() -> None:
    bus = three()
    texts = [bus.session('hoist').services.control_refusal(action) for action in ControlAction
             if action is not ControlAction.HOME]
    assert texts == [says('group_is_led', leader='lift', service='enable'), '', '',
                     says('group_is_led', leader='lift', service='reset_fault')]
    control = bus.session('hoist').control
    assert control is not None
    assert control.state == STANDING
    assert bus.session('hoist').state is DriveState.DISABLED


def test_no_fault_is_reset_by_a_leader_that_is_not_there() -> None:
    """It may be listening, with a fault that nobody has seen."""
    bus = three()
    bus.answers = {2: FAULT, 3: READY}
    bus.live(0.3)
    assert not bus.session('lift').online
    refused = bus.session('lift').services.control_refusal
    assert {action: refused(action) for action in (RESET_FAULT, DISABLE, QUICK_STOP)} == {
        RESET_FAULT: 'drive offline', DISABLE: '', QUICK_STOP: ''}


# -- stops ----------------------------------------------------------------------------------------


def driven(**options: Any) -> Bus:
    """Return a group that runs at 25 Hz."""
    bus = enabled(**options)
    assert bus.commands(0.0) is CommandOutcome.ARMED
    assert bus.commands(25.0) is CommandOutcome.ACCEPTED
    assert '400#7F040020' in [text for _, text in bus.live(0.06)]
    bus.events()
    return bus


def worries(bus: Bus) -> list[tuple[str, str]]:
    return [(name, event.text) for name, event in bus.events(Noted)
            if 'may still be running' in event.text]


def test_commands_count_from_the_last_operation_enabled_on() -> None:
    bus = three()
    lift = bus.session('lift')
    bus.asks(ENABLE)
    assert words(bus.live(0.02)) == ['7F04']
    bus.answers = {1: RUNNING, 2: RUNNING, 3: '330B0000'}
    bus.live(0.1)
    assert bus.outcomes() == []
    assert [session.state for session in bus.sessions] == [DriveState.DISABLED] * 3
    assert bus.commands(0.0) is CommandOutcome.DISABLED, 'turn is switched on'
    bus.answers[3] = RUNNING
    bus.live(0.06)
    assert bus.outcomes() == [('enable', True, 'operation enabled')]
    assert words(bus.live(0.1)) == ['7F04'] * 5
    assert lift.state is DriveState.NOT_ARMED
    assert lift.control is not None
    assert lift.control.state == 'operation enabled'
    assert bus.commands(25.0) is CommandOutcome.NOT_ARMED
    assert bus.commands(0.0) is CommandOutcome.ARMED


def test_a_member_that_comes_back_running_arms_nobody() -> None:
    bus = driven()
    bus.answers[2] = '330B0000'
    bus.live(0.06)
    assert bus.session('lift').state is DriveState.DISABLED
    bus.answers[2] = RUNNING
    bus.live(0.1)
    assert bus.commands(0.0) is CommandOutcome.DISABLED
    assert words(bus.live(0.02)) == ['7E04']


def test_stop_frames_of_a_group_that_the_bus_refuses() -> None:
    bus = driven()
    bus.refusing = lambda text: text.startswith('400')
    bus.ends()
    assert {text.split('#')[1] for _, text in bus.live(0.3)} == {'7E040000'}
    assert [session.stopped for session in bus.sessions] == [False, False, False]
    for session in bus.sessions:
        session.give_up(bus.now)
    bus.pump()
    assert all(session.stopped for session in bus.sessions)
    assert worries(bus) == [(name, says('may_still_be_running', why=says('stop_not_possible')))
                            for name in NAMES]


def test_member_whose_frame_is_refused_gets_one_before_the_stop_ends() -> None:
    """It may be one that does not listen to broadcasts."""
    bus = driven()
    asked: list[str] = []

    def refusing(text: str) -> bool:
        asked.append(text)
        return text.startswith('004') and asked.count(text) < 3
    bus.refusing = refusing
    bus.ends()
    sent = [text for _, text in bus.live(1.0)]
    assert {text[:3] for text in sent} == {'400', '002', '004', '006'}
    assert all(session.stopped for session in bus.sessions)
    assert worries(bus) == []


def test_enable_that_only_one_of_them_got_has_its_stop_pending() -> None:
    bus = three()
    bus.refusing = lambda text: text.startswith('400')
    bus.asks(ENABLE)
    assert [text for _, text in bus.live(0.02)] == ['002#7F040000']
    bus.unplugged()
    assert worries(bus) == [
        ('lift', says('may_still_be_running', why=says('bus_lost_before_stop')))]


def test_a_frame_that_answers_nothing_does_not_show_that_a_stop_was_heard() -> None:
    """What a member has shown to have heard ends with the next broadcast that may run it."""
    bus = three()
    bus.asks(ENABLE)
    assert [text for _, text in bus.live(0.02)] == ['400#7F040000', '002#7F040000']
    bus.asks(DISABLE)
    assert [text for _, text in bus.live(0.02)] == ['400#7E040000', '004#7E040000']
    bus.hears(f'007#{READY}')       # twice, say: it was asked before enable only
    bus.unplugged()
    assert [name for name, _ in worries(bus)] == ['lift', 'turn'], 'hoist has answered its stop'


# -- whose turn it is -----------------------------------------------------------------------------


def test_a_turn_that_the_bus_refused_is_not_repeated() -> None:
    bus = three()
    bus.refusing = lambda text: bus.now < 10.07
    bus.live(0.02)      # the cycle of 10.06 s, which was the turn of the first one
    assert [text[:3] for _, text in bus.live(0.05)][:4] == ['400', '004', '400', '006']


# -- the life of a group --------------------------------------------------------------------------


def test_stop_reaches_everybody() -> None:
    bus = Bus(*[inverter(name=f'drive_{station}', station=station, broadcast='group')
                for station in range(1, 8)])
    bus.live(0.15)
    bus.ends()
    assert not any(session.stopped for session in bus.sessions)
    sent = [text for _, text in bus.live(1.0)]
    assert [text for text in sent if text.startswith('400')] == ['400#7E040000'] * STOP_CYCLES
    assert {text[:3] for text in sent} == {'400', '002', '004', '006', '008', '00A', '00C', '00E'}
    assert all(session.stopped for session in bus.sessions)
    assert all(session.next_timer() == math.inf for session in bus.sessions)
    assert sum(session.statistics.rejected for session in bus.sessions) == 0
    assert {event.reason for _, event in bus.events(StationLost)} == {'deactivated'}


# -- what may not differ --------------------------------------------------------------------------


def complaints(*drives: DriveConfiguration) -> list[tuple[str, str, str]]:
    return [(entry.name, key, message)
            for entry, (key, message) in FAMILIES['cannord'].check_together(drives)]


def test_a_group_that_fits() -> None:
    assert complaints(*members()) == []
    assert complaints(*members(2), inverter(
        name='alone', station=9, period=1.0, request=(), parameter_set=2)) == []


LED = 'drive lift, which leads its broadcast group'


@pytest.mark.parametrize(('options', 'key', 'found'), [
    ({'request': SETPOINTS[1:2]}, 'cyclic_request', says('request_differs', leader=LED)),
    ({'period': 0.1}, 'period', says('period_differs', period=0.1, other=0.02, leader=LED)),
    ({'parameter_set': 2}, 'parameter_set',
     says('option_differs', value='2', other='1', leader=LED)),
    ({'swap_setpoints_2_3': True}, 'swap_setpoints_2_3',
     says('option_differs', value='true', other='false', leader=LED)),
    ({'extra_setpoints': True}, 'extra_setpoints',
     says('option_differs', value='true', other='false', leader=LED))])
def test_differences(options: dict[str, Any], key: str, found: says) -> None:
    lift, hoist = members(2)
    other = inverter(name='turn', station=3, broadcast='group', **options)
    assert complaints(hoist, other, lift) == [('turn', key, found)]


@pytest.mark.parametrize(('change', 'differs'), [
    ({'scale': 100 / 16384}, says('type_differs', name='frequency_setpoint', leader=LED)),
    *[({key: value}, says('range_differs', name='frequency_setpoint', leader=LED))
      for key, value in (('maximum', 10.0), ('minimum', -10.0), ('neutral', 5.0))],
    ({'neutral': 0.0, 'limit': True},
     says('limit_differs', name='frequency_setpoint', leader=LED))])
def test_the_same_word_means_and_is_allowed_the_same_everywhere(
        change: dict[str, Any], differs: says) -> None:
    """What the leader may be told, all are told."""
    other = drive('cannord', name='turn', station=3, broadcast='group', response=(ACTUAL,),
                  request=(replace(FREQUENCY, **change),), table=PARAMETERS)
    assert complaints(*members(1), other) == [('turn', 'cyclic_request', differs)]


def test_members_that_have_not_answered_yet_do_not_run_on() -> None:
    """They are polled in turn: in a large group that takes longer than any stop."""
    control = make_control(parameter_set=1, timeout=2.0, members=['a', 'b', 'c'])
    for name in ('a', 'b', 'c'):
        control.member_found(name)
    control.word_sent(0.0)
    for step in range(10):
        control.status_received(0x0B31, 0.1 + 0.5 * step, 'a')
        assert control.disregard == ''
    for step in range(10, 20):
        control.status_received(0x0F37, 0.1 + 0.5 * step, 'b')
    assert control.disregard == says('disregards', action='disable', word=0x047E)
