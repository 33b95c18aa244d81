# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a monitor or panel asks for: stops, reads and writes."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from clients import Client, wait_until
import pytest
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import GetParameterTypes, SetParameters
import rclpy
from rclpy.qos import qos_profile_parameters
from std_srvs.srv import SetBool, Trigger
from waiting import clock

from drive_can_bridge.core.messages import together
from drive_can_bridge.core.sentences import (
    may_still_be_running, no_answer_to_stop, nobody_answered, nobody_takes, write_not_confirmed)
from drive_can_bridge.monitor.snapshot import OperationOutcome, StopAction
from drive_can_bridge.ros.client.calls import LONGEST_PATIENCE, OFFER_TIMEOUT
from drive_can_bridge.ros.monitor.client import PARAMETER_TIMEOUT, ServiceOperations
from drive_can_bridge.ros.passing import NodeEnd


@contextmanager
def asking(client: Client) -> Iterator[ServiceOperations]:
    """Return operations of a node of their own."""
    node = rclpy.create_node('asking', context=client.node.context, enable_rosout=False,
                             start_parameter_services=False)
    try:
        yield ServiceOperations(NodeEnd(node, str))
    finally:
        node.destroy_node()


class Shy:
    """A drive's parameter services: who is not known yet gets no answer, as with DDS."""

    def __init__(self, client: Client, known_after: int, *, ends: bool = False) -> None:
        self.ends = ends    # with what it is asked to write
        self.known_after = known_after
        self.mute = False
        self.greetings = self.writes = 0
        self._node = client.node
        self._services = [
            self._node.create_service(kind, f'/lift/{name}', answer,
                                      qos_profile=qos_profile_parameters)
            for kind, name, answer in ((GetParameterTypes, 'get_parameter_types', self._greeted),
                                       (SetParameters, 'set_parameters', self._written))]
        for service in self._services:
            send = service.send_response
            service.send_response = lambda *answer, send=send: (
                self.greetings >= self.known_after and not self.mute and send(*answer))

    def _greeted(self, _: Any, response: Any) -> Any:
        self.greetings += 1
        return response

    def _written(self, _: Any, response: Any) -> Any:
        self.writes += 1
        self.mute = self.ends
        response.results = [SetParametersResult(successful=True)]
        return response

    def close(self) -> None:
        for service in self._services:
            self._node.destroy_service(service)


def test_what_is_asked_of_a_drive_is_asked_once_it_knows_us(client: Client) -> None:
    """An answer to somebody unknown is given up; what it was about was done all the same."""
    shy, told, later = Shy(client, known_after=3), list[OperationOutcome](), 0.0

    def now() -> float:
        return clock().now() + later

    def write(value: float) -> OperationOutcome:
        operations.write('/lift', 'ramp_time', value, told.append, now())
        wait_until(lambda: not operations.poll({}, now()), what='an answer')
        return told[-1]
    try:
        with asking(client) as operations:
            assert write(1.5) == OperationOutcome(True, '')
            assert shy.greetings >= 3
            assert write(2.5) == OperationOutcome(True, '')
            # somebody else by the same name
            shy.known_after, later = shy.greetings + 3, 10.0
            assert write(3.5) == OperationOutcome(True, '')
            assert shy.greetings >= shy.known_after
            assert shy.writes == 3, 'each of them once'
            # nobody
            shy.known_after, later = 1_000_000, 20.0
            operations.write('/lift', 'ramp_time', 4.5, told.append, now())
            assert operations.poll({}, now())
            later += PARAMETER_TIMEOUT
            assert not operations.poll({}, now())
            assert told[3] == OperationOutcome(False, nobody_answered())
            assert shy.writes == 3
    finally:
        shy.close()


def test_who_is_known_late_is_answered_soon_after(client: Client) -> None:
    """Where a message of discovery is lost, Fast DDS sends it again after 3 s, or 6 s."""
    shy, told = Shy(client, known_after=1_000_000), list[OperationOutcome]()
    begun = clock().now()

    def answered() -> bool:
        if clock().now() > begun + 3.2:
            shy.known_after = 0
        return not operations.poll({}, clock().now())
    try:
        with asking(client) as operations:
            operations.write('/lift', 'ramp_time', 1.5, told.append, begun)
            wait_until(answered, what='an answer')
        assert 3.2 < clock().now() - begun < 3.2 + 2.0 * LONGEST_PATIENCE
    finally:
        shy.close()
    assert told == [OperationOutcome(True, '')]


def test_a_write_that_was_sent_and_not_answered_may_have_been_done(client: Client) -> None:
    shy, told = Shy(client, known_after=1, ends=True), list[OperationOutcome]()
    try:
        with asking(client) as operations:
            now = clock().now()
            operations.write('/lift', 'ramp_time', 1.5, told.append, now)
            wait_until(lambda: operations.poll({}, now) and shy.writes, what='a write')
            assert not operations.poll({}, now + PARAMETER_TIMEOUT)
    finally:
        shy.close()
    assert told == [OperationOutcome(False, together([write_not_confirmed(), nobody_answered()]))]
    assert shy.writes == 1


def test_a_stop_waits_a_moment_for_whoever_offers_it(client: Client) -> None:
    """A drive has several services, and each is found by itself."""
    def answer(_: Any, response: Any) -> Any:
        response.success, response.message = True, 'stopped'
        return response

    now, told = 100.0, list[OperationOutcome]()
    with asking(client) as operations:
        operations.poll({'/lift': StopAction}, now)
        operations.stop('/lift', StopAction.QUICK_STOP, told.append, now)
        assert operations.poll({'/lift': StopAction}, now)
        assert told == []
        service = client.node.create_service(Trigger, '/lift/quick_stop', answer)
        try:
            wait_until(lambda: not operations.poll({'/lift': StopAction}, now), what='an answer')
            assert told == [OperationOutcome(True, 'stopped')]
            operations.stop('/lift', StopAction.DISABLE, told.append, now)
            assert operations.poll({'/lift': StopAction}, now + OFFER_TIMEOUT - 0.1)
            assert not operations.poll({'/lift': StopAction}, now + OFFER_TIMEOUT)
            assert told[1:] == [OperationOutcome(False,
                                                 may_still_be_running(nobody_takes('enable')))]
        finally:
            client.node.destroy_service(service)


class Busy:
    """A drive's stop, whose answers are kept back."""

    def __init__(self, client: Client, kind: Any, name: str) -> None:
        self._node = client.node
        self.asked: list[Any] = []
        self.kept: list[tuple[Any, ...]] = []
        self._service = self._node.create_service(kind, name, self._answer)
        self._send = self._service.send_response
        self._service.send_response = lambda *answer: self.kept.append(answer)

    def _answer(self, request: Any, response: Any) -> Any:
        self.asked.append(request)
        response.success, response.message = True, 'stopped'
        return response

    def answers(self) -> None:
        """Answer what was asked last."""
        self._send(*self.kept[-1])

    def close(self) -> None:
        self._node.destroy_service(self._service)


@pytest.mark.parametrize(('stop', 'kind', 'name', 'patience', 'times'), [
    (StopAction.QUICK_STOP, Trigger, 'quick_stop', 10.0, 2),
    (StopAction.DISABLE, SetBool, 'enable', 120.0, 1)])
def test_a_stop_may_take_as_long_as_that_of_a_command(
        client: Client, stop: StopAction, kind: Any, name: str, patience: float,
        times: int) -> None:
    now, told, wanted = 100.0, list[OperationOutcome](), {'/lift': [stop]}
    busy = Busy(client, kind, f'/lift/{name}')
    try:
        with asking(client) as operations:
            for answered in (True, False):
                busy.kept.clear()
                operations.poll(wanted, now)
                operations.stop('/lift', stop, told.append, now)
                wait_until(lambda: operations.poll(wanted, now) and busy.kept, what='a stop')
                # DDS may lose an answer
                wait_until(lambda: operations.poll(wanted, now + 1.0)
                           and len(busy.kept) == times, what='a stop, again')
                assert operations.poll(wanted, now + patience - 0.1)
                if answered:
                    busy.answers()
                    wait_until(lambda: not operations.poll(wanted, now + patience - 0.1),
                               what='an answer')
                else:
                    assert not operations.poll(wanted, now + patience)
    finally:
        busy.close()
    assert told == [OperationOutcome(True, 'stopped'),
                    OperationOutcome(False, may_still_be_running(no_answer_to_stop(patience)))]
    assert busy.asked == [kind.Request()] * 2 * times, 'for anything but enable'


def test_a_drive_that_has_just_appeared_is_stopped_too(client: Client) -> None:
    """Its button is there before the next poll is told of it."""
    busy, now, told = Busy(client, Trigger, '/lift/quick_stop'), 100.0, list[OperationOutcome]()
    try:
        with asking(client) as operations:
            operations.poll({}, now)
            operations.stop('/lift', StopAction.QUICK_STOP, told.append, now)
            wait_until(lambda: operations.poll({}, now) and busy.kept, what='a stop')
            busy.answers()
            wait_until(lambda: not operations.poll({'/lift': StopAction}, now), what='an answer')
    finally:
        busy.close()
    assert told == [OperationOutcome(True, 'stopped')]
    assert busy.asked == [Trigger.Request()]
