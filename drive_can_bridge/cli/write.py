# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can write``: set parameters of drives, and check that they have arrived."""

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from contextlib import suppress
import re
import shlex

from drive_can_bridge.cli.command import complain, FAILED, print_json, WrongUsage
from drive_can_bridge.cli.drives import (
    add_words, by_short_names, complete_words, opened, source_of, split_words)
from drive_can_bridge.cli.output import counting, print_table
from drive_can_bridge.client.drive import Drive, Drives, ENDED_BEFORE, WriteOutcome
from drive_can_bridge.configuration.scalars import read_scalar
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.errors import NoAnswer
from drive_can_bridge.core.parameters import Parameter, Storage, Value, ValueKind
from drive_can_bridge.core.requests import FailureKind
from drive_can_bridge.protocols.storing import STORING

_HEADINGS = ('drive', 'name', 'value', 'unit', 'number', 'storage', 'result')
#: of the names that a value may have
_NAMES_SHOWN = 12
_OTHER_REFUSED = command_sentences.other_value_refused()
#: octal to parameter files, and decimal to most people
_AMBIGUOUS = re.compile(r'\s*[+-]?0[0-9]')


def define(parser: ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'Set parameters of a drive one after the other: through a running bridge, or '
        'directly with --params-file. Each one is acknowledged by the drive, or read '
        'back. Nothing is written where a name or a value is wrong. No setpoint, no control '
        'word.')
    parser.epilog = (
        'Exit code 0: all was written. 1: something was not, its row says why. 2: wrong '
        'usage, nothing was sent. After Ctrl-C (130) the write under way is complete.')
    add_words(parser, complete_words, '[DRIVE] NAME=VALUE …', '+', (
        'the drive, by its name or its full name in the ROS graph (/cell/lift), also as a shell '
        'pattern (may be left out where there is only one); names of the profile, or raw ones, '
        'with the new value'))


def run(args: Namespace) -> int:
    """
    Write parameters.

    :return: 0 everything, 1 not everything.
    :raises WrongUsage: it is not clear which drive is meant, or a word is no NAME=VALUE.
    :raises DriveCanError: another master, a bus or a bridge that is not there.
    """
    # what the command line alone shows to be wrong; the first word may be a drive
    _assignments(args.words if '=' in args.words[0] else args.words[1:])
    if '=' not in args.words[0]:
        args.words[:1] = by_short_names(args, args.words[:1])
    with source_of(args) as source:
        names, words = split_words(source.names, args.words)
        wanted = _assignments(words)
        with opened(source, names) as drives:
            return _write(args, drives, wanted)


def _assignments(words: Sequence[str]) -> dict[str, str]:
    """
    Return the names and values in ``NAME=VALUE`` words.

    :raises WrongUsage: a word is none, or there is none at all.
    """
    wanted: dict[str, str] = {}
    for word in words:
        name, separator, text = word.partition('=')
        if not separator or not name or not text:
            raise WrongUsage(command_sentences.name_and_value(word=repr(word)))
        if name in wanted:
            raise WrongUsage(command_sentences.name_twice(name=name))
        wanted[name] = text
    if not wanted:
        raise WrongUsage(command_sentences.value_missing())
    return wanted


def _write(args: Namespace, drives: Drives, wanted: dict[str, str]) -> int:
    checked = {(drive, name): each for drive in drives.values()
               for name, each in _all_checked(drive, wanted).items()}
    if any(reason for _, reason in checked.values()):   # half a command is not to be carried out
        _show(args, drives, wanted, [
            (drive, WriteOutcome(name, False, drive.find(name), reason or _OTHER_REFUSED,
                                 kind=FailureKind.INVALID))
            for (drive, name), (_, reason) in checked.items()])
        return FAILED
    outcomes: list[tuple[Drive, WriteOutcome]] = []
    try:
        for drive in drives.values():
            def told(outcome: WriteOutcome, drive: Drive = drive) -> None:
                outcomes.append((drive, outcome))
            with counting(f'writing {drive.name}', len(wanted), args.clock.now) as step:
                for name in wanted:
                    drive.write({name: checked[drive, name][0]}, told=told)
                    step()
    finally:    # also where Ctrl-C, another master or the loss of the bus came between
        known = {(drive, outcome.name) for drive, outcome in outcomes}
        _show(args, drives, wanted, [*outcomes, *(
            (drive, WriteOutcome(name, False, drive.find(name), ENDED_BEFORE,
                                 kind=FailureKind.UNAVAILABLE))
            for drive, name in checked if (drive, name) not in known)])
    return 0 if all(outcome.ok for _, outcome in outcomes) else FAILED


def _all_checked(drive: Drive, wanted: dict[str, str]) -> dict[str, tuple[Value, str]]:
    """Return the values, and what is wrong with each by itself, or beside the others."""
    each = {name: _checked(drive, name, text) for name, text in wanted.items()}
    contradicted = drive.contradicted({
        name: value for name, (value, reason) in each.items() if not reason})
    return {name: (value, reason or contradicted.get(name, ''))
            for name, (value, reason) in each.items()}


def _checked(drive: Drive, name: str, text: str) -> tuple[Value, str]:
    """Return the value, and what is wrong with it as far as that shows without the drive."""
    parameter = drive.find(name)
    if parameter is None:
        return 0, drive.check(name, 0)
    value = _value(parameter, text)
    if value is None:
        return 0, drive.write_refusal(name, parameter) or (
            f'wrong type: {text!r}, expected {_expected(parameter)}'
            + _meant(parameter, text))
    return value, drive.check(name, value)


def _value(parameter: Parameter, text: str) -> Value | None:
    """
    Return a value written as in a parameter file, or by its name.

    :return: None: it is none of the parameter's kind.
    """
    named = parameter.value_named(text)
    if named is not None:
        return named
    value = None if _AMBIGUOUS.match(text) else read_scalar(text)
    if parameter.kind is ValueKind.BOOL:
        return value if isinstance(value, bool) else None
    if isinstance(value, (bool, str)):
        return None
    if parameter.kind is ValueKind.DOUBLE:
        return None if value is None else float(value)
    return value if isinstance(value, int) else None


def _shown(drive: Drive, outcome: WriteOutcome, text: str) -> Value | str:
    """
    Return what the drive holds, or was to hold, as a program takes it.

    :return: the text where it is no value.
    """
    parameter = outcome.parameter
    value = None if parameter is None else _value(parameter, text)
    if parameter is None or value is None:
        return text
    return drive.rounded(parameter, value) if outcome.ok else value


def _cell(drive: Drive, outcome: WriteOutcome, text: str) -> str:
    """
    Return the value for people: as it was typed, unless the drive holds another one.

    One that has a name is shown with it.
    """
    parameter = outcome.parameter
    value = None if parameter is None or not outcome.ok else _value(parameter, text)
    if parameter is None or value is None or not parameter.listed:
        return text
    held = drive.rounded(parameter, value)
    if parameter.text(held) == parameter.text(value) and not parameter.name_of(held):
        return text
    return parameter.named(held)


def _expected(parameter: Parameter) -> str:
    names = ', '.join(name for _, name in parameter.values[:_NAMES_SHOWN])
    more = ' …' if len(parameter.values) > _NAMES_SHOWN else ''
    return parameter.kind.words + (f' or one of {names}{more}' if names else '')


def _meant(parameter: Parameter, text: str) -> str:
    """Return what to write instead of a number with its unit, or with a comma; '': unknown."""
    number = text.removesuffix(parameter.unit).strip()
    if re.fullmatch(r'[-+]?[0-9]+,[0-9]+', number):
        number = number.replace(',', '.')
    meant = '' if number == text or _value(parameter, number) is None else f': write {number}'
    in_unit = parameter.unit and text[:1] in '+-.0123456789'
    return meant + (f' (in {parameter.unit})' if in_unit else '')


def _show(args: Namespace, drives: Drives, wanted: dict[str, str],
          outcomes: Sequence[tuple[Drive, WriteOutcome]]) -> None:
    rows = []
    for drive, outcome in outcomes:
        parameter = outcome.parameter
        if args.json:
            from drive_can_bridge.core.codes import code_of     # takes its time
            print_json({'drive': drive.name, 'name': outcome.name,
                        'value': _shown(drive, outcome, wanted[outcome.name]),
                        'ok': outcome.ok,
                        'reason': outcome.reason, 'code': code_of(outcome.reason)})
            continue
        result = outcome.reason or 'written'
        refused = not outcome.ok and outcome.trouble is None
        rows.append((
            drive.name if len(drives) > 1 else '', outcome.name,
            _cell(drive, outcome, wanted[outcome.name]),
            parameter.unit if parameter else '', parameter.address if parameter else '',
            parameter.storage.value if parameter and parameter.storage else '',
            f'not written: {result}' if refused else result))
    if rows:
        print_table(_HEADINGS, rows, numbers=('value',))
    for drive, outcome in outcomes:
        value = _shown(drive, outcome, wanted[outcome.name])
        twin = None if not outcome.ok or isinstance(value, str) else (
            drive.unnamed(outcome.name, value))
        if twin is not None:
            complain(command_sentences.value_without_name(
                outcome.name, value, [f'{raw} {name}' for raw, name in twin.values], drive.name))
    losers = [drive for drive, outcome in outcomes if _is_lost(outcome)]
    if args.json:
        return
    for name, drive in {drive.name: drive for drive in losers}.items():
        storing = None
        with suppress(NoAnswer):    # the result was printed; its bridge is gone since
            storing = STORING.get(drive.facts.protocol)
        if storing is not None:
            words = ['drive_can', 'write', name, storing.word]
            if args.params_file is not None:
                words += ['-p', str(args.params_file)]
            elif args.namespace is not None:
                words += ['--namespace', args.namespace or '/']
            print(f'{storing.text}{shlex.join(words)}')


def _is_lost(outcome: WriteOutcome) -> bool:
    """Return whether a value was written that the drive may not keep."""
    parameter = outcome.parameter
    return outcome.ok and parameter is not None and not parameter.stores and (
        parameter.storage is not Storage.EEPROM)
