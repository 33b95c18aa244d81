# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Every example of every ``--help`` is run: here those that run until they are ended."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from importlib.util import find_spec
from pathlib import Path
import re
import signal

import help_examples
import pytest
from running import Running
from waiting import DEADLINE, wait_for

pytest.importorskip('rclpy')
pytestmark = pytest.mark.real

FILE = """\
/**/drive_can_bridge:
  ros__parameters:
    buses:
      main: {interface: virtual, channel: help_examples}
    drives:
      lift: {bus: main, protocol: datamodel_extended, station: 2,
             profile: datamodel_control_example, cyclic_request: [control_word, speed_setpoint],
             cyclic_response: [status_word, actual_speed]}
"""
#: the bridge of the others, and one that ends by itself
DEMOS = ('demo', 'demo --drive --duration 60')
#: what the first words of others show of it; the last ones show nothing before their end
SHOWS = {'monitor --json': '"drive"', 'monitor': 'conveyor online', 'panel': '^operator: http',
         'read': 'ramp_time', 'simulate': '^bus main', 'decode': '', 'record': ''}
#: port that another program may have -> any
PORTS = {'8081': '0'}
Start = Callable[[str], Running]


@pytest.fixture(name='type_it')
def _type_it(tmp_path: Path) -> Iterator[Start]:
    """Return what types an example, in a directory with robot.yaml."""
    (tmp_path / 'robot.yaml').write_text(FILE, encoding='utf-8')
    with ExitStack() as stack:
        def start(example: str) -> Running:
            words = [PORTS.get(word, word) for word in help_examples.taken_apart(example)]
            if words == ['panel']:
                words += ['--port', '0']
            place = tmp_path / f'run_{len(list(tmp_path.iterdir()))}'
            one = Running(place, 'drive_can', *words, cwd=tmp_path)
            stack.callback(one.close)
            return one
        yield start


def shows(example: str) -> str:
    """Return what can be read of an example that runs."""
    return next(text for start, text in SHOWS.items() if example.startswith(start))


def listens(one: Running) -> bool:
    """Tell whether a command looks after its end: what shows nothing may still be coming up."""
    status = Path(f'/proc/{one.process.pid}/status').read_text(encoding='ascii')
    caught = int(re.findall(r'^SigCgt:\s*(\w+)', status, re.MULTILINE)[0], 16)
    return bool(caught >> signal.SIGHUP - 1 & 1)


@pytest.mark.timeout(5 * DEADLINE)   # each of them has a deadline of its own
def test_all_of_them_beside_a_demo(type_it: Start, tmp_path: Path) -> None:
    others = [each for each in help_examples.ENDLESS if each not in DEMOS
              and (find_spec('nicegui') is not None or not each.startswith('panel'))]
    demo = type_it(DEMOS[0])
    demo.line('conveyor online')
    for example in others:  # one after the other: a slow machine has enough to do
        one = type_it(example)
        if shows(example):
            one.line(shows(example))
        for name in help_examples.taken_apart(example):
            if name.startswith('trace.'):
                wait_for((tmp_path / name).exists, f'{name} to be begun')
        wait_for(partial(listens, one), f'{example} to look after signals')
        assert one.end(signal.SIGINT) == 0, (example, one.errors)
        assert 'Traceback' not in one.errors, example
    assert demo.end(signal.SIGINT) == 0, demo.errors


def test_the_demo_alone(type_it: Start) -> None:
    demo = type_it(DEMOS[1])
    demo.line('lift online')
    assert demo.end(signal.SIGINT) == 0, demo.errors
