# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The parameter requests of users on their way through the acyclic channel."""

from collections.abc import Callable

from drive_can_bridge.configuration.model import DriveConfiguration
from drive_can_bridge.core.requests import Failure, Outcome, ReadRequest, Request
from drive_can_bridge.protocols.datamodel import procedures
from drive_can_bridge.protocols.datamodel.channel import AcyclicChannel, Lane, Procedure


class UserRequests:
    """
    Turns requests into procedures, and sees to it that each is answered once.

    :param offline: tells whether nobody is there.
    :param offset: added to parameter numbers on the wire.
    :param together: parameters that fit one write frame.
    :param complete: takes a request and one outcome for each of its parameters.
    """

    def __init__(self, channel: AcyclicChannel, drive: DriveConfiguration, *,
                 offline: Callable[[], bool], offset: int, together: int,
                 complete: Callable[[Request, tuple[Outcome, ...]], None]) -> None:
        self._channel = channel
        self._offline = offline
        self._offset = offset
        self._together = together
        self._complete = complete
        self._open: list[Request] = []
        self.reconfigure(drive)

    def reconfigure(self, drive: DriveConfiguration) -> None:
        """Take over what may change while running."""
        self._channel.timeout = drive.parameter_timeout
        self._conditions = procedures.Conditions(
            offline=self._offline, timeout=drive.parameter_timeout,
            attempts=drive.parameter_retries + 1, verify=drive.verify_writes,
            offset=self._offset, together=self._together)

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

        self._channel.run(procedure, done, now, Lane.USERS)

    def fail(self, reason: str) -> None:
        """Answer whatever is open. The channel was cleared."""
        requests, self._open = self._open, []
        for request in requests:
            self._complete(request, (Failure(reason),) * len(request))
