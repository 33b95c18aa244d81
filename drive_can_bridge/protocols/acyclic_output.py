# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What is commanded by acyclic writes: setpoints and control word, and when each is due.

A setpoint is written when it changes, and again after ``refresh_interval``. Values are looked at
when a frame is made, not when it becomes due: the newest one wins.

A control word is written when it changes. It may get lost on the way, a device may acknowledge it
and take no notice, somebody else may have written another one: so one that the drive does not
follow, by what it reports since, is written again, ever more seldom. When, a *policy* says:
:class:`Judged` where nobody acknowledges writes, :class:`Acknowledged` where the drive does.

No word that starts a drive leaves before its setpoints: a drive may have been off for a moment,
unseen, and have in its registers what somebody else has put there. So each is written again,
neutral as it is then, right before ``enable``, every time, and counts when it has left (where a
write is acknowledged, when it was), but not while nobody answers.

How a write is encoded and confirmed, and what has to be told of it, the families say.
"""

from collections.abc import Container, Sequence
import math
from typing import NamedTuple, Protocol

from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.protocols.polled_exchange import TOLERANCE

#: s until a word that the drive takes no notice of is written again: at first, and at most
REPEAT_FIRST = 0.2
REPEAT_LAST = 2.0
#: how often at most where each write wears an EEPROM
EEPROM_REPEATS = 3
#: how often to one that ran, and is at fault or reports nothing: whether it got a word that stops
#: it is not to be seen
UNSEEN_REPEATS = 3


class Policy(Protocol):
    """Whether a word that has left, or was acknowledged, is written once more."""

    @property
    def pulse_spacing(self) -> float:
        """How many s lie between two writes of a pulse; infinity: it is written once."""

    def again(self, control: ControlMachine, repeats: int, *, ran: bool) -> bool:
        """
        Return whether it is, by what the drive reports since.

        :param repeats: how often it was written once more already.
        :param ran: it may run by a word before.
        """


class Judged(NamedTuple):
    """
    Writes are not acknowledged: they are judged by the status that follows.

    :param pulse_spacing: s; a pulse is written as often as it has to leave.
    :param wears: each write wears an EEPROM (or may): only a drive that runs on although it shall
        not gets its word again, a few times.
    """

    pulse_spacing: float
    wears: bool = False

    def again(self, control: ControlMachine, repeats: int, *, ran: bool) -> bool:
        """Return whether the drive takes no notice."""
        if control.pulsing:
            return True
        if self.wears:
            return control.disregard != '' and repeats < EEPROM_REPEATS
        # rid of its fault, it would run by itself, had it missed the word
        unseen = control.fault or control.stopping and control.unseen
        return control.unconfirmed or ran and unseen and repeats < UNSEEN_REPEATS


class Acknowledged:
    """The drive has what it has acknowledged: what starts it is not repeated."""

    pulse_spacing = math.inf

    def again(self, control: ControlMachine, repeats: int, *, ran: bool) -> bool:
        """Return whether the drive runs on although its word is there to stop it."""
        return control.stopping and control.unconfirmed


class AcyclicOutput:
    """
    The acyclic writes that command one drive.

    :param control: the machine of its control word; None: there is none.
    :param count: of what is written on change.
    :param slot: of the control word among that; None: it is asked for by :meth:`word_due` only.
    :param refresh: s after which what has not changed is written again; 0: never.
    :param lasting: indices of those that are not, for all that.
    :ivar word: the control word that was written last; None: nobody knows, or it was refused.
    :ivar again_at: when it is to be written again in any case.
    """

    def __init__(self, control: ControlMachine | None, policy: Policy, count: int, *,
                 slot: int | None = None, refresh: float = 0.0,
                 lasting: Container[int] = ()) -> None:
        self._control = control
        self._policy = policy
        self._slot = slot
        self._refresh = [0.0 if index in lasting else refresh for index in range(count)]
        self._setpoints = frozenset(range(count)) - {slot}
        self._written: list[int | None] = [None] * count
        self._written_at = [-math.inf] * count
        self._due: list[int] = []
        self._lacking: set[int] | None = None   # setpoints that the word waits for
        self.forget()

    def forget(self) -> None:
        """Record that nothing is known of the drive: everything is due with the next poll."""
        self.write_all()
        self._due.clear()
        self.restart()
        self.forget_word()

    def forget_word(self) -> None:
        """Mark the control word of the drive as unknown."""
        self.word: int | None = None
        self._ran = False               # the last one before that was no quick stop was enable
        self._repeats = 0
        self._repeat_at = math.inf      # when the drive must have taken notice
        self.again_at = math.inf

    # -- what is due ------------------------------------------------------------------------------

    def collect_due(self, raws: Sequence[int], now: float, *, hold: Sequence[int | None] = (),
             unknown: Sequence[int] = ()) -> None:
        """
        Find out what is due, once a period.

        :param raws: what is to be written now.
        :param hold: indices of those that are not to be written now.
        :param unknown: of those whose value nobody knows: not now, but as soon as it is known,
            even where it is what was written last.
        """
        for index in unknown:
            self.failed(index)
        hold = (*hold, *unknown)
        if hold:
            self._due = [index for index in self._due if index not in hold]
        for index, raw in enumerate(raws):
            if index not in self._due and index not in hold and self.wants(index, raw, now):
                self._due.append(index)

    def wants(self, index: int, raw: int, now: float) -> bool:
        """Return whether the drive does not have what it shall have, or not lately."""
        return (raw != self._written[index]
                or 0.0 < self._refresh[index] <= now - self._written_at[index] + TOLERANCE)

    def last_written(self, index: int) -> int | None:
        """Return what the drive has, or has been sent; None: unknown."""
        return self._written[index]

    def order_word(self, *, first: bool) -> None:
        """Move the control word before all others, if it is due, or behind them."""
        if self._slot is not None and self._slot in self._due:
            self._due.remove(self._slot)
            self._due.insert(0 if first else len(self._due), self._slot)

    @property
    def waiting(self) -> int:
        """How many are due."""
        return len(self._due)

    def next(self) -> int:
        """Return the index of the one to be written next, which is due no more."""
        return self._due.pop(0)

    def written(self, index: int, raw: int, now: float) -> None:
        """Record what goes out, at once, so that it is not due any more."""
        self._written[index] = raw
        self._written_at[index] = now
        if index in self._due:
            self._due.remove(index)
        if index == self._slot:
            self.word_begun(raw)

    def failed(self, index: int) -> None:
        """Record that it is unknown what the drive has: the value is due again."""
        self._written[index] = None

    def invalidate(self, since: float, *, but: Container[int | None] = ()) -> bool:
        """Mark what was written since then, ``but`` these, as due; return if there was any."""
        found = [index for index, at in enumerate(self._written_at)
                 if at > since and index not in but]
        for index in found:
            self.failed(index)
        return bool(found)

    def write_all(self, *, but: Container[int] = ()) -> None:
        """Mark everything ``but`` these as due, whether it has changed or not."""
        for index in range(len(self._written)):
            if index not in but:
                self.failed(index)

    # -- setpoints before a word that starts ------------------------------------------------------

    def holds_word(self, *, again: bool = False) -> bool:
        """
        Return whether the control word has to wait; when it begins to, all setpoints become due.

        :param again: the word is due again, to a drive that takes no notice of it.
        """
        control = self._control
        if control is None or not (control.word_due or again) or (
                not control.starts or control.pulsing):
            self._lacking = None
            return False
        if self._lacking is None:
            self._lacking = set(self._setpoints)
            for index in self._lacking:
                self.failed(index)
        return bool(self._lacking)

    def restart(self) -> None:
        """Forget which setpoints the drive has: it may not have received them."""
        self._lacking = None

    def has(self, index: int) -> bool:
        """Record that the drive has a setpoint; return whether it was the last one waited for."""
        if not self._lacking or index not in self._lacking:
            return False
        self._lacking.discard(index)
        return not self._lacking

    # -- the control word -------------------------------------------------------------------------

    def word_begun(self, word: int) -> None:
        """Record that a control word is being written."""
        if word == self.word:
            self._repeats += 1
        else:
            self._repeats = 0
            table = self._control and self._control.table
            if table and self.word not in (None, table.quick_stop):
                self._ran = self.word == table.enable
        self.word = word
        self._repeat_at = self.again_at = math.inf  # until it left

    def word_left(self, now: float, word: int, *, again: bool = True) -> bool:
        """
        Record that a control word left; where writes are acknowledged, that it was.

        :param again: it is written again if the drive takes no notice.
        :return: it is, or was, the current one.
        """
        if again:
            self.word_unanswered(now)
        control = self._control
        if control is None or word != control.word:
            return False
        control.word_sent(now)
        if control.pulsing:
            self._repeat_at = self.again_at = now + self._policy.pulse_spacing
        elif again and control.unseen and self._policy.again(
                control, self._repeats, ran=self._ran):
            self.again_at = self._repeat_at     # no status has it looked at
        return True

    def word_unanswered(self, now: float) -> None:
        """Schedule the control word once more, later, if the drive takes no notice."""
        self._repeat_at = now + min(REPEAT_FIRST * 2 ** min(self._repeats, 10), REPEAT_LAST)

    def word_refused(self, word: int, again_at: float) -> None:
        """Record that the bus refused a control word."""
        if word == self.word:
            self.word, self.again_at = None, again_at

    def word_due(self, now: float) -> bool:
        """Return whether the word that has left, and is still the current one, is due again."""
        control = self._control
        if now >= self.again_at:
            return True
        if control is None or self._repeat_at == math.inf:
            return False
        # another one was to follow, and never left
        return control.word_due or now >= self._repeat_at and self._policy.again(
            control, self._repeats, ran=self._ran)

    def handle_timer(self, now: float) -> bool:
        """Return whether the control word is to be seen to: it is written again in any case."""
        if now < self.again_at:
            return False
        self.again_at = math.inf
        if self._slot is not None:
            self.failed(self._slot)
        return True
