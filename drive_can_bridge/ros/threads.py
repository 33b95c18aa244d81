# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Threads of the bridge: of an executor, of what is periodic, of services that must not wait.

An executor serves one callback after the other, and checks everything else that it has in between:
several times for each call that has to wait for its drive, and a client that asks for a thousand
parameters is served before one that wants a stop. So services of drives are taken by threads that
do nothing else, straight from a wait set of their own; those that stop machines by a separate one.
Answers are sent by another one: where a caller has been discovered only halfway, sending takes the
middleware a tenth of a second (:mod:`.answers`).
"""

from collections import Counter, deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from inspect import isawaitable
import math
import threading
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.executors import ExternalShutdownException, ShutdownException, SingleThreadedExecutor
from rclpy.service import Service

from drive_can_bridge.clock import Clock, Mailbox, Worker
from drive_can_bridge.core import sentences
from drive_can_bridge.ros.coroutines import Answer, go_on
from drive_can_bridge.ros.rcl.extension import GONE
from drive_can_bridge.ros.rcl.incoming import PolledGroup
from drive_can_bridge.ros.rcl.relay import Relay
from drive_can_bridge.ros.rcl.services import take_by_rclpy
from drive_can_bridge.ros.rcl.waiting import Sleeping, Waiting
from drive_can_bridge.ros.requests import full_name, Take

#: s between two failures: one that comes at once again must not take the machine
ERROR_PAUSE = 0.05
#: s after which nothing can be missing any more because a drive has left
LEAVING = 1.0
#: share of the processor's time for a thread that clients can keep busy
MODEST = 0.3
#: calls of one service that are taken in a row
TAKE_MAX = 8
#: s that the end waits for a request that is being taken, or an answer
STOP_PATIENCE = 1.0
#: threads that the requests of one service may stop for ever: each keeps its stack
STOPPED_MAX = 3

#: called with a request, and with the function for its response
Callback = Callable[[Any, Answer], None]
#: called with service, response and the header of the request
Send = Callable[[Service, Any, Any], None]


class ExecutorThread:
    """
    Spins a SingleThreadedExecutor until stopped; an exception in a callback does not end it.

    A future of rclpy must be completed in its executor's own thread; completing it elsewhere races
    with the executor's wait. Results of other threads are left here.

    :param report: logs one line about an exception of a callback.
    """

    def __init__(self, name: str, report: Callable[[str], None], context: Context,
                 clock: Clock) -> None:
        self._clock = clock
        self.executor = SingleThreadedExecutor(context=context)
        self._report = report
        self._stopping = False
        self._left_at = -math.inf
        self._ending = threading.Lock()
        self._name = name
        self._thread = clock.worker(self._run, name)
        #: the one that drives are in
        self.of_drives = self

    def start(self) -> None:
        """Start to serve."""
        self._thread.start()
        if self.of_drives is not self:
            self.of_drives.start()

    def part(self) -> None:
        """Serve drives in an executor of their own, unblocked by transitions. Before the start."""
        self.of_drives = ExecutorThread(f'{self._name} of drives', self._report,
                                        self.executor.context, self._clock)

    def later(self, job: Callable[..., object], *arguments: Any) -> None:
        """Run a job in this thread soon. From any thread; dropped once it stops."""
        with self._ending:
            if not self._stopping:
                self.executor.create_task(job, *arguments)

    def leaves(self) -> None:
        """Record that a drive leaves, whose entities may be due. From any thread."""
        self._left_at = self.of_drives._left_at = self._clock.now()

    def stop(self) -> None:
        """Stop to serve, and wait for the callback that is running."""
        # an executor that is merely woken returns to waiting without checking
        self.later(self._end)
        with self._ending:
            self._stopping = True
        self._thread.join(5.0)
        self.executor.shutdown(timeout_sec=1.0)
        if self.of_drives is not self:
            self.of_drives.stop()

    def _end(self) -> None:
        self._stopping = True

    def _run(self) -> None:
        while not self._stopping and self.executor.context.ok():
            try:
                self.executor.spin_once()
            except (ExternalShutdownException, ShutdownException):
                return
            except Exception as error:  # noqa: BLE001  outermost loop: no failure is silent
                if self._stopping:
                    return
                now = self._clock.now()
                if not isinstance(error, InvalidHandle) or now > self._left_at + LEAVING:
                    self._report(sentences.internal_error_in_callback(
                        kind=type(error).__name__, text=str(error)))
                self._clock.wait(now + ERROR_PAUSE)


class PeriodicThread:
    """
    Calls ``action`` every ``period`` s of the steady clock, for the first time after one.

    A timer of rclpy would do as well. But each time it is due the executor checks every service
    of every drive: 12 ms of computing for 15 drives, beside an exchange that wants the
    interpreter every 0.3 ms.

    :param failed: logs one line about an exception of ``action``.
    """

    def __init__(self, name: str, period: float, action: Callable[[], None],
                 failed: Callable[[str], None], clock: Clock) -> None:
        self._period = period
        self._now = clock.now
        self._action = action
        self._failed = failed
        self._changed = clock.wake_event()   # an Event costs more than many an action
        self._ending = False
        self._thread = clock.worker(self._run, name)

    def start(self) -> None:
        """Start."""
        self._thread.start()

    def set_period(self, period: float) -> None:
        """Start over with another period, in s."""
        self._period = period
        self._changed.ring()

    def stop(self) -> None:
        """Stop, and wait for a call that is under way."""
        self._ending = True
        self._changed.ring()
        self._thread.join(5.0)

    def _run(self) -> None:
        due = self._now() + self._period
        while not self._ending:
            if self._changed.wait(due):
                due = self._now() + self._period
                continue
            try:
                self._action()
            except Exception as error:  # noqa: BLE001  outermost loop of a thread
                self._failed(f'{type(error).__name__}: {error}')
            due = max(due + self._period, self._now())  # never twice to catch up


class CpuThrottle:
    """
    Pauses a thread that has used more than its share. Created and used by that thread.

    One thread at a time has the interpreter. One that never waits, because callers ask as fast as
    they are answered, makes the exchange late and stops wait, however high their priority is.

    :param share: of the processor's time, 0 to 1.
    :param in_hand: s that may be used at once, after a while of little work.
    """

    def __init__(self, share: float, clock: Clock, in_hand: float = 0.002) -> None:
        self._clock = clock
        self._share = share
        self._in_hand = in_hand
        self._left = in_hand
        self._seen = clock.now()
        self._used = clock.used()

    def keep(self) -> None:
        """Pause, if it is time to. Called after each piece of work."""
        now, used = self._clock.now(), self._clock.used()
        self._left = min(self._in_hand, self._left + self._share * (now - self._seen)) - (
            used - self._used)
        self._seen, self._used = now, used
        if self._left < 0.0:
            self._clock.wait(now - self._left / self._share)


class _RequestTaker:
    """
    One of the threads that take requests; all but the last are still taking one.

    :ivar changed: the services have changed since it began to wait.
    :ivar superseded: another one has continued.
    :ivar without: the service whose request it is taking since, which others leave out.
    """

    def __init__(self, waiting: Waiting | Sleeping) -> None:
        self.waiting = waiting
        self.wake = waiting.wake    # has it look what there is to do
        self.changed = self.superseded = False
        self.without: Service | None = None

    def change(self) -> None:
        """Make it check which services there are."""
        self.changed = True
        self.wake()


class ServiceThread:
    """
    Serves services whose callback group keeps them from executors.

    Starts with the first service. No thread waits for answers: a callback has to be short.

    :param report: logs one line about an exception of a callback.
    :param prepare_thread: called first in each thread that takes requests.
    :param share: of the processor's time that each of its two threads may use; 1: all of it.
    :param send: sends an answer.
    :param take: takes a request; where that takes long another thread serves all other services.
    :param relay: makes an executor take the requests, and send the answers; None: this does.
    """

    def __init__(self, name: str, context: Context, report: Callable[[str], None], clock: Clock,
                 prepare_thread: Callable[[], object] = lambda: None, *, share: float = MODEST,
                 send: Send = Service.send_response,
                 take: Take = lambda service, _: take_by_rclpy(service),
                 relay: Relay | None = None) -> None:
        self._name = name
        self._clock = clock
        self._send_response = send
        self._take_request = take
        self._share = share
        self._context = context
        self._report = report
        self._prepare_thread = prepare_thread
        self._served: dict[Service, tuple[Callback, Callable[[], None]]] = {}
        self._stopped_threads: Counter[Service] = Counter()
        self._jobs: Mailbox[Callable[[], None] | None] = Mailbox(clock)
        self._begun: deque[Callable[[], None]] = deque()
        self._relay = relay
        self._taker = self._new_taker()
        self._superseded: set[_RequestTaker] = set()
        self._ending = False
        self._threads: list[Worker] = []

    def serve(self, service: Service, callback: Callback,
              answered: Callable[[], None] = lambda: None) -> None:
        """
        Start to serve a service.

        :param answered: called after each response was sent.
        """
        self._served[service] = callback, answered
        if not self._threads:
            self._threads = [
                self._clock.worker(partial(self._take_all, self._taker), self._name),
                self._clock.worker(self._answer_all, f'{self._name}, answering')]
            for thread in self._threads:
                thread.start()
        if self._relay is not None:
            self._relay.serve(service, partial(self._relayed, service, callback), answered)
        self._taker.change()

    def later(self, job: Callable[[], None]) -> None:
        """Run a job in the answering thread. From any thread."""
        self._jobs.put(job)

    def begin(self, job: Callable[[], None]) -> None:
        """Run a job of the local way in the thread that takes requests. From any thread."""
        self._begun.append(job)
        self._taker.wake()

    def forget(self, services: list[Service]) -> None:
        """Stop to serve them; they may be destroyed then."""
        for service in services:
            self._served.pop(service, None)
            if self._relay is not None:
                service.callback_group = PolledGroup()
        self._taker.change()

    def stop(self) -> None:
        """Stop, when all answers have been sent."""
        self._ending = True
        self._taker.change()
        self._jobs.put(None)
        for thread in self._threads:
            thread.join(STOP_PATIENCE)
        self._threads.clear()
        self._taker.waiting.close()

    def _new_taker(self) -> _RequestTaker:
        return _RequestTaker(Waiting(self._context) if self._relay is None
                             else Sleeping(self._clock.wake_event()))

    def _relayed(self, service: Service, callback: Callback, request: Any,
                 answer: Callable[[Any], None]) -> None:
        """Start a callback for a request that the executor has taken."""
        kind = service.srv_type
        self.begin(partial(callback, request, lambda message: answer(
            response_to(kind, request, message) if isinstance(message, Exception) else message)))

    # -- the thread that takes --------------------------------------------------------------------

    def _take_all(self, taker: _RequestTaker) -> None:
        self._prepare_thread()
        throttle = CpuThrottle(self._share, self._clock)
        while self._goes_on(taker):
            try:
                self._take_while_unchanged(taker, throttle)
            except Exception as error:  # noqa: BLE001  outermost loop: no failure is silent
                if self._ending:
                    return
                self._report(sentences.internal_error_in_callback(
                    kind=type(error).__name__, text=str(error)))
                self._clock.wait(self._clock.now() + ERROR_PAUSE)
        if taker.superseded:
            taker.waiting.close()
            self._superseded.discard(taker)
            self._taker.change()

    def _goes_on(self, taker: _RequestTaker) -> bool:
        return not self._ending and not taker.superseded and bool(self._context.ok())

    def _take_while_unchanged(self, taker: _RequestTaker, throttle: CpuThrottle) -> None:
        """Handle requests until the services change."""
        taker.changed = False
        without = {other.without for other in self._superseded.copy()}
        with taker.waiting.held([] if self._relay is not None else [
                service for service in list(self._served) if service not in without]) as wait:
            while not taker.changed and self._goes_on(taker):
                ready = wait()
                while self._begun:
                    self._begun.popleft()()
                for service in ready:
                    self._take(taker, service)
                throttle.keep()

    def _take(self, taker: _RequestTaker, service: Service) -> None:
        for _ in range(TAKE_MAX):
            served = self._served.get(service)
            if served is None or taker.superseded:
                return
            taken = self._take_request(service, partial(self._supersede, taker, service))
            if taken is None:
                return
            request, header = taken
            callback, answered = served
            callback(request, partial(self._answer, service, request, header, answered))

    def _supersede(self, taker: _RequestTaker, service: Service, for_ever: bool) -> None:
        """
        Start another thread for the requests of all other services.

        :param for_ever: this one will never continue; then that one takes those of this, too.
        :raises RuntimeError: no thread can be started.
        """
        if not taker.superseded:
            successor = self._new_taker()
            thread = self._clock.worker(partial(self._take_all, successor), self._name)
            taker.superseded, taker.without = True, service
            self._superseded.add(taker)
            try:
                thread.start()
            except RuntimeError:
                taker.superseded = False
                self._superseded.discard(taker)
                raise
            self._taker, self._threads[0] = successor, thread
            successor.wake()    # for what was to be begun meanwhile
        if for_ever:
            self._superseded.discard(taker)
            self._stopped_threads[service] += 1
            if self._stopped_threads[service] >= STOPPED_MAX:
                self._served.pop(service, None)
                self._report(sentences.service_given_up(full_name(service), STOPPED_MAX))
            self._taker.change()

    # -- the thread that answers ------------------------------------------------------------------

    def _answer(self, service: Service, request: Any, header: Any,
                answered: Callable[[], None], message: Any) -> None:
        """Queue an answer. From any thread."""
        self._jobs.put(partial(self._send, service, request, header, answered, message))

    def _send(self, service: Service, request: Any, header: Any, answered: Callable[[], None],
              message: Any) -> None:
        if isinstance(message, Exception):
            message = response_to(service.srv_type, request, message)
        try:
            self._send_response(service, message, header)
        except GONE:   # service or context are gone
            pass
        except Exception as error:  # the answer cannot be sent as it is
            with suppress(*GONE):
                self._send_response(service, response_to(service.srv_type, request, error), header)
            raise
        finally:
            answered()

    def _answer_all(self) -> None:
        throttle = CpuThrottle(self._share, self._clock)
        while self._do_one_job():
            throttle.keep()

    def _do_one_job(self) -> bool:
        """Run the next job, then release it and its drive; return False at the end."""
        job = self._jobs.get()
        if job is None:
            return False
        try:
            job()
        except Exception as error:  # noqa: BLE001  outermost loop: no failure is silent
            self._report(sentences.internal_error_in_answer(type(error).__name__, str(error)))
        return True


def response_to(kind: Any, request: Any, error: Exception) -> Any:
    """Return the response that reports an error, where its type has a field for it."""
    response, text = kind.Response(), f'internal error: {type(error).__name__}: {error}'
    if hasattr(response, 'message'):
        response.message = text
    elif kind is SetParametersAtomically:
        response.result.reason = text
    elif kind is SetParameters:     # as many as were asked for
        response.results = [SetParametersResult(reason=text) for _ in request.parameters]
    return response


class ExecutorServices:
    """
    Services of a node whose callbacks run in an executor, and whose requests are taken elsewhere.

    :param thread: takes their requests.
    """

    def __init__(self, thread: ServiceThread, spinner: ExecutorThread) -> None:
        self._thread = thread
        self._spinner = spinner

    def adopt(self, services: Iterable[Service]) -> None:
        """Start to serve services."""
        for service in services:
            service.callback_group = PolledGroup()
            kind: Any = service.srv_type
            self._thread.serve(service, partial(
                self._spinner.later, self._serve, service.callback, kind.Response))

    def leave(self, service: Service, then: Callable[[], object]) -> None:
        """Stop serving a service; ``then`` runs when its answers have been sent."""
        self._thread.forget([service])
        self._thread.later(partial(self._spinner.later, then))

    def _serve(self, callback: Callable[[Any, Any], Any], kind: Callable[[], Any], request: Any,
               answer: Answer) -> None:
        try:
            response = callback(request, kind())
        except Exception as error:
            answer(error)
            raise
        if isawaitable(response):
            coroutine: Any = response
            go_on(coroutine, self._spinner.later, answer)
        else:
            answer(response)
