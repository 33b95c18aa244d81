# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``drive_can stop``, ``enable``, ``disable``, ``reset``: commands by hand, through the bridges.

``stop`` is typed in an emergency, so imports are kept minimal.
"""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from functools import partial
from typing import Any

from drive_can_bridge.cli.command import (
    add_words_for_a_bridge, complain, imports_of, only_through_a_bridge, WrongUsage)
from drive_can_bridge.cli.stopping import answers, show
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.bridges import chosen_drives, UnknownDrive
from drive_can_bridge.core.errors import DriveCanError, WhichBridge
from drive_can_bridge.host_texts import is_pattern
from drive_can_bridge.process.local_stop import Answer, begun, LocalStop
from drive_can_bridge.process.local_way import matches

STOP = 'stop'
_WORDS = {
    STOP: ('[DRIVE …]', '*', 'stop drives; without a name all drives of every bridge, at once',
           'Calls ~/quick_stop of each drive, and asks nothing. Without a name it stops those of '
           'all bridges of this computer, whatever their ROS domain or user, and of other '
           'computers in this domain; a name means this domain. Exit code 0: all have stopped. '
           '1: the lines at the top say who may still be running.'),
    'enable': ('DRIVE …', '+', 'enable drives', 'Calls ~/enable. Nothing moves: setpoints stay '
                                              'neutral until they are armed.'),
    'disable': ('DRIVE …', '+', 'disable drives', 'Calls ~/enable with false.'),
    'reset': ('DRIVE …', '+', 'reset the faults of drives', 'Calls ~/reset_fault.'),
}
#: s between two looks at what has arrived
LOOK_PERIOD = 0.002
#: s that a node may take to join the graph where it is no longer wanted there
JOIN_TIMEOUT = 2.0


def define(parser: ArgumentParser) -> None:
    """Define the words and options of one of the subcommands."""
    command = parser.prog.rpartition(' ')[2]
    metavar, nargs, what, how = _WORDS[command]
    patterns = command in (STOP, 'disable')
    parser.description = f'{what[0].upper()}{what[1:]}. {how}'
    if command != STOP:     # which says what else it means
        parser.epilog = 'Exit code 0: all did it. 1: not all, or no bridge. 2: wrong usage.'
    add_words_for_a_bridge(
        parser, metavar, nargs, 'a drive, by its name or its full name in the ROS graph '
        '(/cell/lift)' + ('; patterns too' if patterns else ''),
        namespace_help='only the bridge in this namespace', yes='accepted; nothing is asked')


def run(args: Namespace) -> int:
    """
    Command drives, and show their answers.

    :return: 0 all succeeded, 1 not all.
    :raises WrongUsage: the words are wrong.
    :raises DriveCanError: no bridge, no ROS.
    """
    _check(args)
    if args.subcommand == STOP:
        return _stop(args)
    from drive_can_bridge.cli.output import waiting     # a stop has no time for that
    try:
        with waiting('waiting for the bridge'):
            found = _given_locally(args)
            if found is None:
                found = _given(args)
    except (UnknownDrive, WhichBridge) as error:
        raise WrongUsage(str(error)) from None
    return show(found, args.subcommand, json=args.json)


def _given_locally(args: Namespace) -> list[Answer] | None:
    """Command drives by the local way; None: it does not reach all of them."""
    from drive_can_bridge.client.local import local_ways, NoWay
    with local_ways(args.clock) as ways:
        try:
            nodes = chosen_drives(args.words, args.namespace, ways.known, matches)
        except NoWay:
            return None
        return ways.give(args.subcommand, nodes)


def _given(args: Namespace) -> list[Answer]:
    """Command drives through ROS."""
    graph, commands = _ros(args)
    try:
        nodes = chosen_drives(args.words, args.namespace, partial(commands.known_drives, graph),
                              matches)
        found: list[Answer] = commands.give(graph, args.subcommand, nodes)
        return found
    finally:
        graph.close()


def _ros(args: Namespace, join: Callable[[Callable[[], Any]], Any] = lambda make: make(),
         ) -> tuple[Any, Any]:
    """
    Join the ROS graph; return it, and the module that commands drives there.

    :param join: makes the client node.
    :raises DriveCanError: no ROS.
    """
    with imports_of(f'drive_can {args.subcommand}'):
        from drive_can_bridge.ros.client.client_node import ClientNode
        # is being discovered while the rest is imported
        client_node = join(partial(ClientNode, 'client'))
        from drive_can_bridge.ros.client import drive_commands
        from drive_can_bridge.ros.client.graph import Graph
    return Graph(args.clock, client_node), drive_commands


def _check(args: Namespace) -> None:
    """
    Check the words without asking a bridge.

    :raises WrongUsage: they are wrong.
    """
    only_through_a_bridge(args)
    if args.subcommand in ('enable', 'reset'):
        for word in args.words:
            if is_pattern(word):
                raise WrongUsage(command_sentences.full_names_only(word=repr(word)))


def _stop(args: Namespace) -> int:
    """Stop drives: of this host by the local way, and through ROS where that does not reach."""
    local = begun(args.namespace, args.words)
    ros = _RosStop(args, local)
    now = args.clock.now
    try:
        while not local.look(now()) and not ros.look(now()):
            args.clock.wait(now() + LOOK_PERIOD)
        told = ros.answers()
    except KeyboardInterrupt:
        complain('interrupted; this is known:')
        show(ros.answers(), STOP, json=args.json)
        raise
    except Exception:   # no ROS, for whatever reason: what is known without it is printed
        if local.answers() or local.unheard:
            show(answers(local, None, args.namespace, args.words), STOP, json=args.json)
        raise
    else:
        return show(told, STOP, json=args.json)
    finally:
        local.close()
        ros.close()


class _Joining:
    """
    Joins the ROS graph in a thread of its own, because that takes a while.

    :ivar done: the graph, and the module that commands drives there; None: not yet.
    :ivar failure: why there is none.
    """

    def __init__(self, args: Namespace) -> None:
        self.done: tuple[Any, Any] | None = None
        self.failure: Exception | None = None
        self._args = args
        self._node: Any = None
        self._given_up = False
        self._making = args.clock.lock()
        args.clock.worker(self._run, 'ROS').start()

    def _run(self) -> None:
        try:
            self.done = _ros(self._args, self._join)
        except Exception as error:  # noqa: BLE001  raised again in the waiting thread
            self.failure = error

    def _join(self, make: Callable[[], Any]) -> Any:
        with self._making:
            if self._given_up:
                raise DriveCanError('nobody wants this any more')
            self._node = make()
        return self._node

    def close(self) -> None:
        """Leave the graph completely; imports may go on."""
        made = self._making.acquire(JOIN_TIMEOUT)
        self._given_up = True
        if self._node is not None:
            self._node.leave()
        if made:
            self._making.release()


class _RosStop:
    """The part of a stop that goes through ROS, started where it is needed."""

    def __init__(self, args: Namespace, local: LocalStop) -> None:
        self._args = args
        self._local = local
        self._joining: _Joining | None = None
        self._stop: Any = None

    def look(self, now: float) -> bool:
        """
        Continue; return whether all is done, of the local part, too.

        :raises DriveCanError: no ROS, and nothing is to be expected without it.
        """
        local = self._local
        if self._stop is None and local.wants_ros(now):
            self._begin(now)
        if self._stop is None:
            return False
        for name, told in local.known.items():
            self._stop.know(name, told.drives, told.seen)
        self._stop.leave(local.handled)
        return self._stop.look(now) and local.over(now)

    def _begin(self, now: float) -> None:
        """Join the graph, and start to stop drives there."""
        args, local = self._args, self._local
        if self._joining is None:
            self._joining = _Joining(args)
        if self._joining.failure is not None and local.over(now):
            raise self._joining.failure
        if self._joining.done is not None:
            graph, commands = self._joining.done
            self._stop = commands.StopRequests(graph.client_node, args.namespace, args.words, [
                each.name for each in local.present
                if each.domain == local.domain and each.has_place])

    def answers(self) -> list[Answer]:
        """Return all results."""
        return answers(self._local, self._stop, self._args.namespace, self._args.words)

    def close(self) -> None:
        """Leave the graph."""
        if self._joining is not None:
            self._joining.close()
