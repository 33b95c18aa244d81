# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""One drive, asked through its node of a running bridge."""

from collections.abc import Callable, Iterator, Sequence

from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParameters

from drive_can_bridge.client.bridged.descriptors import (
    message_of, parameter_of, raw_of, role_of,
)
from drive_can_bridge.client.drive import (
    Drive, DriveFacts, Enabled, ReadOutcome, WriteOutcome,
)
from drive_can_bridge.core.directory import ParameterDirectory
from drive_can_bridge.core.parameters import Parameter, Value
from drive_can_bridge.core.roles import Role
from drive_can_bridge.ros.client.graph import Graph
from drive_can_bridge.ros.messages import drive_value, facts_of

#: parameters that are read with one call
BLOCK = 16
_NO_VALUE = 'no value; the log of the bridge says why'
#: s beyond its period that a diagnostic message may take
_DIAGNOSTICS_MARGIN = 5.0
_ENABLED = {'online': Enabled.YES, 'not armed': Enabled.YES, 'disabled': Enabled.NO,
            'fault': Enabled.NO}


class BridgedDrive(Drive):
    """
    One drive.

    :param node: full name of its node.
    :param table: the parameters that it lists.
    :param roles: what the bridge uses them for.
    :param period: s between diagnostic messages of the bridge.
    :param identity: asks the bridge who a drive is.
    """

    def __init__(self, graph: Graph, node: str, facts: DriveFacts, table: dict[str, Parameter],
                 roles: dict[str, Role], period: float, identity: Callable[[str], str]) -> None:
        super().__init__(facts, ParameterDirectory(table, self._raw_parameter))
        self._graph = graph
        self._node = node
        self._roles = roles
        self._period = period
        self._identity = identity
        self._raw: dict[str, Parameter | None] = {}

    def _raw_parameter(self, name: str) -> Parameter | None:
        if name not in self._raw:
            message, = self._describe([name])
            self._raw[name] = parameter_of(message, listed=False)
            role = role_of(message)
            if role is not None:
                self._roles[name] = role
        return self._raw[name]

    def role(self, name: str) -> Role | None:
        return None if self.find(name) is None else self._roles.get(name)

    def write_refusal(self, name: str, parameter: Parameter) -> str:
        role = self.role(name)
        if parameter.writable and role is Role.CONTROL:
            return 'use ~/enable'
        if parameter.writable and role is Role.CYCLIC:
            own = next((each.name for each in self._directory.twins(parameter)), name)
            return f'sent cyclically: publish ~/command/{own}'
        if role is Role.MAP:
            return 'mapping parameter: not written while the bridge is active'
        return ''

    def ask(self, asked: Sequence[tuple[str, Parameter]]) -> Iterator[ReadOutcome]:
        for start in range(0, len(asked), BLOCK):
            yield from self._get(asked[start:start + BLOCK])

    def _get(self, asked: Sequence[tuple[str, Parameter]]) -> list[ReadOutcome]:
        names = [name for name, _ in asked]
        answer = self._graph.call(self._node, 'get_parameters',
                                  GetParameters.Request(names=names))
        values = dict(zip(names, map(drive_value, answer.values)))
        missing = [name for name in names if values.get(name) is None]
        reasons = dict(zip(missing, self._reasons(missing)))
        made = []
        for name, parameter in asked:
            value = values.get(name)
            if value is None:
                made.append(ReadOutcome(name, parameter, reason=reasons.get(name, _NO_VALUE)))
            else:
                made.append(ReadOutcome(name, parameter, raw_of(parameter, value), value))
        return made

    def _reasons(self, names: Sequence[str]) -> list[str]:
        """Ask why there is no value."""
        if not names:
            return []
        return [facts_of(message).get('error') or _NO_VALUE for message in self._describe(names)]

    def _describe(self, names: Sequence[str]) -> list[object]:
        answer = self._graph.call(self._node, 'describe_parameters',
                                  DescribeParameters.Request(names=list(names)))
        return list(answer.descriptors)

    def put(self, name: str, parameter: Parameter, value: Value, *, blind: bool) -> WriteOutcome:
        # the bridge tries what is offline, too
        answer = self._graph.call(self._node, 'set_parameters', SetParameters.Request(
            parameters=[message_of(name, parameter, value)]))
        result, = answer.results
        return WriteOutcome(name, result.successful, parameter, result.reason)

    def enabled(self) -> Enabled:
        facts = self._graph.newest_status(f'{self.facts.through.lstrip("/")}: drive {self.name}',
                                          age=self._period, patience=_DIAGNOSTICS_MARGIN)
        if 'control_state' not in facts:
            return Enabled.UNKNOWN
        return _ENABLED.get(facts.get('state', ''), Enabled.UNKNOWN)

    def identity(self) -> str:
        return self._identity(self.name)
