# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""One request at a time: toggle, synchronisation, what fits a request, time-outs."""

import pytest

from drive_can_bridge.core.outbox import Left
from drive_can_bridge.core.requests import RetryPolicy
from drive_can_bridge.protocols.canopen_pkw import pkw
from drive_can_bridge.protocols.canopen_pkw.pkw import Address, PkwLayout
from drive_can_bridge.protocols.canopen_pkw.transactor import (
    MailboxTransactor, RegisterRead, RegisterWrite, Reply)
from drive_can_bridge.protocols.transactor import Answered, Refused, Silence

REGISTER = Address(455)
OBJECT = Address(0x2004, 0x06)
READ = RegisterRead(REGISTER)
IDLE = '0000000000000000'


class Box:
    """A mailbox, spoken to in hex."""

    def __init__(self, order: str = 'auto', timeout: float = 0.5) -> None:
        self.sent: list[str] = []
        self.box = MailboxTransactor(
            self.send, order=order, retry=RetryPolicy(timeout, attempts=1))
        self.left: Left = lambda sent, now: None

    def send(self, message: pkw.PkwMessage, left: Left) -> None:
        self.sent.append(pkw.encode(message, PkwLayout.WORD_LE).hex().upper())
        self.left = left

    def take(self) -> list[str]:
        sent, self.sent = self.sent, []
        return sent

    def begin(self, step: RegisterRead | RegisterWrite, now: float) -> list[str]:
        self.box.begin(step, now)
        return self.take()

    def asks(self, step: RegisterRead | RegisterWrite, now: float) -> list[str]:
        """Begin something; function 00h is answered at once."""
        sent = self.begin(step, now)
        if sent == [IDLE]:
            assert self.hears(IDLE, now) is True
            sent += self.take()
        return sent

    def hears(self, text: str, now: float) -> Reply | bool:
        return self.box.receive(pkw.decode(bytes.fromhex(text), PkwLayout.WORD_LE), now)


@pytest.fixture(name='box')
def _box() -> Box:
    """Return a mailbox that has just read register 455 with toggle 1."""
    box = Box()
    assert box.asks(READ, 0.0) == [IDLE, 'C70100A500000000']
    assert box.hears('C70100A583200000', 0.02) == Answered((0x2083, 0))
    return box


def test_function_zero_goes_first_and_the_toggle_alternates(box: Box) -> None:
    for second, function in enumerate(('25', 'A5', '25', 'A5')):
        assert box.begin(READ, 1.0 + second) == [f'C70100{function}00000000']
        assert box.hears(f'C70100{function}8320FFFF', 1.1 + second) == Answered(
            (0x2083, 0xFFFF))
    assert box.take() == []
    assert not box.box.busy


def test_function_zero_is_answered_with_either_toggle_and_any_content() -> None:
    for answer in (IDLE, 'C701008083200000'):
        box = Box()
        box.begin(READ, 0.0)
        assert box.hears(answer, 0.01) is True
        assert box.take() == ['C70100A500000000']


@pytest.mark.parametrize('wrong', [
    'C70100A583200000',     # toggle
    'C701002683200000',     # function
    'C701005583200000',     # function: a slip of the page, which prints 55h for 35h
    'C701003583200000',     # function
    'C801002583200000',     # register
    'C702002583200000',     # register
    'C70100CE02000106',     # refusal with the other toggle
    'C801004E02000106',     # refusal of another register
    IDLE,     # function 00h
    'C701000000000000',     # function 00h
])
def test_responses_that_do_not_fit(box: Box, wrong: str) -> None:
    box.begin(READ, 1.0)
    assert box.hears(wrong, 1.1) is False
    assert box.box.busy
    assert box.hears('C701002583200000', 1.2) == Answered((0x2083, 0))


@pytest.mark.parametrize('wrong', [
    '0420073583200000', '042006B583200000', '0520063583200000', '0420065583200000',
    '0420074E11000906', '0420FF4E11000906',
])
def test_sub_index_has_to_fit(box: Box, wrong: str) -> None:
    assert box.begin(RegisterRead(OBJECT), 1.0) == ['0420063500000000']
    assert box.hears(wrong, 1.1) is False
    assert box.hears('0420063583200000', 1.2) == Answered((0x2083, 0))
    assert box.begin(RegisterRead(OBJECT), 2.0) == ['042006B500000000']
    assert box.hears('042006CE11000906', 2.1) == Refused(0x06090011)


def test_low_byte_of_a_register_response_does_not_matter(box: Box) -> None:
    box.begin(READ, 1.0)
    assert box.hears('C701992583200000', 1.1) == Answered((0x2083, 0))


@pytest.mark.parametrize('data, order, code', [
    ('02000106', 'auto', 0x06010002), ('01060200', 'auto', 0x06010002),
    ('02000106', 'low_first', 0x06010002), ('02000106', 'high_first', 0x00020601),
    ('01060200', 'high_first', 0x06010002), ('08000000', 'auto', 8),
    ('00000800', 'auto', 8), ('99000906', 'auto', 0x06090099),
    ('09069900', 'auto', 0x06090099), ('34127856', 'auto', 0x56781234),
    ('00000000', 'auto', 0),
])
def test_refusals(data: str, order: str, code: int) -> None:
    box = Box(order=order)
    box.begin(RegisterWrite(REGISTER, (0x1234,)), 0.0)
    box.hears(IDLE, 0.01)
    assert box.take()[-1] == 'C70100AA34120000'
    assert box.hears(f'C70100CE{data}', 0.02) == Refused(code)


def test_after_silence_function_zero_goes_first_again(box: Box) -> None:
    box.begin(READ, 1.0)
    assert box.box.deadline == 1.5
    assert box.box.handle_timer(1.499) is False
    assert box.box.handle_timer(1.5) == Silence(sent=True)
    assert box.begin(READ, 2.0) == [IDLE]
    # the late answer of the request before is no answer any more
    assert box.hears('C701002583200000', 2.01) is False
    assert box.hears(IDLE, 2.02) is True
    assert box.take() == ['C70100A500000000']
    assert box.hears('C701002583200000', 2.03) is False
    assert box.hears('C70100A583200000', 2.04) == Answered((0x2083, 0))


def test_refusals_synchronise_as_well(box: Box) -> None:
    box.begin(READ, 1.0)
    assert box.hears('C701004E00000206', 1.1) == Refused(0x06020000)
    assert box.begin(READ, 2.0) == ['C70100A500000000']


def test_device_that_does_not_answer_function_zero_is_read_all_the_same() -> None:
    """Its last function byte may be 00h already: then it takes no notice of another one."""
    box = Box()
    box.begin(READ, 0.0)
    box.take()
    assert box.box.deadline == 0.1
    assert box.box.handle_timer(0.1) is False
    assert box.take() == ['C70100A500000000']
    assert box.hears(IDLE, 0.2) is False
    assert box.hears('C70100A583200000', 0.3) == Answered((0x2083, 0))
    assert box.begin(READ, 1.0) == ['C701002500000000']


def test_two_silences_in_a_row_invert_the_toggle() -> None:
    box = Box()
    sent = []
    for start in (0.0, 10.0, 20.0):
        sent += box.begin(READ, start)
        assert box.box.handle_timer(start + 0.1) is False
        sent += box.take()
        assert box.box.handle_timer(start + 0.6) == Silence(sent=True)
    assert [text[6:8] for text in sent] == ['00', 'A5', '00', '25', '00', 'A5']


def test_write_is_not_sent_when_nobody_knows_the_function_byte() -> None:
    box = Box()
    assert box.begin(RegisterWrite(REGISTER, (1,)), 0.0) == [IDLE]
    assert box.box.handle_timer(0.1) == Silence(sent=False)
    assert box.take() == []
    assert not box.box.busy


def test_blind_write_goes_at_once_with_its_own_time_out() -> None:
    box = Box()
    assert box.begin(RegisterWrite(REGISTER, (1,), blind=True, timeout=0.05), 0.0) == [
        'C70100AA01000000']
    assert box.box.deadline == 0.05
    assert box.box.handle_timer(0.05) == Silence(sent=True)
    assert box.begin(RegisterWrite(REGISTER, (1,), blind=True), 1.0) == ['C701002A01000000']


@pytest.mark.parametrize('step', [RegisterWrite(REGISTER, (1,)),
                                  RegisterWrite(REGISTER, (1,), blind=True)])
def test_write_that_the_bus_refuses_was_not_sent(box: Box, step: RegisterWrite) -> None:
    assert box.begin(step, 1.0) == ['C701002A01000000']
    box.left(False, 1.0)
    if not step.blind:
        assert box.box.handle_timer(1.0) == Silence(sent=False, refused=True)
    else:
        assert box.box.handle_timer(1.009) is False
        assert box.box.deadline == pytest.approx(1.01)
        assert box.box.handle_timer(1.01) is False
        assert box.take() == ['C701002A01000000']
        box.left(False, 1.01)
        assert box.box.handle_timer(1.5) == Silence(sent=False, refused=True)
    # the device has not seen it: nothing has to be synchronised, and its toggle is still new
    assert box.begin(READ, 2.0) == ['C701002500000000']


def test_refused_write_that_has_to_make_room_ends(box: Box) -> None:
    box.begin(RegisterWrite(REGISTER, (1,), blind=True), 1.0)
    box.left(False, 1.0)
    box.box.abandon(1.05)
    assert box.box.handle_timer(1.0) == Silence(sent=False, refused=True)


def test_read_that_the_bus_refuses_ends_when_its_time_is_over(box: Box) -> None:
    box.begin(READ, 1.0)
    box.left(False, 1.0)
    assert box.box.handle_timer(1.499) is False
    assert box.box.deadline == 1.5
    assert box.box.handle_timer(1.5) == Silence(sent=False, refused=True)
    assert box.begin(READ, 2.0) == ['C701002500000000']


def test_short_time_out_counts_for_function_zero_too() -> None:
    box = Box(timeout=0.02)
    box.begin(READ, 0.0)
    assert box.box.deadline == 0.02


def test_forgetting_ends_the_exchange_and_the_synchronisation(box: Box) -> None:
    box.begin(READ, 1.0)
    box.box.forget()
    assert not box.box.busy
    assert box.hears('C701002583200000', 1.1) is False
    assert box.begin(READ, 2.0) == [IDLE]


def test_one_exchange_at_a_time(box: Box) -> None:
    box.begin(READ, 1.0)
    with pytest.raises(RuntimeError):
        box.begin(READ, 1.1)


# -- late answers to what was given up, which have the toggle of the last but one -----------------


def blind(value: int, register: Address = REGISTER) -> RegisterWrite:
    return RegisterWrite(register, (value,), blind=True, timeout=0.05)


@pytest.fixture(name='told')
def _told(box: Box) -> Box:
    """Return a mailbox that gave up on 1 with toggle 0, then on 0 with 1, and waits for 0."""
    assert box.begin(RegisterWrite(REGISTER, (1,)), 1.0) == ['C701002A01000000']
    box.box.abandon(1.05)
    assert box.box.handle_timer(1.05) == Silence(sent=True)
    assert box.begin(blind(0), 1.05) == ['C70100AA00000000']
    assert box.box.handle_timer(1.1) == Silence(sent=True)
    assert box.begin(blind(0), 1.1) == ['C701002A00000000']
    return box


@pytest.mark.parametrize('late', ['C701002A00000000', 'C701004E22000008'])
def test_the_answer_to_another_value_proves_nothing(told: Box, late: str) -> None:
    """A device that was busy with 1 takes no notice of a request with the same function byte."""
    assert told.hears(late, 1.13) is False
    assert told.take() == ['C70100AA00000000']
    assert told.box.deadline == pytest.approx(1.18)
    assert told.hears('C701002A00000000', 1.14) is False
    assert told.take() == []
    assert told.hears('C70100AA00000000', 1.15) == Answered((0, 0))
    assert not told.box.busy


def test_the_answer_to_the_same_value_is_as_good(told: Box) -> None:
    """The device got both 0, in order; the answer to the first of them comes in between."""
    assert told.hears('C701002A00000000', 1.13) is False
    assert told.take() == ['C70100AA00000000']
    assert told.hears('C70100AA00000000', 1.14) == Answered((0, 0))


def test_a_late_answer_that_fits_nothing_under_way_is_over(told: Box) -> None:
    """It is to the first 0: after that no answer to 1 can come."""
    assert told.hears('C70100AA00000000', 1.13) is False
    assert told.take() == []
    assert told.hears('C701002A00000000', 1.14) == Answered((0, 0))


def test_a_late_answer_while_nothing_is_asked_is_over(told: Box) -> None:
    assert told.box.handle_timer(1.16) == Silence(sent=True)
    assert told.hears('C701002A00000000', 1.17) is False
    assert told.begin(blind(0), 1.2) == ['C70100AA00000000']
    assert told.hears('C70100AA00000000', 1.21) == Answered((0, 0))


def test_another_register_has_answers_of_its_own(told: Box) -> None:
    assert told.box.handle_timer(1.16) == Silence(sent=True)
    other = Address(456)
    assert told.begin(blind(7, other), 1.16) == ['C80100AA07000000']
    assert told.box.handle_timer(1.22) == Silence(sent=True)
    assert told.begin(blind(7, other), 1.22) == ['C801002A07000000']
    assert told.hears('C801002A00000000', 1.23) == Answered((0, 0))


def test_after_the_answer_to_a_read_none_to_older_writes_comes(told: Box) -> None:
    assert told.box.handle_timer(1.16) == Silence(sent=True)
    assert told.asks(READ, 1.16) == [IDLE, 'C70100A500000000']
    assert told.hears('C70100A583200000', 1.18) == Answered((0x2083, 0))
    assert told.begin(blind(0), 1.2) == ['C701002A00000000']
    assert told.hears('C701002A00000000', 1.21) == Answered((0, 0))


def test_what_has_to_make_room_is_not_sent_again(told: Box) -> None:
    told.box.abandon(1.14)
    assert told.hears('C701002A00000000', 1.13) is False
    assert told.take() == []
    assert told.box.handle_timer(1.14) == Silence(sent=True)


def test_what_must_not_be_executed_twice_is_sent_once(told: Box) -> None:
    """Function 00h has been answered before: an answer to what is older cannot come any more."""
    assert told.box.handle_timer(1.16) == Silence(sent=True)
    write = RegisterWrite(REGISTER, (7,))
    assert told.asks(write, 1.2) == [IDLE, 'C70100AA07000000']
    assert told.hears('C70100AA00000000', 1.22) == Answered((0, 0))
    assert told.take() == []


# -- late answers to what must not be executed twice: the device may answer others meanwhile ------


def gives_up(box: Box, write: RegisterWrite, now: float) -> str:
    """Have a write sent that nobody answers; return what was sent."""
    sent = box.asks(write, now)
    assert box.box.handle_timer(now + 0.5) == Silence(sent=True)
    return sent[-1]


def reads(box: Box, now: float) -> str:
    """Read register 455; return what was sent."""
    sent = box.asks(READ, now)
    assert isinstance(box.hears(sent[-1], now), Answered)
    return sent[-1]


FIRST, SECOND = RegisterWrite(Address(652), (44,)), RegisterWrite(Address(652), (33,))


def test_write_has_not_the_toggle_of_one_that_was_given_up(box: Box) -> None:
    assert gives_up(box, FIRST, 1.0) == '8C02002A2C000000'
    assert reads(box, 1.51) == 'C70100A500000000'
    assert box.asks(SECOND, 1.52) == [IDLE, '8C0200AA21000000']
    assert box.hears('8C02002A00000000', 1.54) is False
    assert box.hears('8C0200AA00000000', 1.55) == Answered((0, 0))
    assert reads(box, 1.56) == 'C701002500000000'


@pytest.mark.parametrize('late', ['8C02002A00000000', '8C02004E30000906'])
def test_once_the_late_answer_has_come_the_toggle_is_free(box: Box, late: str) -> None:
    gives_up(box, FIRST, 1.0)
    reads(box, 1.51)
    assert box.hears(late, 1.52) is False
    assert box.begin(SECOND, 1.53) == ['8C02002A21000000']
    assert box.hears('8C02002A00000000', 1.54) == Answered((0, 0))


@pytest.mark.parametrize('now, sent', [
    (2.49, IDLE), (2.5, '8C02002A21000000'),
])
def test_the_toggle_is_free_when_no_late_answer_can_come_any_more(
        box: Box, now: float, sent: str) -> None:
    """That is a time-out and 0.5 s after it was given up."""
    gives_up(box, FIRST, 1.0)
    reads(box, 1.51)
    assert box.begin(SECOND, now) == [sent]


@pytest.mark.parametrize('write, sent', [
    (RegisterWrite(Address(653), (33,)), '8D02002A21000000'),
    (RegisterWrite(Address(0x2007, 0x03), (33,)), '0720033A21000000'),
])
def test_another_address_is_not_mistaken(box: Box, write: RegisterWrite, sent: str) -> None:
    gives_up(box, FIRST, 1.0)
    reads(box, 1.51)
    assert box.begin(write, 1.52) == [sent]


def test_two_registers_may_be_refused_by_the_late_answer_of_one(box: Box) -> None:
    """A refusal does not say which function is refused."""
    gives_up(box, FIRST, 1.0)
    reads(box, 1.51)
    assert box.begin(RegisterWrite(Address(652), (33, 34)), 1.52) == [IDLE]


def test_where_both_toggles_are_taken_the_first_answer_is_not_believed(box: Box) -> None:
    assert gives_up(box, FIRST, 1.0) == '8C02002A2C000000'
    assert gives_up(box, FIRST, 1.51) == '8C0200AA2C000000'
    assert box.asks(SECOND, 2.02) == [IDLE, '8C02002A21000000']
    assert box.hears('8C02002A00000000', 2.04) is False
    assert box.hears('8C02004E30000906', 2.05) == Refused(0x06090030)


def test_lost_answers_are_not_waited_for_for_ever(box: Box) -> None:
    """It was the answer to the third; that to the first will never come."""
    assert gives_up(box, FIRST, 1.0) == '8C02002A2C000000'
    assert gives_up(box, FIRST, 1.51) == '8C0200AA2C000000'
    assert box.asks(SECOND, 2.02) == [IDLE, '8C02002A21000000']
    assert box.hears('8C02002A00000000', 2.04) is False
    assert box.box.handle_timer(2.53) == Silence(sent=True)
    assert box.asks(SECOND, 2.54) == [IDLE, '8C02002A21000000']
    assert box.hears('8C02002A00000000', 2.56) == Answered((0, 0))


def test_lost_handshakes_cost_no_more_than_one_question(box: Box) -> None:
    """What a lost one leaves in doubt, a register shows that nobody has asked for."""
    box.box.forget()
    for now in (1.0, 2.0):
        assert box.begin(FIRST, now) == [IDLE]
        assert box.box.handle_timer(now + 0.1) == Silence(sent=False)
    gives_up(box, FIRST, 3.0)
    gives_up(box, FIRST, 4.0)
    assert box.begin(SECOND, 20.0) == [IDLE]
    assert box.hears(IDLE, 20.01) is True       # it may be that to one of the others
    assert box.take() == ['4000002500000000']
    assert box.hears('4000004E02000106', 20.02) is True
    write, = box.take()
    assert write[:6] == '8C0200'
    assert box.hears(write[:8] + '00000000', 20.03) == Answered((0, 0))


def test_behind_an_answer_that_was_not_believed_the_next_one_is() -> None:
    """Where nobody waits until a toggle is free: what commands a drive."""
    box = Box(timeout=0.1)
    for now in (1.0, 1.11):
        box.asks(FIRST, now)
        assert box.box.handle_timer(now + 0.1) == Silence(sent=True)
    assert box.box.held_until(SECOND, 1.22) == pytest.approx(1.7)
    sent = box.asks(SECOND, 1.22)[-1]
    assert box.hears(sent[:8] + '00000000', 1.23) is False
    assert box.box.handle_timer(1.33) == Silence(sent=True)
    aside = box.asks(SECOND, 1.34)[-1]
    assert aside[:4] == '4000'
    assert box.hears(aside, 1.35) is True
    write, = box.take()
    assert box.hears(write[:8] + '00000000', 1.36) == Answered((0, 0))


def test_a_stop_is_believed_behind_a_register_that_nobody_has_asked_for() -> None:
    """However many other values were written before it in vain."""
    box = Box(timeout=0.1)
    for number in range(7):
        box.begin(blind(100 + number), 1.0 + 0.2 * number)
        assert box.box.handle_timer(1.1 + 0.2 * number) == Silence(sent=True)
    stop, = box.begin(blind(0), 3.0)
    assert box.hears(stop[:8] + '00000000', 3.002) is False
    aside, = box.take()
    assert aside[:4] == '4000'
    assert box.hears(aside, 3.004) is True
    again, = box.take()
    assert (again[:6], again[8:]) == (stop[:6], '00000000')
    assert box.hears(again, 3.006) == Answered((0, 0))


def test_a_stop_waits_for_that_register_for_a_moment_only() -> None:
    box = Box(timeout=0.1)
    for number in range(7):
        box.begin(blind(100 + number), 1.0 + 0.2 * number)
        box.box.handle_timer(1.1 + 0.2 * number)
    stop, = box.begin(blind(0), 3.0)
    assert box.hears(stop[:8] + '00000000', 3.002) is False
    box.take()
    assert box.box.handle_timer(3.052) is False
    again, = box.take()
    assert (again[:6], again[8:]) == (stop[:6], '00000000')


def test_write_that_had_to_make_room_has_its_time_to_be_late(box: Box) -> None:
    assert box.begin(FIRST, 1.0) == ['8C02002A2C000000']
    box.box.abandon(1.05)
    assert box.box.handle_timer(1.05) == Silence(sent=True)
    assert reads(box, 1.06) == 'C70100A500000000'
    assert box.begin(SECOND, 2.49) == [IDLE]


def test_what_was_cut_short_may_be_answered_late_too(box: Box) -> None:
    assert box.begin(FIRST, 1.0) == ['8C02002A2C000000']
    box.box.forget()
    assert reads(box, 1.01) == 'C70100A500000000'
    assert box.asks(SECOND, 1.02) == [IDLE, '8C0200AA21000000']


def test_what_stops_a_drive_waits_for_no_toggle(box: Box) -> None:
    assert gives_up(box, RegisterWrite(REGISTER, (1,)), 1.0) == 'C701002A01000000'
    reads(box, 1.51)
    assert box.begin(blind(0), 1.52) == ['C701002A00000000']


@pytest.mark.parametrize('refused, following', [
    (RegisterWrite(REGISTER, (1,)), blind(0)), (FIRST, SECOND)])
def test_what_the_bus_refused_takes_no_toggle(box: Box, refused: RegisterWrite,
                                              following: RegisterWrite) -> None:
    sent, = box.begin(refused, 1.0)
    box.left(False, 1.0)
    assert box.box.handle_timer(1.0) == Silence(sent=False, refused=True)
    again, = box.begin(following, 1.1)
    assert again[:8] == sent[:8], 'nor is it answered'
    assert box.hears(again[:8] + '00000000', 1.11) == Answered((0, 0))
