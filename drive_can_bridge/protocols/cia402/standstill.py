# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Whether an axis stands: one meaning, for quick stops, homing and the set-up.

It stands when, for :data:`STILL` seconds without a break, nothing says that it moves:

========= =====================================================================================
object    says that it moves
========= =====================================================================================
6064h     leaves a :class:`Band`, or goes one way only by more than one raw step
606Ch     (6044h where only that exists) above 606Fh, or not 0 where there is no 606Fh. It counts
          for nothing once 6064h has been in its band for :data:`LONG`, and it has not changed by
          one bit meanwhile (frozen), or 6064h has (so that one is alive, and this is noise)
bit 10    where neither exists: low in that state, then set in a row, says that it stands
========= =====================================================================================

In *quick stop active* 605Ah decides what else counts (:attr:`Standstill.holds`). Real drives stay
in that state whatever 605Ah says, freeze 606Ch at its last value, never set bit 10, or have none
of all these; encoders dither.
"""

from collections.abc import Sequence
from itertools import chain
import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.cia402 import states
from drive_can_bridge.protocols.cia402.pdo import response_pdos
from drive_can_bridge.protocols.cia402.states import ServoState, state_of
from drive_can_bridge.protocols.cia402.transactor import (
    ObjectRead, Procedure, SdoChannel, Transfer)
from drive_can_bridge.protocols.transactor import Refused, Silence

#: s for which nothing may say that the axis moves
STILL = 0.5
#: s in its band that say more than a 606Ch that is frozen, or noise
LONG = 2.0
#: answered cycles in a row in which a bit has to be set
IN_A_ROW = 5
#: 605Ah: the drive stays in quick stop active
_STAYS = range(5, 9)
#: relative error of a quotient of two values, far below anything that matters
_ROUNDING = 1e-9
#: what is read where 606Ch is refused
_INSTEAD = {states.VELOCITY: states.VELOCITY_VL, states.VELOCITY_VL: 0}


class Band:
    """
    A position that stays in a band.

    :param width: of the band, in raw steps.
    :ivar since: when it came in.
    :ivar seen_at: when it was seen last.
    :ivar left: how often it has left the band since the beginning.
    :ivar changed: it has changed since the beginning.
    """

    def __init__(self, width: float) -> None:
        self._width = width
        self._low = self._high = self._from = 0
        self._up: bool | None = None    # the way that it went last
        self._changed_at = self._against_at = -math.inf     # and the last change the other way
        self.begin()

    def begin(self) -> None:
        """Know nothing."""
        self.since, self.seen_at = math.inf, -math.inf
        self.left, self.changed = 0, False
        self._last: int | None = None

    def take(self, position: int, now: float) -> None:
        """Record a position."""
        before, self._last, self.seen_at = self._last, position, now
        if before is None:
            self._come_in(position, now)
            return
        if position == before:
            return
        self.changed = True
        self._low, self._high = min(self._low, position), max(self._high, position)
        if self._high - self._low > self._width:
            self.left += 1
            self._come_in(position, now)
            return
        up = position > before
        if up is not self._up:
            self._from, self._against_at, self._up = before, self._changed_at, up
        self._changed_at = now

    def _come_in(self, position: int, now: float) -> None:
        self.since = now
        self._low = self._high = self._from = position
        self._up, self._changed_at, self._against_at = None, -math.inf, -math.inf

    @property
    def creeps(self) -> bool:
        """It goes one way only, by more than one raw step."""
        recent = self.seen_at - STILL
        return (self._changed_at > recent >= self._against_at
                and abs((self._last or 0) - self._from) > 1)

    def stays(self, duration: float) -> bool:
        """Return whether it has been in its band so long, and does not creep."""
        return self.seen_at - self.since >= duration and not self.creeps


class Standstill:
    """
    What is known of the motion of one axis, and of its quick stop.

    :ivar watching: it is to be known whether the axis stands; see :meth:`poll`.
    :ivar quick_stop_option: 605Ah; None: the drive has none.
    :ivar position: the newest 6064h; None: not known.
    :ivar band: that of 6064h since :meth:`begin`.
    """

    def __init__(self, drive: DriveConfiguration) -> None:
        self._timeout = drive.control_timeout
        sample = chain.from_iterable(each.parameters for each in response_pdos(drive))
        self._places = {each.index: place for place, each in enumerate(sample)
                        if each.index in (*_INSTEAD, states.POSITION) and not each.subindex}
        self.band = Band(_width(drive))
        self.quick_stop_option: int | None = None
        self._state: ServoState | None = None
        self.forget()

    def forget(self) -> None:
        """Forget what is known of the drive, also which objects it has."""
        self._position_object, self._velocity_object = states.POSITION, states.VELOCITY
        self._state = None
        self.begin(-math.inf)
        self.watching = False

    def begin(self, now: float) -> None:
        """Watch whether the axis stands, from now on; what was measured before does not count."""
        self.watching, self._since, self._now = True, now, now
        self.band.begin()
        self._threshold: int | None = None
        self._velocity: int | None = None
        self._velocity_at, self._same_since, self._slow_since = -math.inf, math.inf, math.inf
        self._seen_low, self._in_a_row = False, 0
        self._mute: set[int] = set()    # was asked, and did not tell

    def end(self) -> None:
        """Watch it no more."""
        self.watching = False

    # -- what is seen -----------------------------------------------------------------------------

    def status(self, raw: int, now: float) -> None:
        """Record a status word: in *quick stop active* the axis is watched."""
        self._now, state = now, state_of(raw)
        if state is not self._state:
            self._state = state
            if state is ServoState.QUICK_STOP_ACTIVE:
                self.begin(now)
            else:
                self.end()
        if raw & states.TARGET_REACHED:
            self._in_a_row += self._seen_low
        else:
            self._seen_low, self._in_a_row = True, 0

    def sampled(self, raws: Sequence[int | None], now: float) -> None:
        """Record a sample, its status word first."""
        for index, place in self._places.items():
            raw = raws[place] if place < len(raws) else None
            if raw is None:
                continue
            if index == states.POSITION:
                self.band.take(raw, now)
            elif index == self._velocity_object:
                self._take_velocity(raw, now)

    def poll(self, channel: SdoChannel, *, sampled: bool = True) -> Procedure[None]:
        """
        Read once what says whether the axis moves.

        :param sampled: what is in samples is taken from there.
        """
        if self._threshold is None:
            reply = yield Transfer(states.VELOCITY_THRESHOLD, attempts=1)
            if not isinstance(reply, Silence):      # one that is refused is 0
                self._threshold = 0 if isinstance(reply, Refused) else reply.number(2)
        if self._velocity_object and not (sampled and self._velocity_object in self._places):
            reply = yield Transfer(self._velocity_object, attempts=1)
            if isinstance(reply, ObjectRead):
                length = 2 if self._velocity_object == states.VELOCITY_VL else 4
                self._take_velocity(reply.number(length, signed=True), channel.now)
            elif isinstance(reply, Refused) and reply.absent:
                self._velocity_object = _INSTEAD[self._velocity_object]
            else:
                self._mute.add(self._velocity_object)
        if self._position_object and not (sampled and self._position_object in self._places):
            reply = yield Transfer(self._position_object, attempts=1)
            if isinstance(reply, ObjectRead):
                self.band.take(reply.number(4, signed=True), channel.now)
            elif isinstance(reply, Refused) and reply.absent:
                self._position_object = 0
            else:
                self._mute.add(self._position_object)

    @property
    def _tells_position(self) -> bool:
        """It may yet; one that was asked, and has never told since the beginning, does not."""
        return bool(self._position_object) and (
            self._position_object not in self._mute or self.band.since < math.inf)

    @property
    def _tells_velocity(self) -> bool:
        return bool(self._velocity_object) and (
            self._velocity_object not in self._mute or self._velocity is not None)

    def _take_velocity(self, velocity: int, now: float) -> None:
        if velocity != self._velocity:
            self._same_since = now
        self._velocity, self._velocity_at = velocity, now
        if abs(velocity) > (self._threshold or 0):
            self._slow_since = math.inf
        else:
            self._slow_since = min(self._slow_since, now)

    # -- what follows -----------------------------------------------------------------------------

    @property
    def stands(self) -> bool:
        """Nothing has said for long enough that the axis moves."""
        if not self._tells_position and not self._tells_velocity:
            return self._says_so
        if self._tells_position and not self.band.stays(STILL):
            return False
        return (not self._tells_velocity or self._velocity_at - self._slow_since >= STILL
                or self._tells_position and self._counts_for_nothing)

    @property
    def _counts_for_nothing(self) -> bool:
        """606Ch is frozen, or noise."""
        return self.band.seen_at - self.band.since >= LONG and (
            self.band.changed or self._velocity_at - self._same_since >= LONG)

    @property
    def _says_so(self) -> bool:
        """Bit 10 does, which was low in this state."""
        return self._in_a_row >= IN_A_ROW

    @property
    def holds(self) -> bool:
        """
        It stands in a quick stop, which does not end by itself.

        Where 605Ah says that it does, or nothing, the drive is given its time to leave that state.
        """
        if self._state is not ServoState.QUICK_STOP_ACTIVE:
            return False
        if self.quick_stop_option in _STAYS:
            return self._says_so or self.stands
        return self._now - self._since >= 0.5 * self._timeout and self.stands

    @property
    def untold(self) -> bool:
        """
        No object reports whether it stands in its quick stop, and its time is over.

        That is enough for what users ask for, and says nothing else.
        """
        return (self._state is ServoState.QUICK_STOP_ACTIVE
                and not self._tells_position and not self._tells_velocity
                and not self._says_so and self._now - self._since >= self._timeout)


def _width(drive: DriveConfiguration) -> float:
    """Return the width of the band of 6064h."""
    table = drive.profile.parameters
    for each in (*drive.cyclic_request, *table.values()):
        measured = table.get(each.neutral_from)
        if measured is not None and measured.index == states.POSITION:
            return place_of(each, measured)
    return 1.0


def place_of(target: Parameter, measured: Parameter) -> float:
    """Return what counts as one place, in raw steps of what is measured: as much as arms."""
    return max(1.0, target.arming_tolerance / abs(measured.scale) * (1.0 + _ROUNDING))
