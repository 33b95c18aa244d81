# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The parameters of a simulated NORD inverter, by number and sub-index: sets, arrays, EEPROM.

What kind of parameter a number is follows from the entries of the profile that have it:

============================================ ======================================================
entries                                      kind
============================================ ======================================================
one without ``subindex``                     simple
all with ``subindex``                        array; element = sub-index
one without, others with ``subindex``        one value per parameter set; the one without is set 1,
                                             sub-index 1 to 3 are the sets 2 to 4
============================================ ======================================================

A sub-index counts in array tasks and in plain ones: the rule in the manuals wants array tasks,
examples in the manuals use plain ones.

The values of parameter sets are kept here; the register of set 1 in the plant always holds the
value of the *active* set, so that the motor obeys it.
"""

from dataclasses import dataclass, field
import re

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import Parameter, ParameterType, Value
from drive_can_bridge.protocols.cannord.parameter_frame import (
    NUMBER_MAX, ParameterFrame, Response, Task, WRITE_TASKS,
)
from drive_can_bridge.simulation.cannord_plant import InverterPlant
from drive_can_bridge.simulation.scales import RawRange

INVALID_NUMBER = 0
CANNOT_BE_CHANGED = 1
LIMIT_EXCEEDED = 2
WRONG_SUBINDEX = 3
NOT_AN_ARRAY = 4
INVALID_TYPE = 5
INVALID_TASK = 201
CANNOT_BE_REPRESENTED = 202

_RAW_NAME = re.compile(r'p([0-9]{1,4})(?:\.([0-9]{1,3}))?', re.ASCII)
_WRITES = {task: how for how, task in WRITE_TASKS.items()}
_ARRAY_READS = (Task.READ_ARRAY, Task.READ_ELEMENTS)
_NEGATIVE = 0xFFFF


class Refused(Exception):
    """The task cannot be executed; the argument is the error number."""


@dataclass
class _Group:
    """All entries with one number, by sub-index; one without a sub-index counts as 0."""

    members: dict[int, Parameter] = field(default_factory=dict)
    plain: bool = False

    @property
    def array(self) -> bool:
        """Array tasks are possible."""
        return not self.plain or len(self.members) > 1

    @property
    def sets(self) -> bool:
        """Each parameter set has a value of its own."""
        return self.plain and len(self.members) > 1


class CannordTable:
    """
    Everything that the parameter channel reaches.

    :param parameters: the table of the profile, complete.
    :param plant: has the registers; those of the sets 2 to 4 are not among them.
    :ivar eeprom_writes: EEPROM cells written.
    """

    def __init__(self, parameters: dict[str, Parameter], plant: InverterPlant) -> None:
        self._parameters = parameters
        self._plant = plant
        self._groups = groups_of(parameters)
        self._sets: dict[str, int] = {}
        self._active = 0
        self.eeprom_writes = 0
        for group in self._groups.values():
            if group.sets:
                initial = plant.raw(group.members[0].name)
                for member in group.members.values():
                    self._sets[member.name] = RawRange(member, limits=True).clamp(initial)
        self._kept = {
            member.name: self._raw(member.name) for group in self._groups.values()
            for member in group.members.values() if member.writable}

    # -- the parameter channel --------------------------------------------------------------------

    def answer(self, task: ParameterFrame) -> tuple[Response, int]:
        """
        Carry out a task.

        :return: response identifier, and the value, negative where it is.
        :raises Refused: with the error number of the manual.
        """
        try:
            what = Task(task.identifier)
        except ValueError:
            raise Refused(INVALID_TASK) from None
        if what is Task.NONE:
            return Response.NONE, 0
        group = self._groups.get(task.number)
        if group is None:
            raise Refused(INVALID_NUMBER)
        array, double, eeprom = _WRITES.get(what, (what in _ARRAY_READS, False, False))
        if array and not group.array:
            raise Refused(NOT_AN_ARRAY)
        if what is Task.READ_ELEMENTS:
            return Response.ELEMENTS, max(group.members) + 1
        # The manuals contradict each other on a sub-index in plain tasks: where there is something
        # to choose, it counts here, as in their examples; a simple parameter has no use for it.
        parameter = group.members.get(task.index if group.array else 0)
        if parameter is None:
            raise Refused(WRONG_SUBINDEX)
        if what in _WRITES:
            self._write(parameter, task.value, double=double, eeprom=eeprom)
        elif not parameter.readable:
            raise Refused(CANNOT_BE_REPRESENTED)
        wide = parameter.type.bits == 32
        if array:
            response = Response.ARRAY_DOUBLE if wide else Response.ARRAY_WORD
        else:
            response = Response.DOUBLE if wide else Response.WORD
        return response, self._raw(parameter.name)

    def select_set(self, parameter_set: int) -> None:
        """Make a parameter set, 1 to 4, the active one."""
        if parameter_set - 1 != self._active:
            self._active = parameter_set - 1
            for group in self._groups.values():
                self._put_into_force(group)

    def power_on(self) -> None:
        """Fetch from EEPROM what it keeps."""
        self._active = 0
        for name, raw in self._kept.items():
            self._store(name, raw)

    # -- by hand ----------------------------------------------------------------------------------

    def name_of(self, name: str) -> str | None:
        """Return the profile's name of a parameter, also of ``p102`` and ``p102.1``, or None."""
        if name in self._parameters:
            return name
        match = _RAW_NAME.fullmatch(name)
        if match is None:
            return None
        group = self._groups.get(int(match[1]))
        parameter = group and group.members.get(int(match[2] or 0))
        return parameter.name if parameter else None

    def numbered(self, number: int) -> Parameter | None:
        """Return the parameter of a number, the first element of an array."""
        group = self._groups.get(number)
        return group.members.get(0) if group else None

    def value(self, name: str) -> Value:
        """Return a value as a physical one."""
        return self._parameters[name].value_from_raw(self._raw(name))

    def set_value(self, name: str, value: Value) -> None:
        """
        Set a value as if at the panel of the inverter; it stays after a loss of power.

        :raises ValueRefused: the value does not fit.
        """
        if name in self._sets:
            self._store(name, self._parameters[name].raw_from_value(value), by_hand=True)
        else:
            self._plant.set_value(name, value)
        if name in self._kept:
            self._kept[name] = self._raw(name)

    # -- inside -----------------------------------------------------------------------------------

    def _write(self, parameter: Parameter, value: int, *, double: bool, eeprom: bool) -> None:
        if (parameter.type.bits == 32) is not double:
            raise Refused(INVALID_TYPE)
        if not parameter.writable:
            raise Refused(CANNOT_BE_CHANGED)
        raw = value if double else _word(value)
        # a negative number also comes without its sign in the upper half
        raw = parameter.raw_from_word(raw) if raw >= 0 else raw
        low, high = parameter.type.raw_range
        if not low <= raw <= high:
            raise Refused(LIMIT_EXCEEDED)
        try:
            if parameter.type is not ParameterType.BOOL:
                parameter.check_limits(float(parameter.value_from_raw(raw)))
        except ValueRefused:
            raise Refused(LIMIT_EXCEEDED) from None
        self._store(parameter.name, raw)
        if eeprom:
            self.eeprom_writes += 1
            self._kept[parameter.name] = self._raw(parameter.name)

    def _raw(self, name: str) -> int:
        raw = self._sets.get(name)
        return self._plant.raw(name) if raw is None else raw

    def _store(self, name: str, raw: int, *, by_hand: bool = False) -> None:
        if name not in self._sets:
            self._plant.write(name, raw)
        elif by_hand or name not in self._plant.stuck:
            self._sets[name] = raw
            number = self._parameters[name].number
            if number is not None:
                self._put_into_force(self._groups[number])

    def _put_into_force(self, group: _Group) -> None:
        if group.sets and self._active in group.members:
            active = group.members[self._active].name
            self._plant.write(group.members[0].name, self._sets[active])


def groups_of(parameters: dict[str, Parameter]) -> dict[int, _Group]:
    """Collect the entries of a profile by number."""
    groups: dict[int, _Group] = {}
    for parameter in parameters.values():
        if parameter.number is None or parameter.number > NUMBER_MAX:
            continue
        group = groups.setdefault(parameter.number, _Group())
        group.members[parameter.subindex or 0] = parameter
        group.plain = group.plain or parameter.subindex is None
    return groups


def without_other_sets(parameters: dict[str, Parameter]) -> dict[str, Parameter]:
    """Return the table without the entries that stand for parameter sets 2 to 4."""
    other = {member.name for group in groups_of(parameters).values() if group.sets
             for index, member in group.members.items() if index != 0}
    return {name: parameter for name, parameter in parameters.items() if name not in other}


def _word(value: int) -> int:
    """
    Return the number in a word task: negative where the upper half says so.

    :raises Refused: the upper half holds anything else.
    """
    high, low = value >> 16, value & 0xFFFF
    if high == _NEGATIVE:
        return low - 0x10000
    if high:
        raise Refused(LIMIT_EXCEEDED)
    return low
