# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``drive_can stop``, ``enable``, ``disable``, ``reset``: drives told by hand, through their bridges.

``stop`` is what a hand types in a fright, so nothing is imported here that it can do without.
"""

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from functools import partial
from typing import Any

from drive_can_bridge.cli.command import (
    complain, FAILED, namespace, print_json, say, WrongUsage,
)
from drive_can_bridge.core.bridges import chosen_drives, UnknownDrive
from drive_can_bridge.core.errors import DriveCanError, WhichBridge
from drive_can_bridge.core.text import is_pattern
from drive_can_bridge.process.environment import nobody
from drive_can_bridge.process.local_stop import Answer, begun, LocalStop, RUNNING
from drive_can_bridge.process.local_way import matches
from drive_can_bridge.process.presence import short
from drive_can_bridge.resources import what_is_missing

STOP = 'stop'
_WORDS = {
    STOP: ('[DRIVE …]', '*', 'stop drives; without a name all drives of every bridge, at once',
           'Calls ~/quick_stop of each drive, and asks nothing. Exit code 0: all have stopped. '
           '1: the lines at the top say who may still be running.'),
    'enable': ('DRIVE …', '+', 'enable drives', 'Calls ~/enable. Nothing moves: setpoints stay '
                                              'neutral until they are armed.'),
    'disable': ('DRIVE …', '+', 'disable drives', 'Calls ~/enable with false.'),
    'reset': ('DRIVE …', '+', 'reset the faults of drives', 'Calls ~/reset_fault.'),
}
#: s between two looks at what has arrived
LOOK_PERIOD = 0.002


def define(parser: ArgumentParser) -> None:
    """Define the words and options of one of the subcommands."""
    command = parser.prog.rpartition(' ')[2]
    metavar, nargs, what, how = _WORDS[command]
    patterns = command in (STOP, 'disable')
    parser.allow_abbrev = False
    parser.description = f'{what[0].upper()}{what[1:]}. {how}'
    parser.usage = f'%(prog)s [option …] {metavar}'
    words = parser.add_argument('words', metavar=metavar, nargs=nargs, help=(
        'a drive, by its name or its full name in the ROS graph (/cell/lift)'
        + ('; patterns too' if patterns else '')))
    if command != STOP:     # which says what else it means
        parser.epilog = 'Exit code 0: all did it. 1: not all, or no bridge. 2: wrong usage.'
    words.completer = _complete     # type: ignore[attr-defined]  # for argcomplete
    parser.add_argument('--namespace', metavar='NS', type=namespace,
                        help='only the bridge in this namespace')
    parser.add_argument('--json', action='store_true', help='a JSON document a line')
    parser.add_argument('--yes', action='store_true', help='accepted; nothing is asked')
    parser.add_argument('-p', '--params-file', metavar='FILE', help='refused: these go through '
                                                                    'the running bridge only')


def _complete(prefix: str, parsed_args: Namespace, **more: object) -> list[str]:
    from drive_can_bridge.cli.drives import complete_drives
    return complete_drives(prefix, parsed_args, **more)


def run(args: Namespace) -> int:
    """
    Tell drives, and show their answers.

    :return: 0 all did it, 1 not all.
    :raises WrongUsage: what was typed cannot be obeyed.
    :raises DriveCanError: no bridge, no ROS.
    """
    _check(args)
    if args.subcommand == STOP:
        return _stop(args)
    from drive_can_bridge.cli.output import waiting     # a stop has no time for that
    try:
        with waiting('waiting for the bridge'):
            answers = _given_locally(args)
            if answers is None:
                answers = _given(args)
    except (UnknownDrive, WhichBridge) as error:
        raise WrongUsage(str(error)) from None
    return _show(args, answers)


def _given_locally(args: Namespace) -> list[Answer] | None:
    """Tell drives by the local way; None: it does not lead to all of them."""
    from drive_can_bridge.client.local import local_ways, NoWay
    with local_ways(args.clock) as ways:
        try:
            nodes = chosen_drives(args.words, args.namespace, ways.known, matches)
        except NoWay:
            return None
        return ways.give(args.subcommand, nodes)


def _given(args: Namespace) -> list[Answer]:
    """Tell drives through ROS."""
    graph, control = _ros(args)
    try:
        nodes = chosen_drives(args.words, args.namespace, partial(control.known_drives, graph),
                              matches)
        found: list[Answer] = control.give(graph, args.subcommand, nodes)
        return found
    finally:
        graph.close()


def _ros(args: Namespace) -> tuple[Any, Any]:
    """
    Become part of the ROS graph; return that, and what tells drives there.

    :raises DriveCanError: no ROS.
    """
    try:
        from drive_can_bridge.ros.client.calls import ClientNode
        client_node = ClientNode('client')     # is being discovered while the rest is imported
        from drive_can_bridge.ros.client import control
        from drive_can_bridge.ros.client.search import Graph
    except ImportError as error:
        raise DriveCanError(what_is_missing(f'drive_can {args.subcommand}', error)) from error
    return Graph(args.clock, client_node), control


def _check(args: Namespace) -> None:
    """
    See whether the command line alone shows that something is wrong.

    :raises WrongUsage: it does.
    """
    if args.params_file is not None:
        raise WrongUsage('goes through the running bridge: leave --params-file away')
    if args.subcommand in ('enable', 'reset'):
        for word in args.words:
            if is_pattern(word):
                raise WrongUsage(f'{word!r}: takes full names, no patterns')


def _stop(args: Namespace) -> int:
    """Stop drives: of this host by the local way, and through ROS where that does not reach."""
    local = begun(args.namespace, args.words)
    ros = _RosStop(args, local)
    now = args.clock.now
    try:
        while not local.look(now()) and not ros.look(now()):
            args.clock.wait(now() + LOOK_PERIOD)
        return _show(args, ros.answers())
    except KeyboardInterrupt:
        complain('interrupted; this is known:')
        _show(args, ros.answers())
        raise
    except DriveCanError:   # no ROS: what was reached without is told all the same
        if local.answers():
            _show(args, ros.answers())
        raise
    finally:
        local.close()
        ros.close()


class _RosStop:
    """The part of a stop that goes through ROS, begun where there is need of it."""

    def __init__(self, args: Namespace, local: LocalStop) -> None:
        self._args = args
        self._local = local
        self._graph: Any = None
        self._stop: Any = None

    def look(self, now: float) -> bool:
        """Go on; return whether all is done, of the local part, too."""
        args, local = self._args, self._local
        if self._stop is None:
            if not local.wants_ros(now):
                return False
            self._graph, control = _ros(args)
            self._stop = control.Stop(self._graph.client_node, args.namespace, args.words, [
                each.name for each in local.present
                if each.domain == local.domain and each.has_place])
        for name, told in local.known.items():
            self._stop.know(name, told.drives, told.seen)
        self._stop.leave(local.handled)
        return self._stop.look(now) and local.over(now)

    def answers(self) -> list[Answer]:
        """Return what became of all."""
        args, local, stop = self._args, self._local, self._stop
        told, known, drives = list(local.answers()), set(local.known), local.drives
        heard = set() if stop is None else {short(name) for name in stop.heard}
        told = [Answer(each.name, False, f'{each.silence(local.domain)}: its drives {RUNNING}',
                       bridge=True)
                for each in local.unheard
                if each.domain != local.domain or each.name not in heard] + told
        if stop is not None:
            named = {answer.name for answer in told if answer.bridge}
            told += [answer for answer in stop.answers(local.present)
                     if not answer.bridge or short(answer.name) not in named]
            known, drives = known | stop.seen, [*drives, *stop.drives]
        nodes = {answer.name for answer in told if not answer.bridge}
        there = ', '.join(node.lstrip('/') for node in dict.fromkeys(drives)) or 'none'
        told += [Answer(word, False, f'no such drive; there are: {there}') for word in args.words
                 if known and not any(matches(word, node) for node in nodes)]
        own = any(each.domain in (None, local.domain) for each in local.present)
        if not known and (not told or not own and stop is not None):
            # those of other domains may be all that there are, or discovery was too slow
            told.append(Answer('', bool(told), nobody(args.namespace), bridge=True))
        return told or [Answer(name, False, 'has no drives: it is not configured', bridge=True)
                        for name in known]

    def close(self) -> None:
        """Leave the graph."""
        if self._graph is not None:
            self._graph.close()


def _show(args: Namespace, answers: Sequence[Any]) -> int:
    """Print what became of it, failures first; return the exit code."""
    for answer in sorted(answers, key=lambda each: each.ok):
        name, elsewhere = answer.name.lstrip('/'), answer.domain is not None
        if args.json:
            print_json({'bridge' if answer.bridge else 'drive': name, 'ok': answer.ok,
                        'message': answer.text,
                        **({'domain': answer.domain} if elsewhere else {})})
        else:
            verdict = '' if answer.ok or args.subcommand != STOP else 'NOT STOPPED'
            say((f'[domain {answer.domain}] ' if elsewhere else '')
                + ': '.join(filter(None, (name, verdict, answer.text))))
    return 0 if answers and all(answer.ok for answer in answers) else FAILED
