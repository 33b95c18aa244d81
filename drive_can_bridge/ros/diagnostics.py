# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``/diagnostics``: one status per bus and per drive, in words that say what to do.

Also drives that are offline: the text on one, and which are missing a while after the start.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
import math

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from rclpy.qos import QoSProfile

from drive_can_bridge.clock import Clock, time_of_day
from drive_can_bridge.core import bus_sentences, sentences
from drive_can_bridge.core.events import DriveState
from drive_can_bridge.core.frame import STUFFING
from drive_can_bridge.core.lateness import AnswerTiming, Lateness
from drive_can_bridge.core.messages import NOTHING, Sentence, together
from drive_can_bridge.core.session import Session
from drive_can_bridge.core.statistics import Statistic
from drive_can_bridge.core.text import printable, value_text
from drive_can_bridge.exchange.exchange import BusExchange
from drive_can_bridge.ros.advice import how_to_enable, how_to_reset
from drive_can_bridge.ros.drive_node import control_state, DriveNode
from drive_can_bridge.ros.log import Log
from drive_can_bridge.ros.middleware import publisher
from drive_can_bridge.ros.stamps import Stamps
from drive_can_bridge.transport.end_point import Counts
from drive_can_bridge.transport.error_frames import ADVICE_DISTURBED, BUS_OFF, BusError
from drive_can_bridge.transport.failures import with_outlook
from drive_can_bridge.transport.known_adapters import traits_of

#: s after the activation that a drive may take to be seen
GRACE = 5.0
#: bus load above which a bus is never OK
LOAD_WARNING = 70.0
#: s for which a command that changed nothing is worth a warning
COMMANDS_RECENT = 1.5


def absence(drive: DriveNode) -> Sentence:
    """Return since when a drive is offline, and what to do about it."""
    session, exchange = drive.session, drive.exchange
    what = session.offline_advice
    if exchange.bus_state != 'up':      # which is told once, there
        return (sentences.bus_of_drive_opening if exchange.bus_state == 'opening' else
                sentences.bus_of_drive_down)(exchange.bus.name)
    answers = what.kind is sentences.Absence.ANSWERS
    if not session.ever_online:
        return (sentences.not_online if answers else sentences.never_seen)(what)
    since = time_of_day(drive.lost_at // 1_000_000_000)
    if answers:
        return sentences.offline_since(since, what)
    # what to correct at a first start, this one has behind it
    if session.guesses:
        what = drive.lost_for
    return sentences.silent_since(since, what)


class PresenceCheck:
    """
    Logs once, a while after each activation, which drives were never seen.

    :param drives: of the bridge.
    """

    def __init__(self, log: Log, drives: Sequence[DriveNode], clock: Clock) -> None:
        self._log = log
        self._drives = drives
        self._clock = clock
        self._over = clock.wake_event()
        self._thread = clock.worker(self._run, 'attendance')

    def begin(self) -> None:
        """Start the timer."""
        self._over = self._clock.wake_event()
        self._thread = self._clock.worker(self._run, 'attendance')
        self._thread.start()

    def end(self) -> None:
        """Cancel the timer; wait for a check that is under way."""
        self._over.ring()
        self._thread.join()

    def _run(self) -> None:
        try:
            if not self._over.wait(self._clock.now() + GRACE):
                self.look()
        except Exception as error:  # noqa: BLE001  outermost of a thread: no failure is silent
            self._log.error(sentences.attendance_failed(type(error).__name__, str(error)))

    def look(self) -> None:
        """Log which drives are missing."""
        missing = [drive for drive in self._drives if _never_seen(drive)]
        if not missing:
            return
        for drive in missing:
            with drive.exchange.entered() as entered:
                told = absence(drive) if entered else sentences.bus_hangs(drive.exchange.bus.name)
                of_drive = entered and drive.exchange.bus_state == 'up'
            self._log.source(drive.name).warning(told if of_drive else sentences.not_seen(told))
        online = sum(drive.session.online for drive in self._drives)
        self._log.warning(sentences.drives_missing(
            online, len(self._drives), [drive.name for drive in missing]))


def _never_seen(drive: DriveNode) -> bool:
    session = drive.session
    return (session.active and not session.ever_online and not session.defect
            and session.state is DriveState.OFFLINE)


@dataclass
class StatusEntry:
    """One diagnostic status before it becomes a message."""

    name: str
    level: bytes
    message: Sentence
    facts: dict[str, str] = field(default_factory=dict)


class BusReporter:
    """
    Reports on one bus; keeps the counts of the last report.

    :param period: s, the shortest of its drives.
    """

    def __init__(self, exchange: BusExchange, period: float = math.inf) -> None:
        self._exchange = exchange
        self._period = period
        self._bits = self._failures = 0
        self._counts = Counts()
        self._reported_at = math.nan
        self._load = 0.0

    def report(self, now: float) -> StatusEntry:
        """Return the report for the time since the last one."""
        exchange, link = self._exchange, self._exchange.link
        bits = exchange.received_bits + exchange.sent_bits
        elapsed = now - self._reported_at
        if elapsed > 0:
            self._load = (100.0 * STUFFING * (bits - self._bits)
                          / (elapsed * exchange.bus.bitrate))
        counts = link.counts
        new = counts.minus(self._counts)
        failures = link.send_failures + counts.refused
        new_failures = failures - self._failures
        self._bits, self._reported_at = bits, now
        self._failures, self._counts = failures, counts
        level, message = DiagnosticStatus.OK, sentences.bus_up(
            exchange.bus.interface, str(exchange.bus.channel))
        state = exchange.bus_state
        with exchange.entered() as entered:
            hangs = not entered
        if state == 'up' and link.controller or state == 'down' and link.controller == BUS_OFF:
            state = link.controller
        if hangs:
            state, level = 'hangs', DiagnosticStatus.ERROR
            message = sentences.bus_hangs(exchange.bus.name)
        elif exchange.bus_state != 'up':
            level = DiagnosticStatus.ERROR
            reason = exchange.bus_reason or 'not open yet'
            message = sentences.bus_not_up(
                exchange.bus_state, with_outlook(reason, exchange.bus.reconnect_period))
        elif link.controller or new.error_frames and link.last_bus_error is not None:
            level = DiagnosticStatus.WARN
            message = _bus_error(link.last_bus_error, link.controller, new.error_frames)
        elif new.overflowed > 0:
            level = DiagnosticStatus.WARN
            message = sentences.frames_overflowed(new.overflowed)
        elif new_failures:
            level = DiagnosticStatus.WARN
            why = bus_sentences.adapter_refuses_frames() if new.refused > 0 else link.last_error
            message = sentences.frames_not_sent(new_failures, why)
        elif self._load > LOAD_WARNING:
            level = DiagnosticStatus.WARN
            message = sentences.bus_load_high(self._load)
        traits = traits_of(exchange.bus)
        kept = traits is not None and bool(traits.remedy)
        if traits is not None and kept and level == DiagnosticStatus.OK and (
                self._period <= traits.latency):
            level = DiagnosticStatus.WARN
            message = sentences.adapter_keeps(
                traits.title, traits.latency, self._period, traits.remedy)
        return StatusEntry(f'bus {exchange.bus.name}', level, message, {
            'state': state,
            'code': message.code,
            'load_percent': f'{self._load:.1f}',
            'frames_sent': str(link.frames_sent - counts.refused),
            'frames_received': str(link.frames_received),
            'frames_rejected': str(exchange.frames_rejected),
            'error_frames': str(counts.error_frames),
            'bus_off_count': str(counts.bus_off),
            'reconnections': str(link.reconnections),
            'send_failures': str(failures),
            **({'adapter_latency_ms': f'{1e3 * traits.latency:g}'}
               if traits is not None and kept else {}),
        })


class DriveReporter:
    """
    Reports on one drive; keeps the counts of the last report.

    :param lateness: of the answers of all drives of its bus.
    :ivar ended: the drives have been stopped, and the process ends.
    """

    def __init__(self, drive: DriveNode, lateness: Lateness | None = None) -> None:
        self._drive = drive
        self._lateness = lateness or Lateness()
        self._rejected = self._late = 0
        self._latencies = 0, 0.0        # how many, and their sum
        self._requests = 0
        self.ended = False

    def report(self, now: float) -> StatusEntry:
        """Return the report of this moment."""
        drive, session = self._drive, self._drive.session
        statistics = session.statistics
        rejected = statistics.rejected - self._rejected
        self._rejected = statistics.rejected
        # the session belongs to the threads of the bus; what is computed of many samples does not
        state, level, command_age = DriveState.OFFLINE, DiagnosticStatus.ERROR, math.nan
        message, more = sentences.bus_hangs(drive.exchange.bus.name), dict[str, str]()
        with drive.exchange.entered() as entered:
            drive.looked_at(entered)
            if entered:
                state = session.state
                level, message = self._judge(state, rejected, now)
                command_age = session.setpoints.age(now)
                more = session.facts()
                if session.control is not None:
                    more = {'control_state': control_state(session), **more}
                if session.fault_watch is not None:
                    more = {**more, 'fault_code': session.fault_watch.text}
        self._latencies = statistics.latency.count, statistics.latency.total
        self._requests = statistics.requests_ok + statistics.requests_failed
        facts = {
            'state': state.value,
            'code': message.code,
            'exchanges': str(statistics.exchanges),
            'missed_exchanges': str(statistics.missed),
            **_times('latency', statistics.latency),
            **_times('period_error', statistics.period_error),
            'command_age_s': f'{command_age:.3f}',
            'commands_refused': str(statistics.commands_refused),
            'frames_rejected': str(statistics.rejected),
            'late_answers': str(statistics.late),
            'parameter_requests_ok': str(statistics.requests_ok),
            'parameter_requests_failed': str(
                statistics.requests_failed + drive.requests_refused),
            'last_parameter_error': statistics.last_request_error,
            **more,
        }
        return StatusEntry(f'drive {drive.name}', level, message, facts)

    def _judge(self, state: DriveState, rejected: int, now: float) -> tuple[bytes, Sentence]:
        drive, session = self._drive, self._drive.session
        if session.defect and drive.exchange.active:
            return DiagnosticStatus.ERROR, sentences.stopped_for_defect(session.defect)
        if not session.active:
            if self.ended and drive.may_run:
                return DiagnosticStatus.ERROR, sentences.bridge_ended_may_run()
            return DiagnosticStatus.STALE, (sentences.bridge_ended() if self.ended
                                            else sentences.activate_bridge())
        if state is DriveState.MAPPING_DIFFERS:
            return DiagnosticStatus.ERROR, session.remedy(session.offline_advice)
        if state is DriveState.OFFLINE:
            level = DiagnosticStatus.ERROR if session.ever_online else DiagnosticStatus.STALE
            return level, absence(drive)
        if state is DriveState.FAULT:
            told = [sentences.fault(how_to_reset(session, drive.node), _fault_text(session)),
                    *self._warnings(rejected)]
            return DiagnosticStatus.ERROR, together(told)
        told = self._warnings(rejected)
        if session.error:
            return DiagnosticStatus.ERROR, together((session.error, *told))
        obeyed = session.interlock.obeyed
        if obeyed is not None and obeyed.disregard:
            return DiagnosticStatus.ERROR, together((obeyed.disregard, *told))
        if obeyed is not None and obeyed.stopping and obeyed.unconfirmed:
            told.append(obeyed.holds or sentences.still_running(obeyed.state))
        if state is DriveState.DISABLED:
            advice = how_to_enable(session, drive.node)
            if now - session.setpoints.ignored_at < COMMANDS_RECENT:
                told.append(sentences.disabled_and_commanded(advice))
            elif not told:
                return DiagnosticStatus.OK, sentences.disabled(advice)
            else:
                told.append(sentences.disabled(advice))
        if state is DriveState.NOT_ARMED:
            told.append(self._how_to_arm())
        if told:
            return DiagnosticStatus.WARN, together(told)
        return DiagnosticStatus.OK, sentences.online()

    def _warnings(self, rejected: int) -> list[Sentence]:
        """Return all warnings of a drive that answers."""
        drive, session = self._drive, self._drive.session
        told: list[Sentence] = []
        if session.warning:
            told.append(session.warning)
        slow = self._slowness()
        if slow:
            told.append(slow)
        if drive.foreign_text:
            told.append(sentences.one_master_only(drive.foreign_text))
            drive.foreign_text = NOTHING
        if rejected:
            told.append(sentences.frames_rejected(rejected, drive.rejected_text))
        late, self._late = session.statistics.late - self._late, session.statistics.late
        if late:
            bus = drive.exchange.bus
            told.append(self._lateness.told(bus.name, _answers(drive), traits_of(bus)))
        return told

    def _slowness(self) -> Sentence:
        """Report rounds of polling that take longer than the period allows."""
        session = self._drive.session
        statistics = session.statistics
        count, total = self._latencies
        latency, period = statistics.latency, session.configuration.period
        # requests of users hold a round up, and the first one may have waited for a device to take
        # up the conversation: that is no fault of the drive
        if latency.count <= max(count, 1) or self._requests != (
                statistics.requests_ok + statistics.requests_failed):
            return NOTHING
        mean = (latency.total - total) / (latency.count - count)
        if mean <= period:
            return NOTHING
        return sentences.slow_exchange(mean, period)

    def _how_to_arm(self) -> Sentence:
        drive, session = self._drive, self._drive.session
        if session.busy:
            return session.busy
        name = drive.node.get_fully_qualified_name()
        wanted = []
        for setpoint in session.setpoints.waiting:
            parameter = setpoint.parameter
            if session.setpoints.rearm_immediate:
                wanted.append(sentences.any_command_to(topic=name, name=parameter.name))
            else:
                neutral = value_text(parameter.value_from_raw(setpoint.neutral))
                wanted.append(sentences.neutral_to(
                    neutral=neutral, topic=name, name=parameter.name))
        return sentences.not_armed(wanted)


def _answers(drive: DriveNode) -> AnswerTiming:
    session = drive.session
    return AnswerTiming(session.statistics.late, session.statistics.late_by,
                        session.configuration.period, session.online)


class StatusMessage:
    """
    The message of one status, filled again each time.

    Making twenty messages with twenty entries each, once a second, takes longer than filling them,
    and the exchange wants the interpreter meanwhile.
    """

    def __init__(self, name: str, hardware_id: str) -> None:
        self.status = DiagnosticStatus(name=name, hardware_id=hardware_id)
        self._entries: dict[str, KeyValue] = {}

    def fill(self, report: StatusEntry) -> DiagnosticStatus:
        """Fill the message from a status, and return it."""
        status, entries = self.status, self._entries
        status.level, status.message = report.level, printable(report.message, None)
        if entries.keys() != report.facts.keys():
            self._entries = entries = {key: KeyValue(key=key) for key in report.facts}
            status.values = list(entries.values())
        for key, value in report.facts.items():
            entries[key].value = printable(value, None)
        return status


class Diagnostics:
    """
    Publishes the reports of a bridge.

    :param reported: called with each report, and the bus that it is about.
    """

    def __init__(self, node: Node, exchanges: list[BusExchange], drives: list[DriveNode],
                 stamps: Stamps, reported: Callable[[StatusEntry, str], None],
                 clock: Clock) -> None:
        self._now = clock.now
        self._node = node
        self._stamps = stamps
        self._reported = reported
        self._bus_of = {f'bus {exchange.bus.name}': exchange.bus.name for exchange in exchanges}
        self._bus_of.update({f'drive {drive.name}': drive.drive.bus for drive in drives})
        self._prefix = node.get_fully_qualified_name().lstrip('/')
        self._publisher = publisher(node, DiagnosticArray, '/diagnostics', QoSProfile(depth=10))
        self._drives_of = {exchange.bus.name: [
            drive for drive in drives if drive.drive.bus == exchange.bus.name]
            for exchange in exchanges}
        self._lateness = {bus: Lateness() for bus in self._drives_of}
        self.buses = [BusReporter(exchange, min(
            (drive.drive.period for drive in self._drives_of[exchange.bus.name]),
            default=math.inf)) for exchange in exchanges]
        self.drives = [DriveReporter(drive, self._lateness[drive.drive.bus]) for drive in drives]
        self._lock = clock.lock()   # the last message comes from another thread
        self._message = DiagnosticArray()
        self._statuses: dict[str, StatusMessage] = {}

    def publish(self) -> None:
        """Publish one status per bus and per drive."""
        if not self._node.context.ok():  # shut down from outside: there is no receiver
            return
        message = self._message
        with self._lock:
            message.header.stamp = self._stamps.now()
            message.status = [self._status(report) for report in self.reports(self._now())]
            self._publisher.publish(message)

    def _status(self, report: StatusEntry) -> DiagnosticStatus:
        self._reported(report, self._bus_of[report.name])
        found = self._statuses.get(report.name)
        if found is None:
            found = self._statuses[report.name] = StatusMessage(
                f'{self._prefix}: {report.name}', report.name.split()[-1])
        return found.fill(report)

    def conclude(self) -> None:
        """Publish for the last time: the drives have been stopped, and the process ends."""
        for drive in self.drives:
            drive.ended = True
        self.publish()

    def reports(self, now: float) -> list[StatusEntry]:
        """Return all reports, buses first."""
        for bus, lateness in self._lateness.items():
            lateness.look({drive.name: _answers(drive) for drive in self._drives_of[bus]})
        reporters: list[BusReporter | DriveReporter] = [*self.buses, *self.drives]
        return [reporter.report(now) for reporter in reporters]

    def destroy(self) -> None:
        """Destroy the publisher."""
        self._node.destroy_publisher(self._publisher)


def _fault_text(session: Session) -> str:
    """Return that there is a fault, and which, as far as that is known."""
    watch = session.fault_watch
    if watch is None or not (watch.text or watch.unread):
        return 'fault'
    return f'fault {watch.text}' if watch.text else sentences.fault_unread(watch.unread)


def _bus_error(error: BusError | None, controller: str, count: int) -> Sentence:
    """Return what error frames of a bus that is up mean, and what to do."""
    told = [f'controller {controller}'] if controller else []
    if count:
        told.append(f'{count} error frames' + (f' (the last: {error.text})' if error else ''))
    return sentences.bus_disturbed(
        ', '.join(told), error.advice if error else ADVICE_DISTURBED)


def _times(name: str, statistic: Statistic) -> dict[str, str]:
    return {f'{name}_mean_ms': f'{1e3 * statistic.mean:.3f}',
            f'{name}_p99_ms': f'{1e3 * statistic.p99:.3f}',
            f'{name}_max_ms': f'{1e3 * statistic.maximum:.3f}'}
