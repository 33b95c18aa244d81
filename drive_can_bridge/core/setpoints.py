# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Setpoints: what the drive is told to do, and whether anybody still means it.

A setpoint is *armed* when commands go through, and then it is *fresh* for ``command_timeout``
seconds after each accepted command. Whatever is not armed or not fresh is sent as its neutral
value. After start, after a time-out, after every reconnection and while the drive is not enabled a
setpoint is not armed; with ``rearm: neutral`` only a command that equals neutral arms it, so that
no motor jumps to a setpoint that was left standing somewhere.
"""

from enum import Enum
import math

from drive_can_bridge.core.parameters import Parameter, Value, ValueKind

#: relative error of a difference of two values, far below anything that matters
_ROUNDING = 1e-9


class CommandOutcome(Enum):
    """What became of a command that is valid in itself."""

    ACCEPTED = 'accepted'
    ARMED = 'armed'
    NOT_ARMED = 'not armed'
    DISABLED = 'disabled'


class Setpoint:
    """
    One commanded parameter.

    :ivar raw: raw integer to be sent now; neutral unless armed and fresh.
    :ivar armed: commands go through.
    :ivar commanded_at: ``now`` of the last accepted command, or None.
    """

    __slots__ = ('armed', 'commanded_at', 'neutral', 'parameter', 'raw')

    def __init__(self, parameter: Parameter) -> None:
        self.parameter = parameter
        self.neutral = parameter.neutral_raw
        self.raw = self.neutral
        self.armed = False
        self.commanded_at: float | None = None

    def armed_by(self, value: Value) -> bool:
        """
        Tell whether a command of this (valid) value arms: it equals neutral.

        A double does within one raw step, compared as values; a bool or an integer exactly.
        """
        parameter = self.parameter
        neutral = parameter.value_from_raw(self.neutral)
        if parameter.kind is not ValueKind.DOUBLE:
            return value == neutral
        return abs(value - neutral) <= abs(parameter.scale) * (1.0 + _ROUNDING)

    def disarm(self) -> None:
        """Send neutral until armed again."""
        self.raw = self.neutral
        self.armed = False
        self.commanded_at = None


class Setpoints:
    """
    All setpoints of a drive, in slot order.

    :param timeout: s without a fresh command until a setpoint goes neutral; 0: never.
    :param rearm_immediate: any valid command arms, not only a neutral one.
    :ivar changed: some ``raw`` is not what it was; whoever encodes the telegram clears it.
    :ivar enabled: commands are taken at all: the drive is online, nothing is stopping, and a drive
        with control is enabled.
    :ivar ignored_at: ``now`` of the last command that came while they were not taken.
    """

    def __init__(self, parameters: tuple[Parameter, ...], *, timeout: float,
                 rearm_immediate: bool) -> None:
        self.items = tuple(Setpoint(parameter) for parameter in parameters)
        self.timeout = timeout
        self.rearm_immediate = rearm_immediate
        self.changed = True
        self.enabled = False
        self.ignored_at = -math.inf
        self._oldest = math.inf
        self._expired: list[Setpoint] = []  # found overdue by a command, not told yet

    def command(self, index: int, value: Value, now: float) -> CommandOutcome:
        """
        Take a command for one setpoint. The newest one wins.

        :raises ValueRefused: the value cannot be sent. Nothing changes then, the age included.
        """
        setpoint = self.items[index]
        raw = setpoint.parameter.raw_from_value(value)
        if not self.enabled:
            self.ignored_at = now
            return CommandOutcome.NOT_ARMED
        if self._overdue(setpoint, now):  # however long it takes until the next cycle
            setpoint.disarm()
            self._expired.append(setpoint)
            self._oldest = -math.inf
            self.changed = True
        outcome = CommandOutcome.ACCEPTED
        if not setpoint.armed:
            if not self.rearm_immediate and not setpoint.armed_by(value):
                return CommandOutcome.NOT_ARMED
            setpoint.armed = True
            outcome = CommandOutcome.ARMED
        setpoint.commanded_at = now
        self._oldest = min(self._oldest, now)
        if setpoint.raw != raw:
            setpoint.raw = raw
            self.changed = True
        return outcome

    def expire(self, now: float) -> list[Setpoint]:
        """
        Disarm every setpoint whose last command is older than the time-out.

        :return: those that went neutral for that reason since the last call.
        """
        # ``_oldest`` may be older than the truth, never younger: one comparison is all that a
        # cycle pays while commands are fresh.
        if self.timeout <= 0 or now - self._oldest <= self.timeout:
            return []
        expired, self._expired = self._expired, []
        self._oldest = math.inf
        for setpoint in self.items:
            if self._overdue(setpoint, now):
                setpoint.disarm()
                expired.append(setpoint)
                self.changed = True
            elif setpoint.commanded_at is not None:
                self._oldest = min(self._oldest, setpoint.commanded_at)
        return expired

    def _overdue(self, setpoint: Setpoint, now: float) -> bool:
        return (setpoint.commanded_at is not None
                and 0.0 < self.timeout < now - setpoint.commanded_at)

    def allow(self, taken: bool) -> None:
        """Take commands from now on, or not; while they are not taken, everything is neutral."""
        if taken is not self.enabled:
            self.enabled = taken
            self.ignored_at = -math.inf
            if not taken:
                self.disarm()

    @property
    def at_rest(self) -> bool:
        """Everything that is to be sent is neutral."""
        return all(setpoint.raw == setpoint.neutral for setpoint in self.items)

    def disarm(self) -> None:
        """Send neutral everywhere until armed again."""
        for setpoint in self.items:
            setpoint.disarm()
        self.changed = True
        self._oldest = math.inf
        self._expired.clear()

    @property
    def waiting(self) -> list[Setpoint]:
        """The setpoints that are not armed."""
        return [setpoint for setpoint in self.items if not setpoint.armed]

    def age(self, now: float) -> float:
        """Return the age of the oldest command in force, in s; NaN while there is none."""
        ages = [now - item.commanded_at for item in self.items if item.commanded_at is not None]
        return max(ages, default=math.nan)
