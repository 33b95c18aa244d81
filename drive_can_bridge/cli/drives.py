# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What the commands that talk to drives have in common: their options, and which drives are meant.

Positional arguments of such a command are called ``words``; options may stand between them.
"""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, nullcontext, suppress
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from drive_can_bridge.cli.command import add_drive_words, complain, namespace, WrongUsage
from drive_can_bridge.cli.output import counting, waiting
from drive_can_bridge.client import find_source
from drive_can_bridge.client.drive import Drive, Drives, DriveSource, ReadOutcome
from drive_can_bridge.clock import Clock
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.errors import DriveCanError, WhichBridge
from drive_can_bridge.core.text import nearest
from drive_can_bridge.resources import what_is_missing


def add_words(parser: ArgumentParser, completer: Callable[..., list[str]], metavar: str,
              nargs: str, help_text: str) -> None:
    """
    Add the positional arguments, and the options for the way to the drives.

    :param completer: proposes words to the shell.
    :param metavar: how the words are written, as usage lines have it.
    """
    parser.add_argument('-p', '--params-file', metavar='FILE', type=Path,
                        help='open the buses of this parameter file; else the drives of a running '
                             'bridge are asked through it')
    parser.add_argument('--nmt-start', action='store_true',
                        help='with --params-file: start CANopen nodes first, because others '
                             'answer no PKW')
    add_drive_words(parser, completer, metavar, nargs, help_text,
                    namespace_help='of the running bridge, where there are several',
                    yes='answer every question with yes')


@contextmanager
def source_of(args: Namespace) -> Iterator[DriveSource]:
    """
    Return the source of the drives that the options select.

    :raises WrongUsage: options that exclude each other, or several bridges.
    :raises DriveCanError: the file is wrong, no bridge, no ROS.
    """
    if args.params_file is not None and args.namespace is not None:
        raise WrongUsage(command_sentences.namespace_with_file())
    if args.params_file is None and args.nmt_start:
        raise WrongUsage(command_sentences.nmt_start_with_bridge())
    try:
        source = find_source(
            args.params_file, namespace=args.namespace, nmt_start=args.nmt_start,
            clock=args.clock, slow=lambda: waiting(
                'looking for a bridge' if args.params_file is None else 'reading the file'))
    except WhichBridge as error:
        raise WrongUsage(str(error)) from None
    except ImportError as error:
        command = f'drive_can {args.subcommand}'
        text = what_is_missing(command, error)
        if args.params_file is None:
            text += ', or name a parameter file with --params-file to go without ROS'
        raise DriveCanError(text) from error
    try:
        yield source
    finally:
        source.close()


def by_short_names(args: Namespace, words: Sequence[str]) -> list[str]:
    """
    Return words with drives by their short names: a full one gives the namespace, too.

    :raises WrongUsage: they are in several namespaces.
    """
    found = []
    for word in words:
        place, slash, name = word.rpartition('/')
        if slash and args.params_file is None:  # where a file's drives will run is unknown
            with suppress(ArgumentTypeError):   # else it is none, which is reported
                where = namespace(place)
                if args.namespace not in (None, where):
                    raise WrongUsage(command_sentences.other_namespace(
                        word=word, namespace=args.namespace or '/'))
                args.namespace, word = where, name
        found.append(word)
    return found


def matching(names: Sequence[str], word: str) -> list[str]:
    """Return the drives that a name or shell pattern matches, in their order; maybe none."""
    return [name for name in names if fnmatchcase(name, word)]


def _near(word: str, names: Sequence[str]) -> str:
    meant = nearest(word, names)
    return f' (did you mean {meant!r}?)' if meant else ''


def split_words(names: Sequence[str], words: Sequence[str]) -> tuple[list[str], list[str]]:
    """
    Separate the drive from the rest of the words: the first one, if it matches a drive.

    :raises WrongUsage: there are several drives, and no word names one.
    """
    if words and matching(names, words[0]):
        return matching(names, words[0]), list(words[1:])
    if len(names) != 1:
        said = f'{words[0]!r} is none{_near(words[0], names)}. ' if words else ''
        raise WrongUsage(command_sentences.which_drive(
            said=said, there=', '.join(names) or 'none'))
    return list(names), list(words)


def chosen(names: Sequence[str], words: Sequence[str]) -> list[str]:
    """
    Return the drives that words or shell patterns name, in the order of the configuration.

    :raises WrongUsage: one of them names none; or there are several, and no word.
    """
    there = f'there are: {", ".join(names) or "none"}'
    if not words:
        if len(names) != 1:
            raise WrongUsage(command_sentences.which_drives(there=there))
        return list(names)
    for word in words:
        if not matching(names, word):
            raise WrongUsage(command_sentences.no_drive_of_word(word=repr(word), there=there))
    return [name for name in names if any(name in matching(names, word) for word in words)]


def chosen_one(names: Sequence[str], word: str) -> str:
    """
    Return the one drive that a word names.

    :raises WrongUsage: it names none, or several.
    """
    found = chosen(names, [word])
    if len(found) > 1:
        raise WrongUsage(command_sentences.names_several(word=repr(word), found=', '.join(found)))
    return found[0]


@contextmanager
def opened(source: DriveSource, names: Sequence[str]) -> Iterator[Drives]:
    """Open drives, and print their warnings."""
    with (waiting('listening for another master, and greeting the drives')
          if source.listens else nullcontext()):
        drives = source.open(names)
    with drives:
        for warning in drives.warnings:
            complain(f'warning: {warning}')
        yield drives


def unread(drive: Drive, outcomes: Iterable[ReadOutcome]) -> list[str]:
    """Return what could not be read: a line each, or one where nothing could be for one reason."""
    found = list(outcomes)
    wrong = [outcome for outcome in found if not outcome.ok]
    if 1 < len(wrong) == len(found) and len({outcome.reason for outcome in wrong}) == 1:
        return [command_sentences.nothing_read_from(drive=drive.name, reason=wrong[0].reason)]
    return [command_sentences.not_read(drive=drive.name, name=outcome.name, reason=outcome.reason)
            for outcome in wrong]


def read_all(drive: Drive, names: Sequence[str], clock: Clock) -> dict[str, ReadOutcome]:
    """Read parameters of a drive, none if there are no names; show how far it is."""
    with counting(f'reading {drive.name}', len(names), clock.now) as step:
        return drive.read(*names, told=step) if names else {}


def complete_words(prefix: str, parsed_args: Namespace, **_: Any) -> list[str]:
    """Return the drives for the first word, and the names of their parameters after it."""
    words = [word for word in parsed_args.words or () if word != prefix]
    place, slash, own = (words[0] if words else prefix).rpartition('/')

    def proposed(source: DriveSource) -> list[str]:
        names = list(source.names)
        drives = matching(names, own) if words else []
        end = '=' if parsed_args.subcommand == 'write' else ''
        return ([] if words else [f'{place}{slash}{name}' for name in names]) + [
            f'{name}{end}' for drive in drives or (names if len(names) == 1 else [])
            for name in source.parameter_names(drive)]
    return _completed(parsed_args, place if slash else None, proposed)


def complete_drives(prefix: str, parsed_args: Namespace, **_: Any) -> list[str]:
    """Return drives; where none begins so, the shell proposes files."""
    place, slash, _own = prefix.rpartition('/')
    return _completed(parsed_args, place if slash else None, lambda source: [
        f'{place}{slash}{name}' for name in source.names])


def _completed(args: Namespace, place: str | None,
               proposed: Callable[[DriveSource], Iterable[str]]) -> list[str]:
    """
    Return a source's completions.

    :param place: the namespace in a full name that is typed.
    """
    try:
        where = getattr(args, 'namespace', None) if place is None else namespace(place)
        with closing(find_source(getattr(args, 'params_file', None),
                                 namespace=where)) as source:
            return list(proposed(source))
    except Exception:  # noqa: BLE001  nothing may be written into the line that is typed
        return []
