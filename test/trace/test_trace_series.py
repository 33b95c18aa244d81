# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Curves in bounded memory."""

import builders
from trace_builders import bridge

from drive_can_bridge.core.configuration import JointConfiguration
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.observer import Telegram, TelegramKind, Verdict
from drive_can_bridge.protocols.telegrams import Direction
from drive_can_bridge.trace.sinks import BitLanes, Curve, FaultMarks, Plotter


def test_a_short_curve_is_kept_as_it_is() -> None:
    curve = Curve('speed')
    for step in range(1000):
        curve.add(0.02 * step, float(step % 7))
    times, values = curve.points()
    assert values == [float(step % 7) for step in range(1000)]
    assert times[-1] == 0.02 * 999


def test_a_long_one_keeps_its_extremes_everywhere() -> None:
    curve = Curve('speed')
    for step in range(200_000):
        curve.add(0.02 * step, 1000.0 if step % 20_000 == 137 else float(step % 2))
    times, values = curve.points()
    assert 2000 < len(times) <= 8192
    assert times == sorted(times)
    peaks = [time for time, value in zip(times, values) if value == 1000.0]
    assert peaks == [0.02 * (20_000 * peak + 137) for peak in range(10)]
    # no part of the time is thinner than another
    assert max(after - before for before, after in zip(times, times[1:])) < 4000 / 1000


STATUS = Parameter('status_word', number=211, bits=(('enabled', 1), ('fault', 3)))


def telegram(time: float, raw: int, verdict: Verdict = Verdict.NORMAL) -> Telegram:
    return Telegram(time, 'lift', Direction.RESPONSE, TelegramKind.CYCLIC, 'cyclic response',
                    (STATUS,),
                    () if verdict is Verdict.LOST else (raw,), verdict)


def test_what_went_wrong_is_marked() -> None:
    marks = FaultMarks()
    for time, raw in ((0.0, 2), (1.0, 8), (2.0, 10), (3.0, 2), (5.0, 8), (6.0, 8)):
        marks.add(time, telegram(time, raw))
    marks.add(4.0, telegram(4.0, 0, Verdict.LOST))
    marks.add(4.5, telegram(4.5, 8, Verdict.MALFORMED))
    assert marks.lost == [4.0]
    assert marks.faults == [(1.0, 3.0), (5.0, 6.0)], 'the last one to the end of the trace'


def test_a_word_has_a_lane_for_each_bit() -> None:
    lanes = BitLanes('lift.status_word', STATUS.bits, (Curve('enabled'), Curve('fault')))
    for time, raw in ((0.0, 0), (1.0, 2), (2.0, 10)):
        lanes.add(time, raw)
    assert [curve.points() for curve in lanes.curves] == [
        ([0.0, 1.0, 2.0], [0.0, 0.8, 0.8]), ([0.0, 1.0, 2.0], [1.0, 1.0, 1.8])]


def test_the_position_of_a_joint_that_turns_on_and_on_goes_on_in_a_picture() -> None:
    place = builders.parameter('place', 214, type=builders.INT16, scale=0.5, unit='rev')
    drive = builders.drive(
        table=(place,), response=(place,), period=0.1, missed_limit=2,
        joint=JointConfiguration('wheel', position='place', continuous=True))
    plotter = Plotter(bridge(drive), ['conveyor.place'], [])
    # a counter of 16 bits that begins again; after a loss the drive has the word
    for time, raw in ((5.0, 32766), (5.1, -32766), (5.2, -32764), (6.0, 8), (6.1, 10)):
        plotter('main', Telegram(time, 'conveyor', Direction.RESPONSE, TelegramKind.CYCLIC,
                                 'cyclic response', (place,), (raw,)))
    curve, = plotter._curves.values()
    assert [round(time, 6) for time in curve.points()[0]] == [0.0, 0.1, 0.2, 1.0, 1.1]
    assert curve.points()[1] == [16383.0, 16385.0, 16386.0, 4.0, 5.0]
