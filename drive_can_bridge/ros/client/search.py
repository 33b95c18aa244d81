# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Bridges in the ROS graph, found in the same way for all commands.

A process that has just started does not know the graph, a bridge does. So the first one that
answers names the others (its parameter ``bridges``), and there is no wait for what may still turn
up. What is in the graph with the services of a bridge counts, whether it answers or not.
"""

from collections.abc import Callable, Container, Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Protocol

from rcl_interfaces.srv import GetParameters, ListParameters

from drive_can_bridge.core import sentences
from drive_can_bridge.core.bridges import bridges_of, must_stand_together, stand_apart
from drive_can_bridge.core.errors import DriveCanError, NoBridge, SilentBridge, WhichBridge
from drive_can_bridge.core.text import is_ros_name
from drive_can_bridge.process.environment import no_bridge
from drive_can_bridge.process.presence import bridges, short
from drive_can_bridge.ros.client.calls import NodeCalls
from drive_can_bridge.ros.client.foreign import foreign, why_not
from drive_can_bridge.ros.client.graph import Graph
from drive_can_bridge.ros.client.signs import Signs
from drive_can_bridge.ros.rcl.end import TopicEnd
from drive_can_bridge.ros.recognition import BRIDGES, bridges_among, Entries, namespace_of

#: s without a change in the graph until it counts as empty, and how long that may go on
_QUIET, _LONGEST = 4.0, 12.0
#: s that a bridge has to answer
_ANSWER_TIMEOUT = 5.0
#: s that one has of which there are signs of life
_BUSY_TIMEOUT = 30.0
#: s without an answer after which signs of life are looked for
_SIGNS_AFTER = 1.0
#: s between two looks at the graph
_GRAPH_PERIOD = 0.01
_MARK = '.profile_sha256'


@dataclass(slots=True)
class FoundBridge:
    """
    What is known of a bridge.

    :ivar drives: names of its drives, in the order of the configuration; None: not known yet.
    :ivar others: the bridges that it sees, itself among them; None: not known yet.
    :ivar silent: it has not answered in time.
    :ivar foreign: it has another middleware, and is sent nothing.
    :ivar asked_at: when it was asked first.
    """

    name: str
    drives: tuple[str, ...] | None = None
    others: tuple[str, ...] | None = None
    silent: bool = False
    foreign: bool = False
    asked_at: float = 0.0

    @property
    def answered(self) -> bool:
        """Whether it has answered everything."""
        return self.drives is not None and self.others is not None

    @property
    def nodes(self) -> tuple[str, ...]:
        """Full names of its drives, as far as they are known."""
        return tuple(f'{namespace_of(self.name)}/{drive}' for drive in self.drives or ())


class Seeing(Protocol):
    """A node whose view of the graph can be read."""

    end: TopicEnd

    def services(self) -> Entries:
        """Return all services that have been discovered, with their types."""

    def topics(self) -> Entries:
        """Return all topics that have been discovered, with their types."""


class Search:
    """
    Searches for bridges, and asks each one that is discovered.

    :param namespace: of those that are meant, ``/cell``, '' for the root; None: all.
    :param expected: full names of bridges that are known to be there.
    :param only: those that are looked for; None: all.
    :param patience: s that a bridge has to answer; None: a few.
    :param signs: makes what watches for signs of life: a bridge that gives any has longer to
        answer; None: none has.
    :ivar found: by full name, whether they have answered or not.
    :ivar services: all that have been discovered.
    """

    def __init__(self, client_node: Seeing, namespace: str | None,
                 expected: Iterable[str] = (), *, only: Container[str] | None = None,
                 patience: float | None = None,
                 signs: Callable[[], Signs] | None = None) -> None:
        self._client_node = client_node
        self._make_signs = signs
        self._signs: Signs | None = None
        self._now = 0.0
        self._namespace = namespace
        self._expected = list(expected)
        self._only = only
        self._calls = NodeCalls(client_node, patience or _ANSWER_TIMEOUT)
        self.found: dict[str, FoundBridge] = {}
        self.services: Entries = ()
        self._looked_at = self._changed_at = self._began = -1.0

    @property
    def names(self) -> list[str]:
        """The full names of all bridges; equal names are repeated."""
        named = [each.others for each in self.found.values() if each.others]
        return sorted(name for name in self.found for _ in range(
            max([1, *(others.count(name) for others in named)])))

    @property
    def settled(self) -> bool:
        """Whether all bridges are known, and each one has answered, or is silent."""
        return ((any(each.answered or each.foreign for each in self.found.values())
                 or self._only is not None)
                and all(each.answered or each.silent for each in self.found.values()))

    def over(self, now: float) -> bool:
        """Return whether there is no bridge, or none that answers."""
        return (all(each.silent for each in self.found.values()) and self._only is None
                and now > min(self._changed_at + _QUIET, self._began + _LONGEST))

    def look(self, now: float) -> bool:
        """Update from the graph and handle answers; return whether the graph has changed."""
        if self._began < 0.0:
            self._began = self._changed_at = now
            self._see(self._expected, now)
        self._now = now
        self._look_for_signs(now)
        self._calls.look(now)
        if now < self._looked_at + _GRAPH_PERIOD:
            return False
        self._looked_at = now
        services = self._client_node.services()
        if services == self.services:
            return False
        self.services, self._changed_at = services, now
        self._see(bridges_among(services), now)
        return True

    def know(self, name: str, drives: Sequence[str], others: Sequence[str]) -> None:
        """Record what a bridge has answered another way: it is not asked again."""
        found = self.found.setdefault(name, FoundBridge(name))
        found.drives = tuple(drive.rpartition('/')[2] for drive in drives)
        found.others = tuple(others)

    def close(self) -> None:
        """Drop all requests."""
        self._calls.close()
        if self._signs is not None:
            self._signs.close()

    def _look_for_signs(self, now: float) -> None:
        if self._signs is not None:
            self._signs.look(now)
        elif self._make_signs is not None and any(
                now > each.asked_at + _SIGNS_AFTER for each in self.found.values()
                if not (each.answered or each.silent)):
            self._signs = self._make_signs()

    def _give_up(self, bridge: FoundBridge, ask_again: Callable[[float], None]) -> None:
        """Mark a bridge as silent that has not answered in time, unless it gives signs of life."""
        if (self._signs is not None and self._now < bridge.asked_at + _BUSY_TIMEOUT
                and self._signs.lives(bridge.name)):
            ask_again(self._now)
        else:
            bridge.silent = True

    def _see(self, names: Iterable[str], now: float) -> None:
        for name in filter(is_ros_name, names):     # any node may answer anything
            if (name not in self.found and self._namespace in (None, namespace_of(name))
                    and (self._only is None or name in self._only)):
                other = bool(foreign(self._client_node, f'{name}/save_trace'))
                self.found[name] = FoundBridge(name, silent=other, foreign=other)
                if not other:
                    self._ask(self.found[name], now)

    def _ask(self, bridge: FoundBridge, now: float) -> None:
        bridge.asked_at = now

        def take_others(response: GetParameters.Response | None) -> None:
            if response is None:
                self._give_up(bridge, ask_for_others)
                return
            if not response.values:
                bridge.silent = True
                return
            bridge.others = tuple(response.values[0].string_array_value)
            self._see(bridge.others, self._looked_at)

        def take_drives(response: ListParameters.Response | None) -> None:
            if response is None:
                self._give_up(bridge, ask_for_drives)
                return
            drives = (name.split('.')[1] for name in response.result.names
                      if name.endswith(_MARK) and name.count('.') == 2)
            bridge.drives = tuple(drive for drive in drives if is_ros_name(f'/{drive}'))

        def ask_for_others(now: float) -> None:
            self._calls.ask(bridge.name, 'get_parameters',
                            GetParameters.Request(names=[BRIDGES]), take_others, now)

        def ask_for_drives(now: float) -> None:
            self._calls.ask(bridge.name, 'list_parameters',
                            ListParameters.Request(prefixes=['drives']), take_drives, now)
        ask_for_others(now)
        ask_for_drives(now)

    def waited(self, names: Iterable[str]) -> float:
        """Return for how many s bridges were waited for that have not answered, at most."""
        return max((self._now - self.found[name].asked_at for name in names), default=0.0)


def _search(graph: Graph, namespace: str | None, enough: Callable[[list[str]], bool]) -> Search:
    """Search until all is known, or ``enough`` of the bridges' names."""
    search = Search(graph.client_node, namespace, signs=lambda: Signs(graph.client_node))

    def done(now: float) -> bool:
        search.look(now)
        return enough(search.names) or search.settled or search.over(now)
    graph.wait(done, 2.0 * _LONGEST + _BUSY_TIMEOUT)
    return search


def find_drives(graph: Graph, namespace: str | None) -> dict[str, str]:
    """
    Return the drives of the bridges of one namespace, with the full name of the bridge of each.

    :param namespace: where they run, ``/cell``, '' for the root; None: anywhere.
    :raises WhichBridge: there are several, and in several namespaces, or two of one name, or with
        drives of one name, or one that does not answer.
    :raises NoBridge: there is none.
    :raises SilentBridge: it does not answer.
    """
    search = _search(graph, namespace, lambda names: bool(stand_apart(names)))
    _must_talk(graph, search.found.values())
    names = search.names
    must_stand_together(names)
    silent = [name for name in names if not search.found[name].answered]
    if silent and len(names) > 1:
        raise WhichBridge(sentences.several_not_all_answer(
            names=names, silent=silent))
    bridge_of = bridges_of({name: search.found[name].drives or () for name in names})
    if silent or not bridge_of:
        raise _none(graph, namespace, search, silent)
    return bridge_of


def find_bridges(graph: Graph, pattern: str) -> list[FoundBridge]:
    """
    Return the bridges in all namespaces that fit to a shell pattern.

    :raises NoBridge: there is none.
    :raises SilentBridge: one does not answer.
    """
    search = _search(graph, None, lambda _: False)
    found = [each for each in search.found.values()
             if fnmatchcase(namespace_of(each.name), pattern)]
    _must_talk(graph, found)
    if not found or not all(each.answered for each in found):
        raise _none(graph, pattern, search, [each.name for each in found if not each.answered])
    return found


def _must_talk(graph: Graph, found: Iterable[FoundBridge]) -> None:
    """
    Check that bridges have the middleware of this process.

    :raises SilentBridge: they do not.
    """
    reasons = [reason for each in found if not each.answered
               and (reason := why_not(graph.client_node, each.name, each.name))]
    if reasons:
        raise SilentBridge('; '.join(reasons))


def _none(graph: Graph, pattern: str | None, search: Search,
          silent: Sequence[str]) -> DriveCanError:
    """Return the error for no bridge, or none that answers, such as one that has left."""
    if silent:
        return SilentBridge(no_bridge(pattern, silent, search.waited(silent)))
    domain = graph.client_node.context.get_domain_id()
    known = {short(name) for name in search.found}
    hung = [sentences.silent_and_holds(name=each.name, how=each.silence(domain))
            for each in bridges()
            if each.domain == domain and each.may_be_in(pattern) and each.name not in known]
    return SilentBridge('; '.join(hung)) if hung else NoBridge(no_bridge(pattern))
