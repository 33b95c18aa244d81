# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Finding a running bridge, and what it says of its drives."""

from collections.abc import Sequence
import json
from typing import Any

from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters

from drive_can_bridge.client.bridged.descriptors import parameter_of, role_of
from drive_can_bridge.client.bridged.drive import BridgedDrive
from drive_can_bridge.client.drive import DriveFacts, Drives
from drive_can_bridge.clock import Clock
from drive_can_bridge.core.errors import NoBridge
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import RestoreStep, RestoreTable
from drive_can_bridge.core.roles import Role
from drive_can_bridge.ros.client.graph import Graph
from drive_can_bridge.ros.client.search import find_bridge
from drive_can_bridge.ros.messages import plain

#: names in one call
_BATCH = 200
_DRIVE_KEYS = ('bus', 'protocol', 'station', 'profile', 'profile_sha256', 'identity', 'restore')
_BUS_KEYS = ('interface', 'channel', 'bitrate')


class BridgeSource:
    """
    The drives of a running bridge.

    :param namespace: where it runs; None: anywhere, if there is only one.
    :raises WhichBridge: there are several.
    :raises NoBridge: there is none, or it does not answer.
    """

    def __init__(self, namespace: str | None, clock: Clock) -> None:
        self._graph = Graph(clock)
        try:
            found = find_bridge(
                self._graph,
                namespace if namespace is None else f'/{namespace.strip("/")}'.rstrip('/'))
            self.bridge, self._names = found.name, found.drives or ()
        except NoBridge as error:
            self._graph.close()
            raise NoBridge(f'{error}: start one, or name its file with --params-file to talk to '
                           'the drives directly') from None
        except BaseException:
            self._graph.close()
            raise

    @property
    def names(self) -> Sequence[str]:
        """All drives, in the order of the configuration."""
        return self._names

    def parameter_names(self, drive: str) -> Sequence[str]:
        """Return the names of the listed parameters of a drive."""
        return list(self._graph.call(self._node_of(drive), 'list_parameters',
                                     ListParameters.Request()).result.names)

    def open(self, names: Sequence[str]) -> Drives:
        """Ask for what is known of these drives."""
        wanted = [name for name in self._names if name in names]
        period = self._values(['diagnostics_period'])['diagnostics_period']
        opened = {}
        for name in wanted:
            table, roles = self._table(name)
            opened[name] = BridgedDrive(self._graph, self._node_of(name), self._facts(name),
                                        table, roles, float(period or 1.0), self._identity)
        return Drives(opened, self.close)

    def close(self) -> None:
        """Leave the graph. Idempotent."""
        self._graph.close()

    def _node_of(self, drive: str) -> str:
        return f'{self.bridge.rpartition("/")[0]}/{drive}'

    def _values(self, names: Sequence[str]) -> dict[str, Any]:
        """Return parameters of the bridge; None for those that it does not have."""
        answer = self._graph.call(self.bridge, 'get_parameters',
                                  GetParameters.Request(names=list(names)))
        values = [plain(value) for value in answer.values]
        if len(values) != len(names):   # rclpy answers nothing where one name is unknown
            values = [self._values([name])[name] if len(names) > 1 else None for name in names]
        return dict(zip(names, values))

    def _facts(self, drive: str) -> DriveFacts:
        prefix = f'drives.{drive}.'
        values = self._values([prefix + key for key in _DRIVE_KEYS])
        bus = str(values[f'{prefix}bus'])
        place = self._values([f'buses.{bus}.{key}' for key in _BUS_KEYS])
        persist = f'{prefix}persist_writes'     # of one family only
        return DriveFacts(
            name=drive, bus=bus, interface=str(place[f'buses.{bus}.interface']),
            channel=str(place[f'buses.{bus}.channel']),
            bitrate=int(place[f'buses.{bus}.bitrate'] or 0),
            protocol=str(values[f'{prefix}protocol']), station=int(values[f'{prefix}station']),
            profile=str(values[f'{prefix}profile']),
            profile_sha256=str(values[f'{prefix}profile_sha256']),
            restore=_restore_table(values[f'{prefix}restore']), through=self.bridge,
            persist_writes=self._values([persist])[persist] is not False)

    def _identity(self, drive: str) -> str:
        name = f'drives.{drive}.identity'
        return str(self._values([name])[name] or '')

    def _table(self, drive: str) -> tuple[dict[str, Parameter], dict[str, Role]]:
        """Return the parameters that a drive lists, and what the bridge uses them for."""
        names = list(self.parameter_names(drive))
        table: dict[str, Parameter] = {}
        roles: dict[str, Role] = {}
        for start in range(0, len(names), _BATCH):
            answer = self._graph.call(
                self._node_of(drive), 'describe_parameters',
                DescribeParameters.Request(names=names[start:start + _BATCH]))
            for message in answer.descriptors:
                parameter, role = parameter_of(message), role_of(message)
                if parameter is not None:
                    table[message.name] = parameter
                    if role is not None:
                        roles[message.name] = role
        return table, roles


def _restore_table(text: Any) -> RestoreTable | None:
    """Read what :func:`..declare.restore_text` has written."""
    try:
        read = json.loads(text)
        return RestoreTable(*(tuple(RestoreStep(str(name), int(bits), int(mask))
                                    for name, bits, mask in read[phase])
                              for phase in ('before', 'after')))
    except (TypeError, ValueError, KeyError):
        return None
