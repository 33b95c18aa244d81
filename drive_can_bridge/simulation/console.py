# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Lines typed by a person, or sent by a script, while drives are simulated (docs/simulation.md).

``conveyor late=0.15 drop=2`` plays faults, ``conveyor`` tells what the drive is doing.
"""

from contextlib import suppress
import os
import sys

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.simulation.faults import parse_fault, usage_lines
from drive_can_bridge.simulation.player import Say
from drive_can_bridge.simulation.simulation import PlayedDrive, Simulation

_CHUNK = 4096
_LINE_MAX = 1000


class Console:
    """
    Obeys lines.

    :param say: takes what was asked for.
    :param complain: takes one line per line that makes no sense.
    """

    def __init__(self, simulation: Simulation, *, say: Say, complain: Say) -> None:
        self._drives = simulation.drives
        self._say = say
        self._complain = complain

    def obey(self, line: str) -> None:
        """Obey one line. An empty one does nothing."""
        words = line.split()
        if not words:
            return
        told: list[str] = []
        if words == ['help']:
            told = help_lines()
        elif words in (['list'], ['status']):
            for drive in self._drives.values():
                told += describe(drive)[:1 if words == ['list'] else 2]
        elif words[0] not in self._drives:
            self._complain(f"no drive '{words[0]}'; drives: {', '.join(self._drives)}; "
                           f"also: status, list, help")
        elif len(words) == 1:
            told = describe(self._drives[words[0]])
        else:
            self._play(self._drives[words[0]], words[1:])
        for text in told:
            self._say(text)

    def _play(self, drive: PlayedDrive, texts: list[str]) -> None:
        try:
            # all are read before the first is played: a line counts as a whole or not at all
            for fault in [parse_fault(text) for text in texts]:
                drive.fault(fault)
        except ValueRefused as error:
            self._complain(str(error))


class LineReader:
    """Standard input, without ever blocking or stopping a process in the background."""

    def __init__(self) -> None:
        self._descriptor: int | None = None
        self._rest = b''
        # the stream may be closed (None), or replaced by something that has no descriptor
        with suppress(AttributeError, OSError, ValueError):
            self._descriptor = sys.stdin.fileno()

    @property
    def fileno(self) -> int | None:
        """What may be read now; None: nothing comes, or a terminal would stop who reads it."""
        found = self._descriptor
        try:
            foreground = found is None or not os.isatty(found) or (
                os.tcgetpgrp(found) == os.getpgrp())
        except OSError:
            foreground = False
        return found if foreground else None

    def read_lines(self) -> list[str]:
        """Return the lines that have come. Call it when the descriptor is readable."""
        if self._descriptor is None:
            return []
        try:
            data = os.read(self._descriptor, _CHUNK)
        except BlockingIOError:
            return []
        except OSError:
            data = b''
        if not data:
            self._descriptor = None
            data = b'\n'
        *lines, self._rest = (self._rest + data).split(b'\n')
        self._rest = self._rest[:_LINE_MAX]
        return [line.decode('utf-8', 'replace') for line in lines]


def describe(drive: PlayedDrive) -> list[str]:
    """Return a line about a drive, and one about the EEPROM cells that it has written, if any."""
    configuration = drive.drive.configuration
    worn = ', '.join(f'{name} {count}' for name, count in sorted(drive.wear.items()))
    line = (f'{drive.name}: {configuration.protocol} station {configuration.station} '
            f'on bus {configuration.bus}, {drive.requests} requests, {drive.answers} answers, '
            f'{drive.eeprom_writes} EEPROM writes, faults: {drive.faults_text}')
    return [line, f'{drive.name}: EEPROM writes: {worn}'] if worn else [line]


def help_lines() -> list[str]:
    """Return what can be typed."""
    return ['DRIVE FAULT …  DRIVE  status  list  help; faults:', *usage_lines()]
