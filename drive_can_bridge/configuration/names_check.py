# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Names of values (``values``) and of faults (section ``fault``) in a profile."""

import re
from typing import Any

from drive_can_bridge.configuration.control_check import look_up
from drive_can_bridge.configuration.problems import Path, Tree
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.core.profile import FaultTable
from drive_can_bridge.core.words import show, suggestion

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
