# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a drive without a quick stop is offered, and what becomes of it when all are stopped."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
import html
import json
import signal
from typing import Any, TYPE_CHECKING

from clocks import REAL
from panel_builders import Site
from panel_somebody import Somebody
import pytest
from waiting import wait_for

from drive_can_bridge.core.sentences import may_still_be_running
from drive_can_bridge.monitor.model import Model
from drive_can_bridge.monitor.snapshot import (
    DriveSnapshot, Level, OperationOutcome, Snapshot, StopAction)

if TYPE_CHECKING:
    from panel_bench import House

pytest.importorskip('rclpy')
pytest.importorskip('nicegui', reason="needs the extra 'panel'")


def offered(house: 'House', page: str, drive: str) -> set[str]:
    """Return the stops that a page of an operator has a button for."""
    text = html.unescape(house.get(page, 'operator').text).replace('\\"', '"')
    return {stop.value for stop in StopAction if f'panel.stop("{stop.value}", "{drive}"' in text}


@pytest.mark.parametrize(('drive', 'stops'), [
    ('/lift', {'quick_stop', 'disable'}), ('/press', {'quick_stop', 'disable'}),
    ('/conveyor', {'quick_stop'})])
def test_a_quick_stop_is_offered_of_every_drive(
        house: 'House', drive: str, stops: set[str]) -> None:
    for page in ('/', f'/drive{drive}'):
        assert offered(house, page, drive) == stops


def test_nothing_with_control_runs_on_when_all_are_stopped(
        site: Site, somebody: Somebody) -> None:
    for drive in ('/lift', '/press'):
        somebody.enables(drive)
    # the control word comes first in the cyclic request of stations 2 and 3
    enabled = '0001'
    for identifier in ('005FFFF0', '007FFFF0'):     # who writes the trace may be behind
        wait_for(lambda at=identifier: control_word(site, at) == enabled, 'that it is enabled')
    said = site.do('quick_stop', 'operator', {'drive': '*'}).said
    assert (said['success'], said['failed']) == (True, [])
    for identifier in ('005FFFF0', '007FFFF0'):
        wait_for(partial(disabled, site, identifier), 'that it is disabled')


def test_what_reaches_nobody_is_said(site: Site) -> None:
    assert site.bridge.end(signal.SIGKILL) == -signal.SIGKILL
    # of one drive and of all; each takes its time-out, so at once
    with ThreadPoolExecutor() as pool:
        for said in pool.map(lambda wanted: site.do(wanted[0], 'operator', {
                'drive': wanted[1]}).said, (('disable', '/lift'), ('quick_stop', '*'))):
            assert said['success'] is False
            assert may_still_be_running('') in said['text']
    site.bridge = site.start_bridge()
    # what is sent before is not heard, and waited for in vain
    wait_for(lambda: 'active: 3 drives' in site.bridge.errors, 'the bridge')
    wait_for(lambda: site.do('disable', 'operator', {'drive': '/lift'}).said['success'],
             'the bridge that is back')
    site.check_alive()


class Asked:
    """
    Operations that note what they are asked for.

    :param answers: to each stop.
    """

    def __init__(self, **answers: OperationOutcome) -> None:
        self._answers = answers
        self.stops: list[StopAction] = []

    def stop(self, drive: str, stop: StopAction, done: Callable[[OperationOutcome], None],
             now: float) -> None:
        """Answer at once."""
        self.stops.append(stop)
        done(self._answers[stop.value])


def test_a_drive_that_is_braking_is_not_let_go() -> None:
    refused = OperationOutcome(False, 'no confirmation in 2 s')
    operations = Asked(quick_stop=refused, disable=OperationOutcome(True, 'ready'))
    assert asyncio.run(feed_of(operations).stop(seen('lift'), StopAction.QUICK_STOP)) == refused
    assert operations.stops == [StopAction.QUICK_STOP]


class Some(Asked):
    """Stops those drives whose names are not among its answers."""

    def stop(self, drive: str, stop: StopAction, done: Callable[[OperationOutcome], None],
             now: float) -> None:
        done(self._answers.get(drive[1:],
                               OperationOutcome(True, 'neutral; it has no control word')))


@pytest.mark.parametrize(('names', 'failing', 'text'), [
    ('abc', {}, '3 of 3 drives stopped'),
    ('abc', {'b': 'no answer: offline', 'c': ''},
     'b: no answer: offline\nc: not stopped\n1 of 3 drives stopped'),
    ('', {}, 'no drive is known here: nothing was stopped')])
def test_the_number_of_those_that_stand_comes_behind_those_that_do_not(
        names: str, failing: dict[str, str], text: str) -> None:
    from drive_can_bridge.panel.actions import Actions
    feed = feed_of(Some(**{name: OperationOutcome(False, each) for name, each in failing.items()}))
    feed.snapshot = Snapshot(drives=tuple(map(seen, names)))
    actions = Actions(feed, allow_writes=False)
    said = json.loads(asyncio.run(actions._stop_all()).body)
    assert said == {'success': bool(names) and not failing, 'text': text,
                    'failed': text.splitlines()[:len(failing)]}


def test_drives_that_no_bridge_tells_of_are_stopped_too() -> None:
    from drive_can_bridge.panel.actions import Actions
    feed = feed_of(Some(**{'cell/c': OperationOutcome(False, 'nobody answered')}))
    feed.snapshot = Snapshot(drives=(seen('a'),), unheard={'/cell/b': 0.0, '/cell/c': 9.0})
    said = json.loads(asyncio.run(Actions(feed, allow_writes=False)._stop_all()).body)
    assert said == {'success': False, 'failed': ['cell/c: nobody answered'],
                    'text': 'cell/c: nobody answered\n2 of 3 drives stopped'}


def feed_of(operations: Asked) -> Any:
    from drive_can_bridge.panel.feed import Feed
    return Feed(None, operations, Model(), REAL)  # type: ignore[arg-type]


def seen(name: str) -> DriveSnapshot:
    return DriveSnapshot(f'/{name}', name, '/drive_can_bridge', 'online', Level.OK, True, '',
                         facts={'control_state': 'enabled'})


def disabled(site: Site, identifier: str) -> bool:
    """Tell whether that is what was sent last."""
    return control_word(site, identifier) == '0000'


def control_word(site: Site, identifier: str) -> str:
    """Return the control word of the newest request with an identifier."""
    lines = site.frame_log.read_text(encoding='ascii').splitlines()
    mark = f' {identifier}#'
    return next((line.partition(mark)[2][:4] for line in reversed(lines) if mark in line), '')
