# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The executables as a user drives them, which meet over ROS and a bus.

With the mark ``real``: in processes of their own. Without: on the bench (``on_bench.py``), where
no time passes but what the story takes.

Whatever a test started is ended after it, its outputs are shown when it fails, and a traceback in
any of them is a failure in itself.
"""

from collections.abc import Callable, Iterator
import itertools
import os
from pathlib import Path
from typing import Any, TYPE_CHECKING

from processes import Client, ClientProcess, Processes
import pytest
from slcan_peer import Answers, Peer
from waiting import DEADLINE
from world import bench_of, World

if TYPE_CHECKING:
    from on_bench import BenchPeer, BenchProcesses

_COUNTER = itertools.count(1)
_PROCESSES = pytest.StashKey[Processes]()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Give these tests more time than their own deadlines."""
    for item in items:
        if item.nodeid.startswith('test/system/'):
            item.add_marker(pytest.mark.timeout(5 * DEADLINE))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: Any) -> Iterator[None]:
    """Show the outputs of a failed test's processes."""
    report = yield
    processes = item.stash.get(_PROCESSES, None)
    if report.failed and processes is not None:
        report.sections.append(('processes', processes.dump()))
    return report


@pytest.fixture(name='world')
def _world(request: pytest.FixtureRequest) -> Iterator[World | None]:
    """Return the bench; None: the story is real."""
    yield from bench_of(request)


@pytest.fixture
def processes(request: pytest.FixtureRequest, tmp_path: Path, world: World | None,
              ) -> 'Iterator[Processes | BenchProcesses]':
    """Start processes; none of them outlives the test."""
    if world is not None:
        from on_bench import BenchProcesses
        bench = BenchProcesses(tmp_path, world)
        yield bench
        bench.end()
        return
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
def _client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ClientProcess]:
    client = ClientProcess(tmp_path_factory.mktemp('client'))
    yield client
    client.process.finish()


@pytest.fixture
def client(request: pytest.FixtureRequest, processes: 'Processes | BenchProcesses',
           world: World | None) -> Iterator[Client]:
    """Return the ROS client; of real stories a process that lives as long as the test run."""
    if world is not None:
        from on_bench import BenchClient
        bench = BenchClient(world)
        yield bench
        bench.close()
        return
    shared: ClientProcess = request.getfixturevalue('_client')
    assert isinstance(processes, Processes)
    processes.guests.append(shared.process)
    yield shared
    shared.ask('forget')


@pytest.fixture
def connect(world: World | None, tmp_path: Path) -> Iterator[Callable[[Answers], Any]]:
    """Return what puts a drive in literal text on the bus."""
    started: 'list[Peer | BenchPeer]' = []

    def begin(answers: Answers) -> 'Peer | BenchPeer':
        link = tmp_path / 'links' / 'main'
        if world is None:
            started.append(Peer(link, answers))
        else:
            from on_bench import BenchPeer
            started.append(BenchPeer(world, link, answers))
        return started[-1]
    yield begin
    for peer in started:
        peer.close()
