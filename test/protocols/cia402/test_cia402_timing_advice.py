# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What would have held where the computer was too late, as a servo and its bridge see it."""

from saying import says
from servo_builders import Axis

from drive_can_bridge.core.events import Noted, StationLost

#: an emergency 8130h of node 5, as CANopenNode 4 sends it when it misses a heartbeat
MISSED = '085#3081110000000000'


def told(axis: Axis) -> list[str]:
    """Return the codes of what somebody should do something about."""
    return [event.text for event in axis.talk.events(Noted) if event.warning]


def test_pdos_that_stay_away_for_a_moment() -> None:
    axis = Axis(heartbeat_timeout=0.0).online()
    axis.mute = True
    axis.live(0.055)    # five periods
    axis.mute = False
    axis.live(0.3)
    assert axis.session.online
    assert told(axis) == [says('more_missed_would_hold')]


def test_as_many_periods_as_were_named_hold() -> None:
    axis = Axis(heartbeat_timeout=0.0).online()
    axis.mute = True
    axis.live(0.055)
    axis.mute = False
    axis.live(0.3)
    limit = next(event.text.fields['limit'] for event in axis.talk.events(Noted))
    again = Axis(heartbeat_timeout=0.0, missed_limit=limit).online()
    again.mute = True
    again.live(0.055)
    again.mute = False
    again.live(0.3)
    assert again.talk.events(StationLost) == []


def test_a_device_that_has_restarted_was_not_late() -> None:
    axis = Axis(heartbeat_timeout=0.0).online()
    axis.mute = True
    axis.live(0.055)
    axis.mute = False
    for each in axis.drive.restarts():
        axis.says(str(each))
    axis.live(0.5)
    assert axis.session.online
    assert says('more_missed_would_hold') not in told(axis)


def test_a_heartbeat_that_is_late() -> None:
    axis = Axis(objects={(0x1017, 0): b'\x64\0'}, heartbeat_producer=0.0).online()
    axis.drive.objects[0x1017, 0] = b'\0\0'
    axis.live(0.55)
    assert [event.reason for event in axis.talk.events(StationLost)] == [
        says('no_heartbeat', timeout=0.35)]
    axis.drive.objects[0x1017, 0] = b'\x64\0'
    axis.live(0.5)
    text, = told(axis)
    assert text == says('longer_timeout_would_hold')
    assert 0.5 < text.fields['gap'] < text.fields['timeout'] < 0.8


def test_a_bridge_that_was_late_with_its_own() -> None:
    axis = Axis().online()
    axis.live(1.0)
    told(axis)
    axis.now += 0.8     # nobody looks at its timers
    axis.says(MISSED)
    text, = [each for each in told(axis) if each == says('longer_beat_would_hold')]
    assert 0.8 <= text.fields['gap'] < 1.1
    assert text.fields['gap'] < 3 * text.fields['interval'] < 1.3 * text.fields['gap']
    axis.says(MISSED)
    assert not [each for each in told(axis) if each == says('longer_beat_would_hold')]


def test_a_bridge_that_was_in_time_names_no_key() -> None:
    axis = Axis().online()
    axis.live(1.0)
    told(axis)
    axis.says(MISSED)
    text, = [each for each in told(axis) if each == says('beats_were_sent')]
    assert text.fields['gap'] < 0.25


def test_the_pause_while_nobody_was_served_is_none_between_two_heartbeats() -> None:
    axis = Axis().online()
    axis.deliver(axis.talk.deactivate(axis.now))
    axis.live(3.0)
    axis.start()
    told(axis)
    axis.says(MISSED)
    assert [each for each in told(axis) if each == says('beats_were_sent')]
