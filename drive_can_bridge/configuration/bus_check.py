# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The buses of a configuration: interface, channel, and the keys for the adapter."""

from collections.abc import Iterable
from typing import Any, Protocol

from drive_can_bridge.configuration.problems import Path, Tree
from drive_can_bridge.configuration.schema import complete, definition
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.words import hint, nearest, show

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

    def check_channel(self, interface: str, channel: str | int) -> str | None:
        """Say why a channel can be none of an interface; None: it may."""

    def check_bitrate(self, interface: str, bitrate: int) -> str | None:
        """Say why an adapter cannot be set to a bit rate; None: it may be possible."""


def check_buses(tree: Tree, adapters: Adapters | None) -> dict[str, BusConfiguration]:
    """Check the ``buses`` of a tree that has passed its schema; return those that can be used."""
    buses: dict[str, BusConfiguration] = {}
    for name, entry in tree.data.get('buses', {}).items():
        path, known = ('buses', name), len(tree.problems)
        values = complete('bus', entry)
        keywords = _check_adapter(tree, path, values, adapters)
        _check_keys(tree, path, entry, keywords)
        if 'interface' not in entry or 'channel' not in entry:
            continue
        bus = BusConfiguration(name=name, **values, options={
            key: value for key, value in entry.items() if key not in values})
        _look_for_twin(tree, bus, buses)
        if len(tree.problems) == known:
            buses[name] = bus
    _look_for_channels_of_others(tree, buses.values())
    return buses


def _check_adapter(tree: Tree, path: Path, values: dict[str, Any], adapters: Adapters | None,
                   ) -> set[str] | None:
    """Check what the adapter decides; return the keywords that it takes, None: unknown."""
    interface = values.get('interface')
    if adapters is None or interface is None:
        return None
    message = adapters.check_interface(interface)
    if message is not None:
        tree.wrong((*path, 'interface'), message)
        return None
    message = adapters.check_channel(interface, values['channel']) if 'channel' in values else None
    if message is not None:
        tree.wrong((*path, 'channel'), message)
    message = adapters.check_bitrate(interface, values['bitrate'])
    if message is not None:
        tree.wrong((*path, 'bitrate'), message)
    return adapters.adapter_keywords(interface)


def _check_keys(tree: Tree, path: Path, entry: dict[str, Any], keywords: set[str] | None) -> None:
    """Look for keys that are neither ours nor the adapter's."""
    ours = definition('bus')['properties']
    for key in entry:
        if key in ours or (keywords is not None and key in keywords):
            continue
        slip = nearest(key, ours, cutoff=_SLIP)
        if slip is not None:
            set_by_us = 'not' in ours[slip]
            tree.wrong((*path, key), f"unknown key, did you mean '{slip}'?"
                       + ' It is set by the bridge itself' * set_by_us)
        elif keywords is not None:
            tree.suspicious((*path, key), f'the adapter for {entry["interface"]} does not name '
                            f'this key{hint(key, keywords)}; it is handed over all the same')


def _look_for_twin(tree: Tree, bus: BusConfiguration, others: dict[str, BusConfiguration]) -> None:
    for other in others.values():
        if (bus.interface, str(bus.channel)) == (other.interface, str(other.channel)):
            tree.suspicious(
                ('buses', bus.name, 'channel'),
                f'{show(bus.channel)} is also the channel of bus {other.name}; identifiers and '
                'load are checked for each bus alone')
            return


def _look_for_channels_of_others(tree: Tree, buses: Iterable[BusConfiguration]) -> None:
    """Warn of a bus that a trace may mean by its name, or another one by its channel."""
    names = {bus.name: bus for bus in buses}
    for other in names.values():
        named = names.get(str(other.channel), other)
        if named is not other:
            tree.suspicious(
                ('buses', named.name), f'bus {other.name} has a channel of this name: decode '
                "takes what other programs' traces have of it for this bus")
