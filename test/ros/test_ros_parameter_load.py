# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Many parameter requests at once, large ones, slow ones."""

from typing import Any

from bridges import acyclic, CONVEYOR, LIFT, parameters, StartBridge
from clients import Client, from_value, to_messages, wait_until
from rcl_interfaces.srv import GetParameters, SetParameters

DRIVE = 'drive_can_bridge: drive conveyor'


def test_two_hundred_names(bridge: StartBridge, client: Client, tmp_path: Any) -> None:
    profile = tmp_path / 'large.yaml'
    rows = '\n'.join(f'  value_{number}: {{number: {number}, type: uint16, storage: ram}}'
                     for number in range(300, 500))
    profile.write_text(f'protocols: [datamodel_extended]\nparameters:\n{rows}\n', 'utf-8')
    one = bridge(parameters(conveyor={
        **CONVEYOR, 'profile': str(profile), 'cyclic_request': ['value_300'],
        'cyclic_response': ['value_301']}))
    one.online()
    for number in range(301, 500):
        one.played['conveyor'].set_value(f'value_{number}', number)
    with one.record() as recorder:
        values = client.get('/conveyor', *(f'value_{number}' for number in range(300, 500)))
        assert values[1:] == list(range(301, 500))
        assert len(acyclic(recorder)) == 50


def test_a_thousand_calls_in_flight(bridge: StartBridge, client: Client) -> None:
    one = bridge()
    one.online()
    client.listen()
    service = client.service('/conveyor/get_parameters', GetParameters)
    answered: list[int] = []
    futures = []
    for number in range(1000):
        future = service.call_async(GetParameters.Request(names=['ramp_time']))
        future.add_done_callback(lambda _, number=number: answered.append(number))
        futures.append(future)
    wait_until(lambda: len(answered) == 1000, 60.0, 'all answers')
    values = [from_value(future.result().values[0]) for future in futures]
    served = [number for number in answered if values[number] is not None]
    assert len(served) >= 65  # the one being served, and 64 behind it
    assert served == sorted(served)
    if len(served) < 1000:
        client.wait_logged('conveyor: read ramp_time (P30): busy')
        refused = [number for number in answered if values[number] is None]
        assert refused == sorted(refused)


def test_busy(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, 'missed_limit': 1000,
                                      'parameter_timeout': 30.0, 'parameter_retries': 0}))
    one.online()
    one.played['conveyor'].fault('silent')
    service = client.service('/conveyor/set_parameters', SetParameters)
    answered: list[int] = []
    futures = []
    for number in range(100):
        future = service.call_async(SetParameters.Request(
            parameters=to_messages({'jog_speed': float(number)})))
        future.add_done_callback(lambda _, number=number: answered.append(number))
        futures.append(future)
    # a look at the maps may be under way: then all that are let in are waiting
    wait_until(lambda: len(answered) >= 35)
    reasons = [future.result().results[0].reason for future in futures if future.done()]
    assert reasons.count('busy') >= 35
    assert 64 <= 100 - reasons.count('busy') <= 65
    client.diagnostics(DRIVE, lambda drive: drive['last_parameter_error'].endswith(': busy'))
    # they are all answered when the bridge lets go, in the order in which they came
    assert client.transition(4)
    wait_until(lambda: len(answered) == 100)
    late = [number for number in answered
            if futures[number].result().results[0].reason == 'bridge inactive']
    assert len(late) >= 60 and late == sorted(late)


def test_a_slow_drive_delays_no_other(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(
        conveyor={**CONVEYOR, 'missed_limit': 100000, 'parameter_timeout': 10.0},
        lift=LIFT))
    one.online()
    one.played['conveyor'].fault('silent')
    slow = client.ask('/conveyor/get_parameters', GetParameters,
                      GetParameters.Request(names=['ramp_time']))
    for _ in range(20):
        assert client.get('/lift', 'ramp_time') != [None]
    assert not slow.done()
    one.played['conveyor'].fault('ok')
