# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Which fault it is: the number that the drive has for it, by the profile's section ``fault``.

It is looked for once, when a fault shows: in samples where it is mapped, otherwise by one read,
like that of a user.
"""

from collections.abc import Iterable
from typing import Protocol

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.events import (
    Event, Noted, ProcessDataReceived, RequestCompleted, StationLost,
)
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import FaultTable
from drive_can_bridge.core.reporter import Reporter
from drive_can_bridge.core.requests import Failure, ReadRequest, ReadValue
from drive_can_bridge.core.sentences import NOTHING, Sentence


class Desk(Protocol):
    """Where reads are asked for."""

    def submit(self, request: ReadRequest, now: float) -> None:
        """Take a request."""


class Watched(Protocol):
    """A drive that may have a fault; the session itself."""

    configuration: DriveConfiguration
    control: ControlMachine | None
    report: Reporter
    sample_parameters: tuple[Parameter, ...]

    @property
    def services(self) -> Desk:
        """Where it is asked which one."""


#: 603Fh: manuals write what is in it, as in emergencies, with four hexadecimal digits
ERROR_CODE = 0x603F


class FaultWatch:
    """
    Watches one drive for faults.

    :ivar shows: the drive says that it has a fault.
    :ivar text: number and name of the fault, ``7 overcurrent``; '' without a fault, or where the
        number could not be read.
    :ivar unread: why it could not be read.
    """

    def __init__(self, session: Watched, table: FaultTable) -> None:
        self.text = ''
        self.unread = NOTHING
        self._session = session
        self._parameter = session.configuration.profile.parameters[table.parameter]
        self._names = dict(table.codes)
        sample = [parameter.name for parameter in session.sample_parameters]
        self._place = sample.index(table.parameter) if table.parameter in sample else None
        name, self._mask = table.bit or ('', 0)
        self._bit_place = sample.index(name) if name in sample else None
        self.shows = False
        self._request: ReadRequest | None = None

    def look(self, events: Iterable[Event]) -> None:
        """Look at what has happened; there may be more to be told, and to be sent, then."""
        for event in tuple(events):
            if isinstance(event, ProcessDataReceived):
                self._sampled(event.raws, event.received_at)
            elif isinstance(event, StationLost):
                self._gone()

    def take(self, event: RequestCompleted) -> bool:
        """Take the end of a request; tell whether it was ours."""
        if self._request is None or event.request is not self._request:
            return False
        self._request = None
        outcome = event.outcomes[0]
        if not self.shows:
            return True     # and reset before it was known
        if isinstance(outcome, ReadValue):
            self._known(outcome.raw)
        elif isinstance(outcome, Failure):
            self.unread = outcome.reason
            self._tell(sentences.fault_unread(outcome.reason))
        return True

    def _sampled(self, raws: tuple[int, ...], now: float) -> None:
        control, place = self._session.control, self._bit_place
        if control is not None:
            shows = control.fault
        elif place is not None and place < len(raws):
            shows = bool(raws[place] & self._mask)
        else:
            return
        if not shows:
            self._gone()
            return
        if not self.shows:
            self.shows = True
            if self._place is None:
                self._request = ReadRequest((self._parameter,))
                self._session.services.submit(self._request, now)
        if not self.text and self._place is not None and self._place < len(raws):
            raw = raws[self._place]
            if raw or raw in self._names:   # some drives say what it is a moment later
                self._known(raw)

    def _known(self, raw: int) -> None:
        name = self._names.get(raw, '')
        parameter = self._parameter
        number = f'{raw:04X}h' if parameter.index == ERROR_CODE else parameter.shown(raw)
        self.text = f'{number} {name}' if name else number
        self._tell(sentences.fault_named(number, name))

    def _tell(self, what: Sentence) -> None:
        control = self._session.control
        if control is not None:
            control.fault_text = self.text
        self._session.report.note(Noted(what, warning=True))

    def _gone(self) -> None:
        if self.shows:
            self.shows = False
            self.text, self.unread = '', NOTHING
            if self._session.control is not None:
                self._session.control.fault_text = ''
