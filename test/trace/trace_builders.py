# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Conversations for the tests of observers: frames as candump writes them, lines of text back."""

from builders import frame

from drive_can_bridge.core.configuration import (
    BridgeConfiguration, BusConfiguration, DriveConfiguration)
from drive_can_bridge.core.frame import Record
from drive_can_bridge.protocols.observer import Observed, Telegram
from drive_can_bridge.trace.sinks import LineWriter, Only, Selection
from drive_can_bridge.trace.tracer import Tracer


def bridge(*drives: DriveConfiguration, bitrate: int = 125_000) -> BridgeConfiguration:
    """Make the configuration of a bridge with one bus, can0."""
    return BridgeConfiguration(
        buses={'main': BusConfiguration('main', 'socketcan', 'can0', bitrate)},
        drives={drive.name: drive for drive in drives})


class Witness:
    """Listens to a bus."""

    def __init__(self, *drives: DriveConfiguration, only: set[Only] | None = None) -> None:
        self.telegrams: list[Telegram] = []
        self._lines: list[str] = []
        self._writer = LineWriter(self._lines.append, Selection([], only or set()))
        self.tracer = Tracer(bridge(*drives), self._take)

    def _take(self, bus: str, telegram: Telegram) -> None:
        self.telegrams.append(telegram)
        self._writer(bus, telegram)

    def hears(self, text: str, time: float, *, sent: bool | None = None) -> list[str]:
        """Take a frame; return the lines that it brings."""
        identifier, data, extended = frame(text)
        self.tracer.take(Record(time, 'can0', identifier, data, extended, sent=sent))
        return self.lines()

    def waits(self, now: float) -> list[str]:
        """Let time pass."""
        self.tracer.advance(now)
        return self.lines()

    def lines(self) -> list[str]:
        """Return the lines so far, without their ends."""
        lines = [line.rstrip('\n') for line in self._lines]
        self._lines.clear()
        return lines

    def observed(self, name: str) -> Observed:
        """Return what was counted of a drive."""
        return self.tracer.observed()[name]
