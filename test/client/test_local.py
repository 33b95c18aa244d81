# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The local way at the end of a command: what bridges may say, and how they may end."""

from collections.abc import Iterator
from itertools import count
from typing import Any

from clocks import HandClock, REAL
import pytest

from drive_can_bridge.client import local
from drive_can_bridge.client.local import local_way, local_ways
from drive_can_bridge.core.errors import NoAnswer
from drive_can_bridge.process.presence import Present


class Host:
    """
    A host with one bridge.

    :ivar process: of the bridge; 0: it has ended.
    :ivar lines: connections to it, so far.
    :ivar said: to whatever is asked.
    """

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.process = 1
        self.lines: list[Line] = []
        self.asked: list[list[str]] = []
        self.said: list[list[str]] = [['value', 'd1.5']]
        patch.setattr(local, 'bridges', self.bridges)
        patch.setattr(local, 'Line', self._line)
        patch.setenv('DRIVE_CAN_LOCAL', 'on')
        patch.setenv('ROS_DOMAIN_ID', '0')

    def bridges(self) -> list[Present]:
        """Return what the kernel shows."""
        return [Present(self.process, 0, '/bridge', 1)] if self.process else []

    def _line(self, present: Present) -> Any:
        if present.process != self.process:
            raise ConnectionRefusedError
        self.lines.append(Line(self))
        return self.lines[-1]


class Line:
    """A connection."""

    believed = True

    def __init__(self, host: Host) -> None:
        self._host = host
        self._process = host.process
        self._left: Iterator[list[str]] = iter(())
        self.open = True

    def ask(self, *words: str) -> None:
        """Ask."""
        if not self.open or self._process != self._host.process:
            raise BrokenPipeError
        self._host.asked.append(list(words))
        said = ([['drives', '/lift'], ['around'], ['bridge', '/bridge', '0', '/bridge']]
                if words[0] == 'who' else self._host.said)
        self._left = iter([*said, ['end']])

    def take(self) -> list[str] | None:
        """Return what was said."""
        if self._process != self._host.process:
            raise ConnectionResetError
        return next(self._left, None)

    def close(self) -> None:
        """Hang up."""
        self.open = False


@pytest.fixture
def host(monkeypatch: pytest.MonkeyPatch) -> Host:
    """Let commands see one bridge."""
    return Host(monkeypatch)


def test_one_connection_is_enough(host: Host) -> None:
    way = local_way(None, REAL)
    assert way is not None
    assert [list(way.get('/lift', ['ramp_time'])) for _ in range(50)] == [[1.5]] * 50
    assert len(host.lines) == 1
    way.close()


def test_what_has_arrived_counts_however_late_it_is_read(host: Host) -> None:
    minutes = count(0.0, 60.0)      # between any two looks this process does not run for one
    way = local_way(None, HandClock(lambda: next(minutes)))
    assert way is not None
    host.said *= 9
    assert list(way.get('/lift', ['ramp_time'])) == [1.5] * 9
    way.close()


def test_an_answer_that_never_ends_is_none(host: Host) -> None:
    minutes = count(0.0, 60.0)
    way = local_way(None, HandClock(lambda: next(minutes)))
    assert way is not None
    host.lines[0].take = lambda: ['value', 'd1.5']      # type: ignore[method-assign]
    with pytest.raises(NoAnswer):
        way.get('/lift', ['ramp_time'])


def test_one_that_was_hung_up_on_for_its_silence_calls_again(host: Host) -> None:
    way = local_way(None, REAL)
    assert way is not None
    host.lines[0].close()
    assert list(way.get('/lift', ['ramp_time'])) == [1.5]
    assert len(host.lines) == 2


def test_a_bridge_that_was_started_again_is_asked_again(host: Host) -> None:
    way = local_way(None, REAL)
    assert way is not None
    host.process = 0
    for _ in range(2):
        with pytest.raises(NoAnswer, match='/lift has gone'):
            way.get('/lift', ['ramp_time'])
    host.process = 7
    assert list(way.get('/lift', ['ramp_time'])) == [1.5]


def test_it_is_not_asked_twice_where_it_may_have_heard(host: Host) -> None:
    way = local_way(None, REAL)
    assert way is not None

    def end() -> Any:
        host.process = 7
        raise ConnectionResetError
    host.lines[0].take = end    # type: ignore[method-assign]
    with pytest.raises(NoAnswer) as trouble:
        way.set('/lift', 'ramp_time', 2.0)
    assert trouble.value.asked
    assert [words[0] for words in host.asked] == ['who', 'set']


@pytest.mark.parametrize('said', [
    ['value'], ['value', 'x1'], ['described', 'a'], ['result', '1'], ['fact', 'a'], ['']])
def test_nonsense_is_no_answer(host: Host, said: list[str]) -> None:
    way = local_way(None, REAL)
    assert way is not None
    host.said = [said]
    asked = {'value': lambda: way.get('/lift', ['a']), 'fact': lambda: way.condition(
        'lift', age=1.0, patience=1.0), 'result': lambda: way.set('/lift', 'a', 1.0)}.get(
            said[0], lambda: way.describe('/lift', ['a']))
    with pytest.raises(NoAnswer, match='/lift does not answer: this makes no sense'):
        asked()


@pytest.mark.parametrize('said', [['drive'], ['drive', '/lift'], ['drive', '/lift', '1']])
def test_nonsense_moves_nothing(host: Host, said: list[str]) -> None:
    host.said = [said]
    with local_ways(REAL) as ways:
        assert ways.known(None) == ['/lift']
        answer, = ways.give('enable', ['/lift'])
    assert (answer.ok, answer.text) == (False, 'no answer')


def test_a_bridge_that_introduces_itself_in_nonsense_is_none(
        host: Host, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Line, 'take', lambda _: ['bridge'])
    monkeypatch.setattr(local, 'PATIENCE', 0.05)    # it talks without end
    assert local_way(None, REAL) is None
    said = iter([['bridge'], ['end']])
    monkeypatch.setattr(Line, 'take', lambda _: next(said))
    assert local_way(None, REAL) is None
