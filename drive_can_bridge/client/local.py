# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The local way to bridges (:mod:`..process.local_way`), where it reaches all that are meant.

Wherever it does not, whatever the reason, the way through ROS is used as if there were no other.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

from drive_can_bridge.client.way import Described, Found
from drive_can_bridge.clock import Clock
from drive_can_bridge.core import sentences
from drive_can_bridge.core.bridges import bridges_of, is_some, must_stand_together
from drive_can_bridge.core.errors import NoAnswer
from drive_can_bridge.core.parameters import Value
from drive_can_bridge.process.local_stop import Answer
from drive_can_bridge.process.local_way import (
    END, Line, NO, PATIENCE, Rubbish, value_of, value_text)
from drive_can_bridge.process.orders import CONTROL_TIMEOUT, unanswered, unoffered
from drive_can_bridge.process.presence import (
    bridges, in_namespace, own_domain, Present, switched_on)

#: s between two looks at what has arrived
LOOK_PERIOD = 0.0005
#: s that an answer may take: many reads without an answer are slow
CALL_TIMEOUT = 120.0
#: messages that are read behind that: an answer that never ends is none
_LATE_MAX = 10_000
#: what parsing raises for an answer that is no bridge's
_SENSELESS = (Rubbish, ValueError, IndexError)


class _Bridge:
    """
    A bridge of this host that gets one request after the other.

    :ivar name: as it answers; '' until then.
    :ivar drives: full names of its drives, in the order of the configuration.
    :ivar seen: full names of the bridges that it sees.
    :raises OSError: it does not listen.
    """

    def __init__(self, present: Present, clock: Clock) -> None:
        self._present = present
        self._clock = clock
        self._line = Line(present)
        self.name = ''
        self.drives: list[str] = []
        self.seen: list[str] = []

    @property
    def believed(self) -> bool:
        """Whether it is root's, or of our user."""
        return self._line.believed

    def ask(self, *words: str) -> None:
        """
        Send a request.

        :raises OSError: it is gone.
        """
        try:
            self._line.ask(*words)
        except OSError:     # it hangs up on callers that are idle for long, or has ended
            self._line.close()
            self._line = self._called_again()
            if not self._line.believed:
                raise PermissionError from None
            self._line.ask(*words)

    def _called_again(self) -> Line:
        """
        Return a new line, to a successor of the same name where it has ended.

        :raises OSError: there is none.
        """
        try:
            return Line(self._present)
        except OSError:
            heirs = [each for each in bridges() if each[1:3] == self._present[1:3]]
            if len(heirs) != 1 or heirs[0].process == self._present.process:
                raise
            self._present, = heirs
            return Line(self._present)

    def answers(self, until: float) -> list[list[str]]:
        """
        Return all messages, up to the end.

        :raises TimeoutError: there was none until then.
        :raises OSError: it is gone.
        :raises Rubbish: it is no bridge.
        """
        found: list[list[str]] = []
        while True:
            now = self._clock.now()     # before it looks: it may not run for a while
            message = self._line.take()
            if now > until and (message is None or len(found) >= _LATE_MAX):
                raise TimeoutError
            if message is None:
                self._clock.wait(now + LOOK_PERIOD)
            elif message[0] == END:
                return found
            elif message[0] == NO:
                raise Rubbish(*message[1:])
            else:
                found.append(message)

    def introduce(self, until: float) -> None:
        """Read its name, after it was asked for."""
        for kind, *words in self.answers(until):
            if kind == 'drives':
                self.drives = words
            elif kind == 'bridge':
                self.name, self.seen = words[0], words[2:]

    def close(self) -> None:
        """Close the connection."""
        self._line.close()


def _found(namespace: str | None, clock: Clock) -> list[_Bridge] | None:
    """
    Return the bridges that may be meant, each with its name.

    :param namespace: in which they are, or a pattern of some; None: anywhere.
    :return: None: not all known ones are reached this way.
    """
    domain = own_domain()
    present = [each for each in bridges() if each.domain == domain and each.may_be_in(namespace)]
    if not switched_on() or not present:
        return None
    found: list[_Bridge] = []
    try:
        for each in present:
            found.append(_Bridge(each, clock))
        if not all(bridge.believed for bridge in found):
            raise PermissionError
        for bridge in found:
            bridge.ask('who')
        until = clock.now() + PATIENCE
        for bridge in found:
            bridge.introduce(until)
    except (OSError, *_SENSELESS):
        for bridge in found:
            bridge.close()
        return None
    return found


def _meant(found: Sequence[_Bridge], namespace: str | None) -> tuple[list[_Bridge], list[str]]:
    """Return those in a namespace, and the names of all that they see there, themselves too."""
    def is_there(name: str) -> bool:
        return namespace is None or in_namespace(name, namespace)
    here = [each for each in found if is_there(each.name)]
    return here, sorted({each.name for each in here} | {
        name for each in here for name in each.seen if is_there(name)})


def _without_others(found: Sequence[_Bridge], namespace: str | None) -> list[_Bridge] | None:
    """
    Return the bridges that are meant; None: some of them are elsewhere.

    :raises WhichBridge: they are not in one namespace, or share a name.
    """
    here, names = _meant(found, namespace)
    if not is_some(namespace):
        must_stand_together(names)
    return here if here and len(here) == len(names) else None


class LocalWay:
    """
    A :class:`.Way`.

    :param found: the bridges.
    :raises WhichBridge: two have a drive of one name.
    """

    def __init__(self, found: Sequence[_Bridge], clock: Clock) -> None:
        self._found = found
        self._clock = clock
        self._at = {node: each for each in found for node in (each.name, *each.drives)}
        self.bridge_of: Mapping[str, str] = bridges_of({
            each.name: [node.rpartition('/')[2] for node in each.drives]
            for each in sorted(found, key=lambda each: each.name)})

    def _ask(self, action: str, node: str, *words: str) -> list[list[str]]:
        """
        Call a bridge about one of its nodes.

        :raises NoAnswer: it does not answer, or is gone.
        """
        bridge = self._at[node]
        try:
            bridge.ask(action, node, *words)
        except OSError:
            raise NoAnswer(sentences.node_gone(node=node), asked=False) from None
        try:
            return bridge.answers(self._clock.now() + CALL_TIMEOUT)
        except BaseException as error:
            bridge.close()      # what may still come is no answer to the next question
            if isinstance(error, TimeoutError):
                raise NoAnswer(sentences.node_unanswering(node=node, timeout=CALL_TIMEOUT),
                               asked=True) from None
            if isinstance(error, OSError):
                raise NoAnswer(sentences.node_gone(node=node), asked=True) from None
            if isinstance(error, Rubbish):
                raise NoAnswer(sentences.node_does_not_answer(
                    node=node, reason=str(error)), asked=False) from None
            raise

    def get(self, node: str, names: Sequence[str]) -> Sequence[Found]:
        """Return values of parameters; fewer where a bridge does not know one of them."""
        with _sense(node):
            return [_value(words[0]) for _, *words in self._ask('get', node, *names)]

    def describe(self, node: str, names: Sequence[str]) -> Sequence[Described]:
        """Return the descriptions of parameters of a drive."""
        with _sense(node):
            return [Described(name, text, facts, _limit(minimum), _limit(maximum))
                    for _, name, text, facts, minimum, maximum in self._ask(
                        'describe', node, *names)]

    def listed(self, node: str) -> Sequence[str]:
        """Return the names of the parameters that a drive lists."""
        return [name for _, *words in self._ask('list', node) for name in words]

    def set(self, node: str, name: str, value: Value) -> tuple[bool, str]:
        """Set a parameter of a drive; return whether it was, and why not, or a note."""
        with _sense(node):
            (_, done, reason), = self._ask('set', node, name, value_text(value))
            return done == '1', reason

    def condition(self, drive: str, *, age: float, patience: float) -> Mapping[str, str]:
        """Return the present diagnostics of a drive; none: its bus hangs."""
        node = f'{self.bridge_of[drive].rpartition("/")[0]}/{drive}'
        with _sense(node):
            return {words[0]: words[1] for _, *words in self._ask('status', node)}

    def close(self) -> None:
        """Close the connections. Idempotent."""
        for each in self._found:
            each.close()


@contextmanager
def _sense(node: str) -> Iterator[None]:
    """
    Parse the answer of a node.

    :raises NoAnswer: it is no answer of a bridge.
    """
    try:
        yield
    except _SENSELESS:
        raise NoAnswer(sentences.node_does_not_answer(
            node=node, reason=sentences.makes_no_sense()), asked=True) from None


def _value(text: str) -> Found:
    value = value_of(text)
    return value if isinstance(value, (bool, int, float, str, tuple)) else None


def _limit(text: str) -> float | None:
    value = value_of(text)
    return value if isinstance(value, (int, float)) else None


def local_way(namespace: str | None, clock: Clock) -> LocalWay | None:
    """
    Return the local way to the bridges of one namespace; None: there is none.

    :param namespace: ``/cell``, '' for the root; None: anywhere, if there is only one.
    :raises WhichBridge: there are several, and not together.
    """
    found = _found(namespace, clock)
    if found is None:
        return None
    try:
        meant = _without_others(found, namespace)
        if meant is not None and any(each.drives for each in meant):
            return LocalWay(meant, clock)
    except BaseException:
        for each in found:
            each.close()
        raise
    for each in found:
        each.close()
    return None


class NoWay(Exception):
    """The local way does not reach all that are meant."""


class LocalWays:
    """The local ways to the drives that commands are for."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._at: dict[str, _Bridge] = {}
        self._found: list[_Bridge] = []

    def known(self, place: str | None) -> list[str]:
        """
        Return the full names of all drives in a namespace, or in those of a pattern.

        :param place: None: the only one.
        :raises WhichBridge: there are several, and not together.
        :raises NoWay: some of them are reached another way, or none is.
        """
        found = _found(place, self._clock) or []
        self._found += found
        meant = _without_others(found, place)
        if meant is None:
            raise NoWay
        meant.sort(key=lambda each: each.name)
        if not is_some(place):
            bridges_of({each.name: [node.rpartition('/')[2] for node in each.drives]
                        for each in meant})
        nodes = {node: each for each in meant for node in each.drives}
        if not nodes:
            raise NoWay
        self._at.update(nodes)
        return list(nodes)

    def give(self, order: str, nodes: Sequence[str]) -> list[Answer]:
        """
        Command drives, all of them at once.

        :param order: one of :data:`.SERVICES`.
        """
        asked: dict[_Bridge, list[str]] = {}
        for node in nodes:
            asked.setdefault(self._at[node], []).append(node)
        answers = {node: Answer(node, False, sentences.bridge_has_gone()) for node in nodes}
        waiting = []
        for bridge, names in asked.items():
            try:
                bridge.ask(order, *names)
                waiting.append(bridge)
            except OSError:
                answers.update((name, unoffered(name, order)) for name in names)
        until = self._clock.now() + CONTROL_TIMEOUT
        for bridge in waiting:
            try:
                for kind, name, *words in bridge.answers(until):
                    answers[name] = (unoffered(name, order) if kind == 'unoffered'
                                     else Answer(name, words[0] == '1', words[2]))
            except TimeoutError:
                answers.update((node, unanswered(node, CONTROL_TIMEOUT)) for node in asked[bridge])
            except _SENSELESS:      # it lives
                answers.update((node, Answer(node, False, sentences.no_answer_briefly()))
                               for node in asked[bridge])
            except OSError:
                continue
        return [answers[node] for node in nodes]

    def close(self) -> None:
        """Close the connections."""
        for each in self._found:
            each.close()


@contextmanager
def local_ways(clock: Clock) -> Iterator[LocalWays]:
    """Yield ways that are closed afterwards."""
    ways = LocalWays(clock)
    try:
        yield ways
    finally:
        ways.close()
