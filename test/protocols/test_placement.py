# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Where parameters stand, and which of the writes that left are what a drive was told."""

from builders import ACTUAL, drive, KEY, LIMIT, parameter, SPEED
import pytest

from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.core.process_image import LastSent
from drive_can_bridge.protocols.access import OneByOne, SentWrites
from drive_can_bridge.protocols.canopen_pkw.addresses import Placement, Span
from drive_can_bridge.protocols.canopen_pkw.pkw import Address
from drive_can_bridge.protocols.datamodel.procedures import Numbers
from drive_can_bridge.protocols.polled_exchange import Chunk

WIDE = parameter('wide', 500, type=ParameterType.INT32)
NARROW = parameter('narrow', 502)


@pytest.mark.parametrize(('order', 'raw'), [('high_first', 900), ('low_first', 900 << 16)])
def test_values_are_put_together_from_words_by_address(order: str, raw: int) -> None:
    placement = Placement('register', order)
    words = {Address(500): 0, Address(501): 900, Address(455): 0x2083}
    span = placement.span(WIDE)
    assert placement.raw_among(WIDE, span, words) == raw
    assert placement.raw_among(WIDE, span, {Address(500): 0}) is None
    assert placement.raw_among(NARROW, placement.span(NARROW), words) is None


def test_numbers_on_the_wire_are_moved() -> None:
    numbers = Numbers(drive('datamodel_standard', parameter_offset=-1))
    assert numbers.span(ACTUAL) == Chunk(208, 1)
    assert numbers.raw_among(ACTUAL, Chunk(208), {208: 0xFC18, 209: 7}) == -1000
    assert numbers.numbers((SPEED, LIMIT)) == (49, 50)
    assert (numbers.write(SPEED, -1).eeprom, numbers.write(KEY, 1).eeprom) == (False, True)


def test_what_is_read_one_by_one_is_read_once() -> None:
    alone = OneByOne()
    assert alone.plan([WIDE, NARROW, WIDE]) == [WIDE, NARROW]
    assert alone.raw_among(WIDE, WIDE, {WIDE: 0xFFFF_FFFE}) == -2


def told(*parameters: Parameter) -> tuple[LastSent, SentWrites[Span]]:
    sent = LastSent(parameters)
    return sent, SentWrites(sent, Placement('register', 'high_first'))


def test_what_a_drive_was_told_is_known_by_what_was_written_where() -> None:
    sent, writes = told(WIDE, NARROW)
    writes.note(Span(Address(502)), (7,))
    assert (sent.raws, sent.times) == ((None, 7), [0, 1])
    writes.note(Span(Address(500), 2), (0xFFFF, 0xFFFE))
    assert (sent.raws, sent.times) == ((-2, 7), [1, 1])


def test_other_writes_are_none_of_them() -> None:
    sent, writes = told(WIDE, NARROW)
    writes.note(Span(Address(500)), (1,))
    writes.note(Span(Address(503)), (1,))
    writes.note(Span(Address(0x2004, 0x10)), (1,))
    assert (sent.raws, sent.times) == ((None, None), [0, 0])
