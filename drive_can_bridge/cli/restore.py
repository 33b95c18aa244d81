# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can restore``: the settings of a backup back into a drive."""

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path

from drive_can_bridge.backup.document import Backup, is_setting, read_backup
from drive_can_bridge.backup.restore import (
    LeftAlone, names_to_read, NotAsInFile, other_type, plan_restore, problems_in, RestorePlan,
    Restorer, RestoreResult, says_nothing, StepKind, strangers, why_left_alone)
from drive_can_bridge.cli.command import (
    agreed, complain, FAILED, must_be_answerable, print_json, say, WrongUsage)
from drive_can_bridge.cli.drives import (
    add_words, by_short_names, chosen_one, complete_drives, opened, read_all, source_of, unread)
from drive_can_bridge.cli.output import counting, print_table
from drive_can_bridge.client.drive import Drive, DriveSource, Enabled, NOT_CONFIRMED
from drive_can_bridge.clock import Clock
from drive_can_bridge.core import command_sentences, sentences
from drive_can_bridge.core.codes import code_of
from drive_can_bridge.core.messages import around
from drive_can_bridge.core.parameters import named_value, Parameter, Storage, Value
from drive_can_bridge.core.text import counted, printable
from drive_can_bridge.process.critical_sections import Interruption, postponed

#: s that a drive's identity is waited for
_PATIENCE = 2.0
_NOTHING = 'Nothing was written'
_WHY_VOLATILE = {True: 'its profile says: storage: ram',
                 False: 'persist_writes: true in its configuration would write to EEPROM'}
_NONE = '-'
_HEADINGS = ('parameter', 'drive', 'file', 'unit', '')


def define(parser: ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'Read the drive, show what would change, ask, write only what differs, read '
        'everything back. Repeating it is safe.')
    parser.epilog = (
        'Exit code 0: the drive is as in the file. 1: it is not, or nothing may be '
        'written. 2: wrong usage, or nobody can be asked. 130: interrupted; what was '
        'written is said. --json, for each setting that differs: drive, parameter, unit, '
        'found, wanted, left_alone (why, or null); and after writing for each that was to '
        'be changed: drive, parameter, ok, found, wanted, reason.')
    parser.add_argument('--dry-run', action='store_true', help='only show what would change')
    parser.add_argument('--include-protected', action='store_true',
                        help='also what the profile protects: station, bit rate, what cuts off '
                             'the bus')
    parser.add_argument('--force', action='store_true',
                        help='although profile or identity are not those of the file')
    add_words(parser, complete_drives, 'FILE [DRIVE]', '+', (
        'what drive_can backup has written, and where to (default: the drive that the file is '
        'of), by its name or its full name in the ROS graph (/cell/lift)'))


def run(args: Namespace) -> int:
    """
    Restore a backup.

    :return: exit code.
    :raises WrongUsage: it is not clear which drive is meant, or a question cannot be answered.
    :raises DriveCanError: the file is wrong, or the drive cannot be reached.
    :raises OSError: the file cannot be read.
    """
    if len(args.words) > 2:
        raise WrongUsage(command_sentences.file_and_drive(words=' '.join(args.words)))
    file, word = [*args.words, None][:2]
    backup = read_backup(Path(file))
    if not args.dry_run:
        must_be_answerable(yes=args.yes, otherwise=_NOTHING, yes_means='writes without asking')
    if word is not None:
        word, = by_short_names(args, [word])
    with source_of(args) as source:
        name = _target(backup, word, source)
        with opened(source, [name]) as drives:
            return _restore(args, backup, drives[name])


def _target(backup: Backup, word: str | None, source: DriveSource) -> str:
    """
    Return the drive that is meant.

    :raises WrongUsage: that is not clear.
    """
    if word is not None:
        return chosen_one(source.names, word)
    if backup.drive in source.names:
        return backup.drive
    if not backup.drive and len(source.names) == 1:
        return source.names[0]
    of = (f'is of drive {printable(backup.drive)}, which is not here' if backup.drive
          else 'names no drive')
    raise WrongUsage(command_sentences.say_which_drive(
        file=backup.file, of=of, there=', '.join(source.names) or 'none'))


def _restore(args: Namespace, backup: Backup, drive: Drive) -> int:
    if not _may_be(args, backup, drive):
        return FAILED
    names = names_to_read(backup, drive)
    outcomes = read_all(drive, names, args.clock)
    plan = plan_restore(backup, drive, outcomes, include_protected=args.include_protected)
    if plan.unread:
        complain('\n'.join([*unread(drive, outcomes.values()), f'{_NOTHING}.']))
        return FAILED
    _show(args, backup, drive, plan)
    if args.dry_run or not plan.changes:
        return FAILED if plan.absent and not args.dry_run else 0
    if drive.enabled() is Enabled.UNKNOWN:
        complain(command_sentences.enabled_unknown(drive=drive.name))
    count = counted(len(plan.changes), 'setting')
    if not agreed(f'Write {count} to {drive.name}?', yes=args.yes,
                  otherwise=_NOTHING, yes_means='writes without asking'):
        return FAILED
    if drive.enabled() is Enabled.YES:      # since it was asked
        return _is_enabled(drive)
    with postponed(lambda: complain(command_sentences.ending_after_write(drive=drive.name))) \
            as interrupted:
        with counting(f'writing {drive.name}', len(plan.changes), args.clock.now) as step:
            result = Restorer(drive, plan, stopped=lambda: bool(interrupted),
                              clock=args.clock.now,
                              wait=lambda s: args.clock.wait(args.clock.now() + s),
                              told=step, hint=complain).run()
        # a second signal does not suppress what was written
        try:
            return _report(args, drive, plan, result, interrupted)
        except OSError:     # the terminal whose end it is
            if not interrupted:
                raise
            return interrupted.exit_code


def _may_be(args: Namespace, backup: Backup, drive: Drive) -> bool:
    """Return whether the file may be restored into the drive; print why not."""
    problems = problems_in(backup, drive)
    if problems:
        other = other_type(backup, drive)
        complain(command_sentences.of_other_type(file=backup.file, other=other) if other else
                 '\n'.join(problems))
        return False
    identity = _identity(backup, drive, args.clock)
    if backup.head.identity and not identity:
        # maybe it is silent: then its identity is unknown
        for asked in read_all(drive, names_to_read(backup, drive)[:1],
                              args.clock).values():
            if asked.unheard:
                complain(around(
                    command_sentences.nothing_read_from(drive=drive.name, reason=asked.reason),
                    behind=f'\n{_NOTHING}.'))
                return False
    differing = strangers(backup, drive, identity)
    for text in differing:
        complain(f'{backup.file}: {text}')
    if differing and not (args.force or args.dry_run):
        complain(command_sentences.force_restores(nothing=_NOTHING))
        return False
    if says_nothing(backup.head):
        complain(command_sentences.profile_not_said(file=backup.file, drive=drive.name))
    if drive.facts.restore is None and not args.force:
        complain(
            command_sentences.mode_not_told(drive=drive.name, nothing=_NOTHING.lower()))
        return False
    if drive.enabled() is Enabled.YES and not args.dry_run:
        _is_enabled(drive)
        return False
    return True


def _identity(backup: Backup, drive: Drive, clock: Clock) -> str:
    """Return the identity of a drive; a bridge that has just started is about to read it."""
    end = clock.now() + _PATIENCE
    while True:
        late = clock.now() > end    # before it looks: it may not run for a while
        found = drive.identity()
        if found or late or not (drive.facts.through and backup.head.identity):
            return found
        clock.wait(clock.now() + _PATIENCE / 10.0)


def _is_enabled(drive: Drive) -> int:
    complain(command_sentences.restore_while_enabled(drive=drive.name, nothing=_NOTHING))
    return FAILED


# -- what is printed ------------------------------------------------------------------------------


def _show(args: Namespace, backup: Backup, drive: Drive, plan: RestorePlan) -> None:
    differing = [*plan.changes, *plan.kept]
    if args.json:
        print_json(*({'drive': drive.name, 'parameter': change.name,
                      'unit': change.parameter.unit, 'found': change.found,
                      'wanted': change.wanted,
                      'left_alone': change.left_alone.value if change.left_alone else None}
                     for change in differing), *(
            {'drive': drive.name, 'parameter': each.name, 'unit': _unit(drive, each.name),
             'found': None, 'wanted': each.wanted, 'left_alone': 'absent'}
            for each in plan.absent))
    elif differing or plan.absent:
        print_table(_HEADINGS, [
            (change.name, change.parameter.named(change.found),
             _NONE if change.wanted is None else change.parameter.named(change.wanted),
             change.parameter.unit, change.note)
            for change in differing] + [
            (each.name, _NONE, _named(drive, each.name, each.wanted), _unit(drive, each.name),
             'not there: the drive does not have it')
            for each in plan.absent], numbers=('drive', 'file'))
    for name in backup.values:
        why = why_left_alone(drive, name, include_protected=True)
        if why is not None and not is_setting(drive, name):
            complain(command_sentences.setting_left_alone(
                drive=drive.name, name=name, why=why.text))
    if backup.without_value:
        complain(command_sentences.no_value_in_backup(
            file=backup.file, names=_list(backup.without_value)))
    if not plan.changes and not args.json:
        say(command_sentences.nothing_to_restore(
                drive=drive.name, same=len(plan.same), file=backup.file))


def _report(args: Namespace, drive: Drive, plan: RestorePlan, result: RestoreResult,
            interrupted: Interruption) -> int:
    wrong = {each.name: each for each in result.wrong}
    why = sentences.enabled_meanwhile() if result.enabled else sentences.interrupted()
    if args.json:
        # without a comparison, the writes show the differences
        early = '' if result.stopped is None else why
        if result.trouble is not None:
            early = result.trouble.sentence
        for change in plan.changes:
            if change.name in result.unconfirmed:
                _print_outcome(drive, change.name, False, None, change.value, NOT_CONFIRMED)
            elif early and change.name not in result.written:
                _print_outcome(drive, change.name, False, None, change.value, early)
            elif change.name not in wrong:
                _print_outcome(drive, change.name, True, change.value, change.value, '')
        for each in result.wrong:
            _print_outcome(drive, each.name, False, each.found, each.wanted,
                           _reason(each, result))
    for step in result.steps:
        complain(f'{drive.name}: {step.text}')
    volatile = [change.name for change in plan.changes
                if change.name in result.written and _is_volatile(drive, change.parameter)]
    stores = [step for step in result.steps if step.kind is StepKind.STORE]
    if volatile and not result.stored and not any(step.unknown for step in stores):
        complain(command_sentences.gone_without_power(
            drive=drive.name, names=_list(volatile),
            why=_WHY_VOLATILE[drive.facts.persist_writes]))
    if result.trouble is not None:
        complain(f'{drive.name}: {result.trouble}')
    for name in result.unconfirmed:
        complain(f'{drive.name}: {name}: {NOT_CONFIRMED}')
    if result.stopped is not None:
        complain(
            command_sentences.restore_interrupted(
                drive=drive.name, why=why, written=_list(result.written),
                not_written=_list(result.stopped),
                again='Disable it, then repeat' if result.enabled else 'Repeat'))
        return FAILED if result.enabled else interrupted.exit_code
    if wrong:
        confirmed = [name for name in result.written if name not in wrong]
        complain(command_sentences.restore_incomplete(
            drive=drive.name, confirmed=_list(confirmed)))
        for each in result.wrong:
            found = ('not there' if each in plan.absent else 'unknown' if each.found is None
                     else _with_unit(drive, each.name, each.found))
            reason = _reason(each, result)
            complain(f'  {each.name}: {found} instead of '
                     f'{_with_unit(drive, each.name, each.wanted)}{reason and f": {reason}"}')
    elif result.trouble is not None:
        complain(f'{drive.name}: written before: {_list(result.written)}')
    if not result.complete:
        return FAILED
    if not args.json:
        modes = [change.name for change in (*plan.changes, *plan.kept) if change.not_all
                 and change.wanted is not None and change.left_alone in (None, LeftAlone.MODE)]
        count = counted(len(plan.changes), 'setting')
        say(command_sentences.restored(
                drive=drive.name, count=count, read=len(plan.words),
                modes=f', but for the mode in {_list(modes)}' if modes else ''))
    return 0


def _reason(wrong: NotAsInFile, result: RestoreResult) -> str:
    ignored = wrong.found is not None and wrong.name in result.written
    return wrong.reason or (sentences.acknowledged_not_taken() if ignored else '')


def _is_volatile(drive: Drive, parameter: Parameter) -> bool:
    if parameter.storage is None:
        return not drive.facts.persist_writes
    return parameter.storage is Storage.RAM


def _print_outcome(drive: Drive, name: str, ok: bool, found: Value | None, wanted: Value,
                   reason: str) -> None:
    print_json({'drive': drive.name, 'parameter': name, 'ok': ok, 'found': found,
                'wanted': wanted, 'reason': reason, 'code': code_of(reason)})


def _with_unit(drive: Drive, name: str, value: Value) -> str:
    return f'{_named(drive, name, value)} {_unit(drive, name)}'.rstrip()


def _named(drive: Drive, name: str, value: Value) -> str:
    return named_value(drive.find(name), value)


def _unit(drive: Drive, name: str) -> str:
    parameter = drive.find(name)
    return parameter.unit if parameter is not None else ''


def _list(names: Sequence[str]) -> str:
    return ', '.join(names) or 'nothing'
