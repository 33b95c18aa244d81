# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Services served by a thread of their own."""

from collections.abc import Iterator
from typing import Any

from clients import Client, ClientContext, wait_until
import pytest
from rclpy.qos import qos_profile_parameters
from std_srvs.srv import Trigger
from waiting import clock

from drive_can_bridge.ros.polled_topics import PolledGroup
from drive_can_bridge.ros.threads import Answer, ServiceThread


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
