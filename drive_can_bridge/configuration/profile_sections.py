# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The ``control`` section of a profile: words that fit, conditions that can come true.

Names of values (``values``) and of faults (section ``fault``) in a profile.

The sections ``identity`` and ``restore`` of a profile: names that exist, values that fit.
"""

from collections.abc import Iterator
import re
from typing import Any

from drive_can_bridge.configuration.problems import Path, Tree
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.core.profile import (
    ControlTable, FaultTable, RestoreStep, RestoreTable, StatusPattern,
)
from drive_can_bridge.core.words import show, suggestion


def check_control(tree: Tree, parameters: dict[str, Parameter], names: tuple[str, ...]) -> None:
    """
    Check the ``control`` section of a profile's tree.

    :param parameters: those that are all right.
    :param names: of all parameters.
    """
    control = tree.data['control']
    words = control.get('words', {})
    parameter = look_up(tree, ('control', 'parameter'), control.get('parameter'), parameters,
                        names)
    if parameter is not None:
        if not parameter.writable:
            tree.wrong(('control', 'parameter'), f'{show(parameter.name)} is read-only, allowed '
                                                 'is one with access rw or wo')
        largest = _largest_word(parameter)
        for key, word in words.items():
            if word > largest:
                tree.wrong(('control', 'words', key), f'{word} does not fit {parameter.name}, '
                           f'allowed is 0 to {largest} ({parameter.type.value})')
    for key, word in words.items():     # nothing but ~/enable starts a drive
        if key != 'enable' and word == words.get('enable'):
            tree.wrong(('control', 'words', 'enable'), f'{show(word)} is the word for {key} too, '
                                                       'allowed is another one')
    if isinstance(control.get('status'), dict):
        _check_status(tree, control['status'], parameters, names)


def look_up(tree: Tree, path: Path, name: str | None, parameters: dict[str, Parameter],
            names: tuple[str, ...], *, at: Path | None = None) -> Parameter | None:
    """
    Return the parameter that a section names, if it is all right.

    One with problems of its own is known.
    """
    if name is not None and name not in names and not tree.is_damaged(('parameters',)):
        tree.wrong(path, f'{show(name)} is unknown, {suggestion(name, names)}', at=at)
    return parameters.get(name or '')


def _check_status(tree: Tree, status: dict[str, Any], parameters: dict[str, Parameter],
                  names: tuple[str, ...]) -> None:
    path = ('control', 'status')
    parameter = look_up(tree, (*path, 'parameter'), status.get('parameter'), parameters, names)
    if parameter is not None and not parameter.readable:
        tree.wrong((*path, 'parameter'), f'{show(parameter.name)} is write-only, allowed is one '
                                         'with access ro or rw')
    for key in ('ready', 'enabled', 'fault'):
        if key not in status:
            continue
        mask, value = status[key]
        if parameter is not None and mask > _largest_word(parameter):
            tree.wrong((*path, key), f'mask {mask} does not fit {parameter.name}, allowed is 1 to '
                                     f'{_largest_word(parameter)} ({parameter.type.value})')
        if mask == 0:
            tree.wrong((*path, key), 'mask 0 looks at no bit, allowed is a mask with at least one')
        elif value & ~mask:
            tree.wrong((*path, key), f'value {value} has bits outside of mask {mask} and never '
                                     'matches, allowed are bits of the mask')


def _largest_word(parameter: Parameter) -> int:
    return 1 if parameter.type is ParameterType.BOOL else (1 << parameter.type.bits) - 1


def control_table(control: dict[str, Any]) -> ControlTable:
    """Make the table of a section without a fault."""
    words, status = control['words'], control.get('status', {})

    def pattern(key: str) -> StatusPattern | None:
        return StatusPattern(*status[key]) if key in status else None

    return ControlTable(
        parameter=control['parameter'],
        disable=words['disable'], enable=words['enable'],
        quick_stop=words.get('quick_stop'), reset_fault=words.get('reset_fault'),
        status_parameter=status.get('parameter'),
        ready=pattern('ready'), enabled=pattern('enabled'), fault=pattern('fault'))


#: of one name: as clients find it between others, and as a person may type it
NAME_MAX = 60
_NAME = re.compile(r'[^\s"\\]+( [^\s"\\]+)*')
_NUMBER = re.compile(r'[+-]?[0-9.]')
_NEXT = re.compile(r'(^| )-?[0-9]+:')


def check_values(tree: Tree, path: Path, parameter: Parameter, entry: dict[str, Any]) -> None:
    """Check the names of a parameter's values."""
    if 'values' not in entry:
        return
    if parameter.scaled or parameter.type is ParameterType.BOOL:
        kind = 'a bool' if parameter.type is ParameterType.BOOL else 'a number with a unit'
        tree.wrong((*path, 'values'), f'{show(parameter.name)} is {kind}, allowed in integers '
                                      'without scale, offset and unit')
        return
    check_names(tree, (*path, 'values'), entry['values'], parameter)


def check_names(tree: Tree, path: Path, given: dict[str, Any],
                parameter: Parameter | None) -> None:
    """
    Check names by integers.

    :param parameter: whose raw integers they are; None: nothing is known of it.
    """
    numbers: dict[int, str] = {}
    names: dict[str, str] = {}
    for key, name in given.items():
        here, number = (*path, key), int(key, 0)
        low, high = (-2**31, 2**32 - 1) if parameter is None else parameter.type.raw_range
        if not low <= number <= high:
            tree.wrong(here, f'{key} does not fit, allowed is {low} to {high}')
        elif number in numbers:
            tree.wrong(here, f'{key} stands twice (as {numbers[number]}), allowed is once')
        numbers.setdefault(number, key)
        if isinstance(name, bool):
            word = 'true, on or yes' if name else 'false, off or no'
            tree.wrong(here, f'{word} without quotes is a bool, allowed is text: write it in '
                             'quotes')
        elif not isinstance(name, str):
            tree.wrong(here, f'{show(name)} is a number, allowed is text')
        elif (len(name) > NAME_MAX or not _NAME.fullmatch(name) or _NUMBER.match(name)
              or _NEXT.search(name)):
            tree.wrong(here, f'{show(name)} is no name, allowed are at most {NAME_MAX} characters '
                             'that begin with no digit, without quotes and double spaces')
        elif name in names:
            tree.wrong(here, f'{show(name)} is the name of {names[name]} too, allowed is another '
                             'one')
        else:
            names[name] = key


def named(given: dict[str, Any]) -> tuple[tuple[int, str], ...]:
    """Return names that are all right, with their integers."""
    return tuple((int(key, 0), name) for key, name in given.items())


def check_fault(tree: Tree, parameters: dict[str, Parameter], names: tuple[str, ...]) -> None:
    """
    Check the ``fault`` section of a profile's tree.

    :param parameters: those that are all right.
    :param names: of all parameters.
    """
    section = tree.data['fault']
    path = ('fault', 'parameter')
    parameter = look_up(tree, path, section.get('parameter'), parameters, names)
    if parameter is not None and not parameter.readable:
        tree.wrong(path, f'{show(parameter.name)} is write-only, allowed is one with access ro or '
                         'rw')
    elif parameter is not None and parameter.type is ParameterType.BOOL:
        tree.wrong(path, f'{show(parameter.name)} is a bool, allowed is a number')
    if isinstance(section.get('codes'), dict):
        check_names(tree, ('fault', 'codes'), section['codes'], parameter)
    if isinstance(section.get('bit'), str):
        _check_bit(tree, section['bit'], parameters, names)


def _check_bit(tree: Tree, text: str, parameters: dict[str, Parameter],
               names: tuple[str, ...]) -> None:
    path, (name, _, bit) = ('fault', 'bit'), text.partition('.')
    parameter = look_up(tree, path, name, parameters, names)
    if parameter is None:
        return
    bits = dict(parameter.bits)
    if bit not in bits:
        tree.wrong(path, f'{show(bit)} is no bit of {name}, {suggestion(bit, bits)}' if bits else
                   f'{show(name)} has no named bits, allowed is PARAMETER.BIT')


def fault_table(section: dict[str, Any], parameters: dict[str, Parameter]) -> FaultTable:
    """Make the table of a section without a fault."""
    name, _, bit = section.get('bit', '').partition('.')
    position = dict(parameters[name].bits).get(bit) if name in parameters else None
    return FaultTable(
        section['parameter'], named(section.get('codes', {})),
        None if position is None else (name, 1 << position))


_PHASES = ('before', 'after')


def check_identity(tree: Tree, parameters: dict[str, Parameter], names: tuple[str, ...]) -> None:
    """
    Check the ``identity`` section of a profile's tree.

    :param parameters: those that are all right.
    :param names: of all parameters.
    """
    seen: set[str] = set()
    for position, name in enumerate(tree.data.get('identity', ())):
        at = ('identity', position)
        if name in seen:
            tree.wrong(('identity',), f'{show(name)} stands twice, allowed is once', at=at)
            continue
        parameter = look_up(tree, ('identity',), name, parameters, names, at=at)
        if parameter is not None and not parameter.readable:
            tree.wrong(('identity',), f'{show(name)} is write-only, allowed are parameters with '
                                      'access ro or rw', at=at)
        seen.add(name)


def check_restore(tree: Tree, parameters: dict[str, Parameter], names: tuple[str, ...]) -> None:
    """Check the ``restore`` section likewise."""
    for phase, name, value in _steps(tree):
        path = ('restore', phase, name)
        parameter = look_up(tree, path, name, parameters, names)
        if parameter is None:
            continue
        if not parameter.writable:
            tree.wrong(path, f'{show(name)} is read-only, allowed are parameters with access rw '
                             'or wo')
        elif isinstance(value, dict):
            _check_bits(tree, path, parameter, value)
        else:
            try:
                parameter.raw_from_value(value)
            except ValueRefused:
                allowed = 'true or false' if parameter.type is ParameterType.BOOL \
                    else parameter.range_text
                tree.wrong(path, f'{show(value)} cannot be written, allowed is {allowed}')


def restore_table(tree: Tree, parameters: dict[str, Parameter]) -> RestoreTable:
    """Make the table of the section; where something is wrong, nothing of it may be used."""
    if not tree.is_sound(('restore',)) or any(
            name not in parameters for _, name, _ in _steps(tree)):
        return RestoreTable()
    made: dict[str, list[RestoreStep]] = {phase: [] for phase in _PHASES}
    for phase, name, value in _steps(tree):
        made[phase].append(_step(parameters[name], value))
    return RestoreTable(tuple(made['before']), tuple(made['after']))


def _step(parameter: Parameter, value: Any) -> RestoreStep:
    if not isinstance(value, dict):
        return RestoreStep(parameter.name,
                           parameter.word_from_raw(parameter.raw_from_value(value)),
                           parameter.word_from_raw(-1))
    positions = dict(parameter.bits)
    bits = mask = 0
    for name, wanted in value.items():
        mask |= 1 << positions[name]
        bits |= wanted << positions[name]
    return RestoreStep(parameter.name, bits, mask)


def _check_bits(tree: Tree, path: Path, parameter: Parameter, value: dict[str, bool]) -> None:
    known = [bit for bit, _ in parameter.bits]
    for bit in value:
        if bit not in known:
            tree.wrong((*path, bit), f'{show(bit)} is no bit of {parameter.name}, '
                                     f'{suggestion(bit, known)}')
    if not parameter.readable:
        tree.wrong(path, f'{show(parameter.name)} is write-only: its other bits cannot be kept, '
                         'allowed is a value')


def _steps(tree: Tree) -> Iterator[tuple[str, str, Any]]:
    section = tree.data.get('restore')
    for phase in _PHASES:
        steps = section.get(phase) if isinstance(section, dict) else None
        if isinstance(steps, dict):
            for name, value in steps.items():
                yield phase, name, value
