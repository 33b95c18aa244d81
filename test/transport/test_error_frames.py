# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Error frames in words.

The numbers are those of linux/can/error.h, written here by hand; the first group was sent by real
kernel drivers (slcan of Linux 6.1, told by its adapter what is wrong).
"""

from hypothesis import given, strategies as st
import pytest

from drive_can_bridge.transport.error_frames import decode_error_frame

ALONE = ('no other node acknowledges: check that one is switched on, cable, termination and bit '
         'rate')
DISTURBED = 'check cable, shield, termination and bit rate'
WIRES = 'check the wires between transceiver and bus'
OVERFLOW = 'frames were lost: less traffic, or a faster machine'

FROM_DRIVERS = [
    # "sp130128": error-passive, receive counter 130, transmit counter 128
    (0x204, '0010000000008082',
     ('error-passive (receiving), error counters transmit 128, receive 130', 'error-passive',
      DISTURBED)),
    # "e2af": no acknowledgement, form error
    (0x0A8, '0000021900000000',
     ('no acknowledgement, form error no acknowledgement', None, ALONE)),
    # "e3scB": stuff, CRC, recessive bit
    (0x088, '0000150800000000',
     ('bit error stuff error bit error (recessive bit not sent) CRC error', None, DISTURBED)),
    # "e1o": receive overflow
    (0x08C, '0001000000000000',
     ('receive overflow of the controller, protocol violation', None, OVERFLOW)),
    # "sa001001": error-active again
    (0x204, '0040000000000101',
     ('error-active again, error counters transmit 1, receive 1', '', '')),
    # "sb000256": bus-off
    (0x040, '0000000000000000', ('bus-off', 'bus-off', DISTURBED)),
]
BY_HAND = [
    (0x001, '', ('transmit time-out of the driver', None, ALONE)),
    (0x002, '', ('lost arbitration', None, '')),
    (0x002, '0B', ('lost arbitration in bit 11', None, '')),
    (0x004, '0001', ('receive overflow of the controller', None, OVERFLOW)),
    (0x004, '0002', ('transmit overflow of the controller', None, ALONE)),
    (0x004, '0004', ('error-warning (receiving)', 'error-warning', DISTURBED)),
    (0x004, '0008', ('error-warning (sending)', 'error-warning', ALONE)),
    (0x004, '000C', ('error-warning (sending and receiving)', 'error-warning', DISTURBED)),
    (0x004, '0010', ('error-passive (receiving)', 'error-passive', DISTURBED)),
    (0x004, '0020', ('error-passive (sending)', 'error-passive', ALONE)),
    (0x004, '0030', ('error-passive (sending and receiving)', 'error-passive', DISTURBED)),
    # passive on one side, warning on the other: the worse counts
    (0x004, '0024', ('error-passive (sending)', 'error-passive', ALONE)),
    (0x004, '0040', ('error-active again', '', '')),
    (0x004, '0000', ('controller problem', None, '')),
    (0x008, '000001', ('bit error', None, DISTURBED)),
    (0x008, '000002', ('form error', None, DISTURBED)),
    (0x008, '000004', ('stuff error', None, DISTURBED)),
    (0x008, '000008', ('bit error (dominant bit not sent)', None, DISTURBED)),
    (0x008, '000010', ('bit error (recessive bit not sent)', None, DISTURBED)),
    (0x008, '000020', ('overload', None, DISTURBED)),
    (0x008, '00008008', ('CRC error while sending', None, DISTURBED)),
    (0x008, '00000018', ('CRC error', None, DISTURBED)),
    (0x008, '0000810A', ('bit error in the data while sending', None, DISTURBED)),
    (0x008, '00000019', ('no acknowledgement', None, ALONE)),
    (0x008, '00000000', ('protocol violation', None, DISTURBED)),
    (0x010, '0000000004', ('CAN_H not connected', None, WIRES)),
    (0x010, '0000000074', ('CAN_H not connected and CAN_L shorted to ground', None, WIRES)),
    (0x010, '0000000046', ('CAN_H shorted to supply and CAN_L not connected', None, WIRES)),
    (0x010, '0000000057', ('CAN_H shorted to ground and CAN_L shorted to battery', None, WIRES)),
    (0x010, '0000000065', ('CAN_H shorted to battery and CAN_L shorted to supply', None, WIRES)),
    (0x010, '0000000080', ('CAN_L shorted to CAN_H', None, WIRES)),
    (0x010, '', ('transceiver fault', None, WIRES)),
    (0x020, '', ('no acknowledgement', None, ALONE)),
    (0x080, '', ('bus error', None, DISTURBED)),
    # SJA1000 with berr-reporting: a bus error that says where
    (0x088, '00008019', ('no acknowledgement while sending', None, ALONE)),
    (0x0C8, '00008019', ('bus-off, no acknowledgement while sending', 'bus-off', DISTURBED)),
    (0x100, '', ('controller restarted', '', '')),
    (0x044, '0030', ('bus-off, error-passive (sending and receiving)', 'bus-off', DISTURBED)),
    (0x200, '0000000000008700', ('error counters transmit 135, receive 0', None, '')),
    (0x000, '', ('error without details', None, '')),
]


@pytest.mark.parametrize(('classes', 'data', 'expected'), FROM_DRIVERS + BY_HAND,
                         ids=lambda value: f'{value:03X}' if isinstance(value, int) else None)
def test_in_words(classes: int, data: str, expected: tuple[str, str | None, str]) -> None:
    assert tuple(decode_error_frame(classes, bytes.fromhex(data))) == expected


@given(st.integers(0, 0x1FFFFFFF), st.binary(max_size=64))
def test_anything(classes: int, data: bytes) -> None:
    error = decode_error_frame(classes, data)
    assert error.text
    assert error.state in (None, '', 'error-warning', 'error-passive', 'bus-off')
    assert (error.state == 'bus-off') == bool(classes & 0x40)
