# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The buses of a configuration: interface, channel, and the keys for the adapter."""

from collections.abc import Iterator
from typing import Any, Protocol

from drive_can_bridge.configuration.problems import hint, nearest, Problem, show, Tree
from drive_can_bridge.configuration.schema import defaults, definition
from drive_can_bridge.core.configuration import BusConfiguration

#: how much a key has to look like one of ours to be taken for a slip of the pen
_SLIP = 0.8


class Adapters(Protocol):
    """
    What is known about CAN adapters (the module :mod:`drive_can_bridge.transport.adapters`).

    Handed in, because only the transport knows python-can, and because a check without it is
    still worth something.
    """

    def adapter_keywords(self, interface: str) -> set[str] | None:
        """Return the keyword arguments that an adapter's class names; None: unknown."""

    def check_interface(self, interface: str) -> str | None:
        """Say why an interface cannot be used here; None: it can."""

    def check_bitrate(self, interface: str, bitrate: int) -> str | None:
        """Say why an adapter cannot be set to a bit rate; None: it may be possible."""


class BusChecker:
    """Check the ``buses`` of a tree that has passed its schema."""

    def __init__(self, tree: Tree, adapters: Adapters | None) -> None:
        self.problems: list[Problem] = []
        self.warnings: list[Problem] = []
        self._tree = tree
        self._adapters = adapters

    def check(self) -> dict[str, BusConfiguration]:
        """Return the buses that can be used."""
        buses: dict[str, BusConfiguration] = {}
        for name, entry in self._tree.data.get('buses', {}).items():
            found = list(self._check_options(name, entry))
            self.problems.extend(found)
            if 'interface' in entry and 'channel' in entry:
                bus = _bus(name, entry)
                self._look_for_twin(bus, buses)
                if not found:
                    buses[name] = bus
        return buses

    def _check_options(self, name: str, entry: dict[str, Any]) -> Iterator[Problem]:
        path = ('buses', name)
        interface = entry.get('interface')
        keywords = None
        if self._adapters is not None and interface is not None:
            message = self._adapters.check_interface(interface)
            if message is not None:
                yield self._tree.problem((*path, 'interface'), message)
            else:
                keywords = self._adapters.adapter_keywords(interface)
                message = self._adapters.check_bitrate(interface, entry.get(
                    'bitrate', defaults('bus')['bitrate']))
                if message is not None:
                    yield self._tree.problem((*path, 'bitrate'), message)
        ours = definition('bus')['properties']
        for key in entry:
            if key in ours or (keywords is not None and key in keywords):
                continue
            slip = nearest(key, ours, cutoff=_SLIP)
            if slip is not None:
                yield self._tree.problem((*path, key), f"unknown key, did you mean '{slip}'?")
            elif keywords is not None:
                self.warnings.append(self._tree.problem(
                    (*path, key), f'the adapter for {interface} does not name this key'
                                  f'{hint(key, keywords)}; it is handed over all the same'))

    def _look_for_twin(self, bus: BusConfiguration, others: dict[str, BusConfiguration]) -> None:
        for other in others.values():
            if (bus.interface, str(bus.channel)) == (other.interface, str(other.channel)):
                self.warnings.append(self._tree.problem(
                    ('buses', bus.name, 'channel'),
                    f'{show(bus.channel)} is also the channel of bus {other.name}; identifiers '
                    'and load are checked for each bus alone'))
                return


def _bus(name: str, entry: dict[str, Any]) -> BusConfiguration:
    values = {**defaults('bus'), **entry}
    ours = definition('bus')['properties']
    return BusConfiguration(
        name=name, interface=values['interface'], channel=values['channel'],
        bitrate=values['bitrate'], reconnect_period=float(values['reconnect_period']),
        trace_seconds=float(values['trace_seconds']), trace_directory=values['trace_directory'],
        trace_files=values['trace_files'],
        options={key: value for key, value in entry.items() if key not in ours})
