# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Statistics that cost an exchange next to nothing: one store, two additions."""

from array import array
from dataclasses import dataclass, field
import math

WINDOW = 1024


class Statistic:
    """
    Mean and maximum since the start, 99th percentile over the last 1,024 samples.

    The percentile is asked for about once a second, for thirty windows in a row, while the
    exchange goes on: sorting them all would keep the interpreter busy for 6 ms. So only those are
    sorted that are not far below the last answer.
    """

    __slots__ = ('_floor', '_window', 'count', 'maximum', 'total')

    def __init__(self) -> None:
        self._window = array('d', bytes(8 * WINDOW))
        self.count = 0
        self.total = 0.0
        self.maximum = math.nan
        self._floor = 0.0

    def add(self, sample: float) -> None:
        """Add one sample."""
        self._window[self.count % WINDOW] = sample
        self.count += 1
        self.total += sample
        if not sample <= self.maximum:
            self.maximum = sample

    @property
    def mean(self) -> float:
        """Mean of all samples; NaN without any."""
        return self.total / self.count if self.count else math.nan

    @property
    def p99(self) -> float:
        """Return the 99th percentile of the window; NaN without samples."""
        if not self.count:
            return math.nan
        samples = self._window[:self.count] if self.count < WINDOW else self._window
        above = len(samples) - math.ceil(0.99 * len(samples)) + 1  # the answer and what exceeds it
        floor = self._floor
        largest = [sample for sample in samples if sample >= floor]
        if len(largest) < above:  # times have become better
            largest = list(samples)
        largest.sort()
        answer = largest[-above]
        self._floor = 0.7 * answer
        return answer

    def samples(self) -> list[float]:
        """Return the samples of the window, in no particular order (for benches)."""
        return list(self._window[:min(self.count, WINDOW)])


@dataclass
class DriveStatistics:
    """
    The counts of a session. Times in s.

    :ivar exchanges: complete request/response exchanges.
    :ivar missed: responses that did not come in time.
    :ivar rejected: frames on the drive's own response identifiers that are malformed or unasked.
    :ivar late: answers to a question whose time was over.
    :ivar late_by: how many s the last of them came after it.
    :ivar short: responses with fewer than 8 bytes that still held what was needed.
    :ivar commands_refused: setpoint commands with a value that cannot be sent.
    :ivar latency: from request to response.
    :ivar period_error: absolute difference between the real and the configured period.
    """

    exchanges: int = 0
    missed: int = 0
    rejected: int = 0
    late: int = 0
    late_by: float = 0.0
    short: int = 0
    commands_refused: int = 0
    requests_ok: int = 0
    requests_failed: int = 0
    last_request_error: str = ''
    latency: Statistic = field(default_factory=Statistic)
    period_error: Statistic = field(default_factory=Statistic)
