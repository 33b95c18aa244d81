# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The requests of users to one drive, between their arrival and their answer."""

from collections.abc import Callable
from typing import Protocol

from drive_can_bridge.core.events import RequestCompleted
from drive_can_bridge.core.requests import Failure, Outcomes, Request
from drive_can_bridge.core.statistics import DriveStatistics


class RequestServer(Protocol):
    """Serves requests one after the other."""

    @property
    def waiting(self) -> int:
        """How many wait behind the one being served."""

    def serve(self, request: Request, done: Callable[[Outcomes], None], now: float) -> None:
        """Queue a request; ``done`` gets an outcome for each name."""

    def cancel(self) -> None:
        """Forget all of them; nobody is told."""


class RequestDesk:
    """
    Has requests served, and sees that each is answered exactly once.

    :param emit: takes the answers.
    """

    def __init__(self, server: RequestServer, statistics: DriveStatistics,
                 emit: Callable[[RequestCompleted], None]) -> None:
        self._server = server
        self._statistics = statistics
        self._emit = emit
        self._open: list[Request] = []

    @property
    def waiting(self) -> int:
        """How many requests wait behind the one being served."""
        return self._server.waiting

    def serve(self, request: Request, answered: Callable[[Request, Outcomes], None],
              now: float) -> None:
        """
        Have a request served.

        :param answered: called after its answer, unless it fails with all others.
        """
        def done(outcomes: Outcomes) -> None:
            self._open.remove(request)
            self.complete(request, outcomes)
            answered(request, outcomes)

        self._open.append(request)
        self._server.serve(request, done, now)

    def fail_all(self, reason: str) -> None:
        """Forget what is under way, and answer it."""
        self._server.cancel()
        requests, self._open = self._open, []
        for request in requests:
            self.refuse(request, reason)

    def refuse(self, request: Request, reason: str) -> None:
        """Answer a request with the same failure for every name."""
        self.complete(request, (Failure(reason),) * len(request))

    def complete(self, request: Request, outcomes: Outcomes) -> None:
        """Answer a request."""
        for outcome in outcomes:
            if isinstance(outcome, Failure):
                self._statistics.requests_failed += 1
            else:
                self._statistics.requests_ok += 1
        self._emit(RequestCompleted(request, outcomes))
