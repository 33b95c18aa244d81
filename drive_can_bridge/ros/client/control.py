# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Drives stopped, enabled, disabled and reset by hand, through the services of their bridges.

A stop waits for nobody: a drive is told as soon as it is seen in the graph, before its bridge was
asked for anything. What the bridges say afterwards shows whether that were all.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
import math
from typing import Any, NamedTuple

from rclpy.type_support import check_is_valid_srv_type
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger

from drive_can_bridge.core.text import is_pattern
from drive_can_bridge.ros.client.calls import (
    ClientNode, Inbox, latched_quality, NodeCalls, OFFER_TIMEOUT, Service)
from drive_can_bridge.ros.client.search import (
    find_bridges, find_drives, Graph, nobody, Search)
from drive_can_bridge.ros.recognition import drives_among, namespace_of

#: s that a drive may take to stop; after how many it is told once more: DDS may lose an answer
STOP_TIMEOUT, STOP_AGAIN = 10.0, 1.0
#: s that it may take to hear whether a drive is online
_ONLINE_TIMEOUT = 5.0
#: s that anything else may take: it is the bridge that says when it is over
CONTROL_TIMEOUT = 120.0
_RUNNING = 'may still be running'


class Answer(NamedTuple):
    """
    What became of a drive, or of a bridge.

    :param name: full name; or what was asked for and is nobody's.
    :param ok: it did what was wanted.
    :param bridge: it is one.
    """

    name: str
    ok: bool
    text: str
    bridge: bool = False


class UnknownDrive(Exception):
    """A word names no drive."""


def meant(words: Sequence[str], node: str) -> bool:
    """Tell whether words mean a drive: none means all."""
    return not words or any(matches(word, node) for word in words)


def matches(word: str, node: str) -> bool:
    """Tell whether a word, a pattern or a full name means a drive."""
    return fnmatchcase(node if word.startswith('/') else node.rpartition('/')[2], word)


class _Stopping:
    """One drive that is told to stop."""

    def __init__(self, client_node: ClientNode, node: str, now: float) -> None:
        self.node = node
        self.answer: Answer | None = None
        self._client_node = client_node
        self._said: Any = None
        self._since = now
        self._online: bool | None = None
        self._inbox: Inbox | None = None
        self._service = Service(client_node, Trigger, f'{node}/quick_stop', STOP_TIMEOUT,
                                STOP_AGAIN)
        self._service.send(Trigger.Request(), self._take, now, 2.0 * OFFER_TIMEOUT)

    def _take(self, response: Any) -> None:
        self._said = response
        if response is None:
            what = 'no answer' if self._service.ready else 'nobody offers its ~/quick_stop'
            self.answer = Answer(self.node, False, f'{what}: {_RUNNING}')
        elif not response.success:
            self.answer = Answer(self.node, False, response.message)

    def look(self, now: float) -> None:
        """Take what has arrived."""
        self._service.look(now)
        if self._inbox is None:
            if not self._service.unsent:    # first things first
                self._inbox = Inbox(self._client_node, Bool, f'{self.node}/online',
                                    latched_quality(), self._take_online)
            return
        self._inbox.look()
        if self._said is None:
            self._since = now
        elif self.answer is None:
            said = self._said.message or 'stopped'
            if self._online is not None:
                self.answer = Answer(self.node, self._online, said if self._online else
                                     f'{said}; not online: {_RUNNING}')
            elif now - self._since > _ONLINE_TIMEOUT:
                self.answer = Answer(self.node, False,
                                     f'{said}; nobody says whether it is online')

    def _take_online(self, message: Bool) -> None:
        self._online = message.data


class Stop:
    """
    A stop of drives, begun for each one as soon as it is seen.

    :param namespace: of the bridges that are meant; None: all.
    :param words: names, patterns or full names of the drives; none: all.
    :param expected: bridges that are there, whether they are in the graph or not.
    """

    def __init__(self, graph: Graph, namespace: str | None, words: Sequence[str],
                 expected: Iterable[str]) -> None:
        self._client_node = graph.client_node
        check_is_valid_srv_type(Trigger)    # takes its time, while the graph is being discovered
        self._words = words
        self._namespace = namespace
        self._search = Search(graph.client_node, namespace, expected)
        self._drives: dict[str, _Stopping] = {}

    def look(self, now: float) -> bool:
        """Go on; return whether all is done."""
        self._search.look(now)
        known = [node for each in self._search.found.values() for node in each.nodes]
        for node in (*self._seen(), *known):
            if node not in self._drives and meant(self._words, node):
                self._drives[node] = _Stopping(self._client_node, node, now)
        for drive in self._drives.values():
            drive.look(now)
        return ((self._search.settled or self._search.over(now))
                and all(drive.answer for drive in self._drives.values()))

    def _seen(self) -> list[str]:
        """Return drives that are new in the graph, in the namespaces of bridges."""
        if self._search.settled:
            return []
        return drives_among(self._search.services, self._client_node.topics, self._search.found,
                            self._drives)

    @property
    def seen(self) -> set[str]:
        """The bridges of which :meth:`answers` tells."""
        return set(self._search.found)

    def answers(self) -> list[Answer]:
        """Return what became of it so far: bridges that do not answer, then drives."""
        found, names = self._search.found, self._search.names
        told = [Answer(name, False, f'this bridge does not answer: its drives {_RUNNING}',
                       bridge=True)
                for name in found if not found[name].answered]
        told += [Answer(name, False, f'{names.count(name)} bridges are called so, and one answer '
                                     f'hides the other: drives {_RUNNING}', bridge=True)
                 for name in found if names.count(name) > 1]
        told += [drive.answer or Answer(node, False, f'no answer yet: {_RUNNING}')
                 for node, drive in self._drives.items()]
        told += [Answer(word, False, f'no such drive; there are: '
                                     f'{", ".join(self._everybody()) or "none"}')
                 for word in self._words
                 if found and not any(matches(word, node) for node in self._drives)]
        if not found:
            told.append(Answer('', False, nobody(self._namespace), bridge=True))
        return told or [Answer(name, False, 'has no drives: it is not configured', bridge=True)
                        for name in found]

    def _everybody(self) -> list[str]:
        return [node.lstrip('/') for each in self._search.found.values() for node in each.nodes]


@dataclass(frozen=True, slots=True)
class Order:
    """What a drive is told beside a stop: the service, and what it is asked."""

    service: str
    request: Callable[[], Any]


ORDERS: Mapping[str, Order] = {
    'enable': Order('enable', lambda: SetBool.Request(data=True)),
    'disable': Order('enable', lambda: SetBool.Request(data=False)),
    'reset': Order('reset_fault', Trigger.Request),
}


def give(graph: Graph, order: str, namespace: str | None, words: Sequence[str]) -> list[Answer]:
    """
    Tell drives something, all of them at once.

    :param order: of :data:`ORDERS`.
    :param words: names, patterns or full names; a full name says which bridge is meant.
    :raises UnknownDrive: a word names none.
    :raises WhichBridge: there are several, and not together.
    :raises NoBridge: there is none.
    :raises SilentBridge: it does not answer.
    """
    nodes: dict[str, None] = {}
    known: dict[str | None, list[str]] = {}
    for word in words:
        place = namespace_of(word) if word.startswith('/') else namespace
        if place not in known:
            known[place] = [
                node for each in find_bridges(graph, place) for node in each.nodes
            ] if place and is_pattern(place) else [
                f'{namespace_of(bridge)}/{drive}'
                for drive, bridge in find_drives(graph, place).items()]
        found = [node for node in known[place] if matches(word, node)]
        if not found:
            there = ', '.join(node.lstrip('/') for node in known[place])
            raise UnknownDrive(f'no drive {word!r}; there are: {there}')
        nodes.update(dict.fromkeys(found))
    calls = NodeCalls(graph.client_node, CONTROL_TIMEOUT)
    answers: dict[str, Answer] = {}
    service = ORDERS[order].service

    def ask(node: str) -> None:
        def take(response: Any) -> None:
            if response is not None:
                answers[node] = Answer(node, response.success, response.message)
            elif calls.offered(node, service):
                answers[node] = Answer(node, False, 'no answer')
            else:
                answers[node] = Answer(node, False, f'nobody offers its ~/{service}: no control '
                                                    'word, or its bridge has gone')
        calls.ask(node, service, ORDERS[order].request(), take, graph.now(), OFFER_TIMEOUT)
    for node in nodes:
        ask(node)

    def done(now: float) -> bool:
        calls.look(now)
        return len(answers) == len(nodes)
    graph.wait(done, math.inf)
    return [answers[node] for node in nodes]
