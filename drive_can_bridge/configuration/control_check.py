# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The ``control`` section of a profile: words that fit, conditions that can come true."""

from typing import Any

from drive_can_bridge.configuration.problems import Path, Tree
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.core.profile import ControlTable, StatusPattern
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
