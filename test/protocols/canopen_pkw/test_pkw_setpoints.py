# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Setpoints: written on change and after a while, neutral when in doubt, and the safe stop."""

from functools import partial
import math
from typing import Any

from builders import read
from conversation import Conversation
from pkw_builders import (
    ANSWER_0, ANSWER_1, answered, BOOT_UP, CLASS, commanding, CURRENT, denied, DISABLE_0,
    DISABLE_1, DISABLED_0, driven, echo, IDLE, LEVEL, online, POSITION, READ_0, READ_1, SPEED,
    SPEED_1, START, started, STATUS, STILL_0, STILL_1, STOPPED, TORQUE,
)
from saying import may_run, says
from timeline import Timeline

from drive_can_bridge.core.events import DriveState, Noted, SetpointsExpired, StationLost
from drive_can_bridge.core.setpoints import CommandOutcome

WITHDRAWN = Noted('enable withdrawn: bridge inactive; only ~/enable starts the drive again')


def writes(sent: list[str]) -> list[str]:
    """Return address and words of what was written."""
    return [text[4:8] + text[12:] for text in sent if text[10:12] in ('2A', 'AA', '2B', 'AB')]


def cycle(talk: Conversation, now: float) -> list[str]:
    """Let the round of this time pass; return address and words of what was written."""
    return writes(answered(talk, talk.at(now), now))


def armed(**options: Any) -> Conversation:
    """Return a drive whose speed was commanded to 0 and then to 10 Hz."""
    options.setdefault('request', (SPEED,))
    talk = online(**options)
    assert talk.commands(0, 0.0, 10.06) is CommandOutcome.ARMED
    assert talk.commands(0, 10.0, 10.06) is CommandOutcome.ACCEPTED
    return talk


def test_change_is_written_before_the_round_and_once() -> None:
    talk = armed(command_timeout=0.0)
    assert talk.until(10.069) == []
    assert talk.at(10.07) == [SPEED_1]
    assert talk.hears('485#C60200AA00000000', 10.071) == [READ_0]
    assert talk.hears(ANSWER_0, 10.072) == []
    assert cycle(talk, 10.09) == []


def test_32_bits() -> None:
    talk = online(request=(POSITION,), command_timeout=0.0)
    talk.commands(0, 0, 10.06)
    talk.commands(0, -2, 10.06)
    assert cycle(talk, 10.07) == ['D002FFFFFEFF']


def test_neutral_waits_for_no_round_and_has_others_make_room() -> None:
    """Without a control word it is all that stops the drive."""
    talk = armed(command_timeout=0.5, period=2.0)
    talk.commands(0, 0.0, 12.04)
    talk.commands(0, 10.0, 12.04)
    assert cycle(talk, 12.05) == ['C60264000000']
    assert talk.submits(read(CLASS), 12.5) == ['505#5E0200A500000000']
    talk.events()
    assert talk.until(12.63) == [(12.59, STILL_0)], '50 ms after the time-out'
    assert talk.events(SetpointsExpired) == [SetpointsExpired(('speed',))]
    assert talk.hears('485#C602002A00000000', 12.631) == ['505#5E0200A500000000'], 'again'


def test_lost_neutral_is_repeated_soon() -> None:
    """The last attempt has the time that any request has: a slow device is no silent one."""
    talk = armed(command_timeout=0.05)
    assert cycle(talk, 10.07) == ['C60264000000']
    assert talk.until(10.0901) == [(10.09, READ_1)]
    assert talk.hears(ANSWER_1, 10.091) == []
    assert talk.until(10.1101) == [(10.11, READ_0)]
    assert talk.hears(ANSWER_0, 10.111) == [STILL_1]
    sent = talk.until(10.71)
    assert [text for _, text in sent] == [STILL_0, STILL_1]
    assert [round(at, 4) for at, _ in sent] == [10.161, 10.211]
    assert talk.until(10.712) == [(10.711, IDLE)]


def test_lost_neutral_that_is_commanded_is_repeated_as_soon() -> None:
    talk = armed(command_timeout=0.0)
    assert cycle(talk, 10.07) == ['C60264000000']
    assert talk.commands(0, 0.0, 10.08) is CommandOutcome.ACCEPTED
    assert talk.until(10.13) == [(10.09, STILL_1)]
    assert talk.until(10.141) == [(10.14, STILL_0)]
    assert talk.commands(0, 10.0, 10.145) is CommandOutcome.ACCEPTED
    assert talk.until(10.191) == [(10.19, IDLE)], 'what starts it is not sent blindly'
    assert writes(answered(talk, [IDLE], 10.192)) == []
    assert cycle(talk, 10.21) == ['C60264000000']


def test_commands_do_not_wait_for_a_round() -> None:
    """Of three reads, between which users ask for what nobody answers."""
    talk = started(request=(SPEED,), response=(STATUS, LEVEL, CURRENT), command_timeout=0.0,
                   parameter_timeout=0.2, parameter_retries=0, rearm_immediate=True,
                   refresh_interval=0.0)
    line = Timeline(talk, lambda text: None if text[4:8] == '5E02' else (0.001, echo(text)))
    for _ in range(6):
        line.plan(10.5, partial(talk.submits, read(CLASS)))
    line.plan(10.9, commanding(talk, 0, 20.0))
    line.live(12.0)
    at, = [at for at, text in line.log if text[4:8] == 'C602' and text[12:16] == 'C800']
    assert at < 10.9 + 0.25
    assert len([text for _, text in line.log if text[4:8] == '5E02']) > 3


# -- lost and refused -----------------------------------------------------------------------------


def test_refused_setpoint_is_shown_until_one_is_taken() -> None:
    talk = armed(command_timeout=0.0)
    assert talk.at(10.07) == [SPEED_1]
    assert talk.hears('485#C60200CE30000906', 10.071) == [READ_0]
    assert talk.hears(ANSWER_0, 10.072) == []
    refused = says(
        'write_refused', what='speed', reason=says('refused_by_drive', number=0x06090030))
    assert talk.session.warning == says('setpoint_not_taken', what=refused)
    assert talk.events(Noted) == [Noted(says('write_failed', what=refused), warning=True)]
    assert talk.session.online
    assert cycle(talk, 10.09) == [], 'not repeated before the refresh'
    talk.commands(0, 5.0, 10.1)
    assert cycle(talk, 10.11) == ['C60232000000']
    assert talk.session.warning == ''


def test_what_was_refused_before_a_restart_is_forgotten_and_told_anew() -> None:
    talk = armed(command_timeout=0.0)
    said = 'write of speed refused by the drive: 06090030h (value out of range)'
    for begin in (10.0, 11.0):
        text, = talk.at(begin + 0.07)
        assert text[:10] == '505#C60200' and text[12:] == '64000000'
        answered(talk, talk.hears(denied(text, '30000906'), begin + 0.071), begin + 0.072)
        assert talk.session.warning.startswith(said)
        assert [note.text for note in talk.events(Noted) if 'refused' in note.text] == [said]
        talk.hears(BOOT_UP, begin + 0.2)
        talk.hears('485#C60200AA00000000', begin + 0.21)
        talk.hears('485#C602002A00000000', begin + 0.21)
        cycle(talk, begin + 0.3)
        assert talk.session.online
        assert talk.session.warning == ''
        talk.commands(0, 0.0, begin + 1.06)
        talk.commands(0, 10.0, begin + 1.06)


# -- loss -----------------------------------------------------------------------------------------


def test_restart_disarms() -> None:
    talk = armed(command_timeout=0.0)
    cycle(talk, 10.07)
    assert talk.hears(BOOT_UP, 10.11) == [START, STILL_1], 'it was told to run'
    assert talk.session.state is DriveState.OFFLINE
    assert [item.armed for item in talk.session.setpoints.items] == [False]
    assert talk.commands(0, 10.0, 10.12) is CommandOutcome.NOT_ARMED
    assert talk.hears('485#C60200AA00000000', 10.13) == []
    assert cycle(talk, 10.17) == ['C60200000000'], 'once more when it is back'
    assert talk.session.state is DriveState.NOT_ARMED
    assert talk.commands(0, 10.0, 10.18) is CommandOutcome.NOT_ARMED
    assert cycle(talk, 10.2) == []


# -- the stop -------------------------------------------------------------------------------------


def test_stop_is_acknowledged_and_then_silent() -> None:
    talk = driven()
    assert talk.deactivate(10.115) == [DISABLE_0]
    assert not talk.session.stopped
    assert talk.hears(DISABLED_0, 10.116) == [STILL_1]
    assert talk.hears('485#C60200AA00000000', 10.117) == ['505#C701002500000000']
    assert not talk.session.stopped
    assert talk.hears('485#C701002541000000', 10.118) == []
    assert talk.session.stopped
    assert talk.session.control is not None
    assert talk.session.control.off
    assert talk.session.next_timer() == math.inf
    assert talk.events(StationLost) == [StationLost('deactivated', ordered=True)]
    assert talk.hears(BOOT_UP, 11.0) == []
    assert talk.at(20.0) == []


def test_stop_is_tried_three_times() -> None:
    """Each attempt has the time that any request has: a slow device is no silent one."""
    talk = driven()
    sent = [(10.115, *talk.deactivate(10.115)), *talk.until(20.0)]
    assert [text for _, text in sent] == [
        DISABLE_0, DISABLE_1, DISABLE_0, STILL_1, STILL_0, STILL_1]
    assert [round(now - 10.115, 3) for now, _ in sent] == [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]
    assert talk.session.stopped
    assert talk.events(Noted) == [WITHDRAWN, Noted(
        says(
            'may_still_be_running', why=says('stop_failed', what=[says('write_not_acknowledged',
            attempts=3, what='control_register_1 0000h'), says('write_not_acknowledged',
            attempts=3, what='speed')])), warning=True, danger=True)]


def test_stop_of_many_setpoints_has_its_limit() -> None:
    """3 s all together."""
    talk = driven((SPEED, TORQUE))
    talk.deactivate(10.115)
    assert talk.session.longest_stop == 3.0
    talk.until(13.11)
    assert not talk.session.stopped
    talk.until(13.12)
    assert talk.session.stopped
    assert talk.session.longest_stop == 0.0


def test_slow_device_acknowledges_each_stop_once() -> None:
    """It takes 0.3 s for each answer."""
    talk = driven()
    assert talk.deactivate(10.115) == [DISABLE_0]
    assert talk.until(10.414) == []
    assert talk.hears(DISABLED_0, 10.415) == [STILL_1]
    assert talk.until(10.714) == []
    assert talk.hears('485#C60200AA00000000', 10.715) == ['505#C701002500000000']
    assert talk.until(10.814) == []
    assert talk.until(10.816) == [], 'nobody waits longer for its status'
    assert talk.session.stopped
    assert talk.session.control is not None
    assert not talk.session.control.off, 'it was enabled when it was last asked'
    assert talk.events(Noted) == [WITHDRAWN]


def test_refused_stop_is_an_answer() -> None:
    talk = armed()
    assert cycle(talk, 10.07) == ['C60264000000']
    assert talk.deactivate(10.075) == [STILL_1]
    assert talk.hears('485#C60200CE22000008', 10.076) == []
    assert talk.session.stopped
    note, = talk.events(Noted)
    assert note.warning
    assert note.text == may_run('stop_failed', what=[says(
        'write_refused', what='speed', reason=says('refused_by_drive', number=0x08000022))])


def test_nothing_to_stop() -> None:
    talk = armed()
    talk.hears(STOPPED, 10.061)
    for each in (online(), talk):
        assert each.deactivate(10.062) == []
        assert each.session.stopped


def test_node_that_restarts_during_the_stop_has_stopped() -> None:
    talk = armed()
    assert talk.deactivate(10.061) == [STILL_1]
    assert talk.hears(BOOT_UP, 10.062) == []
    assert talk.session.stopped
    assert talk.at(11.0) == []


def test_activation_during_the_stop() -> None:
    talk = armed()
    assert talk.deactivate(10.061) == [STILL_1]
    assert talk.activate(10.07) == ['000#0105']
    assert talk.hears('485#C60200AA00000000', 10.08) == []
    assert cycle(talk, 10.121) == ['C60200000000']
    assert talk.session.online
    assert not talk.session.stopped
