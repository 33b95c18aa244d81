# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a configuration of CiA 402 drives may not say, and what is only suspicious."""

from dataclasses import replace
from typing import Any

from builders import INT16, parameter
import pytest
from saying import says
from servo_builders import (
    MODES_OF, POSITION, servo, TABLE, TARGET, TORQUE, TORQUE_TARGET, VELOCITY, VELOCITY_TARGET,
)

from drive_can_bridge.core.frame import worst_bits
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.protocols.cia402.pdo import request_pdos, response_pdos
from drive_can_bridge.protocols.families import FAMILIES

FAMILY = FAMILIES['cia402']


def wrong(mode: str = 'csv', **options: Any) -> dict[str, Sentence]:
    return dict(FAMILY.check(servo(mode, **options)))


def test_all_modes_are_fine() -> None:
    for mode in ('csp', 'csv', 'cst', 'pp', 'pv', 'tq', 'vl', 'ip'):
        assert wrong(mode) == {}, mode


def test_the_mode_and_its_setpoint() -> None:
    drive = servo()
    drive = replace(drive, options=replace(drive.options, mode=None))
    assert dict(FAMILY.check(drive)) == {'mode': says('one_missing')}
    assert wrong(request=()) == {'cyclic_request': says(
        'setpoint_missing', name='csv', index=0x60FF, subindex=0)}
    assert wrong('ip', request=()) == {'cyclic_request': says(
        'setpoint_missing', name='ip', index=0x60C1, subindex=1)}
    narrow = parameter('target_velocity', None, index=0x60FF, subindex=0, type=INT16)
    assert wrong(request=(narrow,)) == {'profile.parameters.target_velocity.type': says(
        'setpoint_type', type='int16', name='csv', wanted='int32')}
    bound = replace(VELOCITY_TARGET, limit=True, neutral=0.0)
    assert wrong(request=(bound,)) == {'profile.parameters.target_velocity.limit': says(
        'setpoint_limit', name='target_velocity', mode='csv')}


@pytest.mark.parametrize('mode', ['csp', 'pp'])
@pytest.mark.parametrize('neutral', [None, 0.0])
def test_a_position_stays_where_it_is(mode: str, neutral: float | None) -> None:
    plain = replace(TARGET, neutral_from='', neutral=neutral)
    assert wrong(mode, request=(plain,)) == {
        'profile.parameters.target_position.neutral_from': says('no_neutral_position', name=mode)}


def test_what_is_interpolated_needs_a_setpoint_every_20_ms() -> None:
    for mode in ('csp', 'csv', 'cst', 'ip'):
        assert wrong(mode, period=0.03) == {'mode': says('interpolated', name=mode, most=0.02)}
    assert wrong('csp', period=0.03, transmission='event') == {
        'mode': says('interpolated', name='csp', most=0.02)}
    assert wrong('pv', period=0.03) == {}


def warned(mode: str, **options: Any) -> dict[str, Sentence]:
    return dict(FAMILY.warnings(servo(mode, **options)))


@pytest.mark.parametrize('mode', ['csp', 'csv', 'cst'])
def test_it_is_warned_about_by_event(mode: str) -> None:
    assert wrong(mode, transmission='event', period=0.02) == {}
    assert warned(mode, transmission='event', period=0.02) == {
        'transmission': says('interpolated_by_event', mode=mode)}
    assert warned(mode, period=0.02) == {}
    assert warned('pv', transmission='event') == {}


def test_ip_needs_sync() -> None:
    assert wrong('ip', transmission='event') == {'transmission': says('ip_by_event')}


def test_a_period_that_jitters() -> None:
    assert warned('csp', period=0.004) == {'period': says('period_jitters', period=0.004)}
    assert warned('csp', period=0.005) == {}


def test_lists_that_are_too_short_say_what_is_needed() -> None:
    assert wrong(response=(POSITION, VELOCITY), response_pdos=(1,)) == {'response_pdos': says(
        'pdos_too_small', count=1, plural='', listed='cyclic_response', needed=2,
        write='response_pdos: [1, 2]')}
    assert wrong(response=(POSITION, VELOCITY), response_pdos=(2,)) == {'response_pdos': says(
        'pdos_too_small', write='response_pdos: [2, 1]')}
    assert wrong(response=(POSITION, VELOCITY)) == {}   # as many as needed, from 1
    many = [replace(POSITION, name=f'p{n}', index=0x2000 + n) for n in range(9)]
    assert wrong(response=many) == {'response_pdos': says(
        'pdos_too_small', count=4, needed=5, write='')}
    assert wrong(response=(POSITION, VELOCITY), response_pdos=(1, 3)) == {}
    # 2 + 4 bytes, then 4 + 2: no entry is torn
    assert wrong(request=(VELOCITY_TARGET, replace(
        VELOCITY_TARGET, name='other', index=0x2000)), request_pdos=(3,)) == {
            'request_pdos': says('pdos_too_small', count=1, plural='', listed='cyclic_request',
                                 needed=2, write='request_pdos: [3, 1]')}
    assert wrong(response_pdos=(1, 1)) == {'response_pdos': says('pdo_twice')}


def test_what_the_bridge_sends_by_itself() -> None:
    word = parameter('word', None, index=0x6040, subindex=0)
    assert wrong(request=(VELOCITY_TARGET, word)) == {'cyclic_request': says(
        'mapped_already', name='word',
        taken='the control word, which the bridge sends by itself')}
    mode = parameter('mode', None, index=0x6060, subindex=0)
    assert wrong(request=(VELOCITY_TARGET, mode)) == {'cyclic_request': says(
        'mapped_already', name='mode', taken='the mode, which the key mode gives')}
    again = replace(VELOCITY_TARGET, name='again')
    assert wrong(request=(VELOCITY_TARGET, again), request_pdos=(1, 2)) == {
        'cyclic_request': says('mapped_already', name='again',
                               taken="the same object as 'target_velocity'")}
    status = parameter('status', None, index=0x6041, subindex=0)
    assert wrong(response=(status,)) == {'cyclic_response': says(
        'status_word_mapped', name='status')}
    assert wrong(table=(*TABLE, parameter('status_word', None, index=0x6041))) == {
        'profile.parameters.status_word': says(
            'built_in', name='status_word', family='cia402')}


@pytest.mark.parametrize('index', [
    0x1400, 0x15FF, 0x1600, 0x1800, 0x1A00, 0x1BFF, 0x1005, 0x1006, 0x1016, 0x1017, 0x60C2])
def test_mapping_parameters_are_no_setpoints(index: int) -> None:
    further = parameter('further', None, index=index, subindex=1)
    assert wrong(request=(VELOCITY_TARGET, further)) == {'cyclic_request': says(
        'mapped_already', name='further', taken='a mapping parameter')}
    assert wrong(response=(VELOCITY, further)) == {}


@pytest.mark.parametrize('index', [0x13FF, 0x1C00, 0x1007, 0x60C1])
def test_what_is_next_to_mapping_parameters(index: int) -> None:
    further = parameter('further', None, index=index, subindex=1)
    assert wrong(request=(VELOCITY_TARGET, further)) == {}


def test_times() -> None:
    for period in (0.0105, 66.0):
        assert wrong('pv', transmission='event', period=period) == {'period': says(
            'no_event_timer', period=period, most=65.535)}
    assert wrong(heartbeat_producer=0.4) == {'heartbeat_timeout': says(
        'heartbeat_too_short', timeout=0.35, producer=0.4)}
    assert wrong(heartbeat_producer=0.4, heartbeat_timeout=0.0) == {}
    for key in ('heartbeat_producer', 'bridge_heartbeat'):
        assert wrong(**{key: 0.0009}) == {key: says('time_too_short', seconds=0.0009)}
        assert wrong(**{key: 0.001}) == {}
    assert wrong(station=128) == {'station': says(
        'value_out_of_range', value=128, least=1, most=127)}


def test_addresses() -> None:
    number = parameter('x', 5)
    assert wrong(table=(*TABLE, number)) == {
        'profile.parameters.x.index': says('index_missing', family='cia402')}
    both = parameter('x', 5, index=0x2000)
    assert wrong(table=(*TABLE, both)) == {
        'profile.parameters.x.number': says('no_numbers', family='cia402')}
    for listed, first in (('request', VELOCITY_TARGET), ('response', POSITION)):
        assert wrong(**{listed: (first, number)}) == {
            f'cyclic_{listed}': says('no_index', name='x')}


def test_what_is_suspicious() -> None:
    def said(mode: str, **options: Any) -> dict[str, Sentence]:
        return dict(FAMILY.warnings(servo(mode, **options)))
    assert said('csv') == {}
    assert said('csv', request=(VELOCITY_TARGET, TORQUE_TARGET)) == {'cyclic_request': says(
        'setpoint_of_other_mode', name='target_torque', mode='csv')}
    assert said('csv', ramp_bits=False) == {'ramp_bits': says('vl_only', mode='csv')}
    assert said('vl', ramp_bits=False) == {}
    assert said('pp', command_timeout=0.5) == {'command_timeout': says('pp_halts', timeout=0.5)}
    assert said('pp', command_timeout=0.0) == {}


def test_drives_of_one_bus() -> None:
    def said(*drives: Any) -> list[tuple[str, str, Sentence]]:
        return [(drive.name, *found) for drive, found in FAMILY.check_together(drives)]
    one = servo(name='one', station=1)
    assert said(one, servo(name='two', station=2)) == []
    assert said(one, servo(name='two', station=2, period=0.02)) == [('two', 'period', says(
        'period_of_sync', period=0.02, other=0.01, drive='one'))]
    assert said(one, servo('pv', name='two', station=2, period=0.02, transmission='event')) == []
    assert said(one, servo(name='two', station=2, bridge_node=126)) == [
        ('two', 'bridge_node', says('bridge_node_differs', node=126, other=127, drive='one'))]
    assert said(one, servo(name='two', station=127)) == [
        ('one', 'bridge_node', says('node_of_drive', node=127, drive='two'))]


def test_the_load_has_one_sync_for_all() -> None:
    drives = [servo(name=f'axis_{n}', station=n, heartbeat_producer=0.0, bridge_heartbeat=0.0)
              for n in range(1, 16)]
    pdos = worst_bits(6, extended=False) + worst_bits(6, extended=False)
    sync = worst_bits(0, extended=False)
    assert sum(FAMILY.loads(drives)) == pytest.approx((15 * pdos + sync) / 0.01)
    assert FAMILY.bits_per_second(drives[0]) == pytest.approx((pdos + sync) / 0.01)


def test_identifiers() -> None:
    claimed = {claim.route.identifier: claim for claim in FAMILY.claims(servo(
        response=(POSITION, VELOCITY, TORQUE, MODES_OF), response_pdos=(2, 4)))}
    assert set(claimed) == {0x000, 0x080, 0x085, 0x205, 0x285, 0x485, 0x585, 0x605, 0x705, 0x77F}
    assert not claimed[0x080].heard
    assert not claimed[0x77F].heard


def test_as_many_pdos_as_needed_from_1() -> None:
    made = servo(response=(POSITION, VELOCITY))
    assert [each.number for each in request_pdos(made)] == [1]
    assert [each.number for each in response_pdos(made)] == [1, 2]
