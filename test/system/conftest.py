# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The executables as a user drives them: in processes of their own, which meet over ROS and a bus.

Whatever a test started is ended after it, its outputs are shown when it fails, and a traceback in
any of them is a failure in itself.
"""

from collections.abc import Iterator
import itertools
import os
from pathlib import Path
from typing import Any

from processes import Client, Processes
import pytest
from waiting import DEADLINE

_COUNTER = itertools.count(1)
_PROCESSES = pytest.StashKey[Processes]()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Give these tests more time than their own deadlines."""
    here = Path(__file__).parent
    for item in items:
        if here in item.path.parents:
            item.add_marker(pytest.mark.timeout(5 * DEADLINE))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: Any) -> Iterator[None]:
    """Show the outputs of a failed test's processes."""
    report = yield
    processes = item.stash.get(_PROCESSES, None)
    if report.failed and processes is not None:
        report.sections.append(('processes', processes.dump()))
    return report


@pytest.fixture
def processes(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Processes]:
    """Start processes; none of them outlives the test."""
    started = Processes(tmp_path)
    request.node.stash[_PROCESSES] = started
    yield started
    started.end()
    assert not started.tracebacks(), 'traceback'


@pytest.fixture
def namespace() -> str:
    """Return a namespace that no other test uses: they share one ROS graph."""
    return f'test_{os.getpid()}_{next(_COUNTER)}'


@pytest.fixture(scope='session')
def _client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    client = Client(tmp_path_factory.mktemp('client'))
    yield client
    client.process.kill()


@pytest.fixture
def client(_client: Client, processes: Processes) -> Iterator[Client]:
    """Return the ROS client, a process that lives as long as the test run."""
    processes.guests.append(_client.process)
    yield _client
    _client.ask('forget')
