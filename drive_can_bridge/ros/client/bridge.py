# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Finding a running bridge, and what it says of its drives."""

from collections.abc import Mapping, Sequence
import json
import os
import time
from typing import Any

from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters

from drive_can_bridge.client.drive import DriveFacts, Drives, WhichBridge
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import RestoreStep, RestoreTable
from drive_can_bridge.core.roles import Role
from drive_can_bridge.ros.client.descriptors import parameter_of, role_of
from drive_can_bridge.ros.client.drive import BridgedDrive
from drive_can_bridge.ros.client.graph import Graph, NoAnswer
from drive_can_bridge.ros.messages import plain

#: s without anything new in the graph until nobody is there; where one is known to be there
_SEARCH, _EXPECTED = 4.0, 6.0
#: s without anything new, once a bridge is found, until nobody else is there; and how many times
#: as long as it took to find that one: on a busy machine others need as long at least
_SETTLE, _AS_LONG = 1.0, 2.0
#: s that looking takes in a graph where there is always something new
_LONGEST = 12.0
#: s that one that may be a bridge has to say so
_ASK_TIMEOUT = 5.0
#: names in one call
_BATCH = 200
_LIFECYCLE = 'lifecycle_msgs/srv/ChangeState'
_MARK = '.profile_sha256'
_DRIVE_KEYS = ('bus', 'protocol', 'station', 'profile', 'profile_sha256', 'identity', 'restore')
_BUS_KEYS = ('interface', 'channel', 'bitrate')


class BridgeSource:
    """
    The drives of a running bridge.

    :param namespace: where it runs; None: anywhere, if there is only one.
    :raises WhichBridge: there are several.
    :raises DriveCanError: there is none, or it does not answer.
    """

    def __init__(self, namespace: str | None) -> None:
        self._graph = Graph()
        try:
            self._namespace = None if namespace is None else '/' + namespace.strip('/')
            self.bridge, self._names = self._find()
            self._tables: dict[str, dict[str, Parameter]] = {}
            self._roles: dict[str, dict[str, Role]] = {}
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

    # -- which bridge -----------------------------------------------------------------------------

    def _find(self) -> tuple[str, tuple[str, ...]]:
        """Return the full name of the bridge, and its drives."""
        found: dict[str, tuple[str, ...]] = {}
        looked: set[str] = set()
        silent: dict[str, NoAnswer] = {}
        graph: list[object] = []
        began = changed = time.monotonic()
        patience = _SEARCH if self._namespace is None else _EXPECTED
        last = changed + _LONGEST
        while time.monotonic() < min(last, changed + patience):
            before, graph = graph, self._graph.everything()
            if graph != before:     # they are still being discovered
                changed = time.monotonic()
            new = [node for node in self._graph.nodes_with('change_state', _LIFECYCLE)
                   if node not in looked and self._in_namespace(node)]
            if not new:
                self._graph.wait(lambda: False, 0.1)
            for node in new:
                looked.add(node)
                try:
                    drives = self._drives_of(node)
                except NoAnswer as error:
                    silent[node] = error
                    continue
                if drives:
                    found[node] = drives
                    # asking it took its time: whoever else is there gets as much
                    changed = time.monotonic()
                    if len(found) == 1:
                        patience = min(max(_SETTLE, _AS_LONG * (changed - began)), _EXPECTED)
                    last = changed + max(_SEARCH, patience)
        if not found:
            raise DriveCanError(self._nobody(silent))
        if len(found) > 1:
            raise WhichBridge(f'several bridges are running: {", ".join(sorted(found))}; choose '
                              'one with --namespace')
        return next(iter(found.items()))

    def _nobody(self, silent: Mapping[str, NoAnswer]) -> str:
        where = '' if self._namespace is None else f' in namespace {self._namespace}'
        domain = os.environ.get('ROS_DOMAIN_ID') or '0'
        if silent:
            return (f'no bridge answers{where} (ROS domain {domain}): '
                    + '; '.join(map(str, silent.values())))
        return (f'no configured bridge is running{where} (ROS domain {domain}): start one, or '
                'name its file with --params-file to talk to the drives directly')

    def _in_namespace(self, node: str) -> bool:
        return self._namespace is None or (node.rpartition('/')[0] or '/') == self._namespace

    def _drives_of(self, node: str) -> tuple[str, ...]:
        """Return the drives of a node; none of one that is no bridge."""
        names = self._graph.call(node, 'list_parameters', ListParameters.Request(
            prefixes=['drives']), _ASK_TIMEOUT).result.names
        return tuple(name.split('.')[1] for name in names
                     if name.endswith(_MARK) and name.count('.') == 2)

    def _node_of(self, drive: str) -> str:
        return f'{self.bridge.rpartition("/")[0]}/{drive}'

    # -- what it says -----------------------------------------------------------------------------

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
