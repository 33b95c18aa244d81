# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The bridge's node with real rclpy, simulated drives and a virtual bus, all in this process.

Whatever a test starts is stopped after it, and has to be gone then: threads, buses, nodes.
"""

from collections.abc import Iterator
import importlib.util
import os
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

# Before rclpy is imported: nothing leaves this machine, and others on it are left alone.
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
os.environ.setdefault('ROS_DOMAIN_ID', str(10 + os.getpid() % 80))

# Without rclpy every module here skips itself, in clients.py.
if TYPE_CHECKING or importlib.util.find_spec('rclpy') is not None:
    from bridges import Bridge, StartBridge
    from clients import Client, ClientContext
    from leaks import assert_nothing_left


@pytest.fixture(scope='session')
def _client_context() -> Iterator['ClientContext']:
    context = ClientContext()
    yield context
    context.close()


@pytest.fixture
def client(_client_context: 'ClientContext') -> Iterator['Client']:
    """Return a node of its own for each test, in a context apart from the bridge's."""
    node = Client(_client_context)
    yield node
    node.close()


@pytest.fixture
def bridge(client: 'Client', tmp_path: Path) -> Iterator['StartBridge']:
    """Start bridges with their simulated drives; see :class:`bridges.Bridge`."""
    started: list[Bridge] = []

    def start(content: object = None, **options: object) -> Bridge:
        one = Bridge(tmp_path, content, **options)
        started.append(one)
        one.begin()
        return one
    yield start
    errors = []
    for one in reversed(started):
        one.close()
        errors += one.errors
    started.clear()
    assert not errors, errors
    assert_nothing_left(client)
