# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Colours, order, counts and advice, the same for all views."""

from collections.abc import Callable
from typing import Any

from monitor_builders import (
    AT, bus_status, drive_status, ENDED, ENDED_IN_DOUBT, fifteen_drives, model_of, NOW, seen,
    three_drives,
)
import pytest
from transcripts import replayed, stories

from drive_can_bridge.monitor.model import Model
from drive_can_bridge.monitor.snapshot import Status
from drive_can_bridge.monitor.summary import (
    counts_in_words, in_order, silence, Tone, tone_of, troubles,
)

STORIES = stories(__file__, 'summary.yaml')


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


def alike(text: str, *others: Status) -> Model:
    """Return two drives with the same advice, but for their names."""
    return model_of([*others, *(
        drive_status(name, level=1, state='not armed', message=text.format(name))
        for name in ('line', 'on'))])


def two_bridges() -> Model:
    """Return one that goes on, and one that does not."""
    model = model_of([drive_status(), drive_status('hoist', bridge='cell/drive_can_bridge')])
    model.diagnosed([drive_status()], AT + 7.0, NOW + 7.0)
    return model


def unheard() -> Model:
    """Return drives in the graph that no bridge tells of, but for one."""
    model = model_of([drive_status()])
    model.noticed(['/cell/lift', '/cell/saw', f'/{model.drives[0][1:]}'], NOW)
    return model


def ended(lift: dict[str, Any] = ENDED, **options: bool) -> Model:
    """Return a bridge that has taken its leave; what it said of one drive."""
    model = Model(**options)
    model.diagnosed([bus_status(), drive_status(**ENDED), drive_status('lift', **lift),
                     drive_status('hoist', **ENDED)], AT, NOW)
    return model


DRIVES: dict[str, Callable[[], Model]] = {
    'unheard': unheard, 'ended': ended, 'ended_in_doubt': lambda: ended(ENDED_IN_DOUBT),
    'ended_of_two': lambda: ended({}), 'ended_here': lambda: ended(started_here=True),
    'fifteen': fifteen_drives, 'three': three_drives, 'nobody': Model, 'two_bridges': two_bridges,
    'with_files': lambda: alike('call ~/enable (drive_can enable {0}) of an online {0}.yaml'),
    'with_bus_off': lambda: alike('enable {}, online', bus_status(level=2, message='bus off'))}


@pytest.mark.parametrize('story', STORIES)
def test_lines(story: str) -> None:
    def step(step: str) -> list[str]:
        drives, text = step.split()
        snapshot = DRIVES[drives]().look(NOW + float(text), AT + float(text))
        return [*silence(snapshot, lambda time: str(time - AT)), counts_in_words(snapshot.drives),
                *(f'{trouble.who}{trouble.text}' for trouble in troubles(snapshot))]
    assert replayed(STORIES[story], step) == STORIES[story]
