# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""How bridges, buses and drives are at one moment: plain values, ready to be shown anywhere."""

from collections.abc import Mapping
from dataclasses import dataclass, field
import math

from drive_can_bridge.monitor.reports import Level
from drive_can_bridge.monitor.values import ParameterInfo

Points = tuple[tuple[float, float], ...]
#: state of a bus whose bridge is silent
UNKNOWN = 'unknown'


@dataclass(frozen=True, slots=True)
class Shown:
    """
    A parameter with its value.

    :param text: value without unit; '' while there is none.
    :param assignment: ``actual_speed=12.3 rpm``, for lines that programs read.
    :param width: characters that the longest possible value takes.
    :param points: the last values as (s ago, value), oldest first.
    """

    name: str
    text: str
    assignment: str = ''
    unit: str = ''
    width: int = 0
    points: Points = ()


@dataclass(frozen=True, slots=True)
class Times:
    """Mean and maximum since the start and 99th percentile of the last exchanges, in ms."""

    mean: float = math.nan
    p99: float = math.nan
    maximum: float = math.nan


@dataclass(frozen=True, slots=True)
class Place:
    """Where a drive is and how it is talked to, from the parameters of its bridge."""

    bus: str = ''
    station: str = ''
    protocol: str = ''
    period: float = math.nan


@dataclass(frozen=True, slots=True)
class Reading:
    """
    What became of reading a parameter.

    :param text: the value; '' when it could not be read.
    :param age: s since it was read.
    """

    text: str
    age: float


@dataclass(frozen=True, slots=True)
class DriveSnapshot:
    """
    One drive.

    :param name: full name of its node.
    :param label: as short as it may be among the others.
    :param state: in one or two words, as the bridge says it.
    :param online: it exchanges process data.
    :param silent: its bridge says nothing any more: how it is nobody knows.
    :param advice: in words, and what to do.
    :param control: state of its control word; '' without control.
    :param bits: parameter -> bit -> set.
    :param rate: exchanges per second.
    :param command_age: s; NaN before the first command.
    :param facts: everything that diagnostics say.
    :param sampled: a sample was received since it came online.
    :param asked_for: s for which its samples have been asked for without a break; 0: they are not.
    :param parameters: what the drive has; empty until it has told.
    :param readings: of the parameters that were asked for.
    :param told_again: how often it has told of them once more: readings are asked for anew.
    """

    name: str
    label: str
    bridge: str
    state: str
    level: Level
    online: bool
    advice: str
    control: str = ''
    setpoints: tuple[Shown, ...] = ()
    values: tuple[Shown, ...] = ()
    bits: Mapping[str, Mapping[str, bool]] = field(default_factory=dict)
    rate: float = 0.0
    exchanges: int = 0
    missed: int = 0
    period_error: Times = Times()
    latency: Times = Times()
    command_age: float = math.nan
    facts: Mapping[str, str] = field(default_factory=dict)
    sampled: bool = False
    asked_for: float = 0.0
    place: Place = Place()
    parameters: tuple[ParameterInfo, ...] = ()
    readings: Mapping[str, Reading] = field(default_factory=dict)
    told_again: int = 0
    silent: bool = False


@dataclass(frozen=True, slots=True)
class BusSnapshot:
    """One bus; ``load`` in percent, the rates in frames per second."""

    name: str
    label: str
    bridge: str
    state: str
    level: Level
    message: str
    load: float = math.nan
    sent: float = 0.0
    received: float = 0.0
    rejected: int = 0
    errors: int = 0


@dataclass(frozen=True, slots=True)
class BridgeSnapshot:
    """
    One bridge.

    :param silent: s since its last diagnostics, once that is longer than it should be; else 0.
    """

    name: str
    silent: float = 0.0


@dataclass(frozen=True, slots=True)
class LogLine:
    """
    One line of the log.

    :param at: s since the epoch.
    :param level: as ROS names it.
    :param logger: who said it.
    """

    at: float
    level: str
    logger: str
    text: str


@dataclass(frozen=True, slots=True)
class Snapshot:
    """
    Everything.

    :param at: s since the epoch.
    """

    at: float = 0.0
    bridges: tuple[BridgeSnapshot, ...] = ()
    buses: tuple[BusSnapshot, ...] = ()
    drives: tuple[DriveSnapshot, ...] = ()
    log: tuple[LogLine, ...] = ()

    def drive(self, name: str) -> DriveSnapshot | None:
        """Return a drive by its full name."""
        return next((drive for drive in self.drives if drive.name == name), None)
