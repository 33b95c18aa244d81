# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Status word and actual values of an inverter as samples, of one frame or of two.

Values 4 and 5 come in an additional frame. The sample of an exchange waits for them, and goes out
without when they do not come.
"""

from drive_can_bridge.core import sentences
from drive_can_bridge.core.events import ProcessDataReceived
from drive_can_bridge.core.sentences import NOTHING
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.cannord.process_data import decode_extra, MAIN_VALUES


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
        Take a main frame; tell whether it has all the values that are wanted of it.

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
        """Take the additional frame of the exchange under way."""
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
