# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
One master for each drive: a process locks drives on this host before it talks to them.

A drive is identified by its bus (interface, channel), its protocol and its station, whatever a
parameter file calls it. Serial ports are locked as a whole: what two processes read from one
arrives at neither. Buses that other processes may use besides (SocketCAN) are not locked; drives
on them that the other process does not know are not affected.
"""

from collections.abc import Iterable, Sequence

from drive_can_bridge.core import bus_sentences
from drive_can_bridge.core.configuration import BusConfiguration, DriveConfiguration
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.process.locks import Held, holder, HostLock, take
from drive_can_bridge.process.presence import BESIDES, BRIDGE
from drive_can_bridge.transport.bus_identity import identity_of

#: what to do for commands that have only the direct way
END_FIRST = 'end that first'


class InUse(DriveCanError):
    """Another process talks to a drive, or has the serial port open."""


class AnotherMaster(DriveCanError):
    """Another master talks to one of the drives."""


class Ownership:
    """
    The locks of a process; a context manager.

    :param buses: with all drives on each of them that it will talk to.
    :param who: its name: ``drive_can_bridge``, ``drive_can read``.
    :param advice: what to do where a bridge has a drive.
    :raises InUse: another process has one; nothing is locked then.
    """

    def __init__(self, buses: Iterable[tuple[BusConfiguration, Sequence[DriveConfiguration]]],
                 who: str, advice: str) -> None:
        claims: dict[str, str] = {}
        drive_keys: set[str] = set()    # one for each: others count them
        for bus, drives in buses:
            identity = identity_of(bus)
            for drive in drives:
                drive_keys.add(f'drive {identity.names[0]} {drive.protocol} {drive.station}')
                for name in identity.names:
                    claims[f'drive {name} {drive.protocol} {drive.station}'] = (
                        f'bus {bus.name}: drive {drive.name}')
            if identity.port:      # after the drives: their locks are more specific
                claims.update(dict.fromkeys(
                    identity.names, f'bus {bus.name}: the serial port {identity.port}'))
        try:
            self._locks: list[HostLock] = take({
                key: who if key in drive_keys or who != BRIDGE else BESIDES for key in claims})
        except Held as held:
            # which one failed is chance: the first in the caller's order is clearest
            for key, what in claims.items():
                other = holder(key)
                if other is not None:
                    raise _in_words(other, what, advice) from None
            raise _in_words(held, next(iter(claims.values())), advice) from None

    def __enter__(self) -> 'Ownership':
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    def release(self) -> None:
        """Release the drives. Idempotent."""
        while self._locks:
            self._locks.pop().release()


def _in_words(held: Held, what: str, advice: str) -> InUse:
    process = held.in_words
    if held.who not in ('', BRIDGE, BESIDES):
        process += f' ({held.who.replace("_", " ").replace("drive can", "drive_can")})'
        advice = bus_sentences.wait_or_end()
    return InUse(bus_sentences.in_use(what=what, process=process, advice=advice))
