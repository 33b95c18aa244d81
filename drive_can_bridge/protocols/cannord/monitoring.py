# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Telegram monitoring: the inverter's own time-out and the period of the bridge.

P513 ("telegram time-out") makes an inverter fault (E010) when the time between two telegrams is
longer; 0 and negative values switch that off (BU 0260 page 77). It begins with the first telegram.
Process frames come once a ``period``, and so do the broadcasts of a group. A single one may get
lost on a busy bus, or be late on a busy machine, so the time-out should allow for
:data:`PERIODS_MIN` periods.

Without it nothing stops the motor when the bridge dies, which is told once.

The scale of P513 comes from the profile, as that of every parameter; a profile that does not list
it gets no warning.
"""

import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.events import Noted
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import Profile
from drive_can_bridge.core.reporter import Reporter
from drive_can_bridge.core.requests import (
    Failure, Outcomes, ReadRequest, ReadValue, Request, WriteRequest, Written,
)
from drive_can_bridge.protocols.cannord.procedures import TaskAccess
from drive_can_bridge.protocols.channel import Priority

TIMEOUT_NUMBER = 513
#: periods that the time-out should last at least: one frame lost, the next one late
PERIODS_MIN = 3
#: s until a time-out that nobody answered is asked for again
UNKNOWN_PAUSE = 10.0


def timeout_parameter(profile: Profile) -> Parameter | None:
    """Return the parameter of the profile that holds the telegram time-out in s, if any."""
    for parameter in profile.parameters.values():
        if parameter.number == TIMEOUT_NUMBER and parameter.unit == 's' and parameter.readable:
            return parameter
    return None


def timeout_warning(parameter: Parameter, timeout: float, period: float) -> Sentence:
    """
    Return that the inverter's time-out is too tight for the period; '' if it is not.

    :param timeout: s; 0 or less: not monitored.
    :param period: s between two process frames.
    """
    least = PERIODS_MIN * period
    if timeout <= 0.0 or timeout > least - 1e-9:
        return NOTHING
    return sentences.timeout_too_tight(
        timeout, parameter.name, parameter.address, period, least)


class TimeoutWatch:
    """
    Reads the telegram time-out of one inverter, where its profile lists it.

    :param access: how parameters are read.
    :param report: takes what people should know.
    :ivar warning: why it does not fit; '' if it does, or nobody knows.
    """

    def __init__(self, drive: DriveConfiguration, access: TaskAccess,
                 report: Reporter) -> None:
        self.warning = NOTHING
        self._parameter = timeout_parameter(drive.profile)
        self._period = drive.period
        self._access = access
        self._report = report
        self._ask_at = -math.inf
        self._told = NOTHING

    def poll(self, now: float) -> None:
        """Read it, unless a read is under way or was unanswered lately."""
        if self._parameter is not None and now >= self._ask_at and (
                self._access.channel.is_idle(Priority.OWN)):
            self._access.serve(ReadRequest((self._parameter,)), self._take, now, Priority.OWN)

    def request_answered(self, request: Request, outcomes: Outcomes) -> None:
        """Read it again after a user has written it."""
        if isinstance(request, WriteRequest) and any(
                parameter.number == TIMEOUT_NUMBER and isinstance(outcome, Written)
                for (parameter, _), outcome in zip(request.items, outcomes)):
            self._ask_at = -math.inf    # now it is known to answer
            self.poll(self._access.channel.now)

    def _take(self, outcomes: Outcomes) -> None:
        outcome, = outcomes
        if self._parameter is None:
            return
        if isinstance(outcome, ReadValue):
            timeout = float(self._parameter.value_from_raw(outcome.raw))
            self.warning = timeout_warning(self._parameter, timeout, self._period)
            if self.warning:
                self._report.note(Noted(self.warning, warning=True))
            unwatched = sentences.not_monitored(
                self._parameter.name, self._parameter.address, timeout) if (
                    timeout <= 0.0) else NOTHING
            if unwatched and unwatched != self._told:
                self._report.note(Noted(unwatched, warning=True))
            self._told = unwatched
        elif isinstance(outcome, Failure):
            self._ask_at = self._access.channel.now + UNKNOWN_PAUSE
            self._report.note(Noted(sentences.timeout_unknown(
                self._parameter.address, outcome.reason)))
