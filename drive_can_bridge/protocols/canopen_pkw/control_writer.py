# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The control word on its way through the mailbox.

It is written when it changes. Whether the drive got it, its answer says; when that is missing,
``disable`` is simply written again. Any other word might be executed twice: so it is read back
first, and written again only if it is not there. Where it cannot be read back it is not repeated,
and the control machine gives up by itself.
"""

from collections.abc import Callable, Generator
import math

from drive_can_bridge.core.control import ControlMachine
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.canopen_pkw import addresses
from drive_can_bridge.protocols.canopen_pkw.addresses import Span
from drive_can_bridge.protocols.canopen_pkw.channel import Channel, Lane
from drive_can_bridge.protocols.canopen_pkw.mailbox import (
    Answered, Read, Refused, Reply, Silence, Step, Write,
)


class ControlWriter:
    """
    Writes the control word of one drive.

    :param word: parameter of the control word.
    :param changed: called after anything that may have changed the control word.
    :param disable: the word that may be written any number of times.
    :param refresh: s after which an unchanged word is written again; 0: never.
    :ivar refusal: what the drive says to a word that it refused; '' if it does not.
    """

    def __init__(self, channel: Channel, control: ControlMachine, word: Parameter,
                 changed: Callable[[float], None], *, disable: int, addressing: str,
                 word_order: str, refresh: float) -> None:
        self.refusal = ''
        self._channel = channel
        self._control = control
        self._parameter = word
        self._changed = changed
        self._disable = disable
        self._word_order = word_order
        self._span = addresses.span_of(word, addressing)
        self._refresh = refresh
        self._settled: int | None = None    # the drive has it, or has refused it
        self._settled_at = -math.inf
        self._doubtful: int | None = None   # sent, but not answered

    def forget(self) -> None:
        """Take note that nothing is known of the drive."""
        self._settled = self._doubtful = None
        self.refusal = ''

    def update(self, now: float) -> None:
        """Write the word if the drive does not have it, or not lately."""
        fresh = self._refresh <= 0.0 or now < self._settled_at + self._refresh
        if self._settled == self._control.word and fresh:
            return
        if self._channel.is_idle(Lane.CONTROL):
            self._channel.run(Lane.CONTROL, self._write(), lambda _: None, now)

    def disable_write(self) -> tuple[Span, tuple[int, ...]]:
        """Return what writes ``disable``."""
        return self._span, self._words(self._disable)

    def _words(self, word: int) -> tuple[int, ...]:
        return addresses.words_from_raw(self._parameter, word, self._word_order)

    def _write(self) -> Generator[Step, Reply, None]:
        """Write the newest word, until it is answered or silence says to wait a while."""
        while True:
            word = self._control.word
            if word == self._doubtful and word != self._disable:
                there = yield from self._read_back(word)
                if there is None:
                    return
                if there:
                    self._settle(word)
                    if word == self._control.word:
                        return
                    continue
                word = self._control.word
            reply = yield Write(self._span.address, self._words(word))
            if isinstance(reply, Silence):
                if reply.sent:
                    self._settled, self._doubtful = None, word
                if word == self._control.word:
                    return
                continue
            if isinstance(reply, Refused):
                self.refusal = f'{self._parameter.name} {word:04X}h {reply.text}'
                self._settled, self._settled_at = word, self._channel.now
            else:
                self.refusal = ''
                self._settle(word)
            if word == self._control.word:
                return

    def _read_back(self, word: int) -> Generator[Step, Reply, bool | None]:
        """Tell whether the drive has a word that was not answered; None: nobody knows."""
        if not self._parameter.readable:
            return None
        reply = yield Read(self._span.address, self._span.count)
        if not isinstance(reply, Answered):
            return None
        found = addresses.raw_from_words(
            self._parameter, reply.words[:self._span.count], self._word_order)
        self._doubtful = None
        return self._parameter.word_from_raw(found) == self._parameter.word_from_raw(word)

    def _settle(self, word: int) -> None:
        """Take note that the drive has a word."""
        self._doubtful = None
        self._settled, self._settled_at = word, self._channel.now
        if word == self._control.word:
            self._control.word_sent(self._channel.now)
            self._changed(self._channel.now)
