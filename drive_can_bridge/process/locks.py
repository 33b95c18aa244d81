# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Locks that all processes of this host respect, of any user.

A lock is a socket in the abstract name space of Linux, bound to a name that is made of its key.
The kernel lets one process have a name, and takes it away when that process ends, however it ends.
There is no file: none that is left behind, that another user may not write, that was replaced by
a symbolic link, or that a service with a ``/tmp`` of its own does not see. The
names belong to the network namespace, as CAN interfaces do.

Beside each lock its holder has a second name that identifies it; ``/proc/net/unix`` shows it to
everybody.
"""

from collections.abc import Mapping
import errno
import hashlib
import os
from pathlib import Path
import re
import socket
import time

from drive_can_bridge.process.presence import PREFIX, TABLE

#: characters of a holder's name that have room in that of a socket
_WHO_MAX = 40
#: s until the new holder of a lock has also published its name
_PATIENCE = 0.1


class Held(Exception):
    """
    A lock is held already.

    :param process: number of its process; None: not known.
    :param who: the name of its holder; '' where that is not known.
    """

    def __init__(self, process: int | None, who: str) -> None:
        super().__init__(process, who)
        self.process = process
        self.who = who

    @property
    def in_words(self) -> str:
        """Its process, in words."""
        return 'another process' if self.process is None else f'process {self.process}'


class HostLock:
    """
    One lock, held from its creation until it is released.

    :param key: what is locked; the same on the whole host.
    :param who: the name of the holder.
    :raises Held: it is held, be it by this very process.
    :raises OSError: no lock is possible (no descriptor is left).
    """

    def __init__(self, key: str, who: str) -> None:
        digest = hashlib.sha256(key.encode()).hexdigest()[:24]
        self._sockets: list[socket.socket] = []
        try:
            self._bind(f'lock/{digest}')
        except OSError as error:
            self.release()
            if error.errno != errno.EADDRINUSE:
                raise
            raise _holder(digest) from None
        words = re.sub(r'[^A-Za-z0-9_]+', '_', who)[:_WHO_MAX]
        try:
            self._bind(f'who/{digest}/{os.getpid()}/{words}')
        except OSError:     # then the holder is unknown, but it is locked all the same
            pass

    def _bind(self, name: str) -> None:
        made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._sockets.append(made)
        made.bind(f'\0{PREFIX}/{name}')

    def release(self) -> None:
        """Release it. Idempotent."""
        while self._sockets:
            self._sockets.pop().close()


def take(holders: Mapping[str, str]) -> list[HostLock]:
    """
    Acquire several locks, or none.

    In the order of their keys, so that of two processes that want the same one gets all.

    :param holders: by key, the name of its holder.
    :raises Held: one of them is held.
    """
    taken: list[HostLock] = []
    try:
        for key in sorted(holders):
            taken.append(HostLock(key, holders[key]))
    except BaseException:
        for lock in taken:
            lock.release()
        raise
    return taken


def holder(key: str) -> Held | None:
    """Return the holder of a lock; None: it is free."""
    try:
        HostLock(key, '').release()
    except Held as held:
        return held
    return None


def _holder(digest: str) -> Held:
    """Return the holder of a lock, as far as it can be found."""
    deadline = time.monotonic() + _PATIENCE
    wanted = re.compile(rf'@{PREFIX}/who/{digest}/(\d+)/(\w*)$', re.MULTILINE)
    while True:
        late = time.monotonic() > deadline      # before it looks: it may not run for a while
        try:
            found = wanted.search(Path(TABLE).read_text(encoding='utf-8', errors='replace'))
        except OSError:
            found = None
        if found is not None:
            return Held(int(found[1]), found[2])
        if late:
            return Held(None, '')
        time.sleep(0.005)
