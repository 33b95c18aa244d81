# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What can be asked of a drive beyond parameters: ``~/enable``, ``~/reset_fault``, ``~/quick_stop``.

What a request does, step by step, is a table, :data:`STEPS`: which control word is sent, what the
status has to show, and what follows then. Which of two requests gives way is another,
:data:`MEETINGS`. :class:`.ControlMachine` goes by them; here stands why they are as they are.

The profile's table has the word for each action. Where the next word depends on what the
drive reports (CiA 402: 0007h before 000Fh), a family hands in rules of its own.

Every other end of a request (time-out, fault, withdrawal, replacement) is a failure and leaves
``disable``; but a drive that reports that it still brakes when the time is over keeps its quick
stop until it lets go: ``disable`` may let it coast. So ``enable`` is on the bus only because
of an ENABLE that nothing has ended since; a fault, or a drive that drops out of ``enabled`` by
itself, ends it like a stop does.

*Which status counts.* A status word confirms something only if it arrived after the current
control word had left; what was on its way before is older. A fault counts
always. For the same reason an enabled drive is found "enabled already" only while the control
word is ``enable``: under ``disable`` such a status is about to be outdated, and ENABLE waits for
the drive to let go first.

*A request while another is under way.* The same request again joins the first, and both are
answered together, at the first one's deadline at the latest. Of two different ones:

* DISABLE and QUICK_STOP take effect at once, whatever they interrupt, each other included: the
  newest request to stop the drive is obeyed.
* ENABLE and RESET_FAULT are refused while a DISABLE or QUICK_STOP is under way: no start cuts a
  stop short. (A RESET_FAULT with nothing to reset succeeds without disturbing the stop.)
* RESET_FAULT replaces an ENABLE, and the other way round as far as there is no fault.

A request that is refused changes nothing.

*Quick stop of a drive without a word for it* is a DISABLE, and the answer reports so.

*Quick stop of a drive that does not run* is a DISABLE: answered at once where that is known, and
otherwise as soon as the drive confirms it. The same goes for a faulted drive, whose control word
is ``disable`` in any case; but not for others that share its control word, as long as they run.

*What a profile leaves out.* Where a condition is missing in the profile, having sent the word is
all the confirmation there is, and the answer reports so. A quick stop then keeps its word for the
whole time-out, although it is answered at once: ``disable`` right after it would end the braking
before it began. A drive that does not report faults gets the reset pulse in any case.

*The pulse.* What is not acknowledged may get lost, and a drive may look at its control word
seldom: so the word leaves :data:`RESET_CYCLES` times, and its sender lets little time pass
between them (:attr:`.ControlMachine.pulsing`). Where a write is acknowledged, one is enough. The
pulse is the same whether or not the fault goes meanwhile; what counts is the status after it.

*Several drives with one control word.* What a status has to confirm, all of them have to
(:mod:`.status_reports`). ENABLE wants all of them to be there, and ends when one is lost.

*A drive that takes no notice.* A word that is written when it changes may get lost on the way.
:attr:`.ControlMachine.unconfirmed` shows the session that the drive, by what it reports since,
does not follow the word: then the word is written again. A drive that goes on running under
a word that stops it for longer than a request may take is reported
(:attr:`.ControlMachine.disregard`). One that reports that it refuses the word
(:meth:`.ControlMachine.word_refused`) ends what is under way, with its reason.
"""

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.profile import ControlTable


class ControlAction(Enum):
    """The control actions of a drive; also the names of control words in a profile."""

    ENABLE = 'enable'
    DISABLE = 'disable'
    QUICK_STOP = 'quick_stop'
    RESET_FAULT = 'reset_fault'
    #: no word of a profile: a sequence of its own, where a family has one
    HOME = 'home'


@dataclass(frozen=True, slots=True, eq=False)
class ControlRequest:
    """A request for a control action; answered exactly once. Equal only to itself."""

    action: ControlAction


@dataclass(frozen=True, slots=True)
class ControlCompleted:
    """
    The outcome of a request; each gets exactly one.

    :param message: the state reached, or why it was not, for the answer of the service.
    :param by_fault: a fault ended it; ``message`` gets a field ``fault`` when that is known.
    """

    request: ControlRequest
    success: bool
    message: Sentence
    by_fault: bool = False


_ENABLE, _DISABLE = ControlAction.ENABLE, ControlAction.DISABLE
_QUICK_STOP, _RESET = ControlAction.QUICK_STOP, ControlAction.RESET_FAULT


class Seen(Enum):
    """
    What a step waits for.

    The status counts from drives that know the current word; where the profile
    has no condition for it, that the word has left is all there is.
    """

    NO_FAULT = 'no fault'
    READY = 'ready'
    ENABLED = 'enabled'
    OFF = 'it does not run'
    RESETTABLE = 'a fault that can be reset, and no pulse before'
    PULSED = 'the pulse has left as often as it has to'
    REPORTS = 'the profile says how it reports that it runs'


class Then(Enum):
    """What a step does when all its conditions are seen."""

    SEND_ENABLE = 'enable becomes the word'
    SEND_RESET = 'the pulse becomes the word'
    SEND_DISABLE = 'disable becomes the word, and the request goes on'
    SUCCEED = 'success, disable becomes the word'
    SUCCEED_AND_STAY = 'success, the word stays'
    ANSWER = 'success, and the word stays until the time is over'


class ControlStep(NamedTuple):
    """
    One step of a request.

    A quick stop of a drive that runs begins with its own word, an enable with the word that is
    there, and everything else with ``disable``.

    :ivar request: what is under way.
    :ivar word: what the current control word is for.
    :ivar when: all of it has to be seen.
    """

    request: ControlAction
    word: ControlAction
    when: tuple[Seen, ...]
    then: Then


#: the first one that fits is taken; every other end of a request is a failure, and ``disable``
STEPS: tuple[ControlStep, ...] = (
    ControlStep(_ENABLE, _DISABLE, (Seen.NO_FAULT, Seen.OFF, Seen.READY), Then.SEND_ENABLE),
    ControlStep(_ENABLE, _ENABLE, (Seen.ENABLED,), Then.SUCCEED_AND_STAY),
    ControlStep(_DISABLE, _DISABLE, (Seen.OFF,), Then.SUCCEED),
    ControlStep(_QUICK_STOP, _DISABLE, (Seen.OFF,), Then.SUCCEED),
    # of a drive that does not run
    ControlStep(_QUICK_STOP, _QUICK_STOP, (Seen.OFF, Seen.REPORTS), Then.SUCCEED),
    ControlStep(_QUICK_STOP, _QUICK_STOP, (Seen.OFF,), Then.ANSWER),
    # disable would end the braking
    ControlStep(_RESET, _DISABLE, (Seen.RESETTABLE,), Then.SEND_RESET),
    ControlStep(_RESET, _DISABLE, (Seen.NO_FAULT,), Then.SUCCEED),
    ControlStep(_RESET, _RESET, (Seen.PULSED,), Then.SEND_DISABLE),
)


class Meeting(Enum):
    """What happens to a request while another is under way."""

    JOINS = 'both are answered together'
    REPLACES = 'the one under way fails'
    REFUSED = 'no start cuts a stop short'


_JOINS, _REPLACES, _REFUSED = Meeting.JOINS, Meeting.REPLACES, Meeting.REFUSED

#: (request, the one under way) -> what happens to it
MEETINGS: dict[tuple[ControlAction, ControlAction], Meeting] = {
    (request, under_way): meeting
    for request, row in {
        #              enable     disable    quick stop  reset
        _ENABLE:     (_JOINS,    _REFUSED,  _REFUSED,   _REPLACES),
        _DISABLE:    (_REPLACES, _JOINS,    _REPLACES,  _REPLACES),
        _QUICK_STOP: (_REPLACES, _REPLACES, _JOINS,     _REPLACES),
        _RESET:      (_REPLACES, _REFUSED,  _REFUSED,   _JOINS),
    }.items()
    for under_way, meeting in zip((_ENABLE, _DISABLE, _QUICK_STOP, _RESET), row)
}


class TableRules:
    """
    One word for each action, as the table has them.

    :ivar known: the actions that there is a word for.
    :ivar may_run: a status may be older than the word that started the drive.
    """

    def __init__(self, table: ControlTable) -> None:
        self._words: dict[ControlAction, int] = {
            action: word for action in ControlAction
            if (word := getattr(table, action.value, None)) is not None}
        self.known = frozenset(self._words)
        self.may_run = False

    def word(self, sending: ControlAction, *, asked: ControlAction | None) -> int:
        """
        Return the word to be sent now.

        :param sending: what it is for.
        :param asked: what is under way because users want it; None: nothing is.
        """
        return self._words[sending]

    def rests(self, word: int) -> bool:
        """Return whether a word commands the drive to stand still."""
        return word == self._words[ControlAction.DISABLE]

    def left(self, word: int) -> None:
        """Record a word that has left."""

    def reported(self, raw: int, *, behind: bool) -> None:
        """
        Record a status word.

        :param behind: it arrived after the current word had left.
        """

    def forget(self) -> None:
        """Record that the state of the drive is unknown."""

    @property
    def holds(self) -> Sentence:
        """The answer to a quick stop in which the drive stays; '' if it does not."""
        return NOTHING

    @property
    def lacking(self) -> Sentence:
        """What a drive that reports enabled lacks to be driven; '' if nothing."""
        return NOTHING

    def remark(self, sending: ControlAction) -> Sentence:
        """Return why a drive does not follow, as far as the family knows; '' for nothing."""
        return NOTHING

    def proviso(self) -> Sentence:
        """Return, once, what is not known of a request that succeeds; '' for nothing."""
        return NOTHING

    @property
    def loose(self) -> bool:
        """Whether nothing holds the axis in its place although the drive is enabled."""
        return False
