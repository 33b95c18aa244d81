# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Drives through a running bridge."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
import json
from typing import Any, TYPE_CHECKING

from drive_can_bridge.client.drive import (
    Drive, DriveFacts, Drives, Enabled, ReadOutcome, WriteOutcome)
from drive_can_bridge.client.way import Described, Way
from drive_can_bridge.core import sentences
from drive_can_bridge.core.directory import ParameterDirectory
from drive_can_bridge.core.errors import NoAnswer
from drive_can_bridge.core.parameters import (
    AccessMode, Parameter, ParameterType as WireType, Storage, Value, ValueKind)
from drive_can_bridge.core.requests import kind_of
from drive_can_bridge.core.roles import controlled_by, Role
from drive_can_bridge.core.text import facts_in, printable, taken_apart

if TYPE_CHECKING:   # read it is not needed
    from drive_can_bridge.core.profile import RestoreTable

_TYPES = {ValueKind.DOUBLE: float, ValueKind.INTEGER: int, ValueKind.BOOL: bool}


def parameter_of(message: Described, *, listed: bool = True) -> Parameter | None:
    """Return the parameter of a descriptor; None: no parameter of a drive."""
    facts = facts_in(message.facts)
    if 'access' not in facts:
        return None
    try:
        minimum, maximum = (message.minimum, message.maximum) if listed else (None, None)
        made = Parameter(
            name=message.name,
            type=WireType(facts['type']) if 'type' in facts else WireType.UINT32,
            number=_number(facts, 'number'), scale=float(facts.get('scale', 1.0)),
            offset=float(facts.get('offset', 0.0)), unit=facts.get('unit', ''),
            access=AccessMode(facts['access']),
            storage=Storage(facts['storage']) if 'storage' in facts else None,
            minimum=minimum, maximum=maximum,
            subindex=_number(facts, 'subindex'), index=_number(facts, 'index'),
            scaled='scale' in facts, listed=listed, protected=facts.get('protected') == 'true',
            width_known='type' in facts, values=taken_apart(facts.get('values', '')))
    except ValueError:
        return None
    text = printable(message.text)
    end = text.rfind(f' ({made.address}')
    return replace(made, description=text[:end] if end > 0 and listed else '')


def role_of(message: Described) -> Role | None:
    """Return what the bridge uses a parameter for."""
    role = facts_in(message.facts).get('role')
    return next((each for each in Role if each.value == role), None)


def _number(facts: dict[str, str], key: str) -> int | None:
    return int(facts[key], 0) if key in facts else None


#: parameters that are read with one call
BLOCK = 16
_NO_VALUE = sentences.no_value()
#: s beyond its period that a diagnostic message may take
_DIAGNOSTICS_MARGIN = 5.0
_ENABLED = {'online': Enabled.YES, 'not armed': Enabled.YES, 'disabled': Enabled.NO,
            'fault': Enabled.NO}
#: parts of a ``control_state`` in which a motor may move, whatever the drive is commanded
_MOVING = ('enabled', 'enable sent', 'quick stop', 'fault reaction')


class BridgedDrive(Drive):
    """
    One drive of a bridge.

    :param name: of the drive.
    :param way: to its bridge.
    :param node: full name of its node.
    :param table: the parameters that it lists.
    :param roles: what the bridge uses them for.
    :param knowledge: reads the rest from the bridge.
    """

    def __init__(self, name: str, way: Way, node: str, table: dict[str, Parameter],
                 roles: dict[str, Role], knowledge: 'BridgeSource') -> None:
        super().__init__(name, lambda: knowledge.facts(name),
                         ParameterDirectory(table, self._raw_parameter))
        self._way = way
        self._node = node
        self._roles = roles
        self._knowledge = knowledge
        self._raw: dict[str, Parameter | None] = {}

    def _raw_parameter(self, name: str) -> Parameter | None:
        # no parameter is called so, and not all of it can be sent
        if not name.isascii() or '\0' in name:
            return None
        if name not in self._raw:
            message, = self._way.describe(self._node, [name])
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
            return controlled_by(parameter)
        if parameter.writable and role is Role.CYCLIC:
            own = next((each.name for each in self._directory.twins(parameter)), name)
            return sentences.sent_cyclically(own)
        if role is Role.MAP:
            return sentences.mapping_parameter()
        return ''

    def ask(self, asked: Sequence[tuple[str, Parameter]]) -> Iterator[ReadOutcome]:
        for start in range(0, len(asked), BLOCK):
            yield from self._get(asked[start:start + BLOCK])

    def _get(self, asked: Sequence[tuple[str, Parameter]]) -> list[ReadOutcome]:
        names = [name for name, _ in asked]
        values = {name: value for name, value in zip(names, self._way.get(self._node, names))
                  if isinstance(value, (bool, int, float))}
        missing = [name for name in names if values.get(name) is None]
        reasons = dict(zip(missing, self._reasons(missing)))
        made = []
        for name, parameter in asked:
            value = values.get(name)
            if value is None:
                reason = reasons.get(name, _NO_VALUE)
                made.append(ReadOutcome(name, parameter, reason=reason, kind=kind_of(reason)))
            else:
                raw = round(parameter.steps(value)) if parameter.scaled else int(value)
                made.append(ReadOutcome(name, parameter, raw, value))
        return made

    def _reasons(self, names: Sequence[str]) -> list[str]:
        """Read why there is no value."""
        if not names:
            return []
        return [facts_in(message.facts).get('error') or _NO_VALUE
                for message in self._way.describe(self._node, names)]

    def put(self, name: str, parameter: Parameter, value: Value, *, blind: bool) -> WriteOutcome:
        # the bridge tries what is offline, too
        try:
            done, reason = self._way.set(self._node, name, _TYPES[parameter.kind](value))
        except NoAnswer as trouble:
            if not trouble.asked:
                raise
            return WriteOutcome.under_way(name, parameter, trouble)
        return WriteOutcome(name, done, parameter, reason, kind=None if done else kind_of(reason))

    def enabled(self) -> Enabled:
        facts = self._way.condition(self.name, age=self._knowledge.period(self.name),
                                    patience=_DIAGNOSTICS_MARGIN)
        if 'control_state' not in facts:
            return Enabled.UNKNOWN
        if any(part in facts['control_state'] for part in _MOVING):
            return Enabled.YES
        return _ENABLED.get(facts.get('state', ''), Enabled.UNKNOWN)

    def identity(self) -> str:
        return self._knowledge.identity(self.name)


#: names in one call
_BATCH = 200
_DRIVE_KEYS = ('bus', 'protocol', 'station', 'profile', 'profile_sha256', 'identity', 'restore')
_PERIOD = 'diagnostics_period'
_BUS_KEYS = ('interface', 'channel', 'bitrate')


class BridgeSource:
    """
    The drives of a running bridge, or of all bridges of one namespace.

    :param way: to the bridges.
    """

    listens = False

    def __init__(self, way: Way) -> None:
        self._way = way
        self._bridges = way.bridge_of
        self._periods: dict[str, float] = {}

    @property
    def names(self) -> Sequence[str]:
        """All drives, in the order of the configuration."""
        return list(self._bridges)

    def parameter_names(self, drive: str) -> Sequence[str]:
        """Return the names of the listed parameters of a drive."""
        return self._way.listed(self._node_of(drive))

    def open(self, names: Sequence[str]) -> Drives:
        """Open drives by reading what their bridges know of them."""
        opened = {}
        for name in self._bridges:
            if name in names:
                opened[name] = BridgedDrive(name, self._way, self._node_of(name),
                                            *self._table(name), self)
        return Drives(opened, self.close)

    def close(self) -> None:
        """Close the way. Idempotent."""
        self._way.close()

    def _node_of(self, drive: str) -> str:
        return f'{self._bridges[drive].rpartition("/")[0]}/{drive}'

    def _values(self, bridge: str, names: Sequence[str]) -> dict[str, Any]:
        """Return parameters of a bridge; None for those that it does not have."""
        values = [None if isinstance(value, tuple) else value
                  for value in self._way.get(bridge, names)]
        if len(values) != len(names):   # rclpy returns nothing where one name is unknown
            values = [self._values(bridge, [name])[name] if len(names) > 1 else None
                      for name in names]
        return dict(zip(names, values))

    def period(self, drive: str) -> float:
        """Return the s between diagnostic messages of the bridge of a drive; asked for once."""
        bridge = self._bridges[drive]
        if bridge not in self._periods:
            self._periods[bridge] = float(self._values(bridge, [_PERIOD])[_PERIOD] or 1.0)
        return self._periods[bridge]

    def facts(self, drive: str) -> DriveFacts:
        """Return what its bridge knows of a drive."""
        prefix, bridge = f'drives.{drive}.', self._bridges[drive]
        values = self._values(bridge, [prefix + key for key in _DRIVE_KEYS])
        bus = str(values[f'{prefix}bus'])
        place = self._values(bridge, [f'buses.{bus}.{key}' for key in _BUS_KEYS])
        persist = f'{prefix}persist_writes'     # of one family only
        return DriveFacts(
            name=drive, bus=bus, interface=str(place[f'buses.{bus}.interface']),
            channel=str(place[f'buses.{bus}.channel']),
            bitrate=int(place[f'buses.{bus}.bitrate'] or 0),
            protocol=str(values[f'{prefix}protocol']), station=int(values[f'{prefix}station']),
            profile=str(values[f'{prefix}profile']),
            profile_sha256=str(values[f'{prefix}profile_sha256']),
            restore=_restore_table(values[f'{prefix}restore']), through=bridge,
            persist_writes=self._values(bridge, [persist])[persist] is not False)

    def identity(self, drive: str) -> str:
        """Return the identity of a drive, as its bridge has read it."""
        name = f'drives.{drive}.identity'
        return str(self._values(self._bridges[drive], [name])[name] or '')

    def _table(self, drive: str) -> tuple[dict[str, Parameter], dict[str, Role]]:
        """Return the parameters that a drive lists, and what the bridge uses them for."""
        names = list(self.parameter_names(drive))
        table: dict[str, Parameter] = {}
        roles: dict[str, Role] = {}
        for start in range(0, len(names), _BATCH):
            for message in self._way.describe(self._node_of(drive), names[start:start + _BATCH]):
                parameter, role = parameter_of(message), role_of(message)
                if parameter is not None:
                    table[message.name] = parameter
                    if role is not None:
                        roles[message.name] = role
        return table, roles


def _restore_table(text: Any) -> 'RestoreTable | None':
    """Return the table in a text of :func:`..declare.restore_text`."""
    from drive_can_bridge.core.profile import RestoreStep, RestoreTable
    try:
        read = json.loads(text)
        return RestoreTable(*(tuple(RestoreStep(str(name), int(bits), int(mask))
                                    for name, bits, mask in read[phase])
                              for phase in ('before', 'after')))
    except (TypeError, ValueError, KeyError):
        return None
