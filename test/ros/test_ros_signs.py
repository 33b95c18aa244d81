# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A bridge that does not answer in time: waited for as long as it is seen to live."""

from collections.abc import Callable
import os
from types import SimpleNamespace
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import pytest
from rcl_interfaces.srv import ListParameters

from drive_can_bridge.process.environment import no_bridge
from drive_can_bridge.process.presence import Present
from drive_can_bridge.ros.client import search, signs

BRIDGE = '/cell/drive_can_bridge'


class Asked:
    """Node calls that are answered by the test, or never: given up after so many s."""

    def __init__(self, _: Any, timeout: float) -> None:
        self.timeout = timeout
        self.waiting: list[tuple[float, str, Callable[[Any], None]]] = []

    def ask(self, _: str, service: str, request: Any, done: Callable[[Any], None], now: float,
            ) -> None:
        self.waiting.append((now + self.timeout, service, done))

    def look(self, now: float) -> None:
        waiting, self.waiting = self.waiting, []
        for each in waiting:
            if now >= each[0]:
                each[2](None)
            else:
                self.waiting.append(each)

    def answer(self) -> None:
        waiting, self.waiting = self.waiting, []
        for _, service, done in waiting:
            done(SimpleNamespace(values=[SimpleNamespace(string_array_value=[BRIDGE])])
                 if service == 'get_parameters' else ListParameters.Response())

    def close(self) -> None:
        self.waiting.clear()


@pytest.fixture
def looking(monkeypatch: pytest.MonkeyPatch) -> Callable[[bool], search.Search]:
    """Return a search that has found a bridge."""
    monkeypatch.setattr(search, 'NodeCalls', Asked)
    monkeypatch.setattr(search, 'foreign', lambda *_: '')
    node: Any = SimpleNamespace(handle=None, end=None, topics=tuple, services=lambda: [
        (f'{BRIDGE}/change_state', ['lifecycle_msgs/srv/ChangeState']),
        (f'{BRIDGE}/save_trace', ['std_srvs/srv/Trigger'])])

    def make(lives: bool) -> search.Search:
        sign: Any = SimpleNamespace(look=lambda _: None, lives=lambda _: lives,
                                    close=lambda: None)
        return search.Search(node, None, signs=lambda: sign)
    return make


def settled_after(looked: search.Search, *, answered_at: float = 1e9) -> float:
    """Return after how many s there is nothing more to be waited for."""
    for step in range(1000):
        now = 100.0 + 0.1 * step
        looked.look(now)
        if now - 100.0 >= answered_at:
            looked._calls.answer()  # type: ignore[attr-defined]
        if looked.settled or looked.over(now):
            return now - 100.0
    raise AssertionError('it goes on and on')


def test_one_that_is_not_seen_to_live_has_a_few_seconds(
        looking: Callable[[bool], search.Search]) -> None:
    looked = looking(False)
    assert settled_after(looked) == pytest.approx(5.0, abs=0.3)
    assert not looked.found[BRIDGE].answered
    assert no_bridge(None, [BRIDGE], looked.waited([BRIDGE])).endswith(
        f'{BRIDGE} does not, for 5 s (the computer may be busy)')


def test_one_that_lives_is_waited_for(looking: Callable[[bool], search.Search]) -> None:
    looked = looking(True)
    assert settled_after(looked, answered_at=12.0) == pytest.approx(12.0, abs=0.3)
    assert looked.found[BRIDGE].answered


def test_but_not_for_ever(looking: Callable[[bool], search.Search]) -> None:
    looked = looking(True)
    assert settled_after(looked) == pytest.approx(30.0, abs=5.3)
    assert looked.waited([BRIDGE]) >= 30.0


class Box:
    """A subscription whose messages come from the test."""

    messages: list[Any] = []

    def __init__(self, *arguments: Any) -> None:
        self._take = arguments[-1]

    def look(self) -> None:
        while self.messages:
            self._take(self.messages.pop())

    def close(self) -> None:
        pass


def look_about(used: Callable[[float], int | None], until: float, say_at: float = -1.0,
               ) -> signs.Signs:
    """Look for signs, of a bridge whose process has used so many ticks at a time."""
    now = [0.0]
    looked = signs.Signs(None, lambda: [Present(7, 0, BRIDGE, 1)],   # type: ignore[arg-type]
                         lambda process: used(now[0]) if process == 7 else None)
    for step in range(int(10.0 * until) + 1):
        now[0] = 0.1 * step
        if now[0] == pytest.approx(say_at):
            Box.messages.append(DiagnosticArray(status=[DiagnosticStatus(
                name='cell/drive_can_bridge: drive axis')]))
        looked.look(now[0])
    return looked


@pytest.mark.parametrize(('used', 'lives'), [
    (lambda now: int(10.0 * now), True),
    (lambda now: 100, False),                       # suspended
    (lambda now: min(100, int(100.0 * now)), False),    # since 1 s
    (lambda now: None, False)])
def test_a_process_lives_that_takes_time_of_the_processors(
        used: Callable[[float], int | None], lives: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(signs, 'Inbox', Box)
    looked = look_about(used, 6.0)
    assert looked.lives(BRIDGE) is lives
    assert not looked.lives('/cell/another')


@pytest.mark.parametrize(('said_at', 'lives'), [(1.0, False), (5.0, True)])
def test_a_bridge_lives_that_publishes_diagnostics(
        said_at: float, lives: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(signs, 'Inbox', Box)
    assert look_about(lambda now: None, 6.0, said_at).lives(BRIDGE) is lives


@pytest.mark.parametrize('hangs', [True, False])
@pytest.mark.parametrize('gap', [3.0, 4.5, 6.0])
def test_who_stood_still_itself_has_seen_no_lack_of_signs(
        hangs: bool, gap: float, looking: Callable[[bool], search.Search],
        monkeypatch: pytest.MonkeyPatch) -> None:
    """What takes diagnostics is imported first, which takes seconds on a busy computer."""
    monkeypatch.setattr(signs, 'Inbox', Box)
    now = [100.0]
    looked = looking(False)
    looked._make_signs = lambda: signs.Signs(
        None, lambda: [Present(7, 0, BRIDGE, 1)],   # type: ignore[arg-type]
        lambda _: 0 if hangs else int(10.0 * now[0]))
    for step in range(400):
        now[0] = 100.0 + 0.1 * step + (step > 11) * gap     # signs are looked for after 1 s
        looked.look(now[0])
        if not hangs and now[0] >= 112.0:
            looked._calls.answer()      # type: ignore[attr-defined]
        if looked.settled or looked.over(now[0]):
            break
    assert looked.found[BRIDGE].answered is not hangs
    assert now[0] - 100.0 < 13.0


def test_the_time_that_a_process_has_taken_is_read() -> None:
    before = signs.processor_time(os.getpid())
    assert before is not None
    while signs.processor_time(os.getpid()) == before:
        sum(range(100_000))
    assert signs.processor_time(2 ** 30) is None
