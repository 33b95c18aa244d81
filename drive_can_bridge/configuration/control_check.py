# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The ``control`` section of a profile: words that fit, conditions that can come true."""

from collections.abc import Iterator
from typing import Any

from drive_can_bridge.configuration.problems import Problem, show, suggestion, Tree
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.core.profile import ControlTable, StatusPattern


def check_control(tree: Tree, parameters: dict[str, Parameter],
                  names: tuple[str, ...]) -> Iterator[Problem]:
    """
    Check the ``control`` section of a profile's tree.

    :param parameters: those that are all right.
    :param names: of all parameters.
    """
    control = tree.data['control']
    words = control.get('words', {})
    name = control.get('parameter')
    parameter = parameters.get(name or '')
    if name is not None and name not in names and not tree.is_damaged(('parameters',)):
        yield tree.problem(('control', 'parameter'),
                           f'{show(name)} is unknown, {suggestion(name, names)}')
    elif parameter is not None:
        if not parameter.writable:
            yield tree.problem(('control', 'parameter'), f'{show(name)} is read-only, allowed is '
                                                         'one with access rw or wo')
        yield from _check_words(tree, parameter, words)
    if 'disable' in words and words['disable'] == words.get('enable'):
        yield tree.problem(('control', 'words', 'enable'), f'{show(words["enable"])} is the word '
                           'for disable too, allowed is another one')
    yield from _check_status(tree, parameters, names)


def _check_words(tree: Tree, parameter: Parameter, words: dict[str, int]) -> Iterator[Problem]:
    largest = _largest_word(parameter)
    for key, word in words.items():
        if word > largest:
            yield tree.problem(('control', 'words', key), f'{word} does not fit {parameter.name}, '
                               f'allowed is 0 to {largest} ({parameter.type.value})')


def _check_status(tree: Tree, parameters: dict[str, Parameter],
                  names: tuple[str, ...]) -> Iterator[Problem]:
    status = tree.data['control'].get('status')
    if not isinstance(status, dict):
        return
    name = status.get('parameter')
    parameter = parameters.get(name or '')
    largest = 0xFFFFFFFF if parameter is None else _largest_word(parameter)
    if name is not None and name not in names and not tree.is_damaged(('parameters',)):
        yield tree.problem(('control', 'status', 'parameter'),
                           f'{show(name)} is unknown, {suggestion(name, names)}')
    elif parameter is not None and not parameter.readable:
        yield tree.problem(('control', 'status', 'parameter'),
                           f'{show(name)} is write-only, allowed is one with access ro or rw')
    for key in ('ready', 'enabled', 'fault'):
        if key not in status:
            continue
        mask, value = status[key]
        path = ('control', 'status', key)
        if mask > largest and parameter is not None:
            yield tree.problem(path, f'mask {mask} does not fit {parameter.name}, allowed is '
                                     f'1 to {largest} ({parameter.type.value})')
        if mask == 0:
            yield tree.problem(path, 'mask 0 looks at no bit, allowed is a mask with at least one')
        elif value & ~mask:
            yield tree.problem(path, f'value {value} has bits outside of mask {mask} and never '
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
