# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can backup``: the settings of drives as files."""

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from datetime import datetime, timezone
import os
from pathlib import Path
from typing import Any

from drive_can_bridge.backup.document import head_of, settings_of, written
from drive_can_bridge.cli.command import complain, FAILED, output, print_json, say, WrongUsage
from drive_can_bridge.cli.drives import (
    add_words, by_short_names, chosen, complete_drives, opened, read_all, source_of, unread)
from drive_can_bridge.cli.output import may_overwrite, write_atomically
from drive_can_bridge.client.drive import Drive
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.codes import code_of
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.text import counted, printable

SUFFIX = '.yaml'
#: names of what a drive does not have that are shown
NAMED_MAX = 5


def define(parser: ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'Write the settings of a drive to a file that drive_can restore and ros2 '
        'param load take: everything that can be restored, nothing else. Sends reads '
        'only.')
    parser.epilog = (
        'Exit code 0: written. 1: something could not be read or written, and there is no '
        'file. 2: wrong usage, or a file exists and nobody can be asked. --json, for each '
        'drive: drive, file, settings (how many), identity, left_out (parameter, reason).')
    parser.add_argument('-o', '--output', metavar='FILE', type=output, required=True,
                        help='where it goes; for several drives DIR/, a file each')
    parser.add_argument('--partial', action='store_true',
                        help='write the file although parameters could not be read; it lists them '
                             'in a comment')
    add_words(parser, complete_drives, '[DRIVE …] -o FILE', '*',
              'a drive, by its name or its full name in the ROS graph (/cell/lift), or a shell '
              'pattern; may be left out where there is only one')


def run(args: Namespace) -> int:
    """
    Write the backups.

    :return: exit code.
    :raises WrongUsage: which drives, where to, or a question cannot be answered.
    :raises DriveCanError: the drives cannot be reached.
    :raises OSError: a file cannot be written.
    """
    words = by_short_names(args, args.words)
    with source_of(args) as source:
        names = chosen(source.names, words)
        files = _files(args.output, names)
        if not may_overwrite(files.values(), yes=args.yes,
                             otherwise='Nothing was read or written'):
            return FAILED
        with opened(source, names) as drives:
            made = {name: _made(args, drives[name], files[name]) for name in names}
    for name, backup in made.items():
        if backup is not None:
            text, document = backup
            files[name].parent.mkdir(exist_ok=True)
            write_atomically(files[name], text.encode('utf-8'))
            if args.json:
                print_json(document)
            else:
                settings = counted(document['settings'], 'setting')
                say(f'{name}: {settings} in {files[name]}')
    return FAILED if None in made.values() else 0


def _files(wanted: str, names: Sequence[str]) -> dict[str, Path]:
    """
    Return the backup file of each drive.

    :raises WrongUsage: one file for several drives.
    :raises OSError: nothing can be written there.
    """
    path = Path(wanted)
    if wanted.endswith('/') or path.is_dir():
        folder, files = path, {name: path / f'{name}{SUFFIX}' for name in names}
        above = folder.parent if not folder.exists() else folder
    elif len(names) > 1:
        raise WrongUsage(command_sentences.one_file_for_several(
            count=len(names), names=', '.join(names), wanted=wanted))
    else:
        above, files = path.parent, {names[0]: path}
    if not above.is_dir():
        raise DriveCanError(command_sentences.no_directory_above(above=above))
    if not os.access(above, os.W_OK):
        raise DriveCanError(command_sentences.not_writable(above=above))
    return files


def _made(args: Namespace, drive: Drive, file: Path) -> tuple[str, dict[str, Any]] | None:
    """
    Read a drive; None: no file is to be written, and the reason was printed.

    :return: the text of its file, and the document for programs.
    """
    names = settings_of(drive)
    outcomes = read_all(drive, names, args.clock)
    settings: list[tuple[Parameter, int]] = []
    missing: list[tuple[str, str]] = []
    absent: list[str] = []
    useless: list[tuple[str, str]] = []
    for name, outcome in outcomes.items():
        parameter, raw = outcome.parameter, outcome.raw
        if outcome.absent:
            absent.append(name)
            continue
        if parameter is None or raw is None:
            missing.append((name, outcome.reason))
            continue
        low, high = parameter.raw_limits
        if low <= raw <= high:
            settings.append((parameter, raw))
        else:   # it could not be written back
            useless.append((name, command_sentences.beyond_profile(
                value=outcome.value, allowed=parameter.range_text)))
    for name, reason in useless:
        complain(command_sentences.setting_left_out(drive=drive.name, name=name, reason=reason))
    for line in unread(drive, [each for each in outcomes.values() if not each.absent]):
        complain(line)
    if absent:
        named = ', '.join(absent[:NAMED_MAX]) + ', …' * (len(absent) > NAMED_MAX)
        in_profile = counted(len(names), 'setting')
        have_not = (command_sentences.drive_has_not_all(
            drive=drive.name, absent=len(absent), settings=in_profile,
            profile=printable(drive.facts.profile), named=named))
        if 2 * len(absent) > len(names):
            complain(command_sentences.other_profile(have_not=have_not))
            return None
        complain(f'{have_not}: left out')
    if missing and not args.partial:
        advice = ('' if not settings else '; --partial writes one without '
                  f'{"it" if len(missing) == 1 else "them"}')
        complain(command_sentences.no_file_written(drive=drive.name, advice=advice))
        return None
    if not settings:
        complain(command_sentences.no_settings(drive=drive.name))
        return None
    left_out = [*missing, *useless]
    made_at = datetime.fromtimestamp(1e-9 * args.clock.stamp(), timezone.utc)
    head = head_of(drive.facts, time=made_at.strftime('%Y-%m-%dT%H:%M:%SZ'),
                   identity=drive.identity())
    return written(drive.facts, head, settings, remarks=[
        *(f'left out: {name}: {reason}' for name, reason in left_out),
        *([f'left out, the drive does not have them: {", ".join(absent)}'] if absent else ())]), {
            'drive': drive.name, 'file': str(file), 'settings': len(settings),
            'identity': head.identity,
            'left_out': [{'parameter': name, 'reason': reason, 'code': code_of(reason)}
                         for name, reason in (
                *left_out, *((name, outcomes[name].reason) for name in absent))]}
