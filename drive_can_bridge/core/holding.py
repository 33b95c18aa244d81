# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Setpoints of axes that stay where they are: the neutral value is a position that was measured.

A position axis has no value that is neutral wherever it stands: 0 would send it home. With
``neutral_from`` its setpoint is where the axis is:

============================================ ==================================================
as long as                                   the setpoint
============================================ ==================================================
nothing is known of the position             is not sent without control, and beside ``disable``
                                             it is what it was (0 in the beginning)
nothing drives the axis (control: the drive  follows each sample
reports that it is not enabled)
it is driven, and not armed                  is latched: no sample moves it, so that neither noise
                                             nor a load lets the axis creep
it is driven, and armed                      is what was commanded
it was armed, and is still driven            is latched at what was *sent* last: a command that
                                             never left would be a jump
============================================ ==================================================

When the drive was lost, the position is unknown and has to be measured again. What
is measured is not limited by ``minimum..maximum``: an axis outside of them stays there, too.

A :class:`Limit` travels with the setpoints, but moves nothing.
"""

from drive_can_bridge.core.parameters import Parameter, Value, ValueKind
from drive_can_bridge.core.process_image import LastSent

#: relative error of a difference of two values, far below anything that matters
_ROUNDING = 1e-9


class Setpoint:
    """
    One commanded parameter.

    :ivar raw: raw integer to be sent now; neutral unless armed and fresh.
    :ivar neutral: raw integer that is sent without a fresh command.
    :ivar armed: commands go through.
    :ivar commanded_at: ``now`` of the last accepted command, or None.
    :ivar expired_at_neutral: when it was disarmed because no fresh command kept it, the last one
        was neutral: nothing changed for the drive.
    """

    __slots__ = (
        'armed', 'commanded_at', 'expired_at_neutral', 'neutral', 'parameter', 'raw')

    def __init__(self, parameter: Parameter) -> None:
        self.parameter = parameter
        self.neutral = parameter.neutral_raw
        self.raw = self.neutral
        self.armed = False
        self.commanded_at: float | None = None
        self.expired_at_neutral = False

    @property
    def known(self) -> bool:
        """Whether the neutral value is known: it may be sent, and commands may arm."""
        return True

    def armed_by(self, value: Value) -> bool:
        """
        Return whether a command of this (valid) value arms: it equals neutral.

        A double does within one raw step, compared as values, or within ``arming_tolerance``; a
        bool or an integer exactly.
        """
        parameter = self.parameter
        neutral = parameter.value_from_raw(self.neutral)
        if parameter.kind is not ValueKind.DOUBLE:
            return value == neutral
        allowed = max(abs(parameter.scale), parameter.arming_tolerance)
        return abs(value - neutral) <= allowed * (1.0 + _ROUNDING)

    def disarm(self) -> None:
        """Send neutral until armed again."""
        self.raw = self.neutral
        self.armed = False
        self.commanded_at = None

    def expire(self) -> None:
        """Disarm the setpoint, because no fresh command keeps it."""
        self.expired_at_neutral = self.raw == self.neutral
        self.disarm()


class HeldSetpoint(Setpoint):
    """
    A setpoint with ``neutral_from``.

    :param measured: the actual value whose name ``neutral_from`` is.
    :param place: where it stands in a sample.
    :param sent: what the drive was commanded last.
    :ivar ever_known: since the last ``reset``, its position was known at least once.
    """

    __slots__ = ('_known', '_known_from', '_sent', '_sent_place', 'ever_known', 'measured',
                 'place')

    def __init__(self, parameter: Parameter, measured: Parameter, place: int,
                 sent: LastSent) -> None:
        super().__init__(parameter)
        self.measured = measured
        self.place = place
        self._sent = sent
        self._sent_place = sent.parameters.index(parameter)
        self._known_from = 0
        self.reset()

    @property
    def known(self) -> bool:
        return self._known

    @property
    def told(self) -> bool:
        """Whether the drive was commanded its neutral value since that is known."""
        return self._known and self._sent.times[self._sent_place] > self._known_from

    def armed_by(self, value: Value) -> bool:
        if self.parameter.kind is ValueKind.DOUBLE:
            return super().armed_by(value)
        neutral = self.parameter.value_from_raw(self.neutral)
        return abs(value - neutral) <= self.parameter.arming_tolerance

    def disarm(self) -> None:
        """Stay at the value that was sent last."""
        if self.armed:
            last = self._sent.raws[self._sent_place]
            self.neutral = self.neutral if last is None else last
        super().disarm()

    def reset(self) -> None:
        """Forget that the position was ever known."""
        self.forget()
        self.ever_known = False
        self.neutral = 0
        self.disarm()

    def forget(self) -> None:
        """Record that the axis may be anywhere by now."""
        self._known = False

    def measure(self, raw: int) -> bool:
        """
        Follow the position of the axis, unless a command moves it.

        :param raw: of the actual value. One that the setpoint cannot represent makes the position
            unknown: something else must not be sent in its place.
        :return: something else is to be sent, or may be sent now.
        """
        if self.armed:
            return False
        position = self.parameter.raw_nearest(self.measured.value_from_raw(raw))
        before = self._known, self.neutral
        self._known = position is not None
        if position is not None:
            self.ever_known = True
            self.neutral = self.raw = position
            if not before[0]:
                self._known_from = self._sent.times[self._sent_place]
        return before != (self._known, self.neutral)


class Limit(Setpoint):
    """
    What bounds a drive and moves nothing, such as a torque limit (``limit: true``).

    Commands always go through, and the last one stands, whatever becomes of the drive: what is
    sent without a fresh command is what was commanded last. So it is never more than neutral.
    """

    __slots__ = ()

    def __init__(self, parameter: Parameter) -> None:
        super().__init__(parameter)
        self.reset()

    def disarm(self) -> None:
        """Leave the limit as it is: a stop may need that torque to brake."""

    def reset(self) -> None:
        """Set the value that an activation starts with."""
        self.take(self.parameter.neutral_raw)
        self.armed = True

    def take(self, raw: int) -> bool:
        """Set a commanded value; return whether it differs from the one before."""
        changed = self.raw != raw
        self.raw = self.neutral = raw
        return changed


def make_setpoint(parameter: Parameter, sample: tuple[Parameter, ...],
                  sent: LastSent | None) -> Setpoint:
    """
    Return the setpoint of a parameter.

    :param sample: what is measured, in the order of ``ProcessDataReceived.raws``.
    :param sent: what the drive was commanded last; needed for ``neutral_from``.
    """
    if parameter.limit:
        return Limit(parameter)
    if sent is not None:
        for place, measured in enumerate(sample):
            if measured.name == parameter.neutral_from:
                return HeldSetpoint(parameter, measured, place, sent)
    return Setpoint(parameter)
