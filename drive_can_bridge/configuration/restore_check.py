# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The sections ``identity`` and ``restore`` of a profile: names that exist, values that fit."""

from collections.abc import Iterator
from typing import Any

from drive_can_bridge.configuration.control_check import look_up
from drive_can_bridge.configuration.problems import Path, Tree
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.core.profile import RestoreStep, RestoreTable
from drive_can_bridge.core.words import show, suggestion

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
