# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Services of another middleware, recognised before anything is sent to them.

Fast DDS and Cyclone DDS discover each other, and topics work between them; services never do, and
their requests may do harm on the other side. The first two bytes of an endpoint's gid identify
the maker of its middleware (RTPS 2.5, 9.3.1.5 and 8.3.3.1.3: vendor identifiers).
"""

from typing import Protocol

from rclpy.utilities import get_rmw_implementation_identifier

from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.sentences import other_middleware
from drive_can_bridge.ros.rcl.end import TopicEnd
from drive_can_bridge.ros.recognition import namespace_of

VENDORS = {b'\x01\x0f': 'Fast DDS', b'\x01\x10': 'Cyclone DDS'}
_OURS = {'rmw_fastrtps_cpp': 'Fast DDS', 'rmw_fastrtps_dynamic_cpp': 'Fast DDS',
         'rmw_cyclonedds_cpp': 'Cyclone DDS'}
#: what a node is called that is found by its drives only
_BRIDGE = 'drive_can_bridge'


class _Node(Protocol):
    end: TopicEnd


def ours() -> str:
    """Return the middleware of this process; '': an unknown one."""
    return _OURS.get(get_rmw_implementation_identifier(), '')


def foreign(node: _Node, service: str) -> str:
    """
    Return the middleware of all servers of a service, if it is known and differs from ours.

    :param service: full name.
    """
    found = {VENDORS.get(gid[:2], '') for gid in node.end.who_reads(f'rq{service}Request')}
    own = ours()
    return found.pop() if own and len(found) == 1 and own not in found else ''


def why_not(node: _Node, name: str, bridge: str = '') -> Sentence | None:
    """
    Return why services of a node do not work with this process; None: they may.

    :param name: full name of a bridge, or of one of its drives.
    :param bridge: whose that is; '': of the one in its namespace.
    """
    for service in 'get_parameters', 'quick_stop', 'save_trace':
        theirs = foreign(node, f'{name}/{service}')
        if theirs:
            is_bridge = service == 'save_trace' or name.endswith(f'/{_BRIDGE}')
            return other_middleware(
                bridge or (name if is_bridge else f'{namespace_of(name)}/{_BRIDGE}'),
                theirs, ours())
    return None
