# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The promises that every protocol family keeps, whatever its frames look like.

A new family adds a :class:`~partners.Partner`: how its drive is configured and what the drive
answers. The tests stay as they are.
"""

import math

from builders import (
    ACTUAL, DAMPING, GAIN, LIMIT, ORDER, RAMP, read, SPEED, text_of, write,
)
from partners import Partner, PARTNERS, run, warnings, worries
import pytest
from saying import may_run, says

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.events import (
    DriveState, FrameRejected, ProcessDataReceived, RequestCompleted, SetpointsExpired,
    StationFound, StationLost)
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.setpoints import CommandOutcome
from drive_can_bridge.protocols.families import FAMILIES


def test_every_family_has_a_partner() -> None:
    assert set(PARTNERS) == set(FAMILIES)


@pytest.fixture(params=sorted(PARTNERS), name='make')
def _make(request: pytest.FixtureRequest) -> type[Partner]:
    return PARTNERS[request.param]


@pytest.fixture(name='partner')
def _partner(make: type[Partner]) -> Partner:
    partner = make().start()
    assert partner.talk.session.online
    partner.enable()
    partner.take()
    partner.talk.events()
    return partner


# -- life cycle -----------------------------------------------------------------------------------


def test_nothing_before_activation(make: type[Partner]) -> None:
    partner = make()
    partner.deliver(partner.talk.bus_up(9.0))
    partner.live(5.0)
    assert partner.take() == []
    assert partner.talk.session.next_timer() == math.inf
    assert partner.talk.session.stopped
    assert not partner.talk.session.active


def test_nothing_before_the_bus_is_there(make: type[Partner]) -> None:
    partner = make()
    partner.deliver(partner.talk.activate(9.0))
    partner.live(5.0)
    assert partner.take() == []
    partner.deliver(partner.talk.bus_up(partner.now))
    partner.live(0.2)
    assert partner.talk.session.online


def test_online_is_told_before_the_first_sample(make: type[Partner]) -> None:
    partner = make().start()
    events = partner.talk.events(StationFound, StationLost, ProcessDataReceived)
    assert events[0] == StationFound()
    assert {event.raws for event in events[1:]} == {partner.sample}
    assert partner.talk.session.ever_online
    assert partner.talk.session.offline_advice == ''


def test_silent_drive_is_not_online(make: type[Partner]) -> None:
    partner = make()
    partner.deaf = True
    partner.start()
    partner.live(3.0)
    session = partner.talk.session
    assert not session.online
    assert not session.ever_online
    assert session.state is DriveState.OFFLINE
    assert session.offline_advice
    assert partner.take()
    assert partner.talk.events(StationFound, StationLost, ProcessDataReceived) == []


def test_loss_and_recovery(partner: Partner) -> None:
    partner.deaf = True
    partner.live(1.0)
    lost, = partner.talk.events(StationLost)
    assert lost.reason
    assert not partner.talk.session.online
    assert partner.talk.session.statistics.missed >= 3
    partner.deaf = False
    partner.live(2.0)
    assert partner.talk.session.online
    assert len(partner.talk.events(StationFound)) == 1


def test_an_answer_that_is_not_wanted_any_more_is_not_rejected(partner: Partner) -> None:
    """It was asked for, and comes in time: the bridge has ended meanwhile."""
    partner.deaf = True
    partner.reads(RAMP)
    while not (asked := [text for _, text in partner.take() if not partner.setpoints(text)]):
        partner.live(0.005)
    answers = partner.answers(asked[-1])
    assert answers
    partner.deliver(partner.talk.deactivate(partner.now))
    partner.deaf = False
    partner.now += partner.DELAY
    for answer in answers:
        partner.deliver(partner.talk.hears(answer, partner.now))
    partner.live(1.0)
    assert partner.talk.events(FrameRejected) == []
    assert partner.talk.session.statistics.rejected == 0
    assert partner.talk.session.statistics.late == 0


def test_deactivation_ends_neutral_and_then_silent(partner: Partner) -> None:
    partner.commands(0.0, 100.0)
    partner.live(0.1)
    assert list(partner.commanded())[-1] == 1000
    partner.ends(1.0)
    assert set(partner.commanded()) == {0}
    session = partner.talk.session
    assert session.stopped
    assert not session.online
    assert session.next_timer() == math.inf
    assert partner.talk.events(StationLost) == [StationLost('deactivated', ordered=True)]
    partner.live(5.0)
    assert partner.take() == []


def test_deactivation_of_a_drive_that_stopped_answering(partner: Partner) -> None:
    partner.deaf = True
    partner.ends(2.0)
    assert set(partner.commanded()) <= {0}


def test_bus_down_is_silence_at_once(partner: Partner) -> None:
    assert partner.talk.bus_down(partner.now) == []
    partner.live(3.0)
    assert partner.take() == []
    assert partner.talk.session.offline_advice == says(
        'bus_is_down', bus='main', reason='unplugged')
    assert partner.talk.session.stopped


# -- whatever was told to run is told to stop -----------------------------------------------------


@pytest.mark.parametrize('upset', ['stall', 'bus'])
def test_stop_right_after_an_upset(partner: Partner, upset: str) -> None:
    run(partner)
    if upset == 'bus':
        partner.talk.bus_down(partner.now)
        assert worries(partner)
    partner.now += 1.5
    back = partner.talk.bus_up if upset == 'bus' else partner.talk.handle_stall
    partner.deliver(back(partner.now))
    partner.ends(1.0)
    assert partner.registers[50] == 0
    assert not worries(partner)


def test_bus_that_comes_back_stops_the_drive_at_once(partner: Partner) -> None:
    run(partner)
    partner.talk.bus_down(partner.now)
    partner.now += 1.5
    partner.deliver(partner.talk.bus_up(partner.now))
    partner.live(0.05)
    assert partner.registers[50] == 0


def test_end_while_the_bus_is_lost_is_told(partner: Partner) -> None:
    run(partner)
    partner.talk.bus_down(partner.now)
    partner.talk.events()
    partner.deliver(partner.talk.deactivate(partner.now))
    assert partner.talk.session.stopped
    assert warnings(partner) == [may_run('stop_not_possible')]


def test_a_stop_that_the_drive_did_not_hear_is_told(partner: Partner) -> None:
    """What was told to stand still when it had fallen silent already may not have heard it."""
    run(partner)
    partner.deaf = True
    partner.talk.commands(0, 0.0, partner.now)
    partner.live(2.0)
    assert partner.registers[50] == 1000
    assert not partner.talk.session.online
    partner.ends(2.0)
    assert worries(partner)


def test_a_drive_that_is_silent_when_the_bridge_ends_is_told(make: type[Partner]) -> None:
    """It does not count as lost yet."""
    partner = make(missed_limit=100).start()
    partner.enable()
    run(partner)
    partner.deaf = True
    partner.live(2.5 * partner.configuration.period)
    assert partner.talk.session.online
    partner.ends(3.0)
    assert partner.registers[50] == 1000
    assert worries(partner)


def test_stop_frames_that_the_bus_refuses_are_no_stop(partner: Partner) -> None:
    run(partner)
    partner.talk.refusing = lambda text: True
    partner.deliver(partner.talk.deactivate(partner.now))
    partner.live(partner.talk.session.longest_stop + 0.5)
    partner.talk.session.give_up(partner.now)
    partner.deliver(partner.talk.sent())
    assert partner.talk.session.stopped
    assert partner.registers[50] == 1000
    assert worries(partner)


def test_nobody_is_warned_of_a_drive_that_was_never_told_to_run(partner: Partner) -> None:
    partner.deaf = True
    partner.talk.bus_down(partner.now)
    partner.deliver(partner.talk.bus_up(partner.now))
    partner.live(0.2)
    partner.ends(2.0)
    told = bool(worries(partner))
    assert told is (partner.idle is DriveState.DISABLED)    # that one was told to enable


def test_acknowledged_or_not_a_refused_write_is_not_sent(make: type[Partner]) -> None:
    partner = make(verify_writes=False).start()
    partner.talk.events()
    sent: list[str] = []

    def refusing(text: str) -> bool:
        sent.append(text)
        return True
    partner.talk.refusing = refusing
    partner.writes((GAIN, 7))
    partner.live(0.5)
    assert partner.talk.outcomes() == [[says('not_sent')]]
    assert partner.registers[GAIN.number] == 0


def test_life_can_be_repeated(partner: Partner) -> None:
    for _ in range(3):
        partner.ends(1.0)
        partner.deliver(partner.talk.activate(partner.now))
        partner.live(1.0)
        assert partner.talk.session.online
        partner.talk.bus_down(partner.now)
        partner.deliver(partner.talk.bus_up(partner.now))
        partner.live(1.0)
        assert partner.talk.session.online


# -- setpoints ------------------------------------------------------------------------------------


def test_nothing_moves_before_it_is_enabled(make: type[Partner]) -> None:
    partner = make(rearm_immediate=True).start()
    assert partner.talk.session.state is partner.idle
    if partner.idle is DriveState.DISABLED:
        assert partner.talk.commands(0, 100.0, partner.now) is CommandOutcome.DISABLED
        partner.live(0.1)
        partner.enable()
        assert set(partner.commanded()) == {0}


def test_only_neutral_until_armed(partner: Partner) -> None:
    assert partner.talk.session.state is DriveState.NOT_ARMED
    assert partner.talk.commands(0, 100.0, partner.now) is CommandOutcome.NOT_ARMED
    partner.live(0.5)
    assert set(partner.commanded()) <= {0}
    assert partner.talk.commands(0, 0.0, partner.now) is CommandOutcome.ARMED
    assert partner.talk.session.state is DriveState.ONLINE
    assert partner.talk.commands(0, 100.0, partner.now) is CommandOutcome.ACCEPTED
    partner.live(0.1)
    assert list(partner.commanded())[-1] == 1000


def test_immediate(make: type[Partner]) -> None:
    partner = make(rearm_immediate=True).start()
    partner.enable()
    assert partner.talk.commands(0, -100.0, partner.now) is CommandOutcome.ARMED
    partner.live(0.1)
    assert list(partner.commanded())[-1] == 0xFC18


def test_silence_of_the_commander_is_neutral(partner: Partner) -> None:
    partner.commands(0.0, 100.0)
    partner.live(1.0)
    assert list(partner.commanded())[-1] == 0
    assert partner.talk.events(SetpointsExpired) == [SetpointsExpired(('speed_setpoint',))]
    assert partner.talk.commands(0, 100.0, partner.now) is CommandOutcome.NOT_ARMED
    assert math.isnan(partner.talk.session.setpoints.age(partner.now))


def test_that_waits_for_no_cycle(make: type[Partner]) -> None:
    """However long the period is; one of the last command may come between."""
    partner = make(period=1.0, command_timeout=0.3).start().live(3.0)
    partner.enable()
    partner.talk.commands(0, 0.0, partner.now)
    for _ in range(25):
        partner.talk.commands(0, 100.0, partner.now)
        partner.live(0.1)
    commanded_at = partner.now - 0.1
    partner.live(0.35)
    sent = [(at, raw) for at, text in partner.take() for raw in partner.setpoints(text)]
    assert 1000 in [raw for _, raw in sent]
    at, raw = sent[-1]
    assert raw == 0 and at < commanded_at + 0.35


@pytest.mark.parametrize('upset', ['loss', 'bus', 'time'])
def test_after_an_upset_it_wants_arming_again(partner: Partner, upset: str) -> None:
    talk = partner.talk
    talk.commands(0, 0.0, partner.now)
    talk.commands(0, 100.0, partner.now)
    partner.live(0.1)
    partner.take()
    if upset == 'loss':
        partner.deaf = True
        partner.live(0.2)
        partner.take()  # until the loss was noticed, the command was still in force
        partner.deaf = False
    elif upset == 'bus':
        talk.bus_down(partner.now)
        partner.deliver(talk.bus_up(partner.now))
    else:
        partner.now += 5.0
        partner.deliver(talk.handle_stall(partner.now))
    partner.live(1.0)
    assert talk.session.online
    assert set(partner.commanded()) <= {0}
    assert talk.session.state is partner.idle
    partner.enable()
    assert talk.session.state is DriveState.NOT_ARMED
    assert talk.commands(0, 100.0, partner.now) is CommandOutcome.NOT_ARMED


@pytest.mark.parametrize('value', [math.nan, math.inf, 3000.1, 1e300, True])
def test_bad_commands_are_refused(partner: Partner, value: float) -> None:
    partner.commands(0.0, 100.0)
    with pytest.raises(ValueRefused):
        partner.talk.commands(0, value, partner.now)
    partner.live(0.1)
    assert list(partner.commanded())[-1] == 1000
    assert partner.talk.session.statistics.commands_refused == 1


# -- parameters -----------------------------------------------------------------------------------


def outcomes(partner: Partner) -> list[list[object]]:
    return [[text_of(outcome) for outcome in event.outcomes]
            for event in partner.talk.events(RequestCompleted)]


def test_parameters_are_read_and_written(partner: Partner) -> None:
    partner.registers[40] = 7
    partner.reads(GAIN, ACTUAL, DAMPING)
    partner.live(0.1)
    partner.writes((GAIN, 8), (RAMP, 9))
    partner.live(0.3)
    assert outcomes(partner) == [[7, 1000, 0], ['written', 'written']]
    assert (partner.registers[40], partner.registers[30]) == (8, 9)


def test_missing_parameter_takes_no_other_along(partner: Partner) -> None:
    del partner.registers[41]
    partner.reads(GAIN, DAMPING, RAMP)
    partner.live(3.0)
    (gain, damping, ramp), = outcomes(partner)
    assert (gain, ramp) == (0, 0)
    assert partner.unknown in str(damping)
    assert partner.talk.session.online


def test_requests_never_hold_up_the_exchange(partner: Partner) -> None:
    for _ in range(30):
        partner.reads(GAIN, RAMP)
    partner.live(1.0)
    assert partner.talk.session.statistics.missed == 0
    assert partner.talk.session.statistics.exchanges > 40
    assert outcomes(partner) == [[0, 0]] * 30


def test_requests_without_a_drive_end(make: type[Partner]) -> None:
    partner = make()
    partner.deaf = True
    partner.start()
    for _ in range(3):
        partner.reads(GAIN, RAMP, DAMPING)
        partner.writes((GAIN, 1))
    partner.live(10.0)
    done = outcomes(partner)
    assert [len(entry) for entry in done] == [3, 1, 3, 1, 3, 1]
    assert all(reason == says('no_answer_offline') for entry in done for reason in entry)


def test_requests_are_refused_while_nothing_can_be_sent(make: type[Partner]) -> None:
    partner = make()
    partner.talk.submits(read(partner.own(GAIN), partner.own(RAMP)), 1.0)
    partner.talk.activate(2.0)
    partner.talk.submits(write((partner.own(GAIN), 1)), 2.0)
    assert outcomes(partner) == [['bridge inactive'] * 2, ['bus down']]


def test_64_requests_wait(partner: Partner) -> None:
    partner.deaf = True
    for _ in range(70):
        partner.reads(GAIN)
    refused = outcomes(partner)
    assert refused == [['busy']] * len(refused)
    assert len(refused) in (5, 6)
    partner.deaf = False
    partner.live(10.0)
    assert len(outcomes(partner)) == 70 - len(refused)


def test_requests_end_with_the_bus_or_with_activity(partner: Partner) -> None:
    partner.deaf = True
    for reason in ('bus down', 'bridge inactive'):
        partner.reads(GAIN, RAMP)
        partner.reads(GAIN)
        if reason == 'bus down':
            partner.talk.bus_down(partner.now)
            partner.deliver(partner.talk.bus_up(partner.now))
        else:
            partner.deliver(partner.talk.deactivate(partner.now))
        assert outcomes(partner) == [[reason, reason], [reason]]


@pytest.mark.parametrize('reason', ['bus down', 'bridge inactive'])
def test_what_was_written_before_a_request_ends_is_told(partner: Partner, reason: str) -> None:
    """Whoever is told that nothing was written would leave a drive with half of its settings."""
    answers = partner.answers
    # the drive has heard of the second one, but its answer is lost
    partner.answers = lambda sent: [  # type: ignore[method-assign]
        answer for answer in answers(sent) if partner.registers[41] != 9]
    partner.writes((GAIN, 8), (DAMPING, 9), (RAMP, 7))
    for _ in range(1000):
        if partner.registers[41] == 9:
            break
        partner.live(0.0005)
    assert (partner.registers[40], partner.registers[41]) == (8, 9)
    ok = partner.talk.session.statistics.requests_ok
    if reason == 'bus down':
        partner.talk.bus_down(partner.now)
    else:
        partner.deliver(partner.talk.deactivate(partner.now))
    assert outcomes(partner) == [['written', reason, reason]]
    assert partner.talk.session.statistics.requests_ok == ok + 1


def test_what_users_may_not_write(partner: Partner) -> None:
    refusal = partner.talk.session.services.write_refusal
    assert refusal(partner.own(SPEED)) == says('sent_cyclically', name='speed_setpoint')
    assert [refusal(partner.own(parameter)) for parameter in (GAIN, RAMP, ORDER, LIMIT)] == [
        ''] * 4


# -- anything -------------------------------------------------------------------------------------


def test_frames_of_strangers_do_no_harm(partner: Partner) -> None:
    samples = len(partner.talk.samples())
    for identifier in (*range(0, 0x800, 7), *range(0, 0x20000000, 0x1234567)):
        for data in (b'', b'\xFF', bytes(8), bytes([0xFF] * 8)):
            for is_extended in (False, True):
                if identifier > 0x7FF and not is_extended:
                    continue
                partner.talk.session.receive_frame(
                    Frame(identifier, data, is_extended), partner.now)
    assert len(partner.talk.samples()) == samples == 0
    assert partner.talk.session.online
    partner.live(1.0)
    assert partner.talk.session.statistics.missed == 0


def test_unasked_frames_are_counted(partner: Partner) -> None:
    seen = [text for _, text in partner.log]
    partner.live(0.1)
    answered = [answer for _, text in partner.take() for answer in partner.answers(text)]
    assert answered
    assert not seen
    before = partner.talk.session.statistics.rejected
    partner.talk.events()
    partner.talk.hears(answered[-1], partner.now + partner.DELAY)
    assert partner.talk.session.statistics.rejected == before + 1
    assert len(partner.talk.events(FrameRejected)) == 1
