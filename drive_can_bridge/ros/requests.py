# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Requests of services, whatever the middleware makes of their bytes.

Reading a request takes it some microseconds. There are some whose bytes do not fit, of another
middleware, that take it a minute, or memory until there is no more; or it throws. The interpreter
is not held meanwhile (:mod:`.rcl.services`), so it blocks one thread only: its service thread
is called, to continue with another one.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
import threading
from typing import Any

from rclpy.context import Context
from rclpy.service import Service

from drive_can_bridge.clock import Clock
from drive_can_bridge.core.sentences import (
    request_hangs, request_hung, request_unreadable, requests_hold_up)
from drive_can_bridge.ros.rcl.extension import GONE, RCLError
from drive_can_bridge.ros.rcl.services import RclServices, take_by_rclpy
from drive_can_bridge.ros.rcl.unfit import Unfit

#: s after which others are not kept waiting for a request to be read
HANGS = 0.5

#: called when a request takes long, or (True) when the thread that reads it will never continue
GoOn = Callable[[bool], None]
#: called with a service, and with a function that continues without a thread that takes long;
#: returns the request with its header; None: there is none
Take = Callable[[Service, GoOn], tuple[Any, Any] | None]


def full_name(service: Service) -> str:
    """Return the name of a service in the graph, or, when that is gone, its own."""
    try:
        return str(service.service_name)
    except GONE:
        return str(service.srv_name)


@dataclass(slots=True, eq=False)
class _Taking:
    """
    The request that one thread is taking.

    :ivar thrown: what the middleware threw.
    :ivar told: other threads have continued.
    """

    service: Service
    since: float
    go_on: GoOn
    thrown: str = ''
    told: bool = False


class ServiceRequests:
    """
    Takes requests. In any thread.

    :param rcl: direct access to rcl; None: through rclpy only.
    :param warn: logs a warning.
    :param error: the same.
    """

    def __init__(self, rcl: RclServices | None, warn: Callable[[str], None],
                 error: Callable[[str], None], context: Context, clock: Clock) -> None:
        self._rcl = rcl
        self._context = context
        self._warn = warn
        self._error = error
        self._clock = clock
        self._taking: dict[int, _Taking] = {}   # by thread
        self._wake = clock.wake_event()
        self._idle = True
        self._ending = False
        # now: later on there may be no memory for it
        self._thread = clock.worker(self._run, 'requests')
        if rcl is not None:
            self._thread.start()

    def take(self, service: Service, go_on: GoOn) -> tuple[Any, Any] | None:
        """
        Return the oldest waiting request, with its header; None: there is none that can be read.

        :param go_on: called, by another thread, if this takes long.
        :raises InvalidHandle: the service is gone.
        """
        try:
            if self._rcl is not None:
                try:
                    return self._take(self._rcl, service, go_on)
                except Unfit as error:
                    self._rcl = None
                    self._warn(requests_hold_up(str(error)))
            return take_by_rclpy(service)
        except RCLError as error:
            if self._context.ok():
                self._error(request_unreadable(full_name(service), str(error)))
            return None

    def _take(self, rcl: RclServices, service: Service, go_on: GoOn) -> tuple[Any, Any] | None:
        own, taking = threading.get_ident(), _Taking(service, self._clock.now(), go_on)
        self._taking[own] = taking
        if self._idle:
            self._idle = False
            self._wake.ring()
        try:
            return rcl.take(service, partial(self._threw, taking))
        finally:
            self._taking.pop(own, None)
            if taking.told:
                self._warn(request_hung(full_name(service), self._clock.now() - taking.since))

    def _threw(self, taking: _Taking, what: str) -> None:
        taking.thrown = what
        self._wake.ring()

    def stop(self) -> None:
        """Stop the thread."""
        self._ending = True
        self._wake.ring()
        self._thread.join(5.0)

    # -- the thread that measures how long it takes -----------------------------------------------

    def _run(self) -> None:
        while not self._ending:
            self._idle = True
            if self._taking:    # or one that began just now
                self._idle = False
            else:
                self._wake.wait()
            self._wake.wait(self._clock.now() + HANGS)
            for own, taking in list(self._taking.items()):
                self._look(own, taking)

    def _look(self, own: int, taking: _Taking) -> None:
        if taking.told and not taking.thrown or (
                not taking.thrown and self._clock.now() < taking.since + HANGS):
            return
        name = full_name(taking.service)
        try:
            taking.go_on(bool(taking.thrown))
        except RuntimeError:    # no thread can be started; tried again
            return
        if taking.thrown:
            self._taking.pop(own, None)
            self._error(request_unreadable(name, taking.thrown))
        elif not taking.told:
            self._warn(request_hangs(name, HANGS))
        taking.told = True
