# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Sentences of the contract that only show where a drive is in the middle of something."""

from servo_builders import Axis
from test_cia402_modes import home, meet

from drive_can_bridge.core.control import ControlAction


def test_an_axis_that_is_halted_stays_so_until_homing_starts() -> None:
    axis, drive = meet('pp', homing=True)
    axis.commands(1000.0, 2000.0)
    axis.live(0.6)
    assert drive.told[-1] == 0x010F
    axis.take()
    assert home(axis) == [('home', True, 'homed')]
    sent = axis.take()
    start = next(at for at, text in enumerate(sent) if text.startswith('205#1F00'))
    before = {text[4:8] for text in sent[:start] if text.startswith('205#')}
    assert before == {'0F01'}


def test_the_mode_stays_while_a_quick_stop_ends_a_homing() -> None:
    axis, drive = meet('csp', homing=True)
    drive.homing = -1
    home(axis, 0.2)
    drive.braking = 30
    axis.take()
    axis.asks(ControlAction.QUICK_STOP, 0.1)
    assert drive.state == drive.QUICK_STOP
    assert not any(text.startswith('605#2F6060') for text in axis.take())
    axis.live(0.6)
    assert '605#2F60600008000000' in axis.take()


def test_a_quick_stop_that_ends_by_itself_is_not_cut_short_when_found() -> None:
    axis = Axis()
    axis.drive.becomes(axis.drive.QUICK_STOP)
    status = int.from_bytes(axis.drive.objects[0x6041, 0], 'little') | 0x0400
    axis.drive.objects[0x6041, 0] = status.to_bytes(2, 'little')
    axis.start()
    assert '605#2B40600000000000' not in axis.take()


def test_one_that_holds_when_found_stands_when_its_velocity_is_0() -> None:
    axis = Axis(objects={(0x605A, 0): b'\6\0'})
    axis.drive.becomes(axis.drive.QUICK_STOP)
    axis.start()
    assert '605#2B40600000000000' in axis.take()
    assert axis.session.online
