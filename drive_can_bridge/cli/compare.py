# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can compare``: what differs between backups and drives."""

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path
import re

from drive_can_bridge.backup.comparison import (
    Difference, differences, names_to_read, Setting, Side, side_of_drive, side_of_file,
    side_of_file_and_drive,
)
from drive_can_bridge.backup.document import Backup, read_backup
from drive_can_bridge.cli.command import complain, say, WrongUsage
from drive_can_bridge.cli.drives import (
    add_words, chosen_one, complete_drives, opened, read_all, source_of, unread,
)
from drive_can_bridge.cli.output import print_json, print_table
from drive_can_bridge.client.drive import Drive, Drives
from drive_can_bridge.clock import Clock
from drive_can_bridge.configuration.profiles import ProfileStore
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.profile import Profile
from drive_can_bridge.core.text import printable
from drive_can_bridge.core.words import value_text

SAME, DIFFERENT = 0, 1
_DRIVE = re.compile(r'[a-z][a-z0-9_]*')
_NONE = '-'
#: settings that may all be misspelt
_FEW = 3
#: names of what is left out that are told
_NAMED_MAX = 5


def define(parser: ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'Compare the settings of A and B, each of them a backup file or a drive: what '
        'looks like the name of a drive is one, ./NAME is a file. Sends reads only.')
    parser.epilog = (
        'Exit code 0: the same. 1: different. 2: trouble, a drive in use included. '
        '--json, for each setting that differs: parameter, unit, a, b (null: not there).')
    add_words(parser, complete_drives, 'A B', '+', 'backup files or drives')


def run(args: Namespace) -> int:
    """
    Compare.

    :return: 0 the same, 1 different.
    :raises WrongUsage: not two of them, or it is not clear which drives.
    :raises DriveCanError: a file is wrong, or a drive cannot be reached or read.
    :raises OSError: a file cannot be read.
    """
    first, second = _sides_of(args)
    found = differences(first, second)
    counts = [len(side.settings) for side in (first, second)]
    alien = min(counts) > 0 and not (
        first.settings.keys() & second.settings.keys() or args.json)
    few = min(counts) <= _FEW
    if alien:
        say(f'{" and ".join(args.words)} have no setting in common ({counts[0]} and {counts[1]}): '
            'they are of different drive types'
            + (', or all names of one are misspelt' if few else ''))
    if few or not alien:
        _show(args, found)
    return DIFFERENT if found else SAME


def _sides_of(args: Namespace) -> list[Side]:
    words = args.words
    if len(words) != 2:
        raise WrongUsage(f'{" ".join(words)}: allowed are two, A and B')
    files = {word: read_backup(Path(word)) for word in words if not _DRIVE.fullmatch(word)}
    wanted = [word for word in words if word not in files]
    if not wanted:
        profile = next(filter(None, map(_profile_of, files.values())), None)
        sides = [_file_alone(files[word], profile) for word in words]
    else:
        with source_of(args) as source:
            for word in wanted:
                chosen_one(source.names, word)
            with opened(source, list(dict.fromkeys(wanted))) as drives:
                sides = _sides(words, files, drives, args.clock)
    for word, side in zip(words, sides, strict=True):
        if side.left_out:
            names = ', '.join(side.left_out[:_NAMED_MAX])
            more = ', …' if len(side.left_out) > _NAMED_MAX else ''
            complain(f'{word}: left out, because no settings: {len(side.left_out)} '
                     f'values ({names}{more})')
    return sides


def _sides(words: Sequence[str], files: dict[str, Backup], drives: Drives,
           clock: Clock) -> list[Side]:
    found = []
    for word in words:
        if word in files:
            # there are two sides, so the other one is a drive
            drive = drives[next(other for other in words if other not in files)]
            found.append(side_of_file_and_drive(files[word], drive))
            _tell_profile(files[word], drive)
        else:
            found.append(_drive(drives[word], list(files.values()), clock))
    return found


def _drive(drive: Drive, files: Sequence[Backup], clock: Clock) -> Side:
    """
    Read a drive.

    :raises DriveCanError: something cannot be read: nobody knows whether it differs.
    """
    names = names_to_read(drive, *files)
    outcomes = read_all(drive, names, clock)
    problems = unread(drive, outcomes.values())
    if problems:
        raise DriveCanError('\n'.join(problems))
    return side_of_drive(drive, outcomes)


def _profile_of(backup: Backup) -> Profile | None:
    """Return the profile that a file names, if it is here."""
    head = backup.head
    loaded = ProfileStore([]).load(head.profile) if head.profile else ''
    if isinstance(loaded, str) or loaded.profile.sha256 != head.profile_sha256:
        return None
    return loaded.profile


def _file_alone(backup: Backup, profile: Profile | None) -> Side:
    if profile is None:
        return side_of_file(backup, find=lambda name: None, counts=lambda name: True)
    parameters = profile.parameters
    return side_of_file(
        backup, find=parameters.get,
        counts=lambda name: parameters[name].readable and parameters[name].writable)


def _tell_profile(backup: Backup, drive: Drive) -> None:
    head = backup.head
    if head.profile_sha256 and head.profile_sha256 != drive.facts.profile_sha256:
        complain(f'warning: {backup.file} was made with another profile '
                 f'({printable(head.profile)}) than the one of {drive.name} '
                 f'({drive.facts.profile})')


def _show(args: Namespace, found: Sequence[Difference]) -> None:
    if args.json:
        for each in found:
            print_json({'parameter': each.name, 'unit': each.unit,
                        'a': each.first and each.first.value,
                        'b': each.second and each.second.value})
    elif found:
        first, second = args.words
        print_table(('parameter', first, second, 'unit'), [
            (each.name, _text(each.first), _text(each.second), each.unit) for each in found],
            numbers=(first, second))
    else:
        print('the same')


def _text(setting: Setting | None) -> str:
    return _NONE if setting is None else value_text(setting.value)
