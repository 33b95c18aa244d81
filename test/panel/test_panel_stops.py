# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a drive without a quick stop is offered, and what becomes of it when all are stopped."""

import asyncio
from collections.abc import Callable, Iterator
from functools import partial
import html

from panel_builders import Site
from panel_somebody import Somebody
import pytest
from waiting import wait_for

from drive_can_bridge.monitor.model import Model
from drive_can_bridge.monitor.reports import Level
from drive_can_bridge.monitor.snapshot import DriveSnapshot
from drive_can_bridge.monitor.source import Outcome, Stop

pytest.importorskip('rclpy')
pytest.importorskip('nicegui', reason="needs the extra 'panel'")

REFUSED = ('no quick stop: the profile has no quick_stop word; '
           '~/enable false disables the drive')


@pytest.fixture
def somebody(site: Site) -> Iterator[Somebody]:
    """Return somebody else who enables drives."""
    other = Somebody()
    yield other
    other.close()


def offered(site: Site, page: str, drive: str) -> set[str]:
    """Return the stops that a page of an operator has a button for."""
    text = html.unescape(site.get(page, 'operator').text).replace('\\"', '"')
    return {stop.value for stop in Stop if f'panel.stop("{stop.value}", "{drive}"' in text}


@pytest.mark.parametrize(('drive', 'stops'), [
    ('/lift', {'quick_stop', 'disable'}), ('/press', {'disable'}), ('/conveyor', set())])
def test_only_what_a_drive_has_is_offered(site: Site, drive: str, stops: set[str]) -> None:
    wait_for(lambda: offered(site, '/', '/lift'), 'what the bridge says of its drives')
    for page in ('/', f'/drive{drive}'):
        assert offered(site, page, drive) == stops


def test_nothing_with_control_runs_on_when_all_are_stopped(
        site: Site, somebody: Somebody) -> None:
    for drive in ('/lift', '/press'):
        somebody.enables(drive)
    # the control word comes first in the cyclic request of stations 2 and 3
    enabled = '0001'
    assert control_word(site, '005FFFF0') == control_word(site, '007FFFF0') == enabled
    said = site.do('quick_stop', 'operator', {'drive': '*'}).said
    assert said['success'] is True
    assert said['text'].splitlines() == [
        'lift: ready', 'press: has no quick stop, told to disable: ready',
        'conveyor: not told, it has no control word']
    for identifier in ('005FFFF0', '007FFFF0'):
        wait_for(partial(disabled, site, identifier), 'that it is disabled')


def test_of_one_drive_it_is_refused_as_the_bridge_says_it(
        site: Site, somebody: Somebody) -> None:
    somebody.enables('/press')
    said = site.do('quick_stop', 'operator', {'drive': '/press'}).said
    assert said == {'success': False, 'text': REFUSED}
    assert site.do('disable', 'operator', {'drive': '/press'}).said['success'] is True


class Asked:
    """
    Operations that note what they are asked for.

    :param answers: to each stop.
    """

    def __init__(self, **answers: Outcome) -> None:
        self._answers = answers
        self.stops: list[Stop] = []

    def stop(self, drive: str, stop: Stop, done: Callable[[Outcome], None], now: float) -> None:
        """Answer at once."""
        self.stops.append(stop)
        done(self._answers[stop.value])


@pytest.mark.parametrize(('facts', 'refusal', 'asked', 'outcome'), [
    # as a bridge says it, and one that does not say it yet
    ({'quick_stop': 'none'}, REFUSED, [Stop.DISABLE],
     Outcome(True, 'has no quick stop, told to disable: ready')),
    ({}, REFUSED, [Stop.QUICK_STOP, Stop.DISABLE],
     Outcome(True, 'has no quick stop, told to disable: ready')),
    # a drive that is braking is not to be let go
    ({'quick_stop': 'available'}, 'no confirmation in 2 s', [Stop.QUICK_STOP],
     Outcome(False, 'no confirmation in 2 s'))])
def test_what_has_no_quick_stop_is_disabled(
        facts: dict[str, str], refusal: str, asked: list[Stop], outcome: Outcome) -> None:
    from drive_can_bridge.panel.feed import Feed
    operations = Asked(quick_stop=Outcome(False, refusal), disable=Outcome(True, 'ready'))
    drive = DriveSnapshot('/lift', 'lift', '/drive_can_bridge', 'online', Level.OK, True, '',
                          facts={'control_state': 'enabled', **facts})

    async def stopped() -> Outcome:
        feed = Feed(None, operations, Model())  # type: ignore[arg-type]
        return await feed.stop_as_it_can(drive, Stop.QUICK_STOP)
    assert asyncio.run(stopped()) == outcome
    assert operations.stops == asked


def disabled(site: Site, identifier: str) -> bool:
    """Tell whether that is what was sent last."""
    return control_word(site, identifier) == '0000'


def control_word(site: Site, identifier: str) -> str:
    """Return the control word of the newest request with an identifier."""
    lines = site.frame_log.read_text(encoding='ascii').splitlines()
    mark = f' {identifier}#'
    return next((line.partition(mark)[2][:4] for line in reversed(lines) if mark in line), '')
