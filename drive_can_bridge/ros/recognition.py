# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How bridges and their drives are recognised in the ROS graph, before anybody was asked.

A bridge offers ``~/save_trace`` beside the transitions of a managed node, so nobody else's managed
node is taken for one. A drive offers ``~/quick_stop``, publishes its samples, and lives in the
namespace of a bridge.
"""

from collections.abc import Iterable

#: name and types of each service, or topic, as the graph tells them
Entries = Iterable[tuple[str, list[str]]]

#: parameter of a bridge: the full names of all bridges that it sees, its own among them
BRIDGES = 'bridges'
_TRIGGER = 'std_srvs/srv/Trigger'


def bridges_among(services: Entries) -> list[str]:
    """Return the full names of the bridges that offer some of these services."""
    entries = list(services)
    managed = set(_nodes(entries, 'change_state', 'lifecycle_msgs/srv/ChangeState'))
    return sorted(managed.intersection(_nodes(entries, 'save_trace', _TRIGGER)))


def stoppable_among(services: Entries) -> list[str]:
    """Return the full names of the nodes that can be stopped, drives or not."""
    return sorted(_nodes(services, 'quick_stop', _TRIGGER))


def sampled_among(topics: Entries) -> set[str]:
    """Return the full names of the nodes that have samples as drives have them."""
    return set(_nodes(topics, 'response', 'rcl_interfaces/msg/ParameterEvent'))


def namespace_of(node: str) -> str:
    """Return the namespace of a node: '' for the root."""
    return node.rpartition('/')[0]


def _nodes(entries: Entries, name: str, kind: str) -> list[str]:
    ending = f'/{name}'
    return [full.removesuffix(ending) for full, kinds in entries
            if full.endswith(ending) and kind in kinds]
