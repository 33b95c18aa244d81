# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``Session.sent``: what stood in the last frames, in every family."""

from builders import CONTROL, drive, LIMIT, SPEED, WORD
from partners import Partner, PARTNERS
import pytest

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.families import make_sessions


@pytest.fixture(params=sorted(PARTNERS), name='family')
def _family(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def started(family: str, **options: object) -> Partner:
    partner = PARTNERS[family](command_timeout=0.0, **options).start()
    assert partner.talk.session.online
    return partner


@pytest.fixture(name='partner')
def _partner(family: str) -> Partner:
    return started(family)


def told(partner: Partner) -> dict[str, int | None]:
    sent = partner.talk.session.sent
    return dict(zip((parameter.name for parameter in sent.parameters), sent.raws))


def commanded(partner: Partner) -> Session:
    """Enable it, and command -150 rpm; return the session."""
    partner.enable()
    session = partner.session
    session.setpoints.items[0].armed = True
    session.services.command(0, -150.0, partner.now)
    return session


def word(partner: Partner, name: str) -> dict[str, int]:
    """Return the control word of a family that has it built in."""
    return {'control_word': partner.words[name]} if partner.words else {}


def test_nothing_was_sent_at_first(family: str) -> None:
    partner = PARTNERS[family]()
    assert set(told(partner).values()) == {None}
    partner.deaf = True
    partner.deliver(partner.talk.bus_up(partner.now))
    assert set(told(partner).values()) == {None}


def test_setpoints_as_the_drive_got_them(partner: Partner) -> None:
    assert told(partner) == {**word(partner, 'disable'), 'speed_setpoint': 0}
    same = partner.talk.session.sent.raws
    partner.live(0.1)
    assert partner.talk.session.sent.raws is same, 'nothing changed'
    commanded(partner)
    assert told(partner)['speed_setpoint'] == 0, 'commanded, not sent'
    partner.take()
    partner.live(0.1)
    assert told(partner) == {**word(partner, 'enable'), 'speed_setpoint': -1500}
    assert list(partner.commanded())[-1] == -1500 & 0xFFFF
    partner.ends(1.0)
    assert told(partner) == {**word(partner, 'disable'), 'speed_setpoint': 0}


def test_what_the_bus_refused_was_not_sent(partner: Partner) -> None:
    session = commanded(partner)
    partner.talk.refusing = lambda text: bool(partner.setpoints(text))
    partner.live(0.03)     # no longer than the drive may be missed
    assert told(partner)['speed_setpoint'] == 0
    partner.talk.refusing = lambda text: False
    session.services.command(0, -150.0, partner.now)
    partner.live(1.1)
    assert told(partner)['speed_setpoint'] == -1500


def test_a_stop_that_is_told_when_the_bus_is_back(partner: Partner) -> None:
    """By whatever way a family has for it; nobody answers."""
    session = commanded(partner)
    partner.live(0.1)
    assert told(partner) == {**word(partner, 'enable'), 'speed_setpoint': -1500}
    partner.deliver(partner.talk.bus_down(partner.now))
    assert told(partner) == {**word(partner, 'enable'), 'speed_setpoint': -1500}
    partner.deaf = True
    partner.deliver(partner.talk.bus_up(partner.now))
    partner.live(2.0)   # cia402: a node that NMT may have stopped gets its word for a second first
    assert not session.online
    assert told(partner)['speed_setpoint'] == 0
    if partner.words:
        assert told(partner)['control_word'] != partner.words['enable']


@pytest.mark.parametrize('request_, order', [
    ((SPEED, LIMIT), ['speed_setpoint', 'torque_limit', 'control_word']),
    ((WORD, SPEED), ['control_word', 'speed_setpoint'])])
@pytest.mark.parametrize('family', ['datamodel_extended', 'datamodel_standard', 'canopen_pkw'])
def test_control_word_with_and_without_a_slot(family: str, request_: tuple[Parameter, ...],
                                              order: list[str]) -> None:
    partner = PARTNERS[family](control=CONTROL, request=request_)
    partner.registers.update({122 + place: parameter.number for place, parameter
                              in enumerate(partner.configuration.cyclic_request)})
    partner.registers.update({122 + place: 0 for place in range(len(request_), 4)})
    partner.start()
    partner.live(0.3)
    assert list(told(partner)) == order
    assert set(told(partner).values()) == {0}
    partner.deliver(partner.talk.asks(ControlAction.ENABLE, partner.now))
    partner.live(0.3)
    assert told(partner)['control_word'] == 1
    partner.registers[211] = 3      # it runs, and goes on
    partner.live(0.3)
    partner.deliver(partner.talk.asks(ControlAction.QUICK_STOP, partner.now))
    partner.live(0.1)
    assert told(partner)['control_word'] == 2


def test_activation_begins_anew(partner: Partner) -> None:
    partner.ends(1.0)
    partner.deliver(partner.talk.bus_down(partner.now))
    partner.deliver(partner.talk.activate(partner.now))
    assert set(told(partner).values()) == {None}


def test_all_members_of_a_broadcast_group_are_told_the_same() -> None:
    sessions = make_sessions([
        drive('cannord', name=name, station=station, request=(SPEED,), broadcast='group')
        for name, station in (('lift', 1), ('hoist', 2))])
    for session in sessions:
        session.bus_up(9.0)
        session.activate(9.0)
    sessions[0].handle_timer(9.1)
    assert sessions[0].take_frames()
    sessions[0].frames_left(9.1)
    assert [session.sent.raws for session in sessions] == [(0x047E, 0)] * 2
    assert [parameter.name for parameter in sessions[1].sent.parameters] == [
        'control_word', 'speed_setpoint']
