# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The model: takes what arrives from the graph, gives snapshots.

Nothing is believed that arrives: text is made printable, names have to be names, and there is an
upper limit to everything. ``now`` is the time of a steady clock in s.
"""

from collections import deque
from collections.abc import Iterable, Sequence
import math

from drive_can_bridge.core.parameters import Value
from drive_can_bridge.core.text import printable
from drive_can_bridge.monitor.drive import DriveRecord, PARAMETERS_MAX
from drive_can_bridge.monitor.history import Rate
from drive_can_bridge.monitor.reports import Level, read_status, Report, Status
from drive_can_bridge.monitor.snapshot import (
    BridgeSnapshot, BusSnapshot, LogLine, Place, Snapshot, UNKNOWN,
)
from drive_can_bridge.monitor.text import LOG_LIMIT
from drive_can_bridge.monitor.values import ParameterInfo

#: lines of the log kept
LOG_MAX = 500
BRIDGES_MAX, BUSES_MAX, DRIVES_MAX = 64, 256, 1024
#: s that a bridge may be late with its diagnostics, beside one and a half of its periods
_PATIENCE = 1.5
_PERIOD_MIN = 1.0


class _BusRecord:
    """What a bridge says about a bus."""

    def __init__(self) -> None:
        self._sent, self._received = Rate(), Rate()
        self._report: Report | None = None

    def reported(self, report: Report, stamp: float) -> bool:
        """Take a report; return whether its bridge has begun anew."""
        self._report = report
        anew = self._sent.went_back(report.count('frames_sent'))
        self._sent.update(report.count('frames_sent'), stamp)
        self._received.update(report.count('frames_received'), stamp)
        return anew

    def look(self, name: str, *, label: str, silent: float) -> BusSnapshot:
        report = self._report or Report('', False, name, Level.STALE, '')
        if silent:
            return BusSnapshot(name, label, report.bridge, UNKNOWN, Level.STALE,
                               f'its bridge {report.bridge} is silent')
        return BusSnapshot(
            name, label, report.bridge, report.state, report.level, report.message,
            report.number('load_percent'), self._sent.value, self._received.value,
            report.count('frames_rejected'), report.count('error_frames'))


class _BridgeRecord:
    """One bridge: its buses and drives, in the order in which it tells of them."""

    def __init__(self) -> None:
        self.buses: dict[str, _BusRecord] = {}
        self.drives: dict[str, DriveRecord] = {}
        self._at = self._stamp = math.nan
        self._period = _PERIOD_MIN

    def heard(self, stamp: float, now: float) -> None:
        if stamp > self._stamp:
            self._period = max(_PERIOD_MIN, stamp - self._stamp)
        self._at, self._stamp = now, stamp

    def silent(self, now: float) -> float:
        elapsed = now - self._at
        return elapsed if elapsed > 1.5 * self._period + _PATIENCE else 0.0


class Model:
    """
    Everything that is known of all bridges.

    :param namespace: only bridges in it, or below it; '' or '/': all.
    """

    def __init__(self, namespace: str = '') -> None:
        self._prefix = f'/{namespace.strip("/")}/' if namespace.strip('/') else '/'
        self._bridges: dict[str, _BridgeRecord] = {}
        self._drives: dict[str, DriveRecord] = {}
        self._log: deque[LogLine] = deque(maxlen=LOG_MAX)
        self._anew: set[str] = set()

    # -- what arrives -----------------------------------------------------------------------------

    def diagnosed(self, statuses: Iterable[Status], stamp: float, now: float) -> None:
        """
        Take a diagnostic message, of whomever.

        :param stamp: s, of the message.
        """
        reports: dict[str, list[Report]] = {}
        for status in statuses:
            report = read_status(status)
            if report is not None and report.bridge.startswith(self._prefix):
                reports.setdefault(report.bridge, []).append(report)
        for name, found in reports.items():
            if name in self._bridges or len(self._bridges) < BRIDGES_MAX:
                self._reported(self._bridges.setdefault(name, _BridgeRecord()), found, stamp, now)

    def went_online(self, drive: str, online: bool, now: float) -> None:
        """Take ``~/online`` of a drive."""
        if drive in self._drives:
            self._drives[drive].went_online(online, now)

    def responded(self, drive: str, values: Iterable[tuple[str, Value]], now: float) -> None:
        """Take ``~/response`` of a drive."""
        if drive in self._drives:
            self._drives[drive].responses.take(
                [(printable(name), value) for name, value in values], now)

    def requested(self, drive: str, values: Iterable[tuple[str, Value]], now: float) -> None:
        """Take ``~/request`` of a drive."""
        if drive in self._drives:
            self._drives[drive].requests.take(
                [(printable(name), value) for name, value in values], now)

    def bit(self, drive: str, parameter: str, bit: str, state: bool) -> None:
        """Take a bit of a drive."""
        if drive in self._drives:
            self._drives[drive].bits.setdefault(printable(parameter), {})[printable(bit)] = state

    def described(self, drive: str, parameters: Sequence[ParameterInfo]) -> None:
        """Take what a drive says about its parameters."""
        if drive in self._drives:
            self._drives[drive].described(parameters[:PARAMETERS_MAX])

    def read(self, drive: str, readings: Iterable[tuple[str, Value | None]], now: float) -> None:
        """Take values of parameters that were asked for; None: it could not be read."""
        if drive in self._drives:
            self._drives[drive].read(readings, now)

    def placed(self, drive: str, place: Place) -> None:
        """Take where a drive is."""
        if drive in self._drives:
            self._drives[drive].place = place

    def sampled(self, drives: Iterable[str], now: float) -> None:
        """Take note of the drives whose samples are asked for from now on, and of no others."""
        wanted = set(drives)
        for name, drive in self._drives.items():
            drive.sampled(name in wanted, now)

    def logged(self, at: float, level: str, logger: str, text: str) -> None:
        """Take a line of the log, of whomever; ``at`` in s since the epoch."""
        # what comes before the first diagnostics may turn out to be of a bridge
        if not self._bridges or f'/{logger.replace(".", "/")}' in self._bridges:
            self._log.append(LogLine(at, level, printable(logger), printable(text, LOG_LIMIT)))

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

    def silent(self, now: float) -> tuple[str, ...]:
        """Return the full names of bridges that say nothing any more, and of their drives."""
        return tuple(name for bridge, record in self._bridges.items() if record.silent(now)
                     for name in (bridge, *record.drives))

    def take_anew(self) -> set[str]:
        """
        Return the full names of bridges that were started again, and of their drives, once.

        What they have told of themselves may hold no longer, however short a time they were away.
        """
        anew, self._anew = self._anew, set()
        return anew

    def rates(self) -> dict[str, float]:
        """Return the exchanges per second of all drives."""
        return {name: drive.rate for name, drive in self._drives.items()}

    def look(self, now: float, at: float) -> Snapshot:
        """
        Return how everything is.

        :param at: s since the epoch, for the clock of the view.
        """
        bridges, buses, drives = [], [], []
        several = len({name.rpartition('/')[0] for name in self._bridges}) > 1
        for name, bridge in self._bridges.items():
            silent = bridge.silent(now)
            bridges.append(BridgeSnapshot(name, silent))
            place = f'{name[1:].rpartition("/")[0] or name[1:]} ' if len(self._bridges) > 1 else ''
            buses += [bus.look(bus_name, label=f'{place}{bus_name}', silent=silent)
                      for bus_name, bus in bridge.buses.items()]
            drives += [drive.look(now, label=full[1:] if several else full.rpartition('/')[2],
                                  silent=silent)
                       for full, drive in bridge.drives.items()]
        return Snapshot(at, tuple(bridges), tuple(buses), tuple(drives), tuple(
            line for line in self._log
            if f'/{line.logger.replace(".", "/")}' in self._bridges))

    # -- inside -----------------------------------------------------------------------------------

    def _reported(self, bridge: _BridgeRecord, reports: list[Report], stamp: float, now: float,
                  ) -> None:
        """Take all that one bridge says in one message: what it does not name has gone."""
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
                    continue  # of another bridge; two of one name are no drives of anybody
                record = bridge.drives[name] = self._drives[name] = DriveRecord(name)
            anew |= record.reported(report, stamp, now)
        if anew:
            self._anew |= {reports[0].bridge, *bridge.drives}
