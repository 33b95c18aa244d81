# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The buses of a configuration: interface, channel, and the keys for the adapter.

What drives do to each other on a bus: colliding identifiers, the load they add up to, time.
"""

from collections.abc import Iterable, Iterator
import math
from typing import Any, Protocol

from drive_can_bridge.configuration.problems import Path, Tree
from drive_can_bridge.configuration.schema import complete, definition
from drive_can_bridge.core.configuration import BusConfiguration, DriveConfiguration
from drive_can_bridge.core.words import hint, nearest, show
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.family import Claim, Family

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


#: share of the bus above which a configuration is refused, and warned about
LOAD_MAX = 1.0
LOAD_WARNING = 0.7


def bus_shares(bus: BusConfiguration, drives: Iterable[DriveConfiguration]) -> dict[str, float]:
    """Return the worst-case share of the bus that the exchange of each of its drives takes."""
    shares: dict[str, float] = {}
    for family, together in _by_family(drives):
        for drive, load in zip(together, family.loads(together)):
            shares[drive.name] = load / bus.bitrate
    return shares


def _by_family(drives: Iterable[DriveConfiguration],
               ) -> Iterator[tuple[Family, list[DriveConfiguration]]]:
    """Yield the drives of one bus, family by family."""
    together: dict[str, list[DriveConfiguration]] = {}
    for drive in drives:
        together.setdefault(drive.protocol, []).append(drive)
    for protocol, members in together.items():
        yield FAMILIES[protocol], members


def check_identifiers(tree: Tree, drives: Iterable[DriveConfiguration]) -> None:
    """Look for drives that use identifiers of an earlier one on their bus."""
    claimed: dict[str, list[tuple[Claim, DriveConfiguration]]] = {}
    for drive in drives:
        on_bus = claimed.setdefault(drive.bus, [])
        family = FAMILIES[drive.protocol]
        own = [*family.claims(drive), *family.reserved(drive)]
        hit = next(((mine, claim, other) for mine in own for claim, other in on_bus
                    if mine.overlaps(claim)), None)
        if hit is not None:
            mine, claim, other = hit
            what = claim.purpose if claim.purpose == mine.purpose else \
                f'one identifier, {mine.purpose} here and {claim.purpose} there'
            tree.wrong(
                ('drives', drive.name, 'station'),
                f'{drive.station} collides with drive {other.name} (station {other.station}) on '
                f'bus {drive.bus}: both use {what}; allowed is a station of its own')
        on_bus.extend((claim, drive) for claim in own)


def check_load(tree: Tree, bus: BusConfiguration, drives: Iterable[DriveConfiguration]) -> None:
    """Check the worst-case load of a bus."""
    shares = bus_shares(bus, drives)
    total = sum(shares.values())
    if total <= LOAD_WARNING:
        return
    parts = ', '.join(f'{name} {100 * share:.1f} %' for name, share in shares.items())
    figure = f'worst-case load {100 * total:.1f} % at {bus.bitrate} bit/s ({parts})'
    if total > LOAD_MAX:
        tree.wrong(('buses', bus.name), f'{figure}, allowed is {100 * LOAD_MAX:.0f} %: use longer '
                                        'periods, fewer drives or a higher bit rate')
    else:
        tree.suspicious(('buses', bus.name), f'{figure}, recommended is at most '
                                             f'{100 * LOAD_WARNING:.0f} %')


def check_rounds(tree: Tree, bus: BusConfiguration, drives: Iterable[DriveConfiguration]) -> None:
    """Look for drives whose round of polling does not fit their period."""
    for drive in drives:
        shortest = FAMILIES[drive.protocol].shortest_period(drive, bus.bitrate)
        if drive.period < shortest:
            # rounded up: what is named here has to pass
            allowed = math.ceil(shortest * 1e5 - 1e-6) / 1e5
            tree.wrong(
                ('drives', drive.name, 'period'),
                f'{drive.period:g} s is too short for a round of polling at {bus.bitrate} bit/s, '
                f'allowed is at least {allowed:g} s')


def check_neighbours(tree: Tree, drives: Iterable[DriveConfiguration]) -> None:
    """Look for what drives of one bus cannot do together, family by family."""
    for family, together in _by_family(drives):
        for drive, (key, message) in family.check_together(together):
            path = ('drives', drive.name, *(key.split('.') if key else ()))
            if not tree.is_damaged(path):
                tree.wrong(path, message)
