# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Answers to callers that the middleware does not reach, and to all others."""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
import threading
from typing import Any

from bridges import Bridge, LIFT, parameters, StartBridge
from clients import Client, ClientContext, LATCHED, wait_until
from clocks import REAL
import pytest
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.qos import qos_profile_parameters
from rclpy.service import Service
from saying import says
from std_srvs.srv import Trigger
from waiting import clock
from world import World

from drive_can_bridge.ros import bridge_node
from drive_can_bridge.ros.answers import ServiceAnswers, WAITING_MAX
from drive_can_bridge.ros.rcl import services as rcl_module
from drive_can_bridge.ros.rcl.incoming import PolledGroup
from drive_can_bridge.ros.rcl.services import RclServices, ReadyResponse, Unreachable
from drive_can_bridge.ros.rcl.unfit import Unfit
from drive_can_bridge.ros.requests import ServiceRequests
from drive_can_bridge.ros.threads import ServiceThread

#: what DDS does (test/real.py)
REAL_DDS = pytest.mark.real
#: a hundred of them would fit into the wait of the middleware
TICK = 0.001
#: so many show that the interpreter was not held: where it is, one gets in on the way out
TICKS = 5
#: s between two calls of somebody who is never answered
AGAIN = 0.3


class Ticks:
    """What another thread gets done."""

    def __init__(self) -> None:
        self.count = 0
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._ending.wait(TICK):
            self.count += 1

    def stop(self) -> None:
        """End."""
        self._ending.set()
        self._thread.join()


@pytest.fixture(name='ticks')
def _ticks() -> Iterator[Ticks]:
    ticks = Ticks()
    yield ticks
    ticks.stop()


@pytest.fixture(name='told')
def _told() -> list[str]:
    return []


@contextmanager
def sending(rcl: Any, told: list[str]) -> Iterator[ServiceAnswers]:
    """Have answers sent by this."""
    answers = ServiceAnswers(rcl, lambda _, text: told.append(text), clock())
    yield answers
    answers.stop()


@pytest.fixture(name='answers')
def _answers(told: list[str]) -> Iterator[ServiceAnswers]:
    with sending(RclServices(), told) as answers:
        yield answers


def _services(bridge: Bridge) -> list[Service]:
    """Return all services of a bridge's process."""
    return [service for node in (bridge.node, *(drive.node for drive in
                                                bridge.node.drives.values()))
            for service in node.services]


def _call_until(caller: Any, kind: Any, condition: Callable[[], Any]) -> None:
    """Call a service that never answers, again and again: nobody says when it is found."""
    due = 0.0

    def look() -> Any:
        nonlocal due
        if clock().now() >= due:
            caller.call_async(kind.Request())
            due = clock().now() + AGAIN
        return condition()
    wait_until(look, what=f'{caller.srv_name} to be called')


def _warnings(recwarn: pytest.WarningsRecorder) -> list[str]:
    return [str(warning.message) for warning in recwarn
            if issubclass(warning.category, RuntimeWarning)]


@REAL_DDS
def test_no_answer_of_the_process_holds_the_interpreter_for_a_caller_out_of_reach(
        bridge: StartBridge, client: Client, ticks: Ticks, monkeypatch: pytest.MonkeyPatch,
        recwarn: pytest.WarningsRecorder, capfd: pytest.CaptureFixture[str]) -> None:
    # the most of any call: on a busy machine a thread that wants to go on may still have to wait
    missed = Counter[str]()
    send = RclServices.send

    def watched(self: RclServices, response: ReadyResponse) -> None:
        before = ticks.count
        try:
            send(self, response)
        except Unreachable:
            name = response.service.service_name
            missed[name] = max(missed[name], ticks.count - before)
            raise
    monkeypatch.setattr(RclServices, 'send', watched)
    one = bridge(parameters(lift=LIFT))
    client.listen()
    services = _services(one)
    names = {service.service_name for service in services}
    assert {'/lift/get_parameters', '/lift/set_parameters', '/lift/quick_stop', '/lift/enable',
            '/drive_can_bridge/change_state', '/drive_can_bridge/get_state',
            '/drive_can_bridge/get_transition_graph', '/drive_can_bridge/set_parameters',
            '/drive_can_bridge/set_logger_levels', '/drive_can_bridge/save_trace'} <= names
    callers = [(client.node.create_client(service.srv_type, service.service_name,
                                          qos_profile=LATCHED), service) for service in services]
    for caller, service in callers:
        _call_until(caller, service.srv_type,
                    lambda name=service.service_name: missed[name] >= TICKS)
    client.wait_logged('an answer of /lift/quick_stop could not be delivered')
    assert not _warnings(recwarn)
    shown = capfd.readouterr().err
    assert not any(word in shown for word in ('Traceback', 'Warning', 'error_handling')), shown


@REAL_DDS
def test_others_are_answered_as_ever_and_as_by_rclpy(
        bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    one = bridge(parameters(lift=LIFT))
    sent: list[str] = []
    send = RclServices.send
    # noted first: who has the answer goes on while the sender may still wait for its turn
    monkeypatch.setattr(RclServices, 'send', lambda self, response: (
        sent.append(response.service.service_name), send(self, response)))
    kinds = {service.service_name: service.srv_type for service in _services(one)}
    ours = {name: client.call(name, kind) for name, kind in kinds.items()}
    assert set(sent) == kinds.keys()
    assert client.transition(label='deactivate') and client.state() == 'inactive'
    assert client.transition(label='activate') and client.state() == 'active'
    one.online()

    def refuse(*_: Any) -> None:
        raise Unfit('for a test')
    monkeypatch.setattr(RclServices, 'take', refuse)
    sent.clear()
    assert {name: client.call(name, kind) for name, kind in kinds.items()} == ours
    assert not sent


class Caller:
    """A service in a thread of its own, and somebody who calls it."""

    def __init__(self, client: Client, context: ClientContext, answers: ServiceAnswers,
                 name: str) -> None:
        self.client = client
        self.errors: list[str] = []
        self.service = client.node.create_service(
            Trigger, name, lambda *_: None, callback_group=PolledGroup(),
            qos_profile=qos_profile_parameters)
        self.requests = ServiceRequests(answers._rcl, self.errors.append, self.errors.append,
                                        context.context, REAL)
        self.thread = ServiceThread('control', context.context, self.errors.append, REAL,
                                    send=answers.send, take=self.requests.take)
        self.thread.serve(self.service, lambda _, answer: answer(
            Trigger.Response(success=True, message='an answer')))

    def ask(self) -> str:
        """Return the answer."""
        name = self.service.service_name
        # it is in this process: discovery is complete when both ends have met
        caller = self.client.node.create_client(Trigger, name, qos_profile=qos_profile_parameters)
        wait_until(caller.service_is_ready)
        future = caller.call_async(Trigger.Request())
        wait_until(future.done)
        return str(future.result().message)


@contextmanager
def called(client: Client, context: ClientContext, answers: ServiceAnswers,
           name: str) -> Iterator[Caller]:
    """Offer a service, and call it."""
    caller = Caller(client, context, answers, name)
    yield caller
    caller.thread.stop()
    caller.requests.stop()
    assert not caller.errors


@pytest.fixture(name='caller')
def _caller(client: Client, _client_context: ClientContext,
            answers: ServiceAnswers) -> Iterator[Caller]:
    with called(client, _client_context, answers, '~/asked') as caller:
        yield caller


def _no_library(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rclpy_implementation, '__file__', '/no/such.so')


def _no_function(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rclpy_implementation, '__file__', 'libc.so.6')


def _no_capsule(monkeypatch: pytest.MonkeyPatch) -> None:
    address = rcl_module._address
    monkeypatch.setattr(rcl_module, '_address', lambda kind, name: address(int, name))


def _other_messages(monkeypatch: pytest.MonkeyPatch) -> None:
    def layout_of(kind: Any) -> Any:
        raise Unfit('fields of type wstring')
    monkeypatch.setattr(rcl_module, 'layout_of', layout_of)


@REAL_DDS
@pytest.mark.parametrize('unfit', [_no_library, _no_function, _no_capsule, _other_messages])
def test_rclpy_takes_and_answers_where_anything_is_other_than_expected(
        client: Client, _client_context: ClientContext, told: list[str],
        monkeypatch: pytest.MonkeyPatch, unfit: Callable[[pytest.MonkeyPatch], None]) -> None:
    unfit(monkeypatch)
    rcl, why_relayed = bridge_node._rcl_services(
        list(client.node.services), client.node.context, told.append)
    assert rcl is None and not why_relayed
    line, = told
    assert line == says('requests_hold_up')
    with sending(rcl, told) as answers, \
            called(client, _client_context, answers, f'~/{unfit.__name__}') as caller:
        assert [caller.ask(), caller.ask()] == ['an answer'] * 2


@REAL_DDS
def test_rclpy_goes_on_where_headers_are_other_than_expected(
        client: Client, _client_context: ClientContext, answers: ServiceAnswers,
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rcl_module, '_NUMBER_MAX', 0)
    with called(client, _client_context, answers, '~/other_header') as caller:
        name = caller.service.service_name
        one = client.node.create_client(Trigger, name, qos_profile=qos_profile_parameters)
        wait_until(one.service_is_ready)
        one.call_async(Trigger.Request())   # which nobody can answer
        wait_until(lambda: caller.errors)
        assert [caller.ask(), caller.ask()] == ['an answer'] * 2
        assert caller.errors == [says('requests_hold_up')]
        caller.errors.clear()


@REAL_DDS
def test_python_does_not_warn_where_rclpy_answers(
        _client_context: ClientContext, client: Client, told: list[str],
        monkeypatch: pytest.MonkeyPatch, recwarn: pytest.WarningsRecorder) -> None:
    sent: list[int] = []
    send = Service.send_response
    monkeypatch.setattr(Service, 'send_response',
                        lambda *arguments: (send(*arguments), sent.append(1)))
    with sending(None, told) as answers, \
            called(client, _client_context, answers, '~/asked') as caller:
        lost = client.node.create_client(Trigger, caller.service.service_name,
                                         qos_profile=LATCHED)
        _call_until(lost, Trigger, lambda: sent)
    assert not _warnings(recwarn)


@REAL_DDS
def test_a_service_may_be_destroyed_while_its_answer_is_sent(
        caller: Caller, client: Client, told: list[str], ticks: Ticks,
        monkeypatch: pytest.MonkeyPatch) -> None:
    over: list[bool] = []
    send = RclServices.send

    def watched(self: RclServices, response: ReadyResponse) -> None:
        def destroy() -> None:
            before = ticks.count
            while ticks.count < before + TICKS:
                pass
            client.node.destroy_service(response.service)
            over.append(False)
        thread = threading.Thread(target=destroy)
        thread.start()
        try:
            send(self, response)
        finally:
            over.append(True)
            thread.join()
    monkeypatch.setattr(RclServices, 'send', watched)
    name = caller.service.service_name
    lost = client.node.create_client(Trigger, name, qos_profile=LATCHED)
    _call_until(lost, Trigger, lambda: len(over) == 2)
    assert over == [False, True]
    caller.thread.forget([caller.service])
    wait_until(lambda: not client.node.count_services(name))
    assert not told     # nobody misses that answer


class FakeRcl:
    """Reaches some callers only."""

    def __init__(self) -> None:
        self.lost = {b'lost'}
        self.go_on = False
        self.sent: list[tuple[bytes, Any, str]] = []

    def prepare(self, service: Any, message: Any, header: bytes) -> Any:
        """Return something with a caller."""
        return ReadyResponse(service, message, None, None, header)    # type: ignore[arg-type]

    def send(self, response: ReadyResponse) -> None:
        """Wait for callers out of reach, but for the first time."""
        late = threading.current_thread().name == 'late answers'
        if late:
            wait_until(lambda: self.go_on)
        if response.caller in self.lost:
            raise Unreachable
        self.sent.append((response.caller, response.message, 'late' if late else 'at once'))


class FakeService:
    """Says who it is."""

    srv_name = service_name = '/lift/get_parameters'

    class srv_type:  # noqa: N801  as in rclpy
        """Its answers are numbers."""

        Response = int


@pytest.fixture(name='rcl')
def _rcl() -> FakeRcl:
    return FakeRcl()


@pytest.fixture(name='late_answers')
def _late_answers(bench: World, rcl: FakeRcl, told: list[str]) -> Iterator[ServiceAnswers]:
    with sending(rcl, told) as answers:
        yield answers


def test_a_client_out_of_reach_delays_others_once(
        rcl: FakeRcl, late_answers: ServiceAnswers, told: list[str]) -> None:
    answers = late_answers
    service: Any = FakeService()
    answers.send(service, 0, b'lost')
    assert told == [says('answer_not_delivered', service=service.srv_name)]
    for number in range(WAITING_MAX + 1):   # another thread waits with the first of them
        answers.send(service, number, b'lost')
    answers.send(service, 7, b'other')
    assert rcl.sent == [(b'other', 7, 'at once')]
    for number in range(WAITING_MAX + 2):   # more than that are not kept
        answers.send(service, number, b'lost')
    assert len(told) >= 2 and len(set(told)) == 1
    rcl.lost.clear()                        # it was discovered only halfway
    rcl.go_on = True
    wait_until(lambda: {(b'lost', 0, 'late'), (b'lost', 1, 'late')} <= {*rcl.sent})
    wait_until(lambda: b'lost' not in answers._waiting)
    answers.send(service, 8, b'lost')
    assert (b'lost', 8, 'at once') in rcl.sent
    with pytest.raises(TypeError):
        answers.send(service, 'no number', b'other')


def test_what_waits_for_clients_out_of_reach_does_not_outlast_the_end(
        rcl: FakeRcl, late_answers: ServiceAnswers) -> None:
    answers = late_answers
    service: Any = FakeService()
    for number in range(3):
        answers.send(service, number, b'lost')
    rcl.lost.clear()
    ending = clock().worker(answers.stop, 'ending')
    ending.start()
    wait_until(lambda: answers._ending)
    rcl.go_on = True
    ending.join(60.0)
    assert not ending.is_alive() and len(rcl.sent) <= 1
    answers.send(service, 4, b'other')      # who is in reach is answered to the end
    assert rcl.sent[-1] == (b'other', 4, 'at once')
