# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The bench: buses, drives, bridges and the graph, by one clock that jumps, and from one seed.

While a world is there, everything that is started in this process belongs to it: what opens a
bus, what asks rclpy for something, and whoever waits by ``waiting.py``. What happened in it is a
story that is printed when a test fails: frames and lines of the log, each at its time.
"""

from collections.abc import Iterator
from contextlib import contextmanager, ExitStack
import importlib
import os
import sys
from typing import Any
from unittest.mock import patch

from bus import Wires
from jumping import BEGIN, jumping, JumpingClock
import waiting

from drive_can_bridge.core.frame import Frame

#: who opens buses by python-can
_OPENERS = ('transport.link', 'transport.tap', 'simulation.simulation', 'cli.scan', 'cli.probe')
#: who makes a clock where nobody hands one in
_OWN_CLOCK = ('cli.main', 'client', 'simulation.simulation')
#: lines of a story that are shown
SHOWN = 80


#: the one that there is
current: 'World | None' = None


class World:
    """
    Everything that a story has.

    :ivar graph: that of ROS; None where it has none.
    """

    def __init__(self, clock: JumpingClock) -> None:
        self.clock = clock
        self.wires = Wires(clock, self._see)
        self.graph: Any = None
        self._story: list[tuple[float, str]] = []

    def tell(self, text: str) -> None:
        """Write something down that happened now."""
        self._story.append((self.clock.now(), text))

    def _see(self, bus: str, frame: Frame) -> None:
        self.tell(f'{bus} {frame}')

    def story(self) -> str:
        """Return what has happened lately."""
        left_out = len(self._story) - SHOWN
        return '\n'.join([f'seed {self.clock.seed}',
                          *([f'(without the first {left_out} lines)'] if left_out > 0 else []),
                          *(f'{at - BEGIN:9.4f} {text}' for at, text in self._story[-SHOWN:])])


def bench_of(request: Any, *, ros: bool = True) -> Iterator[World | None]:
    """Put a test on the bench, unless it has the mark ``real``: that one has None."""
    if request.node.get_closest_marker('real') is not None:
        yield None
    else:
        with world(int(os.environ['DRIVE_CAN_TEST_SEED']), ros=ros) as made:
            yield made


@contextmanager
def world(seed: int, *, ros: bool = False) -> Iterator[World]:
    """Make a world; ``ros``: with a graph."""
    with ExitStack() as stack:
        clock = stack.enter_context(jumping(seed))
        made = World(clock)
        for module in _OPENERS:
            stack.enter_context(patch.object(
                importlib.import_module(f'drive_can_bridge.{module}'), 'open_port',
                made.wires.open))
        for name in _OWN_CLOCK:
            stack.enter_context(patch.object(
                importlib.import_module(f'drive_can_bridge.{name}'), 'SteadyClock',
                lambda: clock))
        stack.enter_context(patch.object(waiting, 'virtual', clock))
        # nobody's priority matters, and one thread of a machine under test is not to rule it
        stack.enter_context(patch.object(os, 'sched_setscheduler', lambda *_: None))
        if ros:
            from graph import pretending, Responses
            made.graph = stack.enter_context(pretending(clock))
            made.graph.tell = made.tell
            stack.enter_context(patch('drive_can_bridge.ros.bridge_node.RclServices', Responses))
        stack.enter_context(patch.object(sys.modules[__name__], 'current', made))
        yield made
