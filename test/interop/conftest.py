# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A bus of this process, and a network of the other stack on it."""

from collections.abc import Iterator
import itertools
import os
from typing import Any

import pytest
from world import World, world

_CHANNELS = itertools.count(1)


@pytest.fixture
def channel() -> str:
    """Return a channel of python-can's virtual bus that nobody else uses."""
    return f'interop {next(_CHANNELS)}'


@pytest.fixture(name='world', autouse=True)
def _world(request: pytest.FixtureRequest) -> Iterator[World | None]:
    """Put both stacks on the bench; None: the test has the mark ``real``."""
    pytest.importorskip('canopen')
    if request.node.get_closest_marker('real') is not None:
        yield None
        return
    from canopen_bench import by_the_clock_of
    with world(int(os.environ['DRIVE_CAN_TEST_SEED'])) as made, by_the_clock_of(made):
        yield made


@pytest.fixture
def network(channel: str, world: World) -> Iterator[Any]:
    """Return a network of the other stack on the bus."""
    from canopen_bench import connect
    connected = pytest.importorskip('canopen').Network()
    connect(connected, world, channel)
    yield connected
    connected.sync.stop()
    connected.disconnect()
