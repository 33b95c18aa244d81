# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The parameter requests of users on their way through the mailbox."""

from collections.abc import Callable

from drive_can_bridge.configuration.model import DriveConfiguration
from drive_can_bridge.core.requests import Failure, Outcome, ReadRequest, Request
from drive_can_bridge.protocols.canopen_pkw import procedures
from drive_can_bridge.protocols.canopen_pkw.channel import Channel, Lane, Procedure


class UserRequests:
    """
    Turns requests into procedures, and sees to it that each is answered once.

    :param offline: tells whether nobody is there.
    :param complete: takes a request and one outcome for each of its parameters.
    """

    def __init__(self, channel: Channel, drive: DriveConfiguration, *,
                 offline: Callable[[], bool],
                 complete: Callable[[Request, tuple[Outcome, ...]], None]) -> None:
        self._channel = channel
        self._offline = offline
        self._complete = complete
        self._open: list[Request] = []
        self.reconfigure(drive)

    def reconfigure(self, drive: DriveConfiguration) -> None:
        """Take over what may change while running."""
        self._channel.mailbox.timeout = drive.parameter_timeout
        self._conditions = procedures.Conditions(
            offline=self._offline, timeout=drive.parameter_timeout,
            attempts=drive.parameter_retries + 1,
            addressing=drive.family_options['addressing'],
            word_order=drive.family_options['word_order'])

    @property
    def waiting(self) -> int:
        """Requests behind the one being served."""
        return self._channel.waiting_users

    def add(self, request: Request, now: float) -> None:
        """Queue a request."""
        procedure: Procedure
        if isinstance(request, ReadRequest):
            procedure = procedures.read_parameters(request.parameters, self._conditions)
        elif request.atomic:
            procedure = procedures.write_together(request.items, self._conditions)
        else:
            procedure = procedures.write_parameters(request.items, self._conditions)
        self._open.append(request)

        def done(outcomes: tuple[Outcome, ...]) -> None:
            self._open.remove(request)
            self._complete(request, outcomes)

        self._channel.run(Lane.USERS, procedure, done, now)

    def fail(self, reason: str) -> None:
        """Answer whatever is open, and forget it."""
        self._channel.cancel(Lane.USERS)
        requests, self._open = self._open, []
        for request in requests:
            self._complete(request, (Failure(reason),) * len(request))
