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
from drive_can_bridge.protocols.families import FAMILIES

FAMILY = FAMILIES['cia402']


def wrong(mode: str = 'csv', **options: Any) -> dict[str, str]:
    return dict(FAMILY.check(servo(mode, **options)))


def test_all_modes_are_fine() -> None:
    for mode in ('csp', 'csv', 'cst', 'pp', 'pv', 'tq', 'vl', 'ip'):
        assert wrong(mode) == {}, mode


def test_the_mode_and_its_setpoint() -> None:
    drive = servo()
    drive = replace(drive, options=replace(drive.options, mode=None))
    assert dict(FAMILY.check(drive))['mode'] == says('one_missing')
    assert '60FFh.00h' in wrong(request=())['cyclic_request']
    narrow = parameter('target_velocity', None, index=0x60FF, subindex=0, type=INT16)
    assert 'int32' in wrong(request=(narrow,))['profile.parameters.target_velocity.type']


@pytest.mark.parametrize('mode', ['csp', 'pp'])
@pytest.mark.parametrize('neutral', [None, 0.0])
def test_a_position_stays_where_it_is(mode: str, neutral: float | None) -> None:
    plain = replace(TARGET, neutral_from='', neutral=neutral)
    assert 'neutral_from' in str(wrong(mode, request=(plain,)))


@pytest.mark.parametrize('options', [
    {'period': 0.03}, {'transmission': 'event'}])
def test_what_is_interpolated_needs_sync(options: dict[str, Any]) -> None:
    assert 'mode' in wrong('csp', **options)
    assert 'mode' not in wrong('pv', **options)


def test_lists_that_are_too_short_say_what_is_needed() -> None:
    assert wrong(response=(POSITION, VELOCITY))['response_pdos'] == says(
        'pdos_too_small', needed=2)
    assert wrong(response=(POSITION, VELOCITY), response_pdos=(1, 3)) == {}
    # 2 + 4 bytes, then 4 + 2: no entry is torn
    assert wrong(request=(VELOCITY_TARGET, replace(VELOCITY_TARGET, name='other', index=0x2000)))[
        'request_pdos'] == says('pdos_too_small', needed=2)
    assert 'twice' in wrong(response_pdos=(1, 1))['response_pdos']


def test_what_the_bridge_sends_by_itself() -> None:
    word = parameter('word', None, index=0x6040, subindex=0)
    assert 'control word' in wrong(request=(VELOCITY_TARGET, word), request_pdos=(1, 2))[
        'cyclic_request']
    mode = parameter('mode', None, index=0x6060, subindex=0)
    assert 'key mode' in wrong(request=(VELOCITY_TARGET, mode))['cyclic_request']
    status = parameter('status', None, index=0x6041, subindex=0)
    assert wrong(response=(status,))['cyclic_response'] == says(
        'status_word_mapped', name='status')
    assert 'profile.parameters.status_word' in wrong(table=(*TABLE, parameter(
        'status_word', None, index=0x6041)))


def test_times() -> None:
    assert 'period' in wrong('pv', transmission='event', period=0.0105)
    assert 'period' in wrong('pv', transmission='event', period=66.0)
    assert 'heartbeat_timeout' in wrong(heartbeat_producer=0.4)
    assert wrong(heartbeat_producer=0.4, heartbeat_timeout=0.0) == {}
    assert 'station' in wrong(station=128)


def test_addresses() -> None:
    assert 'profile.parameters.x.index' in wrong(table=(*TABLE, parameter('x', 5)))


def test_what_is_suspicious() -> None:
    def said(mode: str, **options: Any) -> list[str]:
        return [key for key, _ in FAMILY.warnings(servo(mode, **options))]
    assert said('csv') == []
    assert said('csv', request=(VELOCITY_TARGET, TORQUE_TARGET)) == ['cyclic_request']
    assert said('csv', ramp_bits=False) == ['ramp_bits']
    assert said('vl', ramp_bits=False) == []
    assert said('pp') == ['command_timeout']
    assert said('pp', command_timeout=0.0) == []


def test_drives_of_one_bus() -> None:
    def said(*drives: Any) -> list[tuple[str, str]]:
        return [(drive.name, key) for drive, (key, _) in FAMILY.check_together(drives)]
    one = servo(name='one', station=1)
    assert said(one, servo(name='two', station=2)) == []
    assert said(one, servo(name='two', station=2, period=0.02)) == [('two', 'period')]
    assert said(one, servo('pv', name='two', station=2, period=0.02, transmission='event')) == []
    assert said(one, servo(name='two', station=2, bridge_node=126)) == [('two', 'bridge_node')]
    assert said(one, servo(name='two', station=127)) == [('one', 'bridge_node')]


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
