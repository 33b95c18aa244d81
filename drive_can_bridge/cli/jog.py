# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can jog``: hold a setpoint for a while, through the bridge."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Iterator
from contextlib import contextmanager
import signal
import sys
from typing import Any

from drive_can_bridge.cli.command import (
    above_zero, add_words_for_a_bridge, agreed, complain, FAILED, imports_of, must_be_answerable,
    only_through_a_bridge, print_json, say, WrongUsage)
from drive_can_bridge.cli.output import waiting
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.errors import DriveCanError, WhichBridge
from drive_can_bridge.core.text import printable
from drive_can_bridge.host_texts import is_pattern
from drive_can_bridge.process.critical_sections import handled, Interruption, postponed
from drive_can_bridge.process.signals import NOT_SUSPENDED

#: s: the default, and the longest time
_SECONDS, _LONGEST = 2.0, 60.0
#: s between two lines about the actual values
_LINE_PERIOD = 0.5
_YES_MEANS = 'answers the question with yes'


def define(parser: ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'Hold a setpoint for a while, through the running bridge, by the topic that any node '
        'could use: neutral until it is armed, VALUE, neutral. The drive has to be online, and '
        'enabled if it has control. Ends with neutral at once when it no longer is, when somebody '
        'else commands the drive, on Ctrl-C, and when this process was late; when it dies, '
        'command_timeout of the drive ends it.')
    parser.epilog = (
        'Exit code 0: an answered exchange carried VALUE, and a later one neutral. 1: not so, or '
        'refused; the line says why. 2: wrong usage.')
    add_words_for_a_bridge(
        parser, 'DRIVE [NAME] VALUE', '+', 'the drive, by its name or its full name in the ROS '
        'graph (/cell/lift); the setpoint, where it has several; and the value, in the unit of '
        'the profile', namespace_help='of the bridge, where there are several', yes='do not ask')
    parser.add_argument('--for', dest='seconds', metavar='S', type=_seconds, default=_SECONDS,
                        help=f'how long, {_LONGEST:g} s at most (default: {_SECONDS})')


def _seconds(text: str) -> float:
    value = above_zero(text)
    if value > _LONGEST:
        raise ArgumentTypeError(command_sentences.seconds_at_most(text=text, most=_LONGEST))
    return value


def run(args: Namespace) -> int:
    """
    Hold a setpoint.

    :return: 0 the drive got the value and neutral, 1 not so, 128 + n after a signal.
    :raises WrongUsage: the words are wrong.
    :raises DriveCanError: refused, no bridge, no ROS.
    """
    drive, name, value = _understood(args)
    must_be_answerable(yes=args.yes, otherwise='nothing was moved', yes_means=_YES_MEANS)
    with imports_of('drive_can jog'):
        from drive_can_bridge.client.jog import find_target
        from drive_can_bridge.ros.client.client_node import ClientNode
        from drive_can_bridge.ros.client.graph import Graph
    graph = Graph(args.clock, ClientNode('jog'))
    try:
        with waiting('looking for the drive'):
            target = find_target(graph, args.namespace, drive, name, value)
        label = target.node.lstrip('/')
        question = (f'{label}: {target.parameter.name} {target.in_words(target.value)} for '
                    f'{args.seconds:g} s. Does nobody stand where it moves?')
        if not agreed(question, yes=args.yes, otherwise='nothing was moved',
                      yes_means=_YES_MEANS):
            return FAILED
        return _move(args, graph, target, label)
    except WhichBridge as error:
        raise WrongUsage(str(error)) from None
    except DriveCanError as error:
        raise DriveCanError(f'{drive}: {error}') from None
    finally:
        graph.close()


def _understood(args: Namespace) -> tuple[str, str | None, str]:
    """
    Return drive, setpoint or None, and value from the words.

    :raises WrongUsage: something is missing, or too much.
    """
    only_through_a_bridge(args)
    if len(args.words) not in (2, 3):
        raise WrongUsage(command_sentences.jog_words())
    drive, value = args.words[0], args.words[-1]
    if is_pattern(drive):
        raise WrongUsage(command_sentences.full_name_only(drive=repr(drive)))
    if value.lower() not in ('true', 'false'):
        try:
            float(value)
        except ValueError:
            raise WrongUsage(command_sentences.no_number_or_bool(value=repr(value))) from None
    return drive, args.words[1] if len(args.words) == 3 else None, value


def _move(args: Namespace, graph: Any, target: Any, label: str) -> int:
    from drive_can_bridge.client.jog import Jog, with_unit
    shown = {parameter.name: parameter for parameter in target.shown}
    due = 0.0
    unseen: list[OSError] = []  # the output is not read: nobody may be watching the drive

    def show(elapsed: float) -> None:
        nonlocal due
        if elapsed < due:
            return
        told = ', '.join(f'{name} {with_unit(shown[name], value)}'
                         for name, value in jog.values.items() if name in shown)
        if shown and not (told or args.json):   # no value has arrived yet
            return
        due = elapsed + _LINE_PERIOD
        try:
            if args.json:
                print_json({'drive': label, 'seconds': round(elapsed, 2), 'values': jog.values})
            else:
                say(f'{label}: {elapsed:4.1f} s' + f': {told}' * bool(told))
            sys.stdout.flush()
        except OSError as error:
            unseen.append(error)

    with _kept_running() as interruption:
        jog = Jog(graph, target, args.seconds, lambda: interruption or unseen)
        try:
            outcome = jog.run(show)
        finally:
            jog.close()
    if unseen:
        raise unseen[0]
    if interruption:
        complain(f'{label}: {printable(outcome.text)}')
        return interruption.exit_code
    if args.json:
        print_json({'drive': label, 'ok': outcome.ok, 'code': outcome.text.code,
                    'message': outcome.text})
    elif outcome.ok:
        say(f'{label}: {outcome.text}')
    else:
        complain(f'{label}: {printable(outcome.text)}')
    return 0 if outcome.ok else FAILED


@contextmanager
def _kept_running() -> Iterator[Interruption]:
    """Record what ends the process; refuse what would suspend it."""
    with (handled((signal.SIGTSTP,), lambda *_: complain(NOT_SUSPENDED)),
          postponed(lambda: complain('drive_can jog: back to neutral')) as interruption):
        yield interruption
