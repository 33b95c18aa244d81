# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A stop that came by the local way, passed on to bridges of other hosts.

A command that has just started has to discover them, a bridge has done so: clients that it makes
now are matched within some milliseconds. Only a request of a command of this host is passed on, so
nothing goes round in circles.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
import math
from typing import NamedTuple

from rclpy.node import Node

from drive_can_bridge.clock import Clock, Mailbox, Worker
from drive_can_bridge.core import sentences
from drive_can_bridge.process.local_server import LocalRequest
from drive_can_bridge.process.local_stop import Answer
from drive_can_bridge.process.local_way import PASSING_PERIOD
from drive_can_bridge.ros.client.drive_commands import StopRequests
from drive_can_bridge.ros.client.graph import LOOK_PERIOD
from drive_can_bridge.ros.rcl.end import TopicEnd
from drive_can_bridge.ros.rcl.extension import GONE

#: s that the bridges may take to say which drives they have, and the drives to stop
PATIENCE = 1.0
#: stops of strangers that are passed on at a time
STRANGERS_AT_ONCE = 4
#: s for which an equal stop counts as the same: a later one shares the next
JUST_NOW = 0.25


class NodeEnd:
    """
    The node of a bridge, as an end for calls to other bridges.

    :param warn: logs why its end cannot be the node itself.
    :ivar end: of the node.
    """

    def __init__(self, node: Node, warn: Callable[[str], object]) -> None:
        self.end = TopicEnd(node.context, f'_{node.get_name()}_passing_on',
                            lambda reason: warn(sentences.client_by_rclpy(reason)), node)
        self.services, self.topics = self.end.services, self.end.topics


class OthersStop(NamedTuple):
    """
    A stop of drives of other bridges.

    :ivar bridges: their full names.
    :ivar handled: drives that are stopped already.
    :ivar words: names, patterns or full names of those that are meant; none: all.
    """

    bridges: tuple[str, ...]
    handled: tuple[str, ...]
    words: tuple[str, ...]

    @classmethod
    def of(cls, words: Sequence[str]) -> 'OthersStop':
        """Parse a request: the three lists, with an empty word between two of them."""
        parts: list[list[str]] = [[]]
        for word in words:
            if word or len(parts) == 3:
                parts[-1].append(word)
            else:
                parts.append([])
        bridges, handled, meant = [*parts, [], []][:3]
        return cls(tuple(bridges), tuple(handled), tuple(meant))


class _Way:
    """
    A stop that is being passed on to other bridges.

    :param find_end: returns what asks them.
    :param asked: the requests that get its answers.
    :ivar began: when it was started.
    """

    def __init__(self, find_end: Callable[[], NodeEnd], wanted: OthersStop,
                 asked: list[LocalRequest], now: float) -> None:
        self.wanted = wanted
        self.asked = asked
        self.began = now
        self.is_strangers = not any(each.trusted for each in asked)
        self._stop: StopRequests | None = None
        self._failure = ''
        with self._told():
            self._stop = StopRequests(find_end(), None, wanted.words, wanted.bridges,
                                      only=wanted.bridges, patience=PATIENCE)
            self._stop.leave(wanted.handled)

    def look(self, now: float) -> bool:
        """Continue; return whether all is done."""
        done = True
        with self._told():
            done = self._stop is None or self._stop.look(now)
        return done

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Record a failure instead of raising it: rcl has many types, such as for a policy."""
        try:
            yield
        except Exception as error:  # noqa: BLE001
            self._failure = str(error).partition(', at ')[0]
            self.close()

    def answer(self) -> None:
        """Answer with the results."""
        drives: list[str] = []
        answers: list[Answer] | None = None
        if self._stop is not None:
            with self._told():
                drives, answers = self._stop.drives, self._stop.answers()
        if answers is None:
            answers = [Answer(name, False, sentences.stop_not_passed_on(self._failure),
                              bridge=True) for name in self.wanted.bridges]
        for one in self.asked:
            one.answer('drives', *drives)
            for answer in answers:
                one.answer('passed', answer.name, f'{answer.ok:d}', answer.text,
                           f'{answer.bridge:d}')
            one.end()
        self.close()

    def close(self) -> None:
        """Drop the calls."""
        stop, self._stop = self._stop, None
        if stop is not None:
            with suppress(*GONE):
                stop.close()


class Passing:
    """
    Passes stops on, each at once; those that are the same as one of just now share the next.

    Not with one that is merely under way: a drive that hangs keeps that for long, and others may
    run again by then. Strangers have a few under way. The thread begins with the first one.

    :param warn: logs a warning.
    """

    def __init__(self, node: Node, clock: Clock, warn: Callable[[str], object]) -> None:
        self._node, self._warn = node, warn
        self._end_of: NodeEnd | None = None
        self._clock = clock
        self._mail: Mailbox[tuple[OthersStop, LocalRequest] | None] = Mailbox(clock)
        self._waiting: list[tuple[OthersStop, LocalRequest]] = []
        self._under_way: list[_Way] = []
        self._ending = False
        self._said_at = -math.inf
        self._thread: Worker | None = None

    def begin(self, wanted: OthersStop, asked: LocalRequest) -> None:
        """Start to pass a stop on. From one thread."""
        asked.answer('passing')
        if self._thread is None:
            self._thread = self._clock.worker(self._run, 'passing on')
            self._thread.start()
        self._mail.put((wanted, asked))

    def _find_end(self) -> NodeEnd:
        """Return the end for calls to others; created when it is needed first."""
        if self._end_of is None:
            self._end_of = NodeEnd(self._node, self._warn)
        return self._end_of

    def end(self) -> None:
        """End the thread, and all calls."""
        self._ending = True
        self._mail.put(None)
        if self._thread is not None:
            self._thread.join(PATIENCE)
        if self._end_of is not None:
            self._end_of.end.close()

    def _run(self) -> None:
        while not self._ending:
            try:
                self._turn()
            except Exception as error:  # noqa: BLE001  outermost loop of a thread
                self._warn(sentences.internal_error_in_answer(type(error).__name__, str(error)))
        for way in self._under_way:
            way.close()

    def _turn(self) -> None:
        self._take_mail()
        now = self._clock.now()
        if now >= self._said_at + PASSING_PERIOD:
            self._said_at = now
            for asked in (*(each for _, each in self._waiting),
                          *(each for way in self._under_way for each in way.asked)):
                asked.answer('passing')
        self._begin_what_may(now)
        for way in list(self._under_way):
            if way.look(now):
                self._under_way.remove(way)
                way.answer()

    def _take_mail(self) -> None:
        """Handle new requests; wait for one, only a moment while something is under way."""
        busy = self._under_way or self._waiting
        with suppress(TimeoutError):
            until = self._clock.now() + LOOK_PERIOD if busy else math.inf
            while not self._ending:
                item = self._mail.get(until)
                if item is not None:
                    self._waiting.append(item)
                until = -math.inf

    def _begin_what_may(self, now: float) -> None:
        """Start what waits, and may start; equal requests of the same time share one stop."""
        together: dict[OthersStop, list[LocalRequest]] = {}
        for wanted, asked in self._waiting:
            together.setdefault(wanted, []).append(asked)
        self._waiting = []
        for wanted, askers in together.items():
            strange = not any(each.trusted for each in askers)
            if any(way.wanted == wanted and now < way.began + JUST_NOW
                   for way in self._under_way) or strange and sum(
                    way.is_strangers for way in self._under_way) >= STRANGERS_AT_ONCE:
                self._waiting += [(wanted, each) for each in askers]
            else:
                self._under_way.append(_Way(self._find_end, wanted, askers, now))
