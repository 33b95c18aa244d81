# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Many parameter requests at once, large ones, slow ones."""

from collections.abc import Callable
from pathlib import Path

from bridges import CONVEYOR, LIFT, parameters, StartBridge
from clients import Client, to_messages, wait_until
import pytest
from rcl_interfaces.srv import GetParameters, SetParameters

DRIVE = 'drive_can_bridge: drive conveyor'


def extended_reads(frames: list[tuple[int, bytes]]) -> int:
    """Count acyclic reads of 300 and above: 29-bit identifiers, number in bits 4 to 19."""
    return sum(identifier >> 20 == 0x002 and identifier >> 4 & 0xFFFF >= 300
               for identifier, _ in frames)


def standard_reads(frames: list[tuple[int, bytes]]) -> int:
    """Count reads of 302 and above: number in bytes 1 and 2; what is polled is below."""
    return sum(identifier == 0x3F1 and int.from_bytes(data[1:3], 'little') >= 302
               for identifier, data in frames)


def cannord_reads(frames: list[tuple[int, bytes]]) -> int:
    """Count parameter tasks to address 1."""
    return sum(identifier == 514 for identifier, _ in frames)


def pkw_reads(frames: list[tuple[int, bytes]]) -> int:
    """Count requests to node 1 for registers from 302 on; an idle request is one, too."""
    return sum(identifier == 0x501 and (data[3] & 0x7F == 0
                                        or int.from_bytes(data[0:2], 'little') >= 302)
               for identifier, data in frames)


@pytest.mark.parametrize(('protocol', 'count', 'together'), [
    ('datamodel_extended', extended_reads, 4), ('datamodel_standard', standard_reads, 4),
    ('cannord', cannord_reads, 1), ('canopen_pkw', pkw_reads, 2)])
def test_two_hundred_names(bridge: StartBridge, client: Client, tmp_path: Path, protocol: str,
                           count: Callable[[list[tuple[int, bytes]]], int], together: int,
                           ) -> None:
    """A dump takes as many requests as the protocol needs at best: the ratio is 1."""
    profile = tmp_path / 'large.yaml'
    rows = '\n'.join(f'  value_{number}: {{number: {number}, type: uint16, storage: ram}}'
                     for number in range(300, 502))
    extra = ''
    if protocol == 'cannord':
        extra = '\n  word: {type: uint16}\n  answer: {type: uint16, access: ro}\n'
    profile.write_text(f'protocols: [{protocol}]\nparameters:\n{rows}\n{extra}', 'utf-8')
    one = bridge(parameters(conveyor={
        **CONVEYOR, 'protocol': protocol, 'profile': str(profile), 'period': 0.1,
        'cyclic_request': ['word' if extra else 'value_300'],
        'cyclic_response': ['answer' if extra else 'value_301']})).online()
    wanted = range(302, 502)
    for number in wanted:
        one.played['conveyor'].set_value(f'value_{number}', number)
    with one.record() as recorder:
        recorder.catch_up()
        values = client.get('/conveyor', *(f'value_{number}' for number in wanted))
        assert values == list(wanted)
        recorder.catch_up()
        used = count(recorder.frames())
    needed = -(-len(wanted) // together)
    assert used == needed, f'{needed} requests needed / {used} used = {needed / used:.2f}'
    assert not one.played['conveyor'].violations


def test_busy(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, 'missed_limit': 1000,
                                      'parameter_timeout': 30.0, 'parameter_retries': 0})).online()
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
        lift=LIFT)).online()
    one.played['conveyor'].fault('silent')
    slow = client.ask('/conveyor/get_parameters', GetParameters,
                      GetParameters.Request(names=['ramp_time']))
    for _ in range(20):
        assert client.get('/lift', 'ramp_time') != [None]
    assert not slow.done()
    one.played['conveyor'].fault('ok')
