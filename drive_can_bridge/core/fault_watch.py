# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Which fault it is: the number that the drive has for it, by the profile's section ``fault``.

It is read once, when a fault shows: from samples where it is mapped, otherwise by one read,
like that of a user.
"""

from collections.abc import Sequence
from dataclasses import replace
import math
from typing import Protocol

from drive_can_bridge.core import sentences
from drive_can_bridge.core.command_interlock import CommandInterlock
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlCompleted
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.events import (
    Event, Noted, ProcessDataReceived, RequestCompleted, StationLost,
)
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import FaultTable
from drive_can_bridge.core.reporter import Reporter
from drive_can_bridge.core.requests import Failure, FailureKind, ReadRequest, ReadValue


class ReadRequests(Protocol):
    """Accepts read requests."""

    def submit(self, request: ReadRequest, now: float) -> None:
        """Handle a request."""


class Watched(Protocol):
    """A drive that may have a fault; the session itself."""

    configuration: DriveConfiguration
    control: ControlMachine | None
    interlock: CommandInterlock
    report: Reporter
    sample_parameters: tuple[Parameter, ...]
    active: bool
    online: bool

    @property
    def shows_fault(self) -> bool:
        """Whether its own status reports a fault."""

    @property
    def services(self) -> ReadRequests:
        """Where reads of the fault number are requested."""


#: 603Fh: manuals write what is in it, as in emergencies, with four hexadecimal digits
ERROR_CODE = 0x603F


class FaultWatch:
    """
    Watches one drive for faults.

    :ivar shows: the drive reports a fault.
    :ivar text: number and name of the fault, ``7 overcurrent``; '' without a fault, or where the
        number could not be read.
    :ivar unread: why it could not be read.
    :ivar error_code: 603Fh of a CANopen drive that has a fault, if it is known.
    """

    def __init__(self, session: Watched, table: FaultTable) -> None:
        self.text = ''
        self.unread = NOTHING
        self.error_code: int | None = None
        self._session = session
        self._parameter = session.configuration.profile.parameters[table.parameter]
        self._names = dict(table.codes)
        sample = [parameter.name for parameter in session.sample_parameters]
        self._place = sample.index(table.parameter) if table.parameter in sample else None
        name, self._mask = table.bit or ('', 0)
        self._bit_place = sample.index(name) if name in sample else None
        self.shows = False
        self._wanted = False    # the number is to be read; what is under way is of a fault before
        self._request: ReadRequest | None = None
        self._ended: list[ControlCompleted] = []    # by the fault: they tell its number
        self._now = self._tell_at = -math.inf       # of the last sample; they wait no longer

    def look(self, events: list[Event]) -> None:
        """
        Handle what has happened; there may be more to report, and to send, afterwards.

        What a fault has ended is answered as soon as its number is known, or cannot be read; or
        after ``control_timeout``: the read waits for those of users, which may be many.
        """
        for event in tuple(events):
            if isinstance(event, ProcessDataReceived):
                self.sampled(event.raws, event.received_at)
            elif isinstance(event, StationLost):
                self._gone()
            elif isinstance(event, ControlCompleted) and event.by_fault:
                events.remove(event)
                if not self._ended:
                    self._tell_at = self._now + self._session.configuration.control_timeout
                self._ended.append(event)
        if self._ended and (not self._is_told_soon or self._now >= self._tell_at):
            obeyed = self._session.interlock.obeyed
            fault = '' if obeyed is None else obeyed.fault_text
            events += [replace(each, message=each.message.also(fault=fault))
                       for each in self._ended]
            self._ended.clear()

    @property
    def _is_told_soon(self) -> bool:
        """Whether the number of the fault, or why it is unknown, will be known soon."""
        session = self._session
        return session.active and session.online and session.shows_fault and (
            not self.shows or self._wanted or self._request is not None)

    def take(self, event: RequestCompleted) -> bool:
        """Handle a completed request; return whether it was this watch's own."""
        if self._request is None or event.request is not self._request:
            return False
        self._request = None
        outcome = event.outcomes[0]
        if self._wanted or not self.shows:
            return True     # it was reset before it was known
        if isinstance(outcome, ReadValue):
            self._known(outcome.raw)
        elif isinstance(outcome, Failure):
            self.unread = (outcome.reason if outcome.kind is not FailureKind.NO_ANSWER else
                           sentences.no_answer_briefly())
            self._tell(sentences.fault_unread(self.unread))
            self._have_refusals_tell(sentences.number_unread(self.unread))
        return True

    def sampled(self, raws: Sequence[int | None], now: float) -> None:
        """Check a sample for a fault; None stands for what the drive refused."""
        self._now = now
        if self._session.control is not None:
            shows = self._session.shows_fault
        else:
            status = _at(self._bit_place, raws)
            if status is None:
                return
            shows = bool(status & self._mask)
        if not shows:
            self._gone()
            return
        if not self.shows:
            self.shows = True
            self._wanted = self._place is None
        if self._wanted and self._request is None:
            self._wanted = False
            self._request = ReadRequest((self._parameter,))
            self._session.services.submit(self._request, now)
        if not self.text:
            raw = _at(self._place, raws)
            # some drives report the number a moment later
            if raw is not None and (raw or raw in self._names):
                self._known(raw)

    def _known(self, raw: int) -> None:
        name = self._names.get(raw, '')
        parameter = self._parameter
        if parameter.index == ERROR_CODE:
            self.error_code = raw
        number = parameter.shown(raw) if self.error_code is None else f'{raw:04X}h'
        self.text = f'{number} {name}' if name else number
        self._tell(sentences.fault_named(number, name))

    def _tell(self, what: Sentence) -> None:
        self._have_refusals_tell(self.text)
        self._session.report.note(Noted(what, warning=True))

    def _gone(self) -> None:
        if self.shows:
            self.shows = self._wanted = False
            self.text, self.unread, self.error_code = '', NOTHING, None
            self._have_refusals_tell('')

    def _have_refusals_tell(self, text: str) -> None:
        obeyed = self._session.interlock.obeyed     # in a group not its own
        if obeyed is not None:
            obeyed.fault_text = text


def _at(place: int | None, raws: Sequence[int | None]) -> int | None:
    """Return the value at a place of a sample; None where the sample lacks it."""
    return raws[place] if place is not None and place < len(raws) else None
