# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A stop that came by the local way, passed on to bridges of other hosts.

A command that has just begun has to discover them, a bridge has done so: clients that it makes now
are matched within some milliseconds. Only what a command of this host asks for is passed on, so
nothing goes round in circles.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress

from rclpy.node import Node

from drive_can_bridge.clock import Clock, Mailbox, Worker
from drive_can_bridge.core.sentences import client_by_rclpy
from drive_can_bridge.process.local_server import Asked
from drive_can_bridge.process.local_stop import Answer, RUNNING
from drive_can_bridge.ros.client.control import Stop
from drive_can_bridge.ros.client.search import LOOK_PERIOD
from drive_can_bridge.ros.rcl.end import End
from drive_can_bridge.ros.rcl.extension import GONE

#: s that the bridges may take to say which drives they have, and the drives to stop
PATIENCE = 1.0


class NodeEnd:
    """
    The node of a bridge, as a client of other bridges wants one.

    :param warn: takes why its end cannot be the node itself.
    :ivar end: of the node.
    """

    def __init__(self, node: Node, warn: Callable[[str], object]) -> None:
        self.end = End(node.context, f'_{node.get_name()}_passing_on',
                       lambda reason: warn(client_by_rclpy(reason)), node)
        self.services, self.topics = self.end.services, self.end.topics


class Passing:
    """
    Passes stops on, one after the other; those that came meanwhile share the next.

    The thread begins with the first one.

    :param warn: takes a line for the log.
    """

    def __init__(self, node: Node, clock: Clock, warn: Callable[[str], object]) -> None:
        self._node, self._warn = node, warn
        self._end_of: NodeEnd | None = None
        self._clock = clock
        self._waiting: Mailbox[tuple[tuple[str, ...], Asked] | None] = Mailbox(clock)
        self._ending = False
        self._thread: Worker | None = None

    def begin(self, words: Sequence[str], asked: Asked) -> None:
        """
        Pass a stop on. From one thread.

        :param words: full names of bridges; behind an empty word drives to be left alone; behind
            another one what is meant.
        """
        if self._thread is None:
            self._thread = self._clock.worker(self._run, 'passing on')
            self._thread.start()
        self._waiting.put((tuple(words), asked))

    def end(self) -> None:
        """Pass nothing on any more."""
        self._ending = True
        self._waiting.put(None)
        if self._thread is not None:
            self._thread.join(PATIENCE)
        if self._end_of is not None:
            self._end_of.end.close()

    def _run(self) -> None:
        while not self._ending:
            first = self._waiting.get()
            if first is None:
                return
            words, asked = first
            together, others = [asked], []
            for _ in range(len(self._waiting)):
                each = self._waiting.get()
                if each is not None and each[0] == words:
                    together.append(each[1])
                else:
                    others.append(each)
            for each in others:
                self._waiting.put(each)
            drives, answers = self._passed(words)
            for one in together:
                one.answer('drives', *drives)
                for answer in answers:
                    one.answer('passed', answer.name, f'{answer.ok:d}', answer.text,
                               f'{answer.bridge:d}')
                one.end()

    def _passed(self, words: Sequence[str]) -> tuple[list[str], list[Answer]]:
        """Return drives of bridges, and what became of them, or of bridges that do not answer."""
        bridges, handled, meant = (list(part) for part in _parts(words))
        stop: Stop | None = None
        try:
            if self._end_of is None:
                self._end_of = NodeEnd(self._node, self._warn)
            stop = Stop(self._end_of, None, meant, bridges, only=bridges, patience=PATIENCE)
            stop.leave(handled)
            while not self._ending and not stop.look(self._clock.now()):
                self._clock.wait(self._clock.now() + LOOK_PERIOD)
            return stop.drives, stop.answers()
        except Exception as error:  # noqa: BLE001  a policy, or an end meanwhile: rcl has many types
            reason = str(error).partition(', at ')[0]
            text = f'a stop cannot be passed on to this bridge ({reason}): its drives {RUNNING}'
            return [], [Answer(name, False, text, bridge=True) for name in bridges]
        finally:
            if stop is not None:
                with suppress(*GONE):
                    stop.close()


def _parts(words: Sequence[str]) -> tuple[Sequence[str], Sequence[str], Sequence[str]]:
    """Take apart what stands between empty words."""
    first = words.index('') if '' in words else len(words)
    rest = words[first + 1:]
    second = rest.index('') if '' in rest else len(rest)
    return words[:first], rest[:second], rest[second + 1:]
