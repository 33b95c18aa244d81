# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What can be asked of a drive beyond parameters: ``~/enable``, ``~/reset_fault``, ``~/quick_stop``.

What a request does, step by step, is a table, :data:`.control_steps.STEPS`: which control word
is sent, what the status has to say, and what follows then. Which of two requests gives way is
another, :data:`.control_steps.MEETINGS`. Here stands why they are as they are.

Every other end of a request (time-out, fault, withdrawal, replacement) is a failure and leaves
``disable``; but a drive that says that it still brakes when the time is over keeps its quick
stop until it lets go: ``disable`` may let it coast. So ``enable`` is on the bus only for the sake
of an ENABLE that nothing has ended since; a fault, or a drive that drops out of ``enabled`` by
itself, ends it like a stop does.

*Which status counts.* A status word confirms something only if it arrived after the current
control word had left; what was on its way before that tells of older times. A fault counts
always. For the same reason an enabled drive is found "enabled already" only while the control
word is ``enable``: under ``disable`` such a status is about to be outdated, and ENABLE waits for
the drive to let go first.

*A request while another is under way.* The same request again joins the first, and both are
answered together, at the first one's deadline at the latest. Of two different ones:

* DISABLE and QUICK_STOP take effect at once, whatever they interrupt, each other included: the
  newest word of somebody who wants the drive to stop is the one to obey.
* ENABLE and RESET_FAULT are refused while a DISABLE or QUICK_STOP is under way: no start cuts a
  stop short. (A RESET_FAULT with nothing to reset succeeds without disturbing the stop.)
* RESET_FAULT replaces an ENABLE, and the other way round as far as there is no fault.

A request that is refused changes nothing.

*Quick stop of a drive without a word for it* is a DISABLE, which the answer says.

*Quick stop of a drive that does not run* is a DISABLE: answered at once where that is known, and
otherwise as soon as the drive confirms it. The same goes for a faulted drive, whose control word
is ``disable`` in any case.

*What a profile does not tell.* Where a condition is missing in the profile, having sent the word
is all the confirmation there is, and the answer says so. A quick stop then keeps its word for the
whole time-out, although it is answered at once: ``disable`` right after it would end the braking
before it began. A drive that does not report faults gets the reset pulse in any case.

*The pulse.* What nobody acknowledges may get lost, and a drive may look at its control word
seldom: so the word leaves :data:`RESET_CYCLES` times, and its sender lets little time pass
between them (:attr:`.ControlMachine.pulsing`). Where a write is acknowledged, one is enough. The
pulse is the same whether or not the fault goes meanwhile; what counts is the status after it.

*Several drives with one control word.* What a status has to confirm, all of them have to
(:mod:`.status_reports`). ENABLE wants all of them to be there, and ends when one is lost.

*A drive that takes no notice.* A word that is written when it changes may get lost on the way.
:attr:`.ControlMachine.unconfirmed` tells the session that the drive, by what it reports since,
does not do as the word says: then the word is written again. A drive that goes on running under
a word that stops it for longer than a request may take is told of
(:attr:`.ControlMachine.disregard`). One that says that it refuses the word
(:meth:`.ControlMachine.word_refused`) ends what is under way, with its reason.
"""

from dataclasses import dataclass
from enum import Enum

from drive_can_bridge.core.sentences import Sentence


class ControlAction(Enum):
    """What can be asked of a drive; also names the control words of a profile."""

    ENABLE = 'enable'
    DISABLE = 'disable'
    QUICK_STOP = 'quick_stop'
    RESET_FAULT = 'reset_fault'
    #: no word of a profile: a sequence of its own, where a family has one
    HOME = 'home'


@dataclass(frozen=True, slots=True, eq=False)
class ControlRequest:
    """Somebody asks for something; answered exactly once. Equal only to itself."""

    action: ControlAction


@dataclass(frozen=True, slots=True)
class ControlCompleted:
    """
    The outcome of a request; each gets exactly one.

    :param message: the state reached, or why it was not, for the answer of the service.
    """

    request: ControlRequest
    success: bool
    message: Sentence
