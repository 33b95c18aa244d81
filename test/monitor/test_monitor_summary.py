# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Colours, order, counts and advice, the same for all views."""

from monitor_builders import (
    AT, bus_status, drive_status, fifteen_drives, model_of, NOW, seen, three_drives,
)
import pytest

from drive_can_bridge.monitor.snapshot import Snapshot
from drive_can_bridge.monitor.summary import (
    counts, counts_in_words, in_order, silence, Tone, tone_of, troubles,
)


@pytest.mark.parametrize(('state', 'level', 'tone'), [
    ('online', 0, Tone.OK), ('disabled', 0, Tone.OFF), ('not armed', 1, Tone.WARN),
    ('disabled', 1, Tone.WARN), ('online', 1, Tone.WARN), ('fault', 2, Tone.ERROR),
    ('offline', 2, Tone.ERROR), ('mapping differs', 2, Tone.ERROR),
    ('offline', 3, Tone.ERROR),     # not seen since start
    ('something new', 0, Tone.OFF)])
def test_green_is_enabled_and_armed_and_nothing_else(state: str, level: int, tone: Tone) -> None:
    drive, = seen(model_of([drive_status(state=state, level=level)])).drives
    assert tone_of(drive) is tone


def test_many_are_sorted_and_few_are_not() -> None:
    names = [drive.label for drive in in_order(seen(fifteen_drives()).drives)]
    assert names == [f'axis_{number}' for number in (
        3, 8, 13, 14, 1, 4, 6, 7, 2, 5, 0, 9, 10, 11, 12)]
    assert [drive.label for drive in in_order(seen(three_drives()).drives)] == [
        'conveyor', 'lift', 'turntable']


def test_counts() -> None:
    drives = seen(fifteen_drives()).drives
    assert counts(drives) == [
        (Tone.ERROR, 'fault', 1), (Tone.ERROR, 'offline', 3), (Tone.WARN, 'not armed', 4),
        (Tone.OFF, 'disabled', 2), (Tone.OK, 'online', 5)]
    assert counts_in_words(drives) == (
        '15 drives: 1 fault, 3 offline, 4 not armed, 2 disabled, 5 online')
    assert counts_in_words([]) == '0 drives'


def said(snapshot: Snapshot) -> list[str]:
    return [f'{trouble.who}{trouble.text}' for trouble in troubles(snapshot)]


def test_equal_advice_is_given_once_and_the_worst_first() -> None:
    lines = said(seen(fifteen_drives()))
    assert lines[0] == 'axis_3: fault 7 overcurrent: remove its cause, then reset it'
    assert lines[1].startswith('2 drives silent since \N{HORIZONTAL ELLIPSIS}, was online before')
    assert lines[1].endswith('(axis_8, axis_13)')
    assert lines[2].startswith('axis_14: not seen since start')
    assert lines[3:] == ['4 drives not armed: publish 0 to /\N{HORIZONTAL ELLIPSIS}/command/'
                         'speed_setpoint (axis_1, axis_4, axis_6, axis_7)']


def test_names_are_taken_out_of_advice_as_whole_words() -> None:
    def unarmed(name: str) -> str:
        return f'call ~/enable (drive_can enable {name}) of an online {name}.yaml'
    lines = said(seen(model_of([
        drive_status(name, level=1, state='not armed', message=unarmed(name))
        for name in ('line', 'on')])))
    assert len(lines) == 2      # a file of its own is nobody else's
    lines = said(seen(model_of([bus_status(level=2, message='bus off'), *(
        drive_status(name, level=1, state='not armed', message=f'enable {name}, online')
        for name in ('line', 'on'))])))
    assert lines == ['bus main: bus off',
                     '2 drives enable \N{HORIZONTAL ELLIPSIS}, online (line, on)']


def test_a_silent_bridge_is_told_of_once() -> None:
    model = three_drives()
    assert silence(seen(model), str) == []
    snapshot = model.look(NOW + 7.0, AT)
    line, = silence(snapshot, str)
    assert line.startswith(f'bridge silent since {AT - 7.0}: ')
    assert line.endswith(': its drives may still be running; stop buttons have no effect')
    assert troubles(snapshot) == []
    assert {tone_of(drive) for drive in snapshot.drives} == {Tone.UNKNOWN}
    assert counts_in_words(snapshot.drives) == '3 drives: 3 unknown'


def test_of_several_bridges_the_silent_one_is_named() -> None:
    model = model_of([drive_status(), drive_status('hoist', bridge='cell/drive_can_bridge')])
    model.diagnosed([drive_status()], AT + 7.0, NOW + 7.0)
    line, = silence(model.look(NOW + 7.0, AT + 7.0), str)
    assert line.startswith('bridge /cell/drive_can_bridge silent since ')
