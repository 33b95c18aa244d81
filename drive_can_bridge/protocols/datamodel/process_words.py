# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The process data words of one drive: which parameter travels in which slot, and how to pack them.

Words are 16 bit, high byte first, slot 0 in BYTE0 and BYTE1, as in all telegrams of
:mod:`~drive_can_bridge.protocols.datamodel.extended`; here with the sign of each parameter.
"""

from collections.abc import Sequence
import struct

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.errors import LocalProtocolError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.datamodel import extended
from drive_can_bridge.protocols.datamodel.extended import PADDING, PAYLOAD, SLOTS


class CyclicCodec:
    """
    The cyclic telegrams of one drive; the fast path of session and observer.

    :param request: parameters of the request, in slot order.
    :param response: of the response.
    :param control_slot: of a control word in the request, which is unsigned whatever its type.
    :param strict: do not take responses shorter than eight bytes.
    :raises LocalProtocolError: station out of range, or too many parameters.
    """

    def __init__(self, station: int, request: Sequence[Parameter],
                 response: Sequence[Parameter], *, control_slot: int | None = None,
                 strict: bool = False) -> None:
        for parameters in (request, response):
            if len(parameters) > SLOTS:
                raise LocalProtocolError(
                    f'{len(parameters)} words do not fit a frame: at most {SLOTS}')
        self.request_identifier = extended.cyclic_request_identifier(station)
        self.response_identifier = self.request_identifier | extended.DIR
        self._strict = strict
        self._response = response
        requested = _words_struct(request, unsigned=control_slot)
        self._pack, self._unpack_request = requested.pack, requested.unpack_from
        self._padding = PADDING[len(request)]
        self._unpack_response = _words_struct(response).unpack_from

    def encode_request(self, raws: Sequence[int]) -> Frame:
        """
        Encode a cyclic request.

        :param raws: of all parameters of the request.
        :raises LocalProtocolError: one of them does not fit its word.
        """
        try:
            return Frame(self.request_identifier, self._pack(*raws) + self._padding, True)
        except struct.error as error:
            raise LocalProtocolError(f'{list(raws)}: {error}') from None

    def decode_request(self, data: bytes) -> tuple[tuple[int, ...], str]:
        """
        Decode the payload of a cyclic request, which has eight bytes.

        :return: the raw integers; and what is wrong with it, '' for nothing.
        """
        if len(data) != PAYLOAD:
            return (), frame_sentences.length_differs(len(data), PAYLOAD)
        return self._unpack_request(data), ''

    def decode_response(self, data: bytes) -> tuple[tuple[int, ...], str]:
        """
        Decode the payload of a cyclic response.

        :return: the raw integers that it holds, as far as they are wanted; and what is wrong with
            it, '' where it holds them all and that will do.
        """
        if len(data) == PAYLOAD:
            return self._unpack_response(data), ''
        if self._strict:
            return (), frame_sentences.length_differs(len(data), PAYLOAD)
        needed = 2 * len(self._response)
        raws = _words_struct(self._response[:len(data) // 2]).unpack_from(data)
        return raws, ('' if len(data) >= needed else
                      frame_sentences.bytes_missing(len(data), needed))


def _words_struct(parameters: Sequence[Parameter], *, unsigned: int | None = None,
                  ) -> struct.Struct:
    """Return what packs process data."""
    return struct.Struct('>' + ''.join(
        'h' if parameter.type.signed and slot != unsigned else 'H'
        for slot, parameter in enumerate(parameters)))
