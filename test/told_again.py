# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The one excuse: a story about the wall clock that fails is told again if the machine stalled.

Only where that was measured (``stalls.py``), at most :data:`AGAIN` times, and each time in plain
sight. A run in which that happened more than :data:`AGAIN_IN_ALL` times is red.
"""

import sys
import time
from typing import Any

from _pytest.runner import runtestprotocol
import pytest
from stalls import Witness

AGAIN, AGAIN_IN_ALL = 2, 3


class ToldAgain:
    """Runs the tests with the mark ``real``; a plugin of pytest."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config
        self._witness: Witness | None = None
        self._lines: list[str] = []

    def pytest_runtest_protocol(self, item: pytest.Item,
                                nextitem: pytest.Item | None) -> bool | None:
        """Tell a story, and again if the machine stood still and it failed."""
        if item.get_closest_marker('real') is None:
            return None
        if self._witness is None:
            self._witness = Witness()
            self._config.add_cleanup(self._witness.close)
        item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
        for again in range(AGAIN + 1):
            begin = time.monotonic()
            reports = runtestprotocol(item, log=False, nextitem=nextitem)
            if again == AGAIN or not any(report.failed for report in reports):
                break
            stalls = self._witness.between(begin, time.monotonic())
            if not stalls:
                break
            self._lines.append(f'{item.nodeid}: told again, the machine stalled '
                               f'({"; ".join(map(str, stalls))}): {_failure(reports)}')
            self._say(self._lines[-1])
            _renew(item)
        for report in reports:
            item.ihook.pytest_runtest_logreport(report=report)
        item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
        return True

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Let a run be red in which too much had to be told again."""
        if len(self._lines) > AGAIN_IN_ALL and not session.exitstatus:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """Say what was told again."""
        if self._lines:
            terminalreporter.section(f'told again: {len(self._lines)}, at most {AGAIN_IN_ALL}')
            for line in self._lines:
                terminalreporter.line(line)

    def _say(self, text: str) -> None:
        capture = self._config.pluginmanager.getplugin('capturemanager')
        with capture.global_and_fixture_disabled():
            sys.stderr.write(f'\n{text}\n')
            sys.stderr.flush()


def _failure(reports: list[pytest.TestReport]) -> str:
    failed = next(report for report in reports if report.failed)
    crash = getattr(failed.longrepr, 'reprcrash', None)
    return str(crash or failed.longrepr).strip().splitlines()[0]


def _renew(item: pytest.Item) -> None:
    """Have an item begin anew: its fixtures, and the time that it may take."""
    item._initrequest()     # type: ignore[attr-defined]
    for definitions in item._fixtureinfo.name2fixturedefs.values():  # type: ignore[attr-defined]
        for definition in definitions:
            if definition.cached_result is not None and definition.cached_result[2] is not None:
                definition.cached_result = None     # it failed
    if item.config.pluginmanager.hasplugin('timeout'):
        from pytest_timeout import _get_item_settings
        item.ihook.pytest_timeout_cancel_timer(item=item)
        item.ihook.pytest_timeout_set_timer(item=item, settings=_get_item_settings(item))
