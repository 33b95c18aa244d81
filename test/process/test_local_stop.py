# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can stop`` at its end of the local way: what bridges may say, and how they may fail."""

from collections.abc import Callable, Sequence
from typing import Any

import pytest

from drive_can_bridge.cli.stopping import answers, finished, WithoutRos
from drive_can_bridge.process import local_stop
from drive_can_bridge.process.local_stop import Answer, LocalStop
from drive_can_bridge.process.presence import Present

BRIDGE = Present(1, 0, '/bridge', 1)
#: what a bridge with one drive, that sees another bridge, says to a stop
SAID = [['drives', '/lift'], ['around'], ['bridge', '/bridge', '0', '/bridge', '/far'],
        ['drive', '/lift', '1', '1', 'ready'], ['end']]

#: takes what is asked; returns what is said, in this order, with None where nothing has come yet
Played = Callable[[list[str]], Any]


class Host:
    """
    A host with one bridge.

    :ivar asked: what it was asked.
    :ivar busy: so many calls from now on are not taken.
    """

    def __init__(self, patch: pytest.MonkeyPatch, play: Played, *, believed: bool = True) -> None:
        self.asked: list[list[str]] = []
        self.busy: list[bool] = []
        self._play = play
        self._believed = believed
        patch.setattr(local_stop, 'bridges', lambda: [BRIDGE])
        patch.setattr(local_stop, 'Line', self._line)
        patch.setenv('DRIVE_CAN_LOCAL', 'on')
        patch.setenv('ROS_DOMAIN_ID', '0')

    def _line(self, _: Present) -> Any:
        if self.busy and self.busy.pop(0):
            raise BlockingIOError
        return Line(self)

    def answers(self, question: Sequence[str]) -> Any:
        """Return what is said."""
        self.asked.append(list(question))
        return iter(self._play(list(question)))


class Line:
    """A connection."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._answers: Any = iter(())
        self.believed = host._believed

    def ask(self, *words: str) -> None:
        """Ask."""
        self._answers = self._host.answers(words)

    def take(self) -> Any:
        """Return what was said."""
        return next(self._answers, None)

    def close(self) -> None:
        """Hang up."""


def played(question: list[str]) -> Any:
    """Be a bridge that passes a stop on."""
    if question[0] == 'stop':
        return SAID
    return [['drives', '/arm'], ['passed', '/arm', '1', 'stopped', '0'], ['end']]


def looked(stop: LocalStop, *times: float) -> list[bool]:
    """Look at these times; return whether all was done."""
    return [stop.look(each) for each in times]


def test_one_that_is_busy_when_a_stop_is_passed_on_is_asked_for_that_again(
        monkeypatch: pytest.MonkeyPatch) -> None:
    host = Host(monkeypatch, played)
    host.busy = [False, True, True]
    stop = LocalStop(None, [])
    assert looked(stop, 0.0, 0.002, 0.004, 0.006) == [False, False, True, True]
    assert host.asked == [['stop', '*'], ['pass', '/far', '', '/lift', '']]
    assert [(answer.name, answer.ok) for answer in stop.answers()] == [
        ('/lift', True), ('/arm', True)]


def test_one_that_stays_busy_leaves_the_others_to_ros(monkeypatch: pytest.MonkeyPatch) -> None:
    host = Host(monkeypatch, played)
    host.busy = [False, *[True] * 99]
    stop = LocalStop(None, [])
    assert looked(stop, 0.0, 0.5) == [False, False]
    assert not stop.look(1.1) and stop.over(1.1) and stop.wants_ros(1.1)
    assert host.asked == [['stop', '*']]


def dies(_: list[str]) -> Any:
    """Pass nothing on."""
    yield ['drives', '/arm']
    raise ConnectionResetError


def hangs(_: list[str]) -> Any:
    """Say nothing any more."""
    while True:
        yield None


@pytest.mark.parametrize(('passes', 'at'), [
    (dies, 0.0), (lambda _: [['no', 'another user']], 0.0), (hangs, 1.1)],
    ids=['dies', 'refuses', 'hangs'])
def test_one_that_does_not_pass_a_stop_on_leaves_the_others_to_ros(
        monkeypatch: pytest.MonkeyPatch, passes: Played, at: float) -> None:
    """It has answered for its own drives, which does not stop those of others."""
    Host(monkeypatch, lambda question: SAID if question[0] == 'stop' else passes(question))
    stop = LocalStop(None, [])
    assert looked(stop, 0.1, 0.1 + at) == [False, False]
    assert stop.over(0.1 + at) and stop.wants_ros(0.1 + at)
    assert [answer.name for answer in stop.answers()] == ['/lift']


def test_one_that_passes_a_stop_on_to_a_slow_drive_does_not_hang(
        monkeypatch: pytest.MonkeyPatch) -> None:
    def slow(_: list[str]) -> Any:
        for _ in range(7):
            yield from (['passing'], None)
        yield from played(['pass'])
    Host(monkeypatch, lambda question: SAID if question[0] == 'stop' else slow(question))
    stop = LocalStop(None, [])
    times = [0.9 * number for number in range(1, 9)]
    assert looked(stop, *times) == [False] * 8 and not any(map(stop.wants_ros, times))
    assert stop.look(8.1)
    assert [(answer.name, answer.ok) for answer in stop.answers()] == [
        ('/lift', True), ('/arm', True)]


def test_one_that_passes_on_for_ever_leaves_the_others_to_ros(
        monkeypatch: pytest.MonkeyPatch) -> None:
    def for_ever(_: list[str]) -> Any:
        while True:
            yield from (['passing'], None)
    Host(monkeypatch, lambda question: SAID if question[0] == 'stop' else for_ever(question))
    stop = LocalStop(None, [])
    times = [0.9 * number for number in range(1, 15)]
    assert not any(looked(stop, *times))
    assert stop.over(times[-1]) and stop.wants_ros(times[-1])


@pytest.mark.parametrize('refusal', [ConnectionRefusedError, None], ids=['older', 'strange'])
def test_one_that_is_not_reached_is_left_to_ros_whoever_else_answers(
        monkeypatch: pytest.MonkeyPatch, refusal: type[OSError] | None) -> None:
    other = BRIDGE._replace(process=2, name='/other')
    host = Host(monkeypatch, lambda _: [[*each, '/bridge', '/other'][:5] if each[0] == 'bridge'
                                        else each for each in SAID])
    monkeypatch.setattr(local_stop, 'bridges', lambda: [BRIDGE, other])

    def line(present: Present) -> Any:
        if present == other and refusal is not None:
            raise refusal
        found = Line(host)
        found.believed = present == BRIDGE
        return found
    monkeypatch.setattr(local_stop, 'Line', line)
    stop = LocalStop(None, [])
    assert looked(stop, 0.1, 0.2, 1.3) == [False] * 3
    assert stop.over(1.3) and stop.wants_ros(0.2)
    assert stop.unheard == [other]


def test_one_that_talks_without_end_holds_up_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    def for_ever(_: list[str]) -> Any:
        while True:
            yield ['around', 'x']
    Host(monkeypatch, for_ever)
    stop = LocalStop(None, [])
    assert looked(stop, 0.0, 0.5) == [False, False]
    assert stop.over(1.1) and stop.wants_ros(1.1)
    assert stop.unheard == [BRIDGE]


def test_one_of_another_user_is_asked_and_not_listened_to(monkeypatch: pytest.MonkeyPatch) -> None:
    def spoken(_: list[str]) -> Any:
        raise AssertionError('was listened to')
        yield
    host = Host(monkeypatch, spoken, believed=False)
    stop = LocalStop(None, [])
    assert not stop.look(0.0)
    assert stop.wants_ros(0.0) and stop.unheard == [BRIDGE]
    assert host.asked == [['stop', '*']]


@pytest.mark.parametrize('said', [
    ['bridge'], ['drive', '/lift'], ['passed'], ['drive', '/lift', '1', '1', 'ready', 'more'],
    ['']], ids=' '.join)
def test_nonsense_is_no_answer(monkeypatch: pytest.MonkeyPatch, said: list[str]) -> None:
    Host(monkeypatch, lambda _: [said])
    stop = LocalStop(None, [])
    stop.look(0.0)
    assert not stop.answers() and stop.unheard == [BRIDGE]


def test_one_that_dies_in_the_answer_has_stopped_what_it_said(
        monkeypatch: pytest.MonkeyPatch) -> None:
    def dies(_: list[str]) -> Any:
        yield ['drives', '/lift', '/hoist']
        yield ['bridge', '/bridge', '0', '/bridge']
        yield ['drive', '/lift', '1', '1', 'ready']
        raise ConnectionResetError
    Host(monkeypatch, dies)
    stop = LocalStop(None, [])
    assert stop.look(0.0)
    assert [(answer.name, answer.ok, answer.text) for answer in stop.answers()] == [
        ('/lift', True, 'ready'), ('/hoist', False, 'no answer: may still be running')]


@pytest.mark.parametrize(('word', 'named'), [('/lift', False), ('/drive1', True), ('/d*', True)])
def test_one_that_hangs_is_named_where_a_drive_of_it_may_be_meant(
        monkeypatch: pytest.MonkeyPatch, word: str, named: bool) -> None:
    """What others know of it counts, whatever ROS has found out until then."""
    other = BRIDGE._replace(process=2, name='/other', drives=2)
    said = [['drives', '/lift'], ['around', '/drive1', '/drive3'],
            ['bridge', '/bridge', '0', '/bridge', '/other'], ['end']]
    host = Host(monkeypatch, lambda _: said)
    monkeypatch.setattr(local_stop, 'bridges', lambda: [BRIDGE, other])

    def line(present: Present) -> Any:
        found = Line(host)
        if present == other:
            found.ask = lambda *_: None     # type: ignore[method-assign]
        return found
    monkeypatch.setattr(local_stop, 'Line', line)

    class Ros(WithoutRos):
        seen = ('/other',)

        def answers(self, present: object = ()) -> list[Answer]:
            return [Answer('/other', False, 'it does not answer', bridge=True)]
    stop = LocalStop(None, [word])
    assert looked(stop, 0.1, 1.2) == [False, True]
    found = [answer.name for answer in answers(stop, Ros(), None, [word]) if answer.bridge]
    assert found == ['/other'] * named


def test_whatever_goes_wrong_at_first_the_command_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    host = Host(monkeypatch, played)
    early = local_stop.begin(['lift'])
    assert early is not None and host.asked == [['stop', '*', 'lift']]

    def fails(*_: Any) -> Any:
        raise RuntimeError
    with monkeypatch.context() as patch:
        patch.setattr(LocalStop, 'look', fails)
        assert finished(early) is None
    assert local_stop.begun(None, ['lift']) is early.stop and not early.stop.look(5.0)
