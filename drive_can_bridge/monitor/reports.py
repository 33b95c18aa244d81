# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Diagnostics of a bridge, read: who says it, about what, and the numbers in it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import islice
import math
import re

from drive_can_bridge.core.text import printable
from drive_can_bridge.monitor.text import is_ros_name

_SUBJECT = re.compile(r'(?P<bridge>\S+): (?P<kind>bus|drive) (?P<name>\S+)')
#: keys that one status may have
_FACTS_MAX = 100
#: by which a status of a bridge is told from others of a similar name
_MARKS = {'bus': 'load_percent', 'drive': 'missed_exchanges'}


class Level(IntEnum):
    """How bad it is, numbered as in diagnostic_msgs."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True, slots=True)
class Status:
    """One entry of a diagnostic message, as it arrived."""

    name: str
    level: int
    message: str
    facts: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Report:
    """
    What a bridge says about a bus or a drive.

    :param bridge: full name of the bridge, ``/cell/drive_can_bridge``.
    :param is_drive: about a drive; otherwise about a bus.
    :param name: of the bus or drive, as it is configured.
    :param facts: all keys, printable.
    """

    bridge: str
    is_drive: bool
    name: str
    level: Level
    message: str
    facts: Mapping[str, str] = field(default_factory=dict)

    @property
    def full_name(self) -> str:
        """Name of the drive's node: it lives in its bridge's namespace."""
        return f'{self.bridge.rpartition("/")[0]}/{self.name}'

    @property
    def state(self) -> str:
        """State in one word, as the bridge says it."""
        return self.facts.get('state', '')

    def number(self, key: str) -> float:
        """Return a number of the facts, NaN where there is none."""
        try:
            return float(self.facts.get(key, 'nan'))
        except ValueError:
            return math.nan

    def count(self, key: str) -> int:
        """Return a count of the facts, 0 where there is none."""
        number = self.number(key)
        return int(number) if math.isfinite(number) else 0


def read_status(status: Status) -> Report | None:
    """Return the report in a status; None: it is not from a bridge."""
    match = _SUBJECT.fullmatch(status.name)
    if match is None or _MARKS[match['kind']] not in status.facts:
        return None
    bridge = f'/{match["bridge"]}'
    report = Report(
        bridge=bridge, is_drive=match['kind'] == 'drive', name=printable(match['name']),
        level=Level(status.level) if 0 <= status.level <= 3 else Level.ERROR,
        message=printable(status.message),
        facts={printable(key): printable(value)
               for key, value in islice(status.facts.items(), _FACTS_MAX)})
    return report if is_ros_name(bridge) and is_ros_name(report.full_name) else None
