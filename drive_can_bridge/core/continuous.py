# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The position of an axis that turns without end, from a counter that wraps.

Differences from sample to sample are taken modulo the width of the counter and added up, so that a
joint goes on where the counter wraps. Between two samples the axis turns by less than half
of that; the configuration is checked for it.
"""

from drive_can_bridge.core.configuration import JointConfiguration
from drive_can_bridge.core.parameters import Parameter


def steps_of(parameter: Parameter, continuous: bool | int) -> int:
    """
    Return after how many raw steps a counter wraps.

    :param continuous: the key of the joint: an integer is their number; else the width counts.
    """
    return 1 << parameter.type.bits if isinstance(continuous, bool) else continuous


class ContinuousPosition:
    """
    Adds up the differences of a raw counter.

    :param slot: of the position in a sample.
    :ivar begun_again: it began again with the last sample, though not for the first time.
    """

    def __init__(self, joint: JointConfiguration, parameters: tuple[Parameter, ...]) -> None:
        self.slot, parameter = next((slot, each) for slot, each in enumerate(parameters)
                                    if each.name == joint.position)
        self._steps = steps_of(parameter, joint.continuous)
        self._last: int | None = None
        self._sum = 0
        self._begun = False
        self.begun_again = False

    def take(self, raw: int) -> int:
        """Add a raw sample; return its position without wraps."""
        last, self._last = self._last, raw
        self.begun_again = last is None and self._begun
        if last is None:
            self._sum, self._begun = raw, True
        else:
            half = self._steps // 2
            self._sum += (raw - last + half) % self._steps - half
        return self._sum

    def begin_again(self) -> None:
        """Start over from the next sample: the drive was offline, or was homed."""
        self._last = None
