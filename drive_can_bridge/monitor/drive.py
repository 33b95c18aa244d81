# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What is known of one drive, from all sources together."""

from collections.abc import Iterable, Mapping
import math

from drive_can_bridge.core.parameters import Value, ValueKind
from drive_can_bridge.monitor.history import History, Rate
from drive_can_bridge.monitor.reports import Level, Report
from drive_can_bridge.monitor.snapshot import (
    DriveSnapshot, Place, Reading, Shown, Times, UNKNOWN,
)
from drive_can_bridge.monitor.values import ParameterInfo

OFFLINE, ONLINE = 'offline', 'online'
#: key of diagnostics; there for drives with a control word only
CONTROL_STATE = 'control_state'
#: of a drive that exchanges nothing
_SILENT_STATES = (OFFLINE, 'mapping differs', '')
#: s after which a drive that is sampled all the time, and said to be online, has lost its bridge
SAMPLES_MISSING = 3.0
#: parameters that one drive may tell of, and values that a message may carry
PARAMETERS_MAX = 4000
VALUES_MAX = 64

_KINDS = {bool: ValueKind.BOOL, int: ValueKind.INTEGER, float: ValueKind.DOUBLE}


class _Values:
    """The newest values of a message that carries several, and what they were before."""

    def __init__(self) -> None:
        self.at = -math.inf
        self.values: dict[str, Value] = {}
        self._histories: dict[str, History] = {}

    def take(self, values: Iterable[tuple[str, Value]], now: float) -> None:
        self.at = now
        self.values = dict(list(values)[:VALUES_MAX])
        for name, value in self.values.items():
            history = self._histories.get(name)
            if history is None:
                history = self._histories[name] = History()
            history.add(float(value), now)
        for name in self._histories.keys() - self.values.keys():
            del self._histories[name]

    def shown(self, parameters: Mapping[str, ParameterInfo], now: float, *, current: bool,
              ) -> tuple[Shown, ...]:
        found = []
        for name, value in self.values.items():
            info = parameters.get(name) or ParameterInfo(name, _KINDS[type(value)])
            found.append(Shown(
                name, info.text(value) if current else '',
                info.assignment(value) if current else '', info.unit, info.width,
                self._histories[name].points(now)))
        return tuple(found)


class DriveRecord:
    """
    One drive, filled by :class:`drive_can_bridge.monitor.model.Model`.

    :param name: full name of its node.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.place = Place()
        self.parameters: dict[str, ParameterInfo] = {}
        self.responses, self.requests = _Values(), _Values()
        self.bits: dict[str, dict[str, bool]] = {}
        self._report: Report | None = None
        self._reported_at = math.nan
        self._rate = Rate()
        self._online: bool | None = None
        self._online_at = math.nan
        self._offline_at = -math.inf
        self._sampled_since: float | None = None
        self._readings: dict[str, tuple[str, float]] = {}
        self._told_again = 0

    @property
    def rate(self) -> float:
        """Exchanges per second."""
        return self._rate.value

    def reported(self, report: Report, stamp: float, now: float) -> bool:
        """Take what the bridge says; return whether it has begun anew."""
        self._report, self._reported_at = report, now
        if report.state in _SILENT_STATES:
            self._offline_at = now
        anew = self._rate.went_back(report.count('exchanges'))
        self._rate.update(report.count('exchanges'), stamp)
        return anew

    def went_online(self, online: bool, now: float) -> None:
        """Take ``~/online``."""
        if online != self._online:
            self._online, self._online_at = online, now
        if not online:
            self._offline_at = now

    def sampled(self, wanted: bool, now: float) -> None:
        """Take note whether samples are asked for, or not."""
        if not wanted:
            self._sampled_since = None
        elif self._sampled_since is None:
            self._sampled_since = now

    def described(self, parameters: Iterable[ParameterInfo]) -> None:
        """Take what the drive says of its parameters."""
        known, self.parameters = self.parameters, {info.name: info for info in parameters}
        # told anew: by a bridge that was started again, perhaps with another configuration, behind
        # which there may be another drive
        again = {name for name, info in self.parameters.items()
                 if known.get(name, info) is not info}
        self._readings = {name: reading for name, reading in self._readings.items()
                          if known.get(name) is self.parameters.get(name)}
        self._told_again += bool(again)
        if any(known[name] != self.parameters[name] for name in again):
            # what was in another unit does not belong to the same line
            self.responses, self.requests = _Values(), _Values()

    def read(self, readings: Iterable[tuple[str, Value | None]], now: float) -> None:
        """Take values that a service has read; None: it could not be read."""
        for name, value in readings:
            info = self.parameters.get(name)
            if info is not None:
                self._readings[name] = ('' if value is None else info.text(value), now)

    def look(self, now: float, *, label: str, silent: float) -> DriveSnapshot:
        """
        Return how the drive is.

        :param silent: s for which the bridge says nothing any more, or 0.
        """
        report = self._report or Report('', True, '', Level.STALE, 'nothing known yet')
        state, level, advice, online = self._judge(report, now, silent)
        responses, requests = self.responses, self.requests
        # what it said before it was away is no news of how it is
        sampled = online and responses.at > self._offline_at
        return DriveSnapshot(
            name=self.name, label=label, bridge=report.bridge, state=state, level=level,
            online=online, advice=advice,
            control=report.facts.get(CONTROL_STATE, '') if online else '',
            setpoints=requests.shown(self.parameters, now, current=online),
            values=responses.shown(self.parameters, now, current=sampled),
            bits=self.bits if online else {}, rate=self.rate if online else 0.0,
            exchanges=report.count('exchanges'), missed=report.count('missed_exchanges'),
            period_error=_times(report, 'period_error'), latency=_times(report, 'latency'),
            command_age=report.number('command_age_s'), facts=report.facts,
            sampled=sampled,
            asked_for=0.0 if self._sampled_since is None else now - self._sampled_since,
            place=self.place,
            parameters=tuple(self.parameters.values()),
            readings={name: Reading(text, now - at)
                      for name, (text, at) in self._readings.items()},
            told_again=self._told_again, silent=bool(silent))

    def _judge(self, report: Report, now: float, silent: float) -> tuple[str, Level, str, bool]:
        """Return state, level, advice, and whether it is online."""
        if silent:
            return UNKNOWN, Level.STALE, 'may still be running: its bridge is silent', False
        told_online = report.state not in _SILENT_STATES
        # diagnostics come once a second, this topic at once
        if self._online is not None and self._online_at > self._reported_at:
            if told_online and not self._online:
                return OFFLINE, Level.ERROR, 'offline: it stopped answering', False
            if self._online and not told_online:
                return ONLINE, Level.OK, 'online', True
        quiet = now - max(self.responses.at, self._sampled_since or now)
        if told_online and self.rate and quiet > SAMPLES_MISSING + 3.0 / self.rate:
            return (OFFLINE, Level.ERROR, f'offline: no sample for {quiet:.0f} s: is its bridge '
                    f'{report.bridge} still running?', False)
        return report.state, report.level, report.message, told_online


def _times(report: Report, name: str) -> Times:
    return Times(*(report.number(f'{name}_{kind}_ms') for kind in ('mean', 'p99', 'max')))
