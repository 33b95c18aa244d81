# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can profile list``, ``show`` and ``check``."""

from argparse import Namespace
from pathlib import Path
from typing import Any

from drive_can_bridge.cli.command import complain, FAILED, say
from drive_can_bridge.cli.tables import print_json, print_table
from drive_can_bridge.configuration.problems import Problem
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.profiles.catalogue import available, check, Checked, description, find
from drive_can_bridge.profiles.trust import TRUST_WORDS


def run_list(args: Namespace) -> int:
    """Print which profiles there are."""
    documents = [_summary(name, check(path)) for name, path in available(args.directory).items()]
    if args.json:
        for document in documents:
            print_json(document)
        return 0
    print_table(
        ('name', 'parameters', 'verified', 'protocols', 'description', 'problems'),
        [(document['name'], str(document['parameters']),
          str(document['verified']) if document['verified'] or document['unverified'] else '',
          ', '.join(document['protocols']), document['description'],
          f'{document["problems"]}: drive_can profile check {document["path"]}'
          if document['problems'] else '') for document in documents],
        numbers=('parameters', 'verified'))
    return 0


def _summary(name: str, checked: Checked) -> dict[str, Any]:
    profile = checked.loaded.profile
    return {'name': name, 'path': str(checked.path), 'description': profile.description,
            'protocols': list(profile.protocols), 'parameters': len(profile.parameters),
            'verified': checked.count(True), 'unverified': checked.count(False),
            'problems': len(checked.problems)}


def run_show(args: Namespace) -> int:
    """Print what is in a profile."""
    checked = check(find(args.name, args.directory))
    if checked.problems:
        _print_problems(checked.problems)
        return FAILED
    profile, entries = checked.loaded.profile, checked.entries
    if args.json:
        for name, parameter in profile.parameters.items():
            print_json(description(name, parameter, entries[name]))
        return 0
    say(f'{profile.description or profile.name} ({", ".join(profile.protocols)})')
    say(str(checked.path))
    if profile.identity:
        print(f'identity: {", ".join(profile.identity)}')
    print()
    print_table(
        ('name', 'address', 'type', 'scale', 'unit', 'access', 'storage', 'allowed', 'verified',
         'description'),
        [_row(name, parameter) for name, parameter in profile.parameters.items()])
    return 0


def _row(name: str, parameter: Parameter) -> tuple[str, ...]:
    scale = '' if parameter.scale == 1.0 else f'{parameter.scale:.12g}'
    offset = f'{parameter.offset:+.12g}' if parameter.offset else ''
    bounded = parameter.minimum is not None or parameter.maximum is not None
    return (name, parameter.address, parameter.type.value, scale + offset, parameter.unit,
            parameter.access.value + (' protected' if parameter.protected else ''),
            parameter.storage.value if parameter.storage else '',
            parameter.range_text if bounded else '', TRUST_WORDS[parameter.verified],
            parameter.description)


def run_check(args: Namespace) -> int:
    """Print whether profiles are right, or what is wrong with them."""
    good = True
    for path in args.files:
        checked = _checked(path)
        if checked is None:
            good = False
            continue
        good = good and not checked.problems
        if args.json:
            print_json({'file': str(path), 'ok': not checked.problems,
                        'parameters': len(checked.loaded.profile.parameters),
                        'problems': [_problem(each) for each in checked.problems],
                        'warnings': [_problem(each) for each in checked.warnings]})
            continue
        _print_problems(checked.problems)
        for warning in checked.warnings:
            complain(f'warning: {warning}')
        if not checked.problems:
            say(f'{path}: {_counted(checked)}')
    return 0 if good else FAILED


def _checked(path: Path) -> Checked | None:
    try:
        return check(path)
    except OSError as error:  # the other files are checked all the same
        complain(f'{path}: {error.strerror or error}')
        return None


def _counted(checked: Checked) -> str:
    profile = checked.loaded.profile
    total, sure, unsure = len(profile.parameters), checked.count(True), checked.count(False)
    trust = f', {sure} verified, {unsure} not' if sure or unsure else ''
    return f'all right: {total} parameter{"" if total == 1 else "s"}{trust}; ' \
           f'{", ".join(profile.protocols)}'


def _problem(problem: Problem) -> dict[str, Any]:
    return {'line': problem.line, 'key': problem.key, 'message': problem.message}


def _print_problems(problems: tuple[Problem, ...]) -> None:
    for problem in problems:
        complain(str(problem))
