# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Requests that the middleware cannot read, or not soon: who else notices.

What they are is not written here: a take that takes its time, and one that throws.
"""

from collections.abc import Callable, Iterator
from typing import Any

from bridges import Bridge, CONVEYOR, LIFT, parameters, StartBridge
from clients import Client, wait_until
from graph import Responses
import pytest
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import (
    GetParameters, ListParameters, SetParameters)
from std_srvs.srv import SetBool, Trigger
from waiting import clock, pause

from drive_can_bridge.core.sentences import (
    request_hangs, request_hung, request_unreadable, service_given_up)
from drive_can_bridge.ros.parameter_services import NAMES_MAX
from drive_can_bridge.ros.rcl.layout import BYTES_MAX
from drive_can_bridge.ros.rcl.services import RclServices
from drive_can_bridge.ros.requests import HANGS
from drive_can_bridge.ros.threads import STOPPED_MAX

LONG = 10.0
READ = '/conveyor/get_parameters'
STATE = '/drive_can_bridge/get_state'


class Slow:
    """
    A middleware that takes its time for requests of one service.

    :ivar waiting: how many it is reading.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.service = self.thrown = ''
        self.seconds = LONG
        self.waiting = 0
        self.over = False
        take = Responses.take

        def slowly(middleware: Any, service: Any, lost: Callable[[str], None]) -> Any:
            if service.service_name == self.service:
                self.service, thrown, self.thrown = '', self.thrown, ''
                self.waiting += 1
                if thrown:
                    lost(thrown)
                    wait_until(lambda: self.over, timeout=1e6)  # for ever
                    return None
                pause(self.seconds)
                self.waiting -= 1
            return take(middleware, service, lost)
        monkeypatch.setattr(Responses, 'take', slowly)


@pytest.fixture(name='slow')
def _slow(monkeypatch: pytest.MonkeyPatch) -> Iterator[Slow]:
    slow = Slow(monkeypatch)
    yield slow
    slow.over = True


def _start(bridge: StartBridge) -> Bridge:
    one = bridge(parameters(conveyor=CONVEYOR, lift=LIFT)).online()
    return one


def _others_go_on(client: Client, *, but: str = READ) -> None:
    """All services but this one answer, and the motor stops, within a second of the clock."""
    began = clock().now()
    assert client.call('/lift/enable', SetBool, SetBool.Request(data=True)).success
    assert client.call('/lift/quick_stop', Trigger).success
    assert client.get('/lift', 'ramp_time') != [None]
    if not but.startswith('/drive_can_bridge/'):
        assert client.state() == 'active'
    if not but.startswith('/conveyor/'):
        assert client.get('/conveyor', 'ramp_time') != [None]
    names = client.call('/conveyor/list_parameters', ListParameters).result.names
    assert 'ramp_time' in names
    assert clock().now() - began < 1.0 + 0.5


@pytest.mark.parametrize('service', [READ, STATE, '/lift/enable'])
def test_one_that_takes_ten_seconds_holds_up_its_own_service(
        bridge: StartBridge, client: Client, slow: Slow, service: str) -> None:
    one = _start(bridge)
    client.listen()
    kinds = {each.service_name: each.srv_type for node in
             (one.node, *(drive.node for drive in one.node.drives.values()))
             for each in node.services}
    client.call(service, kinds[service])    # known
    with one.record() as recorder:
        slow.service = service
        began = clock().now()
        future = client.ask(service, kinds[service])
        wait_until(lambda: slow.waiting)
        if service != '/lift/enable':
            _others_go_on(client, but=service)
        assert client.call('/lift/quick_stop', Trigger).success
        assert client.call('/conveyor/quick_stop', Trigger).message
        assert not future.done()
        client.wait_logged(request_hangs(service, HANGS))
        pause(5.0)
        again = client.ask(service, kinds[service])     # waits for the one before
        pause(1.0)
        assert not again.done()
        cycles = len(recorder.cycles(1))
        assert cycles >= (clock().now() - began) / CONVEYOR['period'] - 2
        wait_until(lambda: future.done() and again.done())
        assert LONG <= clock().now() - began < LONG + 1.0
        client.wait_logged(request_hung(service, LONG))
        assert client.call(service, kinds[service])
    assert one.node.drives['conveyor'].times_lost == 0


def test_one_that_throws_costs_its_thread_and_nobody_else(
        bridge: StartBridge, client: Client, slow: Slow) -> None:
    one = _start(bridge)
    client.listen()
    assert client.get('/conveyor', 'ramp_time') != [None]
    for _ in range(STOPPED_MAX - 1):
        slow.service, slow.thrown = READ, 'std::bad_alloc'
        answered = client.ask(READ, GetParameters, GetParameters.Request(names=['ramp_time']))
        _others_go_on(client)
        wait_until(answered.done)   # by the thread that goes on: here the request is still there
    client.wait_logged(request_unreadable(READ, 'std::bad_alloc'))
    assert slow.waiting == STOPPED_MAX - 1
    slow.service, slow.thrown = READ, 'std::bad_alloc'
    client.ask(READ, GetParameters)
    wait_until(lambda: one.errors or not slow.service)
    client.wait_logged(service_given_up(READ, STOPPED_MAX))
    began = clock().now()
    assert client.get('/lift', 'ramp_time') != [None] and client.state() == 'active'
    assert clock().now() - began < 1.0


def test_the_end_does_not_wait_for_it(bridge: StartBridge, client: Client, slow: Slow) -> None:
    one = _start(bridge)
    client.call(READ, GetParameters)
    slow.service, slow.seconds = READ, 1000.0
    client.ask(READ, GetParameters)
    wait_until(lambda: slow.waiting)
    began = clock().now()
    with one.record() as recorder:
        one.node.stop()
        assert recorder.words()[0] == 0
    one.close()
    assert clock().now() - began < 3.0
    slow.service = ''


# -- what is read -------------------------------------------------------------------------------

def _read_back(rcl: RclServices, request: Any) -> Any:
    """Return what is read of a request that lies in C."""
    from drive_can_bridge.ros.rcl import services
    kind = type(request)
    type(kind).__import_type_support__()    # as whoever makes a service does
    functions = rcl._functions_of(kind)
    raw = services._in_c(request, functions)
    try:
        return services._read(raw, services.layout_of(kind), functions)
    finally:
        functions.destroy(raw)


@pytest.fixture(name='rcl', scope='module')
def _rcl() -> RclServices:
    return RclServices()


VALUES = [
    ParameterValue(type=1, bool_value=True), ParameterValue(type=3, double_value=2.5),
    ParameterValue(type=4, string_value='a text'),
    ParameterValue(type=9, string_array_value=['a', 'b', ''])]


@pytest.mark.parametrize('request_', [
    GetParameters.Request(), GetParameters.Request(names=['a', '', 'ä' * 256]),
    GetParameters.Request(names=['x'] * NAMES_MAX), Trigger.Request(), SetBool.Request(data=True),
    ListParameters.Request(prefixes=['p'], depth=7),
    SetParameters.Request(parameters=[Parameter(name='p', value=value) for value in VALUES]),
], ids=lambda request: type(request).__name__)
def test_what_is_read_of_ordinary_requests(rcl: RclServices, request_: Any) -> None:
    assert _read_back(rcl, request_) == request_


def test_what_is_read_of_too_much(rcl: RclServices) -> None:
    names = _read_back(rcl, GetParameters.Request(names=['x'] * 100_000)).names
    assert len(names) == 100_000 and set(names) == {'x'}
    name, = _read_back(rcl, GetParameters.Request(names=['x' * 5_000_000])).names
    assert name == 'x' * BYTES_MAX
    wide, = _read_back(rcl, GetParameters.Request(names=['\U0001f600' * 300])).names
    assert wide == '\U0001f600' * 257
    kept = _read_back(rcl, SetParameters.Request(parameters=[
        Parameter(name='p', value=ParameterValue(type=9, string_array_value=['y' * 2000] * 5000)),
        Parameter(name='q', value=ParameterValue(type=5, byte_array_value=[b'1'] * 5000))]))
    assert [parameter.name for parameter in kept.parameters] == ['p', 'q']
    assert kept.parameters[0].value.string_array_value == ['y' * BYTES_MAX]
    assert len(kept.parameters[1].value.byte_array_value) == 1
    many = _read_back(rcl, SetParameters.Request(parameters=[
        Parameter(name='p', value=VALUES[2])] * 2000)).parameters
    assert len(many) == 2000 and many[0] is many[-1] and many[0].value == VALUES[2]
