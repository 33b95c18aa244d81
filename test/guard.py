# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Sees that a test which starts a process, or a thread, says so.

What hangs on how long things take has the mark ``real``. A thread that is handed its events, and
waits for nothing else, is none of that, and neither is a program that runs to its end, however
long that takes: tests of those use the fixtures ``threads`` and ``programs``. The threads of the
bench (``clocked/``) wait for their turn.
"""

from collections.abc import Callable, Iterator
from functools import partial
import os
import subprocess
import threading
from typing import Any

from jumping import TurnThread
import pytest

#: marks of tests that may start anything
MARKS = ('real', 'browser', 'linter')
#: how threads and processes begin -> the fixture of those that need no time limit
BEGINNINGS = {'threads': [(threading.Thread, 'start')],
              'programs': [(subprocess.Popen, '__init__'), (os, 'fork'), (os, 'posix_spawn')]}


class Guard:
    """Fails tests that start what they do not say."""

    def __init__(self, config: pytest.Config) -> None:
        self._started: dict[str, list[str]] = {}
        for fixture, places in BEGINNINGS.items():
            for owner, name in places:
                former = getattr(owner, name)
                setattr(owner, name, self._noting(former, fixture))
                config.add_cleanup(partial(setattr, owner, name, former))

    def _noting(self, begin: Callable[..., Any], fixture: str) -> Callable[..., Any]:
        def started(*arguments: Any, **options: Any) -> Any:
            # a thread has itself, a process has its words behind itself
            what = arguments[-1] if arguments else options
            if not isinstance(what, TurnThread):
                self._started.setdefault(fixture, []).append(str(what))
            return begin(*arguments, **options)
        return started

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[Any]:
        """Begin to look."""
        self._started.clear()
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item, call: Any) -> Iterator[Any]:
        """Say what was started."""
        report = yield
        if report.when == 'teardown' and report.passed and not any(
                map(item.get_closest_marker, MARKS)):
            for fixture, started in self._started.items():
                if fixture not in getattr(item, 'fixturenames', ()):
                    report.outcome = 'failed'
                    report.longrepr = (
                        f'this test started {len(started)} {fixture}, {started[0][:200]} first. '
                        f'Tell it on the bench, or give it the mark "real"; where it needs no '
                        f'time limit, give it the fixture "{fixture}"')
        return report
