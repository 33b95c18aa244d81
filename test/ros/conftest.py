# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The bridge's node with its drives and whoever uses it, on the bench (``clocked/``).

Where a test has the mark ``real``: with the graph, the threads and the clock of this machine.

Whatever a test starts is stopped after it, and has to be gone then: threads, buses, nodes.
"""

from collections.abc import Iterator
import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from world import bench_of, World

MISSING = importlib.util.find_spec('rclpy') is None
if TYPE_CHECKING or not MISSING:
    from bridges import Bridge, StartBridge
    from by_hand import command, Lines, Run
    from clients import Client, ClientContext, is_client
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
def _real_context() -> Iterator['ClientContext']:
    context = ClientContext()
    yield context
    context.close()


@pytest.fixture
def bench(request: pytest.FixtureRequest) -> Iterator[World | None]:
    """Put a test on the bench, unless it has the mark ``real``: that one has None."""
    yield from bench_of(request)


@pytest.fixture
def _client_context(bench: World | None,
                    request: pytest.FixtureRequest) -> Iterator['ClientContext']:
    if bench is None:
        yield request.getfixturevalue('_real_context')
        return
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
def bridge(client: 'Client', tmp_path: Path, bench: World | None) -> Iterator['StartBridge']:
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
    if bench is None:
        assert_nothing_left(client)
    else:
        assert all(map(is_client, client.nodes()))


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> 'Run':
    """Run a command; return exit code, lines, and standard error."""
    return command(capsys, monkeypatch)


@pytest.fixture
def locally(monkeypatch: pytest.MonkeyPatch) -> 'Lines':
    """Let commands reach bridges of this process by the local way, from now on."""
    return Lines(monkeypatch)


@pytest.fixture
def shared_bridge(bridge: 'StartBridge') -> 'StartBridge':
    """Start a bridge whose drives are online."""
    def start(content: object = None) -> 'Bridge':
        one = bridge(content).online()
        return one
    return start
