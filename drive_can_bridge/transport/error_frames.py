# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Error frames of SocketCAN in words.

An error frame is no frame of the bus: the driver of a CAN controller makes it to report what went
wrong. Its identifier holds the classes of errors, its eight data bytes the details
(linux/can/error.h):

==== =============================================================
byte meaning
==== =============================================================
0    bit in which arbitration was lost (0: not known)
1    state and problems of the controller
2    kind of protocol violation
3    where in the frame it happened
4    state of the transceiver's wires
5    of the driver's own
6    transmit error counter
7    receive error counter
==== =============================================================

Bytes count only when the class that they belong to is set.
"""

from typing import NamedTuple

from drive_can_bridge.core import bus_sentences

TX_TIMEOUT = 0x001
LOST_ARBITRATION = 0x002
CONTROLLER = 0x004
PROTOCOL = 0x008
TRANSCEIVER = 0x010
NO_ACKNOWLEDGEMENT = 0x020
BUS_OFF_CLASS = 0x040
BUS_ERROR = 0x080
RESTARTED = 0x100
COUNTERS = 0x200

#: states of a controller; '' is error-active, the state in which it should be
ERROR_ACTIVE = ''
ERROR_WARNING = 'error-warning'
ERROR_PASSIVE = 'error-passive'
BUS_OFF = 'bus-off'

_RECEIVE_OVERFLOW = 0x01
_TRANSMIT_OVERFLOW = 0x02
_RECEIVE_WARNING = 0x04
_TRANSMIT_WARNING = 0x08
_RECEIVE_PASSIVE = 0x10
_TRANSMIT_PASSIVE = 0x20
_ACTIVE_AGAIN = 0x40

_VIOLATIONS = (
    (0x01, 'bit error'), (0x02, 'form error'), (0x04, 'stuff error'),
    (0x08, 'bit error (dominant bit not sent)'), (0x10, 'bit error (recessive bit not sent)'),
    (0x20, 'overload'),
)
_VIOLATION_SENDING = 0x80

_ACKNOWLEDGEMENT_SLOT = 0x19
_CRC = (0x08, 0x18)
_PLACES = {
    0x02: 'identifier', 0x03: 'start of frame', 0x04: 'SRTR bit', 0x05: 'IDE bit',
    0x06: 'identifier', 0x07: 'identifier', 0x08: 'CRC', 0x09: 'reserved bit', 0x0A: 'data',
    0x0B: 'length', 0x0C: 'RTR bit', 0x0D: 'reserved bit', 0x0E: 'identifier',
    0x0F: 'identifier', 0x12: 'intermission', 0x18: 'CRC delimiter',
    0x19: 'acknowledgement slot', 0x1A: 'end of frame', 0x1B: 'acknowledgement delimiter',
}

_WIRES = {
    0x04: 'CAN_H not connected', 0x05: 'CAN_H shorted to battery', 0x06: 'CAN_H shorted to supply',
    0x07: 'CAN_H shorted to ground', 0x40: 'CAN_L not connected',
    0x50: 'CAN_L shorted to battery', 0x60: 'CAN_L shorted to supply',
    0x70: 'CAN_L shorted to ground', 0x80: 'CAN_L shorted to CAN_H',
}

#: advice where no other node acknowledges
ADVICE_ALONE = bus_sentences.nobody_acknowledges()
ADVICE_DISTURBED = bus_sentences.bus_is_disturbed()
ADVICE_OVERFLOW = bus_sentences.frames_were_lost()


class BusError(NamedTuple):
    """
    The meaning of an error frame.

    :param text: all of it in words.
    :param state: of the controller from now on; None: not in the frame.
    :param advice: what to look at; '' when there is nothing to do.
    """

    text: str
    state: str | None
    advice: str


def decode_error_frame(classes: int, data: bytes) -> BusError:
    """
    Return an error frame in words. Never raises.

    :param classes: the error classes, the identifier of the frame.
    :param data: its data bytes; missing ones count as 0.
    """
    details = bytes(data[:8]).ljust(8, b'\0')
    texts: list[str] = []
    state: str | None = None
    advice = ''
    if classes & BUS_OFF_CLASS:
        texts.append('bus-off')
        state, advice = BUS_OFF, ADVICE_DISTURBED
    if classes & CONTROLLER:
        said, new_state, new_advice = _controller(details[1])
        texts += said
        state = new_state if state is None else state
        advice = advice or new_advice
    if classes & NO_ACKNOWLEDGEMENT:
        texts.append('no acknowledgement')
        advice = advice if state == BUS_OFF else ADVICE_ALONE
    if classes & PROTOCOL:
        texts.append(_violation(details[2], details[3]))
        if details[3] == _ACKNOWLEDGEMENT_SLOT and state != BUS_OFF:
            advice = ADVICE_ALONE
        advice = advice or ADVICE_DISTURBED
    if classes & TRANSCEIVER:
        texts.append(_transceiver(details[4]))
        advice = advice or bus_sentences.look_at_wires()
    if classes & LOST_ARBITRATION:
        texts.append(f'lost arbitration in bit {details[0]}' if details[0] else 'lost arbitration')
    if classes & TX_TIMEOUT:
        texts.append('transmit time-out of the driver')
        advice = advice or ADVICE_ALONE
    if classes & BUS_ERROR and not classes & (PROTOCOL | NO_ACKNOWLEDGEMENT):
        texts.append('bus error')
        advice = advice or ADVICE_DISTURBED
    if classes & RESTARTED:
        texts.append('controller restarted')
        state = ERROR_ACTIVE if state is None else state
    if classes & COUNTERS:
        texts.append(f'error counters transmit {details[6]}, receive {details[7]}')
    return BusError(', '.join(texts) or 'error without details', state, advice)


def protocol_error(kind: int, place: int, *, sending: bool,
                   counters: tuple[int, int]) -> tuple[int, bytes]:
    """
    Return classes and data of an error frame for a violated protocol.

    :param kind: 1 bit error, 2 form error, 4 stuff error; anything else is none of them.
    :param place: where in the frame, as the SJA1000 numbers it (and linux/can/error.h).
    :param counters: of errors, transmit and receive.
    """
    known = kind if kind in (1, 2, 4) else 0
    return PROTOCOL | BUS_ERROR | COUNTERS, bytes(
        (0, 0, known | (_VIOLATION_SENDING if sending else 0), place, 0, 0, *counters))


def _controller(byte: int) -> tuple[list[str], str | None, str]:
    texts = []
    state: str | None = None
    advice = ''
    if byte & (_RECEIVE_PASSIVE | _TRANSMIT_PASSIVE):
        state = ERROR_PASSIVE
    elif byte & (_RECEIVE_WARNING | _TRANSMIT_WARNING):
        state = ERROR_WARNING
    elif byte & _ACTIVE_AGAIN:
        state = ERROR_ACTIVE
        texts.append('error-active again')
    if state:
        sending = byte & (_TRANSMIT_PASSIVE if state == ERROR_PASSIVE else _TRANSMIT_WARNING)
        receiving = byte & (_RECEIVE_PASSIVE if state == ERROR_PASSIVE else _RECEIVE_WARNING)
        sides = ' and '.join(['sending'] * bool(sending) + ['receiving'] * bool(receiving))
        texts.append(f'{state} ({sides})')
        # a sender without another node to acknowledge counts errors of sending only
        advice = ADVICE_ALONE if sending and not receiving else ADVICE_DISTURBED
    if byte & _RECEIVE_OVERFLOW:
        texts.append('receive overflow of the controller')
        advice = advice or ADVICE_OVERFLOW
    if byte & _TRANSMIT_OVERFLOW:
        texts.append('transmit overflow of the controller')
        advice = advice or ADVICE_ALONE
    return texts or ['controller problem'], state, advice


def _violation(kind: int, place: int) -> str:
    texts = [text for bit, text in _VIOLATIONS if kind & bit]
    if place == _ACKNOWLEDGEMENT_SLOT:
        texts.append('no acknowledgement')
    elif place in _CRC:
        texts.append('CRC error')
    elif place in _PLACES:
        texts.append(f'in the {_PLACES[place]}')
    if kind & _VIOLATION_SENDING:
        texts.append('while sending')
    return ' '.join(texts) or 'protocol violation'


def _transceiver(byte: int) -> str:
    # one half for each wire; 80h is a fault of both by itself
    texts = [_WIRES[part] for part in (byte & 0x0F, byte & 0xF0) if part in _WIRES]
    return ' and '.join(texts) or 'transceiver fault'
