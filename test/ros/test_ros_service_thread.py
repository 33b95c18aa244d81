# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Services served by a thread of their own."""

from collections.abc import Iterator
from typing import Any

from clients import Client, ClientContext, wait_until
import pytest
from rcl_interfaces.msg import Parameter, SetParametersResult
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from rclpy.exceptions import InvalidHandle
from rclpy.qos import qos_profile_parameters
from std_srvs.srv import Trigger
from waiting import clock

from drive_can_bridge.ros.coroutines import Answer, Awaited
from drive_can_bridge.ros.drive_services import CoroutineServices
from drive_can_bridge.ros.rcl.incoming import PolledGroup
from drive_can_bridge.ros.threads import ExecutorThread, ServiceThread


@pytest.fixture(name='errors')
def _errors() -> list[str]:
    return []


@pytest.fixture(name='thread')
def _thread(_client_context: ClientContext, errors: list[str]) -> Iterator[ServiceThread]:
    thread = ServiceThread('control', _client_context.context, errors.append, clock())
    yield thread
    thread.stop()


def test_answers_when_the_callback_says(client: Client, thread: ServiceThread,
                                        errors: list[str]) -> None:
    waiting: list[Answer] = []
    sent: list[int] = []
    services = [client.node.create_service(
        Trigger, f'~/{name}', lambda *_: None, callback_group=PolledGroup(),
        qos_profile=qos_profile_parameters) for name in ('later', 'broken', 'gone')]

    def fail(request: Any, answer: Answer) -> None:
        raise ZeroDivisionError('a defect')
    thread.serve(services[0], lambda _, answer: waiting.append(answer), lambda: sent.append(1))
    thread.serve(services[1], fail)
    thread.serve(services[2], fail)
    thread.forget([services[2]])
    callers = [client.node.create_client(Trigger, f'{client.full_name}/{name}',
                                         qos_profile=qos_profile_parameters)
               for name in ('later', 'broken', 'gone')]
    wait_until(lambda: all(caller.service_is_ready() for caller in callers))
    broken, gone = (caller.call_async(Trigger.Request()) for caller in callers[1:])
    wait_until(lambda: errors == ['internal error in a callback: ZeroDivisionError: a defect'])
    futures = [callers[0].call_async(Trigger.Request()) for _ in range(2)]
    wait_until(lambda: len(waiting) == 2)       # one that fails keeps nobody from being served
    assert not any(future.done() for future in futures) and not sent
    for number, answer in enumerate(waiting):
        answer(Trigger.Response(success=True, message=str(number)))
    wait_until(lambda: len(sent) == 2 and all(future.done() for future in futures))
    assert [future.result().message for future in futures] == ['0', '1']
    assert not broken.done() and not gone.done()


def test_who_asks_for_what_has_a_defect_is_told(client: Client, thread: ServiceThread,
                                                errors: list[str]) -> None:
    """At once, after a wait, and where the answer is none; by words where there is room."""
    async def at_once(*_: Any) -> Any:
        raise ZeroDivisionError('a defect')

    async def after_a_wait(*_: Any) -> Any:
        await Awaited[int](lambda answer: answer(1))
        raise ZeroDivisionError('a defect')

    async def none(*_: Any) -> Any:
        return 'none'
    values = [Parameter(name=name) for name in 'ab']
    calls = {
        'at_once': (Trigger, at_once, Trigger.Request()),
        'after_a_wait': (Trigger, after_a_wait, Trigger.Request()),
        'none': (Trigger, none, Trigger.Request()),
        'each': (SetParameters, at_once, SetParameters.Request(parameters=values)),
        'all': (SetParametersAtomically, at_once,
                SetParametersAtomically.Request(parameters=values)),
        'get': (GetParameters, at_once, GetParameters.Request(names=['a']))}
    services = CoroutineServices(client.node, thread, {
        name: (kind, callback) for name, (kind, callback, _) in calls.items()})
    services.serve()
    found: dict[str, Any] = {}
    for name, (kind, _, request) in calls.items():
        caller = client.node.create_client(kind, f'{client.full_name}/{name}',
                                           qos_profile=qos_profile_parameters)
        wait_until(caller.service_is_ready)
        future = caller.call_async(request)
        wait_until(future.done)
        found[name] = future.result()
    wait_until(lambda: services.calls == 0)
    text = 'internal error: ZeroDivisionError: a defect'
    for name in ('at_once', 'after_a_wait'):
        assert found[name] == Trigger.Response(success=False, message=text)
    assert not found['none'].success
    assert found['none'].message.startswith('internal error: TypeError')
    assert found['each'].results == [SetParametersResult(successful=False, reason=text)] * 2
    assert found['all'].result == SetParametersResult(successful=False, reason=text)
    assert found['get'] == GetParameters.Response()
    assert len(errors) == len(calls)


class Broken:
    """A spinner whose executor looks for something that was destroyed, each time."""

    def __init__(self, context: ClientContext, errors: list[str],
                 monkeypatch: pytest.MonkeyPatch) -> None:
        self.spinner = ExecutorThread('services', errors.append, context.context, clock())
        self.failures = 0
        monkeypatch.setattr(self.spinner.executor, 'spin_once', self.fail)

    def fail(self) -> None:
        self.failures += 1
        raise InvalidHandle('destroyed')


@pytest.mark.parametrize('leaves', [False, True])
def test_what_is_gone_is_told_unless_a_drive_leaves(
        leaves: bool, _client_context: ClientContext, errors: list[str],
        monkeypatch: pytest.MonkeyPatch) -> None:
    broken = Broken(_client_context, errors, monkeypatch)
    if leaves:
        broken.spinner.leaves()
    broken.spinner.start()
    wait_until(lambda: broken.failures >= 2)
    told = set(errors)
    broken.spinner.stop()
    assert told == (set() if leaves else {
        'internal error in a callback: InvalidHandle: destroyed'})
