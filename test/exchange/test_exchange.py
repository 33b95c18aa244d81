# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The exchange of one bus, without a bus: routing, time, stops, and who is told what."""

from dataclasses import replace
import threading
import time

from builders import (
    CONTROL, drive, frame, GAIN, INT16, parameter, RAMP, read, RO, SPEED, WORD, write)
from clocks import HandClock, REAL
from exchange_builders import all_routes, Bench, BusNotes
from jumping import JumpingClock
import pytest
from saying import says
from stops import STOP_CYCLES, UNANSWERED_CYCLES
from waiting import wait_for
import world

from drive_can_bridge.clock import SystemThread
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.core.events import (
    ForeignMasterSeen, Noted, RequestCompleted, SetpointsExpired, StationFound, StationLost,
)
from drive_can_bridge.core.frame import Route
from drive_can_bridge.core.profile import FaultTable
from drive_can_bridge.core.requests import ReadValue
from drive_can_bridge.exchange.exchange import (
    BusExchange, LOOK_PERIOD, PASS_PERIOD, PeriodicTask, stop_all,
)

ZEROS = '0000000000000000'
NEUTRAL = f'003FFFF0#{ZEROS}'
ASK_MAP_1, ASK_MAP_2 = f'002007A4#{ZEROS}', f'004007A4#{ZEROS}'
ANSWER = '103FFFF0#03E800FA00010000'


@pytest.fixture(name='clock')
def _clock(bench: world.World) -> JumpingClock:
    return bench.clock


def running() -> Bench:
    """Return one whose drive was told to run, at 10.02 s."""
    bench = Bench(drive(rearm_immediate=True)).online()
    bench.notes[0].commands.append((0, 100.0))
    assert bench.at(10.02) == ['003FFFF0#03E8000000000000']
    return bench


# -- routing --------------------------------------------------------------------------------------


def test_both_begin_when_bus_and_activity_are_there() -> None:
    bench = Bench()
    bench.exchange.bus_opened()
    assert bench.link.take() == []
    bench.exchange.activate()
    assert bench.link.take() == [ASK_MAP_1, ASK_MAP_2]
    assert bench.exchange.bus_state == 'up'
    assert bench.bus_notes.told == [('opened', 'main')]


@pytest.mark.parametrize('text', [
    '106007A4#0032003300000000',      # station 3
    '7A4#0032003300000000', '000#',   # 11 bits
])
def test_frames_of_nobody_are_counted_by_the_bus(text: str) -> None:
    bench = Bench().begin()
    bench.link.take()
    assert bench.hears(text, 10.001) == []
    assert bench.exchange.frames_rejected == 1
    assert [session.statistics.rejected for session in bench.sessions] == [0, 0]


def test_rejected_frames_of_a_drive_are_its_own() -> None:
    bench = Bench()
    bench.hears('104001E0#0000000000000000', 10.0)
    assert bench.exchange.frames_rejected == 0
    assert [session.statistics.rejected for session in bench.sessions] == [0, 1]


@pytest.mark.parametrize('broadcast', ['none', 'group', 'all'])
@pytest.mark.parametrize(('text', 'hearers'), [
    ('408#7F040020', [0, 1, 2]), ('400#7F040020', [0, 1]), ('401#7F040020', [2]),
    ('402#7F040020', []), ('10200000#7F040020', [3]), ('10000000#7F040020', [3])])
def test_a_foreign_broadcast_is_told_of_each_drive_that_would_obey(
        broadcast: str, text: str, hearers: list[int]) -> None:
    bench = Bench(*[drive(
        'cannord', name=name, station=station, request=(), response=(), broadcast=broadcast,
        extended_identifiers=name == 'four')
        for name, station in (('one', 1), ('two', 31), ('three', 32), ('four', 1))])
    bench.hears(text, 10.0)
    assert [[type(event) for event in notes.events] for notes in bench.notes] == [
        [ForeignMasterSeen] if index in hearers else [] for index in range(4)]
    assert bench.exchange.frames_rejected == (not hearers)
    assert [session.statistics.rejected for session in bench.sessions] == [0] * 4


@pytest.mark.interpreted    # opens nothing
def test_routes_become_filters_of_the_link(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench()
    counted = Route(0x000, 0x7FF, False)
    made = BusExchange(BusConfiguration('main', 'virtual', 'x'), bench.sessions, bench.routes,
                       BusNotes(), REAL, counted=[counted])
    opened: list[list[Route]] = []
    monkeypatch.setattr('drive_can_bridge.transport.link.open_port',
                        lambda bus, clock, routes, stations: opened.append(list(routes)))
    made.link._open()
    assert opened == [[*all_routes(bench), counted]]
    assert made.link._send_timeout == pytest.approx(0.01)  # half a cycle


# -- time -----------------------------------------------------------------------------------------


def test_samples_and_events_reach_their_listener() -> None:
    bench = Bench().online()
    first, second = bench.notes
    assert [event.raws for event in first.samples] == [(1000, 250, 1)]
    assert first.samples[0].received_at == 10.002
    assert first.events == [StationFound()]
    assert second.samples == second.events == []


def test_age_of_a_frame_is_taken_off_its_stamp() -> None:
    bench = Bench().online()
    bench.at(10.02)
    bench.hears(ANSWER, 10.025, age=0.004)
    assert bench.notes[0].samples[-1].received_at == pytest.approx(10.021)


def test_commands_are_taken_just_before_a_cycle() -> None:
    bench = Bench(drive(rearm_immediate=True)).online()
    bench.notes[0].commands.append((0, 100.0))
    assert bench.at(10.01) == []
    assert bench.notes[0].commands
    assert bench.at(10.02) == ['003FFFF0#03E8000000000000']
    assert not bench.notes[0].commands


def test_a_drive_that_comes_after_a_slow_one_has_the_time_of_its_own_turn() -> None:
    bench = Bench(drive(name='first', station=1, mapping='assume', rearm_immediate=True),
                  drive(name='second', station=2, mapping='assume', rearm_immediate=True)).begin()
    for step in range(4):
        bench.at(10.0 + 0.01 * step)
        for station in (1, 2):
            bench.hears(f'{0x10 << 24 | 0x1FFFF0 + (station << 21):08X}#03E800FA00010000',
                        10.001 + 0.01 * step)
    assert [session.online for session in bench.sessions] == [True, True]
    first, second = bench.notes

    def take_for_long(now: float) -> None:
        bench.now = now + 0.004
    first.take_commands = take_for_long  # type: ignore[method-assign]
    second.commands.append((0, 100.0))
    bench.at(10.1)          # both are late
    assert second.session.setpoints.items[0].commanded_at == pytest.approx(10.104)


def _answer_both(bench: Bench, now: float) -> None:
    for station in (1, 2):
        bench.hears(f'{0x10 << 24 | 0x1FFFF0 + (station << 21):08X}#03E800FA00010000', now)


@pytest.mark.parametrize('whose', [0, 1])
@pytest.mark.parametrize(('seconds', 'told'), [(0.2, '07D0'), (0.3, '03E8'), (1.5, None)])
def test_who_is_served_after_a_stall_in_the_midst_of_a_pass_gets_nothing_stale(
        whose: int, seconds: float, told: str | None) -> None:
    bench = Bench(*[drive(name=name, station=station, mapping='assume', rearm_immediate=True,
                          command_timeout=5.0)
                    for name, station in (('first', 1), ('second', 2))])
    for session in bench.sessions:
        session.phase = 0.0     # both are due at once
    bench.begin()
    second = bench.notes[1]
    for step in range(4):
        second.commands.append((0, 100.0))
        bench.at(10.0 + 0.02 * step)
        _answer_both(bench, 10.001 + 0.02 * step)
    assert bench.at(10.08)[1] == '005FFFF0#03E8000000000000'
    _answer_both(bench, 10.081)
    take = bench.notes[whose].take_commands

    def stall(now: float) -> None:
        take(now)
        bench.now += seconds
        second.commands.append((0, 200.0))     # comes while the process stands still
        bench.notes[whose].take_commands = take  # type: ignore[method-assign]
    bench.notes[whose].take_commands = stall  # type: ignore[method-assign]
    discarded = second.discarded
    sent = [text for text in bench.at(10.1) if text.startswith('005FFFF0#')]
    if told is None:
        assert all(text == f'005FFFF0#{ZEROS}' for text in sent)
        assert not second.session.online
    elif whose == 1:    # it has taken what there was
        assert sent == ['005FFFF0#03E8000000000000']
    else:
        assert sent == [f'005FFFF0#{told}000000000000']
    assert second.discarded == discarded + (seconds > 0.25)
    bench.at(bench.now + 0.001)     # and that is judged once
    assert second.discarded == discarded + (seconds > 0.25)


def test_an_enable_that_comes_with_the_end_of_a_stall_finds_the_drive_lost() -> None:
    bench = Bench(drive(control=CONTROL)).online()
    bench.now = 11.5        # no pass has noticed it yet
    bench.exchange.submit(bench.sessions[0], ControlRequest(ControlAction.ENABLE))
    assert not bench.sessions[0].online
    assert [event.success for event in bench.notes[0].events
            if isinstance(event, ControlCompleted)] == [False]


def test_pass_says_when_the_next_is_due() -> None:
    bench = Bench(drive()).online()
    assert bench.exchange._pass() == pytest.approx(10.02)
    bench.at(10.02)
    assert bench.exchange._pass() == pytest.approx(10.04)
    idle = Bench()
    assert idle.exchange._pass() == pytest.approx(10.0 + PASS_PERIOD)


def test_commands_do_not_wait_for_a_slow_drive() -> None:
    """How old a command is counts from when it came: it is never far from when it is taken."""
    bench = Bench(drive(rearm_immediate=True, period=0.8, command_timeout=0.3, mapping='assume'))
    bench.begin()
    while not bench.sessions[0].online:
        now = bench.exchange._pass()
        bench.at(now)
        bench.hears(ANSWER, now + 0.001)
    begin = bench.now
    bench.notes[0].commands.append((0, 100.0))
    while bench.now < begin + 0.7:
        bench.at(bench.exchange._pass())
        assert not bench.notes[0].commands or bench.now < begin + LOOK_PERIOD
    assert not any(setpoint.armed for setpoint in bench.sessions[0].setpoints.items)
    assert [event for event in bench.notes[0].events if isinstance(event, SetpointsExpired)]


def test_lost_time_is_noticed_by_the_timer() -> None:
    bench = running()
    bench.hears(ANSWER, 10.021)
    bench.notes[0].commands.append((0, 100.0))

    sent = bench.at(11.03)

    assert bench.notes[0].discarded == 2  # at activation, and now
    assert bench.notes[0].commands == []
    assert sent == ['00300321#0000000000000000']    # it was told to run, so it is stopped
    assert bench.notes[0].events[-1] == StationLost(says('bridge_stood_still'))
    assert not bench.sessions[0].online


def test_a_little_less_is_not_lost() -> None:
    bench = Bench(drive()).online()
    bench.at(10.02)
    bench.hears(ANSWER, 10.021)
    assert bench.at(11.0199) == [NEUTRAL]
    assert bench.sessions[0].online


def test_lost_time_is_noticed_by_the_reader_first() -> None:
    bench = Bench(drive(rearm_immediate=True)).online()
    bench.at(10.02)
    # the answer lay in a queue while the process stood still
    assert bench.hears(ANSWER, 15.0) == [ASK_MAP_1]
    assert len(bench.notes[0].samples) == 1
    assert not bench.sessions[0].online
    assert bench.at(15.0) == []
    assert bench.notes[0].discarded == 2


def test_time_is_not_lost_while_inactive() -> None:
    bench = Bench(drive())
    bench.at(10.0)
    bench.at(500.0)
    assert bench.notes[0].discarded == 0
    bench.now = 900.0
    bench.begin()
    assert bench.link.take() == [ASK_MAP_1]
    assert bench.at(900.001) == []
    assert bench.notes[0].discarded == 1


# -- stopping -------------------------------------------------------------------------------------


def test_deactivate_waits_for_the_neutral_cycles() -> None:
    bench = running()
    bench.step = 0.001  # the timer thread is not there: whoever waits does its work
    assert bench.exchange.deactivate() is True
    assert bench.link.take() == [NEUTRAL] * 6   # nobody answers
    assert bench.sessions[0].stopped
    assert bench.now < 10.4
    assert not bench.exchange.active


def test_deactivate_with_the_timer_thread(clock: JumpingClock) -> None:
    bench = Bench(drive(period=0.005, mapping='assume'), clock=clock)
    bench.exchange.bus_opened()
    bench.exchange.open()
    assert bench.link.started
    bench.exchange.activate()
    wait_for(lambda: len(bench.link.sent) >= 5)
    assert bench.exchange.deactivate() is True
    sent = bench.link.take()
    assert set(sent) == {NEUTRAL}
    assert len(sent) >= 8
    assert bench.sessions[0].stopped
    bench.exchange.close()
    assert bench.link.stopped
    assert not clock.tasks
    assert bench.bus_notes.told == [('opened', 'main')]


def test_a_periodic_task_keeps_its_time_where_no_drive_wants_anything(clock: JumpingClock) -> None:
    bench, done = Bench(clock=clock), list[float]()
    begun = clock.now()
    bench.exchange.periodic_task = PeriodicTask(done.append)
    bench.exchange.periodic_task.begin(PASS_PERIOD / 5, begun)
    bench.exchange.open()
    clock.live(PASS_PERIOD * 2.1)
    assert done == [pytest.approx(begun + PASS_PERIOD / 5 * turn, abs=1e-3)
                    for turn in range(1, 11)]
    bench.exchange.periodic_task.end()
    clock.live(PASS_PERIOD)
    assert len(done) == 10
    bench.exchange.close()


@pytest.mark.interpreted    # replaces a method
def test_the_reader_makes_the_passes_as_long_as_it_is_back_in_time(clock: JumpingClock) -> None:
    bench = Bench(drive(period=0.005, mapping='assume'), clock=clock)
    exchange = bench.exchange
    exchange.bus_opened()
    exchange.open()
    exchange.activate()
    wait_for(lambda: bench.link.sent)
    passes: list[str] = []
    make = exchange._pass

    def note() -> float:
        passes.append(clock.current.name)
        return make()
    exchange._pass = note  # type: ignore[method-assign]

    def read(end: float) -> None:
        while clock.now() < end:
            clock.wait(clock.now() + exchange._keep_time(0.02))
    me, begun = clock.current.name, clock.now()
    read(begun + 0.1)
    passes.clear()
    bench.link.take()
    read(begun + 0.2)
    assert set(passes) == {me}
    assert len(bench.link.take()) == 20     # one every 5 ms, as ever
    # somebody rings: the timer thread does not wait for the reader
    passes.clear()
    exchange._wake.ring()
    clock.wait(clock.now() + 1e-6)
    assert passes == ['exchange main']
    # and it goes on, where the reader does not come back
    passes.clear()
    clock.wait(clock.now() + 0.1)
    assert set(passes) == {'exchange main'}
    assert len(bench.link.take()) >= 15     # but for the 20 ms in which it was waited for
    exchange.deactivate()
    exchange.close()


@pytest.mark.interpreted    # replaces a method
def test_the_timer_thread_does_not_oversleep_what_the_reader_has_found_out(
        clock: JumpingClock) -> None:
    bench = Bench(drive(period=0.005), clock=clock)
    exchange = bench.exchange
    exchange.open()
    exchange.bus_opened()
    clock.wait(clock.now() + 0.3)       # nothing is to be done, and it sleeps for PASS_PERIOD
    exchange._keep_time(0.02)
    # as by a frame that makes something due
    exchange._wake_at = exchange._members[0].due = due = clock.now() + 0.01
    exchange._keep_time(0.02)
    passed: list[float] = []
    make = exchange._pass

    def note() -> float:
        passed.append(clock.now())
        return make()
    clock.wait(due - 0.005)
    exchange._pass = note  # type: ignore[method-assign]
    clock.wait(due + 0.1)       # the reader does not come back
    assert passed[0] == pytest.approx(due + 0.02)
    exchange.close()


def test_what_a_frame_makes_due_wakes_nobody_but_the_reader() -> None:
    bench = Bench(drive(period=5.0, mapping='assume', parameter_retries=0,
                        parameter_timeout=0.02))
    exchange = bench.exchange
    bench.begin()
    bench.at(10.0)
    exchange._keep_time(0.02)
    while exchange._wake.wait(0.0):
        pass
    for back, rings in ((10.02, False), (9.97, True)):  # it is back; it is not
        exchange._back_at, exchange._wake_at = back, 20.0
        bench.hears('7F1#00', 10.001)
        bench.hears(ANSWER, 10.001)
        assert exchange._wake.wait(0.0) is rings
        assert (exchange._wake_at < 20.0) is not rings


def test_no_answer_that_only_waits_for_a_late_reader_is_missed() -> None:
    bench = Bench(*(drive(name=f'drive{station}', station=station, period=0.01, mapping='assume')
                    for station in range(1, 9)))
    bench.begin()
    for _ in range(100):
        bench.now += 0.007      # the interpreter is others', and each turn late
        bench.exchange._keep_time(0.02)
        bench.link.coming += [frame(f'{int(sent[:8], 16) | 1 << 28:08X}#03E800FA00010000')
                              for sent in bench.link.take()]
        if bench.link.coming:       # one by one, as a link reads
            bench.exchange.frame_received(bench.link.coming.pop(0), 0.0)
    assert [session.statistics.missed for session in bench.sessions] == [0] * 8
    assert all(session.online for session in bench.sessions)


def test_a_bus_that_is_flooded_keeps_no_late_cycle_waiting() -> None:
    bench = Bench()
    bench.online()
    bench.link.coming = [frame('7F1#00')] * 1000
    bench.now += 0.1
    bench.exchange._keep_time(0.02)
    assert bench.link.take()
    assert len(bench.link.coming) == 1000 - len(bench.sessions)


@pytest.mark.interpreted    # replaces a property
def test_deactivate_gives_up_in_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(drive()).online()
    bench.step = 0.01
    monkeypatch.setattr(BusExchange, 'stopped', False)
    started = bench.now
    assert bench.exchange.deactivate() is False
    assert 0.5 < bench.now - started < 1.2


@pytest.mark.usefixtures('threads')
def test_a_stop_that_somebody_else_has_begun_is_waited_for() -> None:
    bench = running()
    bench.step = 0.001
    with bench.exchange.lock:
        bench.exchange._begin_stop(bench.now)
    assert not bench.exchange.active
    assert stop_all([bench.exchange], HandClock(bench.clock)) == {}
    assert bench.link.take() == [NEUTRAL] * UNANSWERED_CYCLES   # and not begun anew
    assert stop_all([bench.exchange], HandClock(bench.clock)) == {}
    assert bench.link.take() == []


@pytest.mark.usefixtures('threads')
@pytest.mark.parametrize('started', [0, 1])
def test_buses_are_stopped_though_no_more_threads_can_be_started(
        started: int, monkeypatch: pytest.MonkeyPatch) -> None:
    benches = [running() for _ in range(3)]
    for name, bench in zip(('one', 'two', 'three'), benches):
        bench.exchange.bus = replace(bench.exchange.bus, name=name)
        bench.step = 0.001
    benches[1].link.refusing = True
    active: list[bool] = []    # the third, while the second one's stop is waited for
    monkeypatch.setattr(benches[1].exchange, '_sleep',
                        lambda _: active.append(benches[2].exchange.active))
    clock = HandClock(benches[0].clock)
    threads = iter(range(3))

    def start(thread: SystemThread) -> None:
        if next(threads) >= started:
            raise RuntimeError("can't start new thread")
        threading.Thread.start(thread)
    monkeypatch.setattr(SystemThread, 'start', start)
    assert stop_all([bench.exchange for bench in benches], clock) == {'two': 'the bus blocks'}
    assert [bench.link.take() for bench in benches] == [
        [NEUTRAL] * UNANSWERED_CYCLES, [], [NEUTRAL] * UNANSWERED_CYCLES]
    assert active and not any(active)


def test_stop_frames_that_the_bus_refuses_are_no_stop() -> None:
    bench = running()
    bench.step = 0.001
    bench.link.refusing = True
    assert bench.exchange.deactivate() is False
    assert bench.sessions[0].stopped
    assert bench.notes[0].events[-2:] == [
        Noted(says(
            'may_still_be_running', why=says('stop_not_possible')), warning=True, danger=True),
        StationLost('deactivated', ordered=True)]


def test_stop_that_comes_with_the_end_of_a_stall() -> None:
    bench = running()
    bench.now, bench.step = 11.5, 0.001     # no pass has noticed it yet
    assert bench.exchange.deactivate() is True
    # nobody knows the maps any more: by number, three times, because nobody confirms it
    assert bench.link.take().count('00300321#0000000000000000') >= 3
    assert any(isinstance(event, Noted) and event.text == says('may_still_be_running')
               for event in bench.notes[0].events)


def test_a_process_that_stands_still_during_a_stop_ends_it_all_the_same(
        monkeypatch: pytest.MonkeyPatch) -> None:
    bench = running()
    bench.step = 0.001
    stalls = [3.0, 0.0, 2.0]

    def sleep(_: float) -> None:
        bench.now += stalls.pop(0) if stalls else 0.0
    monkeypatch.setattr(time, 'sleep', sleep)
    assert bench.exchange.deactivate() is True
    assert bench.link.take() == [NEUTRAL] * UNANSWERED_CYCLES
    assert not stalls


def test_silent_member_of_a_broadcast_group_goes_offline() -> None:
    setpoint = parameter('speed_setpoint', None, type=INT16, scale=0.1, unit='%')
    group = [drive('cannord', name=name, station=station, broadcast='all', request=(setpoint,),
                   response=(), table=(setpoint,)) for name, station in (('one', 1), ('two', 2))]
    bench = Bench(*group).begin()
    now = 10.0
    answers = {'002': '003#310B0000', '004': '005#310B0000'}
    for step in range(40):
        now = 10.0 + 0.02 * step
        for text in bench.at(now):
            identifier = text.partition('#')[0]
            if identifier in answers:
                bench.hears(answers[identifier], now + 0.001)
        if step == 20:
            assert [session.online for session in bench.sessions] == [True, True]
            del answers['004']      # its cable is cut
    assert [session.online for session in bench.sessions].count(True) == 1
    lost = [notes for notes in bench.notes if any(
        isinstance(event, StationLost) for event in notes.events)]
    assert len(lost) == 1


def test_fault_of_one_stops_its_broadcast_group_at_once() -> None:
    """The frame is for one session, the answer to it the business of another one's timer."""
    setpoint = parameter('speed_setpoint', None, type=INT16, scale=0.1, unit='%')
    bench = Bench(*[drive(
        'cannord', name=name, station=station, broadcast='all', period=2.0, control_timeout=9.0,
        request=(setpoint,), response=(), table=(setpoint,))
        for name, station in (('one', 1), ('two', 2))])
    exchange, answers = bench.exchange, {'002': '003#310B0000', '004': '005#310B0000'}
    bench.begin()

    def live(end: float) -> None:
        while bench.now < end:
            for text in bench.at(bench.now + 0.1):
                if text[:3] in answers:
                    bench.hears(answers[text[:3]], bench.now + 0.001)
    live(12.5)
    exchange.submit(bench.sessions[0], ControlRequest(ControlAction.ENABLE))
    live(16.5)
    answers = {'002': '003#370F0020', '004': '005#370F0020'}
    live(20.5)
    outcome, = [event for event in bench.notes[0].events if isinstance(event, ControlCompleted)]
    assert outcome.success, outcome.message
    exchange._wake_at = exchange._pass()
    while exchange._wake.wait(0.0):
        pass
    bench.hears('005#380B0000', bench.now + 0.01)       # told unasked
    assert exchange._wake.wait(0.0)
    assert [text for text in bench.at(bench.now + 0.001) if text.startswith('408')] == [
        '408#7E040000']


def test_deactivate_without_a_bus_is_done_at_once() -> None:
    bench = Bench()
    bench.exchange.activate()
    assert bench.exchange.deactivate() is True
    assert bench.link.take() == []


# -- users ----------------------------------------------------------------------------------------


def test_requests_are_sent_at_once_and_answered_as_events() -> None:
    bench = Bench(drive()).online()
    request = read(GAIN)
    bench.now = 10.003
    bench.exchange.submit(bench.sessions[0], request)
    assert bench.link.take() == [f'00200281#{ZEROS}']
    bench.hears('10200281#0007000000000000', 10.004)
    assert bench.notes[0].events[-1] == RequestCompleted(request, (ReadValue(7),))


def test_the_number_of_a_fault_is_asked_for_at_once() -> None:
    """Not with the next cycle: its time would be over by then."""
    code = parameter('fault_code', 217, access=RO)
    conveyor = drive(period=0.5, parameter_timeout=0.1, parameter_retries=0)
    bench = Bench(replace(conveyor, profile=replace(
        conveyor.profile, parameters={**conveyor.profile.parameters, 'fault_code': code},
        fault=FaultTable('fault_code', ((7, 'overcurrent'),), ('status_word', 8))))).online()
    assert bench.at(10.5) == [NEUTRAL]
    assert bench.hears('103FFFF0#03E800FA00080000', 10.502) == [f'00200D91#{ZEROS}']
    bench.hears('10200D91#0007000000000000', 10.504)
    assert bench.notes[0].events[-1] == Noted(
        says('fault_named', number='7', name='overcurrent'), warning=True)


def test_control_request_is_answered_by_an_event() -> None:
    bench = Bench(drive(control=CONTROL, request=(WORD, SPEED), mapping='assume')).begin()
    bench.at(10.0)
    bench.hears(ANSWER, 10.002)
    bench.at(10.02)
    bench.hears(ANSWER, 10.022)
    request = ControlRequest(ControlAction.DISABLE)
    bench.exchange.submit(bench.sessions[0], request)
    outcome, = [event for event in bench.notes[0].events if isinstance(event, ControlCompleted)]
    assert outcome.request is request
    assert outcome.success


def test_reconfigure() -> None:
    bench = Bench(drive())
    bench.exchange.reconfigure(bench.sessions[0], command_timeout=0.1)
    assert bench.sessions[0].setpoints.timeout == 0.1


# -- the bus --------------------------------------------------------------------------------------


def test_bus_that_is_lost_and_comes_back() -> None:
    bench = Bench(drive()).online()
    bench.exchange.bus_lost('unplugged')
    assert (bench.exchange.bus_state, bench.exchange.bus_reason) == ('down', 'unplugged')
    assert bench.notes[0].events[-1] == StationLost(
        says('bus_is_down', bus='main', reason='unplugged'))
    assert bench.at(10.1) == []
    bench.exchange.bus_opened()
    assert bench.link.take() == [ASK_MAP_1]
    assert (bench.exchange.bus_state, bench.exchange.bus_reason) == ('up', '')
    assert bench.bus_notes.told == [
        ('opened', 'main'), ('lost', 'main', 'unplugged'), ('opened', 'main')]


def test_bits_on_the_bus() -> None:
    bench = Bench(drive()).begin()
    assert bench.exchange.sent_bits == 131       # without stuff bits, as in the golden vectors
    bench.hears('7F1#2211000000000000', 10.001)
    assert bench.exchange.received_bits == 111
    bench.hears('102007A4#00320033', 10.002)
    assert bench.exchange.received_bits == 111 + 99


def test_frames_that_were_not_sent_do_not_count() -> None:
    bench = Bench(drive())
    bench.link.refusing = True
    bench.begin()
    assert bench.exchange.sent_bits == 0


# -- what must not happen -------------------------------------------------------------------------


#: how ``ZeroDivisionError('a defect')`` is told
DEFECT = 'internal error: ZeroDivisionError: a defect'


def test_misconfigured_bus_is_fatal() -> None:
    bench = Bench(drive())
    bench.exchange.bus_misconfigured('unknown')
    assert bench.bus_notes.told == [('fatal', 'main', 'unknown', True)]
    assert bench.exchange.bus_state == 'misconfigured'


def test_defect_of_the_reader_is_fatal() -> None:
    bench = Bench(drive())
    reason = 'KeyError: 5'
    bench.exchange.link_failed(reason)
    assert bench.bus_notes.told == [('fatal', 'main', f'internal error: {reason}', False)]
    assert bench.exchange.bus_state == 'failed'


@pytest.mark.interpreted    # a task that only looks like one
def test_defect_in_the_timer_thread_is_told_not_swallowed(clock: JumpingClock) -> None:
    bench = Bench(drive(mapping='assume', period=0.005), clock=clock)
    failing = False

    class Broken:
        def run(self, now: float) -> float:
            if failing:
                raise ZeroDivisionError('a defect')
            return now + 0.01
    bench.exchange.periodic_task = Broken()  # type: ignore[assignment]
    bench.exchange.bus_opened()
    bench.exchange.open()
    bench.exchange.activate()
    wait_for(lambda: bench.link.sent)
    failing = True
    wait_for(lambda: len(bench.bus_notes.told) > 1)
    assert bench.bus_notes.told[-1] == ('fatal', 'main', DEFECT, False)
    # the lock is free, and the drives are stopped all the same
    bench.link.take()
    assert bench.exchange.deactivate() is True
    assert bench.link.take() == [NEUTRAL] * STOP_CYCLES
    bench.exchange.close()


@pytest.mark.parametrize(('broken', 'stopped'), [('handle_timer', False), ('deactivate', True)])
def test_a_session_that_fails_keeps_no_other_from_its_stop(
        broken: str, stopped: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(drive(name='first', station=1, mapping='assume'),
                  drive(name='second', station=2, mapping='assume')).begin()
    bench.at(10.0)
    bench.at(10.02)

    def fail(*_: object) -> None:
        raise ZeroDivisionError('a defect')
    monkeypatch.setattr(bench.sessions[0], broken, fail)
    bench.link.take()
    bench.step = 0.001
    # where it cannot be said that all of them were stopped, whoever asked is told
    assert bench.exchange.deactivate() is stopped
    sent = bench.link.take()
    assert [text for text in sent if text.startswith('005')] == [
        f'005FFFF0#{ZEROS}'] * STOP_CYCLES
    assert [text for text in sent if text.startswith('003')] == [
        NEUTRAL] * STOP_CYCLES * stopped
    assert bench.sessions[1].stopped
    assert bench.exchange.bus_reason == ('' if stopped else f'first: {DEFECT}')


def test_frames_that_nobody_else_should_send_are_counted() -> None:
    bench = Bench(drive('canopen_pkw', name='first', station=1)).begin()
    bench.hears('080#', 10.1)           # SYNC, and a PDO of the node
    bench.hears('181#0000', 10.2)
    assert bench.exchange.frames_rejected == 2
    bench.hears('000#8100', 10.3)       # NMT: reset all nodes
    bench.hears('000#0201', 10.4)
    assert [event.text.code for event in bench.notes[0].events
            if isinstance(event, ForeignMasterSeen)] == ['other_master_resets', 'other_master_nmt']
    assert bench.sessions[0].statistics.rejected == 0


def test_whatever_is_due_sooner_wakes_the_timer() -> None:
    bench = Bench(drive(period=5.0, mapping='assume', parameter_retries=0,
                        parameter_timeout=0.02)).begin()
    bench.at(10.0)
    bench.hears(ANSWER, 10.001)
    exchange = bench.exchange
    exchange._wake_at = exchange._pass()
    exchange._wake.wait(0.0)
    exchange.submit(bench.sessions[0], read(GAIN))
    assert exchange._wake.wait(0.0)         # its time-out comes before the next pass

    exchange._wake_at = 10.01
    bench.hears('10200281#0007000000000000', 10.003)
    assert not exchange._wake.wait(0.0)     # nothing to wait for any more
    exchange._wake_at = 20.0
    bench.hears('7F1#00', 10.004)
    assert not exchange._wake.wait(0.0)
    bench.hears('102001E0#0000000000000000', 10.005)
    assert exchange._wake.wait(0.0)         # the next cycle comes before that


def test_age_of_a_frame_does_not_shorten_the_pause_after_an_eeprom_write() -> None:
    bench = Bench(drive(period=5.0, mapping='assume')).begin()
    bench.at(10.0)
    bench.hears(ANSWER, 10.001)
    bench.now = 10.1
    bench.exchange.submit(bench.sessions[0], write((RAMP, 5)))
    assert bench.hears('102001E1#0004000000000000', 10.11, age=0.009)[-1].startswith('003001E1')
    assert bench.at(10.1295) == []
    assert bench.at(10.1301) == [f'002001E1#{ZEROS}']


def test_close_without_open() -> None:
    bench = Bench(drive())
    bench.exchange.close()
    assert bench.link.stopped


@pytest.mark.parametrize('late, sent', [
    (0.24, '03E8'),     # it is fresh enough
    (0.26, '0000'),     # neutral armed, but what came since has waited too long
    (0.9, '0000')])
def test_what_waits_when_the_exchange_is_late_is_not_believed(late: float, sent: str) -> None:
    bench = Bench(drive(rearm_immediate=False, command_timeout=5.0)).online()
    [notes] = bench.notes
    notes.commands.append((0, 0.0))
    bench.at(10.02)
    bench.hears(ANSWER, 10.021)
    before = notes.discarded
    notes.commands.append((0, 100.0))
    assert bench.at(10.04 + late) == [f'003FFFF0#{sent}000000000000']
    assert (notes.discarded > before) == (sent == '0000')
    assert not notes.session.setpoints.waiting[:-1], 'nothing is armed anew for that'


# -- what was last sent ---------------------------------------------------------------------------


def test_what_was_sent_is_told_on_change_and_once_a_second() -> None:
    bench = Bench(drive(name='first', station=1, command_timeout=0.0)).online()
    [notes] = bench.notes
    notes.told.clear()
    for step in range(1, 60):
        bench.at(10.0 + 0.02 * step)
        bench.hears(ANSWER, 10.002 + 0.02 * step)
    assert notes.told == [pytest.approx(11.0)], 'nothing changed'
    notes.told.clear()
    notes.commands = [(0, 0.0), (0, 150.0)]
    assert bench.at(11.3) == ['003FFFF0#05DC000000000000']
    assert notes.told == [11.3]
    bench.step = 0.001
    assert bench.exchange.deactivate() is True
    notes.told.clear()
    for step in range(1, 5):
        bench.at(12.0 + step)
    assert notes.told == [], 'nothing is sent any more'
