# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The channels of traces: their names for buses, and the bus of each."""

from collections.abc import Callable, Iterable, Mapping, Sequence

from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.text import printable


def labels(buses: Iterable[BusConfiguration]) -> dict[str, str]:
    """
    Return the names of buses in a trace, by name: as candump has them, or their own.

    Its own name also for a bus whose channel could mean another one.
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

    The user's choice comes first. Else a word is the name of a bus; if none has it, its channel.
    Of several buses a number is the place, from 1. The one bus of a file that has only one is
    meant by a trace without channels, too, and by a channel of another name, if there is no other
    in the trace.

    :param meant: by their names, the channels of buses as the user gives them.
    :param tell: called with a line where a number was read as a place, or is of no bus.
    """

    def __init__(self, buses: Sequence[BusConfiguration],
                 meant: Mapping[str, str] | None = None,
                 tell: Callable[[str], None] = lambda _: None) -> None:
        self._buses = list(buses)
        self._meant = meant or {}
        self._tell = tell
        self._found: dict[str | int, BusConfiguration | None] = {}
        # what has another name is of no bus of the file
        self._known = len(buses) != 1 or bool(self._meant)
        self._adopted: str | int | None = None

    def look_ahead(self, channels: Iterable[str | int]) -> None:
        """
        Note which channels a trace has, as far as it matters, before the first is looked up.

        :raises DriveCanError: it is unknown which of them is the bus.
        """
        foreign: dict[str | int, None] = {}
        for channel in () if self._known else channels:
            if channel == '':
                continue
            if self._named(channel) is not None:
                self._known = True
                return
            foreign[channel] = None
        if len(foreign) > 1:
            raise self._ambiguous(foreign)

    def find(self, channel: str | int) -> BusConfiguration | None:
        """
        Return the bus; None: it is not in the file.

        :raises DriveCanError: it is unknown, and another channel was used for the bus.
        """
        if channel not in self._found:
            self._found[channel] = self._look(channel)
        return self._found[channel]

    def _look(self, channel: str | int) -> BusConfiguration | None:
        if channel == '' and len(self._buses) == 1 and not self._meant:
            return self._buses[0]
        named = self._named(channel)
        if self._adopted is not None:
            raise self._ambiguous((self._adopted, channel))
        if named is None and not self._known:
            self._adopted, named = channel, self._buses[0]
        self._known |= self._adopted is None
        return named or self._at(channel)

    def left_over(self) -> list[str]:
        """
        Return lines on channels whose names are those of no bus.

        At the end: a bus whose channel comes later is none that could be meant.
        """
        free = [bus.name for bus in self._buses
                if bus.name not in self._meant and bus not in self._found.values()]
        return [self._no_bus(channel, free) for channel, bus in self._found.items()
                if free and bus is None and channel and isinstance(channel, str)]

    @staticmethod
    def _no_bus(channel: str | int, names: Iterable[str]) -> str:
        shown = printable(str(channel))
        return command_sentences.channel_of_no_bus(
            shown, [f'--bus {name}={shown}' for name in names])

    def missing(self) -> list[str]:
        """Return the user's choices that are not in the trace, as they were given."""
        found = {str(channel) for channel in self._found}
        return [f'{name}={channel}' for name, channel in self._meant.items()
                if channel not in found]

    def _named(self, channel: str | int) -> BusConfiguration | None:
        """Return the bus that has this name by the user or the file."""
        word = str(channel)
        for bus in self._buses:
            if self._meant.get(bus.name) == word:
                return bus
        others = [bus for bus in self._buses if bus.name not in self._meant]
        for bus in others:
            if bus.name == word:
                return bus
        # a number is never compared: adapters count from 0, files from 1
        return next((bus for bus in others if str(bus.channel) == channel), None)

    def _at(self, channel: str | int) -> BusConfiguration | None:
        """Return the bus in this place of the file."""
        if not isinstance(channel, int) or self._adopted is not None:
            return None
        others = [bus for bus in self._buses if bus.name not in self._meant]
        if len(self._buses) > 1 and 1 <= channel <= len(self._buses):
            bus = self._buses[channel - 1]
            if bus in others:
                self._tell(f'channel {channel}: bus {bus.name}')
                return bus
        if others:
            self._tell(self._no_bus(channel, (bus.name for bus in others)))
        return None

    def _ambiguous(self, channels: Iterable[str | int]) -> DriveCanError:
        bus = self._buses[0]
        names = [printable(str(channel)) for channel in channels]
        return DriveCanError(
            command_sentences.which_channel(
                names, bus.name, [f'--bus {bus.name}={name}' for name in names]))
