# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Bridges, buses and drives at one moment: plain values, ready to be shown anywhere.

Diagnostics are read here, and what values and counters were a moment ago is kept. Text from the
graph is made printable: any node can put anything there.
"""

from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from itertools import islice
import math
import re
from typing import Protocol

from drive_can_bridge.core.parameters import Value
from drive_can_bridge.core.status_bits import BUILT_IN, STATUS_NAME
from drive_can_bridge.core.text import is_ros_name, printable
from drive_can_bridge.monitor.values import ParameterInfo

#: characters kept of a line of the log, which may name several drives
LOG_LIMIT = 2000

_SUBJECT = re.compile(r'(?P<bridge>\S+): (?P<kind>bus|drive) (?P<name>\S+)')
#: keys that one status may have
_FACTS_MAX = 100
#: the part that distinguishes a status of a bridge from others of a similar name
_MARKS = {'bus': 'load_percent', 'drive': 'missed_exchanges'}


class Level(IntEnum):
    """The levels, numbered as in diagnostic_msgs."""

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
class StatusReport:
    """
    What a bridge reports of a bus or a drive.

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
        """The full name of the drive's node, which is in its bridge's namespace."""
        return f'{self.bridge.rpartition("/")[0]}/{self.name}'

    @property
    def state(self) -> str:
        """The state in one word, from the bridge."""
        return self.facts.get('state', '')

    def number(self, key: str) -> float:
        """Return a number from the facts, NaN where there is none, or no finite one."""
        try:
            number = float(self.facts.get(key, 'nan'))
        except ValueError:
            return math.nan
        return number if math.isfinite(number) else math.nan

    def count(self, key: str) -> int:
        """Return a count from the facts, 0 where there is none."""
        number = self.number(key)
        return 0 if math.isnan(number) else int(number)


def read_status(status: Status) -> StatusReport | None:
    """Return the report in a status; None: it is not from a bridge."""
    match = _SUBJECT.fullmatch(status.name)
    if match is None or _MARKS[match['kind']] not in status.facts:
        return None
    bridge = f'/{match["bridge"]}'
    report = StatusReport(
        bridge=bridge, is_drive=match['kind'] == 'drive', name=printable(match['name']),
        level=Level(status.level) if 0 <= status.level <= 3 else Level.ERROR,
        message=printable(status.message),
        facts={printable(key): printable(value)
               for key, value in islice(status.facts.items(), _FACTS_MAX)})
    return report if is_ros_name(bridge) and is_ros_name(report.full_name) else None


#: s that a history reaches back
SPAN = 60.0
_POINTS_MAX = 1200


class History:
    """The last values of one quantity with their times."""

    def __init__(self) -> None:
        self._points: deque[tuple[float, float]] = deque(maxlen=_POINTS_MAX)

    def add(self, value: float, now: float) -> None:
        """Add a value; what is not finite leaves a gap."""
        points = self._points
        while points and now - points[0][0] > SPAN:
            points.popleft()
        if math.isfinite(value):
            points.append((now, value))

    def points(self, now: float) -> tuple[tuple[float, float], ...]:
        """Return (s ago, value), oldest first."""
        return tuple((now - at, value) for at, value in self._points if now - at <= SPAN)


def columns(points: tuple[tuple[float, float], ...], span: float, count: int,
            ) -> tuple[float | None, ...]:
    """
    Return points in columns of equal time, the newest on the right; None where there is none.

    A gap of one column between two points is closed: it only shows that both were read
    a little late.
    """
    found: list[float | None] = [None] * count
    for age, value in points:
        # the right end is half a column ahead, so that a point of this moment has a place
        place = count - 1 - int(age / span * count)
        if 0 <= place < count:
            found[place] = value
    for place in range(1, count - 1):
        if found[place] is None and found[place + 1] is not None:
            found[place] = found[place - 1]
    if count > 1 and found[-1] is None:
        found[-1] = found[-2]
    return tuple(found)


class Rate:
    """The rate of a counter, from its last two updates."""

    def __init__(self) -> None:
        self._last: tuple[float, float] | None = None
        self.value = 0.0

    def went_back(self, count: float) -> bool:
        """Return whether a count is less than the last one: counting has restarted."""
        return self._last is not None and count < self._last[1]

    def update(self, count: float, at: float) -> None:
        """
        Update with a count.

        :param at: s, of whatever clock; a clock or a counter that went back starts over.
        """
        if self._last is not None:
            since, before = self._last
            if at > since and count >= before:
                self.value = (count - before) / (at - since)
            elif at == since:
                return
            else:
                self.value = 0.0
        self._last = (at, count)


Points = tuple[tuple[float, float], ...]
#: the names that families give to a bit without a meaning of its own
_UNNAMED = re.compile(r'bit_([0-9]+)')
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
class ParameterReading:
    """
    The outcome of reading a parameter.

    :param text: the value; '' when it could not be read.
    :param age: s since it was read.
    """

    text: str
    age: float


@dataclass(frozen=True, slots=True)
class Bit:
    """
    One bit of a word.

    :param number: None: unknown.
    :param named: it has a meaning; others are called by their number.
    """

    name: str
    state: bool
    number: int | None = None
    named: bool = True


@dataclass(frozen=True, slots=True)
class DriveSnapshot:
    """
    One drive.

    :param name: full name of its node.
    :param label: as short as it may be among the others.
    :param state: in one or two words, from the bridge.
    :param online: it exchanges process data.
    :param silent: its bridge is silent: the state of the drive is unknown.
    :param advice: in words, and what to do.
    :param control: state of its control word; '' without control.
    :param bits: parameter -> bit -> set.
    :param rate: exchanges per second.
    :param command_age: s; NaN before the first command.
    :param facts: everything in diagnostics.
    :param sampled: a sample was received since it came online.
    :param asked_for: s since its samples were subscribed to; 0: they are not.
    :param parameters: what the drive has; empty until read.
    :param readings: of the parameters that were read.
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
    readings: Mapping[str, ParameterReading] = field(default_factory=dict)
    silent: bool = False

    def bits_of(self, parameter: str) -> list['Bit']:
        """Return the bits of a word by number; those without a known number at the end."""
        info = next((info for info in self.parameters if info.name == parameter), None)
        built_in = BUILT_IN.get(self.place.protocol, {}) if parameter == STATUS_NAME else {}
        numbers = info.bits if info is not None else built_in
        found = []
        for name, state in self.bits.get(parameter, {}).items():
            unnamed = _UNNAMED.fullmatch(name)
            number = numbers.get(name, int(unnamed[1]) if unnamed else None)
            found.append(Bit(name, state, number, named=unnamed is None))
        return sorted(found, key=lambda bit: (
            math.inf if bit.number is None else bit.number, bit.name))


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

    :param silent: s since its last diagnostics, once that is longer than it should be; else 0,
        also when it has ended.
    :param ended: it has ended, and reported the stop of each drive as confirmed.
    """

    name: str
    silent: float = 0.0
    ended: bool = False


@dataclass(frozen=True, slots=True)
class LogLine:
    """
    One line of the log.

    :param at: s since the epoch.
    :param level: as ROS names it.
    :param logger: the name of its logger.
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
    :param unheard: full names of drives that are in the graph, and that no bridge has in its
        diagnostics; s since that is so.
    """

    at: float = 0.0
    bridges: tuple[BridgeSnapshot, ...] = ()
    buses: tuple[BusSnapshot, ...] = ()
    drives: tuple[DriveSnapshot, ...] = ()
    log: tuple[LogLine, ...] = ()
    unheard: Mapping[str, float] = field(default_factory=dict)

    def drive(self, name: str) -> DriveSnapshot | None:
        """Return a drive by its full name."""
        return next((drive for drive in self.drives if drive.name == name), None)


class ModelSource(Protocol):
    """Fills a model; everything happens in :meth:`poll`, which returns soon."""

    def poll(self, now: float) -> None:
        """Handle what has arrived, and request what is missing."""

    def focus(self, *drives: str) -> None:
        """Subscribe to all samples of drives, and to their bits."""

    def glance(self, now: float) -> None:
        """Handle the samples of the drives in focus, and nothing else."""

    def watch(self, wanted: bool) -> None:
        """Subscribe to samples, or to none while no view shows them."""

    @property
    def busy(self) -> bool:
        """Whether an answer is awaited: polling soon is worth it."""

    def close(self) -> None:
        """Leave."""


class StopAction(Enum):
    """The requests that stop a drive."""

    QUICK_STOP = 'quick_stop'
    DISABLE = 'disable'


@dataclass(frozen=True, slots=True)
class OperationOutcome:
    """
    The outcome of a request to a drive.

    :param text: the answer of the bridge or the drive, in words; may be '' after a success.
    """

    success: bool
    text: str = ''


class Operations(Protocol):
    """
    Sends a user's requests to drives; none of them ever moves one.

    The answer comes in a later :meth:`poll`, in its thread.
    """

    def poll(self, stops: Mapping[str, Collection[StopAction]], now: float) -> bool:
        """
        Handle the answers that have arrived.

        :param stops: of each drive: their services are kept ready, so that a stop waits for no
            discovery.
        :return: an answer is still awaited.
        """

    def stop(self, drive: str, stop: StopAction, done: Callable[[OperationOutcome], None],
             now: float) -> None:
        """Stop a drive."""

    def write(self, drive: str, name: str, value: Value, done: Callable[[OperationOutcome], None],
              now: float) -> None:
        """Write a parameter of a drive."""

    def read(self, drive: str, names: Sequence[str],
             done: Callable[[Sequence[Value | None]], None], now: float) -> None:
        """Read parameters of a drive; None: could not be read."""
