# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The requests of users to one drive, between their arrival and their answer."""

from collections.abc import Callable
from typing import Protocol

from drive_can_bridge.core import sentences
from drive_can_bridge.core.events import RequestCompleted
from drive_can_bridge.core.requests import Failure, Outcomes, Request
from drive_can_bridge.core.sentences import Sentence
from drive_can_bridge.core.statistics import DriveStatistics

#: requests of one drive that may wait behind the one being served
WAITING_REQUESTS_MAX = 64


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
    Takes requests, has them served, and sees that each is answered exactly once.

    :param emit: takes the answers.
    :param refusal: (now) -> why none are taken; '' if they are.
    :param answered: called after an answer, unless the request failed with all others.
    """

    def __init__(self, server: RequestServer, statistics: DriveStatistics,
                 emit: Callable[[RequestCompleted], None], *, refusal: Callable[[float], Sentence],
                 answered: Callable[[Request, Outcomes], None]) -> None:
        self._server = server
        self._statistics = statistics
        self._emit = emit
        self._refusal = refusal
        self._answered = answered
        self._open: list[Request] = []

    @property
    def waiting(self) -> int:
        """How many requests wait behind the one being served."""
        return self._server.waiting

    def submit(self, request: Request, now: float) -> None:
        """Take a request; it is answered by exactly one ``RequestCompleted``."""
        refusal = self._refusal(now)
        if not refusal and self.waiting >= WAITING_REQUESTS_MAX:
            refusal = sentences.busy()
        if refusal:
            self._refuse(request, refusal)
        elif not len(request):
            self._complete(request, ())
        else:
            self._open.append(request)
            self._server.serve(request, lambda outcomes: self._done(request, outcomes), now)

    def fail_all(self, reason: Sentence) -> None:
        """Forget what is under way, and answer it."""
        self._server.cancel()
        requests, self._open = self._open, []
        for request in requests:
            self._refuse(request, reason)

    def _done(self, request: Request, outcomes: Outcomes) -> None:
        self._open.remove(request)
        self._complete(request, outcomes)
        self._answered(request, outcomes)

    def _refuse(self, request: Request, reason: Sentence) -> None:
        """Answer a request with the same failure for every name."""
        self._complete(request, (Failure(reason),) * len(request))

    def _complete(self, request: Request, outcomes: Outcomes) -> None:
        for outcome in outcomes:
            if isinstance(outcome, Failure):
                self._statistics.requests_failed += 1
            else:
                self._statistics.requests_ok += 1
        self._emit(RequestCompleted(request, outcomes))
