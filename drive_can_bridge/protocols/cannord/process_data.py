# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The process data frames of CANnord, both directions: bytes to words and back.

Sources: BU 0060, section 4.2.1 (page 49: lengths, the two additional values of SK 54xE), page 39
(every word is sent low byte first: control word 047Eh is ``7E 04``), page 44 (setpoints); the swap
from BU 0050 and BU 0080. That the additional frame has the identifiers of the main one and carries
neither control nor status word is inferred: there are no others, and 5 is a length of its own.

====== =================== =========================== ===========================
length bytes 0 and 1       2 and 3                     4 to 7
====== =================== =========================== ===========================
4      control/status word value 1                     none
8      control/status word value 1                     values 2 and 3; with
                                                       ``swap`` (SK 300E, 700E,
                                                       750E) values 3 and 2
5      value 4             value 5                     byte 4: dummy, sent as 00h
====== =================== =========================== ===========================

Values are setpoints on the way to the inverter and actual values on the way back. Here they are
unsigned words; 4000h is 100 % and C000h is -100 % of what the value means. The sample of an
exchange waits for the additional frame where there is one, and goes out without when it does not
come.
"""

from collections.abc import Sequence
import struct
from typing import NamedTuple

from drive_can_bridge.core import frame_sentences, sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import LocalProtocolError, RemoteProtocolError
from drive_can_bridge.core.events import ProcessDataReceived
from drive_can_bridge.core.messages import NOTHING
from drive_can_bridge.core.session import Session

#: values in the longest main frame
MAIN_VALUES = 3
#: values in the additional frame of SK 54xE
EXTRA_VALUES = 2
#: lengths of the frames in bytes
SHORT_LENGTH = 4
LONG_LENGTH = 8
EXTRA_LENGTH = 5

_SHORT = struct.Struct('<HH')
_LONG = struct.Struct('<HHHH')
_EXTRA = struct.Struct('<HHB')


class ProcessData(NamedTuple):
    """
    A main frame.

    :param word: control word, or status word.
    :param values: one or three words, in the order value 1, 2, 3.
    """

    word: int
    values: tuple[int, ...]


def main_length(values: int) -> int:
    """Return the length in bytes of the main frame that holds this many values (0 to 3)."""
    if not 0 <= values <= MAIN_VALUES:
        raise LocalProtocolError(f'{values} values do not fit a frame: at most {MAIN_VALUES}')
    return SHORT_LENGTH if values <= 1 else LONG_LENGTH


def encode_main(word: int, values: Sequence[int], *, length: int, swap: bool = False) -> bytes:
    """
    Encode control word and setpoints, or status word and actual values.

    :param values: at most as many as the length holds; missing ones are sent as 0.
    :param length: 4 or 8.
    :param swap: words 3 and 4 of the long frame change places.
    :raises LocalProtocolError: too many values, another length, or a word that is not 16 bits.
    """
    if length not in (SHORT_LENGTH, LONG_LENGTH):
        raise LocalProtocolError(f'{length} bytes: a main frame has {SHORT_LENGTH} or '
                                 f'{LONG_LENGTH}')
    places = length // 2 - 1
    if len(values) > places:
        raise LocalProtocolError(f'{len(values)} values do not fit {length} bytes')
    padded = [*values, *(0,) * (places - len(values))]
    if swap and length == LONG_LENGTH:
        padded[1], padded[2] = padded[2], padded[1]
    layout = _SHORT if length == SHORT_LENGTH else _LONG
    return _packed(layout, (word, *padded))


def decode_main(data: bytes, *, swap: bool = False) -> ProcessData:
    """
    Decode a main frame.

    :raises RemoteProtocolError: neither 4 nor 8 bytes.
    """
    if len(data) == SHORT_LENGTH:
        word, first = _SHORT.unpack(data)
        return ProcessData(word, (first,))
    if len(data) == LONG_LENGTH:
        word, first, second, third = _LONG.unpack(data)
        return ProcessData(word, (first, third, second) if swap else (first, second, third))
    raise RemoteProtocolError(
        frame_sentences.process_data_length(len(data), SHORT_LENGTH, LONG_LENGTH))


def encode_extra(values: Sequence[int]) -> bytes:
    """
    Encode values 4 and 5 of SK 54xE; a missing one is sent as 0, and so is the dummy byte.

    :raises LocalProtocolError: more than two values, or one that is not 16 bits.
    """
    if len(values) > EXTRA_VALUES:
        raise LocalProtocolError(f'{len(values)} values do not fit the additional frame: '
                                 f'at most {EXTRA_VALUES}')
    return _packed(_EXTRA, (*values, *(0,) * (EXTRA_VALUES - len(values)), 0))


def decode_extra(data: bytes) -> tuple[int, int]:
    """
    Decode values 4 and 5 of SK 54xE. The dummy byte may be anything.

    :raises RemoteProtocolError: not 5 bytes.
    """
    if len(data) != EXTRA_LENGTH:
        raise RemoteProtocolError(frame_sentences.extra_data_length(len(data), EXTRA_LENGTH))
    fourth, fifth, _ = _EXTRA.unpack(data)
    return fourth, fifth


def _packed(layout: struct.Struct, words: Sequence[int]) -> bytes:
    try:
        return layout.pack(*words)
    except struct.error:
        raise LocalProtocolError(f'{list(words)}: every word must be 0 to 65535') from None


def values_needed(drive: DriveConfiguration) -> int:
    """Return how many values travel: the longer of both lists decides."""
    return max(len(drive.cyclic_request), len(drive.cyclic_response))


class Samples:
    """
    The samples of one inverter.

    :ivar awaiting: the additional frame of this exchange is yet to come.
    :ivar warning: what does not arrive, and why; '' if nothing.
    """

    def __init__(self, session: Session) -> None:
        self.awaiting = False
        self.warning = NOTHING
        self._session = session
        response = session.configuration.cyclic_response
        self._main, self._extra = response[:MAIN_VALUES], response[MAIN_VALUES:]
        self._held: ProcessDataReceived | None = None   # until values 4 and 5 arrive
        self._last: tuple[int, ...] = ()

    def settle(self) -> None:
        """End an exchange: what has not come does not belong to it any more."""
        self.awaiting = False
        if self._held is not None:
            self.warning = sentences.extra_values_missing()
            self._publish(self._held)
            self._held = None

    def expect_nothing(self) -> int:
        """Forget the exchange under way; return how many additional frames may come of it."""
        awaiting, self.awaiting, self._held = self.awaiting, False, None
        return int(awaiting)

    def forget(self) -> None:
        """Record that the inverter is offline."""
        self._held = None
        self._last = ()
        self.warning = NOTHING

    def take(self, word: int, values: tuple[int, ...], received_at: float, *,
             asked: bool) -> bool:
        """
        Handle a main frame; return whether it has all the values that are wanted of it.

        :param asked: it answers the exchange under way.
        """
        raws = (word, *(parameter.raw_from_word(value)
                        for parameter, value in zip(self._main, values)))
        complete = len(values) >= len(self._main)
        if not complete:
            self._session.report.reject(
                sentences.short_process_data(len(values), len(self._main)))
        if self._held is not None:      # its values 4 and 5 would come after these
            self._publish(self._held)
            self._held = None
        sample = ProcessDataReceived(raws, received_at)
        if asked and complete and self.awaiting and self._extra:
            self._held = sample
        else:
            self._publish(sample)
        return complete

    def take_extra(self, data: bytes) -> None:
        """Handle the additional frame of the exchange under way."""
        self.awaiting = False
        held, self._held = self._held, None
        if held is not None:    # else: nobody wants them, or what they belong to did not come
            self.warning = NOTHING
            values = (parameter.raw_from_word(value)
                      for parameter, value in zip(self._extra, decode_extra(data)))
            self._publish(ProcessDataReceived((*held.raws, *values), held.received_at))

    def last(self, name: str) -> int | None:
        """Return the raw integer of a parameter that was received last."""
        for parameter, raw in zip(self._session.sample_parameters, self._last):
            if parameter.name == name:
                return raw
        return None

    def _publish(self, sample: ProcessDataReceived) -> None:
        self._last = (*sample.raws, *self._last[len(sample.raws):])
        self._session.interlock.measured(sample.raws)
        self._session.report.note(sample)
