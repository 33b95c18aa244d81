# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The model: is fed with what arrives from the graph, returns snapshots.

Nothing that arrives is trusted: text is made printable, names have to be names, and there is an
upper limit to everything. ``now`` is the time of a steady clock in s.
"""

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.parameters import Value, ValueKind
from drive_can_bridge.core.text import printable
from drive_can_bridge.monitor.snapshot import (
    BridgeSnapshot, BusSnapshot, DriveSnapshot, History, Level, LOG_LIMIT, LogLine,
    ParameterReading, Place, Rate, read_status, Shown, Snapshot, Status, StatusReport, Times,
    UNKNOWN)
from drive_can_bridge.monitor.values import ParameterInfo

OFFLINE, ONLINE = 'offline', 'online'
#: key of diagnostics; there for drives with a control word only
CONTROL_STATE = 'control_state'
#: the last status of a drive: its stop was confirmed, or was not
_ENDED, _ENDED_IN_DOUBT = sentences.bridge_ended().code, sentences.bridge_ended_may_run().code
#: of a drive that exchanges nothing
_SILENT_STATES = (OFFLINE, 'mapping differs', '')
#: s after which a drive that is sampled all the time, and reported online, has lost its bridge
SAMPLES_MISSING = 3.0
#: parameters that one drive may have, and values that a message may carry
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
        self._report: StatusReport | None = None
        self._reported_at = math.nan
        self._rate = Rate()
        self._online: bool | None = None
        self._online_at = math.nan
        self._offline_at = -math.inf
        self._sampled_since: float | None = None
        self._readings: dict[str, tuple[str, float]] = {}

    @property
    def rate(self) -> float:
        """Exchanges per second."""
        return self._rate.value

    def reported(self, report: StatusReport, stamp: float, now: float) -> bool:
        """Handle the bridge's status of the drive; return whether its counts have restarted."""
        self._report, self._reported_at = report, now
        if report.state in _SILENT_STATES:
            self._offline_at = now
        anew = self._rate.went_back(report.count('exchanges'))
        self._rate.update(report.count('exchanges'), stamp)
        return anew

    def went_online(self, online: bool, now: float) -> None:
        """Handle ``~/online``."""
        if online != self._online:
            self._online, self._online_at = online, now
        if not online:
            self._offline_at = now

    def sampled(self, wanted: bool, now: float) -> None:
        """Set whether samples are asked for."""
        if not wanted:
            self._sampled_since = None
        elif self._sampled_since is None:
            self._sampled_since = now

    def described(self, parameters: Iterable[ParameterInfo]) -> None:
        """Handle the descriptors of the drive's parameters."""
        known, self.parameters = self.parameters, {info.name: info for info in parameters}
        # described again: by a restarted bridge, perhaps with another configuration, behind
        # which there may be another drive
        again = {name for name, info in self.parameters.items()
                 if known.get(name, info) is not info}
        self._readings = {name: reading for name, reading in self._readings.items()
                          if known.get(name) is self.parameters.get(name)}
        if any(known[name] != self.parameters[name] for name in again):
            # what was in another unit does not belong to the same line
            self.responses, self.requests = _Values(), _Values()

    def read(self, readings: Iterable[tuple[str, Value | None]], now: float) -> None:
        """Handle values that a service has read; None: could not be read."""
        for name, value in readings:
            info = self.parameters.get(name)
            if info is not None:
                self._readings[name] = ('' if value is None else info.text(value), now)

    @property
    def stopped(self) -> bool:
        """Whether its bridge has ended, with the stop of this drive confirmed."""
        return self._farewell == _ENDED

    @property
    def _farewell(self) -> str:
        """The code of its bridge's farewell; '' where there was none, or it was restarted."""
        if self._report is None or self._online and self._online_at > self._reported_at:
            return ''
        code = self._report.facts.get('code', '')
        return code if code in (_ENDED, _ENDED_IN_DOUBT) else ''

    def look(self, now: float, *, label: str, silent: float, started_here: bool = False,
             ) -> DriveSnapshot:
        """
        Return a snapshot of the drive.

        :param silent: s for which the bridge is silent, or 0.
        :param started_here: no advice to start its bridge again.
        """
        if self._farewell:      # that was the last status: it shows how the drive was left
            silent = 0.0
        report = self._report or StatusReport('', True, '', Level.STALE, 'nothing known yet')
        state, level, advice, online = self._judge(report, now, silent)
        if started_here and self.stopped:
            advice = sentences.bridge_ended_here()
        responses, requests = self.responses, self.requests
        # samples from before it was offline are not its present state
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
            readings={name: ParameterReading(text, now - at)
                      for name, (text, at) in self._readings.items()},
            silent=bool(silent))

    def _judge(self, report: StatusReport, now: float, silent: float,
               ) -> tuple[str, Level, str, bool]:
        """Return state, level, advice, and whether it is online."""
        if silent:
            return UNKNOWN, Level.STALE, sentences.bridge_silent_may_run(), False
        told_online = report.state not in _SILENT_STATES
        # diagnostics come once a second, this topic at once
        if self._online is not None and self._online_at > self._reported_at:
            if told_online and not self._online:
                return OFFLINE, Level.ERROR, sentences.stopped_answering(), False
            if self._online and not told_online:
                return ONLINE, Level.OK, 'online', True
        quiet = now - max(self.responses.at, self._sampled_since or now)
        if told_online and self.rate and quiet > SAMPLES_MISSING + 3.0 / self.rate:
            return (OFFLINE, Level.ERROR, sentences.no_sample(quiet, report.bridge), False)
        return report.state, report.level, report.message, told_online


def _times(report: StatusReport, name: str) -> Times:
    return Times(*(report.number(f'{name}_{kind}_ms') for kind in ('mean', 'p99', 'max')))


#: lines of the log kept
LOG_MAX = 500
BRIDGES_MAX, BUSES_MAX, DRIVES_MAX = 64, 256, 1024
#: s that a bridge may be late with its diagnostics, beside one and a half of its periods
_PATIENCE = 1.5
#: s of that period: assumed until it is known (an answer may take its time), and limits
_PERIOD_UNKNOWN, _PERIOD_MIN, _PERIOD_MAX = 3.0, 1.0, 3600.0


class _BusRecord:
    """What a bridge reports of a bus."""

    def __init__(self) -> None:
        self._sent, self._received = Rate(), Rate()
        self._report: StatusReport | None = None

    def reported(self, report: StatusReport, stamp: float) -> bool:
        """Handle a status; return whether the counts of its bridge have restarted."""
        self._report = report
        anew = self._sent.went_back(report.count('frames_sent'))
        self._sent.update(report.count('frames_sent'), stamp)
        self._received.update(report.count('frames_received'), stamp)
        return anew

    def look(self, name: str, *, label: str, silent: float) -> BusSnapshot:
        report = self._report or StatusReport('', False, name, Level.STALE, '')
        if silent:
            return BusSnapshot(name, label, report.bridge, UNKNOWN, Level.STALE,
                               sentences.bridge_silent(bridge=report.bridge))
        return BusSnapshot(
            name, label, report.bridge, report.state, report.level, report.message,
            report.number('load_percent'), self._sent.value, self._received.value,
            report.count('frames_rejected'), report.count('error_frames'))


class _BridgeRecord:
    """One bridge: its buses and drives, in the order of its diagnostics."""

    def __init__(self) -> None:
        self.buses: dict[str, _BusRecord] = {}
        self.drives: dict[str, DriveRecord] = {}
        self._at = self._stamp = math.nan
        self._paced_at = -math.inf
        self._period = _PERIOD_UNKNOWN

    def heard(self, stamp: float, now: float) -> None:
        # else its host's clock was set: nothing else runs so much faster there than here
        if 0.0 < stamp - self._stamp <= 2.0 * (now - self._at) + _PERIOD_UNKNOWN:
            self._goes_on_after(stamp - self._stamp)
        self._at, self._stamp = now, stamp

    def paced(self, period: float, now: float) -> None:
        self._paced_at = now
        if not math.isnan(period):
            self._goes_on_after(period)

    def _goes_on_after(self, period: float) -> None:
        self._period = min(max(period, _PERIOD_MIN), _PERIOD_MAX)

    def late(self, now: float) -> bool:
        """Return whether its period is to be read again: it may have become longer."""
        return now - max(self._at, self._paced_at) > 1.5 * self._period

    def silent(self, now: float) -> float:
        elapsed = now - self._at
        return elapsed if elapsed > 1.5 * self._period + _PATIENCE else 0.0


class Model:
    """
    Everything that is known of all bridges.

    :param namespace: only bridges in it, or below it; '' or '/': all.
    :param started_here: the viewer has started the bridge, and ends it.
    """

    def __init__(self, namespace: str = '', *, started_here: bool = False) -> None:
        self._started_here = started_here
        self._prefix = f'/{namespace.strip("/")}/' if namespace.strip('/') else '/'
        self._bridges: dict[str, _BridgeRecord] = {}
        self._drives: dict[str, DriveRecord] = {}
        self._log: deque[LogLine] = deque(maxlen=LOG_MAX)
        self._anew: set[str] = set()
        self._noticed: dict[str, float] = {}

    # -- what arrives -----------------------------------------------------------------------------

    def diagnosed(self, statuses: Iterable[Status], stamp: float, now: float) -> None:
        """
        Handle a diagnostic message, of any node.

        :param stamp: s, of the message.
        """
        reports: dict[str, list[StatusReport]] = {}
        for status in statuses:
            report = read_status(status)
            if report is not None and report.bridge.startswith(self._prefix):
                reports.setdefault(report.bridge, []).append(report)
        for name, found in reports.items():
            if name in self._bridges or len(self._bridges) < BRIDGES_MAX:
                self._reported(self._bridges.setdefault(name, _BridgeRecord()), found, stamp, now)

    def went_online(self, drive: str, online: bool, now: float) -> None:
        """Handle ``~/online`` of a drive."""
        if drive in self._drives:
            self._drives[drive].went_online(online, now)

    def responded(self, drive: str, values: Iterable[tuple[str, Value]], now: float) -> None:
        """Handle ``~/response`` of a drive."""
        if drive in self._drives:
            self._drives[drive].responses.take(
                [(printable(name), value) for name, value in values], now)

    def requested(self, drive: str, values: Iterable[tuple[str, Value]], now: float) -> None:
        """Handle ``~/request`` of a drive."""
        if drive in self._drives:
            self._drives[drive].requests.take(
                [(printable(name), value) for name, value in values], now)

    def bit(self, drive: str, parameter: str, bit: str, state: bool) -> None:
        """Handle a bit of a drive."""
        if drive in self._drives:
            self._drives[drive].bits.setdefault(printable(parameter), {})[printable(bit)] = state

    def described(self, drive: str, parameters: Sequence[ParameterInfo]) -> None:
        """Handle the descriptors of a drive's parameters."""
        if drive in self._drives:
            self._drives[drive].described(parameters[:PARAMETERS_MAX])

    def read(self, drive: str, readings: Iterable[tuple[str, Value | None]], now: float) -> None:
        """Handle values of parameters that were read; None: could not be read."""
        if drive in self._drives:
            self._drives[drive].read(readings, now)

    def paced(self, bridge: str, period: float, now: float) -> None:
        """Set the period of a bridge's diagnostics in s; NaN: unknown."""
        if bridge in self._bridges:
            self._bridges[bridge].paced(period, now)

    def placed(self, drive: str, place: Place) -> None:
        """Set where a drive is."""
        if drive in self._drives:
            self._drives[drive].place = place

    def sampled(self, drives: Iterable[str], now: float) -> None:
        """Set the drives whose samples are subscribed to, and no others."""
        wanted = set(drives)
        for name, drive in self._drives.items():
            drive.sampled(name in wanted, now)

    def logged(self, at: float, level: str, logger: str, text: str) -> None:
        """Handle a line of the log, of any node; ``at`` in s since the epoch."""
        # what comes before the first diagnostics may turn out to be of a bridge
        if not self._bridges or f'/{logger.replace(".", "/")}' in self._bridges:
            self._log.append(LogLine(at, level, printable(logger), printable(text, LOG_LIMIT)))

    def noticed(self, drives: Iterable[str], now: float) -> None:
        """Set the full names of all drives in the graph that no bridge reports."""
        found = sorted(name for name in drives if name.startswith(self._prefix))[:DRIVES_MAX]
        self._noticed = {name: self._noticed.get(name, now) for name in found}

    # -- what is known ----------------------------------------------------------------------------

    @property
    def bridges(self) -> tuple[str, ...]:
        """Full names of all bridges."""
        return tuple(self._bridges)

    @property
    def drives(self) -> tuple[str, ...]:
        """Full names of all drives."""
        return tuple(self._drives)

    def drives_of(self, bridge: str) -> tuple[str, ...]:
        """Return the full names of the drives of a bridge."""
        record = self._bridges.get(bridge)
        return tuple(record.drives) if record else ()

    def doubtful(self, now: float) -> tuple[str, ...]:
        """Return the full names of bridges that are late, and of the drives of silent ones."""
        return tuple(name for bridge, record in self._bridges.items() if record.late(now)
                     for name in (bridge, *(record.drives if record.silent(now) else ())))

    def take_anew(self) -> set[str]:
        """
        Return the full names of restarted bridges, and of their drives, once.

        What was read from them may be outdated, however short a time they were away.
        """
        anew, self._anew = self._anew, set()
        return anew

    def rates(self) -> dict[str, float]:
        """Return the exchanges per second of all drives."""
        return {name: drive.rate for name, drive in self._drives.items()}

    def look(self, now: float, at: float) -> Snapshot:
        """
        Return a snapshot of everything.

        :param at: s since the epoch, for the clock of the view.
        """
        bridges, buses, drives = [], [], []
        several = len({name.rpartition('/')[0] for name in self._bridges}) > 1
        for name, bridge in self._bridges.items():
            silent = bridge.silent(now)
            # of one drive that may run, the banner of a silent bridge warns, too
            ended = bool(bridge.drives) and all(
                drive.stopped for drive in bridge.drives.values())
            bridges.append(BridgeSnapshot(name, 0.0 if ended else silent, ended))
            place = f'{name[1:].rpartition("/")[0] or name[1:]} ' if len(self._bridges) > 1 else ''
            buses += [bus.look(bus_name, label=f'{place}{bus_name}', silent=silent)
                      for bus_name, bus in bridge.buses.items()]
            drives += [drive.look(now, label=full[1:] if several else full.rpartition('/')[2],
                                  silent=silent, started_here=self._started_here)
                       for full, drive in bridge.drives.items()]
        return Snapshot(at, tuple(bridges), tuple(buses), tuple(drives), tuple(
            line for line in self._log
            if f'/{line.logger.replace(".", "/")}' in self._bridges),
            {name: now - at for name, at in self._noticed.items() if name not in self._drives})

    # -- inside -----------------------------------------------------------------------------------

    def _reported(self, bridge: _BridgeRecord, reports: list[StatusReport], stamp: float,
                  now: float) -> None:
        """Handle all that one bridge reports in one message: what it leaves out is removed."""
        bridge.heard(stamp, now)
        buses = {report.name: report for report in reports if not report.is_drive}
        drives = {report.full_name: report for report in reports if report.is_drive}
        for gone in bridge.buses.keys() - buses.keys():
            del bridge.buses[gone]
        for gone in bridge.drives.keys() - drives.keys():
            del bridge.drives[gone], self._drives[gone]
        anew = False
        for name, report in list(buses.items())[:BUSES_MAX]:
            anew |= bridge.buses.setdefault(name, _BusRecord()).reported(report, stamp)
        for name, report in drives.items():
            record = bridge.drives.get(name)
            if record is None:
                if name in self._drives or len(self._drives) >= DRIVES_MAX:
                    continue  # of another bridge; two of one name count for no bridge
                record = bridge.drives[name] = self._drives[name] = DriveRecord(name)
            anew |= record.reported(report, stamp, now)
        if anew:
            self._anew |= {reports[0].bridge, *bridge.drives}
