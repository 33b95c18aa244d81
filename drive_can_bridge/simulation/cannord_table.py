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
examples in the manuals use plain ones. The motor obeys the values of the *active* parameter set.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.cannord.parameter_frame import (
    NUMBER_MAX, ParameterFrame, Response, Task,
)
from drive_can_bridge.simulation.plant import Refusal
from drive_can_bridge.simulation.registers import Refused, Registers

(INVALID_NUMBER, CANNOT_BE_CHANGED, LIMIT_EXCEEDED, WRONG_SUBINDEX, NOT_AN_ARRAY, INVALID_TYPE,
 ) = range(6)
INVALID_TASK, CANNOT_BE_REPRESENTED = 201, 202

_NEGATIVE = 0xFFFF
_LIMITS = (Refusal.OUT_OF_RANGE, Refusal.CROSSED)


@dataclass
class Group:
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


def groups_of(parameters: Mapping[str, Parameter]) -> dict[int, Group]:
    groups: dict[int, Group] = {}
    for parameter in parameters.values():
        if parameter.number is None or parameter.number > NUMBER_MAX:
            continue
        group = groups.setdefault(parameter.number, Group())
        group.members[parameter.subindex or 0] = parameter
        group.plain = group.plain or parameter.subindex is None
    return groups


class CannordTable:
    """Everything that the parameter channel reaches."""

    def __init__(self, registers: Registers) -> None:
        self._registers = registers
        self._groups = groups_of(registers.parameters)
        self._active = 1

    def answer(self, task: ParameterFrame) -> tuple[Response, int]:
        """
        Carry out a task.

        :return: response identifier, and the value, negative where it is.
        :raises Refused: with the error number of the manual.
        """
        if task.identifier not in list(Task):
            raise Refused(INVALID_TASK)
        what = Task(task.identifier)
        if what == Task.NONE:
            return Response.NONE, 0
        group = self._groups.get(task.number)
        if group is None:
            raise Refused(INVALID_NUMBER)
        if (what.array or what is Task.READ_ELEMENTS) and not group.array:
            raise Refused(NOT_AN_ARRAY)
        if what == Task.READ_ELEMENTS:
            return Response.ELEMENTS, max(group.members) + 1
        # The manuals contradict each other on a sub-index in plain tasks: where there is something
        # to choose, it counts here, as in their examples; a simple parameter has no use for it.
        parameter = group.members.get(task.index if group.array else 0)
        if parameter is None:
            raise Refused(WRONG_SUBINDEX)
        if what.writes:
            self._write(parameter, task.value, double=what.double,
                        eeprom=bool(what.persistent))
        elif not parameter.readable:
            raise Refused(CANNOT_BE_REPRESENTED)
        response = next(each for each in what.responses
                        if each.double is (parameter.type.bits == 32))
        return response, self._registers.raw(parameter.name)

    def select_set(self, parameter_set: int) -> None:
        """Make a parameter set, 1 to 4, the active one."""
        if parameter_set == self._active:
            return
        self._active = parameter_set
        for group in self._groups.values():
            active = group.members.get(parameter_set - 1)
            if group.sets and active is not None:
                self._registers.stand_ins[group.members[0].name] = active.name

    def name_of(self, raw: Parameter) -> str | None:
        """Return the name of the parameter with a number and sub-index; None: there is none."""
        parameter = self.numbered(raw.number or 0, raw.subindex or 0)
        return parameter.name if parameter else None

    def numbered(self, number: int, subindex: int = 0) -> Parameter | None:
        """Return the parameter with a number and sub-index; None: there is none."""
        group = self._groups.get(number)
        return group.members.get(subindex) if group else None

    def _write(self, parameter: Parameter, value: int, *, double: bool, eeprom: bool) -> None:
        if (parameter.type.bits == 32) is not double:
            raise Refused(INVALID_TYPE)
        high, low = value >> 16, value & 0xFFFF
        if not double and high not in (0, _NEGATIVE):
            raise Refused(LIMIT_EXCEEDED)
        # a negative word says so in the upper half, or comes without anything there
        raw = low - 0x10000 if high and not double else parameter.raw_from_word(value)
        refusal = self._registers.refusal({parameter.name: raw})
        if refusal is not None:
            raise Refused(LIMIT_EXCEEDED if refusal in _LIMITS else CANNOT_BE_CHANGED)
        self._registers.write(parameter.name, raw, keep=eeprom, wear=int(eeprom))
