# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Setpoints: what the drive is commanded, and whether the commands are still fresh.

A setpoint is *armed* when commands go through, and then it is *fresh* for ``command_timeout``
seconds after each accepted command. Whatever is not armed or not fresh is sent as its neutral
value. After start, after a time-out, after every reconnection and while the drive is not enabled a
setpoint is not armed; with ``rearm: neutral`` only a command that equals neutral arms it, so that
no motor jumps to a setpoint that was left standing somewhere. What is neutral for an axis that has
to stay where it is: :mod:`.holding`.
"""

from collections.abc import Sequence
from enum import Enum
import math

from drive_can_bridge.core.holding import HeldSetpoint, Limit, make_setpoint, Setpoint
from drive_can_bridge.core.messages import NOTHING, Sentence, together
from drive_can_bridge.core.parameters import is_misplaced_integer, Parameter, Value
from drive_can_bridge.core.process_image import LastSent
from drive_can_bridge.core.sentences import position_not_told, would_jump


class CommandOutcome(Enum):
    """The outcome of a command that is valid in itself."""

    ACCEPTED = 'accepted'
    ARMED = 'armed'
    NOT_ARMED = 'not armed'
    DISABLED = 'disabled'


class Setpoints:
    """
    All setpoints of a drive, in slot order, with the limits among them.

    :param timeout: s without a fresh command until a setpoint goes neutral; 0: never.
    :param rearm_immediate: any valid command arms, not only a neutral one.
    :param sample: what is measured, in the order of samples.
    :param sent: what the drive was commanded last.
    :ivar held: those that stay where the axis is.
    :ivar changed: some ``raw`` is not what it was; cleared when the telegram is encoded.
    :ivar enabled: commands are accepted at all: the drive is online, nothing is stopping, and a
        drive with control is enabled.
    :ivar ignored_at: ``now`` of the last command that came while they were not accepted.
    :ivar expires_at: when to call ``expire``; it may be too early, never too late.
    """

    def __init__(self, parameters: tuple[Parameter, ...], *, timeout: float,
                 rearm_immediate: bool, sample: tuple[Parameter, ...] = (),
                 sent: LastSent | None = None) -> None:
        self.items = tuple(make_setpoint(parameter, sample, sent) for parameter in parameters)
        self.held = tuple(item for item in self.items if isinstance(item, HeldSetpoint))
        self.expires_at = math.inf
        self.rearm_immediate = rearm_immediate
        self.changed = True
        self.enabled = False
        self.ignored_at = -math.inf
        self._timeout = timeout
        self._expired: list[Setpoint] = []  # found overdue by a command, not reported yet

    def command(self, index: int, value: Value, now: float, *,
                active: bool = True) -> CommandOutcome:
        """
        Handle a command for one setpoint. The newest one wins.

        :param active: the bridge is active: then a limit is set, whatever the drive does.
        :raises ValueRefused: the value cannot be sent. Then nothing changes, not even the age.
            Exception: a value that may have been meant as 0 disarms the setpoint.
        """
        setpoint = self.items[index]
        if is_misplaced_integer(value):
            self.disarm_one(index)
        raw = setpoint.parameter.raw_from_value(value)
        if isinstance(setpoint, Limit) and active:
            self.changed |= setpoint.take(raw)
            return CommandOutcome.ACCEPTED
        if not self.enabled:
            self.ignored_at = now
            return CommandOutcome.NOT_ARMED
        if self._overdue(setpoint, now):  # however long it takes until the next cycle
            setpoint.expire()
            self._expired.append(setpoint)
            self.expires_at = now
            self.changed = True
        outcome = CommandOutcome.ACCEPTED
        if not setpoint.armed:
            if not (self.rearm_immediate and not self.held) and not setpoint.armed_by(value):
                return CommandOutcome.NOT_ARMED
            setpoint.armed = True
            outcome = CommandOutcome.ARMED
        setpoint.commanded_at = now
        self.expires_at = min(self.expires_at, self._expiry(setpoint))
        if setpoint.raw != raw:
            setpoint.raw = raw
            self.changed = True
        return outcome

    def old_command(self, index: int, value: Value) -> None:
        """Handle a command that is too old to move anything: one that equals neutral disarms."""
        setpoint = self.items[index]
        if setpoint.armed and (setpoint.armed_by(value) or is_misplaced_integer(value)):
            self.disarm_one(index)

    def disarm_one(self, index: int) -> None:
        """Send neutral for one setpoint until it is armed again; a limit stays as it is."""
        setpoint = self.items[index]
        before = setpoint.raw
        setpoint.disarm()
        self.changed |= setpoint.raw != before

    def expire(self, now: float) -> list[Setpoint]:
        """
        Disarm every setpoint whose last command is older than the time-out.

        :return: those that went neutral for that reason since the last call.
        """
        if now < self.expires_at:   # all that a cycle pays while commands are fresh
            return []
        expired, self._expired = self._expired, []
        for setpoint in self.items:
            if self._overdue(setpoint, now):
                self.changed |= setpoint.raw != setpoint.neutral
                setpoint.expire()
                expired.append(setpoint)
        self.expires_at = self._soonest()
        return expired

    @property
    def timeout(self) -> float:
        """How old a command may become, in s; 0: any age."""
        return self._timeout

    @timeout.setter
    def timeout(self, timeout: float) -> None:
        self._timeout = timeout
        self.expires_at = min(self.expires_at, self._soonest())

    def _overdue(self, setpoint: Setpoint, now: float) -> bool:
        return now >= self._expiry(setpoint)

    def _expiry(self, setpoint: Setpoint) -> float:
        """Return when the last command begins to be too old; infinity: never, or there is none."""
        if setpoint.commanded_at is None or self._timeout <= 0.0:
            return math.inf
        return math.nextafter(setpoint.commanded_at + self._timeout, math.inf)

    def _soonest(self) -> float:
        return min(map(self._expiry, self.items), default=math.inf)

    def allow(self, taken: bool) -> None:
        """
        Accept commands from now on, or not; while they are not accepted, everything is neutral.

        They are not accepted before all neutral values are known, either.
        """
        taken = taken and self.known
        if taken is not self.enabled:
            self.enabled = taken
            self.ignored_at = -math.inf
            if not taken:
                self.disarm()

    # -- axes that stay where they are ------------------------------------------------------------

    @property
    def known(self) -> bool:
        """Whether all neutral values are known."""
        return all(setpoint.known for setpoint in self.held)

    @property
    def unknown(self) -> list[str]:
        """Names of those whose neutral value is unknown: they are not to be written."""
        return [setpoint.parameter.name for setpoint in self.held if not setpoint.known]

    @property
    def ever_known(self) -> bool:
        """Whether all neutral values were known at least once since the last ``reset``."""
        return all(setpoint.ever_known for setpoint in self.held)

    @property
    def untold(self) -> list[HeldSetpoint]:
        """Those whose present position the drive was not sent."""
        return [setpoint for setpoint in self.held if not setpoint.told]

    @property
    def untold_text(self) -> Sentence:
        """Why an axis cannot be driven yet: the drive was not sent its position; '' if it was."""
        why = together(
            position_not_told(setpoint.parameter.name, setpoint.measured.name, setpoint.known)
            for setpoint in self.untold)
        return would_jump(why) if why else NOTHING

    def reset(self) -> None:
        """Start over: no position was ever measured, and limits are neutral."""
        for setpoint in self.items:
            if isinstance(setpoint, (HeldSetpoint, Limit)):
                setpoint.reset()
        self.changed = True

    def forget(self) -> None:
        """Record that the axes may be anywhere by now: the drive was lost."""
        for setpoint in self.held:
            setpoint.forget()

    def measure(self, raws: Sequence[int | None], *, driven: bool) -> bool:
        """
        Follow the positions of a sample; None: of those that are missing.

        :param driven: the drive may be holding its axes: what is known stays as it is.
        :return: something else is to be sent, or may be sent now.
        """
        moved = False
        for setpoint in self.held:
            raw = raws[setpoint.place] if setpoint.place < len(raws) else None
            if driven and setpoint.known:
                continue
            if raw is not None:
                moved |= setpoint.measure(raw)
            elif setpoint.known:    # by now it may be anywhere
                setpoint.forget()
                moved = True
        self.changed |= moved
        return moved

    @property
    def at_rest(self) -> bool:
        """Whether everything that is to be sent is neutral."""
        for setpoint in self.items:     # asked in every cycle: a generator costs twice as much
            if setpoint.raw != setpoint.neutral:
                return False
        return True

    def disarm(self) -> None:
        """Send neutral everywhere until armed again."""
        for setpoint in self.items:
            setpoint.disarm()
        self.changed = True
        self.expires_at = math.inf
        self._expired.clear()

    @property
    def waiting(self) -> list[Setpoint]:
        """The setpoints that are not armed."""
        return [setpoint for setpoint in self.items if not setpoint.armed]

    def age(self, now: float) -> float:
        """Return the age of the oldest command in force, in s; NaN while there is none."""
        ages = [now - item.commanded_at for item in self.items if item.commanded_at is not None]
        return max(ages, default=math.nan)
