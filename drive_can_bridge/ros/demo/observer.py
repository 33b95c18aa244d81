# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Looks at a running bridge without touching it.

Everything is read without the lock of the exchange: single attributes and tuples, which the
interpreter reads at once. A value may be one exchange older than its neighbour; nobody waits.
"""

from collections import deque
import time

from drive_can_bridge.core.configuration import BridgeConfiguration, DriveConfiguration
from drive_can_bridge.core.parameters import Parameter, Value
from drive_can_bridge.core.session import DriveState, Session
from drive_can_bridge.core.statistics import Statistic
from drive_can_bridge.exchange.exchange import BusExchange
from drive_can_bridge.ros.bridge_node import BridgeNode
from drive_can_bridge.ros.demo.snapshot import (
    as_assignment, Bits, BusSnapshot, DriveSnapshot, give_way, show, Shown, Snapshot, Times, Trend,
)
from drive_can_bridge.ros.diagnostics import BusReporter
from drive_can_bridge.ros.drive_node import DriveNode
from drive_can_bridge.transport.link import steady_now

#: s between two looks at what costs more: percentiles, bus load
_SLOW_PERIOD = 1.0
#: s over which rates are taken
_RATE_WINDOW = 2.0
_TREND_LENGTH = 120


class _Rate:
    """How fast a counter counts."""

    def __init__(self) -> None:
        self._counts: deque[tuple[float, float]] = deque()

    def update(self, count: float, now: float) -> float:
        counts = self._counts
        if counts and count < counts[-1][1]:  # begun anew
            counts.clear()
        counts.append((now, count))
        while len(counts) > 2 and now - counts[1][0] >= _RATE_WINDOW:
            counts.popleft()
        since, before = counts[0]
        return (count - before) / (now - since) if now > since else 0.0


class _DriveObserver:
    """Looks at one drive, whose node may come and go (lifecycle)."""

    def __init__(self, drive: DriveConfiguration) -> None:
        self._drive = drive
        self._rate = _Rate()
        self._samples: deque[float] = deque(maxlen=_TREND_LENGTH)
        self._first = next((parameter for parameter in drive.cyclic_response
                            if parameter.scaled), None)
        self._looked_at = -_SLOW_PERIOD
        self._period_error = self._latency = Times()

    def look(self, node: DriveNode | None, now: float) -> DriveSnapshot:
        give_way()
        session = node.session if node is not None else None
        values = node.values() if node is not None else {}
        if now - self._looked_at >= _SLOW_PERIOD and session is not None:
            self._looked_at = now
            self._period_error = _times(session.statistics.period_error)
            give_way()
            self._latency = _times(session.statistics.latency)
        control = session.control.state if session and session.control is not None else ''
        state = session.state if session else DriveState.OFFLINE
        answering = session is not None and session.online
        parameters = _shown(self._drive, session)
        return DriveSnapshot(
            name=self._drive.name, state=state, answering=answering,
            place=f'{self._drive.bus}, station {self._drive.station}',
            control=control if answering else '', advice=_advice(session),
            setpoints=self._setpoints(session),
            values=tuple(show(parameter, values.get(parameter.name))
                         for parameter in parameters),
            bits=tuple(_bits(parameter, values.get(parameter.name))
                       for parameter in parameters if parameter.bits),
            rate=self._rate.update(session.statistics.exchanges if session else 0, now),
            exchanges=session.statistics.exchanges if session else 0,
            missed=session.statistics.missed if session else 0,
            period_error=self._period_error, latency=self._latency, trend=self._follow(values))

    def _follow(self, values: dict[str, Value]) -> Trend:
        first = self._first
        if first is None:
            return Trend()
        if first.name in values:
            self._samples.append(float(values[first.name]))
        else:
            self._samples.clear()
        return Trend(first.name, first.unit, tuple(self._samples))

    def _setpoints(self, session: Session | None) -> tuple[Shown, ...]:
        if session is None:
            table = self._drive.profile.control
            return tuple(show(parameter, None) for parameter in self._drive.cyclic_request
                         if table is None or parameter.name != table.parameter)
        return tuple(show(item.parameter, item.parameter.value_from_raw(item.raw),
                          strong=item.armed) for item in session.setpoints.items)


class _BusObserver:
    """Looks at one bus, whose exchange may come and go (lifecycle)."""

    def __init__(self, name: str, interface: str, bitrate: int) -> None:
        self._snapshot = BusSnapshot(name, interface, bitrate, 'closed', 0.0, '0', '0', '0')
        self._exchange: BusExchange | None = None
        self._reporter: BusReporter | None = None
        self._looked_at = 0.0

    def look(self, exchange: BusExchange | None, now: float) -> BusSnapshot:
        if exchange is not self._exchange:
            self._exchange = exchange
            # one of its own: reporters remember the counts of their last report
            self._reporter = BusReporter(exchange) if exchange is not None else None
            self._looked_at = -_SLOW_PERIOD
        last = self._snapshot
        if self._reporter is None:
            return BusSnapshot(last.name, last.interface, last.bitrate, 'closed', 0.0,
                               *('0',) * 3)
        if now - self._looked_at >= _SLOW_PERIOD:
            self._looked_at = now
            facts = self._reporter.report(now).facts
            self._snapshot = BusSnapshot(
                last.name, last.interface, last.bitrate, facts['state'],
                self._reporter.load_percent, facts['frames_sent'], facts['frames_received'],
                facts['frames_rejected'])
        return self._snapshot


class Observer:
    """
    Makes snapshots of a bridge.

    :param configuration: what the bridge was given; its drives are shown whether or not the
        bridge has them at the moment.
    """

    def __init__(self, bridge: BridgeNode, configuration: BridgeConfiguration) -> None:
        self._bridge = bridge
        self._drives = {name: _DriveObserver(drive)
                        for name, drive in configuration.drives.items()}
        self._buses = {name: _BusObserver(name, bus.interface, bus.bitrate)
                       for name, bus in configuration.buses.items()}
        self._configuration = configuration
        self._started_at = steady_now()
        self._processor = _Rate()

    def look(self) -> Snapshot:
        """Return how things are now."""
        now = steady_now()
        return Snapshot(
            drives=tuple(observer.look(self._bridge.drives.get(name), now)
                         for name, observer in self._drives.items()),
            buses=tuple(observer.look(self._bridge.exchanges.get(name), now)
                        for name, observer in self._buses.items()),
            uptime=now - self._started_at,
            processor=self._processor.update(time.process_time(), now))

    def lines(self) -> list[str]:
        """Return one line per drive: name, ``online`` or ``offline``, values."""
        lines = []
        for name, drive in self._configuration.drives.items():
            node = self._bridge.drives.get(name)
            values = node.values() if node is not None else {}
            online = node is not None and node.session.online
            assignments = [as_assignment(parameter, values[parameter.name])
                           for parameter in _shown(drive, node.session if node else None)
                           if parameter.name in values]
            lines.append(' '.join([name, 'online' if online else 'offline', *assignments]))
        return lines


def _shown(drive: DriveConfiguration, session: Session | None) -> tuple[Parameter, ...]:
    """Return everything of which a drive has values: what is built in, too."""
    return drive.cyclic_response if session is None else session.sample_parameters


def _advice(session: Session | None) -> str:
    if session is None or not session.active:
        return 'bridge inactive'
    return '' if session.online else session.offline_advice


def _times(statistic: Statistic) -> Times:
    return Times(statistic.mean, statistic.p99)


def _bits(parameter: Parameter, value: Value | None) -> Bits:
    word = None if value is None else parameter.word_from_raw(int(value))
    return Bits(parameter.name, tuple(
        (name, None if word is None else bool(word >> bit & 1)) for name, bit in parameter.bits))
