# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can compare``: what differs between backups and drives, settings only."""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
import math
from pathlib import Path
import re

from drive_can_bridge.backup.document import (
    Backup, in_order, is_command, is_setting, mode_bits, modes_of, raw_in_file, read_backup,
    settings_of)
from drive_can_bridge.cli.command import complain, print_json, say, WrongUsage
from drive_can_bridge.cli.drives import (
    add_words, by_short_names, chosen_one, complete_drives, opened, read_all, source_of, unread)
from drive_can_bridge.cli.output import print_table
from drive_can_bridge.client.drive import Drive, Drives, ReadOutcome
from drive_can_bridge.clock import Clock
from drive_can_bridge.configuration.profiles import ProfileStore
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.errors import ConfigurationError, DriveCanError, ValueRefused
from drive_can_bridge.core.parameters import named_value, Parameter, Value
from drive_can_bridge.core.profile import Profile
from drive_can_bridge.core.text import printable

#: of values without a profile that gives their resolution
_RELATIVE_TOLERANCE = 1e-9
SAME, DIFFERENT = 0, 1
#: a drive by its name, or by its full one
_DRIVE = re.compile(r'(?P<place>/?(?:[A-Za-z_][A-Za-z0-9_]*/)*)[a-z][a-z0-9_]*')
_NONE = '-'
#: settings that may all be misspelt
_FEW = 3
#: names of what is left out that are told
_NAMED_MAX = 5


@dataclass(frozen=True, slots=True)
class ComparedSetting:
    """
    A setting on one side of a comparison.

    :param value: in the parameter's unit.
    :param raw: None where the parameter is unknown.
    """

    value: Value
    raw: int | None = None


@dataclass(frozen=True, slots=True)
class Difference:
    """
    A setting that is not the same on both sides.

    :param parameter: None: nobody knows it.
    :param one: its value on the first side; None: there is no such setting.
    :param other: its value on the second side.
    """

    name: str
    parameter: Parameter | None
    one: Value | None
    other: Value | None

    @property
    def unit(self) -> str:
        """The unit of both values; '' where it is unknown."""
        return self.parameter.unit if self.parameter else ''

    def text(self, value: Value | None) -> str:
        """Return the value of one side for people."""
        return _NONE if value is None else named_value(self.parameter, value)


@dataclass(frozen=True, slots=True)
class Side:
    """
    One side of a comparison.

    :param settings: by name, in order.
    :param parameters: what is known of them.
    :param left_out: names in a file that are no settings.
    """

    settings: Mapping[str, ComparedSetting]
    parameters: Mapping[str, Parameter]
    left_out: tuple[str, ...] = ()


def side_of_drive(drive: Drive, outcomes: Mapping[str, ReadOutcome]) -> Side:
    """Return the settings of a drive that were read, and a mode that it was left in."""
    bits = mode_bits(drive.facts.restore)
    found = {name: outcome for name, outcome in outcomes.items() if outcome.ok and (
        is_setting(drive, name) or not bits[name].is_over(outcome.raw or 0))}
    return Side({name: ComparedSetting(outcome.value, outcome.raw)
                 for name, outcome in found.items() if outcome.value is not None},
                {name: outcome.parameter for name, outcome in found.items()
                 if outcome.parameter is not None})


def side_of_file(backup: Backup, *, find: Callable[[str], Parameter | None],
                 counts: Callable[[str], bool]) -> Side:
    """
    Return the settings of a file.

    :param find: returns a parameter, if it is known.
    :param counts: returns whether a known parameter is a setting.
    :raises ConfigurationError: a value of the wrong type.
    """
    settings: dict[str, ComparedSetting] = {}
    parameters: dict[str, Parameter] = {}
    left_out, problems = [], []
    for name, value in backup.values.items():
        parameter = find(name)
        if parameter is None:
            settings[name] = ComparedSetting(value)     # type: ignore[arg-type]  # the reader saw to it
        elif not counts(name):
            left_out.append(name)
        else:
            try:
                settings[name] = ComparedSetting(value, raw_in_file(    # type: ignore[arg-type]
                    parameter, value))
                parameters[name] = parameter
            except ValueRefused as error:
                problems.append(backup.problem(name, str(error)))
    if problems:
        raise ConfigurationError(problems)
    return Side(settings, parameters, tuple(left_out))


def names_to_read(drive: Drive, *others: Backup) -> tuple[str, ...]:
    """Return what to read of a drive: settings, its mode, and other names in a file."""
    names = [*settings_of(drive), *modes_of(drive)]
    names += [name for backup in others for name in backup.values
              if name not in names and is_setting(drive, name)]
    return in_order(drive, list(dict.fromkeys(names)))


def differences(first: Side, second: Side) -> list[Difference]:
    """Return the settings that are not the same on both sides."""
    names = dict.fromkeys([*first.settings, *second.settings])
    found = []
    for name in names:
        one, other = first.settings.get(name), second.settings.get(name)
        parameter = first.parameters.get(name) or second.parameters.get(name)
        if one is None or other is None or not _same(one, other, parameter):
            found.append(Difference(name, parameter, one.value if one else None,
                                    other.value if other else None))
    return found


def _same(one: ComparedSetting, other: ComparedSetting, parameter: Parameter | None) -> bool:
    if one.raw is None or other.raw is None or parameter is None:
        # a whole number stands for a double, as it does in every file
        return isinstance(one.value, bool) is isinstance(other.value, bool) and math.isclose(
            one.value, other.value, rel_tol=_RELATIVE_TOLERANCE)
    return one.raw == other.raw


def define(parser: ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'Compare the settings of A and B, each of them a backup file or a drive: what '
        'looks like the name of a drive, or like a full one (/cell/lift) that is no file, is one; '
        './NAME is a file. Sends reads only.')
    parser.epilog = (
        'Exit code 0: the same. 1: different. 2: trouble, a drive in use included. '
        '--json, for each setting that differs: parameter, unit, a, b (null: not there).')
    add_words(parser, complete_drives, 'A B', '+', 'backup files or drives')


def run(args: Namespace) -> int:
    """
    Compare two sides, and print the differences.

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
        say(command_sentences.nothing_in_common(
                words=' and '.join(args.words), one=counts[0], other=counts[1])
            + (', or all names of one are misspelt' if few else ''))
    if few or not alien:
        _show(args, found)
    return DIFFERENT if found else SAME


def _sides_of(args: Namespace) -> list[Side]:
    words = args.words
    if len(words) != 2:
        raise WrongUsage(command_sentences.two_wanted(words=' '.join(words)))
    for place, word in enumerate(words):
        if _is_drive(args, word):
            words[place:place + 1] = by_short_names(args, [word])
    files = {word: read_backup(Path(word)) for word in words if not _DRIVE.fullmatch(word)
             or '/' in word}
    wanted = [word for word in words if word not in files]
    if not wanted:
        file, profile = next(((word, found) for word in words
                              if (found := _profile_of(files[word])) is not None), ('', None))
        made_with = {head.profile_sha256: printable(head.profile)
                     for head in (files[word].head for word in words)}
        if len(made_with) > 1 and all(made_with):
            complain(command_sentences.backups_of_two_profiles(
                *words, ' and '.join(dict.fromkeys(made_with.values())), file))
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
            complain(command_sentences.no_settings_left_out(
                word=word, count=len(side.left_out), names=names, more=more))
    return sides


def _is_drive(args: Namespace, word: str) -> bool:
    found = _DRIVE.fullmatch(word)
    if found is None or not found['place']:
        return found is not None
    return args.params_file is None and not Path(word).exists()


def _sides(words: Sequence[str], files: dict[str, Backup], drives: Drives,
           clock: Clock) -> list[Side]:
    found = []
    for word in words:
        if word in files:
            # there are two sides, so the other one is a drive
            drive = drives[next(other for other in words if other not in files)]
            found.append(side_of_file(files[word], find=drive.find,
                                      counts=partial(is_setting, drive)))
            _tell_profile(files[word], drive)
        else:
            found.append(_drive(drives[word], list(files.values()), clock))
    return found


def _drive(drive: Drive, files: Sequence[Backup], clock: Clock) -> Side:
    """
    Read a drive; what it does not have is missing on its side.

    :raises DriveCanError: something cannot be read, so it may differ.
    """
    names = names_to_read(drive, *files)
    outcomes = read_all(drive, names, clock)
    problems = unread(drive, [each for each in outcomes.values() if not each.absent])
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
        counts=lambda name: parameters[name].readable and parameters[name].writable
        and not is_command(backup.head.protocol, parameters[name]))


def _tell_profile(backup: Backup, drive: Drive) -> None:
    head = backup.head
    if head.profile_sha256 and head.profile_sha256 != drive.facts.profile_sha256:
        complain(command_sentences.backup_of_other_profile(
            file=backup.file, profile=printable(head.profile), drive=drive.name,
            its=drive.facts.profile))


def _show(args: Namespace, found: Sequence[Difference]) -> None:
    if args.json:
        print_json(*({'parameter': each.name, 'unit': each.unit, 'a': each.one, 'b': each.other}
                     for each in found))
    elif found:
        first, second = args.words
        print_table(('parameter', first, second, 'unit'), [
            (each.name, each.text(each.one), each.text(each.other), each.unit)
            for each in found], numbers=(first, second))
    else:
        print('the same')

