# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Quality of service of topics, which users may override: standard parameters of ROS.

Each is called ``qos_overrides.TOPIC.publisher.POLICY``, or ``subscription``, perhaps with ``_ID``.
A topic may have dots, and a file may nest names at any of them. rclpy checks the values when
it makes the topic, in the middle of configuring.
"""

from collections.abc import Iterator
from typing import Any

from drive_can_bridge.configuration.problems import Path, Tree
from drive_can_bridge.configuration.schema import check_value
from drive_can_bridge.core import complaints
from drive_can_bridge.core.complaints import suggestion

_KEY = 'qos_overrides'
_ENDS = ('publisher', 'subscription')
_BY_OTHERS = ('best_available', 'system_default')
#: policies that the topics of a bridge accept; the other policies of ROS are not checked
_POLICIES: dict[str, dict[str, Any]] = {
    'history': {'enum': ['keep_last', 'keep_all', 'system_default']},
    'depth': {'type': 'integer', 'minimum': 0, 'maximum': 2**31 - 1},
    'reliability': {'enum': ['reliable', 'best_effort', *_BY_OTHERS]},
    'durability': {'enum': ['volatile', 'transient_local', *_BY_OTHERS]},
    'deadline': {}, 'lifespan': {}, 'liveliness': {}, 'liveliness_lease_duration': {},
    'avoid_ros_namespace_conventions': {},
}


def check_qualities(tree: Tree) -> None:
    """Report qualities that no topic can have."""
    for key, value in tree.data.items():
        if key.split('.')[0] == _KEY:
            for path, given in _values((key,), value):
                _check(tree, path, given)


def _values(path: Path, value: Any) -> Iterator[tuple[Path, Any]]:
    if isinstance(value, dict):
        for key, below in value.items():
            yield from _values((*path, key), below)
    else:
        yield path, value


def _check(tree: Tree, path: Path, value: Any) -> None:
    topic, *last = '.'.join(map(str, path)).rsplit('.', 2)
    if len(last) < 2 or '.' not in topic:
        tree.wrong(path, complaints.wrong(
            value=value, allowed='TOPIC: {publisher: {POLICY: VALUE}}'))
        return
    end, policy = last
    for word, known in ((end.partition('_')[0], _ENDS), (policy, _POLICIES)):
        if word not in known:
            tree.wrong(path, complaints.unknown_key(hint=suggestion(word, known)))
            return
    schema = _POLICIES[policy]
    if isinstance(value, str) and value.lower() in schema.get('enum', ()):
        return      # rclpy does not mind capitals
    message = check_value(value, schema)
    if message is not None:
        tree.wrong(path, message)
