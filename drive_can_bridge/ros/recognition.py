# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How bridges and their drives are recognised in the ROS graph, before any of them was asked.

A bridge offers ``~/save_trace`` beside the transitions of a managed node, so no other managed
node is taken for one. A drive offers ``~/quick_stop``, publishes its samples, and lives in the
namespace of a bridge.
"""

from collections.abc import Callable, Collection, Iterable
import re

#: name and types of each service, or topic, as the graph has them
Entries = Iterable[tuple[str, list[str]]]

#: parameter of a bridge: the full names of all bridges that it sees, its own among them
BRIDGES = 'bridges'
_TRIGGER = 'std_srvs/srv/Trigger'
#: a service of a node by a name that rmw takes, of 247 characters at most: who is no ROS may call
#: its own anything, and rclpy raises where it is asked about that
_FULL_NAME = re.compile(r'(?=.{,247}\Z)(/[A-Za-z_][A-Za-z0-9_]*){2,}')


def bridges_among(services: Entries) -> list[str]:
    """Return the full names of the bridges that offer some of these services."""
    entries = list(services)
    managed = set(_nodes(entries, 'change_state', 'lifecycle_msgs/srv/ChangeState'))
    return sorted(managed.intersection(_nodes(entries, 'save_trace', _TRIGGER)))


def drives_among(services: Entries, topics: Callable[[], Entries], bridges: Iterable[str],
                 known: Collection[str]) -> list[str]:
    """
    Return the full names of the drives in the namespaces of bridges, but for those known.

    :param topics: returns the topics of the graph, if need be.
    """
    places = {namespace_of(bridge) for bridge in bridges}
    stoppable = sorted(node for node in _nodes(services, 'quick_stop', _TRIGGER)
                       if node not in known and namespace_of(node) in places)
    sampled = (set(_nodes(topics(), 'response', 'rcl_interfaces/msg/ParameterEvent'))
               if stoppable else set[str]())
    return [node for node in stoppable if node in sampled]


def namespace_of(node: str) -> str:
    """Return the namespace of a node: '' for the root."""
    return node.rpartition('/')[0]


def _nodes(entries: Entries, name: str, kind: str) -> list[str]:
    ending = f'/{name}'
    return [full.removesuffix(ending) for full, kinds in entries
            if full.endswith(ending) and kind in kinds and _FULL_NAME.fullmatch(full)]
