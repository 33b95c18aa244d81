# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The node's way: flat overrides with dotted names instead of a file."""

from array import array
from pathlib import Path
from typing import Any

from configuration_builders import at, changed, PROFILE
import pytest
from saying import says

from drive_can_bridge.configuration.load import configuration_from_overrides, tree_from_overrides
from drive_can_bridge.core.errors import ConfigurationError


@pytest.fixture
def good(tmp_path: Path) -> dict[str, Any]:
    """Return overrides without a fault, for a profile in ``tmp_path``."""
    (tmp_path / 'table.yaml').write_text(PROFILE)
    return {
        'profile_directories': [str(tmp_path)],
        'buses.main.interface': 'virtual',
        'buses.main.channel': 'demo',
        'drives.conveyor.bus': 'main',
        'drives.conveyor.protocol': 'datamodel_extended',
        'drives.conveyor.station': 1,
        'drives.conveyor.profile': 'table',
        'drives.conveyor.cyclic_request': ['speed'],
        'drives.conveyor.cyclic_response': ['actual', 'status'],
        'drives.conveyor.joint.name': 'belt',
        'drives.conveyor.joint.velocity': 'actual',
        'use_sim_time': True,
        'qos_overrides./parameter_events.publisher.depth': 10,
    }


def problems(overrides: dict[str, Any]) -> list[str]:
    with pytest.raises(ConfigurationError) as caught:
        configuration_from_overrides(overrides)
    return caught.value.problems


def test_good(good: dict[str, Any]) -> None:
    configuration = configuration_from_overrides(good)
    drive = configuration.drives['conveyor']
    assert [parameter.name for parameter in drive.cyclic_response] == ['actual', 'status']
    assert drive.joint is not None
    assert drive.joint.name == 'belt'
    assert configuration.warnings == ()


@pytest.mark.parametrize(('name', 'value', 'expected'), [
    ('drives.conveyor.statoin', 1,
     [at('drives.conveyor.statoin', 'unknown_key', hint=says('did_you_mean', word='station'))]),
    ('drives.conveyor.station', True,
     [at('drives.conveyor.station', 'wrong_type', value=True, kind='a bool',
         allowed='an integer')]),
    ('drives.conveyor.station', None,
     [at('drives.conveyor.station', 'wrong_kind', kind='an empty list', allowed='an integer')]),
    ('drives.conveyor.station', b'\x01',
     [at('drives.conveyor.station', 'wrong_kind', kind='a bytes', allowed='an integer')]),
    ('drives.conveyor.period', float('nan'),
     [at('drives.conveyor.period', 'not_finite', allowed='a number of 0.001 to 65.535')]),
    *[('memory_limit_mb', value, [at('memory_limit_mb', code, **{
        'allowed': 'an integer of 128 to 1048576, or 0 for no limit', **fields})])
      for value, code, fields in (
          (-1, 'out_of_range', {'value': -1}), (64.0, 'wrong_type', {
              'value': 64.0, 'kind': 'a number'}),
          ('512', 'number_in_words', {
              'value': '512', 'kind': 'a string', 'number': '512'}))],
    ('drives.conveyor', 5,
     [at('drives.conveyor', 'value_and_below', below='bus'),
      at('drives.conveyor', 'wrong_type', value=5, kind='an integer', allowed='a mapping')]),
    ('drives', None,
     [at('drives', 'value_and_below', below='conveyor'),
      at('drives', 'wrong_kind', kind='an empty list', allowed='a mapping')]),
    ('unknown.key', 5,
     [at('unknown', 'unknown_key',
         hint=says('allowed', words=(
             'autostart, diagnostics_period, joint_state_rate, memory_limit_mb, '
             'profile_directories, buses, drives, use_sim_time, '
             'start_type_description_service')))]),
])
def test_problem(good: dict[str, Any], name: str, value: object, expected: list[str]) -> None:
    assert problems({**good, name: value}) == expected


def test_nothing_at_all() -> None:
    assert problems({}) == [at('buses', 'missing', allowed='a mapping')]


def test_problem_inside_a_profile(good: dict[str, Any], tmp_path: Path) -> None:
    (tmp_path / 'table.yaml').write_text(changed(PROFILE, 'access: wo', 'access: w'))
    assert problems(good) == [
        at(f'{tmp_path}/table.yaml:9: parameters.order.access', 'unknown_word', value='w',
           near=says('near', word='wo'), allowed='ro, rw or wo')]


@pytest.mark.parametrize('empty', [None, [], (), array('q')])
def test_empty_lists(good: dict[str, Any], empty: object) -> None:
    good['drives.conveyor.cyclic_request'] = empty
    good['profile_directories'] = [*good['profile_directories'], '']
    configuration = configuration_from_overrides(good)
    assert configuration.drives['conveyor'].cyclic_request == ()


def test_numbers(good: dict[str, Any]) -> None:
    configuration = configuration_from_overrides({**good, 'diagnostics_period': 2,
                                                  'drives.conveyor.period': 1})
    assert repr(configuration.diagnostics_period) == '2.0'
    assert repr(configuration.drives['conveyor'].period) == '1.0'


def test_topic_names_keep_their_dots() -> None:
    tree = tree_from_overrides({'qos_overrides./a.b.c': 1, 'x.y': 2})
    assert tree.data == {'qos_overrides./a.b.c': 1, 'x': {'y': 2}}


def test_drives_keep_the_order_of_the_file() -> None:
    overrides = {f'drives.{name}.{key}': 1 for name in ('west', 'north', 'east')
                 for key in ('joint.name', 'bus')}
    assert list(tree_from_overrides(overrides).data['drives']) == ['west', 'north', 'east']


def test_names_too_long_in_their_namespace(good: dict[str, Any]) -> None:
    configuration_from_overrides(good, namespace=f'/{"n" * 211}')
    with pytest.raises(ConfigurationError) as caught:
        configuration_from_overrides(good, namespace=f'/{"n" * 212}')
    assert caught.value.problems == [
        at('drives.conveyor', 'topic_too_long', length=248, most=247,
           topic='~/set_parameters_atomically')]
