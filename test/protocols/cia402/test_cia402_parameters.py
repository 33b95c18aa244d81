# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Parameters by SDO: every width, refusals in words, what is longer than four bytes."""

from typing import Any

from builders import parameter, read, RO, text_of, WO, write
import pytest
from saying import says
from servo_builders import Axis, TABLE

from drive_can_bridge.core.directory import ParameterDirectory
from drive_can_bridge.core.events import ForeignMasterSeen, RequestCompleted
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.protocols.families import FAMILIES

NAME = parameter('device_name', None, index=0x1008, type=ParameterType.UINT32, access=RO)
METHOD = parameter('homing_method', None, index=0x6098, subindex=0, type=ParameterType.INT8)
BYTE = parameter('byte', None, index=0x2001, subindex=1, type=ParameterType.UINT8)
FLAG = parameter('flag', None, index=0x2002, subindex=0, type=ParameterType.BOOL)
WORD = parameter('word', None, index=0x2003, subindex=0, type=ParameterType.INT16)
LONG = parameter('long', None, index=0x2004, subindex=0, type=ParameterType.UINT32)
ORDER = parameter('order', None, index=0x2005, subindex=0, type=ParameterType.UINT16, access=WO)
STORE = parameter('store_parameters', None, index=0x1010, subindex=1, type=ParameterType.UINT32,
                  access=WO)
LISTED = (*TABLE, NAME, METHOD, BYTE, FLAG, WORD, LONG, ORDER, STORE)
OBJECTS = {(0x6098, 0): b'\xFF', (0x2001, 1): b'\x80', (0x2002, 0): b'\1',
           (0x2003, 0): b'\xFE\xFF',
           (0x2004, 0): b'\1\2\3\x84', (0x2005, 0): b'\0\0', (0x2006, 0): b'\x81'}


@pytest.fixture(name='axis')
def _axis() -> Axis:
    return Axis(objects=OBJECTS, table=LISTED).online()


def outcomes(axis: Axis, request: Any) -> list[object]:
    axis.deliver(axis.talk.submits(request, axis.now))
    axis.live(2.0)
    completed, = axis.talk.events(RequestCompleted)
    return [text_of(outcome) for outcome in completed.outcomes]


def raw(name: str, axis: Axis) -> Parameter:
    drive = axis.session.configuration
    found = ParameterDirectory(drive.profile.parameters, lambda text: FAMILIES[
        'cia402'].raw_parameter(drive, text)).find(name)
    assert found is not None
    return found


def test_every_width_is_read_by_its_type(axis: Axis) -> None:
    assert outcomes(axis, read(METHOD, BYTE, FLAG, WORD, LONG)) == [-1, 0x80, 1, -2, 0x84030201]
    assert [text for text in axis.take() if text[:10] in ('605#409860', '605#400120')] == [
        '605#4098600000000000', '605#4001200100000000']


def test_every_width_is_written(axis: Axis) -> None:
    assert outcomes(axis, write((METHOD, -2), (BYTE, 7), (FLAG, 0), (WORD, -3), (LONG, 9))) == [
        'written'] * 5
    assert [text for text in axis.take() if text.startswith('605#2')] == [
        '605#2F986000FE000000', '605#2F01200107000000', '605#2F02200000000000',
        '605#2B032000FDFF0000', '605#2304200009000000']


def test_raw_names_take_the_width_that_the_device_answers(axis: Axis) -> None:
    for name, value in (('x2006.0', 0x81), ('x2003.00', 0xFFFE), ('x2004.00', 0x84030201)):
        assert outcomes(axis, read(raw(name, axis))) == [value], name
    axis.take()
    assert outcomes(axis, write((raw('x2006.0', axis), -1))) == ['written']
    assert '605#2F062000FF000000' in axis.take()
    assert outcomes(axis, write((raw('x2006.0', axis), 300))) == [
        says('not_in_bits', value=300, bits=8, low=-128, high=255)]


def test_refusals_in_words(axis: Axis) -> None:
    axis.drive.fixed = {(0x2003, 0): 0x06090031}
    assert outcomes(axis, write((WORD, 5))) == [
        says('refused_by_drive', number=0x06090031)]
    del axis.drive.objects[0x2001, 1]
    assert outcomes(axis, read(BYTE)) == [
        says('refused_by_drive', number=0x06020000)]


def test_another_length_than_the_profile_says(axis: Axis) -> None:
    axis.drive.objects[0x2003, 0] = b'\5'
    assert outcomes(axis, read(WORD)) == [
        says('other_length', length=1, listed='int16')]


def test_what_can_only_be_written_has_to_be_listed(axis: Axis) -> None:
    axis.drive.instead = {'40072000': '8007200001000106'}
    (why,) = outcomes(axis, write((raw('x2007.0', axis), 1)))
    assert 'nobody knows' in str(why)
    assert not any(text.startswith('605#2B0720') for text in axis.take())


def test_texts_are_no_numbers(axis: Axis) -> None:
    """A device name in segments, as CiA 301 sends them."""
    axis.drive.instead = {
        '4008100000000000': '4108100009000000', '6000000000000000': '0053657276696365',
        '7000000000000000': '1D64730000000000'}
    assert outcomes(axis, read(NAME)) == [says('too_long', length=8)]
    sent = axis.take()
    at = sent.index('605#4008100000000000')
    assert [text for text in sent[at:] if text.startswith('605#')][:3] == [
        '605#4008100000000000', '605#6000000000000000', '605#7000000000000000']


def test_what_does_not_end_is_broken_off(axis: Axis) -> None:
    """Which is no refusal of the drive."""
    axis.drive.instead = {
        '4008100000000000': '4108100000100000', '6000000000000000': '0053657276696365',
        '7000000000000000': '1053657276696365'}
    assert outcomes(axis, read(NAME)) == [says('too_long', length=37 * 7)]
    assert '605#8008100005000405' in axis.take()


def test_what_is_longer_than_four_bytes_is_not_written(axis: Axis) -> None:
    """Nothing of a profile is longer, so that no download needs segments."""
    assert max(kind.bits for kind in ParameterType) == 32
    axis.drive.instead = {
        '4008200000000000': '4108200008000000', '6000000000000000': '0053657276696365',
        '7000000000000000': '1D73000000000000'}
    assert outcomes(axis, write((raw('x2008.0', axis), 1))) == [
        says('too_long', length=8)]
    assert not [text for text in axis.take() if text.startswith('605#2')]


def test_a_drive_that_gives_up_in_the_middle_of_its_segments(axis: Axis) -> None:
    axis.drive.instead = {'4008100000000000': '4108100009000000'}
    takes = axis.drive.takes
    axis.drive.takes = lambda sent: [] if sent.data[:1] == b'\x60' and (   # type: ignore
        sent.identifier == 0x605) else takes(sent)
    (why,) = outcomes(axis, read(NAME))
    assert 'no answer' in str(why)
    assert '605#8008100000000405' in axis.take()


def test_an_answer_to_no_segment_is_rejected_in_the_middle_of_them(axis: Axis) -> None:
    """That of a download in segments; a read before was given up, and may be answered late."""
    takes = axis.drive.takes
    axis.drive.takes = lambda sent: [] if (     # type: ignore[method-assign]
        sent.identifier == 0x605) else takes(sent)
    axis.deliver(axis.talk.submits(read(LONG, NAME), axis.now))
    axis.live(0.35)
    axis.says('585#4108100009000000')
    axis.says('585#2000000000000000')
    assert axis.session.statistics.rejected == 1
    axis.says('585#0053657276696365')
    axis.says('585#1D64000000000000')
    completed, = axis.talk.events(RequestCompleted)
    assert text_of(completed.outcomes[1]) == says('too_long', length=8)


def test_together_or_not_at_all(axis: Axis) -> None:
    fits = 'an SDO carries one object'
    assert outcomes(axis, write((BYTE, 1), (WORD, 1), atomic=True)) == [
        says('not_in_one_frame', fits=fits)] * 2


def test_parameters_of_a_drive_that_differs(axis: Axis) -> None:
    axis = Axis(objects={**OBJECTS, (0x1019, 0): b'\5'}, table=LISTED).start()
    assert outcomes(axis, read(BYTE)) == [0x80]


def test_a_raw_name_of_what_is_listed_has_the_width_that_is_listed(axis: Axis) -> None:
    """What ``drive_can write`` says of how to store: a write-only object by its raw name."""
    axis.drive.instead = {'40052000': '8005200001000106'}
    assert outcomes(axis, write((raw('x2005.0', axis), 7))) == ['written']
    assert '605#2B05200007000000' in axis.take()
    assert outcomes(axis, write((raw('x2005.0', axis), 1 << 16))) == [
        says('not_in_bits', value=1 << 16, bits=16, low=-1 << 15, high=(1 << 16) - 1)]


def test_an_entry_of_another_protocol_is_no_object() -> None:
    """A profile for several may have entries without an index."""
    numbered = parameter('numbered', 50)
    axis = Axis(objects=OBJECTS, table=(*LISTED, numbered)).online()
    axis.take()
    assert outcomes(axis, read(numbered)) == outcomes(axis, write((numbered, 7))) == [
        says('no_object')]
    assert not [text for text in axis.take() if text.startswith('605#') and '000000' in text[:12]]


@pytest.mark.parametrize(('frame', 'code', 'facts'), [
    # a monitor that polls, segments included
    ('605#4041600000000000', 'other_master_reads', {'node': 5}),
    ('605#6000000000000000', 'other_master_reads', {'node': 5}),
    ('605#2F60600009000000', 'other_master_asks_node', {'node': 5, 'what': 'SDO requests'}),
    ('605#2B171000F4010000', 'other_master_asks_node', {'node': 5, 'what': 'SDO requests'}),
    ('605#C641600000000000', 'other_master_asks_node', {'node': 5, 'what': 'SDO requests'}),
    ('605#40', 'other_master_asks_node', {'node': 5, 'what': 'SDO requests'}),
    ('605#2B17100000000000', 'heartbeats_ended', {'node': 5}),
    ('205#0F0000000000', 'other_master_asks_node', {'node': 5, 'what': 'process data'}),
    # the start of many masters
    ('000#8200', 'other_master_resets',
     {'command': 'reset communication', 'whom': 'all nodes'}),
    ('000#8105', 'other_master_resets', {'command': 'reset node', 'whom': 'node 5'}),
    ('000#0100', 'other_master_nmt', {'command': 'start', 'whom': 'all nodes'}),
    ('000#0205', 'other_master_nmt', {'command': 'stop', 'whom': 'node 5'}),
    ('000#8000', 'other_master_nmt', {'command': 'enter pre-operational', 'whom': 'all nodes'}),
])
def test_what_another_master_sends_is_named(frame: str, code: str,
                                            facts: dict[str, Any]) -> None:
    axis = Axis().online()
    axis.talk.events()
    axis.says(frame)
    event, = axis.talk.events(ForeignMasterSeen)
    assert event.text == says(code, frame=frame, **facts)


@pytest.mark.parametrize('frame', ['000#8206', '000#8100FF', '000#', '000#0300', '00000000#8200'])
def test_nmt_that_is_not_about_this_node(frame: str) -> None:
    axis = Axis().online()
    axis.talk.events()
    axis.says(frame)
    assert axis.talk.events(ForeignMasterSeen) == []


@pytest.mark.parametrize(('after', 'outcome'), [
    (0.3, 'written'), (4.9, 'written'), (5.1, says('no_answer', timeout=5.0, attempts=1))])
def test_what_stores_is_told_once_and_waited_for(axis: Axis, after: float, outcome: str) -> None:
    """Others have their turn when it has ended: a node does one transfer at a time."""
    order, takes = '605#2310100173617665', axis.drive.takes
    axis.drive.takes = lambda sent: [] if (     # type: ignore[method-assign]
        str(sent) == order) else takes(sent)
    axis.deliver(axis.talk.submits(write((STORE, 0x65766173)), axis.now))
    axis.deliver(axis.talk.submits(read(BYTE), axis.now))
    axis.live(after)
    axis.says('585#6010100100000000')
    axis.live(0.5)
    stored, other = axis.talk.events(RequestCompleted)
    assert [text_of(each) for each in (*stored.outcomes, *other.outcomes)] == [outcome, 0x80]
    assert axis.take().count(order) == 1


def test_a_stop_does_not_wait_for_what_stores() -> None:
    axis = Axis(table=LISTED).enabled()
    takes = axis.drive.takes
    axis.drive.takes = lambda sent: [] if (     # type: ignore[method-assign]
        str(sent) == '605#2310100173617665') else takes(sent)
    axis.deliver(axis.talk.submits(write((STORE, 0x65766173)), axis.now))
    axis.live(0.1)
    axis.ends(1.0)


@pytest.mark.parametrize(('request_', 'frame', 'times'), [
    (write((WORD, 3)), '605#2B03200003000000', 1), (read(WORD), '605#4003200000000000', 4)])
def test_what_makes_room_for_a_stop_is_written_once(
        axis: Axis, request_: Any, frame: str, times: int) -> None:
    takes = axis.drive.takes
    axis.drive.takes = lambda sent: (    # type: ignore[method-assign]
        [] if str(sent).startswith(frame) else takes(sent))
    axis.deliver(axis.talk.submits(request_, axis.now))
    axis.session._channel.make_room(axis.now)
    axis.live(2.0)
    assert axis.take().count(frame) == times
    assert len(axis.talk.events(RequestCompleted)) == 1
