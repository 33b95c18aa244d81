# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Locks of the host: one holder, named to the others; free at once when it ends, however."""

import os
from pathlib import Path
import subprocess
import sys
import threading
from types import SimpleNamespace

import pytest
from waiting import wait_for

from drive_can_bridge.process import locks
from drive_can_bridge.process.locks import Held, holder, HostLock, take

HOLDER = """
import sys, time
from drive_can_bridge.process.locks import take
locks = take(dict.fromkeys(sys.argv[1:], 'drive_can write'))
print('taken', flush=True)
time.sleep(600)
"""


def key(name: str) -> str:
    """Return a key that no other test run has."""
    return f'test {os.getpid()} {name}'


def elsewhere(*keys: str) -> subprocess.Popen[str]:
    """Let another process take locks."""
    process = subprocess.Popen([sys.executable, '-c', HOLDER, *keys], stdout=subprocess.PIPE,
                               text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == 'taken\n'
    return process


def test_who_did_not_run_for_a_while_looks_once_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """The name of the holder comes a moment behind its lock."""
    mine = HostLock(key('a'), 'drive_can_bridge')
    table, now = Path(locks.TABLE).read_text(encoding='utf-8'), [0.0]
    texts = iter(['', table])

    def read(*_: object, **__: object) -> str:
        now[0] += 60.0
        return next(texts)
    monkeypatch.setattr(locks, 'Path', lambda _: SimpleNamespace(read_text=read))
    monkeypatch.setattr(locks, 'time', SimpleNamespace(
        monotonic=lambda: now[0], sleep=lambda _: None))
    found = holder(key('a'))
    assert found is not None
    assert found.process == os.getpid()
    mine.release()


def test_one_holder_in_a_process() -> None:
    first = HostLock(key('a'), 'drive_can_bridge')
    with pytest.raises(Held) as caught:
        HostLock(key('a'), 'drive_can read')
    assert caught.value.process == os.getpid()
    assert caught.value.who == 'drive_can_bridge'
    other = HostLock(key('b'), '')
    first.release()
    HostLock(key('a'), '').release()
    other.release()


@pytest.mark.real
def test_another_process_is_named_and_its_end_frees_at_once() -> None:
    process = elsewhere(key('a'), key('b'))
    try:
        with pytest.raises(Held) as caught:
            take(dict.fromkeys([key('b'), key('c')], 'x'))
        assert caught.value.process == process.pid
        assert caught.value.who == 'drive_can_write'
        assert holder(key('c')) is None     # all or nothing
    finally:
        process.kill()
        process.wait()
    for lock in take(dict.fromkeys([key('a'), key('b')], 'x')):
        lock.release()


def test_many_who_want_it_do_not_wear_it_out() -> None:
    lock = HostLock(key('a'), 'drive_can_bridge')
    for _ in range(300):
        assert (found := holder(key('a'))) is not None and found.process == os.getpid()
    lock.release()
    assert holder(key('a')) is None


@pytest.mark.usefixtures('threads')
def test_of_many_at_once_one_gets_it() -> None:
    start = threading.Barrier(8)
    won: list[list[HostLock]] = []
    lost: list[Held] = []

    def compete(place: int) -> None:
        keys = [key('x'), key('y'), key('z')]
        start.wait()
        try:
            won.append(take(dict.fromkeys(keys[place % 3:] + keys[:place % 3], 'x')))
        except Held as held:
            lost.append(held)
    threads = [threading.Thread(target=compete, args=(place,)) for place in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(won) == 1 and len(lost) == 7
    for lock in won[0]:
        lock.release()


@pytest.mark.real
def test_a_subprocess_does_not_inherit_it() -> None:
    lock = HostLock(key('a'), 'x')
    sleeper = subprocess.Popen([sys.executable, '-c', 'input()'], stdin=subprocess.PIPE,
                               close_fds=False)
    try:
        lock.release()
        wait_for(lambda: holder(key('a')) is None, 'the lock')  # until exec has closed its copy
    finally:
        sleeper.kill()
        sleeper.wait()
        assert sleeper.stdin is not None
        sleeper.stdin.close()
