# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Axes that stay where they are (``neutral_from``) in the other families, in hex.

The rule itself is tested with :mod:`test_extended_held`; here it is what each family adds: when
the position is known first, and what is sent until then and after a loss. 70 is 7.0 deg.
"""

from dataclasses import replace
from typing import Any

from builders import CONTROL, drive, INT16, parameter, RAM, RO, SPEED, STATUS, TABLE, WORD
from conversation import Conversation
from saying import may_run, says

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import Noted
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import ControlTable, StatusPattern
from drive_can_bridge.core.setpoints import CommandOutcome

TICK = 1e-6


def pair(setpoint: int | None, actual: int | None) -> tuple[Parameter, Parameter]:
    """Return a position setpoint and what it stays at, by their numbers."""
    return (parameter('position_setpoint', setpoint, type=INT16, scale=0.1, unit='deg',
                      minimum=-10.0, maximum=10.0, storage=RAM,
                      neutral_from='actual_position', arming_tolerance=0.5),
            parameter('actual_position', actual, type=INT16, scale=0.1, unit='deg', access=RO))


# -- datamodel_standard: 3F1 and 7F1, numbers and words low byte first ----------------------------

ASK = '3F1#03D3000200000000'        # 211, 212


def standard(**options: Any) -> Conversation:
    """Return a conversation whose first round was begun at 10 s."""
    setpoint, actual = pair(60, 212)
    talk = Conversation(drive('datamodel_standard', **{
        'table': (*TABLE, setpoint, actual), 'control': CONTROL, 'request': (WORD, setpoint),
        'response': (STATUS, actual), **options}))
    assert talk.begins() == []
    assert talk.at(10.0) == [ASK]
    return talk


def test_standard_writes_nothing_before_its_first_round() -> None:
    talk = standard()
    assert {text for _, text in talk.until(10.45)} == {ASK}
    assert talk.hears('7F1#01004600ADDEADDE', 10.452) == []
    sent = [text for _, text in talk.until(10.455)]
    assert sent == ['3F1#0634000000000000', '3F1#063C004600000000']


def test_standard_is_latched_when_it_is_enabled() -> None:
    talk = standard()
    talk.hears('7F1#01004600ADDEADDE', 10.002)
    talk.until(10.02 + TICK)
    talk.hears('7F1#01004400ADDEADDE', 10.022)
    assert talk.until(10.042)[0][1] == '3F1#063C004400000000'
    talk.hears('7F1#01004400ADDEADDE', 10.043)
    assert talk.asks(ControlAction.ENABLE, 10.044) == ['3F1#063C004400000000']
    assert talk.until(10.0605) == [(10.045, '3F1#0634000100000000'), (10.06, ASK)]
    talk.hears('7F1#03004100ADDEADDE', 10.062)          # it sagged: that moves nothing
    assert talk.control_outcomes() == [('enable', True, 'enabled')]
    assert talk.until(10.0805) == [(10.08, ASK)]
    talk.hears('7F1#03004000ADDEADDE', 10.082)
    assert talk.until(10.1005) == [(10.1, ASK)]
    talk.hears('7F1#03004000ADDEADDE', 10.102)
    assert talk.commands(0, 7.5, 10.103) is CommandOutcome.NOT_ARMED
    assert talk.commands(0, 6.9, 10.103) is CommandOutcome.ARMED
    assert talk.until(10.121) == [(10.12, '3F1#063C004500000000'), (10.121, ASK)]


def test_standard_is_told_again_what_was_unknown_for_a_moment() -> None:
    """Where it is as it was before, nothing changes that would have it written."""
    setpoint, actual = pair(60, 212)
    actual = replace(actual, scale=0.2)
    talk = standard(table=(*TABLE, setpoint, actual), response=(STATUS, actual),
                    refresh_interval=0.0)
    talk.hears('7F1#01002300ADDEADDE', 10.002)          # 7.0 deg
    talk.until(10.02 + TICK)
    talk.hears('7F1#0100204EADDEADDE', 10.022)          # 4000 deg are more than 16 bits hold
    assert [text for _, text in talk.until(10.04 + TICK)] == [ASK]
    talk.hears('7F1#01002300ADDEADDE', 10.042)
    assert talk.session.services.control_refusal(ControlAction.ENABLE) == says('would_jump')
    assert [text for _, text in talk.until(10.0605)] == ['3F1#063C004600000000']
    assert talk.session.services.control_refusal(ControlAction.ENABLE) == ''


def test_standard_after_a_loss() -> None:
    """It is told ``disable``, but no position: it may stand elsewhere by now."""
    talk = standard()
    talk.hears('7F1#01004600ADDEADDE', 10.002)
    talk.until(10.02 + TICK)
    talk.hears('7F1#01004600ADDEADDE', 10.022)
    while talk.session.online:
        talk.at(talk.session.next_timer())
    sent = [text for _, text in talk.until(12.0)]
    assert {text for text in sent if text.startswith('3F1#06')} == {'3F1#0634000000000000'}
    # the reads of the stop go unanswered, too; then a round finds it at 3.3 deg
    while True:
        (text,) = talk.at(talk.session.next_timer()) or ['']
        if text == ASK:
            break
    now = talk.now
    talk.hears('7F1#01002100ADDEADDE', now + 0.002)
    assert talk.session.online
    assert '3F1#063C002100000000' in [text for _, text in talk.until(now + 0.01)]


def test_standard_without_control_is_told_nothing_after_a_loss() -> None:
    setpoint, actual = pair(60, 212)
    talk = standard(control=None, request=(setpoint,), response=(STATUS, actual))
    talk.hears('7F1#01004600ADDEADDE', 10.002)
    assert [text for _, text in talk.until(10.01)] == ['3F1#063C004600000000']
    talk.commands(0, 7.0, 10.011)
    talk.commands(0, 9.0, 10.011)
    assert [text for _, text in talk.until(10.0215)] == ['3F1#063C005A00000000', ASK]
    assert talk.hears('7F1#01004700ADDEADDE', 10.022) == []
    talk.events()
    sent = [text for _, text in talk.until(10.4)]       # the command times out: stays at 9.0
    sent += [text for _, text in talk.until(13.0)]
    assert {text for text in sent if text.startswith('3F1#06')} <= {'3F1#063C005A00000000'}
    assert not talk.session.online
    after = [text for _, text in talk.until(15.0)]
    assert not [text for text in after if text.startswith('3F1#06')]


def test_standard_stop_of_the_rest_is_none_of_an_axis_that_may_be_anywhere() -> None:
    setpoint, actual = pair(60, 212)
    talk = standard(control=None, request=(setpoint, SPEED), response=(STATUS, actual),
                    command_timeout=0.0)
    talk.hears('7F1#01004600ADDEADDE', 10.002)
    talk.until(10.01)
    talk.commands(0, 7.0, 10.011)
    talk.commands(0, 9.0, 10.011)
    assert [text for _, text in talk.until(10.0215)] == ['3F1#063C005A00000000', ASK]
    talk.hears('7F1#01004700ADDEADDE', 10.022)
    assert talk.handle_stall(12.0) == ['3F1#0632000000000000']
    assert talk.until(12.0015) == [(12.001, '3F1#0332000100000000')]
    talk.events()
    assert talk.hears('7F1#0000ADDEADDEADDE', 12.002) == []
    talk.bus_down(12.003)
    assert [event.text for event in talk.events(Noted) if event.warning] == [
        says('may_still_be_running', why=says('bus_lost_before_stop'))]


# -- cannord: 002 and 003, words low byte first ---------------------------------------------------


def cannord() -> Conversation:
    """Return a conversation whose first frame was just sent: nothing is known yet."""
    setpoint, actual = pair(None, None)
    talk = Conversation(drive('cannord', table=(setpoint, actual), request=(setpoint,),
                              response=(actual,)))
    assert talk.begins() == []
    assert talk.at(10.0) == ['002#7E040000']        # 047Eh and raw 0
    return talk


def test_cannord_from_the_beginning_to_a_fault_and_back() -> None:
    talk = cannord()
    answers = [     # status and position; and what the next frame has to be
        ('310B4600', '7E044600'),       # ready to switch on: followed
        ('310B4400', '7E044400'),
        ('enable', ''),
        ('310B4300', '7F044300'),       # 047Fh, it does not run yet
        ('370B4200', '7F044300'),       # operation enabled: latched
        ('370B4100', '7F044300'),
        ('370B4500', '7F044300'),
        ('command', ''),                # 6.5 deg arms, then 9.0
        ('370B4300', '7F045A00'),
        ('370B4800', '7F045A00'),
        ('disable', ''),
        ('370B4C00', '7E045A00'),       # on its ramp: output still on
        ('330F4E00', '7E044E00'),       # switched on, but no output: followed
        ('380B3000', '7E043000'),       # fault, it sinks
        ('380B2000', '7E042000'),
    ]
    number = 0
    for answer, following in answers:
        now = 10.002 + 0.02 * number
        if answer == 'command':
            assert talk.commands(0, 7.3, now - 0.001) is CommandOutcome.NOT_ARMED
            assert talk.commands(0, 6.5, now - 0.001) is CommandOutcome.ARMED
            assert talk.commands(0, 9.0, now - 0.001) is CommandOutcome.ACCEPTED
        elif answer in ('enable', 'disable'):
            assert talk.asks(ControlAction(answer), now - 0.001) == []
        else:
            assert talk.hears(f'003#{answer}', now) == []
            number += 1
            assert talk.until(10.0 + 0.02 * number + TICK)[0][1] == f'002#{following}', answer


def test_cannord_after_a_loss_carries_disable_and_the_old_value() -> None:
    talk = cannord()
    talk.hears('003#310B4600', 10.002)
    assert [text for _, text in talk.until(10.2 + TICK)] == ['002#7E044600'] * 10
    assert not talk.session.online
    talk.hears('003#310B2100', 10.202)
    assert talk.until(10.22 + TICK)[0][1] == '002#7E042100'


# -- canopen_pkw: node 5, 505 and 485, words low byte first, adjacent registers in one read -------

PKW_STATUS = parameter('system_status_1', 455, index=0x2004, subindex=6, access=RO)
PKW_WORD = parameter('control_register_1', 704, index=0x2008, subindex=5, storage=RAM)
PKW_CONTROL = ControlTable(
    parameter='control_register_1', disable=0x0000, enable=0x0001,
    status_parameter='system_status_1', ready=StatusPattern(0x0001, 0x0001),
    enabled=StatusPattern(0x0080, 0x0080), fault=StatusPattern(0x0004, 0x0004))


def pkw(control: ControlTable | None = PKW_CONTROL, **options: Any) -> Conversation:
    """Return a conversation whose first round, of 455 and 456, was just begun at 10.052 s."""
    setpoint, actual = pair(710, 456)
    talk = Conversation(drive(
        'canopen_pkw', station=5, table=(PKW_STATUS, PKW_WORD, setpoint, actual),
        control=control, request=(setpoint,), response=(PKW_STATUS, actual),
        parameter_timeout=0.5, **options))
    assert talk.begins() == ['000#0105']
    assert talk.at(10.05) == ['505#0000000000000000']
    assert talk.hears('485#0000000000000000', 10.051) == ['505#C70100A600000000']
    return talk


def is_read(text: str) -> bool:
    """Tell whether a request reads two registers, whatever its toggle bit."""
    return int(text[10:12], 16) & 0x7F == 0x26


def answered(talk: Conversation, sent: list[str], now: float) -> list[str]:
    """Let the device confirm its writes; return what was written, without the toggle bit."""
    written = []
    while sent:
        (text,) = sent
        assert not is_read(text)
        written.append(f'{text[4:10]}{int(text[10:12], 16) & 0x7F:02X}{text[12:]}')
        sent = talk.hears(text.replace('505#', '485#'), now)
    return written


def round_with(talk: Conversation, words: str) -> list[str]:
    """Let a round pass that brings these words; return what was written around it."""
    written: list[str] = []
    sent: list[str] = []
    while True:
        sent = sent or talk.at(talk.session.next_timer())
        if sent and is_read(sent[0]):
            sent = talk.hears(f'485#{sent[0][4:12]}{words}', talk.now + 0.001)
            return written + answered(talk, sent, talk.now)
        if sent:
            written.append(f'{sent[0][4:10]}{int(sent[0][10:12], 16) & 0x7F:02X}{sent[0][12:]}')
            sent = talk.hears(sent[0].replace('505#', '485#'), talk.now + 0.0005)


def test_pkw_writes_where_it_is_before_anything_else() -> None:
    talk = pkw()
    sent = talk.hears('485#C70100A641004600', 10.053)
    assert sorted(answered(talk, sent, 10.054)) == ['C002002A00000000', 'C602002A46000000']


def test_pkw_is_latched_when_it_is_enabled() -> None:
    talk = pkw()
    answered(talk, talk.hears('485#C70100A641004600', 10.053), 10.054)
    assert round_with(talk, '41004400') == []
    assert round_with(talk, '41004400') == ['C602002A44000000']
    assert answered(talk, talk.asks(ControlAction.ENABLE, talk.now), talk.now) == [
        'C602002A44000000', 'C002002A01000000']
    assert round_with(talk, 'C1004100') == []           # runs, and sags
    assert talk.control_outcomes() == [('enable', True, 'enabled')]
    assert round_with(talk, 'C1004000') == []
    assert round_with(talk, 'C1004500') == []
    assert talk.commands(0, 7.4, talk.now) is CommandOutcome.NOT_ARMED
    assert talk.commands(0, 6.5, talk.now) is CommandOutcome.ARMED
    assert round_with(talk, 'C1004500') == ['C602002A41000000']


def test_pkw_after_a_loss_writes_no_position() -> None:
    talk = pkw()
    answered(talk, talk.hears('485#C70100A641004600', 10.053), 10.054)
    answered(talk, talk.asks(ControlAction.ENABLE, talk.now), talk.now)
    round_with(talk, 'C1004600')
    talk.events()
    sent = [text for _, text in talk.until(talk.now + 10.0)]
    assert not talk.session.online
    writes = {f'{text[4:10]}{int(text[10:12], 16) & 0x7F:02X}{text[12:]}' for text in sent
              if int(text[10:12] or '0', 16) & 0x7F == 0x2A}
    assert writes == {'C002002A00000000'}


def test_pkw_without_control_is_told_nothing_after_a_loss() -> None:
    talk = pkw(control=None)
    assert answered(talk, talk.hears('485#C70100A641004600', 10.053), 10.054) == [
        'C602002A46000000']
    talk.commands(0, 7.0, talk.now)
    talk.commands(0, 9.0, talk.now)
    assert round_with(talk, '41004700') == ['C602002A5A000000']
    talk.events()
    sent = [text for _, text in talk.until(talk.now + 10.0)]
    assert not talk.session.online
    assert not [text for text in sent if int(text[10:12] or '0', 16) & 0x7F == 0x2A]
    warnings = [event.text for event in talk.events(Noted) if event.warning]
    assert may_run('position_unknown') in warnings


def test_pkw_does_not_enable_what_refuses_its_position() -> None:
    talk = pkw()
    sent = talk.hears('485#C70100A641004600', 10.053)
    assert sent == ['505#C002002A00000000']
    sent = talk.hears('485#C002002A00000000', 10.054)
    assert sent == ['505#C60200AA46000000']
    talk.hears('485#C60200CE22000008', 10.055)      # 0800 0022h: not in the present state
    answer = talk.session.services.control_refusal(ControlAction.ENABLE)
    assert answer == says('would_jump', why=says('write_failed', what=says(
        'write_refused', what='position_setpoint')))


def test_pkw_is_told_again_what_was_unknown_for_a_moment() -> None:
    talk, refused = pkw(refresh_interval=0.0), ['C801']
    answered(talk, talk.hears('485#C70100A641004600', 10.053), 10.054)

    def device(text: str) -> str:
        if is_read(text) or text[4:8] in refused:       # 0800 0022h: not in the present state
            return f'485#{text[4:10]}{int(text[10:12], 16) & 0x80 | 0x4E:02X}22000008'
        words = {'C7010025': '41000000', 'C8010025': '46000000'}.get(
            f'{text[4:10]}{int(text[10:12], 16) & 0x7F:02X}', text[12:])
        return f'485#{text[4:12]}{words}'

    assert '2A46000000' not in str(talk.served(10.34, device))
    assert talk.session.services.control_refusal(ControlAction.ENABLE) == says('would_jump')
    refused.clear()
    written = [text for _, text in talk.served(10.45, device) if text.startswith('505#C602')]
    assert [text[12:] for text in written] == ['46000000']
    assert talk.session.services.control_refusal(ControlAction.ENABLE) == ''
