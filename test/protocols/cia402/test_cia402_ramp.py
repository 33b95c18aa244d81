# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The end, while a drive that was stopped by SDO is on its way down a ramp of its own."""

import math

from builders import frame
from drives import ServoDrive
import pytest
from servo_builders import Axis

from drive_can_bridge.core.events import Noted

WATCH_ENDS = '605#2316100100000000'
WORDS = '605#2B406000'


class RampedServo(ServoDrive):
    """Takes its time to disable operation, in whatever NMT state (605Ch = 1, a long ramp)."""

    stands_at = math.inf

    def _control(self, word: int) -> None:
        if not (word == 0x07 and self.state == self.ENABLED and self.now < self.stands_at):
            super()._control(word)
        elif self.told[-1:] != [word]:
            self.told.append(word)


def lost_at_speed(after: float) -> tuple[Axis, RampedServo]:
    """Have another master take a drive that runs out of operational, and end a while later."""
    axis = Axis(make=RampedServo, control_timeout=1.0)
    axis.enabled()
    drive = axis.drive
    assert isinstance(drive, RampedServo)
    drive.obeys(0x80)
    axis.says('705#7F')
    axis.live(after)
    assert drive.told[-1] == 0x07
    axis.take()
    axis.talk.events()
    return axis, drive


@pytest.mark.parametrize('after', [0.0, 0.001, 0.005, 0.3])
def test_one_that_does_not_come_down_is_named_at_the_end_and_stays_watched(after: float) -> None:
    axis, drive = lost_at_speed(after)
    axis.ends(5.0)
    assert drive.state == drive.ENABLED
    assert [note for note in axis.talk.events(Noted) if note.danger]
    assert WATCH_ENDS not in axis.take()


@pytest.mark.parametrize('after', [0.0, 0.001, 0.005, 0.3])
def test_one_that_comes_down_in_time_is_watched_until_then(after: float) -> None:
    axis, drive = lost_at_speed(after)
    drive.stands_at = axis.now + 0.5
    axis.deliver(axis.talk.deactivate(axis.now))
    axis.live(0.4)
    assert drive.state == drive.ENABLED
    assert WATCH_ENDS not in axis.take()
    drive.takes(frame(f'{WORDS}07000000'))      # at the end of its ramp
    axis.live(0.2)
    drive.takes(frame(f'{WORDS}07000000'))
    axis.live(5.0)
    assert drive.state != drive.ENABLED
    assert axis.session.stopped
    assert not [note for note in axis.talk.events(Noted) if note.danger]
    assert WATCH_ENDS in axis.take()
