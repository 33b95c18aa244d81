# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
From the tree of a profile to a parameter table.

Checked here is what holds for every drive that uses the profile. What a protocol family cannot do
with it is the family's business, see :meth:`drive_can_bridge.protocols.family.Family.check`.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path as FilePath
import re
from typing import Any

from drive_can_bridge.configuration.control_check import check_control, control_table
from drive_can_bridge.configuration.problems import Path, Problem, show, Tree
from drive_can_bridge.configuration.restore_check import (
    check_identity, check_restore, restore_table,
)
from drive_can_bridge.configuration.schema import profile_schema
from drive_can_bridge.configuration.schema_check import check_schema
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import (
    Access, Parameter, ParameterType, STEP_TOLERANCE, Storage, Value,
)
from drive_can_bridge.core.profile import Profile

#: names that a drive's node uses itself
RESERVED = frozenset((
    'online', 'response', 'request', 'command', 'joint_state', 'joint_command',
    'get_parameters', 'set_parameters', 'set_parameters_atomically', 'list_parameters',
    'describe_parameters', 'get_parameter_types', 'enable', 'reset_fault', 'quick_stop',
))
_RAW_NAME = re.compile(r'p[0-9]+|x[0-9a-f]+', re.ASCII)


@dataclass(frozen=True)
class LoadedProfile:
    """
    A profile with everything that is right in it.

    :param names: all parameter names of the file, wrong ones included: a reference to one of them
        is not unknown.
    """

    profile: Profile
    tree: Tree
    names: tuple[str, ...]
    problems: list[Problem] = field(default_factory=list)
    warnings: list[Problem] = field(default_factory=list)


def profile_from_tree(tree: Tree) -> LoadedProfile:
    """Check a profile and make what can be made of it."""
    sound, problems = check_schema(tree, profile_schema())
    warnings: list[Problem] = []
    parameters: dict[str, Parameter] = {}
    for name, entry in sound.data.get('parameters', {}).items():
        path = ('parameters', name)
        wrong = list(_check_names(sound, path, name, entry))
        parameter = _parameter(name, entry)
        wrong.extend(_check_parameter(sound, path, parameter, entry))
        problems.extend(wrong)
        # An entry of which a part was cut out would be checked with values it never had.
        if not wrong and not any(place[:2] == path for place in sound.damaged):
            parameters[name], narrowed = _narrow(sound, path, parameter)
            warnings.extend(narrowed)
    given = tree.data.get('parameters')
    names = tuple(map(str, given)) if isinstance(given, dict) else ()
    control = None
    if isinstance(sound.data.get('control'), dict):
        wrong = list(check_control(sound, parameters, names))
        problems.extend(wrong)
        if not wrong and not any(place[:1] == ('control',) for place in sound.damaged):
            control = control_table(sound.data['control'])
    wrong = [*check_identity(sound, parameters, names), *check_restore(sound, parameters, names)]
    problems.extend(wrong)
    profile = Profile(
        name=FilePath(tree.file).stem, path=tree.file,
        description=sound.data.get('description', ''),
        protocols=tuple(sound.data.get('protocols', ())),
        parameters=parameters, control=control,
        identity=tuple(name for name in sound.data.get('identity', ()) if name in parameters),
        restore=restore_table(sound, parameters, usable=not wrong))
    return LoadedProfile(profile, sound, names, problems, warnings)


def _parameter(name: str, entry: dict[str, Any]) -> Parameter:
    def number(key: str) -> float | None:
        return float(entry[key]) if key in entry else None

    return Parameter(
        name=name,
        type=ParameterType(entry.get('type', 'uint16')),
        number=entry.get('number'),
        scale=float(entry.get('scale', 1.0)),
        offset=float(entry.get('offset', 0.0)),
        unit=entry.get('unit', ''),
        access=Access(entry.get('access', 'rw')),
        storage=Storage(entry['storage']) if 'storage' in entry else None,
        minimum=number('minimum'),
        maximum=number('maximum'),
        neutral=entry.get('neutral'),
        description=entry.get('description', ''),
        bits=tuple(entry.get('bits', {}).items()),
        subindex=entry.get('subindex'),
        index=entry.get('index'),
        word_order=entry.get('word_order'),
        protected=entry.get('protected', False),
        verified=entry.get('verified'),
        scaled=any(key in entry for key in ('scale', 'offset', 'unit')))


# -- names ----------------------------------------------------------------------------------------


def _check_names(tree: Tree, path: Path, name: str, entry: dict[str, Any]) -> Iterator[Problem]:
    message = _name_problem(name)
    if message:
        yield tree.problem(path, message)
    for bit in entry.get('bits', {}):
        message = _name_problem(bit)
        if message:
            yield tree.problem((*path, 'bits', bit), message)


def _name_problem(name: str) -> str:
    if name in RESERVED:
        return f'{show(name)} is taken by the node of the drive, allowed is any other name'
    if _RAW_NAME.fullmatch(name):
        return f'{show(name)} reads as a raw parameter, allowed are names other than p<digits> ' \
               'and x<hexadecimal digits>'
    return ''


# -- parameters -----------------------------------------------------------------------------------


def _check_parameter(tree: Tree, path: Path, parameter: Parameter,
                     entry: dict[str, Any]) -> Iterator[Problem]:
    if parameter.type is ParameterType.BOOL:
        for key in ('scale', 'offset', 'unit', 'minimum', 'maximum'):
            if key in entry:
                yield tree.problem((*path, key), f'a bool has no {key}, allowed is to leave it '
                                                 'out')
        if 'neutral' in entry and not isinstance(entry['neutral'], bool):
            yield tree.problem((*path, 'neutral'), f'{show(entry["neutral"])} is no bool, '
                                                   'allowed is true or false')
    else:
        yield from _check_range(tree, path, parameter, entry)
    for bit, position in parameter.bits:
        width = 1 if parameter.type is ParameterType.BOOL else parameter.type.bits
        if position >= width:
            yield tree.problem((*path, 'bits', bit), f'bit {position} does not exist in '
                               f'{parameter.type.value}, allowed is 0 to {width - 1}')
    if parameter.word_order is not None and parameter.type.bits != 32:
        yield tree.problem((*path, 'word_order'), f'{parameter.type.value} has one word, allowed '
                                                  'in int32 and uint32')


def _check_range(tree: Tree, path: Path, parameter: Parameter,
                 entry: dict[str, Any]) -> Iterator[Problem]:
    """Check that minimum, neutral and maximum are in this order, and that they can be sent."""
    sound = True
    for key in ('minimum', 'maximum'):
        limit = entry.get(key)
        if limit is not None and not parameter.scaled and float(limit) != int(limit):
            sound = False
            yield tree.problem((*path, key), f'{show(limit)} is no integer, allowed without '
                                             'scale, offset and unit are integers')
    low, high = parameter.raw_limits
    if (parameter.minimum is not None and parameter.maximum is not None
            and parameter.minimum > parameter.maximum):
        sound = False
        yield tree.problem((*path, 'minimum'), f'{show(entry["minimum"])} is above the maximum, '
                                               f'allowed is at most {show(entry["maximum"])}')
    elif sound and low > high:
        sound = False
        key = 'minimum' if 'minimum' in entry else 'maximum'
        scale = f' with scale {parameter.scale:g}' if 'scale' in entry and low == high + 1 else ''
        yield tree.problem((*path, key), f'{parameter.type.value}{scale} has no value in '
                           f'{parameter.range_text}, allowed are limits around one (the nearest '
                           f'is {_with_unit(parameter, _nearest(parameter))})')
    if isinstance(entry.get('neutral'), bool):
        yield tree.problem((*path, 'neutral'), f'{show(entry["neutral"])} is a bool, allowed is '
                                               'a number')
    elif parameter.neutral is not None and sound:
        try:
            parameter.raw_from_value(parameter.neutral)
        except (ValueRefused, OverflowError):
            yield tree.problem((*path, 'neutral'), f'{show(parameter.neutral)} cannot be sent, '
                               f'allowed is {_range_in_words(parameter)}')


def _nearest(parameter: Parameter) -> Value:
    """Return the value next to limits that have none between them."""
    first, last = parameter.type.raw_range
    values = [parameter.value_from_raw(min(max(raw, first), last))
              for raw in sorted(parameter.raw_limits)]
    limits = [limit for limit in (parameter.minimum, parameter.maximum) if limit is not None]
    return min(values, key=lambda value: min(abs(value - limit) for limit in limits))


def _narrow(tree: Tree, path: Path, parameter: Parameter,
            ) -> tuple[Parameter, list[Problem]]:
    """Bring limits that the type cannot hold to its ends; return what a user should know."""
    slack = abs(parameter.scale) * STEP_TOLERANCE
    low, high = parameter.value_range
    narrowed: dict[str, float] = {}
    if parameter.minimum is not None and parameter.minimum < low - slack:
        narrowed['minimum'] = low
    if parameter.maximum is not None and parameter.maximum > high + slack:
        narrowed['maximum'] = high
    warnings = [
        tree.problem((*path, key), f'{show(tree.data["parameters"][parameter.name][key])} is not '
                     f'representable in {parameter.type.value}, narrowed to '
                     f'{_with_unit(parameter, end)}')
        for key, end in narrowed.items()]
    return replace(parameter, **narrowed), warnings  # type: ignore[arg-type]


def _with_unit(parameter: Parameter, value: Value) -> str:
    text = show(value if parameter.scaled else round(value))
    return f'{text} {parameter.unit}' if parameter.unit else text


def _range_in_words(parameter: Parameter) -> str:
    text = parameter.range_text
    return text if parameter.scaled else f'an integer, {text}'
