# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What must be gone after a bridge has ended."""

import gc
import threading
import time
from weakref import WeakSet

import can.interfaces.virtual
from clients import Client, is_client, patience
import waiting

from drive_can_bridge.ros.drive_node import DriveNode

#: beginnings of the names of threads that a bridge or a simulation starts
THREADS = ('bus ', 'exchange ', 'services', 'simulation ', 'stop ')


def threads() -> list[str]:
    """Return the names of running threads of bridges and simulations."""
    running = threading.enumerate() if waiting.virtual is None else waiting.virtual.tasks
    return [thread.name for thread in running if thread.name.startswith(THREADS)]


def open_channels() -> list[str]:
    """Return the virtual buses that somebody has open."""
    return [str(channel) for channel, queues in can.interfaces.virtual.channels.items() if queues]


#: drive nodes that a web framework keeps, which is made for one application in a process
KEPT: 'WeakSet[DriveNode]' = WeakSet()


def drive_nodes() -> int:
    """Return how many drive nodes are still in memory."""
    gc.collect()
    # isinstance would ask each thing for its class, and some answer with an exception
    return sum(issubclass(type(thing), DriveNode) and thing not in KEPT
               for thing in gc.get_objects())


def assert_nothing_left(client: Client) -> None:
    """Fail if a thread, an open bus, a node or a drive is left over."""
    deadline = time.monotonic() + patience(60.0)
    gc.collect()
    while True:
        left = {'threads': threads(), 'buses': open_channels(),
                'nodes': sorted(name for name in client.nodes() if not is_client(name))}
        if not any(left.values()):
            break
        assert time.monotonic() < deadline, left
        time.sleep(0.02)
    assert not drive_nodes(), f'{drive_nodes()} drive nodes are still in memory'
