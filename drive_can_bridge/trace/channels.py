# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Which bus of a parameter file a trace means by its channel."""

from collections.abc import Iterable, Sequence

from drive_can_bridge.core.configuration import BusConfiguration


def labels(buses: Iterable[BusConfiguration]) -> dict[str, str]:
    """
    Return what buses, by name, are called in a trace: as candump calls them, or by their names.

    By its name also a bus whose channel would be taken for another one.
    """
    known = list(buses)
    found = {}
    for bus in known:
        channel = str(bus.channel)
        taken = any(channel in (other.name, str(other.channel)) for other in known
                    if other is not bus)
        found[bus.name] = channel if bus.interface == 'socketcan' and not taken else bus.name
    return found


class Channels:
    """
    Finds buses by the channels of a trace.

    A word is the name of a bus; if none has it, its channel. A number is its place in the file.
    The one bus of a file that has only one is meant by a trace without channels, too, and by the
    first channel of another name that turns up.
    """

    def __init__(self, buses: Sequence[BusConfiguration]) -> None:
        self._buses = list(buses)
        self._found: dict[str | int, BusConfiguration | None] = {}
        self._adopted = False

    def find(self, channel: str | int) -> BusConfiguration | None:
        """Return the bus; None: it is not in the file."""
        if channel not in self._found:
            self._found[channel] = self._look(channel)
        return self._found[channel]

    def _look(self, channel: str | int) -> BusConfiguration | None:
        for meant in ('name', 'channel'):
            for bus in self._buses:
                if channel == str(getattr(bus, meant)):
                    self._adopted = True
                    return bus
        if len(self._buses) == 1:
            if self._adopted and channel != '':
                return None
            self._adopted = channel != ''
            return self._buses[0]
        if isinstance(channel, int) and 0 <= channel < len(self._buses):
            return self._buses[channel]
        return None
