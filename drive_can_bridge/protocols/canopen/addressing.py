# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Drives that are CANopen nodes: their keys, their identifiers, and raw names of their objects."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
import re

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import Route
from drive_can_bridge.protocols.canopen import network
from drive_can_bridge.protocols.family import Claim, Complaint, option, out_of_range

_RAW_OBJECT = re.compile(r'x([0-9a-fA-F]{1,4})\.([0-9a-fA-F]{1,2})', re.ASCII)


@dataclass(frozen=True, slots=True)
class NodeOptions:
    """NMT and supervision of the node."""

    nmt_start: bool = option(
        True, 'Send NMT start to the node at start, after its boot-up frame, when its heartbeat '
        'says stopped or pre-operational, and once a second while it is offline.')
    heartbeat_timeout: float = option(
        0.0, 's without heartbeat until the drive counts as offline; 0: not watched. The producer '
        '(1017h) is not configured by the bridge.', minimum=0, maximum=3600)
    predefined_set: bool = option(
        True, 'Keep other drives off all identifiers of the predefined connection set of the '
        'node, also those that the bridge does not use: what they send there would be commands '
        'to it.')


# -- identifiers ----------------------------------------------------------------------------------


def station_complaints(drive: DriveConfiguration) -> Iterator[Complaint]:
    """Yield what is wrong with the node-ID."""
    yield from out_of_range(
        'station', drive.station, 1, network.NODE_MAX, f' ({drive.protocol})')


def node_claims(drive: DriveConfiguration, exchange: Mapping[int, str]) -> list[Claim]:
    """
    Return all identifiers of a node that the bridge sends or wants to see.

    :param exchange: those that its family adds, and what for.
    """
    node = drive.station
    purposes = {**exchange,
                network.EMERGENCY_BASE + node: f'emergency messages of node {node}',
                network.HEARTBEAT_BASE + node: f'heartbeats of node {node}'}
    # all CANopen nodes of a bus listen to the one NMT identifier
    return [*_claims(purposes),
            *_claims({network.NMT_IDENTIFIER: 'NMT'}, shared='NMT', heard=False)]


def predefined_set(node: int) -> dict[int, str]:
    """Return what a node has identifiers for from the factory, beside those of every node."""
    return {base + node: f'{what} node {node}' for base, what in network.PREDEFINED_SET.items()}


def reserved_claims(drive: DriveConfiguration) -> list[Claim]:
    """Return the rest of what a node listens to and sends on from the factory."""
    if not drive.options.predefined_set:
        return []
    remark = 'predefined_set'
    return [*_claims({identifier: f'{purpose}; {remark}'
                      for identifier, purpose in predefined_set(drive.station).items()}),
            *_claims({network.SYNC_IDENTIFIER: f'SYNC; {remark}'}, shared='SYNC')]


def _claims(purposes: Mapping[int, str], *, shared: str = '', heard: bool = True) -> list[Claim]:
    return [Claim(Route.of(identifier), f'{identifier:03X}h ({purpose})', shared, heard)
            for identifier, purpose in purposes.items()]


# -- objects --------------------------------------------------------------------------------------


def object_of_name(name: str) -> tuple[int, int] | None:
    """
    Return index and sub-index in a raw parameter name; None: it is no name of an object.

    >>> '%04X.%02X' % object_of_name('x2004.10')
    '2004.10'
    """
    match = _RAW_OBJECT.fullmatch(name)
    return None if match is None else (int(match[1], 16), int(match[2], 16))


def name_of_object(index: int, subindex: int) -> str:
    """Return the raw parameter name of an object."""
    return f'x{index:04x}.{subindex:02x}'
