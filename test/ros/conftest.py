# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The bridge's node with real rclpy, simulated drives and a virtual bus, all in this process.

Whatever a test starts is stopped after it, and has to be gone then: threads, buses, nodes. What
the tests of a module share is stopped after the last of them, or before one that starts its own.
"""

from collections.abc import Iterator
import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

MISSING = importlib.util.find_spec('rclpy') is None
if TYPE_CHECKING or not MISSING:
    from bridges import Bridge, StartBridge
    from clients import Client, ClientContext
    from leaks import assert_nothing_left


class _Skipped(pytest.Module):
    """A module that cannot even be imported."""

    def collect(self) -> list[pytest.Item]:
        pytest.skip('ROS 2 is not installed: rclpy cannot be imported', allow_module_level=True)


def pytest_pycollect_makemodule(module_path: Path, parent: pytest.Collector,
                                ) -> pytest.Module | None:
    """Skip everything in here where ROS 2 is missing."""
    return _Skipped.from_parent(parent, path=module_path) if MISSING else None


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


class _Shared:
    """The bridge that the tests of a module share, one at a time."""

    def __init__(self, directory: Path, context: 'ClientContext') -> None:
        self._directory = directory
        self._context = context
        self._content: object = None
        self._one: Bridge | None = None

    def start(self, content: object = None) -> 'Bridge':
        if self._one is None or content != self._content:
            self.close()
            self._one, self._content = Bridge(self._directory, content), content
            self._one.begin()
        for drive in self._one.played.values():
            drive.fault('ok')
        self._one.online()
        return self._one

    def close(self) -> None:
        if self._one is None:
            return
        one, self._one = self._one, None
        one.close()
        assert not one.errors, one.errors
        del one
        client = Client(self._context)
        try:
            assert_nothing_left(client)
        finally:
            client.close()


@pytest.fixture(scope='module')
def _shared(_client_context: 'ClientContext',
            tmp_path_factory: pytest.TempPathFactory) -> Iterator[_Shared]:
    shared = _Shared(tmp_path_factory.mktemp('shared'), _client_context)
    yield shared
    shared.close()


@pytest.fixture
def shared_bridge(_shared: _Shared) -> 'StartBridge':
    """
    Return the module's bridge with these parameters, online; whoever got it before used it.

    For tests that leave nothing behind but values of parameters and counters.
    """
    return _shared.start


@pytest.fixture
def bridge(client: 'Client', tmp_path: Path, _shared: _Shared) -> Iterator['StartBridge']:
    """Start bridges with their simulated drives; see :class:`bridges.Bridge`."""
    started: list[Bridge] = []

    def start(content: object = None, **options: object) -> Bridge:
        _shared.close()
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
