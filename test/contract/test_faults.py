# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Which fault it is: the profile's section ``fault``, in all families."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

from builders import (
    ACTUAL, CONTROL, CURRENT, drive, frame, GAIN, parameter, RO, SPEED, STATUS, TABLE)
from partners import Partner, PARTNERS
import pytest
from saying import says

from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.core.events import (
    DriveState, Noted, ProcessDataReceived, RequestCompleted)
from drive_can_bridge.core.fault_watch import FaultWatch
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.profile import FaultTable
from drive_can_bridge.core.requests import ReadRequest, ReadValue
from drive_can_bridge.protocols.families import make_sessions

CODE = parameter('fault_code', 217, access=RO)
CODES = ((7, 'overcurrent'), (9, 'hot'))
#: those whose status word is a parameter; CANnord has its own test below
NAMES = sorted(name for name, partner in PARTNERS.items() if not partner.words)


def meet(name: str, *, control: Any = CONTROL, mapped: bool = False, bit: Any = None,
         **options: Any) -> Partner:
    """Have a drive online that can tell of faults."""
    partner = PARTNERS[name](control=control, **options)
    drive = partner.talk.session.configuration
    profile = replace(
        drive.profile, fault=FaultTable('fault_code', CODES, bit),
        parameters={each.name: each for each in (*TABLE, CODE)})
    response = (ACTUAL, CURRENT, STATUS, CODE) if mapped else (ACTUAL, CURRENT, STATUS)
    drive = replace(drive, profile=profile, cyclic_response=response)
    partner.configuration = drive
    partner.talk = type(partner.talk)(drive)
    partner.registers[217] = 0
    if name == 'datamodel_extended' and mapped:
        partner.registers[129] = 217
    partner.start()
    assert partner.talk.session.online
    partner.talk.events()
    return partner


def trip(partner: Partner, code: int) -> list[object]:
    """Let the drive trip; return what is said of it then."""
    partner.registers[217], partner.registers[211] = code, 8
    partner.live(0.5)
    return [note.text for note in partner.talk.events(Noted)]


def text(partner: Partner) -> str:
    watch = partner.talk.session.fault_watch
    assert watch is not None
    return watch.text


def test_an_error_code_of_cia402_is_told_as_manuals_write_it() -> None:
    partner = PARTNERS['cia402']().start()
    session = partner.talk.session
    session.configuration = replace(session.configuration, profile=replace(
        session.configuration.profile, parameters={'fault_code': replace(
            CODE, number=None, index=0x603F, subindex=0)}))
    watch = FaultWatch(session, FaultTable('fault_code', ((0x8130, 'heartbeat missed'),), None))
    for raw, told in ((0x8130, '8130h heartbeat missed'), (0x0042, '0042h')):
        watch.shows = True
        watch._known(raw)
        assert watch.text == told


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('mapped', [False, True])
class TestKnown:

    def test_it_is_told_once_with_number_and_name(self, name: str, mapped: bool) -> None:
        partner = meet(name, mapped=mapped)
        assert text(partner) == ''
        said = trip(partner, 7)
        assert said.count(says('fault_named', number='7', name='overcurrent')) == 1
        assert text(partner) == '7 overcurrent'
        assert partner.talk.session.state is DriveState.FAULT
        partner.registers[217] = 9      # only the first counts
        partner.live(0.5)
        assert text(partner) == '7 overcurrent'
        partner.registers[211] = 1
        partner.live(0.5)
        assert text(partner) == ''
        assert says('fault_named', number='9', name='hot') in trip(partner, 9)

    def test_refusals_name_it(self, name: str, mapped: bool) -> None:
        partner = meet(name, mapped=mapped)
        trip(partner, 7)
        partner.talk.session.services.submit(ControlRequest(ControlAction.ENABLE), partner.now)
        (_, success, message), = partner.talk.control_outcomes()
        assert (success, message) == (False, says('reset_first', fault='7 overcurrent'))

    def test_so_do_an_enable_that_it_ended_and_a_reset_that_did_not_help(
            self, name: str, mapped: bool) -> None:
        partner = meet(name, mapped=mapped, control_timeout=0.5)
        for action, code in ((ControlAction.ENABLE, 'fault_while_enabling'),
                             (ControlAction.RESET_FAULT, 'fault_present')):
            partner.talk.session.services.submit(ControlRequest(action), partner.now)
            trip(partner, 7)
            partner.live(0.5)
            (_, success, message), = partner.talk.control_outcomes()
            assert (success, message.code) == (False, code)
            assert message.fields['fault'] == '7 overcurrent'

    def test_a_number_without_a_name(self, name: str, mapped: bool) -> None:
        partner = meet(name, mapped=mapped)
        assert says('fault_named', number='8', name='') in trip(partner, 8)
        assert text(partner) == '8'

    def test_a_drive_without_control_says_it_by_a_bit(self, name: str, mapped: bool) -> None:
        partner = meet(name, mapped=mapped, control=None, bit=('status_word', 8))
        assert says('fault_named', number='7', name='overcurrent') in trip(partner, 7)
        assert partner.talk.session.state is DriveState.FAULT
        partner.registers[211] = 1
        partner.live(0.2)
        assert partner.talk.session.state is DriveState.NOT_ARMED

    def test_a_drive_that_is_found_in_fault(self, name: str, mapped: bool) -> None:
        partner = meet(name, mapped=mapped)
        trip(partner, 7)
        partner.deaf = True
        partner.live(1.0)
        assert text(partner) == ''
        partner.deaf = False
        partner.live(2.0)
        assert text(partner) == '7 overcurrent'


@pytest.mark.parametrize('name', NAMES)
def test_a_number_that_cannot_be_read(name: str) -> None:
    partner = meet(name, parameter_timeout=0.05, parameter_retries=0)
    del partner.registers[217]
    partner.registers[211] = 8
    partner.live(1.0)
    notes = [note.text for note in partner.talk.events(Noted)]
    why = says('refused_by_drive' if name == 'canopen_pkw' else 'no_answer_briefly')
    assert notes.count(says('fault_unread', reason=why)) == 1
    assert text(partner) == ''
    partner.talk.session.services.submit(ControlRequest(ControlAction.ENABLE), partner.now)
    assert partner.talk.control_outcomes() == [('enable', False, says(
        'reset_first', fault=says('number_unread')))]
    assert partner.talk.session.state is DriveState.FAULT


@pytest.mark.parametrize('name', sorted({*NAMES} - {'canopen_pkw'}))
def test_an_enable_that_it_ended_does_not_wait_for_the_reads_of_users(name: str) -> None:
    partner = meet(name, parameter_timeout=0.1, parameter_retries=2, control_timeout=0.5)
    del partner.registers[40]
    services = partner.talk.session.services
    for _ in range(20):     # nobody answers: 6 s at least
        services.submit(ReadRequest((GAIN,)), partner.now)
    services.submit(ControlRequest(ControlAction.ENABLE), partner.now)
    partner.registers[217], partner.registers[211] = 7, 8
    partner.live(3.0)
    (_, success, message), = partner.talk.control_outcomes()
    assert (success, message.code) == (False, 'fault_while_enabling')   # type: ignore
    partner.live(30.0)
    assert text(partner) == '7 overcurrent'


@pytest.mark.parametrize('name', NAMES)
def test_a_mapped_number_may_come_a_moment_later(name: str) -> None:
    partner = meet(name, mapped=True)
    trip(partner, 0)
    assert text(partner) == ''
    assert says('fault_named', number='7', name='overcurrent') in trip(partner, 7)


@pytest.mark.interpreted    # replaces methods
def test_a_fault_that_comes_again_while_the_last_one_is_asked_for() -> None:
    asked: list[ReadRequest] = []
    session: Any = PARTNERS['cia402']().talk.session
    session.configuration = replace(session.configuration, profile=replace(
        session.configuration.profile, parameters={'fault_code': CODE}))
    seen = SimpleNamespace(
        configuration=session.configuration, control=session.control,
        interlock=SimpleNamespace(obeyed=SimpleNamespace(fault_text='')),
        report=SimpleNamespace(note=lambda event: None), sample_parameters=(), shows_fault=False,
        services=SimpleNamespace(submit=lambda request, now: asked.append(request)))
    watch = FaultWatch(seen, FaultTable('fault_code', CODES, None))
    for seen.shows_fault in (True, False, True, True):
        watch.look([ProcessDataReceived((), 1.0)])
    assert len(asked) == 1
    assert watch.take(RequestCompleted(asked[0], (ReadValue(7),)))
    assert watch.text == ''
    for _ in range(2):
        watch.look([ProcessDataReceived((), 1.0)])
    assert len(asked) == 2
    assert watch.take(RequestCompleted(asked[1], (ReadValue(9),)))
    assert watch.text == seen.interlock.obeyed.fault_text == '9 hot'
    assert not watch.take(RequestCompleted(ReadRequest((CODE,)), (ReadValue(7),)))


def test_an_inverter_that_leads_is_not_asked_for_the_fault_of_another_but_tells_it() -> None:
    table = (ACTUAL, CODE)
    drives = [drive('cannord', name=f'drive_{station}', station=station, request=(SPEED,),
                    response=(ACTUAL,), table=(SPEED, *table), broadcast='group', period=0.02)
              for station in (1, 2)]
    drives = [replace(each, profile=replace(
        each.profile, fault=FaultTable('fault_code', CODES, None))) for each in drives]
    sessions = make_sessions(drives)
    now, asked = 10.0, list[Frame]()
    for session in sessions:
        session.bus_up(now)
        session.activate(now)
    while now < 11.0:
        now = max(now, min(session.next_timer() for session in sessions))
        for session in sessions:
            session.handle_timer(now)
        for session in sessions:
            for sent in session.take_frames():
                if sent.identifier in (0x002, 0x004):   # the second one has a fault
                    index = sent.identifier // 4
                    sessions[index].receive_frame(frame(
                        ('003#310B0000', '005#380B0000')[index]), now)
                if sent.identifier in (0x202, 0x204):
                    asked.append(sent)
                    session.receive_frame(frame('205#D910000000000700'), now)
            session.frames_left(now)
            session.take_events()
    assert {each.identifier for each in asked} == {0x204}
    sessions[0].services.submit(ControlRequest(ControlAction.ENABLE), now)
    refusal, = [event.message for event in sessions[0].take_events()
                if isinstance(event, ControlCompleted)]
    assert refusal == says('reset_first', fault='7 overcurrent')


@pytest.mark.parametrize('control', [CONTROL, None])
def test_a_poll_that_is_refused_hides_no_fault(control: Any) -> None:
    partner = meet('canopen_pkw', control=control, bit=('status_word', 8))
    del partner.registers[CURRENT.number or 0]
    assert says('fault_named', number='7', name='overcurrent') in trip(partner, 7)
    assert partner.talk.session.state is DriveState.FAULT
