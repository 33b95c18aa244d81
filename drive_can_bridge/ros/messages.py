# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What bridge and clients read alike: messages of parameters, and how bridges are recognised.

A bridge offers ``~/save_trace`` beside the transitions of a managed node, so nobody else's managed
node is taken for one. A drive offers ``~/quick_stop``, publishes its samples, and lives in the
namespace of a bridge. So both are known before anybody was asked.
"""

from collections.abc import Iterable
import shlex

from rcl_interfaces.msg import Parameter as ParameterMessage, ParameterDescriptor, ParameterValue
from rclpy.parameter import Parameter, parameter_value_to_python

from drive_can_bridge.core.parameters import Value
from drive_can_bridge.core.text import printable, TEXT_MAX

#: characters of ``additional_constraints`` that are looked at
_CONSTRAINTS_MAX = 65536


def value_of(message: ParameterValue) -> object:
    """Return what is in a value; None for NOT_SET, and for a type that does not exist."""
    try:
        return parameter_value_to_python(message)
    except RuntimeError:
        return None


def plain(message: ParameterValue) -> Value | str | None:
    """Return the number, bool or text in a value; None for anything else."""
    value = value_of(message)
    return value if isinstance(value, (bool, int, float, str)) else None


def drive_value(message: ParameterValue) -> Value | None:
    """Return the value of a drive's parameter, which is no text; None where it has none."""
    value = plain(message)
    return None if isinstance(value, str) else value


def parameter_message(name: str, value: Value) -> ParameterMessage:
    """Return what sets a parameter to a value of its type."""
    return Parameter(name, value=value).to_parameter_msg()


def facts_of(message: ParameterDescriptor) -> dict[str, str]:
    """Return the ``key=value`` pairs of a descriptor; none of one that is not understood."""
    try:
        words = shlex.split(message.additional_constraints[:_CONSTRAINTS_MAX])
    except ValueError:
        return {}
    pairs = (word.partition('=') for word in words)
    return {printable(key): printable(value, None if key == 'values' else TEXT_MAX)
            for key, separator, value in pairs if separator}


def limits_of(message: ParameterDescriptor) -> tuple[float | None, float | None]:
    """Return the smallest and the largest value of a descriptor; None: not told."""
    for limits in (*message.floating_point_range, *message.integer_range):
        return float(limits.from_value), float(limits.to_value)
    return None, None


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
