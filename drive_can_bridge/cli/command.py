# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What all subcommands have in common: exit codes, wrong usage, lines for people and programs.

A subcommand is a module of its name with ``define(parser)`` and ``run(args) -> exit code``.
Whatever it raises, :mod:`.main` prints in one line.
"""

import argparse
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
import math
import os
from pathlib import Path
import re
import sys
import termios
from typing import NoReturn, TYPE_CHECKING, TypeVar

from drive_can_bridge.cli.saying import (
    FAILED as FAILED, print_json as print_json, say as say)
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.errors import DriveCanError, ValueRefused
from drive_can_bridge.core.text import is_ros_name, printable
from drive_can_bridge.resources import what_is_missing

if TYPE_CHECKING:
    from drive_can_bridge.core.configuration import BridgeConfiguration

WRONG_USAGE = 2
#: characters of a line of complaint: some name all that there is
LINE_MAX = 4000
#: environment variable in place of ``--params-file`` for commands that need a file
PARAMS_FILE = 'DRIVE_CAN_PARAMS_FILE'
Parsed = TypeVar('Parsed')
#: what an argument that begins with the name of a drive looks like
_EXAMPLES = {'--fault': 'DRIVE:FAULT, for example conveyor:late=0.15',
             '--axis': 'DRIVE:KEY=VALUE, for example lift:load=0.3',
             '--habit': 'DRIVE:KEY=VALUE, for example servo:start=0.3',
             '--without': 'DRIVE=OBJECT, for example servo=6007h,1800h.05h'}


class WrongUsage(DriveCanError):
    """The command line cannot be used, nothing was sent or written: exit code 2."""


@contextmanager
def imports_of(command: str) -> Iterator[None]:
    """
    Import what a command needs, ROS above all.

    :raises DriveCanError: it is missing; with what to install.
    """
    try:
        yield
    except ImportError as error:
        raise DriveCanError(what_is_missing(command, error)) from error


class Parser(argparse.ArgumentParser):
    """Reports the errors of a command line in one line, like all others."""

    def error(self, message: str) -> NoReturn:
        """
        Print an error and end the process.

        :raises SystemExit: always.
        """
        complain(printable(f'{self.prog}: {message}; see {self.prog} --help', None))
        raise SystemExit(WRONG_USAGE)


def complain(text: str) -> None:
    """Write to standard error, a line or more."""
    print('\n'.join(printable(line, LINE_MAX) for line in text.split('\n')), file=sys.stderr,
          flush=True)


def must_be_answerable(*, yes: bool, otherwise: str, yes_means: str) -> None:
    """
    Check, before anything is sent, that a question can be answered later.

    :param otherwise: what was not done.
    :param yes_means: what ``--yes`` does.
    :raises WrongUsage: it cannot.
    """
    if not (yes or sys.stdin.isatty()):
        raise WrongUsage(command_sentences.nobody_can_be_asked(
            otherwise=otherwise, yes_means=yes_means))


def agreed(question: str, *, yes: bool, otherwise: str, yes_means: str) -> bool:
    """
    Ask a question; return whether the answer is yes.

    :raises WrongUsage: there is no terminal to ask.
    """
    must_be_answerable(yes=yes, otherwise=f'{question} {otherwise}', yes_means=yes_means)
    if yes or answered(question):
        return True
    complain(f'{otherwise}.')
    return False


def agree_to_hazard(hazard: str, question: str, *, yes: bool, who: str) -> None:
    """
    Print what may happen, and have it confirmed.

    :param who: what needs ``--yes`` without a terminal.
    :raises WrongUsage: there is no terminal to ask, or the answer is no.
    """
    complain(hazard)
    if yes:
        return
    if not sys.stdin.isatty():
        raise WrongUsage(command_sentences.needs_yes(who=who))
    if not answered(question):
        raise WrongUsage(command_sentences.nothing_was_sent())


def answered(question: str) -> bool:
    """Return whether the answer to a question is yes; what was typed before it does not count."""
    if sys.stdin.isatty():
        with suppress(OSError, termios.error):
            termios.tcflush(sys.stdin.fileno(), termios.TCIFLUSH)
    print(printable(f'{question} [y/N] ', None), end='', file=sys.stderr, flush=True)
    return sys.stdin.readline().strip().lower() in ('y', 'yes')


def above_zero(text: str) -> float:
    """Read a finite number above 0."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0):
        raise ArgumentTypeError(command_sentences.number_above_zero(text=text))
    return value


def bitrate(text: str) -> int:
    """Read a bit rate, ``125000`` or ``500k`` or ``1M``."""
    found = re.fullmatch(r'([0-9]+(?:\.[0-9]+)?)([kKmM]?)(?:bit/s)?', text.strip())
    value = float(found[1]) * {'': 1.0, 'k': 1e3, 'm': 1e6}[found[2].lower()] if found else 0.0
    if not 1000 <= value <= 8e6:
        raise ArgumentTypeError(command_sentences.bitrate_wanted(text=text))
    return round(value)


def whole(low: int, high: int) -> Callable[[str], int]:
    """Return a function that reads an integer within limits."""
    def read(text: str) -> int:
        if not (text.isdecimal() and low <= int(text) <= high):
            raise ArgumentTypeError(command_sentences.number_between(
                text=text, low=low, high=high))
        return int(text)
    return read


def output(text: str) -> str:
    """Read the name of a file, or directory, to be written; some commands need its last slash."""
    if text in ('', '-'):
        raise ArgumentTypeError(command_sentences.names_no_file(text=repr(text)))
    if text == '/dev/stdout':   # descriptor 1 is not ours where libraries write to it
        return f'/dev/fd/{sys.stdout.fileno()}'
    return text


def output_path(text: str) -> Path:
    """Read the same as a path."""
    return Path(output(text))


def namespace(text: str) -> str:
    """Read ``/cell1``, or ``cell1``; '' for the root."""
    name = f'/{text.strip("/")}'
    if name != '/' and not is_ros_name(name):
        raise ArgumentTypeError(command_sentences.no_namespace(text=repr(text)))
    return name if name != '/' else ''


def add_params_file(parser: ArgumentParser, help_text: str) -> None:
    """Add the option for the parameter file; the environment variable is its default."""
    default = os.environ.get(PARAMS_FILE)
    parser.add_argument('-p', '--params-file', metavar='FILE', type=Path, required=not default,
                        default=Path(default) if default else None,
                        help=f'{help_text} (default: ${PARAMS_FILE})')


def add_drive_words(parser: ArgumentParser, completer: Callable[..., list[str]], metavar: str,
                    nargs: str, help_text: str, *, namespace_help: str, yes: str) -> None:
    """
    Add positional arguments that name drives, and the options that all such commands have.

    :param completer: proposes words to the shell.
    :param metavar: how the words are written, as usage lines have it.
    :param yes: what ``--yes`` means.
    """
    parser.allow_abbrev = False
    parser.usage = f'%(prog)s [option …] {metavar}'     # argparse would repeat all of them
    words = parser.add_argument('words', metavar=metavar, nargs=nargs, help=help_text)
    words.completer = completer     # type: ignore[attr-defined]  # for argcomplete
    parser.add_argument('--namespace', metavar='NS', type=namespace, help=namespace_help)
    parser.add_argument('--yes', action='store_true', help=yes)
    parser.add_argument('--json', action='store_true', help='a JSON document a line')


def add_words_for_a_bridge(parser: ArgumentParser, metavar: str, nargs: str, help_text: str, *,
                           namespace_help: str, yes: str) -> None:
    """
    Add words and options of a subcommand that goes through a running bridge, and no other way.

    Options may stand between the words; :func:`only_through_a_bridge` refuses what it must.

    :param metavar: how the words are written, as usage lines have it.
    :param yes: what ``--yes`` means.
    """
    add_drive_words(parser, _complete_drives, metavar, nargs, help_text,
                    namespace_help=namespace_help, yes=yes)
    parser.add_argument('-p', '--params-file', metavar='FILE',
                        help='refused: goes through the running bridge only')


def _complete_drives(prefix: str, parsed_args: Namespace, **more: object) -> list[str]:
    from drive_can_bridge.cli.drives import complete_drives     # a stop has no time for that
    return complete_drives(prefix, parsed_args, **more)


def only_through_a_bridge(args: Namespace) -> None:
    """
    Refuse a parameter file.

    :raises WrongUsage: there is one.
    """
    if args.params_file is not None:
        raise WrongUsage(command_sentences.through_bridge_only())


def add_seconds(parser: ArgumentParser) -> None:
    """Add the option that ends listening."""
    parser.add_argument('--seconds', metavar='S', type=above_zero, default=math.inf,
                        help='end by itself after that time (default: runs until Ctrl-C)')


def of_drive(option: str, text: str, configuration: 'BridgeConfiguration',
             parse: Callable[[str], Parsed], sign: str = ':') -> tuple[str, Parsed]:
    """
    Read an argument that begins with the name of a drive.

    :param option: ``--fault``, ``--axis`` …
    :param parse: reads the text behind the sign; may raise ValueRefused.
    :raises WrongUsage: it is invalid; with what is allowed.
    """
    name, found, rest = text.partition(sign)
    if not found:
        raise WrongUsage(command_sentences.option_written_so(
            option=option, text=text, example=_EXAMPLES[option]))
    if name not in configuration.drives:
        raise WrongUsage(command_sentences.option_names_no_drive(
            option=option, text=text, name=name, drives=', '.join(configuration.drives) or 'none'))
    try:
        return name, parse(rest)
    except ValueRefused as error:
        raise WrongUsage(f'{option} {text}: {error}') from None
