# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Which bridges have drives on this host."""

import os

from drive_can_bridge.process.locks import HostLock
from drive_can_bridge.process.presence import BRIDGE, bridges, Presence, short


def mine() -> list[tuple[int, int | None, str]]:
    return [each[:3] for each in bridges() if each.process == os.getpid()]


def test_as_long_as_it_is_there() -> None:
    assert mine() == []
    present = Presence(63, '/cell/drive_can_bridge')
    assert mine() == [(os.getpid(), 63, '/cell/drive_can_bridge')]
    other = Presence(5, '/drive_can_bridge')
    assert mine() == [(os.getpid(), 5, '/drive_can_bridge'),
                      (os.getpid(), 63, '/cell/drive_can_bridge')]
    present.withdraw()
    other.withdraw()
    assert mine() == []


def test_who_has_locks_only() -> None:
    lock = HostLock('test presence', BRIDGE)
    tool = HostLock('test presence of another', 'drive_can read')
    assert mine() == [(os.getpid(), None, '')]
    lock.release()
    assert mine() == []
    tool.release()


def test_two_by_one_name() -> None:
    first, second = Presence(1, '/a/b'), Presence(1, '/a/b')
    assert mine() == [(os.getpid(), 1, '/a/b')]
    first.withdraw()
    second.withdraw()


def test_a_long_name_is_cut_and_differs_from_others() -> None:
    names = [f'/{"very_" * 40}{end}' for end in 'ab']
    made = [Presence(232, name) for name in names]
    assert {name for _, _, name in mine()} == set(map(short, names))
    assert len(set(map(short, names))) == 2
    assert max(map(len, map(short, names))) <= 70
    for each in made:
        each.withdraw()
