# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``drive_can stop``, ``enable``, ``disable``, ``reset``: drives told by hand, through their bridges.

``stop`` is what a hand types in a fright, so nothing is imported here that it can do without.
"""

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
import re
from typing import Any

from drive_can_bridge.cli.command import (
    complain, FAILED, namespace, print_json, say, WrongUsage,
)
from drive_can_bridge.core.errors import DriveCanError, WhichBridge
from drive_can_bridge.core.text import is_pattern
from drive_can_bridge.process.locks import bridges, Present, short
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
_UP_TO_WILD = re.compile(r'[^*?[]*')


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
    try:
        from drive_can_bridge.ros.client.calls import ClientNode
        client_node = ClientNode('client')     # is being discovered while the rest is imported
        from drive_can_bridge.ros.client import control
        from drive_can_bridge.ros.client.search import Graph
    except ImportError as error:
        raise DriveCanError(what_is_missing(f'drive_can {args.subcommand}', error)) from error
    graph = Graph(args.clock, client_node)
    try:
        if args.subcommand == STOP:
            return _stop(args, graph)
        from drive_can_bridge.cli.output import waiting     # a stop has no time for that
        try:
            with waiting('waiting for the bridge'):
                answers = control.give(graph, args.subcommand, args.namespace, args.words)
            return _show(args, answers)
        except (control.UnknownDrive, WhichBridge) as error:
            raise WrongUsage(str(error)) from None
    finally:
        graph.close()


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


def _stop(args: Namespace, graph: Any) -> int:
    from drive_can_bridge.ros.client.control import Answer, Stop
    domain = graph.client_node.context.get_domain_id()
    present = [each for each in bridges() if _concerns(each, args.namespace, args.words)]
    stop = Stop(graph, args.namespace, args.words, [
        each.name for each in present if each.domain == domain and each.has_place])
    try:
        graph.wait(stop.look, float('inf'))
    except KeyboardInterrupt:
        complain('interrupted; this is known:')
        _show(args, stop.answers())
        raise
    known = {short(name) for name in stop.seen}
    unseen = [Answer(each.name, False,
                     f'{each.silence(domain)}: its drives may still be running', bridge=True)
              for each in present if each.domain != domain or each.name not in known]
    return _show(args, [*unseen, *stop.answers()])


def _concerns(present: Present, namespace: str | None, words: Sequence[str]) -> bool:
    """Tell whether a bridge of this host may have one of the drives that are meant."""
    if namespace is not None or not present.has_place:
        return present.may_be_in(namespace)
    place = present.name.rpartition('/')[0]
    return not words or any(not word.startswith('/') or _may_mean(word, f'{place}/')
                            for word in words)


def _may_mean(word: str, place: str) -> bool:
    """Tell whether a full name, or a pattern of some, may mean a drive in a namespace."""
    literal = _UP_TO_WILD.match(word)[0]    # type: ignore[index]  # matches anything
    if literal.startswith(place):
        return '/' not in literal[len(place):]
    return is_pattern(word) and place.startswith(literal)


def _show(args: Namespace, answers: Sequence[Any]) -> int:
    """Print what became of it, failures first; return the exit code."""
    for answer in sorted(answers, key=lambda each: each.ok):
        name = answer.name.lstrip('/')
        if args.json:
            print_json({'bridge' if answer.bridge else 'drive': name, 'ok': answer.ok,
                        'message': answer.text})
        else:
            verdict = '' if answer.ok or args.subcommand != STOP else 'NOT STOPPED'
            say(': '.join(filter(None, (name, verdict, answer.text))))
    return 0 if answers and all(answer.ok for answer in answers) else FAILED
