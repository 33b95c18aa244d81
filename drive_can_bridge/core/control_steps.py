# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What a control request does, step by step, and which of two requests gives way: both as tables.

:class:`.ControlMachine` goes by them; :mod:`.control` says why they are as they are.
"""

from enum import Enum
from typing import NamedTuple

from drive_can_bridge.core.control import ControlAction

_ENABLE, _DISABLE = ControlAction.ENABLE, ControlAction.DISABLE
_QUICK_STOP, _RESET = ControlAction.QUICK_STOP, ControlAction.RESET_FAULT


class Seen(Enum):
    """
    What a step waits for.

    What the status has to say counts from drives that know the current word; where the profile
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
    """What follows."""

    SEND_ENABLE = 'enable becomes the word'
    SEND_RESET = 'the pulse becomes the word'
    SEND_DISABLE = 'disable becomes the word, and the request goes on'
    SUCCEED = 'success, disable becomes the word'
    SUCCEED_AND_STAY = 'success, the word stays'
    ANSWER = 'success, and the word stays until the time is over'


class Step(NamedTuple):
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
STEPS: tuple[Step, ...] = (
    Step(_ENABLE, _DISABLE, (Seen.NO_FAULT, Seen.OFF, Seen.READY), Then.SEND_ENABLE),
    Step(_ENABLE, _ENABLE, (Seen.ENABLED,), Then.SUCCEED_AND_STAY),
    Step(_DISABLE, _DISABLE, (Seen.OFF,), Then.SUCCEED),
    Step(_QUICK_STOP, _DISABLE, (Seen.OFF,), Then.SUCCEED),     # of a drive that does not run
    Step(_QUICK_STOP, _QUICK_STOP, (Seen.OFF, Seen.REPORTS), Then.SUCCEED),
    Step(_QUICK_STOP, _QUICK_STOP, (Seen.OFF,), Then.ANSWER),   # disable would end the braking
    Step(_RESET, _DISABLE, (Seen.RESETTABLE,), Then.SEND_RESET),
    Step(_RESET, _DISABLE, (Seen.NO_FAULT,), Then.SUCCEED),
    Step(_RESET, _RESET, (Seen.PULSED,), Then.SEND_DISABLE),
)


class Meeting(Enum):
    """What becomes of a request while another is under way."""

    JOINS = 'both are answered together'
    REPLACES = 'the one under way fails'
    REFUSED = 'no start cuts a stop short'


_JOINS, _REPLACES, _REFUSED = Meeting.JOINS, Meeting.REPLACES, Meeting.REFUSED

#: (request, the one under way) -> what becomes of it
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
