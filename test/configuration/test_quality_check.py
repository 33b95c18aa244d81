# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What ``qos_overrides`` say, which are ROS's own: rclpy finds mistakes in them too late."""

from pathlib import Path
from typing import Any

from configuration_builders import at, changed, FILE, load, problems
import pytest
from saying import says

from drive_can_bridge.configuration.load import configuration_from_overrides
from drive_can_bridge.core.errors import ConfigurationError

PUBLISHER = 'qos_overrides./conveyor/actual.publisher'


def with_qualities(*lines: str) -> str:
    """Return a good file with these lines below ``qos_overrides``, in line 10 and further."""
    added = ''.join(f'      {line}\n' for line in lines)
    return changed(FILE, '    drives:\n', f'    qos_overrides:\n{added}    drives:\n')


@pytest.mark.parametrize(('line', 'expected'), [
    ('publisher: {reliability: sometimes, depth: 1}',
     at(f'f.yaml:11: {PUBLISHER}.reliability', 'unknown_word', value='sometimes',
        allowed='reliable, best_effort, best_available or system_default')),
    ('publisher: {durability: transient_locale}',
     at(f'f.yaml:11: {PUBLISHER}.durability', 'unknown_word', value='transient_locale',
        near=says('near', word='transient_local'))),
    ('publisher: {history: 5}',
     at(f'f.yaml:11: {PUBLISHER}.history', 'unknown_word', value=5)),
    ('publisher: {depth: -5}',
     at(f'f.yaml:11: {PUBLISHER}.depth', 'out_of_range', value=-5)),
    ('publisher: {depth: many}',
     at(f'f.yaml:11: {PUBLISHER}.depth', 'wrong_type', value='many', kind='a string')),
    ('publisher: {dept: 5}',
     at(f'f.yaml:11: {PUBLISHER}.dept', 'unknown_key', hint=says('did_you_mean', word='depth'))),
    ('publishr: {depth: 5}',
     at('f.yaml:11: qos_overrides./conveyor/actual.publishr.depth', 'unknown_key',
        hint=says('did_you_mean', word='publisher'))),
    ('depth: 5',
     at('f.yaml:11: qos_overrides./conveyor/actual.depth', 'wrong', value=5)),
])
def test_what_no_topic_can_have(tmp_path: Path, line: str, expected: object) -> None:
    assert problems(tmp_path, with_qualities('/conveyor/actual:', f'  {line}')) == [expected]


def test_no_topics_at_all(tmp_path: Path) -> None:
    text = changed(FILE, '    drives:\n', '    qos_overrides: 5\n    drives:\n')
    assert problems(tmp_path, text) == [at('f.yaml:9: qos_overrides', 'wrong', value=5)]


def test_what_topics_can_have(tmp_path: Path) -> None:
    load(tmp_path, with_qualities(
        '/conveyor/actual.speed:',
        '  publisher: {reliability: BEST_EFFORT, durability: volatile, history: keep_all}',
        '  subscription_two: {depth: 0, deadline: 5, liveliness: automatic}',
        '/lift/online.publisher.depth: 5'))


@pytest.mark.parametrize(('name', 'value', 'code'), [
    (f'{PUBLISHER}.reliability', 'sometimes', 'unknown_word'),
    (f'{PUBLISHER}.depth', None, 'wrong_kind'), ('qos_overrides', 5, 'wrong')])
def test_overrides_of_a_node(tmp_path: Path, name: str, value: Any, code: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        configuration_from_overrides({name: value})
    assert at(name, code) in caught.value.problems
