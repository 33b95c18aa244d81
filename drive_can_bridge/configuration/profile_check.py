# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
From the tree of a profile, section by section, to a parameter table.

Checked here is what holds for every drive that uses the profile. What a protocol family cannot do
with it the family checks, see :meth:`drive_can_bridge.protocols.family.Family.check`.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
import re
from typing import Any

from drive_can_bridge.configuration.problems import Path, Problem, Tree
from drive_can_bridge.configuration.schema import check_schema, checked_profile
from drive_can_bridge.core import complaints
from drive_can_bridge.core.complaints import suggestion, suggestion_of_profile
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.messages import NOTHING
from drive_can_bridge.core.parameters import (
    AccessMode, Parameter, ParameterType, STEP_TOLERANCE, Storage, Value, ValueKind)
from drive_can_bridge.core.profile import (
    ControlTable, FaultTable, Profile, RestoreStep, RestoreTable, StatusPattern)
from drive_can_bridge.core.text import show
from drive_can_bridge.protocols.families import FAMILIES

#: names that a drive's node uses itself
RESERVED = frozenset((
    'online', 'response', 'request', 'command', 'joint_state', 'joint_command',
    'get_parameters', 'set_parameters', 'set_parameters_atomically', 'list_parameters',
    'describe_parameters', 'get_parameter_types', 'enable', 'reset_fault', 'quick_stop',
    'home',
))
#: what the keys of a parameter hold
_MADE: dict[str, Callable[[Any], Any]] = {
    'type': ParameterType, 'access': AccessMode, 'storage': Storage,
    'bits': lambda bits: tuple(bits.items()), 'values': lambda given: (),
    **dict.fromkeys(('scale', 'offset', 'minimum', 'maximum', 'arming_tolerance'), float)}
#: looks like the name of a parameter that is in no profile
RAW_NAME = re.compile(r'p[0-9]+|x[0-9a-f]+', re.ASCII)


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
            tree.wrong(('control', 'parameter'), complaints.read_only_one(name=parameter.name))
        largest = _largest_word(parameter)
        for key, word in words.items():
            if word > largest:
                tree.wrong(('control', 'words', key), complaints.word_too_large(
                    word=word, name=parameter.name, largest=largest, type=parameter.type.value))
    for key, word in words.items():     # only ~/enable starts a drive
        if key != 'enable' and word == words.get('enable'):
            tree.wrong(('control', 'words', 'enable'), complaints.word_twice(word=word, entry=key))
    if isinstance(control.get('status'), dict):
        _check_status(tree, control['status'], parameters, names)


def look_up(tree: Tree, path: Path, name: str | None, parameters: dict[str, Parameter],
            names: tuple[str, ...], *, at: Path | None = None) -> Parameter | None:
    """
    Return the parameter that a section names, if it is all right.

    One with problems of its own is known.
    """
    if name is not None and name not in names and not tree.is_damaged(('parameters',)):
        tree.wrong(path, complaints.unknown(name=name, hint=suggestion_of_profile(name, names)),
                   at=at)
    return parameters.get(name or '')


def _check_status(tree: Tree, status: dict[str, Any], parameters: dict[str, Parameter],
                  names: tuple[str, ...]) -> None:
    path = ('control', 'status')
    parameter = look_up(tree, (*path, 'parameter'), status.get('parameter'), parameters, names)
    if parameter is not None and not parameter.readable:
        tree.wrong((*path, 'parameter'), complaints.write_only_one(name=parameter.name))
    for key in ('ready', 'enabled', 'fault'):
        if key not in status:
            continue
        mask, value = status[key]
        if parameter is not None and mask > _largest_word(parameter):
            tree.wrong((*path, key), complaints.mask_too_large(
                mask=mask, name=parameter.name, largest=_largest_word(parameter),
                type=parameter.type.value))
        if mask == 0:
            tree.wrong((*path, key), complaints.mask_of_nothing())
        elif value & ~mask:
            tree.wrong((*path, key), complaints.outside_mask(value=value, mask=mask))


def _largest_word(parameter: Parameter) -> int:
    return 1 if parameter.type is ParameterType.BOOL else (1 << parameter.type.bits) - 1


def control_table(control: dict[str, Any]) -> ControlTable:
    """Return the table of a section without a fault."""
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
_NUMBER = re.compile(r'[+-]?(0[xX][0-9a-fA-F]+|[0-9.]+([eE][+-]?[0-9]+)?)')
_NEXT = re.compile(r'(^| )-?[0-9]+:')


def check_values(tree: Tree, path: Path, parameter: Parameter, entry: dict[str, Any]) -> None:
    """Check the names of a parameter's values."""
    if 'values' not in entry:
        return
    if parameter.scaled or parameter.type is ParameterType.BOOL:
        kind = 'a bool' if parameter.type is ParameterType.BOOL else 'a number with a unit'
        tree.wrong((*path, 'values'), complaints.no_value_names(name=parameter.name, kind=kind))
        return
    check_names(tree, (*path, 'values'), entry['values'], parameter)


def check_names(tree: Tree, path: Path, given: dict[str, Any],
                parameter: Parameter | None) -> None:
    """
    Check names by integers.

    :param parameter: the parameter of these raw integers; None: it is unknown.
    """
    numbers: dict[int, str] = {}
    names: dict[str, str] = {}
    for key, name in given.items():
        here, number = (*path, key), int(key, 0)
        low, high = (-2**31, 2**32 - 1) if parameter is None else parameter.type.raw_range
        if not low <= number <= high:
            tree.wrong(here, complaints.does_not_fit(entry=key, low=low, high=high))
        elif number in numbers:
            tree.wrong(here, complaints.number_twice(entry=key, other=numbers[number]))
        numbers.setdefault(number, key)
        if isinstance(name, bool):
            word = 'true, on or yes' if name else 'false, off or no'
            tree.wrong(here, complaints.word_is_bool(word=word))
        elif not isinstance(name, str):
            tree.wrong(here, complaints.is_number(name=name))
        elif (len(name) > NAME_MAX or not _NAME.fullmatch(name) or _NUMBER.fullmatch(name)
              or _NEXT.search(name)):
            tree.wrong(here, complaints.no_name(name=name, longest=NAME_MAX))
        elif name in names:
            tree.wrong(here, complaints.name_of_other(name=name, other=names[name]))
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
        tree.wrong(path, complaints.write_only_one(name=parameter.name))
    elif parameter is not None and parameter.type is ParameterType.BOOL:
        tree.wrong(path, complaints.is_bool(name=parameter.name))
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
        tree.wrong(path, (complaints.no_bit(bit=bit, name=name, hint=suggestion(bit, bits)) if bits
                          else complaints.no_named_bits(name=name)))


def fault_table(section: dict[str, Any], parameters: dict[str, Parameter]) -> FaultTable:
    """Return the table of a section without a fault."""
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
            tree.wrong(('identity',), complaints.twice(name=name), at=at)
            continue
        parameter = look_up(tree, ('identity',), name, parameters, names, at=at)
        if parameter is not None and not parameter.readable:
            tree.wrong(('identity',), complaints.write_only(name=name), at=at)
        seen.add(name)


def check_restore(tree: Tree, parameters: dict[str, Parameter], names: tuple[str, ...]) -> None:
    """Check the ``restore`` section likewise."""
    for phase, name, value in _steps(tree):
        path = ('restore', phase, name)
        parameter = look_up(tree, path, name, parameters, names)
        if parameter is None:
            continue
        if not parameter.writable:
            tree.wrong(path, complaints.read_only(name=name))
        elif isinstance(value, dict):
            _check_bits(tree, path, parameter, value)
        else:
            try:
                parameter.raw_from_value(value)
            except ValueRefused:
                allowed = 'true or false' if parameter.type is ParameterType.BOOL \
                    else parameter.range_text
                tree.wrong(path, complaints.cannot_be_written(value=value, allowed=allowed))


def restore_table(tree: Tree, parameters: dict[str, Parameter]) -> RestoreTable:
    """Return the table of the section; empty where anything in it is wrong."""
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
            tree.wrong((*path, bit), complaints.no_bit(
                bit=bit, name=parameter.name, hint=suggestion(bit, known)))
    if not parameter.readable:
        tree.wrong(path, complaints.write_only_bits(name=parameter.name))


def _steps(tree: Tree) -> Iterator[tuple[str, str, Any]]:
    section = tree.data.get('restore')
    for phase in _PHASES:
        steps = section.get(phase) if isinstance(section, dict) else None
        if isinstance(steps, dict):
            for name, value in steps.items():
                yield phase, name, value


@dataclass(frozen=True, slots=True)
class LoadedProfile:
    """
    A profile with everything in it that is right.

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
    """Check a profile, and return what of it can be used."""
    given = tree.data.get('parameters')
    names = tuple(map(str, given)) if isinstance(given, dict) else ()
    check_schema(tree, checked_profile())
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
            built_in = any(FAMILIES[name].control_built_in
                           for name in tree.data.get('protocols', ()) if name in FAMILIES)
            if control is None and fault.bit is None and not built_in and not (
                    tree.is_damaged(('control',))):
                tree.suspicious(('fault',), complaints.fault_without_bit())
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
    """Name the values of a control word in short words, wherever it is shown."""
    parameter = parameters.get(name)
    if parameter is not None and not parameter.values and parameter.kind is ValueKind.INTEGER:
        parameters[name] = replace(parameter, values=tuple(
            (parameter.raw_from_word(word), text.removeprefix('quick_').partition('_')[0])
            for text, word in words.items()))


def _name_faults(parameters: dict[str, Parameter], fault: FaultTable) -> None:
    """Name the values of a fault number, wherever it is shown."""
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
            tree.wrong(place, complaints.name_taken(name=name))
        elif RAW_NAME.fullmatch(name):
            tree.wrong(place, complaints.raw_name(name=name))


# -- parameters -----------------------------------------------------------------------------------


def _check_parameter(tree: Tree, path: Path, parameter: Parameter, entry: dict[str, Any]) -> None:
    width = parameter.type.bits
    if parameter.type is ParameterType.BOOL:
        width = 1
        for key in ('scale', 'offset', 'unit', 'minimum', 'maximum', 'neutral_from',
                    'arming_tolerance'):
            if key in entry:
                tree.wrong((*path, key), complaints.bool_has_no(entry=key))
        if 'neutral' in entry and not isinstance(entry['neutral'], bool):
            tree.wrong((*path, 'neutral'), complaints.no_bool(value=entry['neutral']))
    else:
        _check_limits(tree, path, parameter, entry)
    for bit, position in parameter.bits:
        if position >= width:
            tree.wrong((*path, 'bits', bit), complaints.no_such_bit(
                position=position, type=parameter.type.value, highest=width - 1))
    if parameter.word_order is not None and parameter.type.bits != 32:
        tree.wrong((*path, 'word_order'), complaints.one_word(type=parameter.type.value))


def _check_neutral_from(tree: Tree, path: Path, parameter: Parameter,
                        entry: dict[str, Any]) -> None:
    """Check a setpoint that stays where the axis is."""
    if not parameter.neutral_from or not tree.is_sound((*path, 'neutral_from')):
        return
    if 'neutral' in entry:
        tree.wrong((*path, 'neutral'), complaints.beside_neutral_from())
    if 'arming_tolerance' not in entry and not tree.is_damaged((*path, 'arming_tolerance')):
        tree.wrong((*path, 'neutral_from'), complaints.no_arming_tolerance())
    if not parameter.writable:
        tree.wrong((*path, 'neutral_from'), complaints.read_only_in(name=parameter.name))


def _check_limit(tree: Tree, path: Path, parameter: Parameter, entry: dict[str, Any]) -> None:
    """Check a limit."""
    if not parameter.limit:
        return
    if 'neutral_from' in entry:
        tree.wrong((*path, 'limit'), complaints.beside_neutral_from())
    elif 'neutral' not in entry and not tree.is_damaged((*path, 'neutral')):
        tree.wrong((*path, 'limit'), complaints.no_neutral_of_limit())
    if not parameter.writable:
        tree.wrong((*path, 'limit'), complaints.read_only_in(name=parameter.name))


def _check_measured(tree: Tree, parameters: dict[str, Parameter], names: tuple[str, ...]) -> None:
    """Check that ``neutral_from`` names actual values that a setpoint can be compared with."""
    known = dict(parameters)
    for parameter in known.values():
        name, path = parameter.neutral_from, ('parameters', parameter.name, 'neutral_from')
        measured = parameters.get(name)
        if not name or (measured is None and name in names):     # wrong itself
            continue
        message = NOTHING
        if measured is None:
            message = complaints.not_in_profile(name=name, hint=suggestion_of_profile(
                name, [each for each in names if each not in known
                       or _fits(known[each], parameter)] or names))
        elif measured is parameter or not measured.readable:
            message = complaints.no_actual_value(name=name)
        elif measured.type is ParameterType.BOOL:
            message = complaints.is_bool(name=name)
        elif measured.unit != parameter.unit:
            message = complaints.other_unit(
                name=name, unit=_unit_text(measured), wanted=_unit_text(parameter),
                parameter=parameter.name)
        if message:
            tree.wrong(path, message)
            del parameters[parameter.name]


def _fits(measured: Parameter, setpoint: Parameter) -> bool:
    """Return whether a setpoint may stay at what is measured."""
    return (measured is not setpoint and measured.readable and not measured.writable
            and measured.type is not ParameterType.BOOL and measured.unit == setpoint.unit)


def _unit_text(parameter: Parameter) -> str:
    return f'the unit {show(parameter.unit)}' if parameter.unit else 'no unit'


def _check_limits(tree: Tree, path: Path, parameter: Parameter, entry: dict[str, Any]) -> None:
    """Check that minimum, neutral and maximum are in this order, and that they can be sent."""
    limits = {key: entry[key] for key in ('minimum', 'maximum') if key in entry}
    if not parameter.scaled:
        for key, limit in limits.items():
            if float(limit) != int(limit):
                tree.wrong((*path, key), complaints.no_integer(limit=limit))
    low, high = parameter.raw_limits
    if len(limits) == 2 and limits['minimum'] > limits['maximum']:
        tree.wrong((*path, 'minimum'), complaints.above_maximum(
            minimum=limits['minimum'], maximum=limits['maximum']))
    elif low > high and all(tree.is_sound((*path, key)) for key in limits):
        scale = f' with scale {parameter.scale:g}' if 'scale' in entry and low == high + 1 else ''
        tree.wrong((*path, next(iter(limits))), complaints.no_value_between(
            type=parameter.type.value, scale=scale, limits=parameter.range_text,
            nearest=_with_unit(parameter, _nearest(parameter))))
    if isinstance(entry.get('neutral'), bool):
        tree.wrong((*path, 'neutral'), complaints.is_bool(name=entry['neutral']))
    elif parameter.neutral is not None and all(tree.is_sound((*path, key)) for key in limits):
        try:
            parameter.raw_from_value(parameter.neutral)
        except ValueRefused:
            kind = '' if parameter.scaled else 'an integer, '
            tree.wrong((*path, 'neutral'), complaints.cannot_be_sent(
                name=parameter.neutral, kind=kind, allowed=parameter.range_text))


def _nearest(parameter: Parameter) -> Value:
    """Return the value next to limits that have none between them."""
    first, last = parameter.type.raw_range
    values = [parameter.value_from_raw(min(max(raw, first), last))
              for raw in sorted(parameter.raw_limits)]
    limits = [limit for limit in (parameter.minimum, parameter.maximum) if limit is not None]
    return min(values, key=lambda value: min(abs(value - limit) for limit in limits))


def _narrowed(tree: Tree, path: Path, parameter: Parameter) -> Parameter:
    """Reduce limits that the type cannot hold to its range, with a warning."""
    slack = abs(parameter.scale) * STEP_TOLERANCE
    low, high = parameter.value_range
    ends: dict[str, float] = {}
    if parameter.minimum is not None and parameter.minimum < low - slack:
        ends['minimum'] = low
    if parameter.maximum is not None and parameter.maximum > high + slack:
        ends['maximum'] = high
    for key, end in ends.items():
        limit = tree.data['parameters'][parameter.name][key]
        tree.suspicious((*path, key), complaints.narrowed(
            limit=limit, type=parameter.type.value, end=_with_unit(parameter, end)))
    return replace(parameter, **ends) if ends else parameter  # type: ignore[arg-type]


def _with_unit(parameter: Parameter, value: Value) -> str:
    text = show(value if parameter.scaled else round(value))
    return f'{text} {parameter.unit}' if parameter.unit else text
