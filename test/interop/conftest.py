# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A bus of this process, and a network of the other stack on it."""

from collections.abc import Iterator
import itertools
from typing import Any

import pytest

_CHANNELS = itertools.count(1)


@pytest.fixture
def channel() -> str:
    """Return a channel of python-can's virtual bus that nobody else uses."""
    return f'interop {next(_CHANNELS)}'


@pytest.fixture
def network(channel: str) -> Iterator[Any]:
    """Return a network of the other stack on the bus."""
    connected = pytest.importorskip('canopen').Network()
    connected.NOTIFIER_CYCLE = 0.05
    connected.connect(interface='virtual', channel=channel)
    yield connected
    connected.sync.stop()
    connected.disconnect()
