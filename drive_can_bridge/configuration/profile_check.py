# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
From the tree of a profile to a parameter table.

Checked here is what holds for every drive that uses the profile. What a protocol family cannot do
with it is the family's business, see :meth:`drive_can_bridge.protocols.family.Family.check`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
import re
from typing import Any

from drive_can_bridge.configuration.problems import Path, Problem, Tree
from drive_can_bridge.configuration.profile_sections import (
    check_control, check_fault, check_identity, check_restore, check_values, control_table,
    fault_table, named, restore_table,
)
from drive_can_bridge.configuration.schema import check_schema, profile_schema
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import (
    Access, Parameter, ParameterType, STEP_TOLERANCE, Storage, Value, ValueKind,
)
from drive_can_bridge.core.profile import FaultTable, Profile
from drive_can_bridge.core.words import show, suggestion

#: names that a drive's node uses itself
RESERVED = frozenset((
    'online', 'response', 'request', 'command', 'joint_state', 'joint_command',
    'get_parameters', 'set_parameters', 'set_parameters_atomically', 'list_parameters',
    'describe_parameters', 'get_parameter_types', 'enable', 'reset_fault', 'quick_stop',
    'home',
))
#: what the values of a parameter's keys become
_MADE: dict[str, Callable[[Any], Any]] = {
    'type': ParameterType, 'access': Access, 'storage': Storage,
    'bits': lambda bits: tuple(bits.items()), 'values': lambda given: (),
    **dict.fromkeys(('scale', 'offset', 'minimum', 'maximum', 'arming_tolerance'), float)}
#: what reads as the name of a parameter that stands in no profile
RAW_NAME = re.compile(r'p[0-9]+|x[0-9a-f]+', re.ASCII)


@dataclass(frozen=True, slots=True)
class LoadedProfile:
    """
    A profile with everything that is right in it.

    :param tree: with what was found in it.
    :param names: all parameter names of the file, wrong ones included: a reference to one of them
        is not unknown.
    """

    profile: Profile
    tree: Tree
    names: tuple[str, ...]

    @property
    def problems(self) -> list[Problem]:
        """What is wrong in it."""
        return self.tree.problems

    @property
    def warnings(self) -> list[Problem]:
        """What is suspicious in it."""
        return self.tree.warnings


def profile_from_tree(tree: Tree) -> LoadedProfile:
    """Check a profile and make what can be made of it."""
    given = tree.data.get('parameters')
    names = tuple(map(str, given)) if isinstance(given, dict) else ()
    check_schema(tree, profile_schema())
    parameters: dict[str, Parameter] = {}
    for name, entry in tree.data.get('parameters', {}).items():
        path = ('parameters', name)
        parameter = _parameter(name, entry)
        _check_names(tree, path, parameter)
        _check_parameter(tree, path, parameter, entry)
        _check_neutral_from(tree, path, parameter, entry)
        _check_limit(tree, path, parameter, entry)
        check_values(tree, path, parameter, entry)
        # An entry of which a part was cut out would be checked with values it never had.
        if tree.is_sound(path):
            parameters[name] = replace(_narrowed(tree, path, parameter),
                                       values=named(entry.get('values', {})))
    _check_measured(tree, parameters, names)
    control = None
    if isinstance(tree.data.get('control'), dict):
        check_control(tree, parameters, names)
        if tree.is_sound(('control',)):
            control = control_table(tree.data['control'])
            _name_words(parameters, control.parameter, tree.data['control']['words'])
    fault = None
    if isinstance(tree.data.get('fault'), dict):
        check_fault(tree, parameters, names)
        if tree.is_sound(('fault',)) and tree.data['fault']['parameter'] in parameters:
            fault = fault_table(tree.data['fault'], parameters)
            built_in = {'cannord', 'cia402'} & {*tree.data.get('protocols', ())}
            if control is None and fault.bit is None and not built_in and not (
                    tree.is_damaged(('control',))):
                tree.suspicious(('fault',), 'bit is missing: without a control section nothing '
                                'says when there is a fault, allowed is bit: PARAMETER.BIT')
            _name_faults(parameters, fault)
    check_identity(tree, parameters, names)
    check_restore(tree, parameters, names)
    profile = Profile(
        name=FilePath(tree.file).stem, path=tree.file,
        description=tree.data.get('description', ''),
        protocols=tuple(tree.data.get('protocols', ())),
        parameters=parameters, control=control,
        identity=tuple(name for name in tree.data.get('identity', ()) if name in parameters),
        restore=restore_table(tree, parameters), fault=fault)
    return LoadedProfile(profile, tree, names)


def _name_words(parameters: dict[str, Parameter], name: str, words: dict[str, int]) -> None:
    """Let what a control word says, in a short word, stand beside it wherever it is shown."""
    parameter = parameters.get(name)
    if parameter is not None and not parameter.values and parameter.kind is ValueKind.INTEGER:
        parameters[name] = replace(parameter, values=tuple(
            (parameter.raw_from_word(word), text.removeprefix('quick_').partition('_')[0])
            for text, word in words.items()))


def _name_faults(parameters: dict[str, Parameter], fault: FaultTable) -> None:
    """Let the names of faults stand beside their number wherever it is shown."""
    number = parameters[fault.parameter]
    if not number.values:
        parameters[number.name] = replace(number, values=fault.codes)


def _parameter(name: str, entry: dict[str, Any]) -> Parameter:
    return Parameter(
        name=name, scaled=any(key in entry for key in ('scale', 'offset', 'unit')),
        **{key: _MADE[key](value) if key in _MADE else value for key, value in entry.items()
           if key in Parameter.__dataclass_fields__})


# -- names ----------------------------------------------------------------------------------------


def _check_names(tree: Tree, path: Path, parameter: Parameter) -> None:
    places = [(path, parameter.name)]
    places += [((*path, 'bits', bit), bit) for bit, _ in parameter.bits]
    for place, name in places:
        if name in RESERVED:
            tree.wrong(place, f'{show(name)} is taken by the node of the drive, allowed is any '
                              'other name')
        elif RAW_NAME.fullmatch(name):
            tree.wrong(place, f'{show(name)} reads as a raw parameter, allowed are names other '
                              'than p<digits> and x<hexadecimal digits>')


# -- parameters -----------------------------------------------------------------------------------


def _check_parameter(tree: Tree, path: Path, parameter: Parameter, entry: dict[str, Any]) -> None:
    width = parameter.type.bits
    if parameter.type is ParameterType.BOOL:
        width = 1
        for key in ('scale', 'offset', 'unit', 'minimum', 'maximum', 'neutral_from',
                    'arming_tolerance'):
            if key in entry:
                tree.wrong((*path, key), f'a bool has no {key}, allowed is to leave it out')
        if 'neutral' in entry and not isinstance(entry['neutral'], bool):
            tree.wrong((*path, 'neutral'), f'{show(entry["neutral"])} is no bool, allowed is true '
                                           'or false')
    else:
        _check_limits(tree, path, parameter, entry)
    for bit, position in parameter.bits:
        if position >= width:
            tree.wrong((*path, 'bits', bit), f'bit {position} does not exist in '
                       f'{parameter.type.value}, allowed is 0 to {width - 1}')
    if parameter.word_order is not None and parameter.type.bits != 32:
        tree.wrong((*path, 'word_order'), f'{parameter.type.value} has one word, allowed in int32 '
                                          'and uint32')


def _check_neutral_from(tree: Tree, path: Path, parameter: Parameter,
                        entry: dict[str, Any]) -> None:
    """Check what a setpoint says that stays where the axis is."""
    if not parameter.neutral_from or not tree.is_sound((*path, 'neutral_from')):
        return
    if 'neutral' in entry:
        tree.wrong((*path, 'neutral'), 'stands beside neutral_from, allowed is one of them')
    if 'arming_tolerance' not in entry and not tree.is_damaged((*path, 'arming_tolerance')):
        tree.wrong((*path, 'neutral_from'), 'needs arming_tolerance: how far a command may be '
                                            'from where the axis is and still arm, allowed is '
                                            'to give it too')
    if not parameter.writable:
        tree.wrong((*path, 'neutral_from'), f'{show(parameter.name)} is read-only, allowed in '
                                            'parameters with access rw or wo')


def _check_limit(tree: Tree, path: Path, parameter: Parameter, entry: dict[str, Any]) -> None:
    """Check what bounds and moves nothing."""
    if not parameter.limit:
        return
    if 'neutral_from' in entry:
        tree.wrong((*path, 'limit'), 'stands beside neutral_from, allowed is one of them')
    elif 'neutral' not in entry and not tree.is_damaged((*path, 'neutral')):
        tree.wrong((*path, 'limit'), 'needs neutral: what is sent until the first command, '
                                     'allowed is to give it too')
    if not parameter.writable:
        tree.wrong((*path, 'limit'), f'{show(parameter.name)} is read-only, allowed in parameters '
                                     'with access rw or wo')


def _check_measured(tree: Tree, parameters: dict[str, Parameter], names: tuple[str, ...]) -> None:
    """Check that ``neutral_from`` names actual values that a setpoint can be compared with."""
    for parameter in list(parameters.values()):
        name, path = parameter.neutral_from, ('parameters', parameter.name, 'neutral_from')
        measured = parameters.get(name)
        if not name or (measured is None and name in names):     # wrong itself
            continue
        message = ''
        if measured is None:
            message = f'{show(name)} is not in the profile, {suggestion(name, names)}'
        elif measured is parameter or not measured.readable:
            message = f'{show(name)} is no actual value, allowed is one that can be read'
        elif measured.type is ParameterType.BOOL:
            message = f'{show(name)} is a bool, allowed is a number'
        elif measured.unit != parameter.unit:
            message = (f'{show(name)} has {_unit_text(measured)}, allowed is an actual value with '
                       f'{_unit_text(parameter)}, that of {show(parameter.name)}')
        if message:
            tree.wrong(path, message)
            del parameters[parameter.name]


def _unit_text(parameter: Parameter) -> str:
    return f'the unit {show(parameter.unit)}' if parameter.unit else 'no unit'


def _check_limits(tree: Tree, path: Path, parameter: Parameter, entry: dict[str, Any]) -> None:
    """Check that minimum, neutral and maximum are in this order, and that they can be sent."""
    limits = {key: entry[key] for key in ('minimum', 'maximum') if key in entry}
    if not parameter.scaled:
        for key, limit in limits.items():
            if float(limit) != int(limit):
                tree.wrong((*path, key), f'{show(limit)} is no integer, allowed without scale, '
                                         'offset and unit are integers')
    low, high = parameter.raw_limits
    if len(limits) == 2 and limits['minimum'] > limits['maximum']:
        tree.wrong((*path, 'minimum'), f'{show(limits["minimum"])} is above the maximum, allowed '
                                       f'is at most {show(limits["maximum"])}')
    elif low > high and all(tree.is_sound((*path, key)) for key in limits):
        scale = f' with scale {parameter.scale:g}' if 'scale' in entry and low == high + 1 else ''
        tree.wrong((*path, next(iter(limits))), f'{parameter.type.value}{scale} has no value in '
                   f'{parameter.range_text}, allowed are limits around one (the nearest is '
                   f'{_with_unit(parameter, _nearest(parameter))})')
    if isinstance(entry.get('neutral'), bool):
        tree.wrong((*path, 'neutral'), f'{show(entry["neutral"])} is a bool, allowed is a number')
    elif parameter.neutral is not None and all(tree.is_sound((*path, key)) for key in limits):
        try:
            parameter.raw_from_value(parameter.neutral)
        except ValueRefused:
            kind = '' if parameter.scaled else 'an integer, '
            tree.wrong((*path, 'neutral'), f'{show(parameter.neutral)} cannot be sent, allowed is '
                                           f'{kind}{parameter.range_text}')


def _nearest(parameter: Parameter) -> Value:
    """Return the value next to limits that have none between them."""
    first, last = parameter.type.raw_range
    values = [parameter.value_from_raw(min(max(raw, first), last))
              for raw in sorted(parameter.raw_limits)]
    limits = [limit for limit in (parameter.minimum, parameter.maximum) if limit is not None]
    return min(values, key=lambda value: min(abs(value - limit) for limit in limits))


def _narrowed(tree: Tree, path: Path, parameter: Parameter) -> Parameter:
    """Bring limits that the type cannot hold to its ends, and say so."""
    slack = abs(parameter.scale) * STEP_TOLERANCE
    low, high = parameter.value_range
    ends: dict[str, float] = {}
    if parameter.minimum is not None and parameter.minimum < low - slack:
        ends['minimum'] = low
    if parameter.maximum is not None and parameter.maximum > high + slack:
        ends['maximum'] = high
    for key, end in ends.items():
        limit = tree.data['parameters'][parameter.name][key]
        tree.suspicious((*path, key), f'{show(limit)} is not representable in '
                        f'{parameter.type.value}, narrowed to {_with_unit(parameter, end)}')
    return replace(parameter, **ends) if ends else parameter  # type: ignore[arg-type]


def _with_unit(parameter: Parameter, value: Value) -> str:
    text = show(value if parameter.scaled else round(value))
    return f'{text} {parameter.unit}' if parameter.unit else text
