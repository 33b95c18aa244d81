# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Answers of other sizes: four bytes whatever the type is, frames as short as their content."""

from typing import Any

from builders import parameter, read, write
import pytest
from saying import says
from servo_builders import Axis, TABLE
from stacks import FourBytes, ShortFrames
from test_cia402_parameters import BYTE, FLAG, METHOD, OBJECTS, outcomes, WORD

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.parameters import ParameterType
from drive_can_bridge.protocols.canopen import sdo
from drive_can_bridge.protocols.telegrams import Direction

UNSIGNED = parameter('unsigned', None, index=0x2007, subindex=0, type=ParameterType.UINT16)
LISTED = (*TABLE, METHOD, BYTE, FLAG, WORD, UNSIGNED)
MINUS_300 = (-300).to_bytes(2, 'little', signed=True)
HERE = {**OBJECTS, (0x2003, 0): MINUS_300, (0x2007, 0): b'\xD4\xFE'}


class Signed(FourBytes):
    """Fills up by the sign."""

    signed = frozenset((0x2003, 0x6098, 0x605A))


@pytest.mark.parametrize('make', [FourBytes, Signed])
class TestFourBytes:

    def test_it_is_driven_and_read(self, make: Any) -> None:
        axis = Axis(make=make, objects=HERE, table=LISTED).enabled()
        assert outcomes(axis, read(METHOD, BYTE, FLAG, WORD, UNSIGNED)) == [
            -1, 0x80, 1, -300, 0xFED4]
        assert outcomes(axis, write((WORD, -301))) == ['written']

    def test_without_a_set_up_its_status_word_is_asked_first(self, make: Any) -> None:
        axis = Axis(make=make, objects=HERE, table=LISTED)
        axis.session.serve()
        axis.deliver(axis.talk.bus_up(axis.now))
        assert outcomes(axis, read(WORD)) == [-300]
        assert axis.take() == ['605#4003200000000000', '605#4041600000000000']
        assert outcomes(axis, read(UNSIGNED)) == [0xFED4]
        assert axis.take() == ['605#4007200000000000']

    def test_options_of_the_set_up_have_their_sign(self, make: Any) -> None:
        axis = Axis(make=make, objects={(0x605A, 0): b'\xFE\xFF'}).online()
        assert '(605Ah = -2)' in axis.session.facts()['stops_by']

    def test_it_says_why_it_is_not_enabled(self, make: Any) -> None:
        axis = Axis(make=make).online()
        axis.drive.objects[0x603F, 0] = b'\x30\x81'
        axis.drive.powered = False
        axis.live(0.1)
        axis.drive.becomes(axis.drive.OFF)
        (_, success, why), = axis.asks(ControlAction.ENABLE, 2.5)
        assert not success and '8130h' in why


def test_the_rest_is_00_or_the_sign() -> None:
    axis = Axis(make=FourBytes, objects=HERE, table=LISTED).online()
    for rest, taken in (('0000', True), ('FFFF', True), ('0100', False), ('00FF', False)):
        axis.drive.instead = {'40032000': '43032000D4FE' + rest}
        (found,) = outcomes(axis, read(WORD))
        assert (found == -300) is taken, rest
    axis.drive.instead = {'40072000': '43072000D4FEFFFF'}   # which has no sign
    assert outcomes(axis, read(UNSIGNED)) == [says('other_length', length=4, listed='uint16')]


def test_of_others_it_is_a_wrong_type_in_the_profile() -> None:
    axis = Axis(objects=HERE, table=LISTED).online()
    axis.drive.instead = {'40032000': '43032000D4FEFFFF'}
    assert outcomes(axis, read(WORD)) == [says('other_length', length=4, listed='int16')]


def test_short_frames() -> None:
    axis = Axis(make=ShortFrames, objects=HERE, table=LISTED).enabled()
    assert outcomes(axis, read(METHOD, BYTE, FLAG, WORD)) == [-1, 0x80, 1, -300]
    assert outcomes(axis, write((WORD, 5))) == ['written']
    assert axis.session.statistics.rejected == 0


@pytest.mark.parametrize(('answer', 'data'), [
    ('4B4160005002', '5002'), ('4F60600009', '09'), ('43641000AABBCCDD', 'AABBCCDD'),
    ('4B41600050020000', '5002'), ('60406000', ''), ('0B7365', '7365'), ('1D73', '73')])
def test_what_a_head_promises_is_enough(answer: str, data: str) -> None:
    assert sdo.decode(Direction.RESPONSE, bytes.fromhex(answer)).data == bytes.fromhex(data)


@pytest.mark.parametrize('answer', [
    '', '4B41600050', '4F606000', '42416000500200', '43646000AABBCC', '604060', '804160000000',
    '4108100009', '0B73', '0053657276', '4B416000500200000000'])
def test_what_is_shorter_is_malformed(answer: str) -> None:
    with pytest.raises(RemoteProtocolError):
        sdo.decode(Direction.RESPONSE, bytes.fromhex(answer))
