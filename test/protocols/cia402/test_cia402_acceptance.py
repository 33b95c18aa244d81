# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Sentences of the contract that only show where a drive is in the middle of something."""

from types import SimpleNamespace
from typing import Any

import pytest
from saying import says
from servo_builders import Axis
from test_cia402_modes import home, meet
from test_cia402_set_up import FITS
from test_cia402_stop import running, WATCH_OFF

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.messages import NOTHING
from drive_can_bridge.core.reporter import Reporter
from drive_can_bridge.core.statistics import DriveStatistics
from drive_can_bridge.protocols.canopen.sdo import describe
from drive_can_bridge.protocols.cia402.setpoint_handshake import SetpointHandshake


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
    assert '605#2B40600000000000' not in axis.take()
    axis.live(0.5)
    assert '605#2B40600000000000' in axis.take()
    assert axis.session.online


def test_a_drive_that_brakes_may_miss_some_cycles_of_its_stop() -> None:
    axis = running()
    axis.drive.ramp = 100
    axis.take()
    axis.deliver(axis.talk.deactivate(axis.now))
    axis.live(0.2)
    axis.mute = True
    axis.live(0.02)
    axis.mute = False
    axis.live(5.0)
    sent = axis.take()
    assert sent.count('205#070000000000') >= 100
    assert '205#060000000000' in sent
    assert sent[-1] == WATCH_OFF


@pytest.mark.parametrize('kind', [0xFF, 0xFE])
def test_a_fixed_drive_that_fits_but_for_the_type_of_its_rpdo(kind: int) -> None:
    axis = Axis(objects={**FITS, (0x1400, 2): bytes([kind])})
    axis.drive.fixed = dict.fromkeys(FITS, 0x06010000)
    axis.start()
    assert '605#2F00140201000000' in axis.take()
    assert axis.session.online


CONTENTS = [place for place in FITS if place[0] in (0x1600, 0x1A00)]


@pytest.mark.parametrize('fixed', [CONTENTS, [*CONTENTS, (0x1800, 1)]])
def test_a_fixed_mapping_that_fits_but_for_types_that_can_be_written(
        fixed: list[tuple[int, int]]) -> None:
    axis = Axis(objects={**FITS, (0x1400, 2): b'\xFF', (0x1800, 2): b'\xFF'})
    axis.drive.fixed = dict.fromkeys(fixed, 0x06010000)
    axis.start()
    sent = axis.take()
    assert '605#2F00140201000000' in sent and '605#2F00180201000000' in sent
    assert axis.session.online


@pytest.mark.parametrize(('fixed', 'refused'), [
    (CONTENTS, '1600h.00h'), ([*FITS], '1400h.01h')])
def test_a_fixed_mapping_that_does_not_fit_is_left_as_it_was_found(
        fixed: list[tuple[int, int]], refused: str) -> None:
    axis = Axis(objects={**FITS, (0x1600, 1): bytes.fromhex('10007160')})
    axis.drive.fixed = dict.fromkeys(fixed, 0x06010000)
    found = axis.drive.objects[0x1400, 1]
    axis.start()
    assert not axis.session.online
    assert axis.session.offline_advice == says('mapping_differs', how=says(
        'object_refused', what=refused, why=describe(0x06010000)))
    assert axis.drive.objects[0x1400, 1] == found


def test_bit_8_does_not_fall_without_bit_4_when_an_arming_is_taken_back() -> None:
    """Statuses come between two telegrams: TPDOs by event."""
    target: Any = SimpleNamespace(parameter=SimpleNamespace(index=0x607A, subindex=None),
                                  armed=True, raw=5000)
    rules: Any = SimpleNamespace(mode_bits=0, halted=False)
    handshake = SetpointHandshake(
        SimpleNamespace(items=[target]), rules, 2.0,  # type: ignore[arg-type]
        Reporter(DriveStatistics(), NOTHING))
    handshake.update(0x0027, 0.0)
    handshake.carried(0x003F, [5000])
    target.armed = False
    handshake.update(0x1027, 0.0)
    assert (rules.mode_bits, rules.halted) == (0x100, True)
    handshake.update(0x0027, 0.0)
    target.armed, target.raw = True, 6000
    handshake.update(0x0027, 0.0)
    assert rules.mode_bits == 0x30
    target.armed = False
    handshake.update(0x0027, 0.0)
    assert (rules.mode_bits, rules.halted) == (0x100, True)
