# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Answers to service clients, whether they can be reached or not.

Sending takes the middleware a tenth of a second where it has discovered a caller only halfway, or
where caller and service do not match, which the caller never learns. The interpreter is not held
meanwhile (:mod:`.rcl.services`). The answering thread is, once for each such client: what is
for it afterwards is left to a thread of their own, until one of them arrives.
"""

from collections.abc import Callable
from functools import partial
import threading
from typing import Any
import warnings

from rclpy.service import Service

from drive_can_bridge.clock import Clock, Mailbox
from drive_can_bridge.core import sentences
from drive_can_bridge.ros.rcl.extension import GONE
from drive_can_bridge.ros.rcl.services import RclServices, ReadyResponse, Unreachable
from drive_can_bridge.ros.rcl.unfit import Unfit

#: clients that are remembered as out of reach
CALLERS_MAX = 50
#: answers for one of them that wait; any others are not sent
WAITING_MAX = 2


class ServiceAnswers:
    """
    Sends answers. From any thread.

    :param rcl: direct access to rcl; None: through rclpy only.
    :param warn: logs a warning by topic and text; may be called again and again.
    """

    def __init__(self, rcl: RclServices | None, warn: Callable[[str, str], None],
                 clock: Clock) -> None:
        self._clock = clock
        self._warn = warn
        self._rcl = rcl
        if rcl is None:
            # it tells of callers out of reach by a warning of Python's, with a line of its source
            warnings.filterwarnings('ignore', 'failed to send response', RuntimeWarning)
        self._lock = threading.Lock()
        #: clients out of reach: how many answers for them wait
        self._waiting: dict[bytes, int] = {}
        self._late: Mailbox[Callable[[], None] | None] = Mailbox(clock)
        self._ending = False
        # now: later on there may be no memory for it
        self._thread = clock.worker(self._run, 'late answers')
        if rcl is not None:
            self._thread.start()

    def send(self, service: Service, message: Any, header: Any) -> None:
        """
        Send an answer, in place of ``Service.send_response``.

        :raises TypeError: the message is of another type than the service's answers.
        :raises InvalidHandle: the service is gone.
        :raises RCLError: the context is gone.
        """
        kind: Any = service.srv_type
        if not isinstance(message, kind.Response):
            raise TypeError(f'{service.srv_name}: {type(message).__name__} is no answer')
        rcl = self._rcl
        try:
            response = rcl.prepare(service, message, header) if rcl else None
        except Unfit:   # the request came through rclpy
            response = None
        if rcl is None or response is None:
            Service.send_response(service, message, header)
        elif response.caller in self._waiting:
            self._defer(rcl, response)
        else:
            self._deliver(rcl, response)

    def stop(self) -> None:
        """Stop the thread; answers to unreachable clients that still wait are dropped."""
        with self._lock:
            self._ending = True
        self._late.put(None)
        self._thread.join(5.0)

    def _defer(self, rcl: RclServices, response: ReadyResponse) -> None:
        """Queue an answer for the thread that may wait; drop it when too many wait there."""
        caller = response.caller
        with self._lock:
            waiting = self._waiting.get(caller, 0)
            room = waiting < WAITING_MAX and not self._ending
            if room:
                self._waiting[caller] = waiting + 1
        if room:
            self._late.put(partial(self._deliver_late, rcl, response))
        else:
            self._tell(response.service)

    def _deliver(self, rcl: RclServices, response: ReadyResponse) -> None:
        caller = response.caller
        try:
            rcl.send(response)
        except Unreachable:
            with self._lock:
                self._waiting.setdefault(caller, 0)
                if len(self._waiting) > CALLERS_MAX:
                    del self._waiting[next(iter(self._waiting))]
            self._tell(response.service)
        else:
            if caller in self._waiting:
                with self._lock:
                    self._waiting.pop(caller, None)

    def _tell(self, service: Service) -> None:
        try:
            name = service.service_name
        except GONE:    # meanwhile; the answer is not missed
            return
        self._warn(f'answer of {name}', sentences.answer_not_delivered(name))

    # -- the thread that waits for clients out of reach -------------------------------------------

    def _run(self) -> None:
        while self._do_one_job():
            pass

    def _do_one_job(self) -> bool:
        """Run the next job, then release it; return False at the end."""
        job = self._late.get()
        if job is None or self._ending:
            return False
        job()
        return True

    def _deliver_late(self, rcl: RclServices, response: ReadyResponse) -> None:
        with self._lock:
            if response.caller in self._waiting:
                self._waiting[response.caller] -= 1
        try:
            self._deliver(rcl, response)
        except GONE:    # service or context are gone
            pass
        except Exception as error:  # noqa: BLE001  outermost call of a thread
            self._warn('answer', sentences.internal_error_in_answer(
                kind=type(error).__name__, text=str(error)))
