# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Whether a limit that is sent in a PDO is in effect: it is read back by SDO.

.. code-block:: text

    set-up: what it is before ─► first answered exchange: read back, before the first 000Fh
        ─► first change of what is sent: read back once more

The first value may be what the drive had anyway, so that only a change shows something. It is read
again until it shows what is sent, for at most 0.5 s. One that is still what it was is not in
effect: its drive counts as ``mapping differs`` until it is seen to have another value. What shows
a third value is limited by something else. Silence is asked again, a refusal proves nothing.
"""

from collections.abc import Callable
import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.messages import NOTHING, Sentence, together
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.process_image import LastSent
from drive_can_bridge.core.text import value_text
from drive_can_bridge.protocols.cia402 import pdo
from drive_can_bridge.protocols.cia402.mapped import named
from drive_can_bridge.protocols.cia402.transactor import (
    ObjectRead, Procedure, SdoChannel, Transfer)
from drive_can_bridge.protocols.transactor import Refused

#: s that a drive may take to show what it was sent
LIMIT_TIME = 0.5
#: s between two looks
POLL_PERIOD = 0.02


class _Limit:
    """
    One limit.

    :ivar before: its word before what is sent now, as it was read; None: not known.
    :ivar looked_for: the word that was sent when it was looked at last; None: it was not yet.
    :ivar over: nothing more is to be found out.
    :ivar otherwise: that it has a third value, in words; '' if not.
    """

    def __init__(self, parameter: Parameter, place: int) -> None:
        self.parameter, self.place = parameter, place
        self.before: int | None = None
        self.looked_for: int | None = None
        self.over = False
        self.otherwise = NOTHING

    def text(self, word: int) -> str:
        """Write a word as a value with its unit."""
        value = self.parameter.value_from_raw(self.parameter.raw_from_word(word))
        return f'{value_text(value)} {self.parameter.unit}'.rstrip()


class LimitCheck:
    """
    The limits of one drive.

    :param sent: what left last.
    :param judged: is called when something came of a look.
    :ivar without_effect: which limit is not in effect, in words; '': none is known to be.
    """

    def __init__(self, limits: list[Parameter], sent: LastSent, channel: SdoChannel,
                 judged: Callable[[], None]) -> None:
        self.without_effect = NOTHING
        self._limits = [_Limit(each, sent.parameters.index(each)) for each in limits]
        self._sent, self._channel, self._judged = sent, channel, judged
        self._open: list[_Limit] = []
        self._polling: _Limit | None = None
        self._stuck: _Limit | None = None

    def found(self, words: dict[Parameter, int]) -> Sentence:
        """
        Record what was read before anything is sent.

        :return: which limit was without effect, and still has the same value; '': none.
        """
        stuck = self._stuck
        if stuck is not None and words.get(stuck.parameter) in (None, stuck.before):
            return self.without_effect
        self._stuck, self.without_effect = None, NOTHING
        for limit in self._limits:
            limit.before = words.get(limit.parameter)
        return NOTHING

    def begin(self) -> None:
        """Begin to check: exchanges follow."""
        self._polling = None
        for limit in self._limits:
            limit.looked_for, limit.over, limit.otherwise = None, False, NOTHING
        self._open = list(self._limits)

    def stop(self) -> None:
        """Check nothing any more: the channel was cleared."""
        self._polling = None
        self._open = []

    @property
    def otherwise(self) -> Sentence:
        """Which limits are known to have a third value; '': none."""
        return together(each.otherwise for each in self._limits)

    @property
    def unseen(self) -> Sentence:
        """Which limit has to be read back before the drive is enabled; '': none."""
        return next((sentences.limit_unread(named(each.parameter)) for each in self._open
                     if each.looked_for is None), NOTHING)

    def answered(self, now: float) -> None:
        """Check what was sent with an exchange that the drive has answered."""
        if not self._open or self._polling is not None:     # all that most cycles pay
            return
        for limit in self._open:
            word = self._word(limit)
            if word is not None and word != limit.looked_for:
                self._polling = limit
                self._channel.run(self._poll(limit), self._polled, now)
                return

    def _word(self, limit: _Limit) -> int | None:
        raw = self._sent.raws[limit.place]
        return None if raw is None else limit.parameter.word_from_raw(raw)

    def _poll(self, limit: _Limit) -> Procedure[None]:
        """Read one until it shows what is sent, or for so long that it never will."""
        parameter, tried, until = limit.parameter, set[int](), math.inf
        length = pdo.width(parameter)
        while True:
            reply = yield Transfer(parameter.index or 0, parameter.subindex or 0, attempts=1)
            now, sent = self._channel.now, self._word(limit)
            if sent is None or isinstance(reply, Refused):
                limit.looked_for, limit.over = sent, True
                return
            if not tried or sent != limit.before and tried == {limit.before}:
                until = now + LIMIT_TIME
            tried.add(sent)
            if isinstance(reply, ObjectRead):
                shown = reply.number(length)
                in_effect = shown == sent or shown in tried and shown != limit.before
                if in_effect or now >= until:
                    self._judge(limit, shown, sent, in_effect=in_effect)
                    return
            yield Transfer(pause=POLL_PERIOD)

    def _judge(self, limit: _Limit, shown: int, sent: int, *, in_effect: bool) -> None:
        first, limit.looked_for = limit.looked_for is None, sent
        limit.otherwise = NOTHING
        if in_effect:
            limit.over = not first and shown != limit.before
            limit.before = shown
            return
        said = (named(limit.parameter), limit.text(shown), limit.text(sent))
        if shown != limit.before:   # and looked at again with each change
            limit.otherwise = sentences.limit_otherwise(*said)
        else:
            limit.over = True
            self._stuck, self.without_effect = limit, sentences.limit_without_effect(*said)

    def _polled(self, _: None) -> None:
        self._polling = None
        self._open = [each for each in self._open if not each.over]
        self._judged()
