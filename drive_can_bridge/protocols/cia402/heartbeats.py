# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The heartbeat of the bridge, which the drives of a bus watch (1016h)."""

from collections.abc import Sequence
import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.outbox import Outbox
from drive_can_bridge.core.session import Session, Stage
from drive_can_bridge.protocols.canopen import network
from drive_can_bridge.protocols.cia402.watch import WATCH_INTERVALS
from drive_can_bridge.protocols.timing_advice import enough, TimingAdvice

#: s for which the longest pause between two heartbeats is remembered
GAP_TIME = 5.0


class BridgeHeartbeat:
    """
    The heartbeat that the drives of a bus watch.

    :param node: node-ID of the bridge.
    :param interval: s between two of them.
    :ivar due: when the next one is.
    """

    def __init__(self, node: int, interval: float) -> None:
        self._frame = network.encode_heartbeat(node, network.NmtState.OPERATIONAL)
        self._interval = interval
        self.due = self._sent_at = self._longest_at = -math.inf
        self._longest = 0.0

    def beat(self, outbox: Outbox, now: float) -> None:
        """Send one, if it is due."""
        if now >= self.due:
            self.due = now + self._interval if now > self.due + self._interval else (
                self.due + self._interval)
            outbox.put(self._frame)
            gap = now - self._sent_at
            if gap < math.inf and (gap > self._longest or now > self._longest_at + GAP_TIME):
                self._longest, self._longest_at = gap, now
            self._sent_at = now

    def gap(self, now: float) -> float:
        """Return how many s lay between two of them at most, in the last few seconds."""
        return max(self._longest, now - self._sent_at if self._sent_at > -math.inf else 0.0)

    def rest(self) -> None:
        """Forget what lay between two: a drive is left alone, which may be the last."""
        self._sent_at = -math.inf
        self._longest = 0.0


def common_heartbeat(drives: Sequence[DriveConfiguration]) -> BridgeHeartbeat | None:
    """Return what the drives of a bus watch, as often as one of them wants; None: none does."""
    watching = [drive.options for drive in drives if drive.options.bridge_heartbeat > 0.0]
    return BridgeHeartbeat(watching[0].bridge_node, min(
        each.bridge_heartbeat for each in watching)) if watching else None


class HeartbeatSender:
    """The part of a session that sends the bridge's heartbeat; None: there is none."""

    def __init__(self, session: Session, heartbeat: BridgeHeartbeat | None) -> None:
        self._session, self._heartbeat = session, heartbeat

    def handle_timer(self, now: float) -> None:
        """Send one, if it is due."""
        if self._heartbeat is not None:
            self._heartbeat.beat(self._session.outbox, now)

    @property
    def due(self) -> float:
        """When one is due, or overdue."""
        idle = self._heartbeat is None or self._session.stage is Stage.IDLE
        return math.inf if self._heartbeat is None or idle else self._heartbeat.due

    def stop(self) -> None:
        """Send none on account of this drive: the stage says it."""
        if self._heartbeat is not None:
            self._heartbeat.rest()

    def was_missed(self, timing: TimingAdvice, now: float) -> None:
        """Report that the drive missed the bridge's heartbeat, and what would have held."""
        if self._heartbeat is None:     # whose else it watches, it does not say
            return
        interval = self._session.configuration.options.bridge_heartbeat
        gap = self._heartbeat.gap(now)
        if gap > (WATCH_INTERVALS - 0.5) * interval:
            timing.report_once('bridge_heartbeat', sentences.longer_beat_would_hold(
                gap=gap, interval=enough(gap / WATCH_INTERVALS)))
        else:
            timing.report_once('1016h', sentences.beats_were_sent(gap=gap))
