# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What would have held, where a busy computer was too late for a time that is configured.

When something is missed, nobody knows yet whether it is late or will never come. So that is told
when it comes, with a value of the key that would have borne what was measured: once, because the
first says which key it is. What comes after :data:`GAP_MAX` was not late but away.
"""

from decimal import Decimal, ROUND_CEILING
import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.reporter import Reporter

#: s without an answer beyond which no computer is merely slow
GAP_MAX = 2.0
#: so much more than what was measured is named
MARGIN = 1.1


def enough(seconds: float) -> float:
    """Return a round number of s, a little more than what was measured."""
    wanted = Decimal(seconds * MARGIN)
    return float(wanted.quantize(Decimal(1).scaleb(wanted.adjusted() - 1), ROUND_CEILING))


class TimingAdvice:
    """
    What one drive was late with.

    :param period_max: the longest period that is allowed for it.
    """

    __slots__ = ('_drive', '_period_max', '_report', '_reported', 'since')

    def __init__(self, drive: DriveConfiguration, report: Reporter,
                 period_max: float = math.inf) -> None:
        self._drive, self._report, self._period_max = drive, report, period_max
        self._reported: set[str] = set()
        #: when its last answer came, of a drive that is lost for want of more; infinity: it is not
        self.since = math.inf

    def lost(self, since: float) -> None:
        """Record that too many answers are missing since then."""
        self.since = since

    def forget(self) -> None:
        """Record that what comes next is no late answer: the device has restarted."""
        self.since = math.inf

    def came(self, at: float) -> None:
        """Report by the first answer of a drive that was lost what would have held."""
        gap, self.since = at - self.since, math.inf
        drive = self._drive
        if 0.0 < gap <= GAP_MAX:
            limit = max(drive.missed_limit, math.floor(MARGIN * gap / drive.period)) + 1
            self.report_once('missed_limit', sentences.more_missed_would_hold(
                gap=gap, limit=limit, seconds=limit * drive.period))

    def late(self, seconds: float) -> Sentence:
        """Return what would have held for an answer so many s after its period: once."""
        period = enough(self._drive.period + seconds)
        if period > self._period_max or 'period' in self._reported:
            return NOTHING
        self._reported.add('period')
        return sentences.longer_period_would_hold(late=seconds, period=period)

    def heartbeat(self, gap: float) -> None:
        """Report what would have held by a heartbeat that came so many s after the last."""
        if 0.0 < gap <= GAP_MAX:
            self.report_once('heartbeat_timeout', sentences.longer_timeout_would_hold(
                gap=gap, timeout=enough(gap)))

    def report_once(self, key: str, text: Sentence) -> None:
        """Report of a key what would have held, once."""
        if key not in self._reported:
            self._reported.add(key)
            self._report.warn(text)
