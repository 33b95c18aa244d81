# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Drives stopped, enabled, disabled and reset by hand, through the services of their bridges.

A stop does not wait: a drive is commanded as soon as it is seen in the graph, before its bridge
was asked for anything. The bridges' answers show afterwards whether those were all.
"""

from collections.abc import Callable, Collection, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
import math
from typing import Any

from rclpy.qos import QoSProfile
from rclpy.type_support import check_is_valid_srv_type
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger

from drive_can_bridge.core import command_sentences, host_sentences
from drive_can_bridge.core.bridges import is_some
from drive_can_bridge.core.events import DriveState
from drive_can_bridge.process.local_stop import (
    Answer, does_not_answer, may_match, stop_answer, STOP_TIMEOUT, twins)
from drive_can_bridge.process.local_way import meant
from drive_can_bridge.process.orders import CONTROL_TIMEOUT, SERVICES, unanswered, unoffered
from drive_can_bridge.process.presence import Present, short
from drive_can_bridge.ros.client.calls import NodeCalls, OFFER_TIMEOUT, Service
from drive_can_bridge.ros.client.client_node import HasEnd
from drive_can_bridge.ros.client.foreign import why_not
from drive_can_bridge.ros.client.graph import Graph
from drive_can_bridge.ros.client.search import find_bridges, find_drives, Search, Seeing
from drive_can_bridge.ros.client.subscriptions import Inbox
from drive_can_bridge.ros.rcl.quality import latched_quality
from drive_can_bridge.ros.recognition import drives_among, namespace_of

#: s after which a stop is repeated: DDS may lose an answer
STOP_AGAIN = 1.0
#: s that it may take to learn whether a drive is online: from its own topic, and at all
_LATCHED_TIMEOUT, _ONLINE_TIMEOUT = 1.0, 5.0
#: states of diagnostics in which it is not
_NOT_ONLINE = (DriveState.OFFLINE.value, DriveState.MAPPING_DIFFERS.value)


class _Stopping:
    """The stop of one drive."""

    def __init__(self, client_node: HasEnd, node: str, now: float) -> None:
        self.node = node
        self.answer: Answer | None = None
        self._client_node = client_node
        self._said: Any = None
        self._since = now
        self._online: bool | None = None
        self._inboxes: list[Inbox] = []
        self._service = Service(client_node, Trigger, f'{node}/quick_stop', STOP_TIMEOUT,
                                STOP_AGAIN)
        self._service.send(Trigger.Request(), self._take, now, 2.0 * OFFER_TIMEOUT,
                           self._unasked)

    def _unasked(self) -> None:
        reason = why_not(self._client_node, self.node)
        if reason is None:
            self._take(None)
        else:
            self.answer = Answer(self.node, False, host_sentences.may_run(reason))

    def _take(self, response: Any) -> None:
        self._said = response
        if response is None:
            what = 'no answer' if self._service.ready else 'nobody offers its ~/quick_stop'
            self.answer = Answer(self.node, False, host_sentences.may_run(what))
        elif not response.success:
            self.answer = stop_answer(self.node, False, response.message, False)

    def look(self, now: float) -> None:
        """Handle what has arrived."""
        self._service.look(now)
        if not self._inboxes:
            if not self._service.unsent:    # first things first
                self._inboxes.append(Inbox(self._client_node, Bool, f'{self.node}/online',
                                           latched_quality(), self._take_online))
            return
        for inbox in self._inboxes:
            inbox.look()
        if self._said is None:
            self._since = now
        elif self.answer is None:
            said = self._said.message
            if self._online is not None:
                self.answer = stop_answer(self.node, True, said, self._online)
            elif len(self._inboxes) == 1 and now - self._since > _LATCHED_TIMEOUT:
                # it is called otherwise (remapped)
                from diagnostic_msgs.msg import DiagnosticArray
                self._inboxes.append(Inbox(self._client_node, DiagnosticArray, '/diagnostics',
                                           QoSProfile(depth=50), self._take_diagnostics))
            elif now - self._since > _ONLINE_TIMEOUT:
                self.answer = Answer(self.node, False, command_sentences.online_unknown(
                    said=said or 'stopped'))

    def _take_online(self, message: Bool) -> None:
        self._online = message.data

    def _take_diagnostics(self, message: Any) -> None:
        for status in message.status:
            bridge, _, name = status.name.partition(': drive ')
            if f'{namespace_of(f"/{bridge}")}/{name}' == self.node:
                self._online = any(pair.key == 'state' and pair.value not in _NOT_ONLINE
                                   for pair in status.values)

    def close(self) -> None:
        """Drop its service and subscriptions."""
        self._service.close()
        for inbox in self._inboxes:
            inbox.close()


class StopRequests:
    """
    A stop of drives, sent to each one as soon as it is discovered.

    :param client_node: of ours.
    :param namespace: of the bridges that are meant; None: all.
    :param words: names, patterns or full names of the drives; none: all.
    :param expected: bridges that are there, whether they are in the graph or not.
    :param only: the bridges that are meant; None: all.
    :param patience: s that a bridge has to answer, and its drives with it; None: a few.
    """

    def __init__(self, client_node: Seeing, namespace: str | None, words: Sequence[str],
                 expected: Iterable[str], *, only: Container[str] | None = None,
                 patience: float | None = None) -> None:
        self._client_node = client_node
        check_is_valid_srv_type(Trigger)    # takes its time, while the graph is being discovered
        self._words = words
        self._search = Search(client_node, namespace, expected, only=only, patience=patience)
        #: drives of a bridge that has not answered are not waited for either
        self._hurried = patience is not None
        self._drives: dict[str, _Stopping] = {}
        self._elsewhere: set[str] = set()

    def leave(self, nodes: Iterable[str]) -> None:
        """Leave out drives that are stopped another way."""
        self._elsewhere.update(nodes)

    def know(self, name: str, drives: Sequence[str], others: Sequence[str]) -> None:
        """Record a bridge's drives that were found another way."""
        self._search.know(name, drives, others)

    def look(self, now: float) -> bool:
        """Continue; return whether all is done."""
        self._search.look(now)
        for node in (*self._seen(), *self.drives):
            if (node not in self._drives and node not in self._elsewhere
                    and meant(self._words, node)):
                self._drives[node] = _Stopping(self._client_node, node, now)
        for drive in self._drives.values():
            drive.look(now)
        return ((self._search.settled or self._search.over(now))
                and all(drive.answer or self._hurried and node not in self.drives
                        for node, drive in self._drives.items()))

    def _seen(self) -> list[str]:
        """Return drives that are new in the graph, in the namespaces of bridges."""
        if self._search.settled and not any(
                each.foreign for each in self._search.found.values()):
            return []
        return self._around({*self._drives, *self._elsewhere})

    def _around(self, known: Collection[str]) -> list[str]:
        return drives_among(self._search.services, self._client_node.topics, self._search.found,
                            known)

    @property
    def seen(self) -> set[str]:
        """The bridges whose answers :meth:`answers` returns."""
        return set(self._search.found)

    @property
    def heard(self) -> set[str]:
        """The bridges that have answered."""
        return {name for name, each in self._search.found.items() if each.answered}

    @property
    def drives(self) -> list[str]:
        """Full names of the drives of all bridges that have answered."""
        return [node for each in self._search.found.values() for node in each.nodes]

    def answers(self, present: Iterable[Present] = ()) -> list[Answer]:
        """
        Return the results so far: bridges that do not answer, then drives.

        :param present: what this host shows of bridges.
        """
        found, names = self._search.found, self._search.names
        silent = [name for name in found if not found[name].answered]
        around = self._around(self.drives) if silent and self._words else []
        shown = {each.name: each for each in present}
        told = [Answer(name, False, why_not(self._client_node, name, name) or does_not_answer(),
                       bridge=True) for name in silent
                if may_match(shown.get(short(name), Present(0, None, name, 0)), around,
                             self._words)]
        told += [twins(name, names.count(name)) for name in found if names.count(name) > 1]
        return told + [drive.answer or Answer(
            node, False, host_sentences.may_run('no answer yet'))
                       for node, drive in self._drives.items() if node not in self._elsewhere
                       or drive.answer is not None]

    def close(self) -> None:
        """Drop all requests."""
        self._search.close()
        for drive in self._drives.values():
            drive.close()


@dataclass(frozen=True, slots=True)
class Order:
    """A command besides a stop: the service, and its request."""

    service: str
    request: Callable[[], Any]


ORDERS: Mapping[str, Order] = {
    'enable': Order(SERVICES['enable'], lambda: SetBool.Request(data=True)),
    'disable': Order(SERVICES['disable'], lambda: SetBool.Request(data=False)),
    'reset': Order(SERVICES['reset'], Trigger.Request),
}


def known_drives(graph: Graph, place: str | None) -> list[str]:
    """
    Return the full names of the drives in a namespace, or in those of a pattern.

    :param place: None: the only one.
    :raises WhichBridge: there are several, and not together.
    :raises NoBridge: there is none.
    :raises SilentBridge: it does not answer.
    """
    if is_some(place):
        return [node for each in find_bridges(graph, place or '') for node in each.nodes]
    return [f'{namespace_of(bridge)}/{drive}'
            for drive, bridge in find_drives(graph, place).items()]


def give(graph: Graph, order: str, nodes: Sequence[str]) -> list[Answer]:
    """
    Command drives, all of them at once.

    :param order: of :data:`ORDERS`.
    :param nodes: their full names.
    """
    calls = NodeCalls(graph.client_node, CONTROL_TIMEOUT)
    answers: dict[str, Answer] = {}
    began = graph.now()
    service = ORDERS[order].service

    def ask(node: str) -> None:
        def take(response: Any) -> None:
            if response is not None:
                answers[node] = Answer(node, response.success, response.message)
            elif calls.offered(node, service):
                answers[node] = unanswered(node, graph.now() - began)
            else:
                answers[node] = unoffered(node, order)
        calls.ask(node, service, ORDERS[order].request(), take, graph.now(), OFFER_TIMEOUT)
    for node in nodes:
        ask(node)

    def done(now: float) -> bool:
        calls.look(now)
        return len(answers) == len(nodes)
    graph.wait(done, math.inf)
    return [answers[node] for node in nodes]
