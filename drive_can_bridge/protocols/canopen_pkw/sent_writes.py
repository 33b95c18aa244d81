# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Which of the writes that left are setpoints and control words: what the drive was told last."""

from drive_can_bridge.core.last_sent import LastSent
from drive_can_bridge.core.outbox import Left
from drive_can_bridge.protocols.canopen_pkw.addresses import Placement, Span
from drive_can_bridge.protocols.canopen_pkw.pkw import Message


class SentWrites:
    """
    Keep what a drive was told last.

    :param sent: where that is kept.
    """

    def __init__(self, sent: LastSent, placement: Placement) -> None:
        self._sent = sent
        self._placement = placement
        self._places = {placement.span(parameter): place
                        for place, parameter in enumerate(sent.parameters)}

    def noting(self, message: Message, left: Left) -> Left:
        """Take note of a request when it leaves, before ``left`` is told what became of it."""
        meaning = message.meaning
        place = None if meaning is None or not meaning.writes else (
            self._places.get(Span(message.address, meaning.count)))
        if place is None:
            return left     # nothing that the drive is told by us
        raw = self._placement.raw(self._sent.parameters[place], message.words)

        def told(sent: bool, now: float) -> None:
            if sent:
                self._sent.take((raw,), place)
            left(sent, now)
        return told
