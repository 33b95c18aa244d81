# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Which bridges have drives on this host, whether they answer or not.

Beside its locks (:mod:`.locks`) a bridge has a name in the same name space that says what it is
called in the ROS graph. It goes with the process, as the locks do.
"""

import hashlib
import os
import re
import socket
from typing import NamedTuple

from drive_can_bridge.process.locks import PREFIX, SOCKETS

#: what a bridge calls itself where it locks drives
BRIDGE = 'drive_can_bridge'
#: characters that have room in the name of a socket, and how many of longer ones are kept
_ROOM, _KEPT = 70, 60
_LINE = re.compile(rf'@{PREFIX}/(?:who/[0-9a-f]+/(\d+)/{BRIDGE}|bridge/(\d+)/(\d+)(/\S+))$',
                   re.MULTILINE)


class Present(NamedTuple):
    """
    A bridge of this host.

    :param domain: its ROS domain; None: not known.
    :param name: its full name; '' where it is not known, cut where it is very long.
    """

    process: int
    domain: int | None
    name: str


class Presence:
    """
    Tells others on this host that this process is a bridge, until it is withdrawn.

    :param name: full name of its node.
    """

    def __init__(self, domain: int, name: str) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._socket.bind(f'\0{PREFIX}/bridge/{os.getpid()}/{domain}{short(name)}')
        except OSError:     # two by one name: told already
            pass

    def withdraw(self) -> None:
        """Tell it no more."""
        self._socket.close()


def bridges() -> list[Present]:
    """Return the bridges that hold drives on this host."""
    try:
        text = SOCKETS.read_text(encoding='utf-8', errors='replace')
    except OSError:
        return []
    holding, told = set[int](), set[Present]()
    for found in _LINE.finditer(text):
        if found[1]:
            holding.add(int(found[1]))
        else:
            told.add(Present(int(found[2]), int(found[3]), found[4]))
    named = {each.process for each in told}
    return sorted(told) + [Present(process, None, '') for process in sorted(holding - named)]


def short(name: str) -> str:
    """Return a name as it is told: a very long one is cut, and still differs from others."""
    if len(name) <= _ROOM:
        return name
    return f'{name[:_KEPT]}~{hashlib.sha256(name.encode()).hexdigest()[:8]}'
