# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Drives with 29-bit and with 11-bit identifiers on one bus: identifier *and* format decide.

The 29-bit frames 000003F1h and 000007F1h carry the numbers of the 11-bit drive; they are of
station 0, which does not exist.
"""

from collections.abc import Callable, Iterator
import time
import uuid

from builders import drive, frame, INT32, parameter
import can
from clocks import REAL
from exchange_builders import all_routes, Bench
import pytest

from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.events import ForeignMasterSeen, FrameRejected, StationFound
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.transport.port import open_port, Port

ZEROS = '0000000000000000'
LONG_ASK_MAP = f'002007A4#{ZEROS}'
LONG_NEUTRAL = f'003FFFF0#{ZEROS}'
LONG_ANSWER = '103FFFF0#03E800FA00010000'
SHORT_ASK = '3F1#03D1000300000000'
SHORT_ANSWER = '7F1#E803FA000100ADDE'
SHORT_NEUTRAL = ['3F1#0632000000000000', '3F1#0633000000000000']
#: the numbers of the 11-bit drive in the other format
TWINS = ['000003F1#03D1000300000000', '000003F1#0632006400000000', '000007F1#0100020003000400',
         '000007F1#', '000003F1#']


def mixed() -> Bench:
    """Return both kinds of drive with the same station number."""
    return Bench(drive('datamodel_extended', name='long', station=1),
                 drive('datamodel_standard', name='short', station=1))


def online() -> Bench:
    """Return both, online, at 10.010 s; the 11-bit drive has its setpoints."""
    bench = mixed()
    bench.online()
    assert bench.hears(SHORT_ANSWER, 10.002) == []
    assert [session.online for session in bench.sessions] == [True, True]
    assert bench.at(10.003) == SHORT_NEUTRAL[:1]
    assert bench.at(10.004) == SHORT_NEUTRAL[1:]
    assert bench.at(10.010) == []
    return bench


def test_what_came_in_one_packet_is_taken_before_anything_is_sent() -> None:
    """The answer of a node and its boot-up frame: no request of before follows."""
    target = parameter('target', None, index=0x60FF, subindex=0, type=INT32)
    bench = Bench(drive('cia402', name='servo', station=5, mode='pv', table=(target,),
                        request=(target,), response=())).begin()
    assert bench.link.take()[-1] == '605#4041600000000000'
    bench.link.coming = [frame('705#00'), frame('706#05'), frame('705#7F')]
    assert bench.hears('585#4B41600050020000', 10.01) == ['605#4041600000000000']   # again
    assert bench.link.coming == []
    assert bench.exchange.frames_rejected == 1
    bench.link.coming = [frame('706#05')]
    assert bench.hears('705#7F', 10.03) == []
    assert len(bench.link.coming) == 1, 'nothing is to be sent, so nobody looks'


def test_the_start_of_another_master_concerns_all_nodes() -> None:
    """NMT and, of a PKW drive, requests to its SDO server are on identifiers of no drive."""
    target = parameter('target', None, index=0x60FF, subindex=0, type=INT32)
    bench = Bench(drive('cia402', name='servo', station=5, mode='pv', table=(target,),
                        request=(target,), response=()),
                  drive('canopen_pkw', name='starter', station=6)).begin()

    def told(text: str) -> list[list[str]]:
        for notes in bench.notes:
            notes.events.clear()
        bench.hears(text, 10.1)
        return [[event.text.code for event in notes.events
                 if isinstance(event, ForeignMasterSeen)] for notes in bench.notes]
    assert told('000#8200') == [['other_master_resets']] * 2
    assert told('000#0206') == [[], ['other_master_nmt']]
    assert told('605#2B17100000000000') == [['heartbeats_ended'], []]
    assert told('606#4000100000000000') == [[], ['other_master_reads']]
    assert told('607#4000100000000000') == [[], []]
    assert bench.exchange.frames_rejected == 1


def test_both_begin_at_once() -> None:
    bench = mixed()
    bench.begin()
    # whatever needs no timer goes at once, the first round with the timer
    assert bench.link.take() == [LONG_ASK_MAP]
    assert bench.at(10.0) == [SHORT_ASK]


def test_each_gets_its_own_answers() -> None:
    bench = online()
    long, short = bench.notes
    assert [event.raws for event in long.samples] == [(1000, 250, 1)]
    assert [event.raws for event in short.samples] == [(1000, 250, 1)]
    assert bench.at(10.02) == [LONG_NEUTRAL, SHORT_ASK]
    assert bench.hears('7F1#0100020003000400', 10.021) == []
    assert len(long.samples) == 1
    assert short.samples[-1].raws == (1, 2, 3)
    assert bench.hears('103FFFF0#0004000500060000', 10.022) == []
    assert long.samples[-1].raws == (4, 5, 6)
    assert len(short.samples) == 2
    assert bench.exchange.frames_rejected == 0
    assert [session.statistics.rejected for session in bench.sessions] == [0, 0]


@pytest.mark.parametrize('text', TWINS)
def test_29_bit_twins_reach_nobody(text: str) -> None:
    bench = online()
    assert bench.at(10.02) == [LONG_NEUTRAL, SHORT_ASK]
    assert bench.hears(text, 10.021) == []
    assert bench.exchange.frames_rejected == 1
    long, short = bench.notes
    assert len(long.samples) == len(short.samples) == 1
    assert [event for notes in bench.notes for event in notes.events] == [StationFound()] * 2
    # the read is still open
    assert bench.hears(SHORT_ANSWER, 10.022) == []
    assert len(short.samples) == 2


@pytest.mark.parametrize('identifier', [0x7F0, 0x7F2, 0x3F0, 0x3F2, 0x000, 0x7FF])
def test_11_bit_neighbours_reach_nobody(identifier: int) -> None:
    bench = online()
    bench.at(10.02)
    bench.exchange.frame_received(Frame(identifier, bytes(8), False), 0.0)
    assert bench.exchange.frames_rejected == 1
    assert [session.statistics.rejected for session in bench.sessions] == [0, 0]


def test_11_bit_frames_of_the_drive_are_no_business_of_the_29_bit_drive() -> None:
    bench = online()
    bench.hears(SHORT_ANSWER, 10.015)
    assert bench.exchange.frames_rejected == 0
    assert [session.statistics.rejected for session in bench.sessions] == [0, 1]
    assert [type(event) for event in bench.notes[0].events] == [StationFound]
    assert [type(event) for event in bench.notes[1].events] == [StationFound, FrameRejected]


def test_a_second_master_is_told_at_the_drive_it_means() -> None:
    bench = online()
    bench.hears('3F1#0632006400000000', 10.015)
    assert [type(event) for event in bench.notes[1].events] == [StationFound, ForeignMasterSeen]
    assert [type(event) for event in bench.notes[0].events] == [StationFound]
    assert bench.exchange.frames_rejected == 0


def test_a_silent_11_bit_drive_does_not_hold_up_the_other() -> None:
    bench = online()
    for cycle in range(1, 100):
        now = 10.0 + 0.02 * cycle
        assert LONG_NEUTRAL in bench.at(now)
        bench.hears(LONG_ANSWER, now + 0.002)
        for step in range(1, 19):
            bench.at(now + 0.001 * step)
    assert bench.sessions[0].statistics.exchanges == 100
    assert bench.sessions[0].statistics.missed == 0
    assert not bench.sessions[1].online


# -- filters --------------------------------------------------------------------------------------


def test_filters_of_the_link_hold_both() -> None:
    bench = mixed()
    assert set(all_routes(bench)) == {
        Route(0x00200000, 0x0FE00000, True), Route(0x3F1, 0x7FF, False),
        Route(0x7F1, 0x7FF, False)}


@pytest.fixture
def ports() -> Iterator[tuple[can.BusABC, Port]]:
    """Return a plain end point of a bus, and one with the filters of both drives."""
    channel = f'mixed_{uuid.uuid4()}'
    with can.Bus(interface='virtual', channel=channel, ignore_config=True) as other:
        port = open_port(BusConfiguration('main', 'virtual', channel), REAL, all_routes(mixed()))
        yield other, port
        port.close()


def received(port: Port, condition: Callable[[list[str]], bool]) -> list[str]:
    found: list[str] = []
    deadline = time.monotonic() + 10.0
    while not condition(found) and time.monotonic() < deadline:
        heard = port.receive(0.05)
        if heard is not None:
            found.append(str(heard))
    return found


def test_filters_know_the_format(ports: tuple[can.BusABC, Port]) -> None:
    other, port = ports
    for identifier, is_extended in [
            (0x3F1, True), (0x7F1, True), (0x3F1, False), (0x7F2, False), (0x7F1, False),
            (0x103FFFF0, True), (0x105FFFF0, True), (0x200, False), (0x003FFFF0, True)]:
        other.send(can.Message(arbitration_id=identifier, is_extended_id=is_extended,
                               data=b'\x01'))
    assert received(port, lambda found: '003FFFF0#01' in found) == [
        '3F1#01', '7F1#01', '103FFFF0#01', '003FFFF0#01']


def test_frames_leave_in_their_format(ports: tuple[can.BusABC, Port]) -> None:
    other, port = ports
    port.send(Frame(0x3F1, bytes(8), False), 0.1)
    port.send(Frame(0x003FFFF0, bytes(8), True), 0.1)
    first, second = other.recv(10.0), other.recv(10.0)
    assert first is not None
    assert second is not None
    assert (first.arbitration_id, first.is_extended_id) == (0x3F1, False)
    assert (second.arbitration_id, second.is_extended_id) == (0x003FFFF0, True)
