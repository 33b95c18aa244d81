# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""No thread keeps the interpreter for long; those of an exchange go first."""

import gc
import os
from pathlib import Path
import sys
import threading
from types import SimpleNamespace

import pytest

from drive_can_bridge.process import scheduling

SOURCES = Path(scheduling.__file__).parents[1]


@pytest.mark.parametrize(('handover', 'interval', 'allowed'), [
    (6e-6, 0.0001, True), (6e-6, 0.0001, False),
    # threads that wait would do nothing but ask for the interpreter
    (60e-6, 0.0006, True), (0.002, 0.005, True)])
def test_be_punctual(monkeypatch: pytest.MonkeyPatch, handover: float, interval: float,
                     allowed: bool) -> None:
    asked: list[tuple[int, ...]] = []

    def set_priority(*arguments: int) -> None:
        asked.append(arguments)
        if not allowed:
            raise PermissionError(13, 'Permission denied')
    monkeypatch.setattr(os, 'setpriority', set_priority)
    monkeypatch.setattr(scheduling, 'handover_time', lambda: handover)
    before, thresholds = sys.getswitchinterval(), gc.get_threshold()
    try:
        scheduling.be_punctual()
        assert sys.getswitchinterval() == pytest.approx(interval)
        assert asked == [(os.PRIO_PROCESS, 0, -10)]
        # whatever anybody keeps the bridge busy with, nobody stops to look at all of it
        passes: list[int] = []
        gc.callbacks.append(lambda phase, found: passes.append(found['generation']))
        assert len([[] for _ in range(300_000)]) == 300_000
        gc.callbacks.pop()
        assert set(passes) == {0, 1}
    finally:
        sys.setswitchinterval(before)
        gc.set_threshold(*thresholds)


@pytest.mark.usefixtures('threads')
def test_a_handover_is_measured_there_and_back(monkeypatch: pytest.MonkeyPatch) -> None:
    # one round of 80 us among slower ones
    times = iter([0.0, 0.001] + [1.0, 1.00008] + 18 * [2.0, 2.5])
    monkeypatch.setattr(scheduling, 'time', SimpleNamespace(perf_counter=lambda: next(times)))
    before = threading.active_count()
    assert scheduling.handover_time() == pytest.approx(40e-6)
    assert threading.active_count() == before


def test_whoever_runs_a_bridge_asks_for_it() -> None:
    assert '    be_punctual()\n' in (SOURCES / 'ros' / 'main.py').read_text(encoding='utf-8')


def test_priority_is_asked_for_this_thread_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, int, int]] = []
    monkeypatch.setattr(os, 'sched_setscheduler', lambda thread, policy, parameter: asked.append(
        (thread, policy, parameter.sched_priority)))
    assert scheduling.raise_priority() == scheduling.RAISED
    # first in, first out; what this thread starts is not
    assert asked == [(0, 0x40000000 | 1, 40)]


def test_a_system_that_does_not_allow_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(1, 'Operation not permitted')
    monkeypatch.setattr(os, 'sched_setscheduler', refuse)
    assert scheduling.raise_priority() == scheduling.NOT_RAISED
    monkeypatch.delattr(os, 'sched_setscheduler')  # as on other systems
    assert scheduling.raise_priority() == scheduling.NOT_RAISED


@pytest.mark.usefixtures('threads')
def test_threads_that_a_real_time_thread_starts_are_ordinary() -> None:
    policies: list[int] = []

    def child() -> None:
        policies.append(os.sched_getscheduler(0))

    def parent() -> None:
        if scheduling.raise_priority() != scheduling.RAISED:
            return
        policies.append(os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK)
        thread = threading.Thread(target=child)
        thread.start()
        thread.join()

    thread = threading.Thread(target=parent)
    thread.start()
    thread.join()
    if not policies:
        pytest.skip('this system does not allow real-time priorities')
    assert policies == [os.SCHED_FIFO, os.SCHED_OTHER]
    assert os.sched_getscheduler(0) == os.SCHED_OTHER
