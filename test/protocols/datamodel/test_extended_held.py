# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Axes that stay where they are (``neutral_from``), 29-bit identifiers, in hex.

Station 1, request map 52 (control word), 60 (position, 0.1 deg), response map 211 (status word:
ready 1, enabled 2, fault 8), 212 (position). The position is limited to ±10 deg.
"""

from typing import Any

from builders import ACTUAL, CONTROL, drive, INT16, parameter, RAM, RO, STATUS, TABLE, WORD
from conversation import Conversation
import pytest
from saying import says
from stops import UNANSWERED_CYCLES

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.control_machine import RESET_CYCLES
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.events import Noted
from drive_can_bridge.core.setpoints import CommandOutcome

ZEROS = '0000000000000000'
ASK_MAPS = [f'002007A4#{ZEROS}', f'002007E4#{ZEROS}']
MAPS = ['102007A4#0034003C00000000', '102007E4#00D300D400000000']
#: read of 212 alone
ASK_POSITION = f'00200D41#{ZEROS}'

POSITION = parameter(
    'position_setpoint', 60, type=INT16, scale=0.1, unit='deg', minimum=-10.0, maximum=10.0,
    storage=RAM, neutral_from='actual_position', arming_tolerance=0.5)
MEASURED = parameter('actual_position', 212, type=INT16, scale=0.1, unit='deg', access=RO)
#: why an axis that may be anywhere is not enabled
UNKNOWN = says('would_jump', why=says(
    'position_not_told', known=False, measured='actual_position', name='position_setpoint'))


def axis(**options: Any) -> Conversation:
    """Return a conversation with an axis of which nothing is known yet, bus up."""
    talk = Conversation(drive(**{
        'table': (*TABLE, POSITION, MEASURED), 'control': CONTROL, 'request': (WORD, POSITION),
        'response': (STATUS, MEASURED), **options}))
    assert talk.bus_up(9.0) == []
    return talk


def checking(**options: Any) -> Conversation:
    """Return one whose maps were read: its position is asked for at 9.992 s."""
    talk = axis(**options)
    assert talk.activate(9.99) == ASK_MAPS[:1]
    assert talk.hears(MAPS[0], 9.991) == ASK_MAPS[1:]
    assert talk.hears(MAPS[1], 9.992) == [ASK_POSITION]
    return talk


def request(word: int, position: int) -> str:
    """Return the cyclic request with these words."""
    return f'003FFFF0#{word:04X}{position & 0xFFFF:04X}00000000'


def cycle(talk: Conversation, number: int, status: int, position: int) -> str:
    """Let a cycle pass, 20 ms after the one before; return its request. The drive answers."""
    (_, sent), = talk.until(10.0 + 0.02 * number + 1e-6)
    assert talk.hears(f'103FFFF0#{status:04X}{position & 0xFFFF:04X}00000000',
                      10.002 + 0.02 * number) == []
    return sent


def standing(position: int = 70, **options: Any) -> Conversation:
    """Return one that stands at this position, disabled, with two cycles behind it."""
    talk = checking(**options)
    assert talk.hears(f'10200D41#{position & 0xFFFF:04X}000000000000', 10.0) == []
    assert cycle(talk, 0, 1, position) == request(0, position)
    assert cycle(talk, 1, 1, position) == request(0, position)
    assert talk.session.online
    talk.events()
    return talk


def enabled(position: int = 70, **options: Any) -> Conversation:
    """Return one that was enabled in cycle 2."""
    talk = standing(position, **options)
    assert talk.asks(ControlAction.ENABLE, 10.025) == []
    assert cycle(talk, 2, 3, position) == request(1, position)
    assert talk.control_outcomes() == [('enable', True, 'enabled')]
    return talk


def short(talk: Conversation, number: int, status: int) -> str:
    """Let a cycle pass whose response holds the status word only."""
    (_, sent), = talk.until(10.0 + 0.02 * number + 1e-6)
    assert talk.hears(f'103FFFF0#{status:04X}', 10.002 + 0.02 * number) == []
    return sent


def test_axis_whose_position_is_missing_may_be_anywhere() -> None:
    talk = standing()
    assert short(talk, 2, 1) == request(0, 70)
    refusal = talk.session.services.control_refusal(ControlAction.ENABLE)
    assert refusal == UNKNOWN
    # moved by hand meanwhile
    assert cycle(talk, 3, 1, 90) == request(0, 70), 'beside disable'
    assert talk.session.services.control_refusal(ControlAction.ENABLE) == says(
        'would_jump', why=says('position_not_told', known=True, measured='actual_position',
                               name='position_setpoint'))
    assert cycle(talk, 4, 1, 90) == request(0, 90)
    assert talk.session.services.control_refusal(ControlAction.ENABLE) == ''


def test_axis_that_is_driven_stays_latched_without_its_position() -> None:
    talk = enabled()
    for number in range(3, 9):
        assert short(talk, number, 3) == request(1, 70)
    assert talk.commands(0, 7.0, 10.165) is CommandOutcome.ARMED


def test_no_cycle_without_a_position() -> None:
    """Nobody answers the read: the maps are looked at again, and then the position."""
    talk = checking()
    sent = [text for _, text in talk.until(10.35)]
    assert sent == [ASK_POSITION, ASK_POSITION, ASK_MAPS[0]]
    assert talk.hears(MAPS[0], 10.36) == ASK_MAPS[1:]
    assert talk.hears(MAPS[1], 10.361) == []    # the read is in quarantine
    assert talk.until(10.5)[0][1] == ASK_POSITION
    assert talk.session.offline_advice == UNKNOWN


def test_limits_do_not_bound_where_the_axis_is() -> None:
    talk = standing(-300)
    assert cycle(talk, 2, 1, -300) == '003FFFF0#0000FED400000000'


def test_follows_while_it_is_disabled_and_is_latched_when_it_is_enabled() -> None:
    talk = standing(70)
    assert cycle(talk, 2, 1, 68) == request(0, 70)      # somebody pushes it
    assert cycle(talk, 3, 1, 66) == request(0, 68)
    talk.asks(ControlAction.ENABLE, 10.065)
    assert cycle(talk, 4, 1, 65) == request(1, 66)      # does not run yet: it is still followed
    assert cycle(talk, 5, 3, 64) == request(1, 65)      # runs from here on: with 65
    assert cycle(talk, 6, 3, 63) == request(1, 65)      # whatever the load and the noise say
    assert cycle(talk, 7, 3, 67) == request(1, 65)
    assert cycle(talk, 8, 3, 65) == request(1, 65)


def test_command_near_it_arms() -> None:
    talk = enabled(70)
    assert talk.commands(0, 0.0, 10.043) is CommandOutcome.NOT_ARMED
    assert talk.commands(0, 7.6, 10.043) is CommandOutcome.NOT_ARMED
    assert talk.commands(0, 6.4, 10.043) is CommandOutcome.NOT_ARMED
    assert cycle(talk, 3, 3, 71) == request(1, 70)
    assert talk.commands(0, 7.5, 10.063) is CommandOutcome.ARMED
    assert cycle(talk, 4, 3, 71) == request(1, 75)
    assert talk.commands(0, 9.9, 10.083) is CommandOutcome.ACCEPTED
    assert cycle(talk, 5, 3, 76) == request(1, 99)
    with pytest.raises(ValueRefused):       # of commands, the limits are those of the profile
        talk.commands(0, 10.1, 10.103)


def test_rearm_immediate_never_moves_it() -> None:
    """The configuration refuses that; should it happen while running, nothing comes of it."""
    talk = enabled(70)
    talk.session.reconfigure(rearm_immediate=True)
    assert talk.commands(0, 0.0, 10.043) is CommandOutcome.NOT_ARMED
    assert cycle(talk, 3, 3, 70) == request(1, 70)


@pytest.mark.parametrize(('action', 'word'), [
    (ControlAction.DISABLE, 0), (ControlAction.QUICK_STOP, 2)])
def test_stop_keeps_what_was_sent_until_it_is_disabled(action: ControlAction, word: int) -> None:
    talk = enabled(70)
    talk.commands(0, 7.0, 10.043)
    talk.commands(0, 9.0, 10.043)
    assert cycle(talk, 3, 3, 72) == request(1, 90)
    talk.asks(action, 10.065)
    assert cycle(talk, 4, 3, 75) == request(word, 90)       # brakes
    assert cycle(talk, 5, 1, 77) == request(word, 90)
    assert cycle(talk, 6, 1, 76) == request(0, 77)          # stands, and is followed
    assert cycle(talk, 7, 1, 76) == request(0, 76)


def test_fault_reset_and_enabling_anew() -> None:
    talk = enabled(70)
    talk.commands(0, 7.0, 10.043)
    talk.commands(0, 9.0, 10.043)
    assert cycle(talk, 3, 3, 75) == request(1, 90)
    assert cycle(talk, 4, 8, 76) == request(1, 90)          # trips, and sinks
    assert cycle(talk, 5, 8, 70) == request(0, 76)
    assert cycle(talk, 6, 8, 60) == request(0, 70)
    talk.asks(ControlAction.RESET_FAULT, 10.125)
    assert cycle(talk, 7, 1, 55) == request(0x80, 60)
    over = 7 + RESET_CYCLES
    for number in range(8, over):
        assert cycle(talk, number, 1, 55) == request(0x80, 55)
    assert cycle(talk, over, 1, 55) == request(0, 55)
    talk.asks(ControlAction.ENABLE, talk.now + 0.003)
    assert cycle(talk, over + 1, 3, 55) == request(1, 55)
    # left standing
    assert talk.commands(0, 9.0, talk.now + 0.001) is CommandOutcome.NOT_ARMED
    assert cycle(talk, over + 2, 3, 54) == request(1, 55)


def test_lost_with_control_it_is_read_anew() -> None:
    talk = enabled(70)
    talk.commands(0, 7.0, 10.043)
    talk.commands(0, 9.0, 10.043)
    assert cycle(talk, 3, 3, 75) == request(1, 90)
    sent = [text for _, text in talk.until(10.18 + 1e-6)]
    assert sent == [request(1, 90)] * 3 + [request(0, 90)] * 3      # three missed, three to stop
    talk.events()
    while (now := talk.session.next_timer()) < 10.3:
        sent = talk.at(now)
    assert sent == ['00200341#0000000000000000'], 'disable, and no position'
    assert talk.hears('10200341#0000000000000000', 10.3) == ASK_MAPS[:1]
    assert talk.hears(MAPS[0], 10.31) == ASK_MAPS[1:]
    assert talk.hears(MAPS[1], 10.311) == [ASK_POSITION]
    assert talk.until(10.35) == []
    assert talk.hears('10200D41#0021000000000000', 10.36) == []     # it sank meanwhile
    assert talk.until(10.36 + 1e-6)[0][1] == request(0, 33)
    assert talk.hears('103FFFF0#0001002100000000', 10.362) == []
    assert talk.commands(0, 9.0, 10.363) is CommandOutcome.DISABLED


def bare(**options: Any) -> Conversation:
    """Return a drive without control that is online, at 7.0 deg."""
    talk = axis(control=None, request=(POSITION,), response=(MEASURED, STATUS), **options)
    maps = ['102007A4#003C000000000000', '102007E4#00D400D300000000']
    if options.get('mapping') == 'assume':
        assert talk.activate(9.992) == [ASK_POSITION]
    else:
        assert talk.activate(9.99) == ASK_MAPS[:1]
        assert talk.hears(maps[0], 9.991) == ASK_MAPS[1:]
        assert talk.hears(maps[1], 9.992) == [ASK_POSITION]
    assert talk.hears('10200D41#0046000000000000', 10.0) == []
    assert talk.until(10.0 + 1e-6)[0][1] == '003FFFF0#0046000000000000'
    talk.hears('103FFFF0#0045000100000000', 10.002)
    assert talk.session.online
    talk.events()
    return talk


def test_without_control_it_is_latched_from_the_beginning() -> None:
    talk = bare()
    assert talk.until(10.02 + 1e-6)[0][1] == '003FFFF0#0046000000000000'
    talk.hears('103FFFF0#0044000100000000', 10.022)
    assert talk.until(10.04 + 1e-6)[0][1] == '003FFFF0#0046000000000000'
    talk.hears('103FFFF0#0044000100000000', 10.042)
    assert talk.commands(0, 7.2, 10.05) is CommandOutcome.ARMED
    assert talk.until(10.06 + 1e-6)[0][1] == '003FFFF0#0048000000000000'
    talk.hears('103FFFF0#0044000100000000', 10.062)
    talk.deactivate(10.07)
    # nobody answers
    assert [text for _, text in talk.until(11.0)] == [
        '003FFFF0#0048000000000000'] * UNANSWERED_CYCLES


@pytest.mark.parametrize('mapping', ['verify', 'assume'])
def test_without_control_a_lost_drive_is_sent_nothing(mapping: str) -> None:
    """It may have been switched off, and stand elsewhere by now."""
    talk = bare(mapping=mapping)
    talk.commands(0, 7.0, 10.01)
    talk.commands(0, 9.0, 10.01)
    cyclic = [text for _, text in talk.until(10.4) if text.startswith('003FFFF0')]
    assert cyclic == ['003FFFF0#005A000000000000'] * 3
    assert [event.text for event in talk.events(Noted) if event.warning] == [
        says('may_still_be_running', why=says('position_unknown'))]
    assert not [text for _, text in talk.until(15.0) if not text.endswith(ZEROS)]   # reads only
    talk.deactivate(15.0)
    assert talk.sent() == []
    assert talk.session.stopped
    assert [event.text for event in talk.events(Noted) if event.warning] == [
        says('may_still_be_running', why=says('stop_not_possible'))]


def test_stall_reads_it_anew_and_believes_no_older_answer() -> None:
    talk = bare(mapping='assume')
    assert talk.handle_stall(12.0) == [ASK_POSITION]
    assert talk.handle_stall(12.05) == []      # waits behind the first one, whose answer is old
    assert talk.hears('10200D41#0050000000000000', 12.06) == [ASK_POSITION]
    assert talk.until(12.07) == []
    talk.hears('10200D41#0021000000000000', 12.08)
    assert talk.until(12.09)[0][1] == '003FFFF0#0021000000000000'


def coarse_axis() -> Conversation:
    """Return an axis whose setpoint carries 32.767 deg at most; its maps have been compared."""
    coarse = parameter('coarse', 60, type=INT16, scale=0.001, unit='deg', storage=RAM,
                       neutral_from='actual_position', arming_tolerance=0.5)
    talk = axis(table=(*TABLE, coarse, MEASURED), request=(WORD, coarse))
    talk.activate(9.99)
    talk.hears(MAPS[0], 9.991)
    talk.hears(MAPS[1], 9.992)
    return talk


def test_position_that_the_setpoint_cannot_carry() -> None:
    talk = coarse_axis()
    assert talk.hears('10200D41#0190000000000000', 9.993) == []     # 40.0 deg, 32.767 at most
    assert talk.until(10.09) == []
    assert talk.until(10.0931) == [(10.093, ASK_POSITION)]
    talk.hears('10200D41#0140000000000000', 10.1)                   # 32.0 deg
    assert talk.until(10.1 + 1e-6)[0][1] == request(0, 32000)


def test_position_is_not_read_again_where_the_maps_differ_meanwhile() -> None:
    talk = coarse_axis()
    talk.hears('10200D41#0190000000000000', 9.993)      # 40.0 deg, 32.767 at most
    for read in range(1, 10):
        due = 9.993 + 0.1 * read
        assert [text for _, text in talk.until(due + 1e-6)] == [ASK_POSITION]
        assert talk.hears('10200D41#0190000000000000', due) == []
    assert [text for _, text in talk.until(10.9921)] == [ASK_MAPS[0]]
    assert talk.hears(MAPS[0], 10.9922) == [ASK_MAPS[1]]
    assert talk.hears('102007E4#00D4000000000000', 10.9923) == []
    assert talk.until(11.9) == []
    assert talk.session.offline_advice.startswith('mapping differs')


def test_status_by_hand_latches_with_the_word() -> None:
    """A status word that comes seldom does not say from when on the axis is driven."""
    talk = axis(response=(ACTUAL, MEASURED), request=(WORD, POSITION))
    talk.activate(9.99)
    talk.hears(MAPS[0], 9.991)
    talk.hears('102007E4#00D100D400000000', 9.992)
    talk.hears('10200D41#0046000000000000', 10.0)
    talk.until(10.0 + 1e-6)
    talk.hears('103FFFF0#0000004600000000', 10.002)
    assert talk.at(10.003) == [f'00200D31#{ZEROS}']
    talk.hears('10200D31#0001000000000000', 10.004)
    sent = []
    for number in range(1, 12):
        now = 10.0 + 0.02 * number
        sent += [text for _, text in talk.until(now + 1e-6) if text.startswith('003FFFF0')]
        for text in talk.hears(f'103FFFF0#0000{70 - number:04X}00000000', now + 0.002):
            assert text == f'00200D31#{ZEROS}'
            talk.hears('10200D31#0001000000000000', now + 0.003)    # not enabled yet
        if number == 4:
            talk.asks(ControlAction.ENABLE, now + 0.01)
    assert sent[:4] == [request(0, 70), request(0, 69), request(0, 68), request(0, 67)]
    assert len(set(sent[4:])) == 1
    assert sent[4] == request(1, 66)


def test_axis_that_ran_and_does_not_say_where_it_is_is_disabled_by_number() -> None:
    """It was silent when it was told so; then its maps are answered, but not its position."""
    talk = enabled()
    talk.until(12.0)
    assert not talk.session.online
    talk.events()
    disable, ask = f'00300341#{ZEROS}', f'00200341#{ZEROS}'
    sent = [text for _, text in talk.served(14.0, {
        **dict(zip(ASK_MAPS, MAPS)), ask: f'10200341#{ZEROS}'}.get)]
    assert sent.count(disable) == 1
    assert not any(text.startswith('003FFFF0') for text in sent)
    assert [note.text for note in talk.events(Noted)] == [
        says('stopped_again')]
