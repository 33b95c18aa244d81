# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What drives do to each other on a bus: colliding identifiers, the load they add up to, time."""

from collections.abc import Iterable, Iterator
import math

from drive_can_bridge.configuration.problems import Tree
from drive_can_bridge.core.configuration import BusConfiguration, DriveConfiguration
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.family import Claim, Family

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
