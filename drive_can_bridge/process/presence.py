# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Which bridges have drives on this host.

Beside its locks (:mod:`.locks`) a bridge has a name in the abstract name space of Linux that says
which name it has in the ROS graph. It goes with the process, as the locks do: whether the bridge
answers or not, it can be named. Behind that name it listens (:mod:`.local_server`), unless
``DRIVE_CAN_LOCAL`` is ``off``.

``drive_can stop`` imports this before it has stopped anything, so nothing is imported here that
takes time.
"""

from collections import namedtuple
from collections.abc import Sequence
import os
import socket

from drive_can_bridge import host_texts

#: all names begin with this
PREFIX = 'drive_can_bridge'
#: what a bridge calls itself where it locks a drive, and what else it locks: ports, other names
BRIDGE, BESIDES = 'drive_can_bridge', 'drive_can_bridge_besides'
#: what the kernel shows of all sockets
TABLE = '/proc/net/unix'
#: switches the local way off: the value ``off``
SWITCH = 'DRIVE_CAN_LOCAL'
#: characters that have room in the name of a socket, and how many of longer ones are kept
_ROOM, _KEPT = 70, 60


def switched_on() -> bool:
    """Return whether bridges of this host listen, and commands ask them there."""
    return os.environ.get(SWITCH, '').strip().lower() != 'off'


def own_domain() -> int | None:
    """Return the ROS domain of this shell; None: the variable has no valid one."""
    try:
        return int(os.environ.get('ROS_DOMAIN_ID') or '0', 0)
    except ValueError:
        return None


def in_namespace(name: str, namespace: str) -> bool:
    """Return whether a node is in a namespace, or one of a pattern."""
    place = name.rpartition('/')[0]
    if place == namespace:
        return True
    from fnmatch import fnmatchcase
    return fnmatchcase(place, namespace)


class Present(namedtuple('Present', 'process domain name drives')):
    """
    A bridge of this host.

    :ivar process: number of its process.
    :ivar domain: its ROS domain; None: not known.
    :ivar name: its full name; '' where it is not known, cut where it is very long.
    :ivar drives: how many drives its process has locked.
    """

    __slots__ = ()

    @property
    def address(self) -> str:
        """The address of its socket."""
        return f'\0{PREFIX}/bridge/{self.process}/{self.domain}{self.name}'

    @property
    def has_place(self) -> bool:
        """Whether its namespace is known."""
        return bool(self.name) and '~' not in self.name

    def may_be_in(self, namespace: str | None) -> bool:
        """Return whether it may run in a namespace, or one of a pattern; None: anywhere."""
        return (namespace is None or not self.has_place
                or in_namespace(self.name, namespace))

    def may_mean(self, words: Sequence[str]) -> bool:
        """Return whether words, patterns or full names may mean a drive of it; none mean all."""
        place = f'{self.name.rpartition("/")[0]}/'
        return not words or not self.has_place or any(
            not word.startswith('/') or _may_mean(word, place) for word in words)

    def silence(self, domain: int | None) -> str:
        """Return that it does not answer in a ROS domain."""
        where = f'process {self.process}'
        if self.domain not in (None, domain):
            where += f', ROS domain {self.domain}'
        return host_texts.not_here.format(where=where)


class Presence:
    """
    Shows other processes on this host that this one is a bridge, until it is withdrawn.

    :param name: full name of its node.
    :ivar socket: bound, and not listening yet.
    :ivar taken: another process has the name.
    """

    def __init__(self, domain: int, name: str) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.taken = False
        try:
            self.socket.bind(Present(os.getpid(), domain, short(name), 0).address)
        except OSError:     # two of one name: reported already
            self.taken = True

    def withdraw(self) -> None:
        """Withdraw it."""
        self.socket.close()


def bridges() -> list[Present]:
    """Return the bridges that hold drives on this host."""
    try:
        with open(TABLE, encoding='utf-8', errors='replace') as table:
            names = [line.rstrip('\n').partition(f' @{PREFIX}/')[2] for line in table]
    except OSError:     # no Linux, or no /proc
        return []
    holding: dict[int, int] = {}
    told: set[tuple[int, int, str]] = set()
    for name in filter(None, names):
        kind, _, rest = name.partition('/')
        words = rest.split('/', 2)
        if len(words) < 3:
            continue
        if kind == 'who' and words[2] in (BRIDGE, BESIDES) and _is_number(words[1]):
            holding[int(words[1])] = holding.get(int(words[1]), 0) + (words[2] == BRIDGE)
        elif kind == 'bridge' and words[2] and _is_number(words[0]) and _is_number(words[1]):
            if not any(map(str.isspace, words[2])):
                told.add((int(words[0]), int(words[1]), f'/{words[2]}'))
    named = {process for process, *_ in told}
    return [Present(*each, holding.get(each[0], 0)) for each in sorted(told)] + [
        Present(process, None, '', drives) for process, drives in sorted(holding.items())
        if process not in named]


def _may_mean(word: str, place: str) -> bool:
    """Return whether a full name, or a pattern of some, may mean a drive in a namespace."""
    literal = word[:min((word.find(wild) for wild in host_texts.WILD if wild in word),
                        default=len(word))]
    if literal.startswith(place):
        return '/' not in literal[len(place):]
    return literal != word and place.startswith(literal)


def _is_number(text: str) -> bool:
    """Return whether a text may be a process, or a domain: any process may write anything."""
    return text.isascii() and text.isdecimal() and len(text) < 10


def short(name: str) -> str:
    """Return a name as it is shown: a very long one is cut, and still differs from others."""
    if len(name) <= _ROOM:
        return name
    import hashlib
    return f'{name[:_KEPT]}~{hashlib.sha256(name.encode()).hexdigest()[:8]}'
